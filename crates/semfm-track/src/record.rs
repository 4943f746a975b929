//! What is known of the object in one frame.

use std::fmt;

use semfm_align::Sim3;
use semfm_geom::math::DVec3;

/// Where tracking stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TrackState {
    /// Found for the first time.
    New,
    /// Seen where it was, or near.
    Tracking,
    /// Too little of it is seen, since something stands before it or it leaves the picture; nothing contradicts the pose,
    /// which stays what it was.
    Occluded,
    /// Not where it was, and not found elsewhere, or not found yet: there is no pose.
    Lost,
    /// Found again, elsewhere than it was expected.
    Reacquired,
}

impl TrackState {
    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::New => "new",
            Self::Tracking => "tracking",
            Self::Occluded => "occluded",
            Self::Lost => "lost",
            Self::Reacquired => "reacquired",
        }
    }

    /// Whether the pose was measured in this frame.
    pub fn is_seen(self) -> bool {
        matches!(self, Self::New | Self::Tracking | Self::Reacquired)
    }
}

impl fmt::Display for TrackState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The object in one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct TrackRecord {
    /// Number of the frame, from 0.
    pub frame: usize,
    /// Its time, as it was given.
    pub time_nanos: Option<u64>,
    /// Where tracking stands.
    pub state: TrackState,
    /// From the mesh's frame and units to the camera's frame in metres; `None` while lost.
    pub camera_from_object: Option<Sim3>,
    /// Probability that the surface stands within a tenth of its diameter of where the pose puts it; 0 while lost. While
    /// hidden it falls from frame to frame.
    pub probability: f64,
    /// Covariance of the pose (6 × 6): x, y, z of the mesh's origin in metres, then the rotation vector in radians, along
    /// the camera's axes, as ROS has it; `None` while lost.
    pub covariance: Option<[[f64; 6]; 6]>,
    /// Greatest standard deviation of the object's middle, metres.
    pub position_std: Option<f64>,
    /// Greatest standard deviation of the rotation, radians; π where nothing seen determines it.
    pub rotation_std: Option<f64>,
    /// What the image says of the pose; of the pose that was expected, where there is none.
    pub evidence: PoseEvidence,
    /// The region, where there is one.
    pub region: Option<RegionRecord>,
}

/// What an image says for and against a pose.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PoseEvidence {
    /// Of the surface that faces the camera, the share that was seen where the pose puts it.
    pub visible_share: f64,
    /// The share that something stands before, or that lies beyond the picture.
    pub hidden_share: f64,
    /// Of what was seen or looked through, the share that the camera looked through.
    pub through_share: f64,
    /// Of the points of the outline that tell, the share where the depth jumps; ½ where none tells.
    pub outline_share: f64,
    /// Root mean square distance of what was seen to the surface, metres; `None` where nothing was.
    pub residual: Option<f64>,
    /// The probability that the pose is right, by this image alone.
    pub probability: f64,
}

/// A region of the object in one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegionRecord {
    /// Mean over the region, by weight, of the probability that surface is where the mesh has it, as far as frames so far
    /// tell; 1 for what was not seen yet.
    pub confidence: f64,
    /// Share of the region that is seen in this frame.
    pub visible_share: f64,
    /// Share of the region that some frame saw.
    pub observed_share: f64,
    /// Mean distance by which what was seen of the region stands before the mesh's surface, metres; negative behind it.
    pub deviation: f64,
    /// Its middle in the camera's frame, metres; `None` while lost.
    pub centre: Option<DVec3>,
}
