//! `Transfer`: a transferred region and everything known about it.

use std::path::PathBuf;
use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use semfm::files::{Provenance, TransferResult};
use semfm::fmap;
use semfm_show::{TransferFigure, TransferFiles, write_transfer};
use serde_json::{Value, json};

use crate::interruptible::run;
use crate::point_map::PointMap;
use crate::prepared::PreparedObject;
use crate::region::Region;
use crate::settings::TransferSettings;
use crate::shared::Shared;
use crate::{arrays_out, errors, json as dicts, pictures};

/// A transferred region and everything known about it.
///
/// Vertices are those of the meshes as given. Made by `transfer` and `Matching.transfer`.
#[pyclass(frozen, module = "semfm")]
pub struct Transfer {
    pub inner: Arc<semfm::Transfer>,
    pub source: PreparedObject,
    pub target: PreparedObject,
    pub region: Shared<semfm::Region>,
}

#[pymethods]
impl Transfer {
    /// Region: the region on the target.
    #[getter]
    fn region(&self) -> Region {
        Region { inner: Shared::part_of(&self.inner, |transfer| &transfer.region) }
    }

    /// (n_target,) float64 array: weight of each target vertex, a read-only view.
    #[getter]
    fn weights<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        arrays_out::vector(slf, |transfer| transfer.inner.weights())
    }

    /// float: the probability that the IoU with the true region is at least one half, in [0, 1].
    #[getter]
    fn confidence(&self) -> f64 {
        self.inner.confidence
    }

    /// str: ``"accept"``, ``"check"`` or ``"refuse"``.
    #[getter]
    fn verdict(&self) -> String {
        self.inner.verdict.to_string()
    }

    /// str, optional: why the answer is not accepted, where more is known than that it is doubtful.
    #[getter]
    fn why(&self) -> Option<&'static str> {
        self.inner.why()
    }

    /// list of Hypothesis: where the region may belong, by falling probability.
    #[getter]
    fn hypotheses(&self) -> Vec<Hypothesis> {
        self.inner.hypotheses.iter().map(Hypothesis::of).collect()
    }

    /// PointMap: one source vertex for each target vertex.
    #[getter]
    fn point_map(&self) -> PointMap {
        let n_source = self.source.inner.object.shape().original().n_vertices();
        PointMap { inner: Shared::part_of(&self.inner, |transfer| &transfer.point_map), n_source }
    }

    /// Region, optional: the region under the other rule, where the method computes both (``semfm``).
    #[getter]
    fn other_rule(&self) -> Option<Region> {
        let region = self.inner.other_rule.as_ref()?;
        Some(Region { inner: Shared::new(region.clone()) })
    }

    /// dict: how the answer came about: settings, stages, anchors, fit, quality of the map.
    #[getter]
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        dicts::to_python(py, &self.inner.report)
    }

    /// TransferSettings: the settings it was made with, map sizes clipped to the bases.
    #[getter]
    fn settings(&self) -> TransferSettings {
        TransferSettings { settings: self.inner.report.settings.clone() }
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
        Region { inner: self.region.clone() }
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
    /// pictures : bool, default True
    ///     Also draw ``transfer.png``, ``features.png`` and ``transfer.mcap``.
    /// progress : progress, optional
    ///
    /// Returns
    /// -------
    /// list of str
    ///     The files.
    #[pyo3(signature = (folder, *, about=None, pictures=true, progress=None))]
    fn write(
        &self,
        py: Python<'_>,
        folder: PathBuf,
        about: Option<&Bound<'_, PyDict>>,
        pictures: bool,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Vec<String>> {
        let which = if pictures { TransferFiles::All } else { TransferFiles::WithoutPictures };
        let about = about.map(|about| dicts::from_python(about, "about")).transpose()?;
        let version = Some(env!("CARGO_PKG_VERSION").to_owned());
        let mut provenance = Provenance { version, ..Provenance::default() };
        if let Some(Value::Object(about)) = about {
            provenance.more = about;
        }
        let (shared, region) = (self.inner.clone(), self.region.clone());
        let (source, target) = (self.source.inner.clone(), self.target.inner.clone());
        let files = run(py, progress, move |task| {
            let (source, target, transfer) = (&*source, &*target, &*shared);
            let (region, provenance) = (&*region, &provenance);
            let result = TransferResult { source, target, region, transfer, provenance };
            Ok(write_transfer(&folder, &result, which, task)?)
        })?;
        Ok(files.iter().map(|file| file.display().to_string()).collect())
    }

    /// A picture of both objects with the region, which notebooks show by themselves: `transfer.png` of
    /// `write`.
    ///
    /// Returns
    /// -------
    /// bytes
    ///     PNG.
    fn picture<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let (shared, region) = (self.inner.clone(), self.region.clone());
        let (source, target) = (self.source.inner.clone(), self.target.inner.clone());
        pictures::png(py, move |path, task| {
            let (source, target, transfer) = (&*source, &*target, &*shared);
            let (region, provenance) = (&*region, &Provenance::default());
            let result = TransferResult { source, target, region, transfer, provenance };
            Ok(TransferFigure::new(&result, task)?.write_transfer_picture(path, task)?)
        })
    }

    fn _repr_png_<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyBytes>> {
        pictures::shown(self.picture(py))
    }

    fn __repr__(&self) -> String {
        let (n, of) = (self.inner.region.vertices().len(), self.inner.region.n_vertices());
        let (verdict, confidence) = (self.verdict(), self.inner.confidence);
        format!("Transfer({verdict}, confidence {confidence:.2}, {n} of {of} vertices)")
    }

    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, (PreparedObject, PreparedObject, Region, Bound<'py, PyBytes>))>
    {
        let restore = py.import("semfm._semfm")?.getattr("_restore_transfer")?;
        let transfer = &*self.inner;
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
        inner: Arc::new(read().map_err(damaged)?),
        source: source.get().clone(),
        target: target.get().clone(),
        region: region.get().inner.clone(),
    })
}

/// One place where the region may belong.
#[pyclass(frozen, module = "semfm")]
pub struct Hypothesis {
    region: Shared<semfm::Region>,
    probability: f64,
}

impl Hypothesis {
    pub fn new(region: semfm::Region, probability: f64) -> Self {
        Self { region: Shared::new(region), probability }
    }

    pub fn of(hypothesis: &fmap::Hypothesis) -> Self {
        let fmap::Hypothesis { region, probability, .. } = hypothesis;
        Self { region: Shared::new(region.clone()), probability: *probability }
    }
}

#[pymethods]
impl Hypothesis {
    /// Region: the region there.
    #[getter]
    fn region(&self) -> Region {
        Region { inner: self.region.clone() }
    }

    /// float: share of the votes that fell there, among the hypotheses returned.
    #[getter]
    fn probability(&self) -> f64 {
        self.probability
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (Region, f64))> {
        let restore = py.import("semfm._semfm")?.getattr("_restore_hypothesis")?;
        Ok((restore, (self.region(), self.probability)))
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }

    fn __repr__(&self) -> String {
        let n = self.region.vertices().len();
        format!("Hypothesis({n} vertices, probability {:.2})", self.probability)
    }
}

/// A hypothesis out of a pickle.
#[pyfunction]
pub fn _restore_hypothesis(region: &Bound<'_, Region>, probability: f64) -> Hypothesis {
    Hypothesis { region: region.get().inner.clone(), probability }
}
