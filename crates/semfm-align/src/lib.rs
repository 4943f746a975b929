//! The pose and scale of a reconstruction in an observed partial cloud: a robust Sim(3).
//!
//! A reconstruction (from a picture, say) has a shape but neither a place nor metres. What a depth
//! camera sees of the object has both, but only one side, with noise and clutter. [`align`] finds
//! the similarity that brings one onto the other:
//!
//! * **Observed to model only.** Every observed point is matched to the model's surface, never the
//!   reverse, which would shrink the model onto the one side that was seen.
//! * **Point to plane under an annealed Geman–McClure kernel** (Zhou, Park & Koltun 2016), Gauss–
//!   Newton on the seven parameters, scale within bounds.
//! * **Many starts**, spread over all rotations; a table of nearest samples makes each cost a fifth
//!   of a millisecond. An initial pose narrows them down.
//! * **A visibility check.** Observed points alone fit a model that is too large as well, or one that
//!   lies behind a flat patch. So the side of the model that faces the camera is compared with what
//!   was seen there, too: surface that the camera looked through, or did not see where it should
//!   be, counts against a pose. Where the points leave a direction undetermined (the scale of a box
//!   of which three faces are seen), the same comparison determines it.

mod align;
mod alignment;
mod ambiguity;
mod correspondence;
mod depth_image;
mod downsample;
mod error;
mod evidence;
mod extent;
mod gauss_newton;
mod initial_pose;
mod judgement;
mod kernel;
mod model;
mod nearest_table;
mod observed_cloud;
mod oriented_point;
mod refine;
mod rotations;
mod search;
mod settings;
mod silhouette;
mod sim3;
mod uncertainty;
mod visibility;
mod weak_directions;

pub use align::{align, align_model};
pub use alignment::Alignment;
pub use ambiguity::UndeterminedAxis;
pub use depth_image::{DepthImage, DepthPoints};
pub use error::{Error, Result};
pub use model::AlignModel;
pub use observed_cloud::ObservedCloud;
pub use rotations::super_fibonacci;
pub use semfm_geom::Verdict;
pub use settings::AlignSettings;
pub use sim3::Sim3;

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_send_sync<T: Send + Sync>() {}

    #[test]
    fn public_types_can_be_shared_between_threads() {
        assert_send_sync::<AlignModel>();
        assert_send_sync::<AlignSettings>();
        assert_send_sync::<Alignment>();
        assert_send_sync::<DepthImage>();
        assert_send_sync::<DepthPoints>();
        assert_send_sync::<Error>();
        assert_send_sync::<ObservedCloud>();
        assert_send_sync::<Sim3>();
        assert_send_sync::<Verdict>();
    }
}
