//! What to do with a pose.

use serde::{Deserialize, Serialize};

/// What to do with the pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Use it.
    Accept,
    /// Let somebody look at it.
    Check,
    /// It explains too little of what was seen, or shows what was not there.
    Refuse,
}
