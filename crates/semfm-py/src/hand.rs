//! `Hand`, and the region that it touches.

use std::path::PathBuf;
use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use semfm::align::Sim3;
use semfm::demonstration::region_of_hands;
use semfm::observe::{self, ContactSettings, HandFrame, HandPart, HandShift, read_vertex_ids};
use serde_json::Value;

use crate::align::Alignment;
use crate::arrays_in::{self, Axis};
use crate::interruptible::{guard, run};
use crate::mesh::{Mesh, from_any};
use crate::observation::{Observation, observation_of};
use crate::region::Region;
use crate::shared::Shared;
use crate::tracker::pose_with_scale;
use crate::{arrays_out, errors, json, pictures};

/// A hand: a surface, open at the wrist or not, or points alone, in metres.
///
/// Made by `read_hand` of what programs reconstruct, by `from_mask` of what a depth camera saw, or of arrays.
///
/// Parameters
/// ----------
/// points : (n, 3) array_like
///     In metres, in the frame of a camera (x right, y down, z forward) or of a mesh.
/// faces : (m, 3) array_like, optional
///     Ids of points; a cloud where none are given. Fingers are known for MANO's 778 points.
/// joints : (21, 3) array_like, optional
///     The wrist, then four joints of each finger from the thumb on, its tip last: tells fingers for other hands.
///
/// Examples
/// --------
/// >>> import semfm, semfm.zoo
/// >>> ball = semfm.zoo.icosphere(4)
/// >>> mug = semfm.Mesh(0.05 * ball.vertices, ball.faces)
/// >>> fist = semfm.Hand(0.04 * ball.vertices + [0.089, 0, 0], ball.faces)
/// >>> touched = semfm.find_contact(mug, fist)
/// >>> bool((mug.vertices[touched.region.vertices, 0] > 0.035).all())
/// True
#[pyclass(frozen, module = "semfm")]
pub struct Hand {
    inner: Arc<observe::Hand>,
    shift: Option<HandShift>,
}

impl Hand {
    fn of(hand: observe::Hand, shift: Option<HandShift>) -> Self {
        Self { inner: Arc::new(hand), shift }
    }
}

#[pymethods]
impl Hand {
    #[new]
    #[pyo3(signature = (points, faces=None, *, joints=None))]
    fn new(
        points: &Bound<'_, PyAny>,
        faces: Option<&Bound<'_, PyAny>>,
        joints: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let py = points.py();
        let points = arrays_in::points(points, "points")?;
        let faces = match faces {
            Some(faces) => arrays_in::ids(faces, "faces", &[Axis::Any("m"), Axis::Is(3)])?.0,
            None => Vec::new(),
        };
        let joints = joints.map(|joints| arrays_in::points(joints, "joints")).transpose()?;
        let hand = guard(py, || {
            let hand = observe::Hand::new(points, faces.as_chunks::<3>().0.to_vec())?;
            Ok(match joints {
                Some(joints) => hand.with_joints(&joints)?,
                None => hand,
            })
        })?;
        Ok(Self::of(hand, None))
    }

    /// A hand of which a camera saw one side: the points under its mask, with the thickness of a finger behind them.
    ///
    /// Parameters
    /// ----------
    /// observation : Observation
    /// mask : str or (height, width) array_like, optional
    ///     The hand's mask: a name, an array of dtype bool, or the only one that there is where none is given.
    ///
    /// Returns
    /// -------
    /// Hand
    ///     In the camera's frame.
    #[staticmethod]
    #[pyo3(signature = (observation, mask=None))]
    fn from_mask(
        observation: &Bound<'_, PyAny>,
        mask: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let py = observation.py();
        let seen = SeenHand::of(observation, mask)?;
        let hand = run(py, None, move |_| Ok(observe::Hand::from_mask(&seen.0, seen.mask())?))?;
        Ok(Self::of(hand, None))
    }

