//! The outcome of an alignment.

use semfm_geom::Verdict;

use crate::ambiguity::UndeterminedAxis;
use crate::sim3::Sim3;

/// The pose of an object in a camera's frame, and how far to trust it.
#[derive(Clone, Debug, PartialEq)]
pub struct Alignment {
    /// From the mesh's frame and units to the camera's frame in metres.
    pub camera_from_object: Sim3,
    /// Standard deviation of the scale, metres per unit of the mesh.
    pub scale_std: f64,
    /// Standard deviation of the rotation about its least certain axis, radians; π where what was seen
    /// does not determine it.
    pub rotation_std: f64,
    /// Standard deviation of the position in its least certain direction, metres.
    pub position_std: f64,
    /// Root mean square distance from the points that lie on the model to its surface, metres.
    pub residual_m: f64,
    /// Share of the observed points that lie on the model.
    pub inlier_share: f64,
    /// Of the model's side that faces the camera, the share that was seen where it is.
    pub visibility: f64,
    /// What the best pose that puts some of the surface elsewhere explains of what was seen, as a
    /// share of what this one does.
    pub rival: f64,
    /// Axes of the mesh about which what was seen does not determine the rotation.
    pub undetermined: Vec<UndeterminedAxis>,
    /// Other poses (camera from object) that explain what was seen as well.
    pub alternatives: Vec<Sim3>,
    /// Starts tried.
    pub n_starts: usize,
    /// Steps of the last, exact round.
    pub iterations: usize,
    /// What to do with the pose.
    pub verdict: Verdict,
    /// What speaks against accepting it, in words.
    pub reasons: Vec<String>,
    /// Time per stage in milliseconds, in order.
    pub stages_ms: Vec<(&'static str, f64)>,
}
