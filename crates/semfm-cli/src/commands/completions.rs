//! `semfm-cli completions`: tab completion for the shell.

use anyhow::Result;
use clap::Args;
use clap_complete::Shell;

use super::Outcome;

/// Print a completion script for a shell
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  semfm-cli completions bash > ~/.local/share/bash-completion/completions/semfm-cli"
)]
pub struct CompletionsCommand {
    /// The shell
    shell: Shell,
}

impl CompletionsCommand {
    pub fn run(self) -> Result<Outcome> {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut crate::command_line(), "semfm-cli", &mut script);
        crate::console::data(String::from_utf8_lossy(&script).trim_end());
        Ok(Outcome::Done)
    }
}
