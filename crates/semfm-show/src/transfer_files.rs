//! The folder of a transfer: files for programs, for people and for viewers.

use std::path::{Path, PathBuf};

use semfm::{PreparedObject, Region, Task, Transfer, output};
use serde_json::{Map, Value};

use crate::{Result, TransferFigure};

/// Writes a transfer into `folder`, which is made if it is not there: the files of
/// [`output::write_transfer`], then `transfer.png`, `features.png` and (feature `mcap`) `transfer.mcap`.
/// Each file is written whole or not at all. `about` is put into the report as it is.
///
/// # Errors
/// [`Error::Semfm`](crate::Error::Semfm) for the first file that cannot be written or drawn.
pub fn write_transfer(
    folder: &Path,
    source: &PreparedObject,
    target: &PreparedObject,
    region: &Region,
    transfer: &Transfer,
    about: Map<String, Value>,
    task: &Task,
) -> Result<Vec<PathBuf>> {
    let report = output::report_json(source, target, transfer, about);
    let mut files =
        output::write_transfer(folder, source, target, region, transfer, &report, task)?;
    let mut add = |name: &str| {
        let path = folder.join(name);
        files.push(path.clone());
        path
    };
    let figure = TransferFigure::new(source, target, region, transfer, task)?;
    figure.write_transfer_picture(&add("transfer.png"), task)?;
    figure.write_features_picture(&add("features.png"), task)?;
    #[cfg(feature = "mcap")]
    crate::foxglove::write_transfer_scene(&add("transfer.mcap"), &figure, &report, task)?;
    Ok(files)
}
