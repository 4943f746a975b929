//! `Laplacian`: stiffness and lumped mass, as SciPy's matrices.

use faer::sparse::{SparseColMat, Triplet};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use semfm::geom;
use semfm::geom::laplacian::{
    CloudSettings, LaplacianKind, TuftedSettings, cotan_laplacian, laplacian as build,
    point_cloud_laplacian, tufted_laplacian,
};

use crate::arrays_in::{self, Axis, within_memory};
use crate::interruptible::run;
use crate::mesh::{Reduced, from_any};
use crate::shared::Shared;
use crate::{arrays_out, errors};

/// Stiffness and lumped mass of a surface: ``L = M⁻¹ · stiffness`` is the Laplace–Beltrami operator.
///
/// The stiffness is symmetric, positive semidefinite (not negative, as in part of the literature)
/// and its rows sum to zero. The mass is positive and adds up to the surface area.
///
/// Parameters
/// ----------
/// stiffness : object
///     Any SciPy sparse matrix (n × n).
/// mass : (n,) array_like
///     The diagonal of M, positive.
///
/// See Also
/// --------
/// laplacian, tufted_laplacian, cotan_laplacian, point_cloud_laplacian
#[pyclass(frozen, module = "semfm")]
pub struct Laplacian {
    pub inner: Shared<geom::Laplacian>,
}

#[pymethods]
impl Laplacian {
    #[new]
    fn new(stiffness: &Bound<'_, PyAny>, mass: &Bound<'_, PyAny>) -> PyResult<Self> {
        let py = mass.py();
        let (mass, shape) = arrays_in::floats(mass, "mass", &[Axis::Any("n")])?;
        let n = shape[0];
        if let Some(i) = mass.iter().position(|&m| m <= 0.0) {
            let found = format!("{} at {i}", mass[i]);
            return Err(errors::invalid(py, "mass", "positive numbers", &found));
        }
        let wanted = "a SciPy sparse matrix";
        let coo = stiffness
            .call_method0("tocoo")
            .map_err(|_| errors::wrong_type("stiffness", wanted, stiffness))?;
        let found: (usize, usize) = coo.getattr("shape")?.extract()?;
        if found != (n, n) {
            let expected = format!("shape ({n}, {n}), as the mass has");
            return Err(errors::invalid(py, "stiffness", &expected, &format!("shape {found:?}")));
        }
        let entries = [Axis::Any("nnz")];
        let rows = arrays_in::ids(&coo.getattr("row")?, "stiffness.row", &entries)?.0;
        let columns = arrays_in::ids(&coo.getattr("col")?, "stiffness.col", &entries)?.0;
        let values = arrays_in::floats(&coo.getattr("data")?, "stiffness.data", &entries)?.0;
        let triplets: Vec<_> = rows
            .iter()
            .zip(&columns)
            .zip(values)
            .map(|((&i, &j), value)| Triplet::new(i as usize, j as usize, value))
            .collect();
        let stiffness = SparseColMat::try_new_from_triplets(n, n, &triplets)
            .map_err(|error| errors::internal(py, &format!("{error:?}")))?;
        Ok(Self { inner: Shared::new(geom::Laplacian { stiffness, mass }) })
    }

    /// int: number of vertices n.
    #[getter]
    fn n_vertices(&self) -> usize {
        self.inner.n_vertices()
    }

    /// (n,) float64 array: the diagonal of the mass matrix, a read-only view.
    #[getter]
    fn mass<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        arrays_out::vector(slf, |laplacian| laplacian.inner.mass.as_slice())
    }

    /// scipy.sparse.csc_matrix: stiffness (n × n); needs SciPy.
    #[getter]
    fn stiffness<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let py = slf.py();
        let data = arrays_out::vector(slf, |laplacian| laplacian.inner.stiffness.val())?;
        let matrix = &slf.get().inner.stiffness;
        let index =
            |ids: &[usize]| arrays_out::owned(py, ids.iter().map(|&id| id as i64).collect());
        let (rows, columns) = (index(matrix.row_idx()), index(matrix.col_ptr()));
        let options = PyDict::new(py);
        options.set_item("shape", (matrix.nrows(), matrix.ncols()))?;
        sparse(py)?.call_method("csc_matrix", ((data, rows, columns),), Some(&options))
    }

    /// scipy.sparse.csc_matrix: the mass as a diagonal matrix (n × n); needs SciPy.
    #[getter]
    fn mass_matrix<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let options = PyDict::new(slf.py());
        options.set_item("format", "csc")?;
        sparse(slf.py())?.call_method("diags", (Self::mass(slf)?,), Some(&options))
    }

    fn __repr__(&self) -> String {
        let entries = self.inner.stiffness.val().len();
        format!("Laplacian({} vertices, {entries} entries)", self.inner.n_vertices())
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Reduced<'py>> {
        let parts = (Self::stiffness(slf)?, Self::mass(slf)?);
        Ok((slf.get_type(), parts.into_pyobject(slf.py())?.into_any()))
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }
}

