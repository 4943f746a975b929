//! `Matching`, `Transfer`, and the one-call door.

use std::path::PathBuf;
use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use self_cell::self_cell;
use semfm::fmap::Matching as Matched;
use semfm::output::write_transfer;
use semfm::{PipelineSettings, fmap};
use serde_json::{Map, Value, json};

use crate::anchors::Anchors;
use crate::cloud::SemanticCloud;
use crate::functional_map::FunctionalMap;
use crate::held::Held;
use crate::mesh::from_any;
use crate::point_map::PointMap;
use crate::prepared::{OwnedMeaning, PreparedObject, PreparedParts};
use crate::region::{Region, region_of};
use crate::settings::{Options, TransferSettings};
use crate::shape::check_shape_size;
use crate::work::run;
use crate::{errors, json as dicts, lend};

self_cell!(
    /// A matched pair with both objects, from which it borrows.
    struct MatchedPair {
        owner: (Arc<PreparedParts>, Arc<PreparedParts>),
        #[covariant]
        dependent: Matched,
    }
);

/// A matched pair: computed once, it carries any number of regions.
///
/// Parameters
/// ----------
/// source : PreparedObject
///     The demonstrated object.
/// target : PreparedObject
///     The one to act on.
/// method : str, optional
///     ``fused`` (where neither this nor `settings` is given), ``semfm``, ``anchored``,
///     ``sinkhorn``, ``nearest`` or ``wks``.
/// rule : str, optional
///     How a map carries the region: ``preimage`` (where none is given) or ``image``.
/// seed : int, optional
///     Of everything drawn by chance; 0 where none is given.
/// settings : TransferSettings, optional
///     Everything that can be set, in place of `method` and `rule`.
/// progress : progress, optional
///
/// Examples
/// --------
/// >>> import semfm
/// >>> mug, kettle = (semfm.demo_object("containers", instance=i, n_vertices=500) for i in (0, 1))
/// >>> source, target = (
/// ...     semfm.prepare(o.mesh, features=o.shared_features(), k=30) for o in (mug, kettle))
/// >>> matching = semfm.Matching(source, target)
/// >>> matching.transfer(mug.region).verdict in ("accept", "check", "refuse")
/// True
#[pyclass(frozen, module = "semfm")]
pub struct Matching {
    pair: Arc<MatchedPair>,
    source: PreparedObject,
    target: PreparedObject,
}

#[pymethods]
impl Matching {
    #[new]
    #[pyo3(signature = (
        source, target, *, method=None, rule=None, seed=None, settings=None, progress=None
    ))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments, one per setting")]
    fn new(
        py: Python<'_>,
        source: &Bound<'_, PreparedObject>,
        target: &Bound<'_, PreparedObject>,
        method: Option<&str>,
        rule: Option<&str>,
        seed: Option<u64>,
        settings: Option<&Bound<'_, TransferSettings>>,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let options =
            Options { method, rule, seed, settings, k: None, working_vertices: None, cache: None };
        let settings = options.pipeline(py)?.transfer;
        let (source, target) = (source.get().clone(), target.get().clone());
        run(py, progress, move |task| Self::of(source, target, &settings, task))
    }

    /// Carries one region.
    ///
    /// Parameters
    /// ----------
    /// region : Region or path
    ///     On the source's mesh as given.
    ///
    /// Returns
    /// -------
    /// Transfer
    fn transfer(&self, region: &Bound<'_, PyAny>) -> PyResult<Transfer> {
        let py = region.py();
        let region = region_of(region, &self.source.held.part(|o| o.shape.original()))?;
        let pair = Arc::clone(&self.pair);
        let (source, target) = (self.source.clone(), self.target.clone());
        run(py, None, move |_| {
            let carried = pair.borrow_dependent().transfer(&region)?;
            Ok(Transfer { held: Held::new(carried), source, target, region })
        })
    }

    /// Anchors: the paired parts of the two objects.
    #[getter]
    fn anchors(&self) -> Anchors {
        Anchors { held: Held::new(self.pair.borrow_dependent().anchors().clone()) }
    }

    /// FunctionalMap, optional: C between the working shapes; None for methods without a map.
    #[getter]
    fn functional_map(&self) -> Option<FunctionalMap> {
        let map = self.pair.borrow_dependent().functional_map()?;
        Some(FunctionalMap { held: Held::new(map.clone()) })
    }

    /// PointMap: target → source, between the working meshes.
    #[getter]
    fn working_point_map(&self) -> PointMap {
        let map = self.pair.borrow_dependent().working_point_map();
        let n_source = self.source.held.shape.mesh().n_vertices();
        PointMap { held: Held::new(map.clone()), n_source }
    }

    /// PreparedObject: the demonstrated object.
    #[getter]
    fn source(&self) -> PreparedObject {
        self.source.clone()
    }

    /// PreparedObject: the one to act on.
    #[getter]
    fn target(&self) -> PreparedObject {
        self.target.clone()
    }

    fn __repr__(&self) -> &'static str {
        "Matching(PreparedObject, PreparedObject)"
    }
}

