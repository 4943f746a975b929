//! The files that are read and written here. Each format is defined once, by a struct that its
//! writer and its readers share.
//!
//! | file | format | struct |
//! | --- | --- | --- |
//! | a region on a mesh | `semfm.region/1` | [`RegionFile`] |
//! | `region.json` of a transfer | the same, with more fields | [`TransferredRegionFile`] |
//! | `report.json` of a transfer | `semfm.report/1` | [`TransferReportFile`] |
//! | `point_map.json` of a transfer | `semfm.point_map/1` | [`PointMapFile`] |
//! | `aligned.json`, the pose of an object before a camera | `semfm.aligned/1` | [`AlignedFile`] |
//! | what stands around an arm | `semfm.scene/1` | [`SceneFile`] |
//! | `grasps.json` | `semfm.grasps/1` | [`GraspsFile`] |
//! | `plan.json` | `semfm.plan/1` | [`PlanFile`] |
//! | `trajectory.json` | `semfm.trajectory/1` | [`TrajectoryFile`] |
//! | lines of `track` | `semfm.track/1` | [`TrackLine`] |
//! | `surface.json` of an observed surface | `semfm.surface/1` | `SurfaceFile` (feature `mcap`) |
//!
//! [`write_transfer`] writes the folder of a transfer, [`StoredTransfer`] reads it. Grasps are also written as Isaac's YAML
//! ([`write_isaac_grasps`]) and as a ROS 2 bag (`write_ros2_grasps`, feature `mcap`), a motion and a track as others
//! (`write_ros2_trajectory`, `write_ros2_track`). From other
//! programs come per-vertex features ([`read_vertex_features`]) and obstacles ([`read_obstacle`]); what cameras
//! leave behind is read in [`observe`](crate::observe).
//!
//! Keys of a JSON file stand in alphabetical order, whatever the order of a struct's fields.

mod aligned;
#[cfg(feature = "mcap")]
mod embeddings;
mod grasps;
mod isaac_grasps;
#[cfg(feature = "mcap")]
mod memory;
#[cfg(feature = "mcap")]
mod memory_report;
mod obstacle;
mod plan;
mod point_map;
mod region;
mod rigid_pose;
#[cfg(feature = "mcap")]
mod ros2_grasps;
#[cfg(feature = "mcap")]
mod ros2_hand;
#[cfg(feature = "mcap")]
mod ros2_track;
#[cfg(feature = "mcap")]
mod ros2_trajectory;
mod run;
mod scene;
mod stage;
mod stored_transfer;
#[cfg(feature = "mcap")]
mod surface;
mod track;
mod trajectory;
mod trajectory_check;
mod transfer_folder;
mod transfer_report;
mod transferred_region;
mod vertex_features;

use std::path::Path;

use semfm_geom::io::refuse_input;
use serde::Serialize;

pub use aligned::{
    AlignSettingsRecord, AlignedFile, AlignedPose, UndeterminedAxisRecord, read_aligned, read_pose,
};
#[cfg(feature = "mcap")]
pub use embeddings::read_embeddings;
pub use grasps::{
    FORMAT as GRASPS_FORMAT, GraspRecord, GraspSettingsRecord, GraspsFile, GripperRecord,
    HandRecord, MissRecord, PartRecord, TableRecord,
};
pub use isaac_grasps::write_isaac_grasps;
#[cfg(feature = "mcap")]
pub use memory::{
    EntryProvenance, EntryRecord, FORMAT as MEMORY_FORMAT, MemoryEncoder, MemoryFile,
};
#[cfg(feature = "mcap")]
pub use memory_report::{
    EntryAnswerRecord, FORMAT as MEMORY_REPORT_FORMAT, MemoryReportFile, write_memory_answer,
};
pub use obstacle::read_obstacle;
pub use plan::{
    FORMAT as PLAN_FORMAT, PlanFile, PlanSettingsRecord, SegmentSeconds, StartContactRecord,
};
pub use point_map::PointMapFile;
pub use region::{FORMAT as REGION_FORMAT, RegionFile, read_region, write_region};
pub use rigid_pose::{read_camera_pose, read_rigid_pose, rigid_pose};
#[cfg(feature = "mcap")]
pub use ros2_grasps::write_ros2_grasps;
#[cfg(feature = "mcap")]
pub use ros2_track::{
    Ros2Track, TRACK_OBJECT_FRAME, TRACK_POSE_TOPIC, TRACK_REGION_TOPIC, TRACK_STATE_TOPIC,
    write_ros2_track,
};
#[cfg(feature = "mcap")]
pub use ros2_trajectory::{BAG_FILE, BAG_METADATA, write_ros2_trajectory};
pub use run::{FORMAT as RUN_FORMAT, RUN_FILE, RunFile, RunStageRecord, StageState};
pub use scene::{
    BoxRecord, CloudObstacleRecord, CylinderRecord, FORMAT as SCENE_FORMAT, MeshRecord, SceneFile,
    SphereRecord, TablePlaneRecord, read_scene,
};
pub use stage::{FORMAT as STAGE_FORMAT, FileHash, NoAnswerRecord, STAGE_FILE, StageFile};
pub use stored_transfer::StoredTransfer;
#[cfg(feature = "mcap")]
pub use surface::{
    AROUND as SURFACE_AROUND, CameraRecord, EMBEDDINGS as SURFACE_EMBEDDINGS,
    FILES as SURFACE_FILES, FORMAT as SURFACE_FORMAT, MESH as SURFACE_MESH, PixelsRecord,
    SurfaceFile, SurfaceFrame, SurfaceResult, write_surface,
};
pub use track::{FORMAT as TRACK_FORMAT, PoseEvidenceRecord, TrackLine, TrackedRegionRecord};
pub use trajectory::{
    FORMAT as TRAJECTORY_FORMAT, FingerRecord, MotionObjectRecord, MotionRobotRecord,
    MountedHandRecord, OBJECT_FILE, ObstacleRecord, ShapeRecord, TrajectoryFile, read_motion,
};
pub use transfer_folder::{
    ANSWERS as TRANSFER_ANSWERS, AnchorRanks, FILES as TRANSFER_FILES, ObjectAnchors,
    TransferResult, put_transfer, write_answer, write_transfer, write_transfer_data,
};
pub use transfer_report::{
    CloudRecord, ObjectRecord, Provenance, Seeds, TransferInputs, TransferReportFile, stages_ms,
};
pub use transferred_region::{HypothesisRecord, TransferredRegionFile};
pub use vertex_features::read_vertex_features;

/// A 4 × 4 matrix, rows first, points as columns.
pub type MatrixRows = [[f64; 4]; 4];

/// A value as JSON, keys in alphabetical order.
pub(crate) fn to_json(value: &impl Serialize) -> serde_json::Value {
    serde_json::to_value(value).expect("the keys of what is written here are text")
}

/// Writes [`to_json`], whole or not at all. A file that was read as an input is not replaced.
fn write_json(path: &Path, file: &impl Serialize) -> crate::Result<()> {
    refuse_input(path)?;
    Ok(semfm_geom::io::write_json(path, &to_json(file))?)
}
