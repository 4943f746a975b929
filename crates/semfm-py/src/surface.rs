//! `SurfaceIndex`: nearest points and first hits; samples of the surface; the mesh zoo.

use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::{PyTuple, PyType};
use semfm::geom::math::DVec3;
use semfm::geom::sampling::{self, SurfaceSample};
use semfm_geom::zoo;

use crate::arrays_in::{self, within_memory};
use crate::interruptible::run;
use crate::mesh::{Mesh, from_any};
use crate::shared::Shared;
use crate::{arrays_out, errors};

/// A tree over the triangles of a mesh: built once, asked often.
///
/// Triangles without area are left out. Both sides of a triangle count, whatever its winding.
///
/// Parameters
/// ----------
/// mesh : mesh_like
///
/// Examples
/// --------
/// >>> import semfm
/// >>> mesh = semfm.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
/// >>> points, distances, faces, barycentric = semfm.SurfaceIndex(mesh).closest([[0.25, 0.25, 3]])
/// >>> float(distances[0]), barycentric.tolist()
/// (3.0, [[0.5, 0.25, 0.25]])
#[pyclass(frozen, module = "semfm")]
pub struct SurfaceIndex {
    mesh: Shared<semfm::Mesh>,
    index: Arc<semfm::geom::SurfaceIndex>,
}

#[pymethods]
impl SurfaceIndex {
    #[new]
    fn new(mesh: &Bound<'_, PyAny>) -> PyResult<Self> {
        let shared = from_any(mesh, "mesh")?;
        let of = shared.clone();
        let index = run(mesh.py(), None, move |_| Ok(semfm::geom::SurfaceIndex::new(&of)?))?;
        Ok(Self { mesh: shared, index: Arc::new(index) })
    }

    /// The point of the surface nearest to each query.
    ///
    /// Parameters
    /// ----------
    /// queries : (q, 3) array_like
    ///
    /// Returns
    /// -------
    /// points : (q, 3) float64 array
    /// distances : (q,) float64 array
    /// faces : (q,) uint32 array
    /// barycentric : (q, 3) float64 array
    fn closest<'py>(&self, queries: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyTuple>> {
        let py = queries.py();
        let points = arrays_in::points(queries, "queries")?;
        let index = self.index.clone();
        let asked = points.clone();
        let found = run(py, None, move |task| {
            let nearest = |(i, &p): (usize, &DVec3)| {
                if i.is_multiple_of(4096) {
                    task.check()?;
                }
                Ok(index.closest(p).ok_or(i))
            };
            asked.iter().enumerate().map(nearest).collect::<semfm::Result<Vec<_>>>()
        })?;
        let mut hits = Vec::with_capacity(found.len());
        for hit in found {
            hits.push(hit.map_err(|i| {
                errors::invalid(py, "queries", "finite numbers", &format!("{} at {i}", points[i]))
            })?);
        }
        let positions = hits.iter().flat_map(|hit| hit.point.to_array()).collect();
        let positions = arrays_out::owned_rows(py, positions, 3)?;
        let barycentric = hits.iter().flat_map(|hit| hit.barycentric).collect();
        let barycentric = arrays_out::owned_rows(py, barycentric, 3)?;
        let distances = arrays_out::owned(py, hits.iter().map(|hit| hit.distance).collect());
        let faces = arrays_out::owned(py, hits.iter().map(|hit| hit.face).collect::<Vec<u32>>());
        (positions, distances, faces, barycentric).into_pyobject(py)
    }

    /// The first triangle that each ray meets.
    ///
    /// Parameters
    /// ----------
    /// origins : (q, 3) array_like
    /// directions : (q, 3) array_like
    ///     Of any length but zero.
    ///
    /// Returns
    /// -------
    /// t : (q,) float64 array
    ///     The hit is at ``origin + t * direction``; infinite for a miss.
    /// faces : (q,) int32 array
    ///     Triangle, −1 for a miss.
    fn first_hit<'py>(
        &self,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyTuple>> {
        let py = origins.py();
        let origins = arrays_in::points(origins, "origins")?;
        let rows = [arrays_in::Axis::Is(origins.len()), arrays_in::Axis::Is(3)];
        let (directions, _) = arrays_in::floats(directions, "directions", &rows)?;
        let index = self.index.clone();
        let hits = run(py, None, move |_| {
            let (directions, _) = directions.as_chunks::<3>();
            let rays = origins.iter().zip(directions);
            Ok(rays.map(|(&o, &d)| index.first_hit(o, d.into())).collect::<Vec<_>>())
        })?;
        let t = hits.iter().map(|hit| hit.map_or(f64::INFINITY, |hit| hit.t)).collect();
        let faces = hits.iter().map(|hit| hit.map_or(-1, |hit| hit.face as i32)).collect();
        (arrays_out::owned::<f64>(py, t), arrays_out::owned::<i32>(py, faces)).into_pyobject(py)
    }

    /// Mesh: the mesh that was indexed.
    #[getter]
    fn mesh(&self) -> Mesh {
        Mesh { inner: self.mesh.clone() }
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> (Bound<'py, PyType>, (Mesh,)) {
        (slf.get_type(), (slf.get().mesh(),))
    }
}

