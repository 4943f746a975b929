//! `Observation`: what a depth camera saw at one moment.

use std::path::PathBuf;
use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyString};
use semfm::ObjectFrame;
use semfm::geom::math::{DAffine3, DVec3};
use semfm::observe::{self, ObservationFiles, SeenObject, depth_of_numbers};
use semfm_show::write_sheet;

use crate::arrays_in::{self, Axis};
use crate::interruptible::{guard, run};
use crate::observation_parts::{
    Pictures, axes, check_scale, given_pose, lens_of, mask_files, masks_of,
};
use crate::observed_object::{ObservedObject, surface_settings};
use crate::pinhole::{Pinhole, camera_of_matrix, pose_of, rows_and_columns};
use crate::{arrays_out, errors, pictures};

/// What a camera saw at one moment: colour, depth and masks on one grid of pixels, and the camera.
///
/// Whatever it came from, depth is in metres, 0 is where nothing came back, and the pictures are without
/// distortion. `read` makes one of files, `read_observations` of a BOP scene or a bag.
///
/// Parameters
/// ----------
/// intrinsics : Pinhole or (3, 3) array_like
///     The camera, or the matrix of a calibration, counted as by `Pinhole.from_matrix`.
/// color : (height, width, 3) array_like, optional
///     sRGB, of dtype uint8.
/// depth : (height, width) array_like, optional
///     Depth along the camera's axis. What is 0 or not finite is no return; nor is 65535 in whole numbers.
/// depth_scale : float, optional
///     Units of `depth` to the metre; 1000 for whole numbers and 1 for floats where none is given.
/// cloud : (n, 3) array_like, optional
///     Points in the camera's frame, metres, where the sensor gave them in place of a depth image.
/// masks : dict or list of (height, width) array_like, optional
///     Which pixels show what, of dtype bool, by name; those of a list are called 0, 1 and so on.
/// distortion : (c,) array_like, optional
///     Coefficients of the lens in OpenCV's order; the pictures come out without distortion.
/// distortion_model : str, optional
///     ``"plumb_bob"`` or ``"rational_polynomial"`` (4, 5 or 8 coefficients), or ``"equidistant"`` (4, a fisheye);
///     ``"plumb_bob"`` where none is given.
/// camera_from_world : (4, 4) array_like, optional
///     Where the camera stood; that of a `Pinhole`, else its own frame is the world, where none is given.
/// time_nanos : int, optional
///     When it was, in nanoseconds.
///
/// Raises
/// ------
/// InvalidInput
///     Pictures of different sizes, a mask that marks nothing or everything, an argument that nothing would read
///     (`depth_scale` without `depth`). A depth image in which nothing came back is none of it.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> import semfm
/// >>> depth = np.full((48, 64), 0.7)
/// >>> depth[16:32, 20:44] = 0.5
/// >>> k = [[60, 0, 31.5], [0, 60, 23.5], [0, 0, 1]]
/// >>> seen = semfm.Observation(k, depth=depth, masks={"box": depth < 0.6})
/// >>> seen
/// Observation(64 × 48, depth, 1 mask)
/// >>> seen.cloud("box").shape
/// (384, 3)
/// >>> seen.surface().mesh
/// Mesh(308 vertices, 546 triangles)
#[pyclass(frozen, module = "semfm")]
pub struct Observation {
    pub inner: Arc<observe::Observation>,
}

