//! `Pinhole`, a camera, and the rig around an object.

use pyo3::prelude::*;
use pyo3::types::PyTuple;
use semfm::align::DepthImage;
use semfm::geom::math::{DAffine3, DMat3, DVec3};
use semfm::geom::{self, Intrinsics, PixelDepth};
use semfm::views::{self, RigSettings};

use crate::arrays_in::{self, Axis};
use crate::arrays_out;
use crate::interruptible::{guard, run};
use crate::mesh::from_any;

/// A pinhole camera without distortion: x right, y down, z forward, in the units of the world.
///
/// A point (x, y, z) of the camera's frame projects to ``u = fx x / z + cx``, ``v = fy y / z + cy``
/// in pixels, where the centre of pixel (0, 0) is at (½, ½). The world is the frame that the camera
/// stands in: an object's in rendered views. The two constructors differ in how the numbers that
/// they are given count pixels.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> import semfm
/// >>> camera = semfm.Pinhole.with_pixel_centres_at_half(64, 48, 70, 70, 32, 24, np.eye(4))
/// >>> camera.project([[0, 0, 2]]).tolist()
/// [[32.0, 24.0, 2.0]]
/// >>> camera == semfm.Pinhole.with_pixel_centres_at_integers(
/// ...     64, 48, 70, 70, 31.5, 23.5, np.eye(4))
/// True
#[pyclass(frozen, module = "semfm")]
#[derive(Clone, Copy)]
pub struct Pinhole {
    pub camera: geom::Pinhole,
}

#[pymethods]
impl Pinhole {
    /// A camera whose numbers count as ours do: the centre of pixel (0, 0) is at (½, ½).
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
    /// camera_from_world : (4, 4) array_like, optional
    ///     Rigid motion from the world's frame to the camera's, as a homogeneous matrix; without one
    ///     the camera's own frame is the world.
    ///
    /// Returns
    /// -------
    /// Pinhole
    #[staticmethod]
    #[pyo3(signature = (width, height, fx, fy, cx, cy, camera_from_world=None))]
    #[expect(clippy::too_many_arguments, reason = "a camera's numbers")]
    fn with_pixel_centres_at_half(
        py: Python<'_>,
        width: u32,
        height: u32,
        fx: f64,
        fy: f64,
        cx: f64,
        cy: f64,
        camera_from_world: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let intrinsics = Intrinsics { width, height, fx, fy, cx, cy };
        let pose = pose_of(camera_from_world)?;
        let camera =
            guard(py, || Ok(geom::Pinhole::with_pixel_centres_at_half(intrinsics, pose)?))?;
        Ok(Self { camera })
    }

    /// A camera whose numbers come from a calibration (OpenCV, ROS `CameraInfo`), in which the centre
    /// of pixel (0, 0) is at (0, 0): half a pixel is added to its principal point.
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
    /// camera_from_world : (4, 4) array_like, optional
    ///     Rigid motion from the world's frame to the camera's, as a homogeneous matrix; without one
    ///     the camera's own frame is the world.
    ///
    /// Returns
    /// -------
    /// Pinhole
    #[staticmethod]
    #[pyo3(signature = (width, height, fx, fy, cx, cy, camera_from_world=None))]
    #[expect(clippy::too_many_arguments, reason = "a camera's numbers")]
    fn with_pixel_centres_at_integers(
        py: Python<'_>,
        width: u32,
        height: u32,
        fx: f64,
        fy: f64,
        cx: f64,
        cy: f64,
        camera_from_world: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let intrinsics = Intrinsics { width, height, fx, fy, cx, cy };
        let pose = pose_of(camera_from_world)?;
        let camera =
            guard(py, || Ok(geom::Pinhole::with_pixel_centres_at_integers(intrinsics, pose)?))?;
        Ok(Self { camera })
    }

    /// A camera from a calibration's matrix ``[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]``, counted as by
    /// `with_pixel_centres_at_integers`.
    ///
    /// Parameters
    /// ----------
    /// matrix : (3, 3) array_like
    ///     K of OpenCV, ROS `CameraInfo` and most calibration tools, in pixels.
    /// width : int
    ///     Pixels.
    /// height : int
    ///     Pixels.
    /// camera_from_world : (4, 4) array_like, optional
    ///     Rigid motion from the world's frame to the camera's, as a homogeneous matrix; without one
    ///     the camera's own frame is the world.
    ///
    /// Returns
    /// -------
    /// Pinhole
    ///
    /// Examples
    /// --------
    /// >>> import semfm
    /// >>> camera = semfm.Pinhole.from_matrix([[70, 0, 31.5], [0, 70, 23.5], [0, 0, 1]], 64, 48)
    /// >>> camera.cx, camera.cy
    /// (32.0, 24.0)
    #[staticmethod]
    #[pyo3(signature = (matrix, width, height, *, camera_from_world=None))]
    fn from_matrix(
        matrix: &Bound<'_, PyAny>,
        width: u32,
        height: u32,
        camera_from_world: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let pose = pose_of(camera_from_world)?;
        Ok(Self { camera: camera_of_matrix(matrix, "matrix", [width, height], pose)? })
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

    /// (4, 4) float64 array: rigid motion from the world's frame to the camera's.
    #[getter]
    fn camera_from_world<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        arrays_out::motion(py, &self.camera.camera_from_world())
    }

