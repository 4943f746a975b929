//! `PreparedObject`: shape and semantic cloud of one object, made once.

use std::sync::Arc;

use pyo3::prelude::*;
use semfm::encoder::rendered_views::Coloring;
use semfm::encoder::{BUILTIN_ENCODERS, OpenSettings, open_encoder};
use semfm::geom::{SemanticCloud as Cloud, ShapeCache};
use semfm::object_encoder::ObjectEncoder;
use semfm::{
    EncoderRecord, FeatureSource, PipelineSettings, PreparationReport, Prepared, Task, fmap,
};
use semfm_views::LiftReport;
use semfm_views::mcap::EmbeddingsFile;

use crate::arrays_in::{self, Axis};
use crate::cloud::{SemanticCloud, embeddings_of};
use crate::interruptible::{guard, run};
use crate::mesh::{GivenObject, Mesh};
use crate::settings::{Options, TransferSettings};
use crate::shape::{Shape, check_shape_size};
use crate::shared::Shared;
use crate::{errors, json};

/// An object ready to be matched: its shape and its semantic cloud.
///
/// Made by `prepare`. Semantic parts are cut at the first matching and kept.
#[pyclass(frozen, module = "semfm")]
#[derive(Clone)]
pub struct PreparedObject {
    pub inner: Arc<Prepared>,
}

impl PreparedObject {
    pub fn new(object: Prepared) -> Self {
        Self { inner: Arc::new(object) }
    }

    /// The mesh as given.
    pub fn mesh_inner(&self) -> Shared<semfm::Mesh> {
        Shared::part_of(self.inner.object.shape(), semfm_geom::Shape::original)
    }
}

#[pymethods]
impl PreparedObject {
    /// Mesh: the mesh as given.
    #[getter]
    fn mesh(&self) -> Mesh {
        Mesh { inner: self.mesh_inner() }
    }

    /// Shape: working mesh and eigenbasis.
    #[getter]
    fn shape(&self) -> Shape {
        Shape { inner: Arc::clone(self.inner.object.shape()) }
    }

    /// SemanticCloud: surface points with features.
    #[getter]
    fn cloud(&self) -> SemanticCloud {
        SemanticCloud { inner: Arc::clone(self.inner.object.cloud()) }
    }

    /// bool: whether the shape was read from the cache.
    #[getter(from_cache)]
    fn is_from_cache(&self) -> bool {
        self.inner.report.from_cache
    }

    /// dict, optional: name, version, rolls and number of views of the encoder behind the features; None where it is not known.
    #[getter]
    fn encoder<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.inner.report.encoder)
    }

    /// dict: milliseconds by stage.
    #[getter]
    fn stages_ms<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let stages: std::collections::BTreeMap<_, _> =
            self.inner.report.stages_ms.iter().copied().collect();
        json::to_python(py, &stages)
    }

    fn __repr__(&self) -> String {
        let (shape, cloud) = (self.inner.object.shape(), self.inner.object.cloud());
        let (n, points, dim) = (shape.original().n_vertices(), cloud.n_points(), cloud.dim());
        format!("PreparedObject({n} vertices, {points} points, dim {dim})")
    }

    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(
        Bound<'py, PyAny>,
        (
            Shape,
            Option<SemanticCloud>,
            bool,
            Option<(usize, Vec<usize>)>,
            Vec<(&'static str, f64)>,
            Bound<'py, PyAny>,
        ),
    )> {
        let restore = py.import("semfm._semfm")?.getattr("_restore_prepared")?;
        let report = &self.inner.report;
        let lifted = report.lifted.as_ref();
        let lifted = lifted.map(|lifted| (lifted.n_seen, lifted.lifted_by_view.clone()));
        let stages = report.stages_ms.clone();
        let encoder = self.encoder(py)?;
        let cloud = self.inner.object.has_features().then(|| self.cloud());
        Ok((restore, (self.shape(), cloud, report.from_cache, lifted, stages, encoder)))
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }
}

/// A prepared object out of a pickle.
#[pyfunction]
#[pyo3(signature = (shape, cloud, from_cache, lifted, stages_ms, encoder))]
pub fn _restore_prepared(
    py: Python<'_>,
    shape: &Bound<'_, Shape>,
    cloud: Option<&Bound<'_, SemanticCloud>>,
    from_cache: bool,
    lifted: Option<(usize, Vec<usize>)>,
    stages_ms: Vec<(String, f64)>,
    encoder: &Bound<'_, PyAny>,
) -> PyResult<PreparedObject> {
    let encoder: Option<EncoderRecord> =
        serde_json::from_value(json::from_python(encoder, "encoder")?).ok().flatten();
    let weights = encoder.as_ref().map(EncoderRecord::confidence_weights).unwrap_or_default();
    let stages_ms = stages_ms
        .iter()
        .map(|(name, ms)| match &**name {
            "views" => ("views", *ms),
            "embed" => ("embed", *ms),
            "lift" => ("lift", *ms),
            "shape" => ("shape", *ms),
            _ => ("prepare", *ms),
        })
        .collect();
    let shape = Arc::clone(&shape.get().inner);
    let cloud = cloud.map(|cloud| Arc::clone(&cloud.get().inner));
    let object = run(py, None, move |task| {
        Ok(match cloud {
            Some(cloud) => {
                fmap::PreparedObject::new(shape, cloud, task)?.with_confidence_weights(weights)
            }
            None => fmap::PreparedObject::without_features(shape, task)?,
        })
    })?;
    let lifted = lifted.map(|(n_seen, lifted_by_view)| LiftReport { n_seen, lifted_by_view });
    let report = PreparationReport { from_cache, lifted, encoder, stages_ms };
    Ok(PreparedObject::new(Prepared { object, report }))
}

