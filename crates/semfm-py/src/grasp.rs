//! `Grasp`: one gripper pose.

use pyo3::prelude::*;
use pyo3::types::PyDict;
use semfm::geom::math::{DMat4, DVec3};
use semfm::grasp::{self, Pose};

use crate::grasp_pickle::PickledGrasp;
use crate::gripper::matrix;
use crate::{arrays_out, errors};
/// One parallel-jaw grasp, in the frame of the object scaled to metres.
#[pyclass(frozen, module = "semfm")]
#[derive(Clone)]
pub struct Grasp {
    pub grasp: grasp::Grasp,
    pub camera_from_object: Option<Pose>,
    /// What the gripper can close to, metres.
    pub least_opening: f64,
}

#[pymethods]
impl Grasp {
    /// (4, 4) float64 array: the gripper's TCP frame in the object's frame.
    #[getter]
    fn object_from_tcp<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        matrix(py, self.grasp.object_from_tcp)
    }

    /// (4, 4) float64 array, optional: the same in the camera's frame; None where `find_grasps` was told
    /// no `camera_from_object`.
    #[getter]
    fn camera_from_tcp<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let pose = self.camera_from_object.map(|camera| camera * self.grasp.object_from_tcp);
        pose.map(|pose| matrix(py, pose)).transpose()
    }

    /// (3,) float64 array: the TCP, between the pads, in the object's frame, metres.
    #[getter]
    fn position<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        arrays_out::owned(py, self.grasp.object_from_tcp.translation.to_array().to_vec())
    }

    /// (3,) float64 array: the unit direction in which the hand comes (+z of the TCP), in the object's
    /// frame.
    #[getter]
    fn approach<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        let approach = self.grasp.object_from_tcp.rotation * DVec3::Z;
        arrays_out::owned(py, approach.to_array().to_vec())
    }

    /// float: distance between the closed pads where they touch nothing yet, metres.
    #[getter]
    fn width(&self) -> f64 {
        self.grasp.width
    }

    /// float: distance between the two contacts along the closing direction, metres: where the pads touch.
    #[getter]
    fn contact_width(&self) -> f64 {
        self.grasp.contact_width()
    }

    /// float: what to tell a hand that stops at a force, metres: below contact, so that the pads press, and no
    /// less than the gripper can close to.
    #[getter]
    fn command_width(&self) -> f64 {
        self.grasp.command_width().max(self.least_opening)
    }

    /// float: distance between the pads on the way in, metres.
    #[getter]
    fn opening(&self) -> f64 {
        self.grasp.opening
    }

    /// (2, 3) float64 array: one contact for each pad, in the object's frame, metres.
    #[getter]
    fn contacts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        rows(py, self.grasp.contacts)
    }

    /// (2, 3) float64 array: the object's unit normal at each contact, in the object's frame.
    #[getter]
    fn normals<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        rows(py, self.grasp.normals)
    }

    /// float: Ferrari and Canny's ε.
    #[getter]
    fn epsilon(&self) -> f64 {
        self.grasp.epsilon
    }

    /// float: angle by which the object turns while the pads close, radians.
    #[getter]
    fn closing_turn(&self) -> f64 {
        self.grasp.closing_turn
    }

    /// float, optional: the probability that the grasp holds while the object is lifted, shaken and tilted;
    /// None where no `mass` was given.
    #[getter]
    fn hold(&self) -> Option<f64> {
        self.grasp.hold
    }

    /// float: the probability that the grasp holds, times what is asked beyond that; without a `mass`, as for
    /// an object of .3 kg.
    #[getter]
    fn score(&self) -> f64 {
        self.grasp.score
    }

    /// dict: the terms of the score, each 0 to 1.
    #[getter]
    fn terms<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let terms = PyDict::new(py);
        for (name, value) in &self.grasp.terms {
            terms.set_item(name, value)?;
        }
        Ok(terms)
    }

    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, (String, Option<[f64; 16]>, f64))> {
        let restore = py.import("semfm._semfm")?.getattr("_restore_grasp")?;
        let plain = serde_json::to_string(&PickledGrasp::of(&self.grasp))
            .map_err(|error| errors::internal(py, &error.to_string()))?;
        Ok((restore, (plain, self.camera_from_object.map(columns), self.least_opening)))
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }

    fn __repr__(&self) -> String {
        format!("Grasp(score {:.2}, width {:.4} m)", self.grasp.score, self.grasp.width)
    }
}

fn rows(py: Python<'_>, points: [DVec3; 2]) -> PyResult<Bound<'_, PyAny>> {
    arrays_out::owned_rows(py, points.iter().flat_map(|p| p.to_array()).collect(), 3)
}

/// A grasp out of a pickle.
#[pyfunction]
pub fn _restore_grasp(
    py: Python<'_>,
    plain: &str,
    camera_from_object: Option<[f64; 16]>,
    least_opening: f64,
) -> PyResult<Grasp> {
    let plain: PickledGrasp = serde_json::from_str(plain)
        .map_err(|error| errors::invalid(py, "pickle", "a grasp", &error.to_string()))?;
    let camera_from_object = camera_from_object.map(of_columns);
    Ok(Grasp { grasp: plain.restore(), camera_from_object, least_opening })
}

pub(crate) fn columns(pose: Pose) -> [f64; 16] {
    pose.to_mat4().to_cols_array()
}

pub(crate) fn of_columns(columns: [f64; 16]) -> Pose {
    Pose::from_mat4(DMat4::from_cols_array(&columns))
}
