//! `Shape`: a mesh made ready for maps.

use std::path::PathBuf;
use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use semfm::geom::CleanSettings;
use semfm::geom::laplacian::BridgeSettings;
use semfm::geom::{self, ShapeCache, ShapeSettings};

use crate::arrays_in::{self, Axis};
use crate::eigenbasis::{Eigenbasis, check_size};
use crate::interruptible::{guard, run};
use crate::laplacian::{Laplacian, kind_of};
use crate::mesh::{Mesh, from_any};
use crate::shared::Shared;
use crate::{arrays_out, errors, json};

/// A mesh made ready for maps: cleaned, simplified, with its Laplacian and eigenbasis.
///
/// The basis is that of the working mesh scaled to area 1, so eigenvalues and diffusion times are
/// relative; positions keep the units of the original.
///
/// Parameters
/// ----------
/// mesh : mesh_like
/// k : int, default 60
///     Eigenpairs.
/// clip_k : bool, default True
///     Whether `k` may be clipped to the number of working vertices; else more is an error.
/// working_vertices : int, default 10000
///     Simplify above this many vertices; 0 keeps them all.
/// dust_share : float, default 1e-6
///     Components below this share of the area are dropped; 0 keeps them all.
/// laplacian : str, default "tufted"
///     ``"tufted"`` or ``"cotan"``.
/// bridges : bool, default True
///     Whether components are joined by weak edges.
/// tolerance : float, default 1e-8
///     Largest relative residual of an eigenpair.
/// cache : cache, optional
///     Where prepared shapes are kept: a folder, or True for the user's own.
/// progress : progress, optional
///
/// Examples
/// --------
/// >>> import semfm, semfm.zoo
/// >>> shape = semfm.Shape(semfm.zoo.torus(40, 20), k=20)
/// >>> shape
/// Shape(800 vertices, 800 working, 20 eigenpairs)
/// >>> shape.basis.functions.shape
/// (800, 20)
#[pyclass(frozen, module = "semfm")]
pub struct Shape {
    pub inner: Arc<geom::Shape>,
}

