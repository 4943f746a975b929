//! Shorter paths: needless waypoints go, and random chords replace what lies between their ends (Geraerts & Overmars,
//! Creating High-quality Paths for Motion Planning, IJRR 2007).

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::edges::edge_is_free;
use super::joint_space::{between, straight_length};
use super::rrt_connect::path_length;
use super::validity::Validity;

/// How hard a path is made shorter.
#[derive(Clone, Debug, PartialEq)]
pub struct ShortenSettings {
    /// Seed of the random chords.
    pub seed: u64,
    /// Most chords tried.
    pub chords: usize,
    /// Chords in a row without success after which the path is taken as it is.
    pub failures: usize,
}

/// On MotionBenchMaker 30 failures make paths 1 to 2 % shorter than 12 and take a quarter longer; 8 make them 1 to 2 % longer.
impl Default for ShortenSettings {
    fn default() -> Self {
        Self { seed: 0, chords: 200, failures: 12 }
    }
}

/// A path between the same ends that is no longer than `waypoints` and as free. Edges are straight lines without a
/// short way round, as in [`super::PlannedPath`].
pub fn shorten(
    validity: &impl Validity,
    waypoints: &[Vec<f64>],
    settings: &ShortenSettings,
) -> Vec<Vec<f64>> {
    let mut path = waypoints.to_vec();
    drop_waypoints(validity, &mut path);
    let mut random = ChaCha8Rng::seed_from_u64(settings.seed);
    let mut failures = 0;
    for _ in 0..settings.chords {
        if path.len() < 3 || failures >= settings.failures {
            break;
        }
        if cut(validity, &mut path, random.random(), random.random()) {
            failures = 0;
        } else {
            failures += 1;
        }
    }
    drop_waypoints(validity, &mut path);
    path
}

/// From each waypoint goes straight to the farthest later one that it can reach.
fn drop_waypoints(validity: &impl Validity, path: &mut Vec<Vec<f64>>) {
    let mut at = 0;
    while at + 2 < path.len() {
        if let Some(to) =
            (at + 2..path.len()).rev().find(|&to| edge_is_free(validity, &path[at], &path[to]))
        {
            path.drain(at + 1..to);
        }
        at += 1;
    }
}

/// A place on a path.
struct Place {
    /// Number of the edge.
    edge: usize,
    q: Vec<f64>,
}

/// Replaces the part between two places (shares of the path's length) by a straight line; false where that gains
/// nothing or is not free.
fn cut(validity: &impl Validity, path: &mut Vec<Vec<f64>>, one: f64, other: f64) -> bool {
    let length = path_length(path);
    let (from, to) = (place(path, one.min(other) * length), place(path, one.max(other) * length));
    if from.edge == to.edge {
        return false;
    }
    let mut old = vec![from.q.clone()];
    old.extend_from_slice(&path[from.edge + 1..=to.edge]);
    old.push(to.q.clone());
    let gain = path_length(&old) - straight_length(&from.q, &to.q);
    if gain < LEAST_GAIN * length || !edge_is_free(validity, &from.q, &to.q) {
        return false;
    }
    path.splice(from.edge + 1..=to.edge, [from.q, to.q]);
    true
}

/// Least gain of a chord as a share of the path's length. Below it, chords mill off corners that the blends round anyway.
const LEAST_GAIN: f64 = 1e-3;

fn place(path: &[Vec<f64>], mut along: f64) -> Place {
    for edge in 0..path.len() - 1 {
        let length = straight_length(&path[edge], &path[edge + 1]);
        if along <= length && length > 0.0 {
            return Place { edge, q: between(&path[edge], &path[edge + 1], along / length) };
        }
        along -= length;
    }
    Place { edge: path.len() - 2, q: path[path.len() - 1].clone() }
}
