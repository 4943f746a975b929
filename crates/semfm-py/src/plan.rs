//! `plan`: from grasps to a motion of an arm; `GraspPlan` and its `Segment`s.

use std::path::PathBuf;
use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use semfm::files::{GraspsFile, PlanFile};
use semfm::geom::math::DVec3;
use semfm::motion::{MotionSettings, SegmentKind, Trajectory, TrajectoryPoint};
use semfm::{PlanObject, PlanRequest, RobotArm, SceneContents};
use semfm_show::{write_plan, write_plan_picture};

use crate::arrays_in::{self, Axis, rigid};
use crate::grasps::Grasps;
use crate::interruptible::run;
use crate::mesh::from_any;
use crate::robot::Robot;
use crate::scene::Scene;
use crate::{arrays_out, errors, json, pictures};

/// A motion of an arm that carries out a grasp, or what kept each grasp from one: see `plan`.
#[pyclass(frozen, module = "semfm")]
pub struct GraspPlan {
    inner: Arc<semfm::GraspPlan>,
    arm: Arc<RobotArm>,
}

/// A part of a motion with one purpose. Between two points each joint follows the cubic polynomial that their positions
/// and velocities determine.
#[pyclass(frozen, module = "semfm")]
pub struct Segment {
    plan: Arc<semfm::GraspPlan>,
    at: usize,
}

#[pymethods]
impl GraspPlan {
    /// int, optional: the grasp that is carried out, its place among the grasps from 0; None where none can be.
    #[getter]
    fn grasp(&self) -> Option<usize> {
        self.inner.answer.motion.as_ref().map(|motion| motion.grasp)
    }

    /// list of str: the arm's joints, base to tip: the columns of every array of joint values.
    #[getter]
    fn joint_names(&self) -> Vec<String> {
        self.arm.arm().joints().iter().map(|joint| joint.name.clone()).collect()
    }

    /// float: seconds that the motion takes; 0 without one.
    #[getter]
    fn duration(&self) -> f64 {
        self.trajectory().map_or(0.0, Trajectory::duration)
    }

    /// list of Segment: the motion: to the pre-grasp, approach, close, lift; empty without one.
    #[getter]
    fn segments(&self) -> Vec<Segment> {
        let n = self.trajectory().map_or(0, |trajectory| trajectory.segments.len());
        (0..n).map(|at| Segment { plan: self.inner.clone(), at }).collect()
    }

    /// The state at each of some times; before the motion begins and after it ends, that of its ends.
    ///
    /// Parameters
    /// ----------
    /// times : (t,) array_like
    ///     Seconds.
    ///
    /// Returns
    /// -------
    /// dict
    ///     ``positions``, ``velocities`` and ``accelerations`` (t, n), ``openings`` (t,), metres between the pads.
    fn at<'py>(&self, py: Python<'py>, times: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyDict>> {
        let (times, _) = arrays_in::floats(times, "times", &[Axis::Any("t")])?;
        let Some(trajectory) = self.trajectory() else {
            return Err(errors::invalid(py, "plan", "one with a motion", "none"));
        };
        let points: Vec<TrajectoryPoint> =
            times.iter().filter_map(|&time| trajectory.at(time)).collect();
        let states = PyDict::new(py);
        let n = self.arm.arm().n_joints();
        for (name, pick) in JOINT_VALUES {
            states.set_item(name, joint_rows(py, &points, pick, n)?)?;
        }
        let openings = points.iter().map(|point| point.opening).collect();
        states.set_item("openings", arrays_out::owned(py, openings))?;
        Ok(states)
    }

    /// int: states of the finished motion, a millisecond apart, that were checked again.
    #[getter]
    fn n_replayed(&self) -> usize {
        self.inner.answer.motion.as_ref().map_or(0, |motion| motion.n_replayed)
    }

