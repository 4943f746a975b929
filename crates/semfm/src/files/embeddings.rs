//! Embeddings files of one mesh.

use std::path::Path;

use semfm_geom::Mesh;
use semfm_views::mcap::EmbeddingsFile;

use crate::Result;

/// Reads the embeddings of this very mesh.
///
/// # Errors
/// Those of [`EmbeddingsFile::read`]; [`semfm_views::Error::OtherMesh`].
pub fn read_embeddings(path: &Path, mesh: &Mesh) -> Result<EmbeddingsFile> {
    let file = EmbeddingsFile::read(path)?;
    file.check_mesh(mesh)?;
    Ok(file)
}
