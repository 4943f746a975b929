//! One subcommand for each job of the CI.

fn main() {}