/// Independent points, uniform by area.
///
/// Parameters
/// ----------
/// mesh : mesh_like
/// n : int
/// seed : int, default 0
///
/// Returns
/// -------
/// points : (n, 3) float64 array
/// normals : (n, 3) float64 array
///     Unit normals of the triangles.
/// faces : (n,) uint32 array
///     Triangle of each point.
#[pyfunction]
#[pyo3(signature = (mesh, n, *, seed=0))]
pub fn sample_uniform<'py>(
    mesh: &Bound<'py, PyAny>,
    n: usize,
    seed: u64,
) -> PyResult<Bound<'py, PyTuple>> {
    sample(mesh, n, move |mesh| sampling::sample_uniform(mesh, n, seed))
}

/// Points as far from each other as they can be, out of six times as many uniform ones.
///
/// Parameters
/// ----------
/// mesh : mesh_like
/// n : int
/// seed : int, default 0
///
/// Returns
/// -------
/// points : (n, 3) float64 array
/// normals : (n, 3) float64 array
///     Unit normals of the triangles.
/// faces : (n,) uint32 array
///     Triangle of each point.
///
/// Examples
/// --------
/// >>> import semfm, semfm.zoo
/// >>> points, normals, faces = semfm.sample_even(semfm.zoo.icosphere(2), 50)
/// >>> points.shape
/// (50, 3)
#[pyfunction]
#[pyo3(signature = (mesh, n, *, seed=0))]
pub fn sample_even<'py>(
    mesh: &Bound<'py, PyAny>,
    n: usize,
    seed: u64,
) -> PyResult<Bound<'py, PyTuple>> {
    sample(mesh, n, move |mesh| sampling::sample_even(mesh, n, seed))
}

fn sample<'py>(
    mesh: &Bound<'py, PyAny>,
    n: usize,
    draw: impl FnOnce(&semfm::Mesh) -> semfm::geom::Result<Vec<SurfaceSample>> + Send + 'static,
) -> PyResult<Bound<'py, PyTuple>> {
    let py = mesh.py();
    within_memory(py, "n", n, 64)?;
    let mesh = from_any(mesh, "mesh")?;
    let samples = run(py, None, move |_| Ok(draw(&mesh)?))?;
    let points: Vec<f64> = samples.iter().flat_map(|s| s.point.to_array()).collect();
    let normals: Vec<f64> = samples.iter().flat_map(|s| s.normal.to_array()).collect();
    let faces: Vec<u32> = samples.iter().map(|s| s.face).collect();
    let points = arrays_out::owned_rows(py, points, 3)?;
    let normals = arrays_out::owned_rows(py, normals, 3)?;
    (points, normals, arrays_out::owned(py, faces)).into_pyobject(py)
}

/// Ids of points, each the farthest from those before it, starting with point 0.
///
/// Parameters
/// ----------
/// points : (m, 3) array_like
/// n : int
///     How many; all of them where there are fewer.
///
/// Returns
/// -------
/// (n,) uint32 array
#[pyfunction]
pub fn farthest_points<'py>(points: &Bound<'py, PyAny>, n: usize) -> PyResult<Bound<'py, PyAny>> {
    let py = points.py();
    let (values, _) =
        arrays_in::floats(points, "points", &[arrays_in::Axis::Any("m"), arrays_in::Axis::Is(3)])?;
    let ids = run(py, None, move |_| {
        let points: Vec<DVec3> = values.as_chunks::<3>().0.iter().map(|&p| p.into()).collect();
        Ok(sampling::farthest_points(&points, n))
    })?;
    Ok(arrays_out::owned(py, ids))
}

/// A sphere of radius 1, from a subdivided icosahedron.
///
/// Parameters
/// ----------
/// subdivisions : int
///     0 to 7; each multiplies the triangles by four, from 20.
///
/// Returns
/// -------
/// Mesh
#[pyfunction]
pub fn icosphere(py: Python<'_>, subdivisions: usize) -> PyResult<Mesh> {
    if subdivisions > 7 {
        return Err(errors::invalid(py, "subdivisions", "0 to 7", &subdivisions.to_string()));
    }
    let mesh = run(py, None, move |_| Ok(zoo::icosphere(subdivisions)))?;
    Ok(Mesh { inner: Shared::new(mesh) })
}

/// A torus.
///
/// Parameters
/// ----------
/// n_around : int
///     Vertices around the axis, 3 to 2000.
/// n_across : int
///     Vertices around the tube, 3 to 2000.
///
/// Returns
/// -------
/// Mesh
#[pyfunction]
pub fn torus(py: Python<'_>, n_around: usize, n_across: usize) -> PyResult<Mesh> {
    for (name, count) in [("n_around", n_around), ("n_across", n_across)] {
        if !(3..=2000).contains(&count) {
            return Err(errors::invalid(py, name, "3 to 2000", &count.to_string()));
        }
    }
    let mesh = run(py, None, move |_| Ok(zoo::torus(n_around, n_across)))?;
    Ok(Mesh { inner: Shared::new(mesh) })
}