#[pymethods]
impl Observation {
    #[new]
    #[pyo3(signature = (
        intrinsics, *, color=None, depth=None, depth_scale=None, cloud=None, masks=None, distortion=None,
        distortion_model=None, camera_from_world=None, time_nanos=None
    ))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments, one for each part")]
    fn new(
        intrinsics: &Bound<'_, PyAny>,
        color: Option<&Bound<'_, PyAny>>,
        depth: Option<&Bound<'_, PyAny>>,
        depth_scale: Option<f64>,
        cloud: Option<&Bound<'_, PyAny>>,
        masks: Option<&Bound<'_, PyAny>>,
        distortion: Option<&Bound<'_, PyAny>>,
        distortion_model: Option<&str>,
        camera_from_world: Option<&Bound<'_, PyAny>>,
        time_nanos: Option<u64>,
    ) -> PyResult<Self> {
        let py = intrinsics.py();
        check_scale(py, depth_scale, depth.is_some())?;
        let given = intrinsics.cast::<Pinhole>().ok().map(|pinhole| pinhole.get().camera);
        let size = given.map(|camera| [camera.height() as usize, camera.width() as usize]);
        let Pictures { size, color, depth } = Pictures::of(size, color, depth)?;
        if color.is_none() && depth.is_none() && cloud.is_none() {
            return Err(errors::invalid(
                py,
                "observation",
                "color, depth or cloud",
                "none of them",
            ));
        }
        let Some(size) = size else {
            let expected = "a picture that tells the size, or a Pinhole";
            return Err(errors::invalid(py, "intrinsics", expected, "neither"));
        };
        let [height, width] = size;
        arrays_in::within_memory(py, "pixels of the camera", height * width, 3)?;
        let camera = match given {
            Some(camera) => camera,
            None => {
                let size = [width as u32, height as u32];
                camera_of_matrix(intrinsics, "intrinsics", size, DAffine3::IDENTITY)?
            }
        };
        let pose = camera_from_world.map(|pose| pose_of(Some(pose))).transpose()?;
        let cloud = cloud.map(|cloud| arrays_in::points(cloud, "cloud")).transpose()?;
        let masks = masks.map(|masks| masks_of(masks, size)).transpose()?.unwrap_or_default();
        let lens = lens_of(py, distortion, distortion_model)?;
        let seen = run(py, None, move |_| {
            let mut seen = observation(camera, color, depth, depth_scale, cloud)?;
            seen.time_nanos = time_nanos;
            for (name, marked) in masks {
                seen = seen.with_mask(name, marked)?;
            }
            if let Some(lens) = lens {
                seen = seen.undistorted(&lens)?;
            }
            Ok(match pose {
                Some(pose) => seen.posed(pose)?,
                None => seen,
            })
        })?;
        Ok(Self { inner: Arc::new(seen) })
    }

    /// Reads an observation of single files, as ``semfm-cli frames`` does: see `docs/observations.md` for their forms.
    ///
    /// Parameters
    /// ----------
    /// intrinsics : path
    ///     The camera (JSON); a lens that distorts is taken out of the pictures.
    /// color : path, optional
    ///     A PNG, JPEG or EXR.
    /// depth : path, optional
    ///     A 16-bit PNG, an EXR or .npy, registered to the colour.
    /// depth_scale : float, optional
    ///     Units of the depth to the metre; 1000 for whole numbers and 1 for floats where none is given.
    /// mask : path or list of path or dict, optional
    ///     What the pixels show, ``FILE`` or ``FILE#LABEL``; called as its file is, or as the dict says.
    /// hand_mask : path, optional
    ///     The pixels of a hand: one more mask, called ``hand``.
    /// camera_from_world : path or (4, 4) array_like, optional
    ///     Where the camera stood.
    ///
    /// Returns
    /// -------
    /// Observation
    #[staticmethod]
    #[pyo3(signature = (
        intrinsics, *, color=None, depth=None, depth_scale=None, mask=None, hand_mask=None, camera_from_world=None
    ))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments, one for each file")]
    fn read(
        py: Python<'_>,
        intrinsics: PathBuf,
        color: Option<PathBuf>,
        depth: Option<PathBuf>,
        depth_scale: Option<f64>,
        mask: Option<&Bound<'_, PyAny>>,
        hand_mask: Option<&Bound<'_, PyAny>>,
        camera_from_world: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        check_scale(py, depth_scale, depth.is_some())?;
        let mut masks = mask_files(mask)?;
        masks.extend(mask_files(hand_mask)?.into_iter().map(|hand| hand.named("hand")));
        let camera_from_world = camera_from_world.map(given_pose).transpose()?;
        let calibration = intrinsics;
        let files =
            ObservationFiles { color, depth, depth_scale, calibration, masks, camera_from_world };
        let seen = run(py, None, move |_| Ok(files.read()?))?;
        Ok(Self { inner: Arc::new(seen) })
    }

    /// Pinhole: the camera, in the world that its pose says.
    #[getter]
    fn camera(&self) -> Pinhole {
        Pinhole { camera: *self.inner.camera() }
    }

    /// (height, width, 3) uint8 array, optional: sRGB, a read-only view; None where there is no picture.
    #[getter]
    fn color<'py>(slf: &Bound<'py, Self>) -> PyResult<Option<Bound<'py, PyAny>>> {
        if slf.get().inner.color().is_none() {
            return Ok(None);
        }
        fn bytes(seen: &Observation) -> &[u8] {
            seen.inner.color().map_or(&[], <[[u8; 3]]>::as_flattened)
        }
        let shape = rows_and_columns(slf.py(), slf.get().inner.camera(), &[3])?;
        arrays_out::vector(slf, bytes)?.call_method1("reshape", (shape,)).map(Some)
    }

    /// (height, width) float32 array, optional: metres along the camera's axis, 0 where nothing came back, a read-only
    /// view; None where there is no depth image.
    #[getter]
    fn depth<'py>(slf: &Bound<'py, Self>) -> PyResult<Option<Bound<'py, PyAny>>> {
        if slf.get().inner.depth().is_none() {
            return Ok(None);
        }
        fn metres(seen: &Observation) -> &[f32] {
            seen.inner.depth().map_or(&[], semfm::align::DepthImage::metres)
        }
        let shape = rows_and_columns(slf.py(), slf.get().inner.camera(), &[])?;
        arrays_out::vector(slf, metres)?.call_method1("reshape", (shape,)).map(Some)
    }

    /// dict: (height, width) bool arrays by name, in the order of their files, read-only views.
    #[getter]
    fn masks<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyDict>> {
        let masks = PyDict::new(slf.py());
        for (at, mask) in slf.get().inner.masks().iter().enumerate() {
            // Of two of one name, the first is the one that the name means.
            if masks.contains(&mask.name)? {
                continue;
            }
            let shape = rows_and_columns(slf.py(), slf.get().inner.camera(), &[])?;
            let marked = arrays_out::vector(slf, |seen| seen.inner.masks()[at].marked.as_slice())?;
            masks.set_item(&mask.name, marked.call_method1("reshape", (shape,))?)?;
        }
        Ok(masks)
    }

    /// list of dict: objects whose poses somebody knew, as in a BOP scene: ``id``, ``camera_from_object`` (4, 4) in
    /// metres, and the name of its ``mask`` or None.
    #[getter]
    fn objects<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let one = |object: &SeenObject| {
            let entry = PyDict::new(py);
            entry.set_item("id", object.id)?;
            entry.set_item(
                "camera_from_object",
                arrays_out::motion(py, &object.camera_from_object)?,
            )?;
            let mask = object.mask.map(|mask| self.inner.masks()[mask].name.as_str());
            entry.set_item("mask", mask)?;
            Ok(entry)
        };
        self.inner.objects().iter().map(one).collect()
    }

    /// int, optional: when it was, in nanoseconds of its recorder's clock; None where nobody said.
    #[getter]
    fn time_nanos(&self) -> Option<u64> {
        self.inner.time_nanos
    }

    /// The points that were seen, or those under a mask, for `align` and for scenes of `find_grasps`.
    ///
    /// Parameters
    /// ----------
    /// mask : str or (height, width) array_like, optional
    ///     A mask by name, or an array of dtype bool; all points where none is given.
    ///
    /// Returns
    /// -------
    /// (n, 3) float64 array
    ///     In the camera's own frame (x right, y down, z forward), metres.
    #[pyo3(signature = (mask=None))]
    fn cloud<'py>(
        &self,
        py: Python<'py>,
        mask: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let frame = match mask {
            Some(mask) => self.frame(py, Some(mask))?,
            None => ObjectFrame { seen: self.inner.clone(), mask: None },
        };
        let points = run(py, None, move |_| Ok(frame.seen.points(frame.mask())?.object))?;
        arrays_out::points(py, &points)
    }

    /// Points of what was seen beside an object, as obstacles of grasps: one in 4 mm, within 0.4 m of it.
    ///
    /// Parameters
    /// ----------
    /// mask : str or (height, width) array_like, optional
    ///     The object's mask: a name, an array of dtype bool, or the only one that there is where none is given.
    ///
    /// Returns
    /// -------
    /// (n, 3) float64 array
    ///     In the camera's own frame, metres.
    #[pyo3(signature = (mask=None))]
    fn surroundings<'py>(
        &self,
        py: Python<'py>,
        mask: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let frame = self.frame(py, mask)?;
        let Some(mask) = frame.mask else {
            return Err(errors::invalid(py, "mask", "that of an object", "none"));
        };
        let points =
            run(py, None, move |_| Ok(frame.seen.surroundings(&frame.seen.masks()[mask])?))?;
        arrays_out::points(py, &points)
    }

    /// What the camera saw of an object as an object, in the camera's own frame, metres: what ``semfm-cli surface``
    /// makes. Several frames of known poses: `merged_surface`.
    ///
    /// Parameters
    /// ----------
    /// mask : str or (height, width) array_like, optional
    ///     The object's mask: a name, an array of dtype bool, or the only one that there is where none is given; without
    ///     any, all that was seen is the object.
    /// smooth_pixels : int, default 3
    ///     Radius of the window in which depth is smoothed, 0 to 20.
    /// trim_pixels : int, default 1
    ///     Pixels along the mask's outline that are left out, 0 to 100.
    /// most_vertices : int, default 20000
    ///     Of a larger picture every second pixel is taken, or fewer.
    ///
    /// Returns
    /// -------
    /// ObservedObject
    #[pyo3(signature = (mask=None, *, smooth_pixels=3, trim_pixels=1, most_vertices=20000))]
    fn surface(
        &self,
        py: Python<'_>,
        mask: Option<&Bound<'_, PyAny>>,
        smooth_pixels: usize,
        trim_pixels: usize,
        most_vertices: usize,
    ) -> PyResult<ObservedObject> {
        let settings = surface_settings(py, smooth_pixels, trim_pixels, most_vertices)?;
        ObservedObject::new(py, vec![self.frame(py, mask)?], settings)
    }

    /// The colours, or the depth where there are none, as notebooks show them by themselves.
    ///
    /// Returns
    /// -------
    /// bytes
    ///     PNG.
    fn picture<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let seen = self.inner.clone();
        pictures::png(py, move |path, _| {
            Ok(write_sheet(path, &[pictures::view_of_observation(&seen)], 1)?)
        })
    }

    fn _repr_png_<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyBytes>> {
        pictures::shown(self.picture(py))
    }

    fn __repr__(&self) -> String {
        let (seen, camera) = (&self.inner, self.inner.camera());
        let mut parts = vec![format!("{} × {}", camera.width(), camera.height())];
        parts.extend(seen.color().map(|_| "colour".to_owned()));
        parts.extend(seen.depth().map(|_| "depth".to_owned()));
        parts.extend(seen.cloud().map(|cloud| format!("cloud of {} points", cloud.len())));
        match seen.masks().len() {
            0 => {}
            1 => parts.push("1 mask".to_owned()),
            n => parts.push(format!("{n} masks")),
        }
        format!("Observation({})", parts.join(", "))
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Self>().is_ok_and(|other| *other.get().inner == *self.inner)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Pickled<'py>)> {
        let py = slf.py();
        let restore = py.import("semfm._semfm")?.getattr("_restore_observation")?;
        let seen = &slf.get().inner;
        let cloud = seen.cloud().map(|points| arrays_out::points(py, points)).transpose()?;
        let masks = seen.masks().iter().enumerate().map(|(at, mask)| {
            let marked = arrays_out::vector(slf, |seen| seen.inner.masks()[at].marked.as_slice())?;
            Ok((mask.name.clone(), marked))
        });
        let objects = seen.objects().iter();
        let objects =
            objects.map(|o| Ok((o.id, arrays_out::motion(py, &o.camera_from_object)?, o.mask)));
        let pickled = (
            slf.get().camera(),
            Self::color(slf)?,
            Self::depth(slf)?,
            cloud,
            masks.collect::<PyResult<_>>()?,
            objects.collect::<PyResult<_>>()?,
            seen.time_nanos,
        );
        Ok((restore, pickled))
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }
}

