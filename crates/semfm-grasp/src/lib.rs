//! Parallel-jaw grasps inside a region of a mesh or a point cloud.
//!
//! A [`Gripper`](semfm_robot::Gripper) comes from a URDF or from a built-in parameter set. Its
//! frame (TCP) has its origin between the finger pads, +z along the approach and y along the
//! closing direction; lengths are metres.

mod antipodal;
mod box_tree;
mod candidate;
mod clip;
mod closing_turn;
mod collision;
mod contact;
mod error;
mod find;
#[cfg(test)]
mod find_tests;
mod force_closure;
mod gpg;
mod grasp;
mod grasp_distance;
mod gripper_geometry;
mod likely_symmetry;
mod neighbours;
mod object;
mod obstacle;
mod pad_view;
mod pose_grid;
mod pressure;
mod refine;
mod rejection;
mod scene;
mod score;
mod score_weights;
mod search;
mod select;
mod settings;
mod solid;
#[cfg(test)]
mod test_meshes;
mod working_surface;
mod wrench_hull;

pub use error::{Error, Result};
pub use find::{Grasps, PoseToExamine, examine_poses, find_grasps, find_grasps_with};
pub use grasp::Grasp;
pub use grasp_distance::GraspDistance;
pub use gripper_geometry::{BoxGripper, GripperExtents, GripperGeometry};
pub use object::GraspObject;
pub use rejection::{Miss, Reason, Rejected};
pub use scene::{Scene, Table};
pub use score_weights::{ScoreWeights, TERMS};
/// A rotation and a translation, metres: the pose type of the whole crate.
pub use semfm_robot::Pose;
pub use settings::{ApproachCone, GraspSettings, Limits, Selection, Separation};
pub use working_surface::{SurfaceReport, SurfaceSettings};

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_send_sync<T: Send + Sync>() {}

    #[test]
    fn public_types_go_between_threads() {
        assert_send_sync::<Error>();
        assert_send_sync::<GraspObject>();
        assert_send_sync::<GripperGeometry>();
        assert_send_sync::<Scene>();
        assert_send_sync::<GraspSettings>();
        assert_send_sync::<Grasps>();
        assert_send_sync::<Miss>();
    }
}
