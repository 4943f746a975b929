//! Tests of the built binary, what they share, and the readers that are tried on damaged files.

pub mod mutation;
pub mod readers;
pub mod rgbd;
pub mod sample;
pub mod seeds;
pub mod shell;
