//! RRT-Connect (Kuffner & LaValle, RRT-Connect: An Efficient Approach to Single-Query Path Planning, ICRA 2000), with
//! the domains of Jaillet, Yershova, LaValle & Siméon (Adaptive Tuning of the Sampling Domain for Dynamic-Domain RRTs,
//! IROS 2005) around nodes whose edges were not free.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::edges::edge_is_free;
use super::joint_space::{JointSpace, between};
use super::sample_window::SampleWindow;
use super::tree::Tree;
use super::validity::Validity;
use crate::{Error, Result};

/// How long and how a path is searched.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanSettings {
    /// Seed of the random search: the same seed gives the same path.
    pub seed: u64,
    /// Most iterations, each one random sample that lies in the domain of the node nearest to it.
    pub iterations: usize,
    /// Longest edge of the trees, radians.
    pub longest_edge: f64,
}

impl Default for PlanSettings {
    fn default() -> Self {
        Self { seed: 0, iterations: 20_000, longest_edge: LONGEST_EDGE }
    }
}

/// See [`PlanSettings::longest_edge`].
const LONGEST_EDGE: f64 = 1.0;

/// Radius of the domain of a node after its first edge that is not free, in longest edges (in those of the default where they are
/// longer: shorter edges reach as far, in more steps).
const FIRST_DOMAIN: f64 = 5.0;
/// The domain is so much smaller after each further one, and larger again after one that is free.
const SHRINKAGE: f64 = 0.9;
/// Least radius of a domain, in the same unit. With half of it 5 of 97 problems of MotionBenchMaker are not solved.
const LEAST_DOMAIN: f64 = 2.0;
/// Most samples drawn for one that lies in a domain, on average over a search.
const DRAWS_AN_ITERATION: usize = 20;

/// A path through free space, or why there is none.
#[derive(Clone, Debug, PartialEq)]
pub enum Planned {
    /// A path was found.
    Path(PlannedPath),
    /// Something touches at the start.
    StartNotFree,
    /// Something touches at each of the goals.
    NoGoalFree,
    /// The search ended without a path; there may be one nevertheless.
    NotFound {
        /// Samples toward which a tree was extended.
        iterations: usize,
        /// Nodes of both trees.
        n_nodes: usize,
    },
}

/// A path of straight edges between joint values.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedPath {
    /// From the start to the goal, each unrolled as seen from the one before: continuous joints may leave −π … π, and
    /// edges are straight lines without a short way round. One point where start and goal are the same.
    pub waypoints: Vec<Vec<f64>>,
    /// Which of the goals it leads to.
    pub goal: usize,
    /// Samples toward which a tree was extended; 0 where a straight line was free.
    pub iterations: usize,
    /// Nodes of both trees.
    pub n_nodes: usize,
}

impl PlannedPath {
    /// Length of the path, radians: the sum of the lengths of its edges.
    pub fn length(&self) -> f64 {
        path_length(&self.waypoints)
    }
}

/// Length of a path of straight edges.
pub fn path_length(waypoints: &[Vec<f64>]) -> f64 {
    waypoints.windows(2).map(|edge| super::joint_space::straight_length(&edge[0], &edge[1])).sum()
}

