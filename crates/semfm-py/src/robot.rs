//! `Robot`: an arm out of its files, with kinematics.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

use pyo3::prelude::*;
use pyo3::types::PyDict;
use semfm::RobotArm;
use semfm::motion::CollisionSettings;
use semfm::robot::{
    ArmFiles, IkAnswer, IkSettings, IkSolution, InverseKinematics, OpenedArm, Pose, Preference,
};

use crate::arrays_in::{self, Axis, rigid};
use crate::arrays_out;
use crate::errors;
use crate::gripper::matrix;
use crate::interruptible::{direct, run};

/// Names of preferences, in the order in which messages tell them.
const PREFERENCES: [(&str, Preference); 4] = [
    ("none", Preference::None),
    ("near", Preference::Near),
    ("limits", Preference::Limits),
    ("manipulability", Preference::Manipulability),
];

/// Searches of inverse kinematics (solutions times restarts) up to which a call stays on the calling thread: a search takes
/// some tens of microseconds, ten thousand of them less than a second.
const MOST_DIRECT: usize = 10_000;

/// An arm: the joints of a robot between a base and a tip. Joint values are arrays of n numbers, base to tip,
/// radians or metres; poses are (4, 4) matrices in the base link's frame, metres.
///
/// Made by `Robot.from_urdf`.
///
/// Examples
/// --------
/// >>> import math, pathlib, semfm, tempfile
/// >>> link = '<link name="{}"/>'
/// >>> joint = '''<joint name="{0}{1}" type="revolute"><parent link="{0}"/><child link="{1}"/>
/// ... <origin xyz="{2} 0 0"/><axis xyz="0 0 1"/><limit lower="-3" upper="3" velocity="1" effort="1"/></joint>'''
/// >>> hand = '<joint name="h" type="fixed"><parent link="c"/><child link="d"/><origin xyz=".5 0 0"/></joint>'
/// >>> parts = [*map(link.format, "abcd"), joint.format("a", "b", 0), joint.format("b", "c", 0.5), hand]
/// >>> path = pathlib.Path(tempfile.mkdtemp()) / "planar.urdf"
/// >>> _ = path.write_text(f'<robot name="planar">{"".join(parts)}</robot>')
/// >>> robot = semfm.Robot.from_urdf(path, tip="d")
/// >>> robot.joint_names
/// ['ab', 'bc']
/// >>> pose = robot.forward([math.pi / 6, math.pi / 3])
/// >>> pose[:3, 3].round(3).tolist()
/// [0.433, 0.75, 0.0]
/// >>> robot.solve_ik(pose)["solutions"].round(3).tolist()
/// [[0.524, 1.047]]
#[pyclass(frozen, module = "semfm")]
pub struct Robot {
    files: ArmFiles,
    packages: BTreeMap<String, PathBuf>,
    inner: OpenedArm,
    /// With the collision model, made when it is first planned with.
    arm: OnceLock<Arc<RobotArm>>,
}

#[pymethods]
impl Robot {
    /// Reads an arm from its files.
    ///
    /// Parameters
    /// ----------
    /// urdf : path
    ///     Links and joints.
    /// srdf : path, optional
    ///     The chain that is meant as the arm, and named states.
    /// limits : path, optional
    ///     Joint limits as MoveIt writes them (``joint_limits.yaml``).
    /// base : str, optional
    ///     The link in whose frame poses are told; by default the SRDF's, or the root.
    /// tip : str, optional
    ///     The link that the arm moves; by default the SRDF's, or the end of the one chain of joints.
    /// fixed : dict, optional
    ///     Positions of joints outside the chain by name, such as fingers.
    /// packages : dict, optional
    ///     Folders by the names of packages in ``package://NAME/…``; for `plan`, which needs every collision mesh.
    ///
    /// Returns
    /// -------
    /// Robot
    #[staticmethod]
    #[pyo3(signature = (urdf, *, srdf=None, limits=None, base=None, tip=None, fixed=None, packages=None))]
    #[allow(clippy::too_many_arguments, reason = "keywords of Python")]
    fn from_urdf(
        py: Python<'_>,
        urdf: PathBuf,
        srdf: Option<PathBuf>,
        limits: Option<PathBuf>,
        base: Option<String>,
        tip: Option<String>,
        fixed: Option<&Bound<'_, PyDict>>,
        packages: Option<BTreeMap<String, PathBuf>>,
    ) -> PyResult<Self> {
        let fixed = match fixed {
            Some(fixed) => fixed
                .iter()
                .map(|(name, position)| Ok((name.extract()?, position.extract()?)))
                .collect::<PyResult<Vec<(String, f64)>>>()?,
            None => Vec::new(),
        };
        let files = ArmFiles { urdf, srdf, limits, base, tip, fixed };
        Self::open(py, files, packages.unwrap_or_default())
    }