impl Matching {
    fn of(
        source: PreparedObject,
        target: PreparedObject,
        settings: &fmap::TransferSettings,
        task: &semfm::Task,
    ) -> semfm::Result<Self> {
        let parts = |object: &PreparedObject| object.parts(&settings.clusters, task);
        let (on_source, on_target) = rayon::join(|| parts(&source), || parts(&target));
        let pair = MatchedPair::try_new((on_source?, on_target?), |(source, target)| {
            Matched::new(source.borrow_dependent(), target.borrow_dependent(), settings, task)
        })?;
        Ok(Self { pair: Arc::new(pair), source, target })
    }
}

/// A carried region and everything known about it.
///
/// Vertices are those of the meshes as given. Made by `transfer` and `Matching.transfer`.
#[pyclass(frozen, module = "semfm")]
pub struct Transfer {
    held: Held<semfm::Transfer>,
    source: PreparedObject,
    target: PreparedObject,
    region: Held<semfm::Region>,
}

#[pymethods]
impl Transfer {
    /// Region: the region on the target.
    #[getter]
    fn region(&self) -> Region {
        Region { held: self.held.part(|transfer| &transfer.region) }
    }

    /// (n_target,) float64 array: weight of each target vertex, a read-only view.
    #[getter]
    fn weights<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        lend::vector(slf, |transfer| transfer.held.weights())
    }

    /// float: agreement with an independent opinion, in [0, 1].
    #[getter]
    fn confidence(&self) -> f64 {
        self.held.confidence
    }

    /// str: ``"accept"``, ``"check"`` or ``"refuse"``.
    #[getter]
    fn verdict(&self) -> String {
        json!(self.held.verdict).as_str().unwrap_or_default().to_owned()
    }

    /// list of Hypothesis: where the region may belong, by falling probability.
    #[getter]
    fn hypotheses(&self) -> Vec<Hypothesis> {
        let hypothesis = |h: &fmap::Hypothesis| Hypothesis {
            region: Held::new(h.region.clone()),
            probability: h.probability,
        };
        self.held.hypotheses.iter().map(hypothesis).collect()
    }

    /// PointMap: one source vertex for each target vertex.
    #[getter]
    fn point_map(&self) -> PointMap {
        let n_source = self.source.held.shape.original().n_vertices();
        PointMap { held: self.held.part(|transfer| &transfer.point_map), n_source }
    }

    /// Region, optional: the region under the other rule, where the method computes both (``semfm``).
    #[getter]
    fn other_rule(&self) -> Option<Region> {
        let region = self.held.other_rule.as_ref()?;
        Some(Region { held: Held::new(region.clone()) })
    }

    /// dict: how the answer came about: settings, stages, anchors, fit, quality of the map.
    #[getter]
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        dicts::to_python(py, &self.held.report)
    }

    /// TransferSettings: the settings it was made with, map sizes clipped to the bases.
    #[getter]
    fn settings(&self) -> TransferSettings {
        TransferSettings { settings: self.held.report.settings.clone() }
    }

    /// PreparedObject: the demonstrated object.
    #[getter]
    fn source(&self) -> PreparedObject {
        self.source.clone()
    }

    /// PreparedObject: the one to act on.
    #[getter]
    fn target(&self) -> PreparedObject {
        self.target.clone()
    }

    /// Region: the demonstrated region.
    #[getter]
    fn source_region(&self) -> Region {
        Region { held: self.region.clone() }
    }

    /// Writes every file that `semfm-cli transfer` writes: region, report, point map, painted
    /// meshes, picture and scene.
    ///
    /// Parameters
    /// ----------
    /// folder : path
    ///     Made if it is not there.
    /// about : dict, optional
    ///     Put into the report as it is.
    /// progress : progress, optional
    ///
    /// Returns
    /// -------
    /// list of str
    ///     The files.
    #[pyo3(signature = (folder, *, about=None, progress=None))]
    fn write(
        &self,
        py: Python<'_>,
        folder: PathBuf,
        about: Option<&Bound<'_, PyDict>>,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Vec<String>> {
        let about = about.map(|about| dicts::from_python(about, "about")).transpose()?;
        let mut all = Map::new();
        all.insert("version".into(), json!(env!("CARGO_PKG_VERSION")));
        if let Some(Value::Object(about)) = about {
            all.extend(about);
        }
        let (held, region) = (self.held.clone(), self.region.clone());
        let (source, target) = (self.source.held.clone(), self.target.held.clone());
        let files = run(py, progress, move |task| {
            write_transfer(&folder, &source, &target, &region, &held, all, task)
        })?;
        Ok(files.iter().map(|file| file.display().to_string()).collect())
    }

    fn __repr__(&self) -> String {
        let (n, of) = (self.held.region.vertices().len(), self.held.region.n_vertices());
        let (verdict, confidence) = (self.verdict(), self.held.confidence);
        format!("Transfer({verdict}, confidence {confidence:.2}, {n} of {of} vertices)")
    }

    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, (PreparedObject, PreparedObject, Region, Bound<'py, PyBytes>))>
    {
        let restore = py.import("semfm._semfm")?.getattr("_restore_transfer")?;
        let transfer = &*self.held;
        let parts = json!({
            "region": transfer.region,
            "confidence": transfer.confidence,
            "verdict": transfer.verdict,
            "hypotheses": transfer.hypotheses,
            "point_map": transfer.point_map,
            "other_rule": transfer.other_rule,
            "report": transfer.report,
        });
        let bytes = PyBytes::new(py, parts.to_string().as_bytes());
        Ok((restore, (self.source(), self.target(), self.source_region(), bytes)))
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }
}

