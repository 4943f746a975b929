//! Options that every command takes.

use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use clap::Args;

use crate::address_space::workers_that_fit;

/// Options of every command.
#[derive(Clone, Copy, Debug, Args)]
#[command(next_help_heading = "General")]
pub struct Common {
    /// Worker threads; 0 takes one for each core. Results do not depend on it
    #[arg(long, global = true, default_value_t = 0, value_name = "N")]
    pub threads: usize,
    /// Print nothing but the answer
    #[arg(long, short, global = true, conflicts_with = "verbose")]
    pub quiet: bool,
    /// Print more
    #[arg(long, short, global = true)]
    pub verbose: bool,
    /// Answer in JSON on stdout
    #[arg(long, global = true)]
    pub json: bool,
}

impl Common {
    /// Worker threads of this command's own: a process may run several commands, one after another. Under a limit of
    /// address space there are no more than fit into it.
    pub fn workers(&self) -> Result<rayon::ThreadPool> {
        rayon::ThreadPoolBuilder::new()
            .num_threads(workers_that_fit(self.threads))
            .build()
            .context("cannot start the worker threads")
    }
}

/// A flag's NAME=FOLDER.
pub fn parse_package(text: &str) -> Result<(String, PathBuf)> {
    match text.split_once('=') {
        Some((name, folder)) if !name.is_empty() && !folder.is_empty() => {
            Ok((name.to_owned(), folder.into()))
        }
        _ => bail!("expected NAME=FOLDER, found `{text}`"),
    }
}

/// N numbers between commas.
pub fn numbers<T: std::str::FromStr, const N: usize>(text: &str) -> Result<[T; N]> {
    let values: Option<Vec<T>> = text.split(',').map(|word| word.trim().parse().ok()).collect();
    let values = values.and_then(|values| values.try_into().ok());
    values.ok_or_else(|| anyhow::anyhow!("found `{text}`"))
}
