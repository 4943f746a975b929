//! `Tracker`: an object of known shape in each frame of a depth camera.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::ThreadId;
use std::time::Duration;

use pyo3::prelude::*;
use semfm::ObjectFrame;
use semfm::align::Sim3;
use semfm::files::{TrackLine, read_pose};
use semfm::track::{DepthFrame, TrackSettings, Tracker as Following};

use crate::align::Alignment;
use crate::arrays_in::{self, Axis};
use crate::interruptible::{guard, run};
use crate::mesh::{Mesh, from_any};
use crate::observation::observation_of;
use crate::region::{Region, region_of};
use crate::shared::Shared;
use crate::{arrays_out, errors, gripper, json};

/// Follows an object of known shape through the frames of a depth camera.
///
/// Each `update` takes the next frame and says where the object is, how sure that is, and in which state tracking
/// stands; ``semfm-cli track`` does the same to a bag or a BOP scene. `docs/observations.md` tells how it works and
/// where it fails.
///
/// Parameters
/// ----------
/// mesh : mesh_like
///     In any frame and unit.
/// init : (4, 4) array_like or Alignment or path, optional
///     The pose in the first frame (`Alignment.camera_from_object`, scale included); searched where none is given.
/// scale : float, optional
///     Metres per unit of the mesh, 1 for a mesh in metres; that of `init`, else of the first alignment, where none is
///     given.
/// region : Region or path, optional
///     A region of the mesh, whose confidence is followed, too.
/// hypotheses : int, default 96
///     Poses that are tried in a frame in which the object is not where it was.
/// seed : int, default 0
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> import semfm, semfm.zoo
/// >>> ball = semfm.zoo.icosphere(3)  # of radius 1, here 5 cm
/// >>> camera = semfm.Pinhole.with_pixel_centres_at_half(160, 120, 150, 150, 80, 60)
/// >>> tracker = semfm.Tracker(ball, scale=0.05)
/// >>> for x in (0.02, 0.025, 0.03):
/// ...     posed = semfm.Mesh(0.05 * ball.vertices + [x, 0, 0.5], ball.faces)
/// ...     depth = semfm.render(posed, [camera])[0].depth
/// ...     seen = semfm.Observation(camera, depth=np.where(np.isfinite(depth), depth, 1.0))
/// ...     pose = tracker.update(seen)
/// >>> pose.state, bool(abs(pose.camera_from_object[0, 3] - 0.03) < 0.003)
/// ('tracking', True)
#[pyclass(frozen, module = "semfm")]
pub struct Tracker {
    mesh: Shared<semfm::Mesh>,
    following: Arc<Mutex<Slot>>,
}

/// Where the tracker is: work on a pool's thread has it to itself, so that it never waits for a lock.
enum Slot {
    Free(Box<Following>),
    /// Working, for a call of this thread, which waits for it; `None` once that call was interrupted.
    Busy(Option<ThreadId>),
    /// Work on it ended with a bug.
    Gone,
}

/// Between two looks at whether another thread's frame is done.
const NAP: Duration = Duration::from_millis(5);

/// A tracker that was taken out of its slot; it goes back when this is dropped.
struct Taken {
    slot: Arc<Mutex<Slot>>,
    following: Option<Box<Following>>,
}

impl Drop for Taken {
    fn drop(&mut self) {
        let kept = self.following.take().filter(|_| !std::thread::panicking());
        *locked(&self.slot) = kept.map_or(Slot::Gone, Slot::Free);
    }
}

fn locked(slot: &Mutex<Slot>) -> MutexGuard<'_, Slot> {
    slot.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A call that waits for work on the tracker; when it ends, whatever the work does, its thread may call again.
struct Call<'a> {
    slot: &'a Mutex<Slot>,
    thread: ThreadId,
}

impl Drop for Call<'_> {
    fn drop(&mut self) {
        if let Slot::Busy(thread) = &mut *locked(self.slot) {
            *thread = thread.filter(|thread| *thread != self.thread);
        }
    }
}

/// What became of an attempt to take the tracker.
enum Attempt {
    Taken(Taken),
    Busy,
    /// Taken by a call of the same thread, which cannot end before this one.
    Within,
    Gone,
}

impl Tracker {
    fn try_to_take(&self, thread: ThreadId) -> Attempt {
        let mut slot = locked(&self.following);
        match std::mem::replace(&mut *slot, Slot::Busy(Some(thread))) {
            Slot::Free(following) => {
                Attempt::Taken(Taken { slot: self.following.clone(), following: Some(following) })
            }
            Slot::Busy(other) => {
                *slot = Slot::Busy(other);
                if other == Some(thread) { Attempt::Within } else { Attempt::Busy }
            }
            Slot::Gone => {
                *slot = Slot::Gone;
                Attempt::Gone
            }
        }
    }

