//! Options that every command takes.

use anyhow::{Context, Result};
use clap::Args;

/// Options of every command.
#[derive(Clone, Copy, Debug, Args)]
#[command(next_help_heading = "General")]
pub struct Common {
    /// Worker threads; 0 takes one for each core. Results do not depend on it
    #[arg(long, global = true, default_value_t = 0, value_name = "N")]
    pub threads: usize,
    /// Say nothing but the answer
    #[arg(long, short, global = true, conflicts_with = "verbose")]
    pub quiet: bool,
    /// Say more
    #[arg(long, short, global = true)]
    pub verbose: bool,
    /// Answer in JSON on stdout
    #[arg(long, global = true)]
    pub json: bool,
}

impl Common {
    /// Worker threads of this command's own: a process may run several commands, one after another.
    pub fn workers(&self) -> Result<rayon::ThreadPool> {
        rayon::ThreadPoolBuilder::new()
            .num_threads(self.threads)
            .build()
            .context("cannot start the worker threads")
    }
}

pub fn numbers<T: std::str::FromStr, const N: usize>(text: &str) -> Result<[T; N]> {
    let found = || anyhow::anyhow!("found `{text}`");
    let values: Option<Vec<T>> = text.split(',').map(|word| word.trim().parse().ok()).collect();
    values.and_then(|values| values.try_into().ok()).ok_or_else(found)
}
