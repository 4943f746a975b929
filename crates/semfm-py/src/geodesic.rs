//! Distances along the surface, by the heat method.

use std::sync::Arc;

use pyo3::prelude::*;
use semfm::geom::geodesic::{self, HeatSettings};

use crate::arrays_in::{self, Axis, within_memory};
use crate::arrays_out;
use crate::interruptible::run;
use crate::laplacian::kind_of;
use crate::mesh::{Mesh, from_any};
use crate::shared::Shared;

/// Geodesic distances on one mesh (Crane, Weischedel & Wardetzky 2013): two matrices are factorised
/// once, then every question costs two triangular solves. Distances are those of the surface: vertices
/// at the same place (a UV seam, flat shading) are one point of it.
///
/// Parameters
/// ----------
/// mesh : mesh_like
/// kind : str, default "tufted"
///     The Laplacian: ``"tufted"`` or ``"cotan"``.
/// time : float, default 1.0
///     Diffusion time in squared mean edge lengths; larger is smoother and less exact.
///
/// Examples
/// --------
/// >>> import semfm, semfm.zoo
/// >>> heat = semfm.HeatGeodesics(semfm.zoo.icosphere(4))
/// >>> distances = heat.distances(0)
/// >>> float(distances[0]), round(float(distances.max()), 1)  # half a great circle
/// (0.0, 3.1)
#[pyclass(frozen, module = "semfm")]
pub struct HeatGeodesics {
    inner: Arc<geodesic::HeatGeodesics>,
    mesh: Shared<semfm::Mesh>,
    kind: String,
    time: f64,
}

#[pymethods]
impl HeatGeodesics {
    #[new]
    #[pyo3(signature = (mesh, *, kind="tufted", time=1.0))]
    fn new(mesh: &Bound<'_, PyAny>, kind: &str, time: f64) -> PyResult<Self> {
        let py = mesh.py();
        let settings = HeatSettings { kind: kind_of(py, kind)?, time };
        let mesh = from_any(mesh, "mesh")?;
        let of = mesh.clone();
        let shared = run(py, None, move |_| Ok(geodesic::HeatGeodesics::new(&of, &settings)?))?;
        Ok(Self { inner: Arc::new(shared), mesh, kind: kind.to_owned(), time })
    }

    /// Distance of every vertex from the nearest source.
    ///
    /// One source is good to about an edge length. Several far apart share one function; where that
    /// matters, take the minimum over `distances_from_each`.
    ///
    /// Parameters
    /// ----------
    /// sources : int or (s,) array_like
    ///     Vertex ids.
    ///
    /// Returns
    /// -------
    /// (n,) float64 array
    ///     In the units of the mesh; infinite on components without a source.
    fn distances<'py>(&self, sources: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let py = sources.py();
        let sources = ids(sources)?;
        let heat = self.inner.clone();
        let distances = run(py, None, move |_| Ok(heat.distances(&sources)?))?;
        Ok(arrays_out::owned(py, distances))
    }

    /// Distances from each source alone.
    ///
    /// Parameters
    /// ----------
    /// sources : int or (s,) array_like
    ///     Vertex ids.
    ///
    /// Returns
    /// -------
    /// (n, s) float64 array
    ///     One column per source.
    fn distances_from_each<'py>(&self, sources: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let py = sources.py();
        let sources = ids(sources)?;
        within_memory(py, "sources", sources.len(), self.inner.n_vertices())?;
        let heat = self.inner.clone();
        // In blocks, so that Ctrl-C leaves no long work behind.
        let blocks = run(py, None, move |task| {
            let block = |ids: &[u32]| {
                task.check()?;
                Ok(heat.distances_from_each(ids)?)
            };
            sources.chunks(64).map(block).collect::<semfm::Result<Vec<_>>>()
        })?;
        let blocks: Vec<_> = blocks
            .iter()
            .map(|block| arrays_out::owned_matrix(py, block.as_ref()))
            .collect::<PyResult<_>>()?;
        if blocks.is_empty() {
            return py.import("numpy")?.call_method1("zeros", ((self.inner.n_vertices(), 0),));
        }
        py.import("numpy")?.call_method1("concatenate", (blocks, 1))
    }

    /// int: number of vertices n.
    #[getter]
    fn n_vertices(&self) -> usize {
        self.inner.n_vertices()
    }

    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, (Mesh, String, f64))> {
        let restore = py.import("semfm._semfm")?.getattr("_restore_heat")?;
        Ok((restore, (Mesh { inner: self.mesh.clone() }, self.kind.clone(), self.time)))
    }
}

fn ids(sources: &Bound<'_, PyAny>) -> PyResult<Vec<u32>> {
    match sources.extract::<u32>() {
        Ok(single) => Ok(vec![single]),
        Err(_) => Ok(arrays_in::ids(sources, "sources", &[Axis::Any("s")])?.0),
    }
}

/// Distance of every vertex from the nearest source: `HeatGeodesics` for a single question.
///
/// Parameters
/// ----------
/// mesh : mesh_like
/// sources : int or (s,) array_like
///     Vertex ids.
/// kind : str, default "tufted"
///     The Laplacian: ``"tufted"`` or ``"cotan"``.
/// time : float, default 1.0
///     Diffusion time in squared mean edge lengths.
///
/// Returns
/// -------
/// (n,) float64 array
#[pyfunction]
#[pyo3(signature = (mesh, sources, *, kind="tufted", time=1.0))]
pub fn geodesic_distances<'py>(
    mesh: &Bound<'py, PyAny>,
    sources: &Bound<'py, PyAny>,
    kind: &str,
    time: f64,
) -> PyResult<Bound<'py, PyAny>> {
    HeatGeodesics::new(mesh, kind, time)?.distances(sources)
}

/// Geodesics out of a pickle: factorised again.
#[pyfunction]
pub fn _restore_heat(mesh: &Bound<'_, PyAny>, kind: &str, time: f64) -> PyResult<HeatGeodesics> {
    HeatGeodesics::new(mesh, kind, time)
}