#[pymethods]
impl Shape {
    #[new]
    #[pyo3(signature = (
        mesh, *, k=60, clip_k=true, working_vertices=10_000, dust_share=1e-6, laplacian="tufted",
        bridges=true, tolerance=1e-8, cache=None, progress=None
    ))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments, one per setting")]
    fn new(
        mesh: &Bound<'_, PyAny>,
        k: usize,
        clip_k: bool,
        working_vertices: usize,
        dust_share: f64,
        laplacian: &str,
        bridges: bool,
        tolerance: f64,
        cache: Option<&Bound<'_, PyAny>>,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let py = mesh.py();
        let shared = from_any(mesh, "mesh")?;
        let cache = cache_of(cache)?;
        let settings = ShapeSettings {
            k,
            clip_k,
            working_vertices,
            cleaning: CleanSettings { dust_share },
            laplacian: kind_of(py, laplacian)?,
            bridges: bridges.then(BridgeSettings::default),
            eigen: geom::eigensolver::EigenSettings { tolerance, ..Default::default() },
        };
        check_shape_size(py, shared.n_vertices(), &settings)?;
        let made = run(py, progress, move |task| {
            Ok(cache.shape((*shared).clone(), &settings, task)?.shape)
        })?;
        Ok(Self { inner: Arc::new(made) })
    }

    /// Mesh: the mesh as given.
    #[getter]
    fn original(&self) -> Mesh {
        Mesh { inner: Shared::part_of(&self.inner, geom::Shape::original) }
    }

    /// Mesh: the mesh that maps are computed on, in the units of the original.
    #[getter]
    fn working(&self) -> Mesh {
        Mesh { inner: Shared::part_of(&self.inner, geom::Shape::mesh) }
    }

    /// (n,) uint32 array: the working vertex that stands for each original one, a read-only view.
    #[getter]
    fn working_of_original<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        arrays_out::vector(slf, |shape| shape.inner.working().of_original.as_slice())
    }

    /// (n_working,) uint32 array: the original vertex that each working one is, a read-only view.
    #[getter]
    fn original_of_working<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        arrays_out::vector(slf, |shape| shape.inner.working().to_original.as_slice())
    }

    /// Laplacian: that of the working mesh at area 1, bridges included.
    #[getter]
    fn laplacian(&self) -> Laplacian {
        Laplacian { inner: Shared::part_of(&self.inner, geom::Shape::laplacian) }
    }

    /// Eigenbasis: that of the working mesh at area 1 (n_working × k).
    #[getter]
    fn basis(&self) -> Eigenbasis {
        let n_original = self.inner.original().n_vertices();
        let n_original = Some(n_original).filter(|&n| n != self.inner.mesh().n_vertices());
        Eigenbasis { inner: Shared::part_of(&self.inner, geom::Shape::basis), n_original }
    }

    /// float: √area of the working mesh, the length that becomes 1.
    #[getter]
    fn unit(&self) -> f64 {
        self.inner.unit()
    }

    /// dict: what cleaning, simplification and the solver did, with milliseconds by stage.
    #[getter]
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, self.inner.report())
    }

    /// Values on the working vertices, extended to the original's.
    ///
    /// Parameters
    /// ----------
    /// values : (n_working,) array_like
    ///
    /// Returns
    /// -------
    /// (n,) float64 array
    ///     Exact where a vertex was kept, linear on the nearest working triangle elsewhere.
    fn onto_original<'py>(&self, values: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let py = values.py();
        let n = self.working_rows();
        let values = arrays_in::floats(values, "values", &[n])?.0;
        Ok(arrays_out::owned(py, guard(py, || Ok(self.inner.onto_original(&values)))?))
    }

    /// Values on the original's vertices, read off at the working ones.
    ///
    /// Parameters
    /// ----------
    /// values : (n,) array_like
    ///
    /// Returns
    /// -------
    /// (n_working,) float64 array
    fn onto_working<'py>(&self, values: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let py = values.py();
        let (n, n_working) = (self.inner.original().n_vertices(), self.inner.mesh().n_vertices());
        let n = Axis::Original { n, n_working };
        let values = arrays_in::floats(values, "values", &[n])?.0;
        Ok(arrays_out::owned(py, guard(py, || Ok(self.inner.onto_working(&values)))?))
    }

    /// One implicit step of heat diffusion, ``(M + t L) u = M f``, on the working vertices.
    ///
    /// Parameters
    /// ----------
    /// function : (n_working,) array_like
    /// t : float
    ///     Time at area 1.
    ///
    /// Returns
    /// -------
    /// (n_working,) float64 array
    fn smooth<'py>(&self, function: &Bound<'py, PyAny>, t: f64) -> PyResult<Bound<'py, PyAny>> {
        let py = function.py();
        let n = self.working_rows();
        let function = arrays_in::floats(function, "function", &[n])?.0;
        let shape = self.inner.clone();
        let smoothed = run(py, None, move |_| Ok(shape.smooth(&function, t)?))?;
        Ok(arrays_out::owned(py, smoothed))
    }

    fn __repr__(&self) -> String {
        let n = self.inner.original().n_vertices();
        let (working, k) = (self.inner.mesh().n_vertices(), self.inner.basis().k());
        format!("Shape({n} vertices, {working} working, {k} eigenpairs)")
    }

    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, (Mesh, Bound<'py, PyBytes>))> {
        let bytes = guard(py, || Ok(self.inner.to_bytes()?))?;
        let restore = py.import("semfm._semfm")?.getattr("_restore_shape")?;
        Ok((restore, (self.original(), PyBytes::new(py, &bytes))))
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }
}

impl Shape {
    /// One entry per working vertex.
    fn working_rows(&self) -> Axis {
        let (n, n_original) = (self.inner.mesh().n_vertices(), self.inner.original().n_vertices());
        Axis::Working { n, n_original }
    }
}

/// A shape out of a pickle.
#[pyfunction]
pub fn _restore_shape(mesh: &Bound<'_, Mesh>, bytes: &Bound<'_, PyBytes>) -> PyResult<Shape> {
    let py = mesh.py();
    let shape =
        guard(py, || Ok(geom::Shape::from_bytes((*mesh.get().inner).clone(), bytes.as_bytes())))?;
    let damaged =
        || errors::invalid(py, "pickled shape", "bytes of this version of semfm", "others");
    Ok(Shape { inner: Arc::new(shape.ok_or_else(damaged)?) })
}

/// The cache that an argument means: nothing, the user's own, or a folder.
pub fn cache_of(cache: Option<&Bound<'_, PyAny>>) -> PyResult<ShapeCache> {
    let Some(cache) = cache.filter(|cache| !cache.is_none()) else { return Ok(ShapeCache::off()) };
    if let Ok(wanted) = cache.extract::<bool>() {
        return Ok(if wanted { ShapeCache::of_user() } else { ShapeCache::off() });
    }
    match cache.extract::<PathBuf>() {
        Ok(folder) => Ok(ShapeCache::at(folder)),
        Err(_) => Err(errors::wrong_type("cache", "a folder or a bool", cache)),
    }
}

/// Refuses a basis that no machine would hold.
pub fn check_shape_size(py: Python<'_>, n: usize, settings: &ShapeSettings) -> PyResult<()> {
    // Simplification may keep some more than it is asked for.
    let n_working = match settings.working_vertices {
        0 => n,
        working => n.min(working.saturating_mul(2)),
    };
    check_size(py, settings.k, n_working)
}
