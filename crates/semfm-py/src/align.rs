//! `align`: the pose and scale of an object in what a camera sees.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use semfm::ObjectFrame;
use semfm::align::Alignment as Found;
use semfm::align::{self, AlignSettings, ObservedCloud, Sim3};
use semfm::files::{AlignedFile, AlignedPose};
use semfm::geom::math::DVec3;

use crate::interruptible::run;
use crate::mesh::{Mesh, from_any};
use crate::observation::Observation;
use crate::shared::Shared;
use crate::tracker::pose_with_scale;
use crate::{arrays_in, arrays_out, errors, json};

/// Pose and scale of an object before a camera, and how far to trust them: see `align`.
#[pyclass(frozen, module = "semfm")]
pub struct Alignment {
    found: Arc<Found>,
    file: Arc<AlignedFile>,
    question: Arc<Question>,
}

/// What was asked, so that a pickle can ask it again.
struct Question {
    mesh: Shared<semfm::Mesh>,
    observed: Observed,
    settings: AlignSettings,
}

/// What a camera saw.
enum Observed {
    Points { points: Vec<DVec3>, viewpoint: Option<(f64, f64, f64)> },
    Frame(ObjectFrame),
}

impl Observed {
    fn cloud(&self) -> semfm::Result<ObservedCloud> {
        Ok(match self {
            Self::Frame(frame) => frame.seen.observed_cloud(frame.mask())?,
            Self::Points { points, viewpoint: Some((x, y, z)) } => {
                ObservedCloud::from_view(points, [*x, *y, *z].into())?
            }
            Self::Points { points, viewpoint: None } => ObservedCloud::from_many_views(points)?,
        })
    }
}

impl Question {
    fn answer(self, py: Python<'_>, progress: Option<&Bound<'_, PyAny>>) -> PyResult<Alignment> {
        let question = Arc::new(self);
        let asked = question.clone();
        let (found, file) = run(py, progress, move |task| {
            let Question { mesh, observed, settings } = &*asked;
            let found = align::align(mesh, &observed.cloud()?, settings, task)?;
            let file = AlignedFile::new(&found, mesh, settings);
            Ok((found, file))
        })?;
        Ok(Alignment { found: Arc::new(found), file: Arc::new(file), question })
    }
}

/// What a pickle holds: mesh, points or an observation, viewpoint, init by rows, scale range, starts, seed, and the place of
/// the object's mask.
type Pickled<'py> = (
    Mesh,
    Bound<'py, PyAny>,
    Option<(f64, f64, f64)>,
    Option<[[f64; 4]; 4]>,
    Option<[f64; 2]>,
    usize,
    u64,
    Option<usize>,
);

impl Alignment {
    /// The pose with its scale: from the mesh's frame and units to the camera's frame in metres.
    pub fn similarity(&self) -> Sim3 {
        self.found.camera_from_object
    }

    /// The pose as readers of `aligned.json` have it.
    pub fn pose(&self) -> semfm::Result<AlignedPose> {
        AlignedPose::of_file((*self.file).clone(), Path::new("alignment"))
    }
}

