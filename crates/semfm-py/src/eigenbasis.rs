//! `Eigenbasis`: eigenvalues and eigenfunctions, lent to NumPy.

use std::path::PathBuf;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use semfm::geom;
use semfm::geom::eigensolver::{EigenSettings, eigenbasis as solve};

use crate::arrays_in::{self, Axis, within_memory};
use crate::interruptible::run;
use crate::laplacian::Laplacian;
use crate::mesh::Reduced;
use crate::shared::Shared;
use crate::{arrays_out, errors, json};

/// The first k eigenpairs of ``L φ = λ M φ``, ascending, orthonormal for the lumped mass M.
///
/// Parameters
/// ----------
/// values : (k,) array_like
///     Eigenvalues, ascending, never negative.
/// functions : (n, k) array_like
///     Eigenfunctions, one column each, with ``functions.T @ (mass[:, None] * functions) = I``.
/// mass : (n,) array_like
///     The diagonal of M, positive.
/// residuals : (k,) array_like, optional
///     Relative residuals; zeros where nothing is known about them.
///
/// See Also
/// --------
/// eigenbasis : computes one from a Laplacian.
/// Shape.basis : the one of a prepared mesh.
#[pyclass(frozen, module = "semfm")]
pub struct Eigenbasis {
    pub inner: Shared<geom::Eigenbasis>,
    /// Vertices of the mesh as given, where it is the basis of a shape.
    pub n_original: Option<usize>,
}

impl Eigenbasis {
    pub fn new_of(basis: geom::Eigenbasis) -> Self {
        Self { inner: Shared::new(basis), n_original: None }
    }

    /// One entry per vertex of the basis.
    pub fn rows(&self) -> Axis {
        let n = self.inner.n_vertices();
        self.n_original.map_or(Axis::Is(n), |n_original| Axis::Working { n, n_original })
    }
}

/// How far a basis that is given may be from orthonormal: what f32 files lose.
const ORTHONORMALITY: f64 = 1e-4;

#[pymethods]
impl Eigenbasis {
    #[new]
    #[pyo3(signature = (values, functions, mass, residuals=None))]
    fn new(
        values: &Bound<'_, PyAny>,
        functions: &Bound<'_, PyAny>,
        mass: &Bound<'_, PyAny>,
        residuals: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let py = values.py();
        let (values, shape) = arrays_in::floats(values, "values", &[Axis::Any("k")])?;
        let k = shape[0];
        let (mass, shape) = arrays_in::floats(mass, "mass", &[Axis::Any("n")])?;
        let n = shape[0];
        let functions = arrays_in::matrix(functions, "functions", [Axis::Is(n), Axis::Is(k)])?;
        let residuals = match residuals {
            Some(residuals) => arrays_in::floats(residuals, "residuals", &[Axis::Is(k)])?.0,
            None => vec![0.0; k],
        };
        if k == 0 || n == 0 {
            let found = format!("{k} pairs on {n} vertices");
            return Err(errors::invalid(py, "values", "at least one eigenpair", &found));
        }
        if !(values[0] >= 0.0 && values.is_sorted()) {
            let expected = "ascending numbers, none of them negative";
            return Err(errors::invalid(py, "values", expected, &format!("{values:.3?}")));
        }
        if let Some(i) = mass.iter().position(|&m| m <= 0.0) {
            let found = format!("{} at {i}", mass[i]);
            return Err(errors::invalid(py, "mass", "positive numbers", &found));
        }
        let basis = geom::Eigenbasis { values, functions, mass, residuals };
        let (basis, error) = run(py, None, move |_| {
            let error = basis.orthonormality_error();
            Ok((basis, error))
        })?;
        if error > ORTHONORMALITY {
            let expected = "functions orthonormal for the mass";
            let found = format!("|ΦᵀMΦ − I| up to {error:.1e}");
            return Err(errors::invalid(py, "functions", expected, &found));
        }
        Ok(Self::new_of(basis))
    }

    /// int: number of eigenpairs k.
    #[getter]
    fn k(&self) -> usize {
        self.inner.k()
    }

    /// int: number of vertices n.
    #[getter]
    fn n_vertices(&self) -> usize {
        self.inner.n_vertices()
    }