fn sparse(py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
    py.import("scipy.sparse").map(Bound::into_any).map_err(|error| {
        let message = "sparse matrices need SciPy: pip install scipy";
        let missing = errors::missing_package(py, "scipy", message);
        missing.set_cause(py, Some(error));
        missing
    })
}

/// Which Laplacian a name means.
pub fn kind_of(py: Python<'_>, name: &str) -> PyResult<LaplacianKind> {
    match name {
        "tufted" => Ok(LaplacianKind::Tufted),
        "cotan" => Ok(LaplacianKind::Cotan),
        other => {
            Err(errors::invalid(py, "laplacian", "'tufted' or 'cotan'", &format!("{other:?}")))
        }
    }
}

/// The Laplacian of a mesh.
///
/// Parameters
/// ----------
/// mesh : mesh_like
/// kind : str, default "tufted"
///     ``"tufted"`` (intrinsic Delaunay on the tufted cover, holds on any mesh) or ``"cotan"``.
///
/// Returns
/// -------
/// Laplacian
///
/// Examples
/// --------
/// >>> import semfm, semfm.zoo
/// >>> laplacian = semfm.laplacian(semfm.zoo.icosphere(2))
/// >>> bool(abs(laplacian.stiffness.sum()) < 1e-9)
/// True
#[pyfunction]
#[pyo3(signature = (mesh, kind="tufted"))]
pub fn laplacian(mesh: &Bound<'_, PyAny>, kind: &str) -> PyResult<Laplacian> {
    let kind = kind_of(mesh.py(), kind)?;
    make(mesh, move |mesh| build(mesh, kind))
}

/// The intrinsic Delaunay Laplacian of the tufted cover (Sharp & Crane 2020).
///
/// Parameters
/// ----------
/// mesh : mesh_like
/// mollify_factor : float, default 1e-5
///     By how much edges of degenerate triangles are made longer, relative to the mean edge.
///
/// Returns
/// -------
/// Laplacian
#[pyfunction]
#[pyo3(name = "tufted_laplacian", signature = (mesh, *, mollify_factor=1e-5))]
pub fn tufted_laplacian_(mesh: &Bound<'_, PyAny>, mollify_factor: f64) -> PyResult<Laplacian> {
    make(mesh, move |mesh| tufted_laplacian(mesh, &TuftedSettings { mollify_factor }))
}

/// The cotangent Laplacian of the triangles as they are.
///
/// Parameters
/// ----------
/// mesh : mesh_like
///
/// Returns
/// -------
/// Laplacian
#[pyfunction]
#[pyo3(name = "cotan_laplacian")]
pub fn cotan_laplacian_(mesh: &Bound<'_, PyAny>) -> PyResult<Laplacian> {
    make(mesh, cotan_laplacian)
}

/// The Laplacian of points sampled from a surface, without triangles (Sharp & Crane 2020).
///
/// Parameters
/// ----------
/// points : (n, 3) array_like
/// n_neighbors : int, default 30
///     Neighbours of each point that define its tangent plane and its triangles.
/// mollify_factor : float, default 1e-5
///     As in `tufted_laplacian`.
///
/// Returns
/// -------
/// Laplacian
#[pyfunction]
#[pyo3(name = "point_cloud_laplacian", signature = (points, *, n_neighbors=30, mollify_factor=1e-5))]
pub fn point_cloud_laplacian_(
    points: &Bound<'_, PyAny>,
    n_neighbors: usize,
    mollify_factor: f64,
) -> PyResult<Laplacian> {
    let py = points.py();
    let points = arrays_in::points(points, "points")?;
    // More neighbours than points are all of them.
    let n_neighbors = n_neighbors.min(points.len().max(3));
    within_memory(py, "n_neighbors", n_neighbors, 6 * points.len())?;
    let settings = CloudSettings { n_neighbors, mollify_factor };
    let laplacian = run(py, None, move |_| Ok(point_cloud_laplacian(&points, &settings)?))?;
    Ok(Laplacian { inner: Shared::new(laplacian) })
}

fn make(
    mesh: &Bound<'_, PyAny>,
    build: impl FnOnce(&semfm::Mesh) -> geom::Result<geom::Laplacian> + Send + 'static,
) -> PyResult<Laplacian> {
    let shared = from_any(mesh, "mesh")?;
    let laplacian = run(mesh.py(), None, move |_| Ok(build(&shared)?))?;
    Ok(Laplacian { inner: Shared::new(laplacian) })
}
