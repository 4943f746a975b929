//! `Camera` and the rig around an object.

use pyo3::prelude::*;
use pyo3::types::PyTuple;
use semfm::geom::math::{DAffine3, DMat3, DVec3};
use semfm::geom::{Intrinsics, Pinhole, PixelDepth};
use semfm::views::{self, RigSettings};

use crate::arrays::{self, Axis};
use crate::lend;
use crate::mesh::{Reduced, from_any};
use crate::work::{guard, run};

/// A pinhole camera without distortion, posed in the object's frame: x right, y down, z forward.
///
/// A point projects to ``u = fx x / z + cx``, ``v = fy y / z + cy`` in pixels; the centre of the
/// pixel in column c and row r is at (c + ½, r + ½).
///
/// Parameters
/// ----------
/// width : int
///     Pixels.
/// height : int
///     Pixels.
/// fx : float
///     Focal length along x, in pixels.
/// fy : float
///     Focal length along y, in pixels.
/// cx : float
///     Principal point, x, in pixels.
/// cy : float
///     Principal point, y, in pixels.
/// camera_from_object : (4, 4) array_like
///     Rigid motion from the object's frame to the camera's, as a homogeneous matrix.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> import semfm
/// >>> camera = semfm.Camera(64, 48, 70, 70, 32, 24, np.eye(4))
/// >>> camera.project([[0, 0, 2]]).tolist()
/// [[32.0, 24.0, 2.0]]
#[pyclass(frozen, module = "semfm")]
#[derive(Clone, Copy)]
pub struct Camera {
    pub camera: Pinhole,
}

#[pymethods]
impl Camera {
    #[new]
    fn new(
        width: u32,
        height: u32,
        fx: f64,
        fy: f64,
        cx: f64,
        cy: f64,
        camera_from_object: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let name = "camera_from_object";
        let (m, _) = arrays::floats(camera_from_object, name, &[Axis::Is(4), Axis::Is(4)])?;
        let py = camera_from_object.py();
        if m[12..] != [0.0, 0.0, 0.0, 1.0] {
            let found = format!("{:?}", &m[12..]);
            return Err(crate::errors::invalid(py, name, "the last row 0, 0, 0, 1", &found));
        }
        let row = |i: usize| DVec3::new(m[4 * i], m[4 * i + 1], m[4 * i + 2]);
        let turn = DMat3::from_cols(row(0), row(1), row(2)).transpose();
        let shift = DVec3::new(m[3], m[7], m[11]);
        let camera_from_object = DAffine3::from_mat3_translation(turn, shift);
        let intrinsics = Intrinsics { width, height, fx, fy, cx, cy };
        let camera =
            guard(py, || Ok(Pinhole::with_pixel_centres_at_half(intrinsics, camera_from_object)?))?;
        Ok(Self { camera })
    }

    /// int: pixels.
    #[getter]
    fn width(&self) -> u32 {
        self.camera.width()
    }

    /// int: pixels.
    #[getter]
    fn height(&self) -> u32 {
        self.camera.height()
    }

    /// float: focal length along x, in pixels.
    #[getter]
    fn fx(&self) -> f64 {
        self.camera.fx()
    }

    /// float: focal length along y, in pixels.
    #[getter]
    fn fy(&self) -> f64 {
        self.camera.fy()
    }

    /// float: principal point, x, in pixels.
    #[getter]
    fn cx(&self) -> f64 {
        self.camera.cx()
    }

    /// float: principal point, y, in pixels.
    #[getter]
    fn cy(&self) -> f64 {
        self.camera.cy()
    }

    /// (4, 4) float64 array: rigid motion from the object's frame to the camera's.
    #[getter]
    fn camera_from_object<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let (turn, shift) =
            (self.camera.camera_from_world().matrix3, self.camera.camera_from_world().translation);
        let mut rows = Vec::with_capacity(16);
        for i in 0..3 {
            rows.extend(turn.row(i).to_array());
            rows.push(shift[i]);
        }
        rows.extend([0.0, 0.0, 0.0, 1.0]);
        lend::owned_rows(py, rows, 4)
    }

    /// (3,) float64 array: where the camera stands, in the object's frame.
    #[getter]
    fn eye<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        lend::owned(py, self.camera.eye().to_array().to_vec())
    }

    /// Pixel position and depth of points.
    ///
    /// Parameters
    /// ----------
    /// points : (n, 3) array_like
    ///     In the object's frame.
    ///
    /// Returns
    /// -------
    /// (n, 3) float64 array
    ///     u, v, and depth z; u and v mean nothing where z ≤ 0.
    fn project<'py>(&self, points: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let projected = arrays::points(points, "points")?;
        let projected = projected.into_iter().flat_map(|p| {
            let PixelDepth { u, v, z } = self.camera.project(p);
            [u, v, z]
        });
        lend::owned_rows(points.py(), projected.collect(), 3)
    }

    fn __repr__(&self) -> String {
        let Intrinsics { width, height, fx, .. } = self.camera.intrinsics();
        format!("Camera({width} × {height}, focal length {fx:.1} px)")
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Self>().is_ok_and(|other| other.get().camera == self.camera)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Reduced<'py>> {
        let py = slf.py();
        let Intrinsics { width, height, fx, fy, cx, cy } = slf.get().camera.intrinsics();
        let pose = slf.get().camera_from_object(py)?;
        let parts = (width, height, fx, fy, cx, cy, pose);
        Ok((slf.get_type(), parts.into_pyobject(py)?.into_any()))
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }
}