    /// (k,) float64 array: eigenvalues λ, ascending, a read-only view.
    #[getter]
    fn values<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        arrays_out::vector(slf, |basis| basis.inner.values.as_slice())
    }

    /// (n, k) float64 array: eigenfunctions Φ, one column each, a read-only view.
    #[getter]
    fn functions<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        arrays_out::matrix(slf, |basis| basis.inner.functions.as_ref())
    }

    /// (n,) float64 array: lumped mass, a read-only view.
    #[getter]
    fn mass<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        arrays_out::vector(slf, |basis| basis.inner.mass.as_slice())
    }

    /// (k,) float64 array: relative residuals of the pairs, a read-only view.
    #[getter]
    fn residuals<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        arrays_out::vector(slf, |basis| basis.inner.residuals.as_slice())
    }

    /// Largest entry of |ΦᵀMΦ − I|.
    ///
    /// Returns
    /// -------
    /// float
    fn orthonormality_error(&self, py: Python<'_>) -> PyResult<f64> {
        let basis = self.inner.clone();
        run(py, None, move |_| Ok(basis.orthonormality_error()))
    }

    /// Coefficients ΦᵀMF of functions on the vertices.
    ///
    /// Parameters
    /// ----------
    /// functions : (n,) or (n, p) array_like
    ///     On the working vertices, for the basis of a `Shape`: `Shape.onto_working` makes them of
    ///     functions on the mesh as given.
    ///
    /// Returns
    /// -------
    /// (k,) or (k, p) float64 array
    fn project<'py>(&self, functions: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let basis = self.inner.clone();
        columns(functions, "functions", self.rows(), move |f| basis.project_all(f))
    }

    /// The functions ΦA with the coefficients A, of which there may be fewer than k.
    ///
    /// Parameters
    /// ----------
    /// coefficients : (c,) or (c, p) array_like
    ///
    /// Returns
    /// -------
    /// (n,) or (n, p) float64 array
    fn reconstruct<'py>(&self, coefficients: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let k = self.inner.k();
        let rows = coefficients.len().unwrap_or(k);
        if rows > k {
            let expected = format!("at most {k} rows, one per eigenfunction");
            let py = coefficients.py();
            return Err(errors::invalid(py, "coefficients", &expected, &rows.to_string()));
        }
        let basis = self.inner.clone();
        columns(coefficients, "coefficients", Axis::Is(rows), move |a| basis.reconstruct_all(a))
    }

    /// Heat diffusion exp(−tΔ)F on the truncated basis.
    ///
    /// Parameters
    /// ----------
    /// functions : (n,) or (n, p) array_like
    /// t : float
    ///     Time, in the units of 1 / `values`; relative to area 1 for the basis of a `Shape`.
    ///
    /// Returns
    /// -------
    /// (n,) or (n, p) float64 array
    fn diffuse<'py>(&self, functions: &Bound<'py, PyAny>, t: f64) -> PyResult<Bound<'py, PyAny>> {
        if !(t >= 0.0 && t.is_finite()) {
            let py = functions.py();
            return Err(errors::invalid(py, "t", "a time of at least 0", &t.to_string()));
        }
        let basis = self.inner.clone();
        columns(functions, "functions", self.rows(), move |f| basis.diffuse_all(f, t))
    }

    /// The first pairs only.
    ///
    /// Parameters
    /// ----------
    /// k : int
    ///
    /// Returns
    /// -------
    /// Eigenbasis
    fn truncated(&self, py: Python<'_>, k: usize) -> PyResult<Self> {
        let basis = &self.inner;
        if !(1..=basis.k()).contains(&k) {
            let expected = format!("1 to {}", basis.k());
            return Err(errors::invalid(py, "k", &expected, &k.to_string()));
        }
        let shared = Shared::new(geom::Eigenbasis {
            values: basis.values[..k].to_vec(),
            functions: basis.first(k).to_owned(),
            mass: basis.mass.clone(),
            residuals: basis.residuals[..k].to_vec(),
        });
        Ok(Self { inner: shared, n_original: self.n_original })
    }

    /// Writes `values`, `functions`, `mass` and `residuals` to an .npz file.
    ///
    /// Parameters
    /// ----------
    /// path : path
    fn to_npz(slf: &Bound<'_, Self>, path: PathBuf) -> PyResult<()> {
        let arrays = PyDict::new(slf.py());
        arrays.set_item("values", Self::values(slf)?)?;
        arrays.set_item("functions", Self::functions(slf)?)?;
        arrays.set_item("mass", Self::mass(slf)?)?;
        arrays.set_item("residuals", Self::residuals(slf)?)?;
        json::write_npz(slf.py(), path, &arrays)
    }

    /// Reads what `to_npz` wrote.
    ///
    /// Parameters
    /// ----------
    /// path : path
    ///
    /// Returns
    /// -------
    /// Eigenbasis
    #[staticmethod]
    fn from_npz(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let names = ["values", "functions", "mass", "residuals"];
        let [values, functions, mass, residuals] = json::read_npz(py, &path, names)?;
        Self::new(&values, &functions, &mass, Some(&residuals))
    }

    fn __repr__(&self) -> String {
        format!("Eigenbasis({} pairs on {} vertices)", self.inner.k(), self.inner.n_vertices())
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Reduced<'py>> {
        let parts =
            (Self::values(slf)?, Self::functions(slf)?, Self::mass(slf)?, Self::residuals(slf)?);
        Ok((slf.get_type(), parts.into_pyobject(slf.py())?.into_any()))
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }
}

