//! The folder of a transfer: files for programs, for people and for viewers.

use std::path::{Path, PathBuf};
use std::time::Instant;

use semfm::Task;
use semfm::files::{self, TransferResult};
use semfm::geom::io::StagedFolder;

use crate::{Result, TransferFigure};

/// Which files of a transfer are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TransferFiles {
    /// All of them.
    #[default]
    All,
    /// Those for programs: neither pictures nor the scene for Foxglove.
    WithoutPictures,
    /// The answer alone: `region.json` and `report.json`.
    Region,
}

/// Every file that the folder of a transfer can have.
pub const TRANSFER_FILES: &[&str] = files::TRANSFER_FILES;

/// Writes a transfer into `folder`, which is made if it is not there: the files of
/// [`files::write_transfer`], `transfer.png`, `features.png` and (feature `mcap`) `transfer.mcap`; or
/// as many of them as `which` says, and then none of an earlier transfer stays beside them. The folder
/// has all of them or, where something fails, what it had before. Returns the paths.
///
/// # Errors
/// [`Error::Semfm`](crate::Error::Semfm) for the first file that cannot be written or drawn.
pub fn write_transfer(
    folder: &Path,
    result: &TransferResult<'_>,
    which: TransferFiles,
    task: &Task,
) -> Result<Vec<PathBuf>> {
    let start = Instant::now();
    let staged = StagedFolder::new(folder)?;
    if which == TransferFiles::Region {
        files::write_answer(staged.path(), result)?;
        return Ok(files::put_transfer(staged)?);
    }
    let data = || files::write_transfer_data(staged.path(), result, task);
    if which == TransferFiles::WithoutPictures {
        data()?;
    } else {
        let (data, drawn) = rayon::join(data, || draw(staged.path(), result, task));
        data?;
        drawn?;
    }
    result.write_report(staged.path(), start)?; // last: its stage `write` is all of this
    Ok(files::put_transfer(staged)?)
}

/// The pictures of a transfer, and its scene for Foxglove.
fn draw(folder: &Path, result: &TransferResult<'_>, task: &Task) -> Result<()> {
    let figure = TransferFigure::new(result, task)?;
    let [transfer, features] = ["transfer.png", "features.png"].map(|name| folder.join(name));
    let pictures = || figure.write_pictures(&transfer, &features, task);
    #[cfg(feature = "mcap")]
    {
        let scene = folder.join("transfer.mcap");
        let report = result.report().to_json();
        let write_scene = || crate::foxglove::write_transfer_scene(&scene, &figure, &report, task);
        let (pictures, scene) = rayon::join(pictures, write_scene);
        pictures.and(scene)
    }
    #[cfg(not(feature = "mcap"))]
    pictures()
}