/// Cameras all around an object, each zoomed and centred on its silhouette.
///
/// Parameters
/// ----------
/// mesh : mesh_like
/// count : int, default 14
///     Number of views.
/// size : int, default 224
///     Side of the square images, in pixels.
/// field_of_view : float, default 0.5235987755982988
///     Full angle that the bounding sphere would fill, in radians.
/// fill : float, default 0.8
///     Share of the image's side that the silhouette fills.
/// max_zoom : float, default 1.5
///     Largest zoom beyond the fit of the bounding sphere.
/// principal_frame : bool, default True
///     Pose the cameras in the object's principal frame, else in the file's with z up.
/// close_ups : int, default 0
///     Close-ups beside each view, along the silhouette's longer side.
///
/// Returns
/// -------
/// list of Camera
#[pyfunction]
#[pyo3(signature = (
    mesh, *, count=14, size=224, field_of_view=std::f64::consts::FRAC_PI_6, fill=0.8, max_zoom=1.5,
    principal_frame=true, close_ups=0
))]
#[pyo3(
    text_signature = "(mesh, *, count=14, size=224, field_of_view=0.5235987755982988, fill=0.8, max_zoom=1.5, principal_frame=True, close_ups=0)"
)]
#[allow(clippy::too_many_arguments, reason = "keywords of a Python function")]
pub fn rig(
    mesh: &Bound<'_, PyAny>,
    count: usize,
    size: u32,
    field_of_view: f64,
    fill: f64,
    max_zoom: f64,
    principal_frame: bool,
    close_ups: usize,
) -> PyResult<Vec<Camera>> {
    let settings =
        RigSettings { count, size, field_of_view, fill, max_zoom, principal_frame, close_ups };
    let held = from_any(mesh, "mesh")?;
    let cameras = run(mesh.py(), None, move |_| Ok(views::rig(&held, &settings)?))?;
    Ok(cameras.into_iter().map(|camera| Camera { camera }).collect())
}

/// One camera that looks along ``-direction`` at the whole object: for pictures of results.
///
/// Parameters
/// ----------
/// mesh : mesh_like
/// direction : (3,) array_like
///     From the object towards the camera, in the mesh's frame.
/// up : (3,) array_like
///     Upwards in the image, in the mesh's frame.
/// size : int, default 224
///     Side of the square image, in pixels.
/// fill : float, default 0.8
///     Share of the image's side that the silhouette fills.
///
/// Returns
/// -------
/// Camera
#[pyfunction]
#[pyo3(signature = (mesh, direction, up, *, size=224, fill=0.8))]
pub fn camera_towards(
    mesh: &Bound<'_, PyAny>,
    direction: &Bound<'_, PyAny>,
    up: &Bound<'_, PyAny>,
    size: u32,
    fill: f64,
) -> PyResult<Camera> {
    let settings = RigSettings { size, fill, ..Default::default() };
    let (direction, up) = (arrays::point(direction, "direction")?, arrays::point(up, "up")?);
    let held = from_any(mesh, "mesh")?;
    let camera =
        run(mesh.py(), None, move |_| Ok(views::camera_towards(&held, direction, up, &settings)?))?;
    Ok(Camera { camera })
}

/// The cameras of a list.
pub fn list(cameras: &Bound<'_, PyAny>) -> PyResult<Vec<Pinhole>> {
    let mut out = Vec::new();
    for camera in cameras.try_iter()? {
        let camera = camera?;
        let camera = camera
            .cast::<Camera>()
            .map_err(|_| crate::errors::wrong_type("cameras", "Camera objects", &camera))?;
        out.push(camera.get().camera);
    }
    Ok(out)
}

/// A tuple of a width and a height, as NumPy has them: rows first.
pub fn rows_and_columns<'py>(
    py: Python<'py>,
    camera: &Pinhole,
    depth: &[usize],
) -> PyResult<Bound<'py, PyTuple>> {
    let mut shape = vec![camera.height() as usize, camera.width() as usize];
    shape.extend(depth);
    PyTuple::new(py, shape)
}
