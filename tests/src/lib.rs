//! Tests of the built binary, and what they share.

pub mod shell;
