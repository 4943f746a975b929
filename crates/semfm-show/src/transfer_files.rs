//! The folder of a transfer: files for programs, for people and for viewers.

use std::path::{Path, PathBuf};

use semfm::Task;
use semfm::files::{self, TransferResult};

use crate::{Result, TransferFigure};

/// Writes a transfer into `folder`, which is made if it is not there: the files of
/// [`files::write_transfer`], then `transfer.png`, `features.png` and (feature `mcap`)
/// `transfer.mcap`. Each file is written whole or not at all. Returns the paths.
///
/// # Errors
/// [`Error::Semfm`](crate::Error::Semfm) for the first file that cannot be written or drawn.
pub fn write_transfer(
    folder: &Path,
    result: &TransferResult<'_>,
    task: &Task,
) -> Result<Vec<PathBuf>> {
    let mut files = files::write_transfer(folder, result, task)?;
    let figure = TransferFigure::new(result, task)?;
    let [transfer, features] = ["transfer.png", "features.png"].map(|name| folder.join(name));
    figure.write_transfer_picture(&transfer, task)?;
    figure.write_features_picture(&features, task)?;
    files.extend([transfer, features]);
    #[cfg(feature = "mcap")]
    {
        let scene = folder.join("transfer.mcap");
        crate::foxglove::write_transfer_scene(&scene, &figure, &result.report().to_json(), task)?;
        files.push(scene);
    }
    Ok(files)
}