/// One function or a column for each, in and out of `work`.
fn columns<'py>(
    functions: &Bound<'py, PyAny>,
    name: &str,
    rows: Axis,
    work: impl FnOnce(faer::MatRef<'_, f64>) -> faer::Mat<f64> + Send + 'static,
) -> PyResult<Bound<'py, PyAny>> {
    let py = functions.py();
    let numpy = py.import("numpy")?;
    let single = numpy
        .call_method1("ndim", (functions,))
        .and_then(|ndim| ndim.extract::<usize>())
        .is_ok_and(|ndim| ndim == 1);
    let matrix = if single {
        let values = arrays_in::floats(functions, name, &[rows])?.0;
        faer::Mat::from_fn(values.len(), 1, |i, _| values[i])
    } else {
        arrays_in::matrix(functions, name, [rows, Axis::Any("p")])?
    };
    let result = run(py, None, move |_| Ok(work(matrix.as_ref())))?;
    if single {
        return Ok(arrays_out::owned(py, result.col(0).iter().copied().collect::<Vec<f64>>()));
    }
    arrays_out::owned_matrix(py, result.as_ref())
}

/// The first k eigenpairs of a Laplacian.
///
/// Residuals, orthonormality and (by an inertia count) completeness are verified before a basis is
/// returned. Signs are fixed; the same settings give the same bytes at every thread count.
///
/// Parameters
/// ----------
/// laplacian : Laplacian
/// k : int
///     Number of pairs, at most n.
/// tolerance : float, default 1e-8
///     Largest relative residual accepted.
/// seed : int, default 0
///     Of the starting block.
/// progress : progress, optional
///
/// Returns
/// -------
/// Eigenbasis
///
/// Examples
/// --------
/// >>> import semfm, semfm.zoo
/// >>> basis = semfm.eigenbasis(semfm.laplacian(semfm.zoo.icosphere(3)), 9)
/// >>> basis.values.round(1).tolist()  # l (l + 1) on the unit sphere
/// [0.0, 2.0, 2.0, 2.0, 6.0, 6.0, 6.0, 6.0, 6.0]
#[pyfunction]
#[pyo3(signature = (laplacian, k, *, tolerance=1e-8, seed=0, progress=None))]
pub fn eigenbasis(
    py: Python<'_>,
    laplacian: &Bound<'_, Laplacian>,
    k: usize,
    tolerance: f64,
    seed: u64,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Eigenbasis> {
    let laplacian = laplacian.get().inner.clone();
    check_size(py, k, laplacian.n_vertices())?;
    let settings = EigenSettings { tolerance, seed };
    let basis = run(py, progress, move |task| Ok(solve(&laplacian, k, &settings, task)?))?;
    Ok(Eigenbasis::new_of(basis))
}

/// Refuses a k whose basis, or whose dense solution, no machine would hold.
pub fn check_size(py: Python<'_>, k: usize, n: usize) -> PyResult<()> {
    let k = k.min(n);
    within_memory(py, "k", k, n)?;
    // Many pairs of few vertices are solved densely, in n × n.
    if n <= 4 * k { within_memory(py, "k", n, n) } else { Ok(()) }
}