/// A transfer out of a pickle.
#[pyfunction]
pub fn _restore_transfer(
    source: &Bound<'_, PreparedObject>,
    target: &Bound<'_, PreparedObject>,
    region: &Bound<'_, Region>,
    bytes: &Bound<'_, PyBytes>,
) -> PyResult<Transfer> {
    let read = || -> serde_json::Result<semfm::Transfer> {
        let mut parts: Value = serde_json::from_slice(bytes.as_bytes())?;
        let mut take = |name: &str| parts[name].take();
        Ok(semfm::Transfer {
            region: serde_json::from_value(take("region"))?,
            confidence: serde_json::from_value(take("confidence"))?,
            verdict: serde_json::from_value(take("verdict"))?,
            hypotheses: serde_json::from_value(take("hypotheses"))?,
            point_map: serde_json::from_value(take("point_map"))?,
            other_rule: serde_json::from_value(take("other_rule"))?,
            report: serde_json::from_value(take("report"))?,
        })
    };
    let damaged = |error: serde_json::Error| {
        let expected = "bytes of this version of semfm";
        errors::invalid(source.py(), "pickled transfer", expected, &error.to_string())
    };
    Ok(Transfer {
        held: Held::new(read().map_err(damaged)?),
        source: source.get().clone(),
        target: target.get().clone(),
        region: region.get().held.clone(),
    })
}

/// One place where the region may belong.
#[pyclass(frozen, module = "semfm")]
pub struct Hypothesis {
    region: Held<semfm::Region>,
    probability: f64,
}

#[pymethods]
impl Hypothesis {
    /// Region: the region there.
    #[getter]
    fn region(&self) -> Region {
        Region { held: self.region.clone() }
    }

    /// float: share of the votes that fell there, among the hypotheses returned.
    #[getter]
    fn probability(&self) -> f64 {
        self.probability
    }

    fn __repr__(&self) -> String {
        let n = self.region.vertices().len();
        format!("Hypothesis({n} vertices, probability {:.2})", self.probability)
    }
}

/// One of the two objects, prepared or to be prepared.
enum Side {
    Ready(PreparedObject),
    Raw(Held<semfm::Mesh>, OwnedMeaning),
}

impl Side {
    fn of(
        value: &Bound<'_, PyAny>,
        name: &str,
        features: Option<&Bound<'_, PyAny>>,
        embeddings: Option<&Bound<'_, PyAny>>,
        cloud: Option<&Bound<'_, SemanticCloud>>,
        settings: &PipelineSettings,
    ) -> PyResult<Self> {
        let py = value.py();
        if let Ok(prepared) = value.cast::<PreparedObject>() {
            if features.is_some() || embeddings.is_some() || cloud.is_some() {
                let argument = format!("{name}_features");
                let expected = "nothing beside a PreparedObject, which has its features";
                return Err(errors::invalid(py, &argument, expected, "more"));
            }
            return Ok(Self::Ready(prepared.get().clone()));
        }
        let mesh = from_any(value, name)?;
        check_shape_size(py, mesh.n_vertices(), &settings.shape)?;
        let meaning =
            OwnedMeaning::of(py, &format!("{name}_"), &mesh, features, embeddings, cloud)?;
        Ok(Self::Raw(mesh, meaning))
    }

    fn mesh(&self) -> Held<semfm::Mesh> {
        match self {
            Self::Ready(object) => object.held.part(|object| object.shape.original()),
            Self::Raw(mesh, _) => mesh.clone(),
        }
    }

