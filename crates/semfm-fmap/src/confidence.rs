//! How far to trust a transfer.
//!
//! The best predictor of a right answer is **agreement** between two opinions formed in different
//! ways: the region that a map carries, and the region that transport between the clouds gives
//! without any map (AUC .94 for IoU ≥ .5 on simulated features). Dirichlet energy, orthogonality,
//! commutativity and the margin of the anchors do not predict success (AUC .42–.57); they are
//! reported, and nothing is decided by them.

use semfm_geom::Mesh;
use serde::{Deserialize, Serialize};

use crate::Region;
use crate::neighbour_graph::Pieces;

/// From this agreement on the answer is accepted: above it two in three answers reach IoU .7.
pub const ACCEPT: f64 = 0.6;
/// Below this agreement the mean IoU is .34: no answer.
pub const CHECK: f64 = 0.4;
/// A further hypothesis needs this share of the votes.
const LEAST_SHARE: f64 = 0.1;
/// Islands are cut where the vote falls below this share of the threshold: between the two handles
/// of a pair of scissors it falls to nearly nothing, within one handle it does not.
const ISLAND_LEVEL: f64 = 0.5;

/// What to do with the answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Use it.
    Accept,
    /// Let somebody look at it.
    Check,
    /// There is no answer worth using.
    Refuse,
}

impl Verdict {
    /// The verdict on an agreement in [0, 1].
    pub fn of(agreement: f64) -> Self {
        if agreement >= ACCEPT {
            Self::Accept
        } else if agreement >= CHECK {
            Self::Check
        } else {
            Self::Refuse
        }
    }
}

/// One place where the region may belong.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Hypothesis {
    /// The region there.
    pub region: Region,
    /// Share of the votes that fell there, among the hypotheses returned.
    pub probability: f64,
}

/// The islands of a vote, as up to `count` alternatives by falling probability.
///
/// Which of two handles of a pair of scissors was meant cannot be told from semantics and intrinsic
/// geometry, so the vote spreads over both. `votes` (n, in [0, 1], [`Region::COUNTS`] the threshold)
/// is cut where it falls below half the threshold; each connected island with at least a tenth
/// of all votes (by area) is a hypothesis: its vertices that reach half of the island's own peak.
/// Islands are alternatives only where the demonstrated region was in one piece: if `one_piece` is
/// false they belong together, and the vote as it stands is the single hypothesis.
pub(crate) fn islands(
    mesh: &Mesh,
    votes: &[f64],
    areas: &[f64],
    one_piece: bool,
    count: usize,
) -> Vec<(Vec<f64>, f64)> {
    let level = ISLAND_LEVEL * Region::COUNTS;
    let mut pieces = Pieces::new(votes.len());
    for &[a, b, c] in mesh.faces() {
        for (i, j) in [(a, b), (b, c), (c, a)] {
            if votes[i as usize] >= level && votes[j as usize] >= level {
                pieces.join(i, j);
            }
        }
    }
    let land: Vec<u32> = (0..votes.len() as u32).filter(|&v| votes[v as usize] >= level).collect();
    let mut islands = std::collections::BTreeMap::<u32, (f64, f64)>::new(); // root → (votes, peak)
    for &v in &land {
        let root = if one_piece { pieces.of(v) } else { 0 };
        let island = islands.entry(root).or_insert((0.0, 0.0));
        island.0 += votes[v as usize] * areas[v as usize];
        island.1 = island.1.max(votes[v as usize]);
    }
    let total: f64 = islands.values().map(|island| island.0).sum();
    let mut kept: Vec<(u32, f64, f64)> = islands
        .into_iter()
        .map(|(root, (sum, peak))| (root, sum, peak))
        .filter(|i| i.1 >= LEAST_SHARE * total)
        .collect();
    kept.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    kept.truncate(count);
    let total: f64 = kept.iter().map(|island| island.1).sum();
    let mut out = Vec::with_capacity(kept.len());
    for (root, sum, peak) in kept {
        let mut weights = vec![0.0; votes.len()];
        for &v in land.iter().filter(|&&v| !one_piece || pieces.of(v) == root) {
            weights[v as usize] =
                if one_piece { votes[v as usize] / peak } else { votes[v as usize] };
        }
        out.push((weights, sum / total));
    }
    out
}

/// Whether the vertices inside hang together (nine tenths of their area in one piece).
pub(crate) fn is_one_piece(mesh: &Mesh, inside: &[bool], areas: &[f64]) -> bool {
    let mut pieces = Pieces::new(inside.len());
    for &[a, b, c] in mesh.faces() {
        for (i, j) in [(a, b), (b, c), (c, a)] {
            if inside[i as usize] && inside[j as usize] {
                pieces.join(i, j);
            }
        }
    }
    let mut sizes = std::collections::BTreeMap::<u32, f64>::new();
    for v in (0..inside.len() as u32).filter(|&v| inside[v as usize]) {
        *sizes.entry(pieces.of(v)).or_default() += areas[v as usize];
    }
    let total: f64 = sizes.values().sum();
    sizes.values().fold(0.0f64, |m, &s| m.max(s)) >= 0.9 * total
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_geom::math::DVec3;

    /// A strip of ten squares.
    fn strip() -> Mesh {
        let vertices = (0..11)
            .flat_map(|i| [DVec3::new(f64::from(i), 0.0, 0.0), DVec3::new(f64::from(i), 1.0, 0.0)]);
        let faces = (0..10u32)
            .flat_map(|i| [[2 * i, 2 * i + 2, 2 * i + 1], [2 * i + 1, 2 * i + 2, 2 * i + 3]]);
        Mesh::new(vertices.collect(), faces.collect()).unwrap()
    }

    #[test]
    fn two_handles_are_two_hypotheses_unless_both_were_shown() {
        let mesh = strip();
        let areas = mesh.vertex_areas();
        let votes: Vec<f64> = (0..22)
            .map(|v| match v / 2 {
                0..=2 => 0.9,
                8..=10 => 0.4,
                _ => 0.0,
            })
            .collect();
        let found = islands(&mesh, &votes, &areas, true, 3);
        assert_eq!(found.len(), 2);
        assert!(found[0].0[0] >= Region::COUNTS && found[0].0[20] == 0.0);
        assert!(found[1].0[20] >= Region::COUNTS && found[1].0[0] == 0.0);
        assert!((found[0].1 + found[1].1 - 1.0).abs() < 1e-12 && found[0].1 > found[1].1);
        assert_eq!(islands(&mesh, &votes, &areas, true, 1).len(), 1);
        let together = islands(&mesh, &votes, &areas, false, 3);
        assert_eq!((together.len(), together[0].1), (1, 1.0));
        assert!(islands(&mesh, &[0.0; 22], &areas, true, 3).is_empty());
    }

    #[test]
    fn pieces_are_counted_by_area() {
        let mesh = strip();
        let areas = mesh.vertex_areas();
        let inside = |keep: fn(usize) -> bool| (0..22).map(|v| keep(v / 2)).collect::<Vec<bool>>();
        assert!(is_one_piece(&mesh, &inside(|i| i < 4), &areas));
        assert!(!is_one_piece(&mesh, &inside(|i| !(3..8).contains(&i)), &areas));
    }

    #[test]
    fn verdicts_follow_the_bands() {
        use Verdict::{Accept, Check, Refuse};
        assert_eq!(
            [0.0, 0.39, 0.4, 0.59, 0.6, 1.0].map(Verdict::of),
            [Refuse, Refuse, Check, Check, Accept, Accept]
        );
    }
}