    /// (3,) float64 array: where the camera stands, in the world's frame.
    #[getter]
    fn eye<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        arrays_out::owned(py, self.camera.eye().to_array().to_vec())
    }

    /// Pixel position and depth of points.
    ///
    /// Parameters
    /// ----------
    /// points : (n, 3) array_like
    ///     In the world's frame.
    ///
    /// Returns
    /// -------
    /// (n, 3) float64 array
    ///     u, v, and depth z; u and v mean nothing where z ≤ 0.
    fn project<'py>(&self, points: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let projected = arrays_in::points(points, "points")?;
        let projected = projected.into_iter().flat_map(|p| {
            let PixelDepth { u, v, z } = self.camera.project(p);
            [u, v, z]
        });
        arrays_out::owned_rows(points.py(), projected.collect(), 3)
    }

    /// Directions of the lines of sight through pixel positions. They start at `eye`.
    ///
    /// Parameters
    /// ----------
    /// pixels : (n, 2) array_like
    ///     u to the right and v down, in pixels; the centre of pixel (0, 0) is at (½, ½).
    ///
    /// Returns
    /// -------
    /// (n, 3) float64 array
    ///     In the world's frame, scaled so that the depth is 1: the point at depth z is
    ///     ``eye + z * ray``.
    ///
    /// Examples
    /// --------
    /// >>> import semfm
    /// >>> camera = semfm.Pinhole.with_pixel_centres_at_half(64, 48, 70, 70, 32, 24)
    /// >>> camera.rays([[32, 24], [67, 24]]).tolist()
    /// [[0.0, 0.0, 1.0], [0.5, 0.0, 1.0]]
    fn rays<'py>(&self, pixels: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let (uv, _) = arrays_in::floats(pixels, "pixels", &[Axis::Any("n"), Axis::Is(2)])?;
        let rays = uv.chunks_exact(2).flat_map(|uv| self.camera.ray(uv[0], uv[1]).to_array());
        arrays_out::owned_rows(pixels.py(), rays.collect(), 3)
    }

    /// The points that the camera sees at pixel positions and depths: undoes `project`.
    ///
    /// Parameters
    /// ----------
    /// pixels : (n, 3) array_like
    ///     u, v, and depth z along the camera's axis, as `project` gives them.
    ///
    /// Returns
    /// -------
    /// (n, 3) float64 array
    ///     In the world's frame.
    fn unproject<'py>(&self, pixels: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let (rows, _) = arrays_in::floats(pixels, "pixels", &[Axis::Any("n"), Axis::Is(3)])?;
        let points = rows
            .as_chunks::<3>()
            .0
            .iter()
            .flat_map(|&[u, v, z]| self.camera.unproject(PixelDepth { u, v, z }).to_array());
        arrays_out::owned_rows(pixels.py(), points.collect(), 3)
    }

    /// The points of a depth image, for `align` and for scenes of `find_grasps`.
    ///
    /// Parameters
    /// ----------
    /// depth : (height, width) array_like
    ///     Depth along the camera's axis, in metres for `align`. What is 0, negative or not finite is no
    ///     point.
    /// mask : (height, width) array_like, optional
    ///     Of dtype bool: only the pixels where it is true.
    ///
    /// Returns
    /// -------
    /// (n, 3) float64 array
    ///     In the world's frame, row by row of the image.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> import semfm
    /// >>> camera = semfm.Pinhole.from_matrix([[50, 0, 1], [0, 50, 1], [0, 0, 1]], 3, 3)
    /// >>> depth = np.zeros((3, 3))
    /// >>> depth[1, 1] = 0.5
    /// >>> camera.cloud(depth).tolist()
    /// [[0.0, 0.0, 0.5]]
    #[pyo3(signature = (depth, *, mask=None))]
    fn cloud<'py>(
        &self,
        depth: &Bound<'py, PyAny>,
        mask: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = depth.py();
        let (width, height) = (self.camera.width() as usize, self.camera.height() as usize);
        let axes = [Axis::Is(height), Axis::Is(width)];
        let (depth, _) = arrays_in::any32(depth, "depth", &axes)?;
        let mask = mask.map(|mask| arrays_in::mask(mask, "mask", &axes)).transpose()?;
        let camera = self.camera;
        let points = run(py, None, move |_| {
            let image = DepthImage::new(width, height, depth)?;
            let mask = mask.as_ref().map(|(mask, _)| mask.as_slice());
            let world_from_camera = camera.camera_from_world().inverse();
            let seen = image.points(&camera, mask)?.object.into_iter();
            Ok(seen.map(|p| world_from_camera.transform_point3(p)).collect::<Vec<_>>())
        })?;
        arrays_out::points(py, &points)
    }

    fn __repr__(&self) -> String {
        let Intrinsics { width, height, fx, .. } = self.camera.intrinsics();
        format!("Pinhole({width} × {height}, focal length {fx:.1} px)")
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Self>().is_ok_and(|other| other.get().camera == self.camera)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let py = slf.py();
        let Intrinsics { width, height, fx, fy, cx, cy } = slf.get().camera.intrinsics();
        let pose = slf.get().camera_from_world(py)?;
        let parts = (width, height, fx, fy, cx, cy, pose).into_pyobject(py)?.into_any();
        Ok((slf.get_type().getattr("with_pixel_centres_at_half")?, parts))
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
/// list of Pinhole
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
) -> PyResult<Vec<Pinhole>> {
    let settings =
        RigSettings { count, size, field_of_view, fill, max_zoom, principal_frame, close_ups };
    let shared = from_any(mesh, "mesh")?;
    let cameras = run(mesh.py(), None, move |_| Ok(views::rig(&shared, &settings)?))?;
    Ok(cameras.into_iter().map(|camera| Pinhole { camera }).collect())
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
/// Pinhole
#[pyfunction]
#[pyo3(signature = (mesh, direction, up, *, size=224, fill=0.8))]
pub fn camera_towards(
    mesh: &Bound<'_, PyAny>,
    direction: &Bound<'_, PyAny>,
    up: &Bound<'_, PyAny>,
    size: u32,
    fill: f64,
) -> PyResult<Pinhole> {
    let settings = RigSettings { size, fill, ..Default::default() };
    let (direction, up) = (arrays_in::point(direction, "direction")?, arrays_in::point(up, "up")?);
    let shared = from_any(mesh, "mesh")?;
    let camera = run(mesh.py(), None, move |_| {
        Ok(views::camera_towards(&shared, direction, up, &settings)?)
    })?;
    Ok(Pinhole { camera })
}

/// The cameras of a list.
pub fn list(cameras: &Bound<'_, PyAny>) -> PyResult<Vec<geom::Pinhole>> {
    let mut out = Vec::new();
    for camera in cameras.try_iter()? {
        let camera = camera?;
        let camera = camera
            .cast::<Pinhole>()
            .map_err(|_| crate::errors::wrong_type("cameras", "Pinhole objects", &camera))?;
        out.push(camera.get().camera);
    }
    Ok(out)
}

/// A tuple of a width and a height, as NumPy has them: rows first.
pub fn rows_and_columns<'py>(
    py: Python<'py>,
    camera: &geom::Pinhole,
    depth: &[usize],
) -> PyResult<Bound<'py, PyTuple>> {
    let mut shape = vec![camera.height() as usize, camera.width() as usize];
    shape.extend(depth);
    PyTuple::new(py, shape)
}

