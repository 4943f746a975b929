//! `FunctionalMap`: fitted, refined, read off.

use std::path::PathBuf;
use std::sync::Arc;

use faer::Mat;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use semfm::fmap::fit::{FitSettings, FitSide, OrientedSurface, fit};
use semfm::fmap::zoomout::{self, MapSide, ZoomOutSettings};
use semfm::{fmap, geom};

use crate::arrays_in::{self, Axis};
use crate::eigenbasis::Eigenbasis;
use crate::interruptible::{guard, run};
use crate::mesh::{Reduced, from_any};
use crate::point_map::PointMap;
use crate::precise_map::PreciseMap;
use crate::shared::Shared;
use crate::{arrays_out, errors, json};

/// C (k_target × k_source): takes coefficients of a source function to those on the target.
///
/// Parameters
/// ----------
/// matrix : (k_target, k_source) array_like
///
/// See Also
/// --------
/// PointMap : the map of vertices, which runs the other way.
#[pyclass(frozen, module = "semfm")]
pub struct FunctionalMap {
    pub inner: Arc<fmap::FunctionalMap>,
}

#[pymethods]
impl FunctionalMap {
    #[new]
    fn new(matrix: &Bound<'_, PyAny>) -> PyResult<Self> {
        let axes = [Axis::Any("k_target"), Axis::Any("k_source")];
        let c = arrays_in::matrix(matrix, "matrix", axes)?;
        if c.nrows() == 0 || c.ncols() == 0 {
            let found = format!("{} × {}", c.nrows(), c.ncols());
            return Err(errors::invalid(matrix.py(), "matrix", "at least 1 × 1", &found));
        }
        Ok(Self { inner: Arc::new(fmap::FunctionalMap::new(c)) })
    }

