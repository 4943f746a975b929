//! An encoder by its name.

use std::path::Path;
use std::sync::Arc;

use crate::builtin::{BUILTIN_ENCODERS, BuiltinEncoder};
#[cfg(feature = "mcap")]
use crate::command::CommandEncoder;
use crate::encoder::Encoder;
use crate::net_encoder::NetEncoder;
#[cfg(any(feature = "onnx", feature = "siglip"))]
use crate::pretrained::PretrainedEncoder;
use crate::{Error, Result};

/// How an encoder outside of this process is called.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct OpenSettings {
    /// Threads of the encoder; 0 leaves the number to it.
    pub threads: usize,
    /// Whether the encoder says nothing but errors.
    pub quiet: bool,
}

/// What a name of an encoder may be, for help texts.
pub fn encoder_names() -> String {
    let builtin: Vec<String> = BUILTIN_ENCODERS
        .iter()
        .map(|encoder| format!("{} ({})", encoder.name, encoder.summary))
        .collect();
    format!(
        "{}, a NAME.net file, a Hugging Face name, a local checkpoint, an ONNX encoder's JSON, or a \
         class of Python as package.module:Class",
        builtin.join(", ")
    )
}

/// Opens an encoder: a built-in one by its name, a network of ours by its file (`NAME.net`), an
/// `ENCODER.json` (feature `onnx`) or a folder with a SigLIP checkpoint (feature `siglip`) in this
/// process, and everything else through the program `semfm-embed` (feature `mcap`).
///
/// ```
/// use semfm_encoder::{OpenSettings, open_encoder};
/// let encoder = open_encoder("builtin", &OpenSettings::default())?;
/// assert_eq!(encoder.identity().name, "builtin");
/// # Ok::<(), semfm_encoder::Error>(())
/// ```
///
/// # Errors
/// Those of [`NetEncoder::read`], `PretrainedEncoder::read_onnx` and
/// `PretrainedEncoder::read_siglip`; [`Error::Invalid`] for a name without meaning: empty, or of an
/// encoder outside in a build without MCAP files.
pub fn open_encoder(name: &str, settings: &OpenSettings) -> Result<Arc<dyn Encoder>> {
    if let Some(builtin) = BuiltinEncoder::named(name) {
        return Ok(builtin.encoder()?);
    }
    if Path::new(name).extension().is_some_and(|extension| extension == "net") {
        return Ok(Arc::new(NetEncoder::read(Path::new(name))?));
    }
    if name.trim().is_empty() {
        return Err(Error::invalid("encoder", encoder_names(), "an empty name"));
    }
    #[cfg(feature = "onnx")]
    if name.ends_with(".json") {
        return Ok(Arc::new(PretrainedEncoder::read_onnx(Path::new(name), settings)?));
    }
    #[cfg(feature = "siglip")]
    if crate::pretrained::is_siglip_folder(Path::new(name)) {
        return Ok(Arc::new(PretrainedEncoder::read_siglip(Path::new(name), settings)?));
    }
    #[cfg(feature = "mcap")]
    return Ok(Arc::new(CommandEncoder::new(name, *settings)));
    #[cfg(not(feature = "mcap"))]
    {
        let _ = settings;
        let expected = "builtin or a NAME.net file (built without the feature `mcap`)";
        Err(Error::invalid("encoder", expected, format!("`{name}`")))
    }
}
