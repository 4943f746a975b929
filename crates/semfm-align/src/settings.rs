//! What the caller may choose.

use crate::model::AlignModel;
use crate::observed_cloud::ObservedCloud;
use crate::sim3::Sim3;
use crate::{Error, Result};

/// How far the scale may be from the one at which mesh and cloud are equally large: a single view of
/// a hammer's end shows a third of its length, and clutter makes the cloud larger.
const SCALES: [f64; 2] = [0.35, 4.0];

/// The same around the scale of a guess.
const SCALES_AROUND_GUESS: [f64; 2] = [0.5, 2.0];

/// More starts than this are refused.
const MAX_STARTS: usize = 100_000;

/// Where the search starts and how far it goes.
#[derive(Clone, Debug, PartialEq)]
pub struct AlignSettings {
    /// A guess of the pose (camera from object, scale included); the search stays near its rotation.
    pub init: Option<Sim3>,
    /// Least and greatest scale, metres per unit of the mesh. `None` derives it from how large the
    /// observed cloud is beside the mesh, or from the guess.
    pub scale_range: Option<[f64; 2]>,
    /// Rotations to start from where there is no guess.
    pub n_starts: usize,
    /// Seed of the model's samples.
    pub seed: u64,
}

impl Default for AlignSettings {
    fn default() -> Self {
        Self { init: None, scale_range: None, n_starts: 400, seed: 0 }
    }
}

impl AlignSettings {
    /// # Errors
    /// [`Error::OutOfRange`], naming the setting.
    pub(crate) fn check(&self) -> Result<()> {
        if let Some([low, high]) = self.scale_range
            && !(low > 0.0 && high >= low && high.is_finite())
        {
            return Err(out_of_range("scale range", "0 < low ≤ high", format!("{low}, {high}")));
        }
        if let Some(init) = self.init
            && !(init.scale > 0.0
                && init.scale.is_finite()
                && init.translation.is_finite()
                && init.rotation.is_normalized())
        {
            let expected = "a positive scale and finite numbers";
            let Sim3 { scale, rotation, translation } = init;
            let found = format!("scale {scale}, rotation {rotation}, translation {translation}");
            return Err(out_of_range("initial pose", expected, found));
        }
        if !(1..=MAX_STARTS).contains(&self.n_starts) {
            let expected = format!("1 to {MAX_STARTS}");
            return Err(out_of_range("starts", &expected, self.n_starts.to_string()));
        }
        Ok(())
    }

    /// Least and greatest scale, metres for each radius of the model.
    pub(crate) fn scales(&self, model: &AlignModel, observed: &ObservedCloud) -> [f64; 2] {
        let radius = model.object_from_unit.scale;
        match (self.scale_range, self.init) {
            (Some(range), _) => range.map(|scale| scale * radius),
            (None, Some(init)) => SCALES_AROUND_GUESS.map(|x| x * init.scale * radius),
            (None, None) => SCALES.map(|x| x * observed.diameter() / 2.0),
        }
    }
}

fn out_of_range(what: &'static str, expected: &str, found: String) -> Error {
    Error::OutOfRange { what, expected: expected.into(), found }
}
