//! Where a command writes, looked at before any work: nothing that it reads is replaced, and what
//! cannot be written is said at once.

use std::fs::File;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use semfm::geom::io::{check_output, is_same_file, is_stdout, refuse_input, refuse_to_overwrite};
use tempfile::TempDir;

use crate::console;
use crate::options::Common;

/// The one file that a command writes: at a path, or `-` for stdout.
pub struct OutputFile {
    path: PathBuf,
    /// The folder of the file until it goes to stdout.
    scratch: Option<TempDir>,
}

impl OutputFile {
    /// Looks at the path; `inputs` are the files that the command reads.
    pub fn new(path: &Path, inputs: &[&Path], common: &Common) -> Result<Self> {
        if is_stdout(path) {
            if common.json {
                bail!(
                    "-o -: the file goes to stdout, where --json wants its answer: give a file name"
                );
            }
            console::reserve_stdout();
            let scratch = tempfile::tempdir().context("a temporary folder")?;
            return Ok(Self { path: scratch.path().join("output"), scratch: Some(scratch) });
        }
        check_file(path, inputs)?;
        Ok(Self { path: path.to_owned(), scratch: None })
    }

    /// Where the file is written.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Refuses to go on where the inputs, now that they are read, turn out to hold the file.
    pub fn check_again(&self) -> Result<()> {
        Ok(refuse_input(&self.path)?)
    }

    /// Says where the file is, or sends it to stdout.
    pub fn finish(self, common: &Common) -> Result<()> {
        if self.scratch.is_some() {
            let mut file = File::open(&self.path).context("the file for stdout")?;
            console::copy_to_stdout(&mut file);
        } else if !common.json {
            console::data(self.path.display());
        }
        Ok(())
    }
}

/// Refuses a further file of a command, which never goes to stdout.
pub fn check_file(path: &Path, inputs: &[&Path]) -> Result<()> {
    refuse_to_overwrite(&[path.to_owned()], inputs)?;
    Ok(check_output(path)?)
}

/// Refuses two outputs in one file.
pub fn check_distinct(a: &Path, b: &Path) -> Result<()> {
    if a == b || is_same_file(a, b) {
        bail!("{}: expected a file of its own for each output, found one name twice", b.display());
    }
    Ok(())
}

/// Refuses a folder of results that is none, or in which one of the files `names` would replace one
/// of the `inputs`.
pub fn check_folder(folder: &Path, names: &[&str], inputs: &[&Path]) -> Result<()> {
    if folder == Path::new("-") {
        bail!("-o -: expected a folder, for there are several files; found stdout");
    }
    let files: Vec<PathBuf> = names.iter().map(|name| folder.join(name)).collect();
    refuse_to_overwrite(&files, inputs)?;
    match std::fs::metadata(folder) {
        Ok(about) if !about.is_dir() => {
            bail!("{}: expected a folder for the results, found a file", folder.display())
        }
        Ok(_) => {}
        // What is missing is made; but a file where a folder should be cannot be.
        Err(_) => check_output(folder.join("file"))?,
    }
    for file in files.iter().filter(|file| file.exists()) {
        check_output(file)?;
    }
    Ok(())
}

/// As [`check_folder`], of inputs that were read by now.
pub fn check_folder_again(folder: &Path, names: &[&str]) -> Result<()> {
    Ok(names.iter().try_for_each(|name| refuse_input(folder.join(name)))?)
}
