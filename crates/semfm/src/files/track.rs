//! `track.jsonl`: an object in each frame of a depth camera, a line of JSON each.

use semfm_track::{PoseEvidence, RegionRecord, TrackRecord};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::MatrixRows;

/// The format that is written.
pub const FORMAT: &str = "semfm.track/1";

/// One line: the object in one frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrackLine {
    /// `semfm.track/1`.
    pub format: String,
    /// Number of the frame among those that were read, from 0.
    pub frame: usize,
    /// Its time in nanoseconds, where the source says it.
    pub time_nanos: Option<u64>,
    /// `new`, `tracking`, `occluded`, `lost` or `reacquired`.
    pub state: String,
    /// From the mesh's frame and units to the camera's frame in metres, scale included; null while lost.
    pub camera_from_object: Option<MatrixRows>,
    /// Probability that the surface stands within a tenth of its diameter of where the pose puts it.
    pub probability: f64,
    /// Covariance of x, y, z of the mesh's origin (metres) and of the rotation vector (radians), along the camera's axes.
    pub covariance: Option<[[f64; 6]; 6]>,
    /// Greatest standard deviation of the object's middle, metres.
    pub position_std_m: Option<f64>,
    /// Greatest standard deviation of the rotation, radians.
    pub rotation_std: Option<f64>,
    /// What the image says of the pose.
    pub evidence: PoseEvidenceRecord,
    /// The region, where there is one.
    pub region: Option<TrackedRegionRecord>,
}

/// What an image says for and against a pose.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PoseEvidenceRecord {
    /// Of the surface that faces the camera, the share that was seen where the pose puts it.
    pub visible_share: f64,
    /// The share that something stands before, or that lies beyond the picture.
    pub hidden_share: f64,
    /// Of what was seen or looked through, the share that was looked through.
    pub through_share: f64,
    /// Of the points of the outline that tell, the share where the depth jumps.
    pub outline_share: f64,
    /// Root mean square distance of what was seen to the surface, metres.
    pub residual_m: Option<f64>,
    /// The probability that the pose is right, by this image alone.
    pub probability: f64,
}

/// A region in one frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrackedRegionRecord {
    /// Probability, in the mean, that surface is where the mesh has it.
    pub confidence: f64,
    /// Share of the region that this frame sees.
    pub visible_share: f64,
    /// Share that some frame saw.
    pub observed_share: f64,
    /// Mean distance by which what was seen stands before the mesh's surface, metres.
    pub deviation_m: f64,
    /// Its middle in the camera's frame, metres; null while lost.
    pub centre_m: Option<[f64; 3]>,
}

impl TrackLine {
    /// The line of a record.
    pub fn new(record: &TrackRecord) -> Self {
        Self {
            format: FORMAT.into(),
            frame: record.frame,
            time_nanos: record.time_nanos,
            state: record.state.name().into(),
            camera_from_object: record.camera_from_object.map(|pose| pose.to_rows()),
            probability: record.probability,
            covariance: record.covariance,
            position_std_m: record.position_std,
            rotation_std: record.rotation_std,
            evidence: (&record.evidence).into(),
            region: record.region.as_ref().map(Into::into),
        }
    }

    /// Its JSON.
    pub fn to_json(&self) -> Value {
        super::to_json(self)
    }
}

impl From<&PoseEvidence> for PoseEvidenceRecord {
    fn from(evidence: &PoseEvidence) -> Self {
        let PoseEvidence {
            visible_share,
            hidden_share,
            through_share,
            outline_share,
            residual,
            probability,
        } = *evidence;
        Self {
            visible_share,
            hidden_share,
            through_share,
            outline_share,
            residual_m: residual,
            probability,
        }
    }
}

impl From<&RegionRecord> for TrackedRegionRecord {
    fn from(region: &RegionRecord) -> Self {
        let RegionRecord { confidence, visible_share, observed_share, deviation, centre } = *region;
        Self {
            confidence,
            visible_share,
            observed_share,
            deviation_m: deviation,
            centre_m: centre.map(|p| p.to_array()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_align::Sim3;
    use semfm_track::TrackState;

    #[test]
    fn a_line_is_read_back_and_a_lost_object_has_no_pose() {
        let seen = TrackRecord {
            frame: 3,
            time_nanos: Some(u64::MAX),
            state: TrackState::Reacquired,
            camera_from_object: Some(Sim3 { scale: 0.1, ..Sim3::IDENTITY }),
            probability: 0.9,
            covariance: Some([[0.1; 6]; 6]),
            position_std: Some(0.001),
            rotation_std: Some(0.02),
            evidence: PoseEvidence { residual: Some(0.001), ..Default::default() },
            region: None,
        };
        let line = TrackLine::new(&seen);
        let text = line.to_json().to_string();
        assert!(!text.contains('\n') && text.contains(r#""state":"reacquired""#), "{text}");
        assert_eq!(serde_json::from_str::<TrackLine>(&text).unwrap(), line);
        let lost = TrackRecord { state: TrackState::Lost, camera_from_object: None, ..seen };
        assert!(TrackLine::new(&lost).to_json()["camera_from_object"].is_null());
    }
}