    /// str: as in the URDF.
    #[getter]
    fn name(&self) -> &str {
        &self.inner.arm.robot().name
    }

    /// str: the link in whose frame poses are told.
    #[getter]
    fn base(&self) -> &str {
        let arm = &self.inner.arm;
        &arm.robot().links[arm.base()].name
    }

    /// str: the link that the arm moves.
    #[getter]
    fn tip(&self) -> &str {
        let arm = &self.inner.arm;
        &arm.robot().links[arm.tip()].name
    }

    /// int: number of joints.
    #[getter]
    fn n_joints(&self) -> usize {
        self.inner.arm.n_joints()
    }

    /// list of str: names of the joints, base to tip.
    #[getter]
    fn joint_names(&self) -> Vec<String> {
        self.inner.arm.joints().iter().map(|joint| joint.name.clone()).collect()
    }

    /// (n, 2) float64 array: lowest and highest position of each joint; infinite where there is no limit.
    #[getter]
    fn limits<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let joints = self.inner.arm.joints().iter();
        arrays_out::owned_rows(py, joints.flat_map(|j| [j.lower, j.upper]).collect(), 2)
    }

    /// (n,) float64 array: greatest speed of each joint, per second.
    #[getter]
    fn velocity_limits<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        let joints = self.inner.arm.joints().iter();
        arrays_out::owned(py, joints.map(|joint| joint.velocity).collect())
    }

    /// (n,) float64 array: greatest acceleration of each joint, per second squared.
    #[getter]
    fn acceleration_limits<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        let joints = self.inner.arm.joints().iter();
        arrays_out::owned(py, joints.map(|joint| joint.acceleration).collect())
    }

    /// list of str: what was found, assumed or passed over when the files were read.
    #[getter]
    fn notes(&self) -> Vec<String> {
        self.inner.notes.clone()
    }

    /// Joint values of a state that the SRDF names.
    ///
    /// Parameters
    /// ----------
    /// name : str
    ///     Of the state.
    ///
    /// Returns
    /// -------
    /// (n,) float64 array
    fn state<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let state = self.inner.named_state(name);
        Ok(arrays_out::owned(py, state.map_err(|error| errors::raise(py, &error.into()))?))
    }

    /// The pose of the tip (forward kinematics). Limits are not asked for.
    ///
    /// Parameters
    /// ----------
    /// q : (n,) array_like
    ///     Joint values.
    ///
    /// Returns
    /// -------
    /// (4, 4) float64 array
    fn forward<'py>(&self, py: Python<'py>, q: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        matrix(py, self.inner.arm.base_from_tip(&self.joint_values(q, "q")?))
    }

    /// The pose of every link. Joints outside the chain stand where they were fixed, mimics follow.
    ///
    /// Parameters
    /// ----------
    /// q : (n,) array_like
    ///     Joint values.
    ///
    /// Returns
    /// -------
    /// dict
    ///     (4, 4) float64 arrays by the names of the links.
    fn link_poses<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let mut poses: Vec<Pose> = Vec::new();
        self.inner.arm.link_poses(&self.joint_values(q, "q")?, &mut poses);
        let named = PyDict::new(py);
        for (link, pose) in self.inner.arm.robot().links.iter().zip(poses) {
            named.set_item(&link.name, matrix(py, pose)?)?;
        }
        Ok(named)
    }

    /// How fast the tip moves for each joint.
    ///
    /// Parameters
    /// ----------
    /// q : (n,) array_like
    ///     Joint values.
    ///
    /// Returns
    /// -------
    /// (6, n) float64 array
    ///     Linear above angular velocity of the tip's frame, in the base's frame.
    fn jacobian<'py>(&self, py: Python<'py>, q: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let q = self.joint_values(q, "q")?;
        let mut jacobian = vec![0.0; 6 * q.len()];
        self.inner.arm.jacobian(&q, &mut jacobian);
        arrays_out::owned_rows(py, jacobian, q.len())
    }

    /// How easily the tip moves in every direction (Yoshikawa's measure); zero at a singular position.
    ///
    /// Parameters
    /// ----------
    /// q : (n,) array_like
    ///     Joint values.
    ///
    /// Returns
    /// -------
    /// float
    fn manipulability(&self, q: &Bound<'_, PyAny>) -> PyResult<f64> {
        Ok(self.inner.arm.manipulability(&self.joint_values(q, "q")?))
    }

    /// Joint values that bring the tip to a pose (inverse kinematics). Each solution was checked by forward kinematics.
    ///
    /// Parameters
    /// ----------
    /// pose : (4, 4) array_like
    ///     Where the tip shall be, in the base's frame.
    /// near : (n,) array_like or str, optional
    ///     Where the search begins, or a state of the SRDF; by default zero, or the limit next to it.
    /// solutions : int, default 8
    ///     Distinct solutions to look for: more than .1 rad apart, whole turns aside.
    /// restarts : int, default 50
    ///     Random starts in a row without a new solution after which the search ends.
    /// seed : int, default 0
    ///     Of the random starts.
    /// preference : str, default "none"
    ///     What an arm with more joints than it needs does with them: ``"none"``, ``"near"`` (to where the search
    ///     began), ``"limits"`` (away from them) or ``"manipulability"``.
    ///
    /// Returns
    /// -------
    /// dict
    ///     ``solutions`` (k, n), the nearest to `near` first, with ``position_errors`` (k,), metres, and
    ///     ``rotation_errors`` (k,), radians; where none was found, ``closest`` is a dict of ``positions`` (n,),
    ///     ``position_error`` and ``rotation_error`` of the best try, else None; ``tries``, how often the search began.
    #[pyo3(signature = (pose, *, near=None, solutions=8, restarts=50, seed=0, preference="none"))]
    #[allow(clippy::too_many_arguments, reason = "keywords of Python")]
    fn solve_ik<'py>(
        &self,
        py: Python<'py>,
        pose: &Bound<'py, PyAny>,
        near: Option<&Bound<'py, PyAny>>,
        solutions: usize,
        restarts: usize,
        seed: u64,
        preference: &str,
    ) -> PyResult<Bound<'py, PyDict>> {
        let pose = rigid(pose, "pose")?;
        let near = match near {
            Some(near) => self.state_of(near, "near")?,
            None => {
                let joints = self.inner.arm.joints().iter();
                joints.map(|joint| 0.0_f64.clamp(joint.lower, joint.upper)).collect()
            }
        };
        let Some((_, preference)) = PREFERENCES.iter().find(|(name, _)| *name == preference) else {
            let names = PREFERENCES.map(|(name, _)| name).join(", ");
            return Err(errors::invalid(py, "preference", &names, &format!("`{preference}`")));
        };
        let preference = *preference;
        let settings = IkSettings { seed, restarts, solutions, preference, ..Default::default() };
        let arm = self.inner.arm.clone();
        let solve = move || Ok(InverseKinematics::new(arm, settings)?.solve(&pose, &near)?);
        let answer = if solutions.saturating_mul(restarts) <= MOST_DIRECT {
            direct(py, solve)?
        } else {
            run(py, None, move |_| solve())?
        };
        self.answer(py, &answer)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, RestoredFiles)> {
        let restore = py.import("semfm._semfm")?.getattr("_restore_robot")?;
        let ArmFiles { urdf, srdf, limits, base, tip, fixed } = self.files.clone();
        Ok((restore, (urdf, srdf, limits, base, tip, fixed, self.packages.clone())))
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }

    fn __repr__(&self) -> String {
        let (name, n) = (self.name(), self.n_joints());
        format!("Robot({name}, {n} joints from {} to {})", self.base(), self.tip())
    }
}