    /// Waits, without the interpreter's lock, for the frames of other threads.
    fn taken(&self, py: Python<'_>, thread: ThreadId) -> PyResult<Taken> {
        loop {
            match self.try_to_take(thread) {
                Attempt::Taken(taken) => return Ok(taken),
                Attempt::Busy => {}
                Attempt::Within => {
                    let expected = "calls after the one that is at work";
                    let found = "one from within it (by a signal's handler)";
                    return Err(errors::invalid(py, "tracker", expected, found));
                }
                Attempt::Gone => {
                    return Err(errors::internal(py, "this tracker was lost by an earlier one"));
                }
            }
            py.detach(|| std::thread::sleep(NAP));
            py.check_signals()?;
        }
    }

    /// Works with the tracker.
    fn with<T: Send + 'static>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut Following, &semfm::Task) -> semfm::Result<T> + Send + 'static,
    ) -> PyResult<T> {
        let thread = std::thread::current().id();
        let mut taken = self.taken(py, thread)?;
        let _call = Call { slot: &self.following, thread };
        run(py, None, move |task| match &mut taken.following {
            Some(following) => work(following, task),
            None => Err(semfm::geom::Error::Cancelled.into()),
        })
    }
}

#[pymethods]
impl Tracker {
    #[new]
    #[pyo3(signature = (mesh, *, init=None, scale=None, region=None, hypotheses=96, seed=0))]
    fn new(
        mesh: &Bound<'_, PyAny>,
        init: Option<&Bound<'_, PyAny>>,
        scale: Option<f64>,
        region: Option<&Bound<'_, PyAny>>,
        hypotheses: usize,
        seed: u64,
    ) -> PyResult<Self> {
        let py = mesh.py();
        let mesh = from_any(mesh, "mesh")?;
        let region = region.map(|region| region_of(region, &mesh)).transpose()?;
        let init = init.map(|init| pose_with_scale(init, "init")).transpose()?;
        let settings = TrackSettings { init, scale, hypotheses, seed };
        let shape = mesh.clone();
        let following = run(py, None, move |task| {
            let following = Following::new(&shape, &settings, task)?;
            Ok(match region {
                Some(region) => following.with_region(region.weights())?,
                None => following,
            })
        })?;
        let following = Arc::new(Mutex::new(Slot::Free(Box::new(following))));
        Ok(Self { mesh, following })
    }

    /// The object in the next frame.
    ///
    /// Where the call is interrupted, the frame counts as one that was seen. Calls of several threads wait for each other;
    /// one from within another, by a signal's handler, raises `InvalidInput`.
    ///
    /// Parameters
    /// ----------
    /// observation : Observation
    ///     With a depth image; later than the one before, where both say when they were.
    /// mask : str or (height, width) array_like, optional
    ///     The object's mask, which helps to find it: a name, an array of dtype bool, or the only one that there is where
    ///     none is given. That a frame has no mask of the name says that the object is not visible in it.
    ///
    /// Returns
    /// -------
    /// TrackedPose
    #[pyo3(signature = (observation, *, mask=None))]
    fn update(
        &self,
        observation: &Bound<'_, PyAny>,
        mask: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<TrackedPose> {
        let py = observation.py();
        let seen = observation_of(observation)?;
        let frame = match mask.map(|mask| mask.extract::<String>()) {
            Some(Ok(name)) => {
                guard(py, || ObjectFrame::where_visible(seen.inner.clone(), Some(&name)))?
            }
            _ => seen.frame(py, mask)?,
        };
        let record = self.with(py, move |tracker, task| {
            let frame = DepthFrame {
                depth: frame.seen.depth_image()?,
                camera: frame.seen.camera(),
                mask: frame.mask().map(|mask| &mask.marked[..]),
                time_nanos: frame.seen.time_nanos,
            };
            Ok(tracker.step(&frame, task)?)
        })?;
        Ok(TrackedPose { line: Arc::new(TrackLine::new(&record)) })
    }

    /// Region, optional: the region as the frames so far refined it: each weight times the confidence that surface is
    /// where the mesh has it; None without a region.
    #[getter]
    fn refined_region(&self, py: Python<'_>) -> PyResult<Option<Region>> {
        let region = self.with(py, |tracker, _| {
            let weights = tracker.refined_region()?;
            Ok(weights.map(semfm::Region::from_weights).transpose()?)
        })?;
        Ok(region.map(|region| Region { inner: Shared::new(region) }))
    }

    /// Mesh: the object.
    #[getter]
    fn mesh(&self) -> Mesh {
        Mesh { inner: self.mesh.clone() }
    }

    fn __repr__(&self) -> String {
        format!("Tracker({} vertices)", self.mesh.n_vertices())
    }
}

/// A pose with its scale: a matrix (4 × 4), an alignment, or a file of one.
pub fn pose_with_scale(value: &Bound<'_, PyAny>, name: &str) -> PyResult<Sim3> {
    let py = value.py();
    if let Ok(aligned) = value.cast::<Alignment>() {
        return Ok(aligned.get().similarity());
    }
    if let Ok(path) = value.extract::<PathBuf>() {
        return guard(py, || read_pose(&path));
    }
    let (numbers, _) = arrays_in::floats(value, name, &[Axis::Is(4), Axis::Is(4)])?;
    let rows = [0, 1, 2, 3].map(|i| [0, 1, 2, 3].map(|j| numbers[4 * i + j]));
    Sim3::from_rows(rows).map_err(|error| errors::raise(py, &error.into()))
}

/// An object in one frame, as a line of ``semfm-cli track`` has it: see `Tracker.update`.
#[pyclass(frozen, module = "semfm")]
pub struct TrackedPose {
    line: Arc<TrackLine>,
}

#[pymethods]
impl TrackedPose {
    /// int: number of the frame among those that the tracker was given, from 0.
    #[getter]
    fn frame(&self) -> usize {
        self.line.frame
    }

