//! `SemanticCloud`: surface points with features, and lifting embeddings onto a surface.

use std::sync::Arc;

use pyo3::prelude::*;
use semfm::geom;
use semfm::views::{self, LiftRule, LiftSettings};

use crate::arrays_in::{self, Axis, within_memory};
use crate::embeddings::Embeddings;
use crate::interruptible::{guard, run};
use crate::mesh::{Reduced, from_any};
use crate::{arrays_out, errors};

/// Points on an object's surface, each with a feature vector.
///
/// Parameters
/// ----------
/// points : (m, 3) array_like
///     In the frame and units of the mesh as read.
/// features : (m, d) array_like
///     From any network; kept as float32.
/// n_views : (m,) array_like, optional
///     How many views saw each point; 1 where none are given.
///
/// Examples
/// --------
/// >>> import semfm
/// >>> cloud = semfm.SemanticCloud([[0, 0, 0], [1, 0, 0]], [[1, 0, 0], [0, 1, 0]])
/// >>> cloud
/// SemanticCloud(2 points, dim 3)
#[pyclass(frozen, module = "semfm")]
pub struct SemanticCloud {
    pub inner: Arc<geom::SemanticCloud>,
}

#[pymethods]
impl SemanticCloud {
    #[new]
    #[pyo3(signature = (points, features, n_views=None))]
    fn new(
        points: &Bound<'_, PyAny>,
        features: &Bound<'_, PyAny>,
        n_views: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let points_py = points;
        let points = arrays_in::points(points, "points")?;
        let rows = Axis::Is(points.len());
        let (features, shape) = arrays_in::floats32(features, "features", &[rows, Axis::Any("d")])?;
        let n_views = match n_views {
            Some(n_views) => arrays_in::ids(n_views, "n_views", &[rows])?.0,
            None => vec![1; points.len()],
        };
        let cloud = guard(points_py.py(), || {
            Ok(geom::SemanticCloud::new(points, features, shape[1], n_views)?)
        })?;
        Ok(Self { inner: Arc::new(cloud) })
    }

    /// (m, 3) float64 array: positions, a read-only view.
    #[getter]
    fn points<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        arrays_out::rows(slf, 3, |cloud| bytemuck::cast_slice::<_, f64>(cloud.inner.points()))
    }

    /// (m, d) float32 array: features, a read-only view.
    #[getter]
    fn features<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        arrays_out::rows(slf, slf.get().inner.dim(), |cloud| cloud.inner.features())
    }

    /// (m,) uint32 array: how many views saw each point, 0 where a neighbour lent its features; a read-only view.
    #[getter]
    fn n_views<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        arrays_out::vector(slf, |cloud| cloud.inner.n_views())
    }

    /// int: number of points m.
    #[getter]
    fn n_points(&self) -> usize {
        self.inner.n_points()
    }

    /// int: feature dimension d.
    #[getter]
    fn dim(&self) -> usize {
        self.inner.dim()
    }

    fn __len__(&self) -> usize {
        self.inner.n_points()
    }

    fn __repr__(&self) -> String {
        format!("SemanticCloud({} points, dim {})", self.inner.n_points(), self.inner.dim())
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Reduced<'py>> {
        let parts = (Self::points(slf)?, Self::features(slf)?, Self::n_views(slf)?);
        Ok((slf.get_type(), parts.into_pyobject(slf.py())?.into_any()))
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }
}

/// Lifts the embeddings of views onto samples of the surface.
///
/// Parameters
/// ----------
/// mesh : mesh_like
///     The mesh that the views show.
/// embeddings : Embeddings or path
/// rule : str, default "pull"
///     ``"pull"`` (samples take their features out of every view that sees them) or ``"unproject"``
///     (patch centres are cast onto the surface, the paper's rule).
/// n_samples : int, default 1200
///     Points of the cloud; the paper's rule was measured with 400.
/// depth_tolerance : float, default 0.01
///     For ``"pull"``: how far behind the visible surface a sample may lie and still be seen, as a
///     share of the bounding-sphere radius.
/// radius : float, default 0.06
///     For ``"unproject"``: the reach of a sample, as a share of the bounding box's diagonal.
/// seed : int, default 0
///     Of the samples.
/// progress : progress, optional
///
/// Returns
/// -------
/// SemanticCloud
#[pyfunction]
#[pyo3(signature = (
    mesh, embeddings, *, rule="pull", n_samples=1200, depth_tolerance=0.01, radius=0.06, seed=0,
    progress=None
))]
#[expect(clippy::too_many_arguments, reason = "keyword arguments, one per setting")]
pub fn lift(
    mesh: &Bound<'_, PyAny>,
    embeddings: &Bound<'_, PyAny>,
    rule: &str,
    n_samples: usize,
    depth_tolerance: f64,
    radius: f64,
    seed: u64,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<SemanticCloud> {
    let py = mesh.py();
    let rule = match rule {
        "pull" => LiftRule::Pull { depth_tolerance },
        "unproject" => LiftRule::Unproject { radius },
        other => {
            let found = format!("{other:?}");
            return Err(errors::invalid(py, "rule", "'pull' or 'unproject'", &found));
        }
    };
    let settings = LiftSettings { rule, n_samples, seed };
    let shared = from_any(mesh, "mesh")?;
    let file = embeddings_of(embeddings, "embeddings", &shared)?;
    within_memory(py, "n_samples", n_samples, file.dim())?;
    let lifted =
        run(py, progress, move |task| Ok(views::lift(&shared, &file.views, &settings, task)?))?;
    Ok(SemanticCloud { inner: Arc::new(lifted.cloud) })
}

/// Embeddings, or the file of them, that were made of this very mesh.
pub fn embeddings_of(
    value: &Bound<'_, PyAny>,
    name: &str,
    mesh: &semfm::Mesh,
) -> PyResult<Arc<views::mcap::EmbeddingsFile>> {
    let py = value.py();
    let shared = if let Ok(embeddings) = value.cast::<Embeddings>() {
        embeddings.get().inner.clone()
    } else if let Ok(path) = value.extract() {
        Embeddings::read(py, path)?.inner
    } else {
        return Err(errors::wrong_type(name, "Embeddings or a path", value));
    };
    guard(py, || Ok(shared.check_mesh(mesh)?))?;
    Ok(shared)
}
