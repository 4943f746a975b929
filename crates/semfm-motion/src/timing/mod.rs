//! Time along a curve: as fast as velocity and acceleration limits allow, with limited jerk, as samples between which a
//! cubic keeps the limits; and the check of such samples against limits and obstacles.

mod check_trajectory;
mod limits;
mod profile;
mod retime;
mod smoothing;
#[cfg(test)]
mod tests;

pub use check_trajectory::{CheckSettings, Violation, ViolationKind, check_trajectory};
pub use limits::{JointMotionLimit, MotionLimits};
pub use retime::{RetimeSettings, Retimed, retime};