/// What a pickle holds: names of files, and what they do not say.
type RestoredFiles = (
    PathBuf,
    Option<PathBuf>,
    Option<PathBuf>,
    Option<String>,
    Option<String>,
    Vec<(String, f64)>,
    BTreeMap<String, PathBuf>,
);

impl Robot {
    fn open(
        py: Python<'_>,
        files: ArmFiles,
        packages: BTreeMap<String, PathBuf>,
    ) -> PyResult<Self> {
        let to_read = files.clone();
        let inner = run(py, None, move |_| Ok(to_read.open()?))?;
        Ok(Self { files, packages, inner, arm: OnceLock::new() })
    }

    /// The arm with its collision model.
    pub fn arm(&self, py: Python<'_>) -> PyResult<Arc<RobotArm>> {
        if let Some(arm) = self.arm.get() {
            return Ok(arm.clone());
        }
        let (opened, urdf) = (self.inner.clone(), self.files.urdf.clone());
        let packages = self.packages.clone();
        let arm = run(py, None, move |_| {
            RobotArm::of(opened, &urdf, &packages, &CollisionSettings::default())
        })?;
        // Another thread may have made one meanwhile: any will do.
        Ok(self.arm.get_or_init(|| Arc::new(arm)).clone())
    }

    /// Whether the tip was named, not found.
    pub fn has_named_tip(&self) -> bool {
        self.files.tip.is_some()
    }