    /// list of dict: grasps that did not become the motion, counted by the first gate that each did not pass: ``gate``,
    /// ``n``, the first such ``grasp``, its ``obstruction`` with its numbers, and that in words (``text``).
    #[getter]
    fn gates<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let told = |row: semfm::motion::GateCount| {
            let text = row.obstruction.to_string();
            let mut value = serde_json::to_value(row).unwrap_or_default();
            value["text"] = text.into();
            value
        };
        let rows: Vec<serde_json::Value> =
            self.inner.answer.gates().into_iter().map(told).collect();
        json::to_python(py, &rows)
    }

    /// list of dict: what became of each grasp, in their order: ``ending`` is ``"planned"``, ``"stopped"`` (at a
    /// ``gate``, by an ``obstruction``) or ``"not_tried"``.
    #[getter]
    fn outcomes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.inner.answer.outcomes)
    }

    /// dict, optional: where the start itself touches something: the things ``a`` and ``b``, ``depth`` in metres and
    /// ``nearest_free`` joint values.
    #[getter]
    fn start_contact<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let contact = PlanFile::new(&self.inner).start_contact;
        contact.map(|contact| json::to_python(py, &contact)).transpose()
    }

    /// list of str: what was found or assumed.
    #[getter]
    fn notes(&self) -> Vec<String> {
        self.inner.notes.clone()
    }

    /// The content of `plan.json`.
    ///
    /// Returns
    /// -------
    /// dict
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &PlanFile::new(&self.inner))
    }

    /// A picture of the motion or, where there is none, of the nearest miss, which notebooks show by themselves.
    ///
    /// Returns
    /// -------
    /// bytes
    ///     PNG.
    fn picture<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let (plan, arm) = (self.inner.clone(), self.arm.clone());
        pictures::png(py, move |path, task| Ok(write_plan_picture(path, &arm, &plan, task)?))
    }

    fn _repr_png_<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyBytes>> {
        pictures::shown(self.picture(py))
    }

    /// Writes what ``semfm-cli plan`` writes: `plan.json` and, of a motion, `trajectory.json`, a ROS 2 bag, a scene for
    /// Foxglove, an animated model and a picture, else a picture of the nearest miss. An object that came from no file is
    /// written beside them (`planned_object.ply`).
    ///
    /// Parameters
    /// ----------
    /// folder : path
    ///     Made if it is not there.
    /// progress : progress, optional
    ///
    /// Returns
    /// -------
    /// list of str
    ///     The files.
    #[pyo3(signature = (folder, *, progress=None))]
    fn write(
        &self,
        py: Python<'_>,
        folder: PathBuf,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Vec<String>> {
        let (plan, arm) = (self.inner.clone(), self.arm.clone());
        let files = run(py, progress, move |task| Ok(write_plan(&folder, &arm, &plan, task)?))?;
        Ok(files.iter().map(|file| file.display().to_string()).collect())
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }

    fn __repr__(&self) -> String {
        let answer = &self.inner.answer;
        let n = answer.outcomes.len();
        let Some(motion) = &answer.motion else {
            let stopped: Vec<String> =
                answer.gates().iter().map(|row| format!("{} at {}", row.n, row.gate)).collect();
            return format!("GraspPlan(none of {n} grasps: {} stopped)", stopped.join(", "));
        };
        let seconds: Vec<String> = PlanFile::new(&self.inner)
            .segments
            .iter()
            .map(|segment| format!("{} {:.2} s", segment.kind.name(), segment.seconds))
            .collect();
        format!("GraspPlan(grasp {} of {n}: {})", motion.grasp, seconds.join(", "))
    }
}

impl GraspPlan {
    fn trajectory(&self) -> Option<&Trajectory> {
        self.inner.answer.motion.as_ref().map(|motion| &motion.trajectory)
    }
}

#[pymethods]
impl Segment {
    /// str: ``"to_pre_grasp"``, ``"approach"``, ``"close"`` or ``"lift"``.
    #[getter]
    fn kind(&self) -> &'static str {
        self.inner().map_or("", |segment| SegmentKind::name(segment.kind))
    }

    /// (p,) float64 array: seconds since the motion began, rising.
    #[getter]
    fn times<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        arrays_out::owned(py, self.points().iter().map(|point| point.time).collect())
    }

    /// (p, n) float64 array: joint values, radians or metres.
    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        joint_rows(py, self.points(), |point| &point.positions, self.n_joints())
    }

    /// (p, n) float64 array: per second.
    #[getter]
    fn velocities<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        joint_rows(py, self.points(), |point| &point.velocities, self.n_joints())
    }

    /// (p, n) float64 array: per second squared.
    #[getter]
    fn accelerations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        joint_rows(py, self.points(), |point| &point.accelerations, self.n_joints())
    }

    /// (p,) float64 array: distance between the pads, metres.
    #[getter]
    fn openings<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        arrays_out::owned(py, self.points().iter().map(|point| point.opening).collect())
    }

    fn __len__(&self) -> usize {
        self.points().len()
    }

    fn __repr__(&self) -> String {
        let ends = [self.points().first(), self.points().last()];
        let [from, to] = ends.map(|point| point.map_or(0.0, |point| point.time));
        format!("Segment({}, {} points, {from:.2} to {to:.2} s)", self.kind(), self.__len__())
    }
}

