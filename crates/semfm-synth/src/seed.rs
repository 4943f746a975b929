//! Seeds made of words, and the few draws that shapes and encoder need.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A stream of random numbers named by `key`: the same key gives the same numbers.
pub(crate) fn stream(key: &[&str]) -> Draw {
    let hash = blake3::hash(key.join("\u{1f}").as_bytes());
    Draw(ChaCha8Rng::from_seed(*hash.as_bytes()))
}

/// A unit vector (d) named by `key`, uniform on the sphere.
pub(crate) fn direction(dim: usize, key: &[&str]) -> Vec<f32> {
    let mut draw = stream(key);
    let mut vector: Vec<f32> = (0..dim).map(|_| draw.normal() as f32).collect();
    let norm = vector.iter().map(|x| x * x).sum::<f32>().sqrt();
    vector.iter_mut().for_each(|x| *x /= norm);
    vector
}

pub(crate) struct Draw(ChaCha8Rng);

impl Draw {
    /// Uniform in [low, high).
    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.random::<f64>()
    }

    /// Standard normal (Box & Muller 1958).
    pub(crate) fn normal(&mut self) -> f64 {
        let (u, v) = (1.0 - self.0.random::<f64>(), self.0.random::<f64>());
        (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    }

    /// Uniform in 0..n.
    pub(crate) fn below(&mut self, n: usize) -> usize {
        self.0.random_range(0..n)
    }
}
