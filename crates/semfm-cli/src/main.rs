//! SemFM at the shell.

fn main() {}
