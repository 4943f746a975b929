//! Grasps of a mesh, asked for in the frame that the caller works in.
//!
//! Everything is given in the answer's frame: the camera's, where the pose of the object before one
//! is known, else the object's in metres. The search itself runs in the object's frame.

use std::sync::Arc;

use parry3d_f64::math::Pose;
use semfm_align::Sim3;
use semfm_geom::math::DVec3;
use semfm_geom::{Mesh, Task};
use semfm_grasp::{GraspObject, GraspSettings, Grasps, Scene, SurfaceSettings, find_grasps};
use semfm_observe::{UnseenSettings, unseen_side};
use semfm_robot::Gripper;

use crate::files::AlignedPose;
use crate::pose_dependence::shares_of_poses;
use crate::{GraspResult, ObjectSize, Result};

/// Metres that a gripper keeps from the points of a cloud, unless said otherwise: the noise of a
/// depth camera at arm's length.
pub const POINT_MARGIN: f64 = 0.005;

/// Metres that an uncertain pose keeps the gripper away at most: beyond, hardly a hand gets around a handle, and
/// [`GraspProblem::shares_of_poses`] tells more.
pub const MOST_POSE_MARGIN: f64 = 0.01;

/// Metres behind an observed surface, and from its outline, at which the unknown begins: the noise of a depth camera at arm's
/// length, and the lean of a pad that closes on the outline (2 cm of it at 8° reach 3 mm behind).
const UNSEEN_GAP: f64 = 0.003;

/// What grasps are wanted, and what stands around the object.
#[derive(Clone, Debug)]
pub struct GraspRequest {
    /// Metres per unit of the mesh.
    pub object_scale: f64,
    /// Where the object, scaled to metres, stands before a camera: the answer's frame is then the
    /// camera's.
    pub camera_from_object: Option<Pose>,
    /// Other poses (camera from the mesh in its own units) that explain what the camera saw as well.
    pub alternatives: Vec<Sim3>,
    /// A table, in the answer's frame.
    pub table: Option<Table>,
    /// What else the gripper must not touch, in the answer's frame, metres.
    pub obstacles: Vec<Obstacle>,
    /// Distance that the gripper keeps from the points of obstacles, metres.
    pub point_margin: f64,
    /// On which surface contacts are sought.
    pub surface: SurfaceSettings,
    /// The settings of the search; their directions are in the answer's frame.
    pub settings: GraspSettings,
}

/// The top of a table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Table {
    /// A point of it, metres.
    pub point: DVec3,
    /// Away from the table, of any length above zero.
    pub normal: DVec3,
}

/// Something that stands beside the object.
#[derive(Clone, Debug)]
pub enum Obstacle {
    /// A surface.
    Mesh(Mesh),
    /// Observed points.
    Points(Vec<DVec3>),
}

impl GraspRequest {
    /// The default search, without obstacles.
    pub fn new(object_scale: f64) -> Self {
        Self {
            object_scale,
            camera_from_object: None,
            alternatives: Vec::new(),
            table: None,
            obstacles: Vec::new(),
            point_margin: POINT_MARGIN,
            surface: SurfaceSettings::default(),
            settings: GraspSettings::default(),
        }
    }

    /// The default search at a pose from [`align`](semfm_align::align). Where the pose is uncertain the gripper keeps
    /// its distance: by one standard deviation ([`AlignedPose::uncertainty`]), at most [`MOST_POSE_MARGIN`].
    ///
    /// The verdict is the caller's to ask: a pose that is refused makes a request all the same.
    pub fn at_pose(pose: &AlignedPose, mesh: &Mesh) -> Self {
        let mut request = Self::new(pose.camera_from_object.scale);
        request.camera_from_object = Some(pose.camera_from_object.rigid());
        request.alternatives.clone_from(&pose.alternatives);
        request.settings.pose_margin = pose.uncertainty(mesh).min(MOST_POSE_MARGIN);
        request
    }

    /// What is hidden behind the surface that a camera at `eye` saw, up to `depth` metres or down to the table of this request,
    /// as an obstacle: nobody knows what is there. `mesh` is that surface, in its own frame and unit, `eye` in its frame and
    /// metres; the answer's frame is the same ([`unseen_side`]). `None` where nothing is hidden.
    ///
    /// # Errors
    /// [`Error::Invalid`](crate::Error::Invalid) for a depth of 3 mm or less, numbers that are not finite, and a mesh that is
    /// known all around.
    pub fn hidden_behind(&self, mesh: &Mesh, eye: DVec3, depth: f64) -> Result<Option<Obstacle>> {
        let ends_at = self.table.map(|table| [table.point, table.normal.normalize_or_zero()]);
        let settings = UnseenSettings { depth, gap: UNSEEN_GAP, ends_at };
        let vertices = mesh.vertices().iter().map(|&p| p * self.object_scale).collect();
        let surface = Mesh::new(vertices, mesh.faces().to_vec())?;
        Ok(unseen_side(&surface, eye, &settings)?.map(Obstacle::Mesh))
    }

