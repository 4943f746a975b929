//! Transfer a demonstrated region from one object to another: Semantic Anchored Functional Maps.
//!
//! A demonstration touches one object, the **source** (the handle of a mug). SemFM finds where to
//! act on another object of the same kind, the **target** (a kettle). From two meshes, a region on
//! the first and patch embeddings of rendered views, it lifts the embeddings to the surface, finds
//! semantic anchors, computes and refines a functional map, transfers the region and says how sure
//! it is (Dong & Zhi, *Affordance Transfer Across Object Instances via Semantically Anchored
//! Functional Map*).
//!
//! Three calls do it: [`prepare`] each object, [`transfer`] the region, and, for a robot,
//! [`find_grasps`] in it. [`Matching`] keeps a match for further regions. The crates below are
//! re-exported whole: [`geom`] (meshes, Laplacians, eigenbases), [`views`] (rendering, lifting, MCAP
//! files), [`observe`] (depth cameras and hands), [`fmap`] (anchors, maps, transfer), [`align`] (a model in what a depth camera sees),
//! [`robot`] (robot descriptions, grippers) and [`grasp`]. [`files`] reads and writes what a
//! transfer, an alignment and grasps leave behind.
//!
//! ```
//! use semfm::geom::math::DVec3;
//! use semfm::geom::zoo::icosphere;
//! use semfm::{FeatureSource, Mesh, PipelineSettings, Region, Task, Verdict, prepare, transfer};
//!
//! /// A tool along x: a ball whose one half is drawn out to a handle.
//! fn tool(handle: f64) -> semfm::Result<Mesh> {
//!     let ball = icosphere(3);
//!     let stretch = |p: &DVec3| DVec3::new(if p.x < 0.0 { handle * p.x } else { p.x }, p.y, p.z);
//!     Ok(Mesh::new(ball.vertices().iter().map(stretch).collect(), ball.faces().to_vec())?)
//! }
//! # let ball = icosphere(3);
//! # let places = [-1.0, -0.5, 0.0, 0.5, 1.0];
//! # let near = |p: &DVec3, x: f64| (-8.0 * (p.x - x).powi(2)).exp() as f32;
//! // A feature vector for each vertex, such as an image encoder gives: alike where the tools are.
//! let features: Vec<f32> = // (n × 5)
//!     ball.vertices().iter().flat_map(|p| places.map(|x| near(p, x))).collect();
//!
//! let (settings, task) = (PipelineSettings::default(), Task::default());
//! let (short, long) = (tool(1.5)?, tool(3.0)?);
//! let grip: Vec<bool> = short.vertices().iter().map(|p| p.x < -0.6).collect();
//! let source = prepare(short, FeatureSource::PerVertex(&features), &settings, &task)?;
//! let target = prepare(long, FeatureSource::PerVertex(&features), &settings, &task)?;
//!
//! let region = Region::from_mask(&grip);
//! let found = transfer(&source.object, &target.object, &region, &settings.transfer, &task)?;
//! assert_eq!(found.verdict, Verdict::Accept);
//! # Ok::<(), semfm::Error>(())
//! ```

pub use semfm_align as align;
pub use semfm_encoder as encoder;
pub use semfm_fmap as fmap;
pub use semfm_geom as geom;
pub use semfm_grasp as grasp;
pub use semfm_motion as motion;
pub use semfm_observe as observe;
pub use semfm_robot as robot;
pub use semfm_track as track;
pub use semfm_views as views;

pub mod demonstration;
mod encoded_objects;
mod error;
pub mod files;
mod grasp_file;
mod grasp_plan;
mod grasp_request;
mod grasp_result;
mod hand_mounting;
#[cfg(feature = "mcap")]
pub mod memory;
mod motion_scene;
#[cfg(feature = "mcap")]
pub mod object_encoder;
#[cfg(feature = "mcap")]
mod object_of_frames;
mod object_place;
mod object_size;
pub mod observed_object;
mod pipeline;
mod planned_motion;
mod pose_dependence;
#[cfg(feature = "mcap")]
mod prepared_pair;
mod robot_arm;
mod scene_contents;
pub mod upright;
pub mod weight_colors;

pub use error::{Error, Result};
pub use fmap::{
    Matching, Method, PreparedObject, Region, Rule, Transfer, TransferSettings, Verdict, transfer,
};
pub use geom::{Mesh, Task};
pub use grasp::find_grasps;
pub use grasp_plan::{GraspPlan, PlanObject, PlanRequest, plan};
pub use grasp_request::{
    GraspProblem, GraspRequest, MOST_POSE_MARGIN, Obstacle, POINT_MARGIN, Table,
};
pub use grasp_result::{AnswerFrame, GraspResult};
pub use motion_scene::{
    FingerJoint, FrameOwner, MotionFrame, MotionObject, MotionObstacle, MotionRobot, MotionScene,
    MountedHand, ObstacleShape, SceneState,
};
#[cfg(feature = "mcap")]
pub use object_of_frames::{ObjectFrame, ObservedEmbeddings, ObservedObject, VisibleFrames};
pub use object_place::{ObjectPlace, pose_of_numbers};
pub use object_size::ObjectSize;
pub use pipeline::{
    EncoderRecord, FeatureSource, LiftedCloud, PipelineSettings, PreparationReport, Prepared,
    prepare, semantic_cloud,
};
pub use planned_motion::PlannedMotion;
pub use pose_dependence::shares_of_poses;
#[cfg(feature = "mcap")]
pub use prepared_pair::{
    NamedMesh, PairFeatures, PairFiles, PreparedPair, embeddings_of_both, prepare_pair,
};
pub use robot_arm::RobotArm;
pub use scene_contents::SceneContents;
