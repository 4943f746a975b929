//! What can go wrong between pictures and embeddings.

use std::path::PathBuf;

use semfm_geom::io::FormatError;

/// Result of a call of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// Every way in which an encoder can fail.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Meshes, files and tasks.
    #[error(transparent)]
    Geom(#[from] semfm_geom::Error),
    /// Views, embeddings and their files.
    #[error(transparent)]
    Views(#[from] semfm_views::Error),
    /// An argument outside what it may be.
    #[error("{what}: expected {expected}, found {found}")]
    Invalid {
        /// Name of the argument.
        what: String,
        /// What is allowed.
        expected: String,
        /// What was given.
        found: String,
    },
    /// A file of weights is not what its format demands.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// A pretrained network cannot be run in this process.
    #[error(
        "{}: {reason} (the program `semfm-embed` runs it in Python: \
         `semfm-embed V.views.mcap -o V.emb.mcap --model MODEL`)",
        path.display()
    )]
    Network {
        /// The file that holds it.
        path: PathBuf,
        /// What its runtime says.
        reason: String,
    },
    /// The program that runs other encoders is not there.
    #[error(
        "the encoder `{model}` needs the program `{program}`, which is not there: install it with \
         `pip install '.[onnx]'` (or `'.[embed]'` for SigLIP and DINOv2), name it in SEMFM_EMBED, \
         or take the encoder `builtin`, which needs nothing"
    )]
    ProgramMissing {
        /// The encoder that was asked for.
        model: String,
        /// Name or path of the program.
        program: String,
    },
    /// The program that runs other encoders failed.
    #[error("{program} ended with {status} (its reason stands above)")]
    ProgramFailed {
        /// Name or path of the program.
        program: String,
        /// How it ended.
        status: String,
    },
}

impl Error {
    pub(crate) fn invalid(
        what: impl Into<String>,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> Self {
        Self::Invalid { what: what.into(), expected: expected.into(), found: found.into() }
    }

    /// A short name of the kind of failure, for programs.
    pub fn code(&self) -> &'static str {
        match self {
            Self::Geom(cause) => cause.code(),
            Self::Views(cause) => cause.code(),
            Self::Invalid { .. } => "invalid",
            Self::Format(_) => "format",
            Self::Network { .. } | Self::ProgramMissing { .. } | Self::ProgramFailed { .. } => {
                "encoder"
            }
        }
    }

    /// Where in the file, or which argument; `None` where the failure has no place.
    pub fn place(&self) -> Option<String> {
        match self {
            Self::Geom(cause) => cause.place(),
            Self::Views(cause) => cause.place(),
            Self::Invalid { what, .. } => Some(what.clone()),
            Self::Format(error) => Some(error.place.clone()),
            Self::Network { path, .. } => Some(path.display().to_string()),
            Self::ProgramMissing { .. } | Self::ProgramFailed { .. } => None,
        }
    }
}
