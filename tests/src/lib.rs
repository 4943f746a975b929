//! Roads through the built binary, and what they share.

pub mod calibration;
pub mod shell;