impl Segment {
    fn inner(&self) -> Option<&semfm::motion::Segment> {
        self.plan.answer.motion.as_ref()?.trajectory.segments.get(self.at)
    }

    fn points(&self) -> &[TrajectoryPoint] {
        self.inner().map_or(&[], |segment| &segment.points)
    }

    fn n_joints(&self) -> usize {
        let motion = self.plan.answer.motion.as_ref();
        motion.map_or(0, |motion| motion.trajectory.joint_names.len())
    }
}

/// A list of joint values of a point.
type PickJoints = fn(&TrajectoryPoint) -> &Vec<f64>;

const JOINT_VALUES: [(&str, PickJoints); 3] = [
    ("positions", |point| &point.positions),
    ("velocities", |point| &point.velocities),
    ("accelerations", |point| &point.accelerations),
];

/// Joint values of points (points × joints).
fn joint_rows<'py>(
    py: Python<'py>,
    points: &[TrajectoryPoint],
    pick: PickJoints,
    n_joints: usize,
) -> PyResult<Bound<'py, PyAny>> {
    let values = points.iter().flat_map(|point| pick(point).iter().copied()).collect();
    arrays_out::owned(py, values).call_method1("reshape", (points.len(), n_joints))
}

/// The motion of an arm that takes an object by the best of its grasps that can be carried out: reach, approach, close,
/// lift. What is answered was checked as it is timed, against the robot, the scene and the object.
///
/// That no grasp can be carried out is an answer: see `GraspPlan.gates`. The same as ``semfm-cli plan`` from the same
/// files.
///
/// Parameters
/// ----------
/// robot : Robot
///     The arm; its ``tip`` is the link that the gripper's flange sits on.
/// grasps : Grasps or path
///     From `find_grasps`, or `grasps.json`.
/// object : mesh_like, optional
///     The mesh that the grasps belong to; by default that of ``Grasps``. Without it nothing keeps the arm away from the
///     object. `trajectory.json` names the file of a path.
/// base_from_object : (4, 4) array_like, optional
///     Where the object, in metres, stands in the frame of the arm's base.
/// base_from_camera : (4, 4) array_like, optional
///     The same of the camera that the grasps were found with; one of the two must be given.
/// tip_from_tcp : (4, 4) array_like, optional
///     The TCP of the closed hand in the frame of ``Robot.tip``, where that is not the gripper's flange.
/// start : (n,) array_like or str, optional
///     Joint values, or a state of the SRDF; by default its state ``ready``, ``home`` or ``up``.
/// scene : Scene or path, optional
///     What stands around, in the frame of the arm's base.
/// with_table : bool, default True
///     Whether the table that the grasps were found with stands there, too.
/// approach_length : float, default 0.1
///     Length of the straight way to the grasp, metres.
/// lift_height : float, default 0.1
///     Height of the straight way up with the object, metres along z of the arm's base.
/// speed : float, default 1
///     Share of the joints' velocity limits that is used; accelerations follow with its square.
/// line_speed : float, default 0.5
///     The same on the straight ways.
/// iterations : int, optional
///     Most iterations of each search for a path.
/// searches : int, optional
///     Grasps for which a path is searched at most.
/// seed : int, default 0
/// progress : progress, optional
///
/// Returns
/// -------
/// GraspPlan
#[pyfunction]
#[pyo3(signature = (robot, grasps, *, object=None, base_from_object=None, base_from_camera=None, tip_from_tcp=None,
    start=None, scene=None, with_table=true, approach_length=0.1, lift_height=0.1, speed=1.0, line_speed=0.5,
    iterations=None, searches=None, seed=0, progress=None))]
