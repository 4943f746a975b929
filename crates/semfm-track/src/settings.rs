//! What the caller may choose.

use semfm_align::Sim3;

use crate::{Error, Result};

/// More hypotheses than this a frame are refused.
const MOST_HYPOTHESES: usize = 10_000;

/// Where tracking starts, and what it may cost.
#[derive(Clone, Debug, PartialEq)]
pub struct TrackSettings {
    /// The pose in the first frame (camera from object, scale included), where it is known.
    pub init: Option<Sim3>,
    /// Metres per unit of the mesh: 1 for a mesh in metres. `None` takes it from `init`, else from the first alignment.
    pub scale: Option<f64>,
    /// Poses that are tried in a frame in which the object is not where it was: what bounds the time of such a frame.
    pub hypotheses: usize,
    /// Seed of the mesh's samples and of the search.
    pub seed: u64,
}

impl Default for TrackSettings {
    fn default() -> Self {
        Self { init: None, scale: None, hypotheses: 96, seed: 0 }
    }
}

impl TrackSettings {
    /// Metres per unit of the mesh, where it is known before the first frame.
    ///
    /// # Errors
    /// [`Error::Invalid`], naming the setting.
    pub(crate) fn known_scale(&self) -> Result<Option<f64>> {
        let is_length = |x: &f64| *x > 0.0 && x.is_finite();
        if let Some(scale) = self.scale.filter(|scale| !is_length(scale)) {
            return Err(Error::invalid("scale", "metres per unit of the mesh, above 0", scale));
        }
        if let Some(init) = &self.init {
            let is_pose = is_length(&init.scale)
                && init.translation.is_finite()
                && init.rotation.is_normalized();
            if !is_pose {
                return Err(Error::invalid(
                    "initial pose",
                    "a positive scale and finite numbers",
                    format!("scale {}, translation {}", init.scale, init.translation),
                ));
            }
            if let Some(scale) = self.scale.filter(|s| (s / init.scale - 1.0).abs() > 1e-3) {
                let expected = format!("{}, the initial pose's", init.scale);
                return Err(Error::invalid("scale", expected, scale));
            }
        }
        if !(1..=MOST_HYPOTHESES).contains(&self.hypotheses) {
            let expected = format!("1 to {MOST_HYPOTHESES}");
            return Err(Error::invalid("hypotheses", expected, self.hypotheses));
        }
        Ok(self.init.map(|init| init.scale).or(self.scale))
    }
}