/// The camera of a calibration's matrix (3 × 3), for pictures of a width and a height.
pub fn camera_of_matrix(
    matrix: &Bound<'_, PyAny>,
    name: &str,
    [width, height]: [u32; 2],
    pose: DAffine3,
) -> PyResult<geom::Pinhole> {
    let (k, _) = arrays_in::floats(matrix, name, &[Axis::Is(3), Axis::Is(3)])?;
    if [k[1], k[3], k[6], k[7], k[8]] != [0.0, 0.0, 0.0, 0.0, 1.0] {
        let rows: Vec<&[f64]> = k.chunks(3).collect();
        let expected = "[[fx, 0, cx], [0, fy, cy], [0, 0, 1]] (no skew)";
        let found = format!("the rows {rows:?}");
        return Err(crate::errors::invalid(matrix.py(), name, expected, &found));
    }
    let intrinsics = Intrinsics { width, height, fx: k[0], fy: k[4], cx: k[2], cy: k[5] };
    guard(matrix.py(), || Ok(geom::Pinhole::with_pixel_centres_at_integers(intrinsics, pose)?))
}

/// The pose of a camera; the camera's own frame is the world where none is given.
pub fn pose_of(camera_from_world: Option<&Bound<'_, PyAny>>) -> PyResult<DAffine3> {
    let pose = camera_from_world.map(|pose| rigid_matrix(pose, "camera_from_world"));
    Ok(pose.transpose()?.unwrap_or(DAffine3::IDENTITY))
}

/// A rigid motion given as a homogeneous matrix (4 × 4).
fn rigid_matrix(value: &Bound<'_, PyAny>, name: &str) -> PyResult<DAffine3> {
    let (m, _) = arrays_in::floats(value, name, &[Axis::Is(4), Axis::Is(4)])?;
    if m[12..] != [0.0, 0.0, 0.0, 1.0] {
        let found = format!("{:?}", &m[12..]);
        return Err(crate::errors::invalid(value.py(), name, "the last row [0, 0, 0, 1]", &found));
    }
    let rows = [0, 4, 8].map(|at| DVec3::new(m[at], m[at + 1], m[at + 2]));
    let rotation = DMat3::from_cols(rows[0], rows[1], rows[2]).transpose();
    Ok(DAffine3::from_mat3_translation(rotation, DVec3::new(m[3], m[7], m[11])))
}