    /// (n, 3) float64 array: the points, metres.
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        arrays_out::points(py, self.inner.points())
    }

    /// (m, 3) uint32 array: the faces, a read-only view; none for points alone.
    #[getter]
    fn faces<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        arrays_out::rows(slf, 3, |hand| hand.inner.faces().as_flattened())
    }

    /// list of str, optional: what each point belongs to: ``thumb``, ``index``, ``middle``, ``ring``, ``little`` or
    /// ``palm``; None where that is not known.
    #[getter]
    fn parts(&self) -> Option<Vec<&'static str>> {
        self.inner.parts().map(|parts| parts.iter().map(|part| HandPart::name(*part)).collect())
    }

    /// dict, optional: how `read_hand` brought it to its measured depth: ``along_axis`` and ``residual`` in metres, the
    /// ``scale`` by which its width changed, and ``n_measured`` points; None where it did not.
    #[getter]
    fn shift<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(HandShift { along_axis, residual, scale, n_measured }) = self.shift else {
            return Ok(None);
        };
        let shift = PyDict::new(py);
        shift.set_item("along_axis", along_axis)?;
        shift.set_item("residual", residual)?;
        shift.set_item("scale", scale)?;
        shift.set_item("n_measured", n_measured)?;
        Ok(Some(shift))
    }

    fn __len__(&self) -> usize {
        self.inner.points().len()
    }

    fn __repr__(&self) -> String {
        let (n, faces) = (self.inner.points().len(), self.inner.faces().len());
        let parts = if self.inner.parts().is_some() { ", fingers known" } else { "" };
        format!("Hand({n} points, {faces} triangles{parts})")
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Pickled<'py>)> {
        let py = slf.py();
        let restore = py.import("semfm._semfm")?.getattr("_restore_hand")?;
        let hand = slf.get();
        let shift = hand.shift.map(|shift| {
            let HandShift { along_axis, residual, scale, n_measured } = shift;
            (along_axis, residual, scale, n_measured)
        });
        let parts = hand.parts().map(|parts| parts.into_iter().map(ToOwned::to_owned).collect());
        let is_one_sided = hand.inner.is_one_sided();
        Ok((restore, (hand.points(py)?, Self::faces(slf)?, parts, is_one_sided, shift)))
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }
}

/// What a pickle holds: points, faces, the names of the points' parts, whether it is one side of a hand, and the shift
/// (`along_axis`, `residual`, `scale`, `n_measured`).
type Pickled<'py> = (
    Bound<'py, PyAny>,
    Bound<'py, PyAny>,
    Option<Vec<String>>,
    bool,
    Option<(f64, f64, f64, usize)>,
);

/// A hand out of a pickle.
#[pyfunction]
#[pyo3(signature = (points, faces, parts, is_one_sided, shift))]
pub fn _restore_hand(
    points: &Bound<'_, PyAny>,
    faces: &Bound<'_, PyAny>,
    parts: Option<Vec<String>>,
    is_one_sided: bool,
    shift: Option<(f64, f64, f64, usize)>,
) -> PyResult<Hand> {
    let py = points.py();
    let part_of = |name: &String| {
        let part = HandPart::ALL.into_iter().find(|part| part.name() == name);
        part.ok_or_else(|| errors::invalid(py, "pickle", "the parts of a hand", name))
    };
    let parts =
        parts.map(|parts| parts.iter().map(part_of).collect::<PyResult<_>>()).transpose()?;
    let mut hand = Hand::new(points, Some(faces), None)?;
    let inner = guard(py, || {
        let hand = (*hand.inner).clone();
        let hand = if is_one_sided { hand.one_sided() } else { hand };
        Ok(match parts {
            Some(parts) => hand.with_parts(parts)?,
            None => hand,
        })
    })?;
    hand.inner = Arc::new(inner);
    hand.shift = shift.map(|(along_axis, residual, scale, n_measured)| HandShift {
        along_axis,
        residual,
        scale,
        n_measured,
    });
    Ok(hand)
}

/// An observation with the place of the hand's mask in it.
struct SeenHand(Arc<observe::Observation>, usize);

impl SeenHand {
    fn of(observation: &Bound<'_, PyAny>, mask: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let py = observation.py();
        let seen: &Observation = observation_of(observation)?;
        let frame = seen.frame(py, mask)?;
        match frame.mask {
            Some(at) => Ok(Self(frame.seen, at)),
            None => Err(errors::invalid(py, "mask", "that of a hand", "none")),
        }
    }

    fn mask(&self) -> &observe::Mask {
        &self.0.masks()[self.1]
    }
}

