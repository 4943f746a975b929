//! The folder of a transfer: files for programs, for people and for viewers.

use std::path::{Path, PathBuf};

use semfm::Task;
use semfm::files::{self, TransferResult};

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

/// What a transfer leaves behind beside `region.json` and `report.json`, files for programs first.
const DATA: [&str; 4] = ["point_map.json", "source.ply", "target.ply", "target.glb"];
const PICTURES: [&str; 3] = ["transfer.png", "features.png", "transfer.mcap"];

/// Writes a transfer into `folder`, which is made if it is not there: the files of
/// [`files::write_transfer`], then `transfer.png`, `features.png` and (feature `mcap`)
/// `transfer.mcap`; or as many of them as `which` says, and then none of an earlier transfer stays
/// beside them. Each file is written whole or not at all. Returns the paths.
///
/// # Errors
/// [`Error::Semfm`](crate::Error::Semfm) for the first file that cannot be written or drawn.
pub fn write_transfer(
    folder: &Path,
    result: &TransferResult<'_>,
    which: TransferFiles,
    task: &Task,
) -> Result<Vec<PathBuf>> {
    match which {
        TransferFiles::All => {}
        TransferFiles::WithoutPictures => {
            remove(folder, &PICTURES)?;
            return Ok(files::write_transfer(folder, result, task)?);
        }
        TransferFiles::Region => {
            remove(folder, &PICTURES)?;
            remove(folder, &DATA)?;
            return Ok(files::write_answer(folder, result)?);
        }
    }
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

/// Removes files of an earlier transfer, where they are there.
fn remove(folder: &Path, names: &[&str]) -> Result<()> {
    for path in names.iter().map(|name| folder.join(name)) {
        match std::fs::remove_file(&path) {
            Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
                return Err(semfm::Error::from(semfm::geom::Error::Io { path, source }).into());
            }
            _ => {}
        }
    }
    Ok(())
}