    /// int, optional: the frame's time, nanoseconds.
    #[getter]
    fn time_nanos(&self) -> Option<u64> {
        self.line.time_nanos
    }

    /// str: ``"new"``, ``"tracking"``, ``"occluded"``, ``"lost"`` or ``"reacquired"``.
    #[getter]
    fn state(&self) -> &str {
        &self.line.state
    }

    /// (4, 4) float64 array, optional: from the mesh's frame and units to the camera's frame in metres, the scale is
    /// included; None while lost.
    #[getter]
    fn camera_from_object<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let rows = self.line.camera_from_object;
        rows.map(|rows| arrays_out::owned_rows(py, rows.concat(), 4)).transpose()
    }

    /// (4, 4) float64 array, optional: the same once the object is measured in metres, for `find_grasps`.
    #[getter]
    fn rigid<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.pose(py)?.map(|pose| gripper::matrix(py, pose.rigid())).transpose()
    }

    /// float, optional: metres per unit of the mesh; None while lost.
    #[getter]
    fn scale(&self, py: Python<'_>) -> PyResult<Option<f64>> {
        Ok(self.pose(py)?.map(|pose| pose.scale))
    }

    /// float: probability that the surface stands within a tenth of its diameter of where the pose puts it.
    #[getter]
    fn probability(&self) -> f64 {
        self.line.probability
    }

    /// (6, 6) float64 array, optional: covariance of x, y, z of the mesh's origin (metres) and of the rotation vector
    /// (radians), along the camera's axes; None while lost.
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let rows = self.line.covariance;
        rows.map(|rows| arrays_out::owned_rows(py, rows.concat(), 6)).transpose()
    }

    /// float, optional: greatest standard deviation of the object's middle, metres.
    #[getter]
    fn position_std(&self) -> Option<f64> {
        self.line.position_std_m
    }

    /// float, optional: greatest standard deviation of the rotation, radians; π where nothing seen determines it.
    #[getter]
    fn rotation_std(&self) -> Option<f64> {
        self.line.rotation_std
    }

    /// dict: what the image says of the pose: ``visible_share``, ``hidden_share``, ``through_share``, ``outline_share``,
    /// ``residual_m`` and ``probability`` by this image alone.
    #[getter]
    fn evidence<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.line.evidence)
    }

    /// dict, optional: the region in this frame: ``confidence``, ``visible_share``, ``observed_share``, ``deviation_m``
    /// and its middle ``centre_m``; None without one.
    #[getter]
    fn region<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.line.region.as_ref().map(|region| json::to_python(py, region)).transpose()
    }

    /// The line of ``semfm-cli track`` (`semfm.track/1`).
    ///
    /// Returns
    /// -------
    /// dict
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.line.to_json())
    }

    /// The same as text: to the byte what the command writes, without the line's end.
    ///
    /// Returns
    /// -------
    /// str
    fn to_json(&self) -> String {
        self.line.to_json().to_string()
    }

    fn __repr__(&self) -> String {
        let TrackLine { frame, state, probability, camera_from_object, .. } = &*self.line;
        let place = camera_from_object.map_or(String::new(), |rows| {
            format!(", at {:.3} {:.3} {:.3} m", rows[0][3], rows[1][3], rows[2][3])
        });
        format!("TrackedPose(frame {frame}: {state}{place}, probability {probability:.2})")
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Self>().is_ok_and(|other| *other.get().line == *self.line)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        let restore = py.import("semfm._semfm")?.getattr("_restore_tracked_pose")?;
        Ok((restore, (self.to_json(),)))
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }
}

impl TrackedPose {
    fn pose(&self, py: Python<'_>) -> PyResult<Option<Sim3>> {
        let pose = self.line.camera_from_object.map(Sim3::from_rows).transpose();
        pose.map_err(|error| errors::raise(py, &error.into()))
    }
}

/// A tracked pose out of a pickle.
#[pyfunction]
pub fn _restore_tracked_pose(py: Python<'_>, text: &str) -> PyResult<TrackedPose> {
    let line = serde_json::from_str(text)
        .map_err(|error| errors::invalid(py, "pickle", "a tracked pose", &error.to_string()))?;
    Ok(TrackedPose { line: Arc::new(line) })
}