/// Reads a hand as ``semfm-cli region --hand`` does: a mesh or cloud (HaMeR, WiLoR, SAM 3D Body), or .npz of vertices and
/// joints, in metres.
///
/// Parameters
/// ----------
/// path : path
///     OpenGL's axes (y up, z towards the viewer) are seen and turned.
/// vertices : (v,) array_like or path, optional
///     Ids of the hand's vertices, where the file is a whole body.
/// mirrored : bool, default False
///     The hand stands in the file as in a mirror: a left one that was not turned back.
/// observation : Observation, optional
///     What the camera saw: the mask cuts the hand out of a whole body, and a depth image tells how far away it is: each
///     point keeps its pixel.
/// mask : str or (height, width) array_like, optional
///     The hand's mask in it: a name, an array of dtype bool, or the only one that there is where none is given.
/// focal : float, optional
///     Focal length in pixels that the hand was made with, where it is not the camera's; the observation then has a depth
///     image.
///
/// Returns
/// -------
/// Hand
///
/// Raises
/// ------
/// InvalidInput
///     `mask` without an observation, `focal` without one that has a depth image: nothing would read them.
#[pyfunction]
#[pyo3(signature = (path, *, vertices=None, mirrored=false, observation=None, mask=None, focal=None))]
pub fn read_hand(
    py: Python<'_>,
    path: PathBuf,
    vertices: Option<&Bound<'_, PyAny>>,
    mirrored: bool,
    observation: Option<&Bound<'_, PyAny>>,
    mask: Option<&Bound<'_, PyAny>>,
    focal: Option<f64>,
) -> PyResult<Hand> {
    let ids = match vertices {
        Some(ids) => match ids.extract::<PathBuf>() {
            Ok(path) => Some(guard(py, || Ok(read_vertex_ids(&path)?))?),
            Err(_) => Some(arrays_in::ids(ids, "vertices", &[Axis::Any("v")])?.0),
        },
        None => None,
    };
    let seen = observation.map(|seen| SeenHand::of(seen, mask)).transpose()?;
    if seen.is_none() && mask.is_some() {
        return Err(errors::invalid(py, "mask", "an observation beside it", "none"));
    }
    if focal.is_some() && seen.as_ref().is_none_or(|seen| seen.0.depth().is_none()) {
        let expected = "an observation with a depth image beside it";
        return Err(errors::invalid(py, "focal", expected, "none"));
    }
    let (hand, shift) = run(py, None, move |_| {
        let mut hand = observe::read_hand(&path)?;
        if mirrored {
            hand = hand.mirrored();
        }
        if let Some(ids) = &ids {
            hand = hand.cut_to(ids)?;
        }
        Ok(match &seen {
            Some(seen) => hand.before_camera(&seen.0, seen.mask(), focal, ids.is_some())?,
            None => (hand, None),
        })
    })?;
    Ok(Hand::of(hand, shift))
}

/// The region that hands touch, and how sure that is: see `find_contact`.
#[pyclass(frozen, module = "semfm")]
pub struct TouchedRegion {
    mesh: Shared<semfm::Mesh>,
    region: Shared<semfm::Region>,
    /// The report as `semfm.contact/1`, and its lines for people.
    report: Value,
    lines: Vec<String>,
}

#[pymethods]
impl TouchedRegion {
    /// Region: the region, with smooth weights.
    #[getter]
    fn region(&self) -> Region {
        Region { inner: self.region.clone() }
    }

    /// dict: for each of the ``frames`` what was touched, by which finger, and what is doubtful (`semfm.contact/1`).
    #[getter]
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.report)
    }

    /// list of str: the same in words.
    #[getter]
    fn lines(&self) -> Vec<String> {
        self.lines.clone()
    }

    /// A picture of the mesh with the region, which notebooks show by themselves.
    ///
    /// Returns
    /// -------
    /// bytes
    ///     PNG.
    fn picture<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let (mesh, region) = (self.mesh.clone(), self.region.clone());
        pictures::png(py, move |path, task| {
            pictures::write_mesh_picture(path, &mesh, region.weights(), task)
        })
    }

    fn _repr_png_<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyBytes>> {
        pictures::shown(self.picture(py))
    }

    fn __repr__(&self) -> String {
        let (inside, n) = (self.region.vertices().len(), self.region.n_vertices());
        format!("TouchedRegion({inside} of {n} vertices; {})", self.lines.join("; "))
    }

    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, (Mesh, Region, String, Vec<String>))> {
        let restore = py.import("semfm._semfm")?.getattr("_restore_touched_region")?;
        let mesh = Mesh { inner: self.mesh.clone() };
        Ok((restore, (mesh, self.region(), self.report.to_string(), self.lines())))
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }
}

