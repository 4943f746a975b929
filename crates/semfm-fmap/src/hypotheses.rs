//! Where a region may belong: the components of a vote as alternatives.

use std::collections::BTreeMap;

use semfm_geom::{DisjointSets, Mesh};
use serde::{Deserialize, Serialize};

use crate::Region;

/// A further hypothesis needs this share of the votes.
const LEAST_SHARE: f64 = 0.1;
/// Components are cut where the vote falls below this share of the threshold: between the two handles
/// of a pair of scissors it falls to nearly nothing, within one handle it does not.
const COMPONENT_LEVEL: f64 = 0.5;

/// A vertex set is one component where its largest one has this share of its area.
const ONE_COMPONENT: f64 = 0.9;

/// One place where the region may belong.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Hypothesis {
    /// The region there.
    pub region: Region,
    /// Share of the votes that fell there, among the hypotheses returned.
    pub probability: f64,
}

/// A hypothesis on the working vertices.
#[derive(Clone, Debug)]
pub(crate) struct WorkingHypothesis {
    pub weights: Vec<f64>,
    pub probability: f64,
}

/// A connected component of a vote.
#[derive(Clone, Copy, Debug, Default)]
struct Component {
    root: u32,
    /// ∫ of the vote over it.
    votes: f64,
    /// Its largest vote.
    peak: f64,
}

/// The components of a vote, as up to `count` alternatives by falling probability.
///
/// Which of two handles of a pair of scissors was meant does not follow from semantics and intrinsic
/// geometry, so the vote spreads over both. `votes` (n, in [0, 1], [`Region::COUNTS`] the threshold)
/// is cut where it falls below half the threshold; each connected component with at least a tenth
/// of all votes (by area) is a hypothesis: its vertices that reach half of the component's own peak.
/// Components are alternatives only where the demonstrated region was connected: if `connected` is
/// false they belong together, and the vote as it stands is the single hypothesis.
pub(crate) fn hypotheses(
    mesh: &Mesh,
    votes: &[f64],
    areas: &[f64],
    connected: bool,
    count: usize,
) -> Vec<WorkingHypothesis> {
    let level = COMPONENT_LEVEL * Region::COUNTS;
    let above: Vec<bool> = votes.iter().map(|&v| v >= level).collect();
    let mut components = components_of(mesh, &above);
    let vertices: Vec<u32> = (0..votes.len() as u32).filter(|&v| above[v as usize]).collect();
    let root_of: Vec<u32> =
        vertices.iter().map(|&v| if connected { components.root(v) } else { 0 }).collect();
    let mut by_root = BTreeMap::<u32, Component>::new();
    for (&v, &root) in vertices.iter().zip(&root_of) {
        let component = by_root.entry(root).or_insert(Component { root, ..Component::default() });
        component.votes += votes[v as usize] * areas[v as usize];
        component.peak = component.peak.max(votes[v as usize]);
    }
    let total: f64 = by_root.values().map(|component| component.votes).sum();
    let mut kept: Vec<Component> =
        by_root.into_values().filter(|c| c.votes >= LEAST_SHARE * total).collect();
    kept.sort_by(|a, b| b.votes.total_cmp(&a.votes).then(a.root.cmp(&b.root)));
    kept.truncate(count);
    let total: f64 = kept.iter().map(|component| component.votes).sum();
    let mut out = Vec::with_capacity(kept.len());
    for component in kept {
        let mut weights = vec![0.0; votes.len()];
        for (&v, _) in vertices.iter().zip(&root_of).filter(|(_, root)| **root == component.root) {
            let vote = votes[v as usize];
            weights[v as usize] = if connected { vote / component.peak } else { vote };
        }
        out.push(WorkingHypothesis { weights, probability: component.votes / total });
    }
    out
}

/// Whether the vertices inside are connected: nine tenths of their area in one component.
pub(crate) fn is_connected(mesh: &Mesh, inside: &[bool], areas: &[f64]) -> bool {
    let mut components = components_of(mesh, inside);
    let mut sizes = BTreeMap::<u32, f64>::new();
    for v in (0..inside.len() as u32).filter(|&v| inside[v as usize]) {
        *sizes.entry(components.root(v)).or_default() += areas[v as usize];
    }
    let total: f64 = sizes.values().sum();
    sizes.values().fold(0.0f64, |m, &s| m.max(s)) >= ONE_COMPONENT * total
}

/// The vertices inside, joined along the edges between them.
fn components_of(mesh: &Mesh, inside: &[bool]) -> DisjointSets {
    let mut components = DisjointSets::new(inside.len());
    for &[a, b, c] in mesh.faces() {
        for (i, j) in [(a, b), (b, c), (c, a)] {
            if inside[i as usize] && inside[j as usize] {
                components.join(i, j);
            }
        }
    }
    components
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
        let found = hypotheses(&mesh, &votes, &areas, true, 3);
        assert_eq!(found.len(), 2);
        assert!(found[0].weights[0] >= Region::COUNTS && found[0].weights[20] == 0.0);
        assert!(found[1].weights[20] >= Region::COUNTS && found[1].weights[0] == 0.0);
        assert!(
            (found[0].probability + found[1].probability - 1.0).abs() < 1e-12
                && found[0].probability > found[1].probability
        );
        assert_eq!(hypotheses(&mesh, &votes, &areas, true, 1).len(), 1);
        let together = hypotheses(&mesh, &votes, &areas, false, 3);
        assert_eq!((together.len(), together[0].probability), (1, 1.0));
        assert!(hypotheses(&mesh, &[0.0; 22], &areas, true, 3).is_empty());
    }

    #[test]
    fn components_are_counted_by_area() {
        let mesh = strip();
        let areas = mesh.vertex_areas();
        let one: Vec<bool> = (0..22).map(|v| v / 2 < 4).collect();
        let two: Vec<bool> = (0..22).map(|v| !(3..8).contains(&(v / 2))).collect();
        assert!(is_connected(&mesh, &one, &areas));
        assert!(!is_connected(&mesh, &two, &areas));
    }
}