/// Where an object's features come from, owned.
pub enum OwnedFeatures {
    Encoder(ObjectEncoder),
    /// An encoder that joins the embeddings of the other object of a pair.
    Beside(ObjectEncoder, Arc<EmbeddingsFile>),
    Views(Arc<EmbeddingsFile>),
    PerVertex(Vec<f32>),
    Cloud(Arc<Cloud>),
    Geometry,
}

impl OwnedFeatures {
    /// The one source of features that was given, of arguments whose names begin with `side`; an
    /// encoder where there is none of the others.
    pub fn of(
        py: Python<'_>,
        side: &str,
        mesh: &semfm::Mesh,
        given: &GivenFeatures<'_, '_>,
        settings: &PipelineSettings,
    ) -> PyResult<Self> {
        let GivenFeatures { features, embeddings, cloud, encoder, beside } = *given;
        if encoder.is_some() && (features.is_some() || embeddings.is_some() || cloud.is_some()) {
            let expected = "one of features, embeddings, cloud and encoder";
            return Err(errors::invalid(py, "encoder", expected, "several"));
        }
        match (features, embeddings, cloud) {
            (Some(features), None, None) => {
                let rows = [Axis::Is(mesh.n_vertices()), Axis::Any("d")];
                let (values, shape) =
                    arrays_in::floats32(features, &format!("{side}features"), &rows)?;
                if shape[1] == 0 {
                    let name = format!("{side}features");
                    return Err(errors::invalid(py, &name, "at least one column", "none"));
                }
                Ok(Self::PerVertex(values))
            }
            (None, Some(embeddings), None) => {
                let name = format!("{side}embeddings");
                Ok(Self::Views(embeddings_of(embeddings, &name, mesh)?))
            }
            (None, None, Some(cloud)) => Ok(Self::Cloud(cloud.get().inner.clone())),
            (None, None, None) => {
                if let Some(other) = beside {
                    let open = OpenSettings { quiet: true, ..OpenSettings::default() };
                    let made = ObjectEncoder::beside(other, encoder, &open, &settings.cache);
                    return Ok(Self::Beside(guard(py, || made)?, Arc::clone(other)));
                }
                let method = settings.transfer.method.info();
                if !method.reads_features && encoder.is_none() {
                    return Ok(Self::Geometry);
                }
                let rolls = method.features.rolls;
                let encoder = encoder_of(py, encoder, None, rolls, &settings.cache)?;
                Ok(Self::Encoder(encoder))
            }
            _ => {
                let expected = "one of features, embeddings and cloud";
                Err(errors::invalid(py, &format!("{side}features"), expected, "several"))
            }
        }
    }

    /// Prepares the object.
    pub fn prepare(
        &self,
        object: &GivenObject,
        settings: &PipelineSettings,
        task: &Task,
    ) -> semfm::Result<PreparedObject> {
        let mesh = &object.mesh;
        let source = match self {
            Self::Encoder(encoder) => {
                let encoded = encoder.embed(object.drawable(), Coloring::Grey, task)?;
                let prepared = encoded.prepare((**mesh).clone(), settings, task)?;
                return Ok(PreparedObject::new(prepared));
            }
            Self::Beside(encoder, other) => {
                let encoded = encoder.embed_beside(other, object.drawable(), task)?;
                let prepared = encoded.prepare((**mesh).clone(), settings, task)?;
                return Ok(PreparedObject::new(prepared));
            }
            Self::Views(file) => FeatureSource::from(&**file),
            Self::PerVertex(features) => FeatureSource::PerVertex(features),
            Self::Cloud(cloud) => FeatureSource::Cloud(Arc::clone(cloud)),
            Self::Geometry => FeatureSource::Geometry,
        };
        let prepared = semfm::prepare((**mesh).clone(), source, settings, task)?;
        Ok(PreparedObject::new(prepared))
    }
}

