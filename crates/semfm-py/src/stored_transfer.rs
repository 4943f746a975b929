//! `StoredTransfer`: the folder of a transfer, read back.

use std::path::PathBuf;
use std::sync::Arc;

use pyo3::prelude::*;
use semfm::files::{self, HypothesisRecord};

use crate::interruptible::{guard, run};
use crate::mesh::Mesh;
use crate::point_map::PointMap;
use crate::region::Region;
use crate::shared::Shared;
use crate::transfer::Hypothesis;
use crate::{errors, json};

/// A transfer as its folder has it: what `semfm-cli transfer` and `Transfer.write` leave behind.
///
/// Made by `read_transfer`.
#[pyclass(frozen, module = "semfm")]
pub struct StoredTransfer {
    inner: Arc<files::StoredTransfer>,
    folder: PathBuf,
}

#[pymethods]
impl StoredTransfer {
    /// Mesh: the demonstrated object.
    #[getter]
    fn source(&self) -> Mesh {
        Mesh { inner: Shared::part_of(&self.inner, |files| &files.source) }
    }

    /// Mesh: the one to act on.
    #[getter]
    fn target(&self) -> Mesh {
        Mesh { inner: Shared::part_of(&self.inner, |files| &files.target) }
    }

    /// Region: the demonstrated region on the source, its weights to four digits.
    #[getter]
    fn source_region(&self, py: Python<'_>) -> PyResult<Region> {
        Ok(Region { inner: Shared::new(guard(py, || self.inner.source_region())?) })
    }

    /// Region: the region on the target, of the vertices that count with their weights.
    #[getter]
    pub fn region(&self, py: Python<'_>) -> PyResult<Region> {
        let path = self.folder.join("region.json");
        let region = &self.inner.region.region;
        Ok(Region { inner: Shared::new(guard(py, || region.region(&path, &self.inner.target))?) })
    }

    /// PointMap: one source vertex for each target vertex.
    #[getter]
    fn point_map(&self, py: Python<'_>) -> PyResult<PointMap> {
        PointMap::of_file(py, &self.inner.map)
    }

    /// float: the probability that the region is right.
    #[getter]
    fn confidence(&self) -> f64 {
        self.inner.region.confidence
    }

    /// str: ``"accept"``, ``"check"`` or ``"refuse"``.
    #[getter]
    fn verdict(&self) -> String {
        self.inner.region.verdict.to_string()
    }

    /// list of Hypothesis: where the region may belong, by falling probability.
    #[getter]
    fn hypotheses(&self, py: Python<'_>) -> PyResult<Vec<Hypothesis>> {
        let n = self.inner.target.n_vertices();
        let places = self.inner.region.hypotheses.iter();
        places
            .map(|HypothesisRecord { vertices, weights, probability }| {
                let mut all = vec![0.0; n];
                for (&v, &weight) in vertices.iter().zip(weights) {
                    let place = all.get_mut(v as usize).ok_or_else(|| {
                        let expected = format!("ids below {n}");
                        errors::invalid(py, "hypotheses", &expected, &v.to_string())
                    })?;
                    *place = weight;
                }
                let region = guard(py, || Ok(semfm::Region::from_weights(all)?))?;
                Ok(Hypothesis::new(region, *probability))
            })
            .collect()
    }

    /// dict: the content of `report.json`.
    #[getter]
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.inner.report.to_json())
    }

    fn __repr__(&self) -> String {
        let (verdict, confidence) = (self.verdict(), self.confidence());
        format!("StoredTransfer({}, {verdict}, confidence {confidence:.2})", self.folder.display())
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (PathBuf,))> {
        let read = py.import("semfm._semfm")?.getattr("read_transfer")?;
        Ok((read, (self.folder.clone(),)))
    }
}

/// Reads the folder of a transfer, and checks that its files belong together.
///
/// Parameters
/// ----------
/// folder : path
///     As `semfm-cli transfer -o` and `Transfer.write` make it.
///
/// Returns
/// -------
/// StoredTransfer
///
/// Examples
/// --------
/// >>> import tempfile
/// >>> import semfm
/// >>> mug, kettle = (semfm.demo_object("containers", instance=i, n_vertices=400) for i in (0, 1))
/// >>> result = semfm.transfer(
/// ...     mug.mesh, kettle.mesh, mug.region,
/// ...     source_features=mug.shared_features(), target_features=kettle.shared_features())
/// >>> with tempfile.TemporaryDirectory() as folder:
/// ...     _ = result.write(folder)
/// ...     again = semfm.read_transfer(folder)
/// >>> again.verdict == result.verdict and again.point_map == result.point_map
/// True
#[pyfunction]
pub fn read_transfer(py: Python<'_>, folder: PathBuf) -> PyResult<StoredTransfer> {
    let of = folder.clone();
    let inner = run(py, None, move |_| files::StoredTransfer::read(&of))?;
    Ok(StoredTransfer { inner: Arc::new(inner), folder })
}