/// A path from `start` to one of `goals` along which `validity` says that nothing touches.
///
/// Straight lines to the goals are tried first, the nearest goal first. Then two trees, one from the start and one from
/// all free goals, grow toward random samples and toward each other; the smaller one is extended. A node at which an edge
/// was not free lies beside an obstacle: samples from far away, which would lead through it again, are passed over. Which
/// goal is reached is left to the search.
///
/// # Errors
/// [`Error::Invalid`] where the start, a goal or a setting is outside of its range, or no goal was given.
pub fn plan_path(
    space: &JointSpace,
    validity: &impl Validity,
    start: &[f64],
    goals: &[Vec<f64>],
    settings: &PlanSettings,
) -> Result<Planned> {
    check(space, start, goals, settings)?;
    if !validity.is_free(start) {
        return Ok(Planned::StartNotFree);
    }
    let mut free_goals: Vec<usize> =
        (0..goals.len()).filter(|&goal| validity.is_free(&goals[goal])).collect();
    if free_goals.is_empty() {
        return Ok(Planned::NoGoalFree);
    }
    free_goals.sort_by(|&a, &b| {
        space.distance(start, &goals[a]).total_cmp(&space.distance(start, &goals[b]))
    });

    for &goal in &free_goals {
        let unrolled = space.toward(start, &goals[goal]);
        if edge_is_free(validity, start, &unrolled) {
            let mut waypoints = vec![start.to_vec()];
            if unrolled != start {
                waypoints.push(unrolled);
            }
            return Ok(Planned::Path(PlannedPath { waypoints, goal, iterations: 0, n_nodes: 0 }));
        }
    }

    let mut random = ChaCha8Rng::seed_from_u64(settings.seed);
    let search = Search { space, validity, longest_edge: settings.longest_edge };
    let mut from_start = Tree::new(space.n_joints());
    from_start.add_root(start);
    let mut from_goals = Tree::new(space.n_joints());
    for &goal in &free_goals {
        from_goals.add_root(&goals[goal]);
    }
    let window = SampleWindow::new(space, start, free_goals.iter().map(|&goal| &goals[goal]));
    let mut sample = Vec::with_capacity(space.n_joints());
    let mut iteration = 0;
    for _ in 0..settings.iterations.saturating_mul(DRAWS_AN_ITERATION) {
        if iteration == settings.iterations {
            break;
        }
        window.sample(iteration, &mut random, &mut sample);
        let start_grows = from_start.len() <= from_goals.len();
        let (growing, other) = if start_grows {
            (&mut from_start, &mut from_goals)
        } else {
            (&mut from_goals, &mut from_start)
        };
        let (nearest, distance) = growing.nearest(space, &sample);
        if distance > growing.domain(nearest) {
            continue;
        }
        iteration += 1;
        let Some(new) = search.extend(growing, nearest, &sample) else { continue };
        let Some(met) = search.connect(other, growing.node(new)) else { continue };
        let (in_start, in_goals) = if start_grows { (new, met) } else { (met, new) };
        let mut waypoints = from_start.to_root(in_start);
        waypoints.reverse();
        waypoints.extend(from_goals.to_root(in_goals).into_iter().skip(1));
        unroll(space, &mut waypoints);
        return Ok(Planned::Path(PlannedPath {
            waypoints,
            goal: free_goals[from_goals.root(in_goals)],
            iterations: iteration,
            n_nodes: from_start.len() + from_goals.len(),
        }));
    }
    Ok(Planned::NotFound { iterations: iteration, n_nodes: from_start.len() + from_goals.len() })
}

/// What both trees' growth needs.
struct Search<'a, V> {
    space: &'a JointSpace,
    validity: &'a V,
    longest_edge: f64,
}

impl<V: Validity> Search<'_, V> {
    /// One edge from a node toward `q`, at most the longest; its end, where it is free.
    fn extend(&self, tree: &mut Tree, from: usize, q: &[f64]) -> Option<usize> {
        let step = self.step(tree, from, q);
        tree.set_domain(from, self.domain_after(tree.domain(from), step.is_some()));
        step.map(|step| step.node)
    }

    /// The domain of a node after an edge from it was found to be free, or not.
    fn domain_after(&self, domain: f64, is_free: bool) -> f64 {
        let edge = self.longest_edge.max(LONGEST_EDGE);
        match is_free {
            true => domain / SHRINKAGE,
            false if domain.is_infinite() => FIRST_DOMAIN * edge,
            false => (domain * SHRINKAGE).max(LEAST_DOMAIN * edge),
        }
    }

    /// Edges from the nearest node toward `q` until it is reached; `None` where one is not free.
    fn connect(&self, tree: &mut Tree, q: &[f64]) -> Option<usize> {
        let mut node = tree.nearest(self.space, q).0;
        loop {
            let step = self.step(tree, node, q)?;
            if step.arrived {
                return Some(step.node);
            }
            node = step.node;
        }
    }

    fn step(&self, tree: &mut Tree, from: usize, q: &[f64]) -> Option<Step> {
        let start = tree.node(from);
        let distance = self.space.distance(start, q);
        let arrived = distance <= self.longest_edge;
        if distance == 0.0 {
            return Some(Step { node: from, arrived });
        }
        let mut end = self.space.toward(start, q);
        if !arrived {
            end = between(start, &end, self.longest_edge / distance);
        }
        edge_is_free(self.validity, start, &end)
            .then(|| Step { node: tree.add(&end, from), arrived })
    }
}

struct Step {
    node: usize,
    arrived: bool,
}

/// Turns each point by whole turns so that the edge from the one before is straight.
fn unroll(space: &JointSpace, waypoints: &mut [Vec<f64>]) {
    for i in 1..waypoints.len() {
        waypoints[i] = space.toward(&waypoints[i - 1], &waypoints[i]);
    }
}

fn check(
    space: &JointSpace,
    start: &[f64],
    goals: &[Vec<f64>],
    settings: &PlanSettings,
) -> Result<()> {
    space.check("start", start)?;
    for (index, goal) in goals.iter().enumerate() {
        space.check(&format!("goal {index}"), goal)?;
    }
    if goals.is_empty() {
        return Err(Error::Invalid {
            what: "goals".into(),
            expected: "at least one".into(),
            found: "none".into(),
        });
    }
    if !(settings.longest_edge > 0.0 && settings.longest_edge.is_finite()) {
        return Err(Error::Invalid {
            what: "longest_edge".into(),
            expected: "a length above 0".into(),
            found: settings.longest_edge.to_string(),
        });
    }
    Ok(())
}
