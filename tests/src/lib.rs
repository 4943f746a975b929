//! Tests of the built binary and of the readers: what they share.

pub mod sample;
pub mod shell;
