//! What can go wrong between a camera's files and an observation.

use semfm_geom::io::FormatError;

/// Result of a call of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// Every way in which pictures, calibrations, bags and hands can fail to be what they should.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Files, meshes and cameras.
    #[error(transparent)]
    Geom(#[from] semfm_geom::Error),
    /// Depth images and clouds.
    #[error(transparent)]
    Align(#[from] semfm_align::Error),
    /// MCAP files.
    #[cfg(feature = "mcap")]
    #[error(transparent)]
    Views(#[from] semfm_views::Error),
    /// A file is not what its format demands.
    #[error(transparent)]
    Format(#[from] FormatError),
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
}

impl Error {
    pub(crate) fn invalid(
        what: impl Into<String>,
        expected: impl Into<String>,
        found: impl ToString,
    ) -> Self {
        Self::Invalid { what: what.into(), expected: expected.into(), found: found.to_string() }
    }

    /// A stable name for the kind of failure, for scripts.
    pub fn code(&self) -> &'static str {
        match self {
            Self::Geom(cause) => cause.code(),
            Self::Align(cause) => cause.code(),
            #[cfg(feature = "mcap")]
            Self::Views(cause) => cause.code(),
            Self::Format(_) => "format",
            Self::Invalid { .. } => "invalid",
        }
    }

    /// Where it went wrong: a file's field, or the argument; `None` where the failure has no place.
    pub fn place(&self) -> Option<String> {
        match self {
            Self::Geom(cause) => cause.place(),
            Self::Align(cause) => cause.place(),
            #[cfg(feature = "mcap")]
            Self::Views(cause) => cause.place(),
            Self::Format(error) => Some(error.place.clone()),
            Self::Invalid { what, .. } => Some(what.clone()),
        }
    }
}