/// A touched region out of a pickle.
#[pyfunction]
pub fn _restore_touched_region(
    mesh: &Bound<'_, Mesh>,
    region: &Bound<'_, Region>,
    report: &str,
    lines: Vec<String>,
) -> PyResult<TouchedRegion> {
    let py = mesh.py();
    let report = serde_json::from_str(report)
        .map_err(|error| errors::invalid(py, "pickle", "a contact", &error.to_string()))?;
    let (mesh, region) = (mesh.get().inner.clone(), region.get().inner.clone());
    Ok(TouchedRegion { mesh, region, report, lines })
}

/// Finds where a hand touches a mesh: ``semfm-cli region --hand``.
///
/// The hand is moved by what makes it rest on the surface, within what it may be off; weights are averaged over the places
/// that are likely, and over frames.
///
/// Parameters
/// ----------
/// mesh : mesh_like
/// hands : Hand or list of Hand
///     Several are frames of one grasp.
/// camera_from_object : pose_like or list of pose_like, optional
///     How the mesh stands before the camera, scale included: a (4, 4) matrix, an `Alignment` or the path of its file. The
///     hands are then in the camera's frame. One for all frames, or a list with one for each. Without it mesh and hands
///     are in one frame, in metres.
///
/// Returns
/// -------
/// TouchedRegion
///
/// Raises
/// ------
/// InvalidInput
///     A hand that touches nothing, with its distance, and one that cannot be a hand in metres.
#[pyfunction]
#[pyo3(signature = (mesh, hands, *, camera_from_object=None))]
pub fn find_contact(
    mesh: &Bound<'_, PyAny>,
    hands: &Bound<'_, PyAny>,
    camera_from_object: Option<&Bound<'_, PyAny>>,
) -> PyResult<TouchedRegion> {
    let py = mesh.py();
    let hands = hands_of(hands)?;
    let poses = camera_from_object.map(poses_of).transpose()?.unwrap_or_default();
    if poses.len() > 1 && poses.len() != hands.len() {
        let expected = format!("1 or {}, one for each hand", hands.len());
        let found = poses.len().to_string();
        return Err(errors::invalid(py, "camera_from_object", &expected, &found));
    }
    let mesh = from_any(mesh, "mesh")?;
    let touched_mesh = mesh.clone();
    let touched = run(py, None, move |_| {
        let pose = |i: usize| poses.get(i).or(poses.first()).copied();
        let frames = hands.into_iter().enumerate().map(|(i, (hand, shift))| HandFrame {
            hand: (*hand).clone(),
            camera_from_object: pose(i),
            shift,
        });
        let frames: Vec<HandFrame> = frames.collect();
        region_of_hands(&touched_mesh, &frames, &ContactSettings::default())
    })?;
    let report = serde_json::to_value(&touched.report)
        .map_err(|error| errors::internal(py, &error.to_string()))?;
    let lines = touched.report.lines();
    Ok(TouchedRegion { mesh, region: Shared::new(touched.region), report, lines })
}

/// A hand, or a list of hands.
fn hands_of(value: &Bound<'_, PyAny>) -> PyResult<Vec<(Arc<observe::Hand>, Option<HandShift>)>> {
    let of = |hand: &Bound<'_, PyAny>| {
        let hand = hand.cast::<Hand>();
        let hand = hand.map_err(|_| errors::wrong_type("hands", "a Hand, or Hands", value))?;
        Ok((hand.get().inner.clone(), hand.get().shift))
    };
    if value.cast::<Hand>().is_ok() {
        return Ok(vec![of(value)?]);
    }
    let list = value.try_iter();
    let list = list.map_err(|_| errors::wrong_type("hands", "a Hand, or Hands", value))?;
    list.map(|hand| of(&hand?)).collect()
}

/// A pose, or several: of a matrix, what is iterated are rows of numbers.
fn poses_of(value: &Bound<'_, PyAny>) -> PyResult<Vec<Sim3>> {
    let is_named = |pose: &Bound<'_, PyAny>| {
        pose.cast::<Alignment>().is_ok() || pose.extract::<PathBuf>().is_ok()
    };
    let several = match value.try_iter() {
        Ok(several) if !is_named(value) => several.collect::<PyResult<Vec<_>>>()?,
        _ => Vec::new(),
    };
    let n_axes = value.py().import("numpy")?.getattr("ndim")?;
    let are_poses = match several.first() {
        Some(first) => is_named(first) || n_axes.call1((first,))?.extract::<usize>()? == 2,
        None => false,
    };
    if !are_poses {
        return Ok(vec![pose_with_scale(value, "camera_from_object")?]);
    }
    several.iter().map(|pose| pose_with_scale(pose, "camera_from_object")).collect()
}