#[expect(clippy::too_many_arguments, reason = "keywords of a Python function")]
pub fn plan(
    py: Python<'_>,
    robot: &Bound<'_, PyAny>,
    grasps: &Bound<'_, PyAny>,
    object: Option<&Bound<'_, PyAny>>,
    base_from_object: Option<&Bound<'_, PyAny>>,
    base_from_camera: Option<&Bound<'_, PyAny>>,
    tip_from_tcp: Option<&Bound<'_, PyAny>>,
    start: Option<&Bound<'_, PyAny>>,
    scene: Option<&Bound<'_, PyAny>>,
    with_table: bool,
    approach_length: f64,
    lift_height: f64,
    speed: f64,
    line_speed: f64,
    iterations: Option<usize>,
    searches: Option<usize>,
    seed: u64,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<GraspPlan> {
    let robot = robot
        .cast::<Robot>()
        .map_err(|_| errors::wrong_type("robot", "a Robot (`Robot.from_urdf`)", robot))?
        .get();
    let tip_from_tcp = tip_from_tcp.map(|pose| rigid(pose, "tip_from_tcp")).transpose()?;
    if !robot.has_named_tip() && tip_from_tcp.is_none() {
        let expected = "a Robot whose `tip`, the link that the gripper's flange sits on, was named, or tip_from_tcp";
        return Err(errors::invalid(py, "robot", expected, "neither"));
    }
    let file = grasps_file(grasps)?;
    let object = plan_object(object, grasps)?;
    let place = match (base_from_object, base_from_camera) {
        (Some(pose), None) => rigid(pose, "base_from_object")?,
        (None, Some(pose)) => {
            let camera_pose = file.camera_pose().map_err(|error| errors::raise(py, &error))?;
            rigid(pose, "base_from_camera")? * camera_pose
        }
        (given, _) => {
            let expected = "one of base_from_object and base_from_camera";
            let found = if given.is_some() { "both" } else { "neither" };
            return Err(errors::invalid(py, "base_from_object", expected, found));
        }
    };
    let arm = robot.arm(py)?;
    let start = match start {
        Some(start) => robot.state_of(start, "start")?,
        None => arm.ready_state().map_err(|error| errors::raise(py, &error))?,
    };
    let defaults = MotionSettings::default();
    let request = PlanRequest {
        grasps: file,
        object,
        base_from_object: place,
        tip_from_tcp,
        start,
        scene: surroundings(scene)?,
        with_table,
        settings: MotionSettings {
            seed,
            approach: approach_length,
            lift: DVec3::Z * lift_height,
            speed,
            line_speed,
            iterations: iterations.unwrap_or(defaults.iterations),
            searches: searches.unwrap_or(defaults.searches),
            ..defaults
        },
    };
    let planned_with = arm.clone();
    let inner = run(py, progress, move |task| semfm::plan(&planned_with, &request, task))?;
    Ok(GraspPlan { inner: Arc::new(inner), arm })
}

/// Grasps as their file has them.
fn grasps_file(grasps: &Bound<'_, PyAny>) -> PyResult<GraspsFile> {
    let py = grasps.py();
    if let Ok(found) = grasps.cast::<Grasps>() {
        return found.get().file(py);
    }
    let path: PathBuf = grasps
        .extract()
        .map_err(|_| errors::wrong_type("grasps", "Grasps or the path of grasps.json", grasps))?;
    run(py, None, move |_| GraspsFile::read_alone(&path))
}

/// The object's mesh; `semfm::plan` asks whether the grasps belong to it.
fn plan_object(
    object: Option<&Bound<'_, PyAny>>,
    grasps: &Bound<'_, PyAny>,
) -> PyResult<Option<PlanObject>> {
    let mesh = match (object, grasps.cast::<Grasps>()) {
        (Some(object), _) => from_any(object, "object")?,
        (None, Ok(found)) => found.get().object().clone(),
        (None, Err(_)) => return Ok(None),
    };
    let path = object.and_then(|object| object.extract::<PathBuf>().ok());
    Ok(Some(PlanObject { mesh: Arc::new((*mesh).clone()), file: path }))
}

fn surroundings(scene: Option<&Bound<'_, PyAny>>) -> PyResult<SceneContents> {
    let Some(scene) = scene else { return Ok(SceneContents::new()) };
    if let Ok(scene) = scene.cast::<Scene>() {
        return Ok(scene.get().inner.clone());
    }
    let path: PathBuf = scene
        .extract()
        .map_err(|_| errors::wrong_type("scene", "a Scene, or the path of a file", scene))?;
    run(scene.py(), None, move |_| SceneContents::read(&[path]))
}
