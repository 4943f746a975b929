//! `Transfer`: a carried region and everything known about it.

use std::path::PathBuf;

use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use semfm::files::{Provenance, TransferResult};
use semfm::fmap;
use semfm_show::write_transfer;
use serde_json::{Value, json};

use crate::held::Held;
use crate::point_map::PointMap;
use crate::prepared::PreparedObject;
use crate::region::Region;
use crate::settings::TransferSettings;
use crate::work::run;
use crate::{errors, json as dicts, lend};

/// A carried region and everything known about it.
///
/// Vertices are those of the meshes as given. Made by `transfer` and `Matching.transfer`.
#[pyclass(frozen, module = "semfm")]
pub struct Transfer {
    pub held: Held<semfm::Transfer>,
    pub source: PreparedObject,
    pub target: PreparedObject,
    pub region: Held<semfm::Region>,
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
        self.held.verdict.to_string()
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
        let n_source = self.source.held.object.shape().original().n_vertices();
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
        let version = Some(env!("CARGO_PKG_VERSION").to_owned());
        let mut provenance = Provenance { version, ..Provenance::default() };
        if let Some(Value::Object(about)) = about {
            provenance.more = about;
        }
        let (held, region) = (self.held.clone(), self.region.clone());
        let (source, target) = (self.source.held.clone(), self.target.held.clone());
        let files = run(py, progress, move |task| {
            let (source, target, transfer) = (&*source, &*target, &*held);
            let (region, provenance) = (&*region, &provenance);
            let result = TransferResult { source, target, region, transfer, provenance };
            Ok(write_transfer(&folder, &result, task)?)
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
