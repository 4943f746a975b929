//! The coupling that a transport comes to, and what is read off it.

use rayon::prelude::*;

use super::lanes::{Dot, UNDERFLOW};

/// A coupling P (M_target × M_source) of two clouds, kept as diag(u) K diag(v).
#[derive(Clone, Debug)]
pub struct Plan {
    /// K, row-major: one row per target point.
    pub(super) kernel: Vec<f32>,
    /// u (M_target).
    pub(super) on_target: Vec<f32>,
    /// v (M_source).
    pub(super) on_source: Vec<f32>,
    /// Iterations that were run.
    pub iterations: usize,
    /// Largest relative change of u in the last iteration.
    pub change: f64,
    /// Whether the scaling had to move to the log domain.
    pub log_domain: bool,
}

impl Plan {
    /// Number of source points.
    pub fn n_source(&self) -> usize {
        self.on_source.len()
    }

    /// Number of target points.
    pub fn n_target(&self) -> usize {
        self.on_target.len()
    }

    /// Mass that goes from source point `source` to target point `target`.
    pub fn mass(&self, target: usize, source: usize) -> f64 {
        let kernel = self.kernel[target * self.n_source() + source];
        f64::from(self.on_target[target]) * f64::from(kernel) * f64::from(self.on_source[source])
    }

    /// A function on the source's points (M_source) as each target point (M_target) receives it: the
    /// mean over where its mass comes from, 0 where no mass arrives.
    pub fn vote(&self, on_source: &[f64]) -> Vec<f64> {
        let weighted: Vec<f32> =
            self.on_source.iter().zip(on_source).map(|(v, f)| v * *f as f32).collect();
        let rows = self.kernel.par_chunks(self.n_source());
        rows.map(|row| {
            let vote = pulp::Arch::new().dispatch(Dot(row, &weighted));
            let all = pulp::Arch::new().dispatch(Dot(row, &self.on_source));
            if all > UNDERFLOW { f64::from(vote) / f64::from(all) } else { 0.0 }
        })
        .collect()
    }

    /// A function on the target's points (M_target) as each source point (M_source) finds it where
    /// its mass goes: the mean over there, 0 where no mass leaves.
    pub fn vote_back(&self, on_target: &[f64]) -> Vec<f64> {
        let (mut votes, mut all) = (vec![0.0; self.n_source()], vec![0.0; self.n_source()]);
        for ((row, &u), &f) in
            self.kernel.chunks(self.n_source()).zip(&self.on_target).zip(on_target)
        {
            for ((vote, all), &k) in votes.iter_mut().zip(&mut all).zip(row) {
                let mass = f64::from(u) * f64::from(k);
                *vote += mass * f;
                *all += mass;
            }
        }
        let sums = votes.into_iter().zip(all);
        sums.map(|(vote, all)| if all > 0.0 { vote / all } else { 0.0 }).collect()
    }

    /// For each target point the source point that sends it the most.
    pub fn source_of(&self) -> Vec<u32> {
        let rows = self.kernel.par_chunks(self.n_source());
        rows.map(|row| largest(row.iter().zip(&self.on_source).map(|(k, v)| k * v))).collect()
    }

    /// For each source point the target point that it sends the most to.
    pub fn target_of(&self) -> Vec<u32> {
        let mut best = vec![(0u32, f32::NEG_INFINITY); self.n_source()];
        for ((i, row), u) in (0..).zip(self.kernel.chunks(self.n_source())).zip(&self.on_target) {
            for (best, k) in best.iter_mut().zip(row) {
                if u * k > best.1 {
                    *best = (i, u * k);
                }
            }
        }
        best.into_iter().map(|(i, _)| i).collect()
    }
}

/// Where the largest of some values stands, the first of equal ones.
fn largest(values: impl Iterator<Item = f32>) -> u32 {
    let mut best = (0, f32::NEG_INFINITY);
    for (j, x) in (0..).zip(values) {
        if x > best.1 {
            best = (j, x);
        }
    }
    best.0
}
