//! Starting other programs, and reading what they say while they say it.

use std::ffi::OsStr;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};

use crate::workspace::Workspace;

/// A program about to be started in the repository's root.
pub struct Process(Command);

/// Cargo with these arguments.
pub fn cargo(workspace: &Workspace, arguments: &[&str]) -> Process {
    program(workspace, Path::new("cargo"), arguments)
}

/// Any program with these arguments.
pub fn program(workspace: &Workspace, path: &Path, arguments: &[&str]) -> Process {
    let mut command = Command::new(path);
    command.args(arguments).current_dir(&workspace.root);
    Process(command)
}

impl Process {
    /// Sets an environment variable.
    pub fn env(mut self, name: &str, value: impl AsRef<OsStr>) -> Self {
        self.0.env(name, value);
        self
    }

    /// Waits for the program and fails where it fails.
    pub fn succeed(mut self) -> Result<()> {
        let status = self.0.status().with_context(|| self.name())?;
        if !status.success() {
            bail!("{}: {status}", self.name());
        }
        Ok(())
    }

    /// Whether the program starts and succeeds, its words unheard.
    pub fn works(mut self) -> bool {
        let status = self.0.stdout(Stdio::null()).stderr(Stdio::null()).status();
        status.is_ok_and(|status| status.success())
    }

    /// Everything that the program prints.
    pub fn output(mut self) -> Result<String> {
        let output = self.0.stderr(Stdio::inherit()).output().with_context(|| self.name())?;
        if !output.status.success() {
            bail!("{}: {}", self.name(), output.status);
        }
        Ok(String::from_utf8_lossy(&output.stdout).into_owned())
    }

    /// Passes each line of standard output on and shows it to `listen`; whether the program
    /// succeeded.
    pub fn stream(mut self, mut listen: impl FnMut(&str)) -> Result<bool> {
        let mut child = self.0.stdout(Stdio::piped()).spawn().with_context(|| self.name())?;
        let stdout = child.stdout.take().context("standard output is piped")?;
        let mut ours = std::io::stdout();
        for line in BufReader::new(stdout).split(b'\n') {
            let line = line?;
            let line = String::from_utf8_lossy(&line);
            writeln!(ours, "{line}")?;
            listen(line.trim_end());
        }
        Ok(child.wait()?.success())
    }

    fn name(&self) -> String {
        let words = std::iter::once(self.0.get_program()).chain(self.0.get_args());
        words.map(OsStr::to_string_lossy).collect::<Vec<_>>().join(" ")
    }
}