    /// The map of least ``‖C A − B‖²`` for descriptors A of the source and B of the target.
    ///
    /// Without regularisers and with fewer descriptors than eigenfunctions the minimum-norm one.
    ///
    /// Parameters
    /// ----------
    /// source : Eigenbasis
    /// target : Eigenbasis
    /// source_descriptors : (n_source, p) array_like
    ///     Functions on the source's vertices.
    /// target_descriptors : (n_target, p) array_like
    ///     The same functions on the target's vertices.
    /// k : int, optional
    ///     Size of the map (k × k); the smaller basis where none is given.
    /// laplacian : float, default 0.0
    ///     μ, weight of commutation with the Laplacian, ``‖C Λ_source − Λ_target C‖²``.
    /// descriptors : float, default 0.0
    ///     ν, weight of commutation with multiplication by each descriptor (Nogneng & Ovsjanikov).
    /// orientation : float, default 0.0
    ///     ω, weight of commutation with the turned gradient of each descriptor (Ren et al. 2018),
    ///     which tells left from right. Needs both meshes.
    /// reversing : bool, default False
    ///     Whether the orientation is to be reversed instead of preserved.
    /// source_mesh : mesh_like, optional
    ///     Triangles on the source's vertices, of a `Shape` its `working` mesh. They must be wound
    ///     consistently (all but one in a thousand), and both meshes outward or both inward.
    /// target_mesh : mesh_like, optional
    ///     The same for the target.
    /// coefficients : bool, default False
    ///     Whether the descriptors are given as coefficients (k × p) in the two bases.
    /// progress : progress, optional
    ///
    /// Returns
    /// -------
    /// FunctionalMap
    ///
    /// Examples
    /// --------
    /// >>> import semfm, semfm.zoo
    /// >>> shape = semfm.Shape(semfm.zoo.torus(20, 10), k=10)
    /// >>> signature = semfm.wks(shape.basis)
    /// >>> fitted = semfm.FunctionalMap.fit(
    /// ...     shape.basis, shape.basis, signature, signature, laplacian=0.01)
    /// >>> fitted
    /// FunctionalMap(10 × 10)
    #[staticmethod]
    #[pyo3(signature = (
        source, target, source_descriptors, target_descriptors, *, k=None, laplacian=0.0,
        descriptors=0.0, orientation=0.0, reversing=false, source_mesh=None, target_mesh=None,
        coefficients=false, progress=None
    ))]
    #[pyo3(name = "fit")]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments, one per setting")]
    fn fit_to(
        source: &Bound<'_, Eigenbasis>,
        target: &Bound<'_, Eigenbasis>,
        source_descriptors: &Bound<'_, PyAny>,
        target_descriptors: &Bound<'_, PyAny>,
        k: Option<usize>,
        laplacian: f64,
        descriptors: f64,
        orientation: f64,
        reversing: bool,
        source_mesh: Option<&Bound<'_, PyAny>>,
        target_mesh: Option<&Bound<'_, PyAny>>,
        coefficients: bool,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let py = source.py();
        let (source_rows, target_rows) = (source.get().rows(), target.get().rows());
        let (source, target) = (source.get().inner.clone(), target.get().inner.clone());
        let k = k.unwrap_or(source.k().min(target.k()));
        if k == 0 {
            return Err(errors::invalid(py, "k", "at least 1", "0"));
        }
        for basis in [&source, &target] {
            check_size(py, "k", k, basis)?;
        }
        let axes = [if coefficients { Axis::Is(k) } else { source_rows }, Axis::Any("p")];
        let a = arrays_in::laid(source_descriptors, "source_descriptors", axes)?;
        let axes = [if coefficients { Axis::Is(k) } else { target_rows }, Axis::Is(a.ncols())];
        let b = arrays_in::laid(target_descriptors, "target_descriptors", axes)?;
        let source_mesh = source_mesh.map(|mesh| from_any(mesh, "source_mesh")).transpose()?;
        let target_mesh = target_mesh.map(|mesh| from_any(mesh, "target_mesh")).transpose()?;
        if orientation > 0.0 && (source_mesh.is_none() || target_mesh.is_none()) {
            let expected = "both, where an orientation is asked for";
            return Err(errors::invalid(py, "source_mesh, target_mesh", expected, "None"));
        }
        let settings = FitSettings { laplacian, descriptors, orientation, reversing };
        let map = run(py, progress, move |task| {
            let project = |basis: &geom::Eigenbasis, f: &arrays_in::Laid| {
                let f = f.view();
                if coefficients { f.to_owned() } else { basis.project_first(k, f) }
            };
            let (a, b) = (project(&source, &a), project(&target, &b));
            let is_oriented = orientation > 0.0;
            let source_surface = surface(source_mesh.as_deref().filter(|_| is_oriented))?;
            let target_surface = surface(target_mesh.as_deref().filter(|_| is_oriented))?;
            let source =
                FitSide { surface: source_surface.as_ref(), ..FitSide::new(&source, a.as_ref()) };
            let target =
                FitSide { surface: target_surface.as_ref(), ..FitSide::new(&target, b.as_ref()) };
            Ok(fit(source, target, &settings, task)?.map)
        })?;
        Ok(Self { inner: Arc::new(map) })
    }

    /// C f = f ∘ T in the two bases: ``Φ_targetᵀ M_target Φ_source[T]``.
    ///
    /// Parameters
    /// ----------
    /// map : PointMap
    ///     Target → source.
    /// source : Eigenbasis
    /// target : Eigenbasis
    /// k : int, optional
    ///     Size of the map (k × k); the smaller basis where none is given.
    ///
    /// Returns
    /// -------
    /// FunctionalMap
    #[staticmethod]
    #[pyo3(signature = (map, source, target, *, k=None))]
    fn from_point_map(
        map: &Bound<'_, PointMap>,
        source: &Bound<'_, Eigenbasis>,
        target: &Bound<'_, Eigenbasis>,
        k: Option<usize>,
    ) -> PyResult<Self> {
        let py = map.py();
        let (source, target) = (source.get().inner.clone(), target.get().inner.clone());
        let k = k.unwrap_or(source.k().min(target.k()));
        let n_source = map.get().n_source;
        if n_source != source.n_vertices() {
            let expected = format!("a map onto {} source vertices", source.n_vertices());
            return Err(errors::invalid(py, "map", &expected, &n_source.to_string()));
        }
        let map = map.get().inner.clone();
        let shared = run(py, None, move |_| {
            Ok(fmap::FunctionalMap::from_point_map(&map, &source, &target, k)?)
        })?;
        Ok(Self { inner: Arc::new(shared) })
    }

    /// ZoomOut (Melzi et al. 2019): grows this map by turns of point map and projection.
    ///
    /// Parameters
    /// ----------
    /// source : Eigenbasis
    /// target : Eigenbasis
    /// k_final : int, default 50
    ///     Size of the last map.
    /// step : int, default 5
    ///     Growth per turn.
    /// source_features : (n_source, d) array_like, optional
    ///     Features that take part in the search, in the same space on both sides.
    /// target_features : (n_target, d) array_like, optional
    /// feature_weight : float, default 0.0
    ///     w: the search runs in ``[spectral, w √k · features]``.
    /// source_samples : (r,) array_like, optional
    ///     Source vertices among which matches are sought while the map grows; all where none are
    ///     given.
    /// target_samples : (s,) array_like, optional
    ///     Target vertices that are matched while the map grows; all where none are given.
    /// progress : progress, optional
    ///
    /// Returns
    /// -------
    /// FunctionalMap
    #[pyo3(signature = (
        source, target, *, k_final=50, step=5, source_features=None, target_features=None,
        feature_weight=0.0, source_samples=None, target_samples=None, progress=None
    ))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments, one per setting")]
    fn zoomout(
        &self,
        source: &Bound<'_, Eigenbasis>,
        target: &Bound<'_, Eigenbasis>,
        k_final: usize,
        step: usize,
        source_features: Option<&Bound<'_, PyAny>>,
        target_features: Option<&Bound<'_, PyAny>>,
        feature_weight: f64,
        source_samples: Option<&Bound<'_, PyAny>>,
        target_samples: Option<&Bound<'_, PyAny>>,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let py = source.py();
        let (source, target) = (source.get().inner.clone(), target.get().inner.clone());
        let on_both = features(&source, &target, source_features, target_features)?;
        if !(feature_weight >= 0.0 && feature_weight.is_finite()) {
            let found = feature_weight.to_string();
            return Err(errors::invalid(py, "feature_weight", "a number of at least 0", &found));
        }
        let on_source_alone = samples(source_samples, "source_samples", source.n_vertices())?;
        let on_target_alone = samples(target_samples, "target_samples", target.n_vertices())?;
        let start = (*self.inner).clone();
        let settings = ZoomOutSettings { k_start: 1, k_final, step, feature_weight };
        let grown = run(py, progress, move |task| {
            let (on_source, on_target) = on_both
                .as_ref()
                .map_or((None, None), |(a, b)| (Some(a.as_ref()), Some(b.as_ref())));
            let source = MapSide { basis: &source, features: on_source, samples: &on_source_alone };
            let target = MapSide { basis: &target, features: on_target, samples: &on_target_alone };
            Ok(zoomout::zoomout(start, &source, &target, &settings, task)?)
        })?;
        Ok(Self { inner: Arc::new(grown) })
    }

    /// The point map target → source: each target vertex takes the source vertex whose delta
    /// function, sent through C, comes nearest to its own.
    ///
    /// Parameters
    /// ----------
    /// source : Eigenbasis
    /// target : Eigenbasis
    /// adjoint : bool, default False
    ///     Compare on the source instead, with the target's deltas brought back through Cᵀ. The same
    ///     for an orthogonal C.
    /// source_features : (n_source, d) array_like, optional
    ///     Features that take part in the search, as in `zoomout`.
    /// target_features : (n_target, d) array_like, optional
    /// feature_weight : float, default 0.0
    ///
    /// Returns
    /// -------
    /// PointMap
    #[pyo3(signature = (
        source, target, *, adjoint=false, source_features=None, target_features=None,
        feature_weight=0.0
    ))]
    fn to_point_map(
        &self,
        source: &Bound<'_, Eigenbasis>,
        target: &Bound<'_, Eigenbasis>,
        adjoint: bool,
        source_features: Option<&Bound<'_, PyAny>>,
        target_features: Option<&Bound<'_, PyAny>>,
        feature_weight: f64,
    ) -> PyResult<PointMap> {
        let py = source.py();
        let (source, target) = (source.get().inner.clone(), target.get().inner.clone());
        self.check_bases(py, &source, &target)?;
        let on_both = features(&source, &target, source_features, target_features)?;
        let n_source = source.n_vertices();
        let map = self.inner.clone();
        let found = run(py, None, move |_| {
            Ok(match &on_both {
                Some((a, b)) => {
                    let on = |basis, features| MapSide { basis, features, samples: &[] };
                    let source = on(&source, Some(a.as_ref()));
                    let target = on(&target, Some(b.as_ref()));
                    zoomout::point_map(&map, &source, &target, feature_weight)?
                }
                None if adjoint => map.adjoint_point_map(&source, &target)?,
                None => map.point_map(&source, &target)?,
            })
        })?;
        Ok(PointMap { inner: Shared::new(found), n_source })
    }

    /// The precise map target → source (Ezuz & Ben-Chen 2017): each target vertex takes the nearest
    /// point on the source's triangles, whose corners stand where their delta functions, sent through
    /// C, come to. Exact; of equally near triangles the first.
    ///
    /// Parameters
    /// ----------
    /// source : Eigenbasis
    /// target : Eigenbasis
    /// source_mesh : mesh_like
    ///     Triangles on the source's vertices, of a `Shape` its `working` mesh.
    ///
    /// Returns
    /// -------
    /// PreciseMap
    #[pyo3(signature = (source, target, source_mesh))]
    fn to_precise_map(
        &self,
        source: &Bound<'_, Eigenbasis>,
        target: &Bound<'_, Eigenbasis>,
        source_mesh: &Bound<'_, PyAny>,
    ) -> PyResult<PreciseMap> {
        let py = source.py();
        let mesh = from_any(source_mesh, "source_mesh")?;
        let (source, target) = (source.get().inner.clone(), target.get().inner.clone());
        self.check_bases(py, &source, &target)?;
        let map = self.inner.clone();
        let inner = run(py, None, move |_| Ok(map.precise_map(&source, &mesh, &target)?))?;
        Ok(PreciseMap { inner })
    }

    /// (k_target, k_source) float64 array: C, a read-only view.
    #[getter]
    fn matrix<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        arrays_out::matrix(slf, |map| map.inner.matrix())
    }

    /// int: size of the source basis.
    #[getter]
    fn k_source(&self) -> usize {
        self.inner.k_source()
    }

    /// int: size of the target basis.
    #[getter]
    fn k_target(&self) -> usize {
        self.inner.k_target()
    }

    /// ‖C Cᵀ − I‖ / √k_target: 0 where the map keeps areas.
    ///
    /// Returns
    /// -------
    /// float
    fn orthogonality(&self, py: Python<'_>) -> PyResult<f64> {
        guard(py, || Ok(self.inner.orthogonality()))
    }

    /// ‖C Λ_source − Λ_target C‖ / (λ_max ‖C‖): 0 where the map keeps lengths.
    ///
    /// Parameters
    /// ----------
    /// source : Eigenbasis
    /// target : Eigenbasis
    ///
    /// Returns
    /// -------
    /// float
    fn commutativity(
        &self,
        source: &Bound<'_, Eigenbasis>,
        target: &Bound<'_, Eigenbasis>,
    ) -> PyResult<f64> {
        let py = source.py();
        let (source, target) = (&source.get().inner, &target.get().inner);
        self.check_bases(py, source, target)?;
        guard(py, || Ok(self.inner.commutativity(source, target)))
    }

    /// Writes `matrix` to an .npz file.
    ///
    /// Parameters
    /// ----------
    /// path : path
    fn to_npz(slf: &Bound<'_, Self>, path: PathBuf) -> PyResult<()> {
        let arrays = PyDict::new(slf.py());
        arrays.set_item("matrix", Self::matrix(slf)?)?;
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
    /// FunctionalMap
    #[staticmethod]
    fn from_npz(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let [matrix] = json::read_npz(py, &path, ["matrix"])?;
        Self::new(&matrix)
    }

    fn __repr__(&self) -> String {
        format!("FunctionalMap({} × {})", self.inner.k_target(), self.inner.k_source())
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Self>().is_ok_and(|other| *other.get().inner == *self.inner)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Reduced<'py>> {
        let parts = (Self::matrix(slf)?,);
        Ok((slf.get_type(), parts.into_pyobject(slf.py())?.into_any()))
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }
}