#[pymethods]
impl Alignment {
    /// (4, 4) float64 array: from the mesh's frame and units to the camera's frame in metres; the
    /// scale is included.
    #[getter]
    fn camera_from_object<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let rows = self.found.camera_from_object.to_rows();
        arrays_out::owned_rows(py, rows.as_flattened().to_vec(), 4)
    }

    /// (4, 4) float64 array: the same once the object is measured in metres, for `find_grasps`.
    #[getter]
    fn rigid<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        crate::gripper::matrix(py, self.found.camera_from_object.rigid())
    }

    /// float: metres per unit of the mesh.
    #[getter]
    fn scale(&self) -> f64 {
        self.found.camera_from_object.scale
    }

    /// float: standard deviation of the scale.
    #[getter]
    fn scale_std(&self) -> f64 {
        self.found.scale_std
    }

    /// float: standard deviation of the rotation about its least certain axis, radians; π where what
    /// was seen does not determine it.
    #[getter]
    fn rotation_std(&self) -> f64 {
        self.found.rotation_std
    }

    /// float: standard deviation of the position in its least certain direction, metres.
    #[getter]
    fn position_std(&self) -> f64 {
        self.found.position_std
    }

    /// float: root mean square distance of the points that lie on the model, metres.
    #[getter]
    fn residual_m(&self) -> f64 {
        self.found.residual_m
    }

    /// float: share of the observed points that lie on the model.
    #[getter]
    fn inlier_share(&self) -> f64 {
        self.found.inlier_share
    }

    /// float: of the model's side that faces the camera, the share that was seen where it is.
    #[getter]
    fn visibility(&self) -> f64 {
        self.found.visibility
    }

    /// float: what the best pose that puts some of the surface elsewhere explains of what was seen, as a
    /// share of what this one does.
    #[getter]
    fn rival(&self) -> f64 {
        self.found.rival
    }

    /// list of dict: axes about which what was seen does not determine the rotation: ``axis``, a unit
    /// vector (x, y, z) in the mesh's frame, and ``turns``, the ranges of turns about it (radians, 0
    /// the pose itself) that fit as well.
    #[getter]
    fn undetermined<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let one = |open: &align::UndeterminedAxis| {
            let entry = PyDict::new(py);
            entry.set_item("axis", <(f64, f64, f64)>::from(open.axis))?;
            let turns: Vec<(f64, f64)> = open.turns.iter().map(|&[from, to]| (from, to)).collect();
            entry.set_item("turns", turns)?;
            Ok(entry)
        };
        self.found.undetermined.iter().map(one).collect()
    }

    /// (a, 4, 4) float64 array: other values of `camera_from_object` that explain what was seen as well.
    #[getter]
    fn alternatives<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let numbers: Vec<f64> =
            self.found.alternatives.iter().flat_map(|pose| pose.to_rows().concat()).collect();
        arrays_out::owned(py, numbers).call_method1("reshape", (-1, 4, 4))
    }

    /// str: ``"accept"``, ``"check"`` or ``"refuse"``.
    #[getter]
    fn verdict(&self) -> String {
        self.found.verdict.to_string()
    }

    /// list of str: what speaks against accepting the pose.
    #[getter]
    fn reasons(&self) -> Vec<String> {
        self.found.reasons.clone()
    }

    /// The content of `aligned.json`.
    ///
    /// Returns
    /// -------
    /// dict
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.file.to_json())
    }

    /// Writes `aligned.json`, whole or not at all: what `semfm-cli align` writes and
    /// ``semfm-cli grasp --aligned`` reads.
    ///
    /// Parameters
    /// ----------
    /// path : path
    fn write(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let file = self.file.clone();
        run(py, None, move |_| file.write(&path))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Pickled<'py>)> {
        let restore = py.import("semfm._semfm")?.getattr("_restore_alignment")?;
        let Question { mesh, observed, settings } = &*self.question;
        let AlignSettings { init, scale_range, n_starts, seed } = *settings;
        let (points, viewpoint, mask) = match observed {
            Observed::Points { points, viewpoint } => {
                (arrays_out::points(py, points)?, *viewpoint, None)
            }
            Observed::Frame(frame) => {
                let seen = Observation { inner: frame.seen.clone() };
                (Bound::new(py, seen)?.into_any(), None, frame.mask)
            }
        };
        let init = init.map(|init| init.to_rows());
        let mesh = Mesh { inner: mesh.clone() };
        Ok((restore, (mesh, points, viewpoint, init, scale_range, n_starts, seed, mask)))
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }

    fn __repr__(&self) -> String {
        let (scale, residual) = (self.scale(), self.found.residual_m);
        format!("Alignment({}, scale {scale:.4}, residual {residual:.4} m)", self.verdict())
    }
}

