//! The folder of a memory's answer: files for programs and a picture for people.

use std::path::{Path, PathBuf};

use semfm::files::{self, MemoryReportFile};
use semfm::geom::io::StagedFolder;
use semfm::memory::MemoryTransfer;
use semfm::{Prepared, Task};

use crate::pictures::write_memory_picture;
use crate::{Result, TransferFiles};

/// Writes the answer of a memory into `folder`, which is made if it is not there: the files of
/// [`files::write_memory_answer`] and `memory.png`, or as many of them as `which` says. The folder has all of
/// them or, where something fails, what it had before. Returns the paths.
///
/// # Errors
/// [`Error::Semfm`](crate::Error::Semfm) for the first file that cannot be written or drawn.
pub fn write_memory_transfer(
    folder: &Path,
    target: &Prepared,
    answer: &MemoryTransfer,
    report: &MemoryReportFile,
    which: TransferFiles,
    task: &Task,
) -> Result<Vec<PathBuf>> {
    let staged = StagedFolder::new(folder)?;
    let answer_alone = which == TransferFiles::Region;
    files::write_memory_answer(staged.path(), target, answer, report, answer_alone)?;
    if which == TransferFiles::All {
        write_memory_picture(&staged.path().join("memory.png"), target, answer, task)?;
    }
    Ok(files::put_transfer(staged)?)
}
