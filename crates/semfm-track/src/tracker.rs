//! The tracker: frames in, records out.

use semfm_align::{DepthImage, Sim3};
use semfm_geom::{Mesh, Pinhole, Task};

use crate::depth_view::DepthView;
use crate::first_pose::FirstPose;
use crate::followed::Followed;
use crate::motion::{of_inner, rigid};
use crate::record::{PoseEvidence, TrackRecord, TrackState};
use crate::settings::TrackSettings;
use crate::surface_memory::SurfaceMemory;
use crate::{Error, Result};

/// What a depth camera saw at one moment.
#[derive(Clone, Copy, Debug)]
pub struct DepthFrame<'a> {
    /// The depth image.
    pub depth: &'a DepthImage,
    /// The camera that took it, of the same size. Its pose tells how it moved between frames; the identity, always, says
    /// that it stands still.
    pub camera: &'a Pinhole,
    /// The pixels of the object, where they are known; they help to find it.
    pub mask: Option<&'a [bool]>,
    /// When it was; later than the frame before.
    pub time_nanos: Option<u64>,
}

/// Follows an object of known shape through the frames of a depth camera.
///
/// In each frame the pose is registered against the depth, then held against it: samples that should be seen and are, that
/// something stands before, and that the camera looked through. What speaks against it makes the object lost, whatever the
/// residual says; while it is lost, some hypotheses are tried in each frame, around where it was and all over the picture.
/// Everything that is kept has a fixed size. The same frames give the same records at every thread count.
///
/// ```
/// use semfm_align::{DepthImage, Sim3};
/// use semfm_geom::math::{DAffine3, DVec3};
/// use semfm_geom::{Intrinsics, Pinhole, Task, zoo::icosphere};
/// use semfm_track::{DepthFrame, TrackSettings, TrackState, Tracker};
/// // A ball of 5 cm, half a metre before a wall.
/// let intrinsics = Intrinsics { width: 160, height: 120, fx: 150.0, fy: 150.0, cx: 80.0, cy: 60.0 };
/// let camera = Pinhole::with_pixel_centres_at_half(intrinsics, DAffine3::IDENTITY)?;
/// let centre = DVec3::new(0.02, 0.0, 0.5);
/// let depth = (0..160 * 120).map(|i| {
///     let ray = camera.ray_in_camera(f64::from(i % 160) + 0.5, f64::from(i / 160) + 0.5);
///     let (b, c) = (ray.dot(centre), centre.length_squared() - 0.05f64.powi(2));
///     let inside = b * b - ray.length_squared() * c;
///     (if inside > 0.0 { (b - inside.sqrt()) / ray.length_squared() } else { 1.0 }) as f32
/// });
/// let depth = DepthImage::new(160, 120, depth.collect())?;
/// let init = Sim3 { scale: 0.05, translation: DVec3::new(0.015, 0.005, 0.5), ..Sim3::IDENTITY };
/// let settings = TrackSettings { init: Some(init), ..Default::default() };
/// let mut tracker = Tracker::new(&icosphere(3), &settings, &Task::default())?;
/// let frame = DepthFrame { depth: &depth, camera: &camera, mask: None, time_nanos: None };
/// let record = tracker.step(&frame, &Task::default())?;
/// assert_eq!(record.state, TrackState::New);
/// assert!(record.camera_from_object.unwrap().translation.distance(centre) < 0.003);
/// assert!(record.rotation_std.unwrap() > 1.0); // a ball looks the same from everywhere
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Tracker {
    mesh: Mesh,
    settings: TrackSettings,
    region: Option<Vec<f64>>,
    /// Seeks the object until it is found for the first time; none where the first pose is given.
    first: Option<Box<FirstPose>>,
    /// Known once the size is.
    followed: Option<Box<Followed>>,
    n_frames: usize,
    last_time: Option<u64>,
}

/// A pose that was examined.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Examined {
    /// The pose as it was made better.
    pub camera_from_object: Sim3,
    /// What the image says of it.
    pub evidence: PoseEvidence,
}

impl Tracker {
    /// Prepares a mesh (15 ms for 20 000 triangles).
    ///
    /// # Errors
    /// [`Error::Invalid`] for settings out of range; [`Error::Align`] and [`Error::Geom`] for a mesh that cannot be used;
    /// [`semfm_geom::Error::Cancelled`].
    pub fn new(mesh: &Mesh, settings: &TrackSettings, task: &Task) -> Result<Self> {
        let followed = match settings.known_scale()? {
            Some(scale) => {
                let mut followed = Followed::new(mesh, scale, settings, None, task)?;
                followed.last = settings.init.map(|init| of_inner(&init, followed.model.centre));
                Some(Box::new(followed))
            }
            None => None,
        };
        let first = match settings.init {
            None => Some(Box::new(FirstPose::new(mesh, settings, task)?)),
            Some(_) => None,
        };
        Ok(Self {
            mesh: mesh.clone(),
            settings: settings.clone(),
            region: None,
            first,
            followed,
            n_frames: 0,
            last_time: None,
        })
    }

    /// With a region: a weight for each vertex, 0 to 1.
    ///
    /// # Errors
    /// [`Error::Invalid`] for another number of weights than vertices, and for weights out of range.
    pub fn with_region(mut self, weights: &[f64]) -> Result<Self> {
        if weights.len() != self.mesh.n_vertices() {
            let expected = format!("{} weights, one for each vertex", self.mesh.n_vertices());
            return Err(Error::invalid("region", expected, weights.len()));
        }
        if let Some(at) = weights.iter().position(|w| !(0.0..=1.0).contains(w)) {
            return Err(Error::invalid(format!("region, vertex {at}"), "0 to 1", weights[at]));
        }
        self.region = Some(weights.to_vec());
        if let Some(followed) = &mut self.followed {
            followed.memory = SurfaceMemory::new(&followed.model, Some(weights));
        }
        Ok(self)
    }