    fn prepare(
        self,
        settings: &PipelineSettings,
        task: &semfm::Task,
    ) -> semfm::Result<PreparedObject> {
        match self {
            Self::Ready(object) => Ok(object),
            Self::Raw(mesh, meaning) => meaning.prepare(&mesh, settings, task),
        }
    }
}

/// Carries a demonstrated region from one object to another.
///
/// Parameters
/// ----------
/// source : mesh_like or PreparedObject
///     The demonstrated object.
/// target : mesh_like or PreparedObject
///     The one to act on.
/// region : Region or path
///     Where the demonstration touched the source.
/// source_features : (n_source, d) array_like, optional
///     A feature vector per vertex, from anybody's network.
/// target_features : (n_target, d) array_like, optional
/// source_embeddings : Embeddings or path, optional
///     Patch embeddings of rendered views.
/// target_embeddings : Embeddings or path, optional
/// source_cloud : SemanticCloud, optional
///     Surface points with features, made by the caller.
/// target_cloud : SemanticCloud, optional
/// method : str, optional
///     ``fused`` (where neither this nor `settings` is given), ``semfm`` (the paper to the letter),
///     ``anchored``, ``sinkhorn``, ``nearest`` or ``wks``.
/// rule : str, optional
///     How a map carries the region: ``preimage`` (where none is given) or ``image``.
/// seed : int, optional
///     Of everything drawn by chance; 0 where none is given.
/// settings : TransferSettings, optional
///     Everything that can be set, in place of `method` and `rule`.
/// k : int, optional
///     Eigenpairs of each shape; 60, or what the mesh allows, where none is given.
/// working_vertices : int, optional
///     Simplify above this many vertices, 0 keeps them all; 10 000 where none is given.
/// cache : cache, optional
///     Where prepared shapes are kept: a folder, or True for the user's own.
/// progress : progress, optional
///
/// Returns
/// -------
/// Transfer
///     A region that lands nowhere is no error but the verdict ``"refuse"``.
///
/// Examples
/// --------
/// >>> import semfm
/// >>> mug, kettle = (semfm.demo_object("containers", instance=i, n_vertices=500) for i in (0, 1))
/// >>> carried = semfm.transfer(
/// ...     mug.mesh, kettle.mesh, mug.region,
/// ...     source_features=mug.shared_features(), target_features=kettle.shared_features())
/// >>> carried.region.n_vertices == kettle.mesh.n_vertices
/// True
#[pyfunction]
#[pyo3(signature = (
    source, target, region, *, source_features=None, target_features=None, source_embeddings=None,
    target_embeddings=None, source_cloud=None, target_cloud=None, method=None, rule=None, seed=None,
    settings=None, k=None, working_vertices=None, cache=None, progress=None
))]
#[expect(clippy::too_many_arguments, reason = "keyword arguments, one per setting")]
pub fn transfer(
    source: &Bound<'_, PyAny>,
    target: &Bound<'_, PyAny>,
    region: &Bound<'_, PyAny>,
    source_features: Option<&Bound<'_, PyAny>>,
    target_features: Option<&Bound<'_, PyAny>>,
    source_embeddings: Option<&Bound<'_, PyAny>>,
    target_embeddings: Option<&Bound<'_, PyAny>>,
    source_cloud: Option<&Bound<'_, SemanticCloud>>,
    target_cloud: Option<&Bound<'_, SemanticCloud>>,
    method: Option<&str>,
    rule: Option<&str>,
    seed: Option<u64>,
    settings: Option<&Bound<'_, TransferSettings>>,
    k: Option<usize>,
    working_vertices: Option<usize>,
    cache: Option<&Bound<'_, PyAny>>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Transfer> {
    let py = source.py();
    let options = Options { method, rule, seed, settings, k, working_vertices, cache };
    let settings = options.pipeline(py)?;
    let source =
        Side::of(source, "source", source_features, source_embeddings, source_cloud, &settings)?;
    let target =
        Side::of(target, "target", target_features, target_embeddings, target_cloud, &settings)?;
    let region = region_of(region, &source.mesh())?;
    let n = source.mesh().n_vertices();
    if region.n_vertices() != n {
        let expected = format!("a region of the source's {n} vertices");
        return Err(errors::invalid(py, "region", &expected, &region.n_vertices().to_string()));
    }
    run(py, progress, move |task| {
        let prepare = |side: Side| side.prepare(&settings, task);
        let (source, target) = rayon::join(|| prepare(source), || prepare(target));
        let (source, target) = (source?, target?);
        let matching = Matching::of(source.clone(), target.clone(), &settings.transfer, task)?;
        let carried = matching.pair.borrow_dependent().transfer(&region)?;
        Ok(Transfer { held: Held::new(carried), source, target, region })
    })
}
