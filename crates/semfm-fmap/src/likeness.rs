//! How alike two objects are as a whole: whether they are of one kind.
//!
//! Matching removes what all parts of an object share ([`features`](crate::features)), and with it what says
//! that a pair of pliers is no boot. Here the features stay as they are.

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, Par};
use semfm_geom::SemanticCloud;

use crate::{Error, Result};

/// Points of a cloud that are compared. The first points of a lifted cloud are spread evenly over the surface
/// (farthest points), so a prefix is as good as a sample; 128, 256 and all 1200 tell kinds apart equally well
/// (`bench/README.md`), and 256 against 256 take a hundredth of a matching.
const N_POINTS: usize = 256;

/// An object's features of unit length, not centred, at evenly spread points.
#[derive(Clone, Debug)]
pub struct PlainFeatures {
    /// One point per column (d × m).
    columns: Mat<f32>,
    /// Mean of the columns at unit length (d).
    descriptor: Vec<f32>,
}

impl PlainFeatures {
    /// Takes the features of a cloud's first points, at most 256.
    pub fn new(cloud: &SemanticCloud) -> Self {
        let (d, m) = (cloud.dim(), cloud.n_points().min(N_POINTS));
        let mut columns = Mat::<f32>::zeros(d, m);
        let mut mean = vec![0.0f64; d];
        for j in 0..m {
            let column = columns.col_as_slice_mut(j);
            column.copy_from_slice(cloud.feature(j));
            to_unit_length(column);
            mean.iter_mut().zip(&*column).for_each(|(sum, &x)| *sum += f64::from(x));
        }
        let mut descriptor: Vec<f32> = mean.iter().map(|sum| (sum / m as f64) as f32).collect();
        to_unit_length(&mut descriptor);
        Self { columns, descriptor }
    }

    /// Mean feature of the surface at unit length (d): what similar objects are looked up by.
    pub fn descriptor(&self) -> &[f32] {
        &self.descriptor
    }

    /// Mean cosine of each point's feature with the most similar one of the other object, both ways:
    ///
    /// l = ½ (meanᵢ maxⱼ cos(fᵢ, gⱼ) + meanⱼ maxᵢ cos(fᵢ, gⱼ))
    ///
    /// in [−1, 1]; the same whichever object comes first. How high it is for objects of one kind depends on
    /// the encoder ([`LikenessScale`](semfm_geom::LikenessScale)).
    ///
    /// # Errors
    /// [`Error::Length`] where the feature dimensions differ.
    pub fn likeness(&self, other: &Self) -> Result<f64> {
        Error::length("feature dimension", self.columns.nrows(), other.columns.nrows())?;
        let (n, m) = (self.columns.ncols(), other.columns.ncols());
        let mut cosines = Mat::<f32>::zeros(n, m);
        let (left, right) = (self.columns.transpose(), other.columns.as_ref());
        matmul(cosines.as_mut(), Accum::Replace, left, right, 1.0, Par::Seq);
        let mut best_of_row = vec![-1.0f32; n];
        let mut sum_of_columns = 0.0;
        for j in 0..m {
            let mut best = -1.0f32;
            for (best_of_row, &cosine) in best_of_row.iter_mut().zip(cosines.col_as_slice(j)) {
                *best_of_row = best_of_row.max(cosine);
                best = best.max(cosine);
            }
            sum_of_columns += f64::from(best);
        }
        let sum_of_rows: f64 = best_of_row.iter().map(|&best| f64::from(best)).sum();
        Ok(0.5 * (sum_of_rows / n as f64 + sum_of_columns / m as f64))
    }
}

/// Scales to unit length; a vector of zeros stays one.
fn to_unit_length(vector: &mut [f32]) {
    let square: f64 = vector.iter().map(|&x| f64::from(x).powi(2)).sum();
    let scale = (square.sqrt() + 1e-9).recip();
    vector.iter_mut().for_each(|x| *x = (f64::from(*x) * scale) as f32);
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_geom::math::DVec3;

    /// Points whose features are these vectors of two numbers.
    fn plain(features: &[[f32; 2]]) -> PlainFeatures {
        let n = features.len();
        let cloud = SemanticCloud::new(
            vec![DVec3::ZERO; n],
            features.as_flattened().to_vec(),
            2,
            vec![1; n],
        );
        PlainFeatures::new(&cloud.unwrap())
    }

    #[test]
    fn an_object_is_like_itself_at_any_length_and_the_order_does_not_matter() {
        let (a, longer) = (plain(&[[1.0, 0.0], [0.0, 1.0]]), plain(&[[0.0, 7.0], [3.0, 0.0]]));
        assert!((a.likeness(&longer).unwrap() - 1.0).abs() < 1e-6);
        // (1, 0) meets itself, (0, 1) meets (1, 0) at best; back, (1, 0) meets itself.
        let half = plain(&[[1.0, 0.0]]);
        for likeness in [a.likeness(&half).unwrap(), half.likeness(&a).unwrap()] {
            assert!((likeness - 0.75).abs() < 1e-6, "{likeness}");
        }
        let opposite = plain(&[[-1.0, 0.0]]);
        assert!((half.likeness(&opposite).unwrap() + 1.0).abs() < 1e-6);
    }

    #[test]
    fn the_descriptor_is_the_mean_at_unit_length_and_other_encoders_are_refused() {
        let both = plain(&[[2.0, 0.0], [0.0, 5.0]]);
        let root = 0.5f32.sqrt();
        assert!(both.descriptor().iter().all(|x| (x - root).abs() < 1e-6));
        let cloud = SemanticCloud::new(vec![DVec3::ZERO], vec![1.0; 3], 3, vec![1]).unwrap();
        let error = both.likeness(&PlainFeatures::new(&cloud)).unwrap_err();
        assert!(matches!(error, Error::Length { expected: 2, found: 3, .. }));
        assert_eq!(plain(&[[0.0, 0.0]]).descriptor(), [0.0, 0.0]);
    }
}