/// Finds pose and scale of a mesh in an observed partial cloud (a robust Sim(3)).
///
/// Parameters
/// ----------
/// mesh : mesh_like
///     In any units.
/// points : (n, 3) array_like or Observation
///     What the camera saw of the object, metres, in the camera's frame; or all that it saw, of which the points beside the
///     object tell where it is not.
/// mask : str or (height, width) array_like, optional
///     The object's mask in an `Observation`: a name, an array of dtype bool, or the only one that there is where none is
///     given.
/// viewpoint : tuple of float, float, float, optional
///     Where the camera of points stands. The origin says that the frame is the camera's own (x right, y down,
///     z forward), in which nothing it sees lies behind it. None for a cloud merged from many views, of which nothing can be
///     said about what should have been seen.
/// init : (4, 4) array_like or Alignment or path, optional
///     A guess of `Alignment.camera_from_object`.
/// scale_range : tuple of float, float, optional
///     Least and greatest scale, metres per unit.
/// n_starts : int, optional
///     Rotations to start from where there is no guess.
/// seed : int, optional
/// progress : progress, optional
///
/// Returns
/// -------
/// Alignment
///     A pose that cannot be trusted has the verdict ``"refuse"``; it is no error.
#[pyfunction]
#[pyo3(name = "align", signature = (mesh, points, *, mask=None, viewpoint=(0.0, 0.0, 0.0), init=None,
    scale_range=None, n_starts=400, seed=0, progress=None))]
#[pyo3(
    text_signature = "(mesh, points, *, mask=None, viewpoint=(0.0, 0.0, 0.0), init=None, scale_range=None, n_starts=400, seed=0, progress=None)"
)]
#[expect(clippy::too_many_arguments, reason = "keywords of a Python function")]
pub fn align_(
    py: Python<'_>,
    mesh: &Bound<'_, PyAny>,
    points: &Bound<'_, PyAny>,
    mask: Option<&Bound<'_, PyAny>>,
    viewpoint: Option<(f64, f64, f64)>,
    init: Option<&Bound<'_, PyAny>>,
    scale_range: Option<(f64, f64)>,
    n_starts: usize,
    seed: u64,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Alignment> {
    let mesh = from_any(mesh, "mesh")?;
    let observed = match points.cast::<Observation>() {
        Ok(seen) => Observed::Frame(seen.get().frame(py, mask)?),
        Err(_) if mask.is_some() => {
            return Err(errors::invalid(py, "mask", "an Observation beside it", "points"));
        }
        Err(_) => Observed::Points { points: arrays_in::points(points, "points")?, viewpoint },
    };
    let init = init.map(|init| pose_with_scale(init, "init")).transpose()?;
    let scale_range = scale_range.map(|(low, high)| [low, high]);
    let settings = AlignSettings { init, scale_range, n_starts, seed };
    Question { mesh, observed, settings }.answer(py, progress)
}

/// An alignment out of a pickle: asked again, which gives the same.
#[pyfunction]
#[pyo3(signature = (mesh, points, viewpoint, init, scale_range, n_starts, seed, mask=None))]
#[expect(clippy::too_many_arguments, reason = "what a pickle holds")]
pub fn _restore_alignment(
    py: Python<'_>,
    mesh: &Bound<'_, Mesh>,
    points: &Bound<'_, PyAny>,
    viewpoint: Option<(f64, f64, f64)>,
    init: Option<[[f64; 4]; 4]>,
    scale_range: Option<[f64; 2]>,
    n_starts: usize,
    seed: u64,
    mask: Option<usize>,
) -> PyResult<Alignment> {
    let observed = match points.cast::<Observation>() {
        Ok(seen) => Observed::Frame(ObjectFrame { seen: seen.get().inner.clone(), mask }),
        Err(_) => Observed::Points { points: arrays_in::points(points, "points")?, viewpoint },
    };
    let init = init.map(Sim3::from_rows).transpose();
    let init = init.map_err(|error| errors::raise(py, &error.into()))?;
    let settings = AlignSettings { init, scale_range, n_starts, seed };
    Question { mesh: mesh.get().inner.clone(), observed, settings }.answer(py, None)
}
