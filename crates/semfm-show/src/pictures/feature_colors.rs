//! Features as colours: their first three principal directions as red, green and blue, in one basis for
//! both objects of a pair, so that equal colours are equal features.

use faer::MatRef;
use semfm::fmap::PreparedObject;
use semfm::fmap::features::JointFeatures;

use crate::Result;

/// Features have unit RMS length: this much on each side of grey shows all but the outliers.
const SPREAD: f64 = 1.5;

/// The colour of each cloud point.
pub(super) struct FeatureColors {
    pub source: Vec<[f32; 3]>,
    pub target: Vec<[f32; 3]>,
}

impl FeatureColors {
    /// # Errors
    /// [`Error::Semfm`](crate::Error::Semfm) for features of different dimensions.
    pub(super) fn new(source: &PreparedObject, target: &PreparedObject) -> Result<Self> {
        let joint = JointFeatures::new(source.features(), target.features(), 3)?;
        Ok(Self { source: colors(joint.source.as_ref()), target: colors(joint.target.as_ref()) })
    }
}

/// One colour per row; a missing direction is grey.
fn colors(features: MatRef<'_, f64>) -> Vec<[f32; 3]> {
    (0..features.nrows()).map(|i| std::array::from_fn(|c| channel(features, i, c))).collect()
}

fn channel(features: MatRef<'_, f64>, i: usize, c: usize) -> f32 {
    let value = if c < features.ncols() { features[(i, c)] } else { 0.0 };
    (value / (2.0 * SPREAD) + 0.5).clamp(0.0, 1.0) as f32
}