/// What a pickle holds: camera, colour, depth, cloud, masks by name, objects with the places of their masks, time.
type Pickled<'py> = (
    Pinhole,
    Option<Bound<'py, PyAny>>,
    Option<Bound<'py, PyAny>>,
    Option<Bound<'py, PyAny>>,
    Vec<(String, Bound<'py, PyAny>)>,
    Vec<(u32, Bound<'py, PyAny>, Option<usize>)>,
    Option<u64>,
);

/// An observation out of a pickle.
#[pyfunction]
#[pyo3(signature = (camera, color, depth, cloud, masks, objects, time_nanos))]
pub fn _restore_observation(
    camera: &Bound<'_, Pinhole>,
    color: Option<&Bound<'_, PyAny>>,
    depth: Option<&Bound<'_, PyAny>>,
    cloud: Option<&Bound<'_, PyAny>>,
    masks: Vec<(String, Bound<'_, PyAny>)>,
    objects: Vec<(u32, Bound<'_, PyAny>, Option<usize>)>,
    time_nanos: Option<u64>,
) -> PyResult<Observation> {
    let (py, camera) = (camera.py(), camera.get().camera);
    let size = Some([camera.height() as usize, camera.width() as usize]);
    let Pictures { color, depth, .. } = Pictures::of(size, color, depth)?;
    let cloud = cloud.map(|cloud| arrays_in::points(cloud, "cloud")).transpose()?;
    let mut seen = guard(py, || observation(camera, color, depth, None, cloud))?;
    seen.time_nanos = time_nanos;
    for (name, marked) in masks {
        let marked = arrays_in::mask(&marked, "mask", &[Axis::Any("pixels")])?.0;
        seen = guard(py, || Ok(seen.with_mask(name, marked)?))?;
    }
    for (id, pose, mask) in objects {
        let object = SeenObject { id, camera_from_object: pose_of(Some(&pose))?, mask };
        seen = guard(py, || Ok(seen.with_object(object)?))?;
    }
    Ok(Observation { inner: Arc::new(seen) })
}

/// What a camera saw, without masks.
fn observation(
    camera: semfm::geom::Pinhole,
    color: Option<Vec<[u8; 3]>>,
    depth: Option<observe::Numbers>,
    depth_scale: Option<f64>,
    cloud: Option<Vec<DVec3>>,
) -> semfm::Result<observe::Observation> {
    let (width, height) = (camera.width() as usize, camera.height() as usize);
    let mut seen = observe::Observation::new(camera);
    if let Some(color) = color {
        seen = seen.with_color(color)?;
    }
    if let Some(numbers) = depth {
        seen = seen.with_depth(depth_of_numbers(width, height, numbers, depth_scale)?)?;
    }
    if let Some(cloud) = cloud {
        seen = seen.with_cloud(cloud)?;
    }
    Ok(seen)
}

impl Observation {
    /// The frame with the object's mask: of a name, given as an array, or the only one.
    pub fn frame(&self, py: Python<'_>, mask: Option<&Bound<'_, PyAny>>) -> PyResult<ObjectFrame> {
        let seen = self.inner.clone();
        let Some(mask) = mask.filter(|mask| !mask.is_none()) else {
            return guard(py, || ObjectFrame::of(seen, None));
        };
        if let Ok(name) = mask.cast::<PyString>() {
            let name: String = name.extract()?;
            return guard(py, || ObjectFrame::of(seen, Some(&name)));
        }
        let camera = self.inner.camera();
        let size = [camera.height() as usize, camera.width() as usize];
        let marked = arrays_in::mask(mask, "mask", &axes(Some(size)))?.0;
        let seen = guard(py, || Ok((*seen).clone().with_mask("mask", marked)?))?;
        let at = seen.masks().len() - 1;
        Ok(ObjectFrame { seen: Arc::new(seen), mask: Some(at) })
    }
}

/// An observation that is given as an argument.
pub fn observation_of<'a>(value: &'a Bound<'_, PyAny>) -> PyResult<&'a Observation> {
    let seen = value.cast::<Observation>();
    Ok(seen.map_err(|_| errors::wrong_type("observation", "an Observation", value))?.get())
}
