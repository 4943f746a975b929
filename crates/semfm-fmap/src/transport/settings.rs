//! How clouds are coupled.

use serde::{Deserialize, Serialize};

/// How the clouds are coupled.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TransportSettings {
    /// ε: blur, in units of the median cost.
    pub blur: f64,
    /// τ: what it costs to leave mass behind (weight of the KL terms); infinite for balanced.
    pub kl_weight: f64,
    /// Scaling iterations.
    pub iterations: usize,
}

impl Default for TransportSettings {
    fn default() -> Self {
        Self { blur: 0.05, kl_weight: 1.0, iterations: 60 }
    }
}