    /// Joint values from an array or from the name of a state of the SRDF.
    pub fn state_of(&self, value: &Bound<'_, PyAny>, name: &str) -> PyResult<Vec<f64>> {
        match value.extract::<String>() {
            Ok(state) => {
                let found = self.inner.named_state(&state);
                found.map_err(|error| errors::raise(value.py(), &error.into()))
            }
            Err(_) => self.joint_values(value, name),
        }
    }

    fn joint_values(&self, value: &Bound<'_, PyAny>, name: &str) -> PyResult<Vec<f64>> {
        let (values, _) = arrays_in::floats(value, name, &[Axis::Is(self.inner.arm.n_joints())])?;
        Ok(values)
    }

    fn answer<'py>(&self, py: Python<'py>, answer: &IkAnswer) -> PyResult<Bound<'py, PyDict>> {
        let of_all = |pick: fn(&IkSolution) -> f64| -> Vec<f64> {
            answer.solutions.iter().map(pick).collect()
        };
        let n = self.inner.arm.n_joints();
        let rows: Vec<f64> =
            answer.solutions.iter().flat_map(|solution| solution.positions.clone()).collect();
        let shape = (answer.solutions.len(), n);
        let told = PyDict::new(py);
        let solutions = arrays_out::owned(py, rows).call_method1("reshape", shape)?;
        told.set_item("solutions", solutions)?;
        let position_errors = of_all(|solution| solution.position_error);
        told.set_item("position_errors", arrays_out::owned(py, position_errors))?;
        let rotation_errors = of_all(|solution| solution.rotation_error);
        told.set_item("rotation_errors", arrays_out::owned(py, rotation_errors))?;
        let closest = answer.closest.as_ref().map(|closest| {
            let told = PyDict::new(py);
            told.set_item("positions", arrays_out::owned(py, closest.positions.clone()))?;
            told.set_item("position_error", closest.position_error)?;
            told.set_item("rotation_error", closest.rotation_error)?;
            PyResult::Ok(told)
        });
        told.set_item("closest", closest.transpose()?)?;
        told.set_item("tries", answer.tries)?;
        Ok(told)
    }
}

/// A robot that was pickled: read again from where it came.
#[pyfunction]
#[allow(clippy::too_many_arguments, reason = "what a pickle holds")]
pub fn _restore_robot(
    py: Python<'_>,
    urdf: PathBuf,
    srdf: Option<PathBuf>,
    limits: Option<PathBuf>,
    base: Option<String>,
    tip: Option<String>,
    fixed: Vec<(String, f64)>,
    packages: BTreeMap<String, PathBuf>,
) -> PyResult<Robot> {
    Robot::open(py, ArmFiles { urdf, srdf, limits, base, tip, fixed }, packages)
}