    /// The object in the next frame. In one whose depth image is empty nothing is seen, and the object is lost.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a camera or a mask of another size than the depth image, and for a frame that is not later than
    /// the one before; [`semfm_geom::Error::Cancelled`].
    pub fn step(&mut self, frame: &DepthFrame<'_>, task: &Task) -> Result<TrackRecord> {
        task.check()?;
        self.check(frame)?;
        let number = self.n_frames;
        self.n_frames += 1;
        self.last_time = frame.time_nanos.or(self.last_time);
        let view = DepthView::new(frame.depth, frame.camera);
        let camera_from_world = rigid(&frame.camera.camera_from_world());
        self.seek_first(number, frame, &view, &camera_from_world, task)?;
        let Some(followed) = &mut self.followed else {
            return Ok(not_found(number, frame.time_nanos));
        };
        if number == 0 && self.settings.init.is_some() {
            // The initial pose is one before the first camera.
            followed.last = followed.last.map(|last| camera_from_world.inverse() * last);
        }
        let record = followed.follow(number, frame, &view, &camera_from_world, &self.settings)?;
        if record.state.is_seen() {
            self.first = None;
        } else if self.first.is_some() && self.settings.scale.is_none() {
            // What was aligned did not stand the test: neither did its scale.
            self.followed = None;
        }
        Ok(record)
    }

    /// A pose of yours, made better by a frame, and what the image says of it; `None` where nothing is seen near it. What
    /// the tracker knows stays as it is.
    ///
    /// # Errors
    /// [`Error::Invalid`] as [`step`](Self::step), and where the scale is not known yet.
    pub fn examine(
        &self,
        frame: &DepthFrame<'_>,
        camera_from_object: &Sim3,
    ) -> Result<Option<Examined>> {
        self.check_sizes(frame)?;
        let Some(followed) = &self.followed else {
            return Err(Error::invalid("examined pose", "a tracker that knows the scale", "none"));
        };
        let view = DepthView::new(frame.depth, frame.camera);
        Ok(followed.examine(&view, camera_from_object))
    }

    /// The region's weights by vertex as refined by what was seen: each times the confidence that surface is where the mesh
    /// has it. `None` without a region.
    ///
    /// # Errors
    /// [`Error::Geom`] where the samples make no index.
    pub fn refined_region(&self) -> Result<Option<Vec<f64>>> {
        let Some(weights) = &self.region else { return Ok(None) };
        let Some(followed) = &self.followed else { return Ok(Some(weights.clone())) };
        let Followed { model, memory, noise, .. } = &**followed;
        memory.refined(model, self.mesh.vertices(), weights, *noise).map(Some)
    }

    /// Bytes that are kept from one frame to the next, but for the mesh and the tree over its triangles.
    pub fn kept_bytes(&self) -> usize {
        size_of::<Self>() + self.followed.as_ref().map_or(0, |followed| followed.kept_bytes())
    }

    fn check(&self, frame: &DepthFrame<'_>) -> Result<()> {
        self.check_sizes(frame)?;
        if let (Some(time), Some(last)) = (frame.time_nanos, self.last_time)
            && time <= last
        {
            let expected = format!("later than {last} ns, the frame before");
            let what = format!("frame {}: time", self.n_frames);
            return Err(Error::invalid(what, expected, format!("{time} ns")));
        }
        Ok(())
    }

    fn check_sizes(&self, frame: &DepthFrame<'_>) -> Result<()> {
        let of = |what: &str| format!("frame {}: {what}", self.n_frames);
        let (width, height) = (frame.depth.width(), frame.depth.height());
        let camera = [frame.camera.width() as usize, frame.camera.height() as usize];
        if camera != [width, height] {
            let expected = format!("{width} × {height} pixels, as the depth image");
            return Err(Error::invalid(
                of("camera"),
                expected,
                format!("{} × {}", camera[0], camera[1]),
            ));
        }
        if let Some(mask) = frame.mask.filter(|mask| mask.len() != width * height) {
            let expected = format!("{} pixels, as the depth image", width * height);
            return Err(Error::invalid(of("mask"), expected, mask.len()));
        }
        Ok(())
    }

    /// Where the object was not found yet and no pose was given, aligns the mesh with what the frame shows, in some frames.
    fn seek_first(
        &mut self,
        number: usize,
        frame: &DepthFrame<'_>,
        view: &DepthView<'_>,
        camera_from_world: &Sim3,
        task: &Task,
    ) -> Result<()> {
        let Some(first) = &mut self.first else { return Ok(()) };
        let Some(pose) = first.seek(number, frame, view, &self.settings, task)? else {
            return Ok(());
        };
        let followed = match &mut self.followed {
            Some(followed) => followed,
            none => {
                let region = self.region.as_deref();
                let new = Followed::new(&self.mesh, pose.scale, &self.settings, region, task)?;
                none.insert(Box::new(new))
            }
        };
        followed.last = Some(camera_from_world.inverse() * of_inner(&pose, followed.model.centre));
        Ok(())
    }
}

/// The record of a frame before the object was found for the first time.
fn not_found(frame: usize, time_nanos: Option<u64>) -> TrackRecord {
    TrackRecord {
        frame,
        time_nanos,
        state: TrackState::Lost,
        camera_from_object: None,
        probability: 0.0,
        covariance: None,
        position_std: None,
        rotation_std: None,
        evidence: PoseEvidence::default(),
        region: None,
    }
}
