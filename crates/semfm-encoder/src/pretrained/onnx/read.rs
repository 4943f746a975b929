//! An `ENCODER.json` and the files that it names.

use std::collections::BTreeMap;
use std::path::Path;

use semfm_geom::io::{FormatError, read_file};

use super::RUNTIME;
use super::description::OnnxDescription;
use super::external_files::external_files;
use super::network::OnnxNetwork;
use crate::Result;
use crate::open::OpenSettings;
use crate::pretrained::PretrainedEncoder;
use crate::pretrained::content::Content;

/// Largest network, and largest file with weights, that is read.
const MAX_FILE: u64 = 8 << 30;

impl PretrainedEncoder {
    /// Reads an `ENCODER.json`, the ONNX network beside it and the files that hold its weights.
    ///
    /// # Errors
    /// [`semfm_geom::Error::Io`] where a file cannot be read; [`Error::Format`](crate::Error::Format)
    /// with the field for a description that breaks its format or names files outside of its folder,
    /// and for a network that is damaged, that the runtime does not take, or whose inputs and outputs
    /// are others than described.
    pub fn read_onnx(path: &Path, settings: &OpenSettings) -> Result<Self> {
        let json = read_at_most(path)?;
        let description = OnnxDescription::parse(path, &json)?;
        let onnx = description.network_path(path)?;
        let bytes = read_at_most(&onnx)?;
        let mut parts = BTreeMap::from([
            ("description".to_owned(), hash_of(&json)),
            ("network".to_owned(), hash_of(&bytes)),
        ]);
        let mut external = Vec::new();
        for file in external_files(&onnx, &bytes)? {
            let content = read_at_most(&file.path)?;
            parts.insert(format!("weights {}", file.location), hash_of(&content));
            external.push((file.location, content));
        }
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let content = Content { name, runtime: RUNTIME, parts };
        let preprocessing = description.preprocessing();
        let network = OnnxNetwork::new(description, &onnx, bytes, external)?;
        Ok(Self::new(Box::new(network), &content, preprocessing, settings.threads))
    }
}

/// The bytes of a file of at most [`MAX_FILE`].
fn read_at_most(path: &Path) -> Result<Vec<u8>> {
    let about = std::fs::metadata(path)
        .map_err(|source| semfm_geom::Error::Io { path: path.to_owned(), source })?;
    if about.len() > MAX_FILE {
        let expected = format!("at most {MAX_FILE} bytes");
        return Err(FormatError::new(path, "size", expected, about.len().to_string()).into());
    }
    Ok(read_file(path)?)
}

fn hash_of(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}
