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
//! * **A visibility check.** Observed points alone like a model that is too large, or one that hides
//!   in a flat patch. So a pose must also explain itself: the side of the model that faces the
//!   camera should have been seen where it is. What is not seen through and not seen either speaks
//!   against it. Where the points leave a direction open (the scale of a box of which three faces
//!   are seen), the same question settles it.

mod align;
mod certainty;
mod depth;
mod error;
mod field;
mod model;
mod observation;
mod search;
mod settle;
mod sight;
mod sim3;
mod solve;
mod starts;
mod thin;
mod verdict;

pub use align::{AlignSettings, Alignment, align, align_model};
pub use depth::{DepthImage, Intrinsics};
pub use error::{Error, Result};
pub use model::AlignModel;
pub use observation::Observation;
pub use sim3::Sim3;
pub use verdict::Verdict;
