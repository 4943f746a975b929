//! Which method transfers a region.

use serde::{Deserialize, Serialize};

/// A method that transfers a region from one object to another.
///
/// [`Method::info`] tells more of each: the table is in `methods/mod.rs`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Method {
    /// Transport, then bidirectional feature-augmented ZoomOut.
    #[default]
    Fused,
    /// The published method, to the letter.
    Semfm,
    /// Its anchors, then feature-augmented ZoomOut.
    Anchored,
    /// Transport alone.
    Sinkhorn,
    /// Nearest points in feature space.
    Nearest,
    /// Wave kernel signatures: geometry alone.
    Wks,
}