/// The arguments that say where an object's features come from.
#[derive(Clone, Copy)]
pub struct GivenFeatures<'a, 'py> {
    pub features: Option<&'a Bound<'py, PyAny>>,
    pub embeddings: Option<&'a Bound<'py, PyAny>>,
    pub cloud: Option<&'a Bound<'py, SemanticCloud>>,
    pub encoder: Option<&'a str>,
    /// The embeddings of the other object of a pair, where it alone has some.
    pub beside: Option<&'a Arc<EmbeddingsFile>>,
}

impl GivenFeatures<'_, '_> {
    /// Whether something says what the features are, but for an encoder.
    pub fn has_any(&self) -> bool {
        self.features.is_some() || self.embeddings.is_some() || self.cloud.is_some()
    }
}

/// The encoder of this name, the built-in one where none is given, for a method that asks for up to
/// `most_rolls` rotations where their number is not given.
pub fn encoder_of(
    py: Python<'_>,
    name: Option<&str>,
    rolls: Option<u32>,
    most_rolls: u32,
    cache: &ShapeCache,
) -> PyResult<ObjectEncoder> {
    let settings = OpenSettings { quiet: true, ..OpenSettings::default() };
    let name = name.unwrap_or(BUILTIN_ENCODERS[0].name);
    let encoder = guard(py, || Ok(open_encoder(name, &settings)?))?;
    let rolls = rolls.unwrap_or_else(|| encoder.wants().rolls_up_to(most_rolls));
    Ok(ObjectEncoder::new(encoder, cache).with_rolls(rolls))
}

/// Makes an object ready to be matched with any number of others.
///
/// Where neither features, embeddings nor a cloud are given, an encoder makes them.
///
/// Parameters
/// ----------
/// mesh : mesh_like or MeshFile
/// features : (n, d) array_like, optional
///     A feature vector per vertex, from any network.
/// embeddings : Embeddings or path, optional
///     Patch embeddings of rendered views of this very mesh.
/// cloud : SemanticCloud, optional
///     Surface points with features, made by the caller.
/// encoder : str, optional
///     Shown rendered views in grey: ``builtin`` (where nothing of all this is given), a ``.net``
///     file, a Hugging Face name, a local checkpoint, an ONNX encoder's JSON, or
///     ``package.module:Class``.
/// method : str, optional
///     Lift as this method does (``"wks"`` needs no features): ``"fused"`` where neither this nor `settings` is given.
/// settings : TransferSettings, optional
///     Lift as the method of these settings does.
/// k : int, optional
///     Eigenpairs; 60, or what the mesh allows, where none is given.
/// working_vertices : int, optional
///     Simplify above this many vertices, 0 keeps them all; 10 000 where none is given.
/// n_samples : int, optional
///     Points of the cloud; the method's own number where none is given.
/// seed : int, optional
///     Of everything drawn by chance; 0 where none is given.
/// cache : cache, optional
///     Where prepared shapes and embeddings are kept: a folder, or True for the user's own.
/// progress : progress, optional
///
/// Returns
/// -------
/// PreparedObject
///
/// Examples
/// --------
/// >>> import semfm
/// >>> demo = semfm.demo_object("tools", n_vertices=400)
/// >>> prepared = semfm.prepare(demo.mesh, features=demo.part_features(), k=20)
/// >>> prepared.cloud.dim == len(demo.part_names)
/// True
#[pyfunction]
#[pyo3(signature = (
    mesh, *, features=None, embeddings=None, cloud=None, encoder=None, method=None, settings=None,
    k=None, working_vertices=None, n_samples=None, seed=None, cache=None, progress=None
))]
#[expect(clippy::too_many_arguments, reason = "keyword arguments, one per setting")]
pub fn prepare(
    py: Python<'_>,
    mesh: &Bound<'_, PyAny>,
    features: Option<&Bound<'_, PyAny>>,
    embeddings: Option<&Bound<'_, PyAny>>,
    cloud: Option<&Bound<'_, SemanticCloud>>,
    encoder: Option<&str>,
    method: Option<&str>,
    settings: Option<&Bound<'_, TransferSettings>>,
    k: Option<usize>,
    working_vertices: Option<usize>,
    n_samples: Option<usize>,
    seed: Option<u64>,
    cache: Option<&Bound<'_, PyAny>>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<PreparedObject> {
    let options = Options {
        method,
        rule: None,
        seed,
        second_opinion: None,
        settings,
        k,
        working_vertices,
        cache,
    };
    let mut settings = options.pipeline(py)?;
    if let Some(n) = n_samples {
        arrays_in::within_memory(py, "n_samples", n, 1024)?;
        settings.lift.n_samples = n;
    }
    let object = GivenObject::of(mesh, "mesh")?;
    check_shape_size(py, object.mesh.n_vertices(), &settings.shape)?;
    let given = GivenFeatures { features, embeddings, cloud, encoder, beside: None };
    let features = OwnedFeatures::of(py, "", &object.mesh, &given, &settings)?;
    run(py, progress, move |task| features.prepare(&object, &settings, task))
}