    /// Everything turned into the frame of `mesh` and made ready for the search.
    ///
    /// # Errors
    /// [`semfm_grasp::Error::OutOfRange`] for a scale, a table or points that make no sense;
    /// [`Error::Invalid`](crate::Error::Invalid) for an object that no gripper could hold at this
    /// scale, with a question about its unit.
    pub fn prepare(self, mesh: Arc<Mesh>, gripper: Gripper) -> Result<GraspProblem> {
        if self.object_scale > 0.0 && self.object_scale.is_finite() {
            ObjectSize::of(&mesh, self.object_scale).check()?; // what is no scale is refused below
        }
        let object_from_answer = self.camera_from_object.map_or(Pose::IDENTITY, |p| p.inverse());
        Ok(GraspProblem {
            object: GraspObject::with_surface(&mesh, self.object_scale, self.surface)?,
            scene: self.scene(object_from_answer)?,
            settings: turned(self.settings, object_from_answer),
            mesh,
            object_scale: self.object_scale,
            camera_from_object: self.camera_from_object,
            alternatives: self.alternatives,
            gripper,
        })
    }

    /// Table and obstacles in the object's frame.
    fn scene(&self, object_from_answer: Pose) -> Result<Scene> {
        let mut scene = Scene::new();
        if let Some(Table { point, normal }) = self.table {
            let normal = object_from_answer.rotation * normal;
            scene = scene.with_table(object_from_answer * point, normal)?;
        }
        for obstacle in &self.obstacles {
            scene = match obstacle {
                Obstacle::Mesh(mesh) => {
                    let vertices = moved(object_from_answer, mesh.vertices());
                    scene.with_mesh(&Mesh::new(vertices, mesh.faces().to_vec())?)
                }
                Obstacle::Points(points) => {
                    scene.with_cloud(&moved(object_from_answer, points), self.point_margin)?
                }
            };
        }
        Ok(scene)
    }
}

fn moved(object_from_answer: Pose, points: &[DVec3]) -> Vec<DVec3> {
    points.iter().map(|&p| object_from_answer * p).collect()
}

/// Settings whose directions are in the object's frame.
fn turned(mut settings: GraspSettings, object_from_answer: Pose) -> GraspSettings {
    let rotation = object_from_answer.rotation;
    settings.demonstrated_approach = settings.demonstrated_approach.map(|v| rotation * v);
    if let Some(cone) = &mut settings.limits.approach {
        cone.axis = rotation * cone.axis;
    }
    settings
}

/// A [`GraspRequest`] made ready: grasps of any region of the object can be asked of it.
#[derive(Debug)]
pub struct GraspProblem {
    mesh: Arc<Mesh>,
    object_scale: f64,
    camera_from_object: Option<Pose>,
    alternatives: Vec<Sim3>,
    gripper: Gripper,
    object: GraspObject,
    scene: Scene,
    settings: GraspSettings,
}

impl GraspProblem {
    /// Grasps in a region, one weight per vertex.
    ///
    /// # Errors
    /// [`semfm_grasp::Error::OutOfRange`], [`semfm_geom::Error::Cancelled`].
    pub fn find(&self, weights: &[f64], task: &Task) -> Result<Grasps> {
        let Self { object, gripper, scene, settings, .. } = self;
        Ok(find_grasps(object, weights, gripper, scene, settings, task)?)
    }

    /// For each grasp found in a region the share of [`GraspRequest::alternatives`] under which its
    /// contacts still lie on the object and in the region ([`shares_of_poses`]); `None` where there
    /// are none.
    ///
    /// # Errors
    /// [`semfm_geom::Error::NoArea`].
    pub fn shares_of_poses(&self, weights: &[f64], found: &Grasps) -> Result<Option<Vec<f64>>> {
        let Some(pose) = self.camera_from_object.filter(|_| !self.alternatives.is_empty()) else {
            return Ok(None);
        };
        let Pose { rotation, translation } = pose;
        let pose = Sim3 { scale: self.object_scale, rotation, translation };
        let contacts: Vec<[DVec3; 2]> = found.grasps.iter().map(|grasp| grasp.contacts).collect();
        shares_of_poses(&self.mesh, weights, &pose, &self.alternatives, &contacts).map(Some)
    }

    /// Other poses of the object that explain what the camera saw as well.
    pub fn alternatives(&self) -> &[Sim3] {
        &self.alternatives
    }

    /// What was found, with the object, the gripper and the camera that it refers to.
    pub fn result<'a>(&'a self, found: &'a Grasps) -> GraspResult<'a> {
        GraspResult {
            mesh: &self.mesh,
            object_scale: self.object_scale,
            camera_from_object: self.camera_from_object,
            gripper: &self.gripper,
            found,
        }
    }

    /// The object in metres.
    ///
    /// # Errors
    /// [`semfm_geom::Error::NotFinite`] where a coordinate leaves the range of numbers.
    pub fn mesh_in_metres(&self) -> Result<Mesh> {
        let vertices = self.mesh.vertices().iter().map(|&p| p * self.object_scale).collect();
        Ok(Mesh::new(vertices, self.mesh.faces().to_vec())?)
    }

    /// The table in the frame of the object in metres, its normal of length 1; none where there is none.
    pub fn table(&self) -> Option<Table> {
        let table = self.scene.table()?;
        Some(Table { point: table.point, normal: table.normal })
    }

    /// The object's mesh as read, in its own units.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// How large the object is.
    pub fn size(&self) -> ObjectSize {
        ObjectSize::of(&self.mesh, self.object_scale)
    }

    /// The gripper.
    pub fn gripper(&self) -> &Gripper {
        &self.gripper
    }

    /// The settings of the search, directions in the object's frame.
    pub fn settings(&self) -> &GraspSettings {
        &self.settings
    }
}