impl FunctionalMap {
    fn check_bases(
        &self,
        py: Python<'_>,
        source: &geom::Eigenbasis,
        target: &geom::Eigenbasis,
    ) -> PyResult<()> {
        check_size(py, "source", self.inner.k_source(), source)?;
        check_size(py, "target", self.inner.k_target(), target)
    }
}

fn check_size(py: Python<'_>, name: &str, k: usize, basis: &geom::Eigenbasis) -> PyResult<()> {
    if k <= basis.k() {
        return Ok(());
    }
    let expected = format!("a basis of at least {k} pairs");
    Err(errors::invalid(py, name, &expected, &format!("{} pairs", basis.k())))
}

/// Vertex ids below `n`; none where none are given.
fn samples(ids: Option<&Bound<'_, PyAny>>, name: &str, n: usize) -> PyResult<Vec<u32>> {
    let Some(given) = ids else { return Ok(Vec::new()) };
    let (ids, _) = arrays_in::ids(given, name, &[Axis::Any("s")])?;
    match ids.iter().find(|&&id| id as usize >= n) {
        None => Ok(ids),
        Some(id) => {
            let expected = format!("ids below {n}");
            Err(errors::invalid(given.py(), name, &expected, &id.to_string()))
        }
    }
}

/// The features of both sides, or of neither.
fn features(
    source: &geom::Eigenbasis,
    target: &geom::Eigenbasis,
    on_source: Option<&Bound<'_, PyAny>>,
    on_target: Option<&Bound<'_, PyAny>>,
) -> PyResult<Option<(Mat<f64>, Mat<f64>)>> {
    match (on_source, on_target) {
        (None, None) => Ok(None),
        (Some(a), Some(b)) => {
            let rows = [Axis::Is(source.n_vertices()), Axis::Any("d")];
            let a = arrays_in::matrix(a, "source_features", rows)?;
            let rows = [Axis::Is(target.n_vertices()), Axis::Is(a.ncols())];
            Ok(Some((a, arrays_in::matrix(b, "target_features", rows)?)))
        }
        (Some(lonely), None) => {
            Err(errors::invalid(lonely.py(), "target_features", "features of both sides", "None"))
        }
        (None, Some(lonely)) => {
            Err(errors::invalid(lonely.py(), "source_features", "features of both sides", "None"))
        }
    }
}

/// The surface whose orientation a map is fitted to, where it is.
fn surface(mesh: Option<&semfm::Mesh>) -> semfm::fmap::Result<Option<OrientedSurface>> {
    mesh.map(OrientedSurface::new).transpose()
}
