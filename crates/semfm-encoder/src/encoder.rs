//! What every encoder is: a name, what it wants to be shown, and embeddings of what it was shown.

use std::fmt;
#[cfg(feature = "mcap")]
use std::path::PathBuf;

use semfm_geom::Task;
use semfm_views::EmbeddedView;
#[cfg(feature = "mcap")]
use semfm_views::mcap::{EmbeddingsFile, EmbeddingsMetadata};
use serde::{Deserialize, Serialize};

use crate::Result;
use crate::rendered_views::{Coloring, RenderedObject, ViewSettings};

/// Rotations that encoders need which mix the place in the picture into their tokens.
#[cfg(any(feature = "mcap", feature = "onnx", feature = "siglip", test))]
pub(crate) const PRETRAINED_ROLLS: u32 = 4;

/// Name and version of an encoder: where either differs, so do the features.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct EncoderIdentity {
    /// Its name, as `--encoder` and embeddings files have it.
    pub name: String,
    /// Version of its weights: of a network of ours with the first digits of its hash, in embeddings by a
    /// program what that says. Empty where it is not known before the program has run.
    pub version: String,
}

impl fmt::Display for EncoderIdentity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)?;
        if self.version.is_empty() { Ok(()) } else { write!(f, " {}", self.version) }
    }
}

/// What an encoder wants to be shown of an object.
#[derive(Clone, Debug)]
pub struct WantedViews {
    /// Cameras and light. Its colouring is what an encoder that reads colours gets of an object alone.
    pub views: ViewSettings,
    /// Whether colours say anything to it.
    pub reads_colors: bool,
    /// Rotations of each picture that are averaged where nothing else is asked for: 1, 2 or 4.
    pub rolls: u32,
}

impl WantedViews {
    /// The views of one object of a pair whose colours are `of_pair`.
    pub fn settings(&self, of_pair: Coloring) -> ViewSettings {
        let coloring = if self.reads_colors { of_pair } else { self.views.coloring };
        ViewSettings { coloring, ..self.views.clone() }
    }

    /// Rotations for a method that asks for up to `most`.
    pub fn rolls_up_to(&self, most: u32) -> u32 {
        self.rolls.min(most)
    }
}

/// Makes patch embeddings of rendered views.
///
/// Three are here: [`NetEncoder`](crate::NetEncoder), a network of ours that runs in this process (the
/// built-in one among them), `PretrainedEncoder` (features `onnx` and `siglip`), somebody else's that
/// does, and `CommandEncoder` (feature `mcap`), the program `semfm-embed`.
pub trait Encoder: fmt::Debug + Send + Sync {
    /// Its name and version.
    fn identity(&self) -> EncoderIdentity;

    /// What it wants to be shown.
    fn wants(&self) -> WantedViews;

    /// A hash of everything that makes the encoder, as far as that is known: kept embeddings are found
    /// by it.
    ///
    /// # Errors
    /// What an encoder's own doc names.
    fn content_hash(&self) -> Result<String>;

    /// The hash under which embeddings that were just made may be kept; `None` where more may matter
    /// than is known, or where something changed since it was hashed.
    ///
    /// # Errors
    /// As [`content_hash`](Self::content_hash).
    fn hash_of_last_run(&self) -> Result<Option<String>> {
        self.content_hash().map(Some)
    }

    /// Why embeddings by it can be neither kept nor found, in words; `None` where they can.
    fn why_not_kept(&self) -> Option<String> {
        None
    }

    /// Embeddings of the views of some objects, one after the other; each picture is encoded at
    /// `rolls` rotations (1, 2 or 4) and the mean taken.
    ///
    /// # Errors
    /// [`Error::Invalid`](crate::Error::Invalid) for pictures that it does not take or another number
    /// of rolls, [`semfm_geom::Error::Cancelled`], and what an encoder's own doc names.
    fn encode(
        &self,
        objects: &[RenderedObject<'_>],
        rolls: u32,
        task: &Task,
    ) -> Result<Vec<EncodedViews>>;
}

/// What an encoder made of the views of an object.
#[derive(Clone, Debug, PartialEq)]
pub struct EncodedViews {
    /// Who made it.
    pub encoder: EncoderIdentity,
    /// How a picture was made into the encoder's input.
    pub preprocessing: String,
    /// Number of rotations of each picture that were averaged.
    pub rolls: u32,
    /// What was done with outlier tokens.
    pub outliers: String,
    /// The views, in the order of the pictures.
    pub views: Vec<EmbeddedView>,
}

#[cfg(feature = "mcap")]
impl EncodedViews {
    /// The content of an embeddings file.
    pub fn of_file(file: EmbeddingsFile) -> Self {
        let EmbeddingsFile { metadata, views, .. } = file;
        Self {
            encoder: EncoderIdentity { name: metadata.encoder, version: metadata.revision },
            preprocessing: metadata.preprocessing,
            rolls: metadata.rolls,
            outliers: metadata.outliers,
            views,
        }
    }

    /// As the content of an embeddings file of these views of an object.
    pub fn into_file(self, object: &RenderedObject<'_>) -> EmbeddingsFile {
        let metadata = EmbeddingsMetadata {
            views: object.metadata(),
            encoder: self.encoder.name,
            revision: self.encoder.version,
            preprocessing: self.preprocessing,
            rolls: self.rolls,
            outliers: self.outliers,
            simulated: false,
        };
        EmbeddingsFile { path: PathBuf::new(), metadata, views: self.views }
    }
}
