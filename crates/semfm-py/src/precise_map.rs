//! `PreciseMap`: one point of the source's surface for each target vertex.

use pyo3::prelude::*;
use semfm::fmap;

use crate::arrays_in::{self, Axis};
use crate::arrays_out;
use crate::interruptible::guard;
use crate::mesh::Reduced;
use crate::point_map::PointMap;
use crate::shared::Shared;

/// A map target → source that sends each target vertex to a point on a source triangle.
///
/// Ezuz & Ben-Chen, "Deblurring and Denoising of Maps between Shapes", 2017. Made by
/// `FunctionalMap.to_precise_map`.
///
/// Parameters
/// ----------
/// face_of : (n_target,) array_like
///     Source triangle of each target vertex.
/// corners : (n_target, 3) array_like
///     The source vertices of those triangles.
/// barycentric : (n_target, 3) array_like
///     Coordinates on those vertices: at least 0, sum 1.
/// n_source : int
///     Number of source vertices.
///
/// See Also
/// --------
/// PointMap : the map of vertices to vertices.
#[pyclass(frozen, module = "semfm")]
pub struct PreciseMap {
    pub inner: fmap::PreciseMap,
}

#[pymethods]
impl PreciseMap {
    #[new]
    fn new(
        face_of: &Bound<'_, PyAny>,
        corners: &Bound<'_, PyAny>,
        barycentric: &Bound<'_, PyAny>,
        n_source: usize,
    ) -> PyResult<Self> {
        let (faces, _) = arrays_in::ids(face_of, "face_of", &[Axis::Any("n_target")])?;
        let axes = [Axis::Is(faces.len()), Axis::Is(3)];
        let (corners, _) = arrays_in::ids(corners, "corners", &axes)?;
        let (weights, _) = arrays_in::floats(barycentric, "barycentric", &axes)?;
        let corners = corners.as_chunks::<3>().0.to_vec();
        let weights = weights.as_chunks::<3>().0.to_vec();
        let inner = guard(face_of.py(), || {
            Ok(fmap::PreciseMap::from_corners(faces, corners, weights, n_source)?)
        })?;
        Ok(Self { inner })
    }

    /// (n_target,) uint32 array: the source triangle of each target vertex, a read-only view.
    #[getter]
    fn face_of<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        arrays_out::vector(slf, |map| map.inner.face_of())
    }

    /// (n_target, 3) uint32 array: the source vertices of those triangles, a read-only view.
    #[getter]
    fn corners<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        arrays_out::rows(slf, 3, |map| map.inner.corners().as_flattened())
    }

    /// (n_target, 3) float64 array: barycentric coordinates on those vertices, a read-only view.
    #[getter]
    fn barycentric<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        arrays_out::rows(slf, 3, |map| map.inner.barycentric().as_flattened())
    }

    /// int: number of source vertices.
    #[getter]
    fn n_source(&self) -> usize {
        self.inner.n_source()
    }

    /// int: number of target vertices.
    #[getter]
    fn n_target(&self) -> usize {
        self.inner.n_target()
    }

    /// A function on the source that is linear on its triangles, as the target's vertices find it.
    ///
    /// Parameters
    /// ----------
    /// function : (n_source,) array_like
    ///
    /// Returns
    /// -------
    /// (n_target,) float64 array
    fn pull_back<'py>(&self, function: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let axes = [Axis::Is(self.inner.n_source())];
        let (values, _) = arrays_in::floats(function, "function", &axes)?;
        Ok(arrays_out::owned(function.py(), self.inner.pull_back(&values)))
    }

    /// The map of vertices that takes the corner of largest weight.
    ///
    /// Returns
    /// -------
    /// PointMap
    fn to_point_map(&self) -> PointMap {
        let n_source = self.inner.n_source();
        PointMap { inner: Shared::new(self.inner.to_point_map()), n_source }
    }

    /// The map as a matrix (n_target × n_source) by rows, for
    /// ``scipy.sparse.csr_matrix((data, indices, indptr), shape)``.
    ///
    /// Returns
    /// -------
    /// data : (n,) float64 array
    /// indices : (n,) uint32 array
    /// indptr : (n_target + 1,) uint32 array
    fn to_csr<'py>(
        &self,
        py: Python<'py>,
    ) -> (Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>) {
        let sparse = self.inner.to_sparse();
        (
            arrays_out::owned(py, sparse.values),
            arrays_out::owned(py, sparse.columns),
            arrays_out::owned(py, sparse.starts),
        )
    }

    fn __len__(&self) -> usize {
        self.inner.n_target()
    }

    fn __repr__(&self) -> String {
        let (target, source) = (self.inner.n_target(), self.inner.n_source());
        format!("PreciseMap({target} target vertices → the surface of {source} source)")
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Self>().is_ok_and(|other| other.get().inner == self.inner)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Reduced<'py>> {
        let n_source = slf.get().inner.n_source();
        let parts = (Self::face_of(slf)?, Self::corners(slf)?, Self::barycentric(slf)?, n_source);
        Ok((slf.get_type(), parts.into_pyobject(slf.py())?.into_any()))
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }
}
