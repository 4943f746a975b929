//! Semantic anchors: parts of two objects that correspond (the paper's section IV-D).

use faer::Mat;
use semfm_geom::SemanticCloud;
use serde::{Deserialize, Serialize};

use crate::assignment::{Assigned, best_pairs};
use crate::clusters::Clusters;

/// A part of the source and the part of the target that it is paired with.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Anchor {
    /// Cluster label on the source.
    pub source: u32,
    /// Cluster label on the target.
    pub target: u32,
    /// Cosine of the two mean embeddings.
    pub cosine: f64,
    /// How much the cosine exceeds the best rival in its row or column: negative where the
    /// assignment took a pair whose parts are nearer to others, infinite without a rival.
    #[serde(serialize_with = "finite_or_null", deserialize_with = "null_as_infinity")]
    pub margin: f64,
}

/// The paired parts of two objects.
#[derive(Clone, Debug, PartialEq)]
pub struct Anchors {
    /// Pairs, by falling cosine.
    pub pairs: Vec<Anchor>,
    /// All cosines S (K_source × K_target).
    pub cosines: Mat<f64>,
}

/// A cloud and the clusters of its points.
#[derive(Clone, Copy, Debug)]
pub struct ClusteredCloud<'a> {
    /// The cloud (M points).
    pub cloud: &'a SemanticCloud,
    /// One label per point (M).
    pub clusters: &'a Clusters,
}

impl ClusteredCloud<'_> {
    /// Mean embedding of each cluster, scaled to unit length.
    fn unit_means(self) -> Vec<Vec<f64>> {
        let mut means = self.clusters.means(self.cloud);
        for mean in &mut means {
            let length = mean.iter().map(|x| x * x).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
            mean.iter_mut().for_each(|x| *x /= length);
        }
        means
    }
}

impl Anchors {
    /// The `alpha` one-to-one pairs of clusters with the largest total cosine between their mean
    /// embeddings, by an exact assignment; fewer where there are fewer clusters.
    ///
    /// S = (s̄ᵢ · s̄ⱼ)/(‖s̄ᵢ‖ ‖s̄ⱼ‖) over the mean embeddings s̄ of the clusters, equation 11. The clouds
    /// must have features of the same dimension.
    pub fn select(source: ClusteredCloud<'_>, target: ClusteredCloud<'_>, alpha: usize) -> Self {
        let (on_source, on_target) = (source.unit_means(), target.unit_means());
        let cosines = Mat::from_fn(on_source.len(), on_target.len(), |i, j| {
            on_source[i].iter().zip(&on_target[j]).map(|(a, b)| a * b).sum()
        });
        let mut pairs: Vec<Anchor> = best_pairs(cosines.as_ref(), alpha)
            .into_iter()
            .map(|Assigned { row: i, column: j }| Anchor {
                source: i as u32,
                target: j as u32,
                cosine: cosines[(i, j)],
                margin: margin(&cosines, i, j),
            })
            .collect();
        pairs.sort_by(|a, b| b.cosine.total_cmp(&a.cosine).then(a.source.cmp(&b.source)));
        Self { pairs, cosines }
    }

    /// The same anchors seen from the target.
    pub fn swapped(&self) -> Self {
        let pairs = self.pairs.iter();
        Self {
            pairs: pairs.map(|a| Anchor { source: a.target, target: a.source, ..*a }).collect(),
            cosines: self.cosines.transpose().to_owned(),
        }
    }

    /// The source's labels, in the order of the pairs.
    pub fn source_labels(&self) -> Vec<u32> {
        self.pairs.iter().map(|anchor| anchor.source).collect()
    }

    /// The target's labels, in the order of the pairs.
    pub fn target_labels(&self) -> Vec<u32> {
        self.pairs.iter().map(|anchor| anchor.target).collect()
    }
}

/// Sᵢⱼ − max over the rivals in row i and column j.
fn margin(cosines: &Mat<f64>, i: usize, j: usize) -> f64 {
    let row = (0..cosines.ncols()).filter(|&c| c != j).map(|c| cosines[(i, c)]);
    let column = (0..cosines.nrows()).filter(|&r| r != i).map(|r| cosines[(r, j)]);
    cosines[(i, j)] - row.chain(column).fold(f64::NEG_INFINITY, f64::max)
}

/// JSON has no infinity: a margin without a rival is written as null.
fn finite_or_null<S: serde::Serializer>(x: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    x.is_finite().then_some(*x).serialize(serializer)
}

fn null_as_infinity<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::<f64>::deserialize(deserializer)?.unwrap_or(f64::INFINITY))
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_geom::math::DVec3;

    fn cloud(features: &[[f32; 2]]) -> SemanticCloud {
        let n = features.len();
        SemanticCloud::new(vec![DVec3::ZERO; n], features.concat(), 2, vec![1; n]).unwrap()
    }

    #[test]
    fn parts_that_look_alike_are_paired_and_margins_tell_how_clearly() {
        // Source parts: east, north. Target parts: north, north-east, east.
        let source = cloud(&[[2.0, 0.0], [4.0, 0.0], [0.0, 1.0]]);
        let target = cloud(&[[0.0, 3.0], [1.0, 1.0], [5.0, 0.0]]);
        let (of_source, of_target) =
            (Clusters::from_labels(&[0, 0, 1]), Clusters::from_labels(&[0, 1, 2]));
        let anchors = Anchors::select(
            ClusteredCloud { cloud: &source, clusters: &of_source },
            ClusteredCloud { cloud: &target, clusters: &of_target },
            2,
        );
        assert_eq!((anchors.source_labels(), anchors.target_labels()), (vec![0, 1], vec![2, 0]));
        let diagonal = 0.5f64.sqrt();
        assert!((anchors.pairs[0].cosine - 1.0).abs() < 1e-12);
        assert!((anchors.pairs[0].margin - (1.0 - diagonal)).abs() < 1e-12);
    }

    #[test]
    fn one_part_each_has_no_rival_and_still_goes_through_json() {
        let one = cloud(&[[1.0, 0.0]]);
        let labels = Clusters::from_labels(&[0]);
        let one = ClusteredCloud { cloud: &one, clusters: &labels };
        let anchors = Anchors::select(one, one, 2);
        assert_eq!(anchors.pairs.len(), 1);
        let text = serde_json::to_string(&anchors.pairs[0]).unwrap();
        assert!(text.contains("\"margin\":null"), "{text}");
        assert_eq!(serde_json::from_str::<Anchor>(&text).unwrap(), anchors.pairs[0]);
    }
}
