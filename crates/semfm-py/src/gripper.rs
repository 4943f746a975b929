//! `Gripper`: a two-finger gripper.

use std::path::PathBuf;
use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use semfm::robot::{self, GripperSettings, JointPosition, Pose};

use crate::arrays_out;
use crate::interruptible::run;
use crate::mesh::Mesh;
use crate::shared::Shared;

/// A parallel-jaw gripper: +z along the approach, y along the closing direction, origin between the
/// finger pads (TCP), metres.
///
/// Parameters
/// ----------
/// name_or_path : path
///     A built-in gripper (see `Gripper.builtin_names`) or a URDF file.
/// packages : dict, optional
///     Folders of the packages that a URDF names (``package://NAME/…``).
///
/// Examples
/// --------
/// >>> import semfm
/// >>> gripper = semfm.Gripper("franka")
/// >>> gripper.opening
/// (0.0, 0.08)
/// >>> gripper.joints_at(0.04)
/// {'panda_finger_joint1': 0.02, 'panda_finger_joint2': 0.02}
#[pyclass(frozen, module = "semfm")]
pub struct Gripper {
    pub inner: Arc<robot::Gripper>,
    source: PathBuf,
    packages: Vec<(String, PathBuf)>,
}

#[pymethods]
impl Gripper {
    #[new]
    #[pyo3(signature = (name_or_path, *, packages=None))]
    fn new(
        py: Python<'_>,
        name_or_path: PathBuf,
        packages: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let packages: Vec<(String, PathBuf)> = match packages {
            Some(packages) => packages
                .iter()
                .map(|(name, folder)| Ok((name.extract()?, folder.extract()?)))
                .collect::<PyResult<_>>()?,
            None => Vec::new(),
        };
        let (source, folders) = (name_or_path.clone(), packages.iter().cloned().collect());
        let gripper = run(py, None, move |_| {
            let settings = GripperSettings { packages: folders, ..Default::default() };
            Ok(robot::Gripper::open(&name_or_path.to_string_lossy(), &settings)?)
        })?;
        Ok(Self { inner: Arc::new(gripper), source, packages })
    }

    /// Names of the built-in grippers.
    ///
    /// Returns
    /// -------
    /// list of str
    #[staticmethod]
    fn builtin_names() -> Vec<&'static str> {
        robot::BUILTIN_GRIPPERS.iter().map(|gripper| gripper.name).collect()
    }

    /// str: as in the URDF, or of the built-in set.
    #[getter]
    fn name(&self) -> &str {
        &self.inner.name
    }

    /// tuple of float, float: distances between the pads that the joints can reach, metres.
    #[getter]
    fn opening(&self) -> (f64, f64) {
        (*self.inner.opening.start(), *self.inner.opening.end())
    }

    /// tuple of float, float: the pads' sides across (x) and along (z) the approach, metres.
    #[getter]
    fn pad(&self) -> (f64, f64) {
        (self.inner.pad[0], self.inner.pad[1])
    }

    /// list of str: what was replaced or left out when the URDF was read.
    #[getter]
    fn notes(&self) -> Vec<String> {
        self.inner.notes.clone()
    }

    /// The TCP in the flange's frame.
    ///
    /// Parameters
    /// ----------
    /// width : float
    ///     Distance between the pads, metres; outside of the opening, the nearest inside.
    ///
    /// Returns
    /// -------
    /// (4, 4) float64 array
    fn flange_from_tcp<'py>(&self, py: Python<'py>, width: f64) -> PyResult<Bound<'py, PyAny>> {
        matrix(py, self.inner.flange_from_tcp_at(width))
    }

    /// The gripper's collision shapes as a mesh, for pictures and viewers.
    ///
    /// Parameters
    /// ----------
    /// width : float
    ///     Distance between the pads, metres; outside of the opening, the nearest inside.
    ///
    /// Returns
    /// -------
    /// Mesh
    ///     In the TCP frame, metres.
    fn mesh_at(&self, py: Python<'_>, width: f64) -> PyResult<Mesh> {
        let gripper = self.inner.clone();
        let mesh = run(py, None, move |_| Ok(gripper.mesh_at(width)?))?;
        Ok(Mesh { inner: Shared::new(mesh) })
    }

    /// Positions of the joints that open and close the gripper.
    ///
    /// Parameters
    /// ----------
    /// width : float
    ///     Distance between the pads, metres.
    ///
    /// Returns
    /// -------
    /// dict
    ///     Metres or radians; empty where the joints are not known by name.
    fn joints_at<'py>(&self, py: Python<'py>, width: f64) -> PyResult<Bound<'py, PyDict>> {
        let joints = PyDict::new(py);
        for JointPosition { name, position } in self.inner.joints_at(width) {
            joints.set_item(name, position)?;
        }
        Ok(joints)
    }

    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, (PathBuf, Vec<(String, PathBuf)>))> {
        let restore = py.import("semfm._semfm")?.getattr("_restore_gripper")?;
        Ok((restore, (self.source.clone(), self.packages.clone())))
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }

    fn __repr__(&self) -> String {
        let (closed, open) = self.opening();
        format!("Gripper({}, {closed} to {open:.3} m)", self.inner.name)
    }
}

/// A gripper that was pickled: read again from where it came.
#[pyfunction]
pub fn _restore_gripper(
    py: Python<'_>,
    source: PathBuf,
    packages: Vec<(String, PathBuf)>,
) -> PyResult<Gripper> {
    let folders = PyDict::new(py);
    for (name, folder) in packages {
        folders.set_item(name, folder)?;
    }
    Gripper::new(py, source, Some(&folders))
}

/// A pose as a homogeneous matrix.
pub fn matrix(py: Python<'_>, pose: Pose) -> PyResult<Bound<'_, PyAny>> {
    let rows = pose.to_mat4().transpose().to_cols_array();
    arrays_out::owned_rows(py, rows.to_vec(), 4)
}
