//! What can go wrong with views and embeddings.

use std::path::PathBuf;

/// Result of a call of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// Every way in which views, embeddings or their files can fail.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The ground floor refused.
    #[error(transparent)]
    Geom(#[from] semfm_geom::Error),
    /// A number or an array outside what it may be.
    #[error("{what}: expected {expected}, found {found}")]
    Invalid {
        /// Name of the argument or field.
        what: String,
        /// What is allowed.
        expected: String,
        /// What was given.
        found: String,
    },
    /// A file is not what its format demands.
    #[error("{}: {place}: expected {expected}, found {found}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// Topic, message, record or byte offset.
        place: String,
        /// What the format demands there.
        expected: String,
        /// What stands there.
        found: String,
    },
    /// The file cannot be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        #[source]
        source: std::io::Error,
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
}
