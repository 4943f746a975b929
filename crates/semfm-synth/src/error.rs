//! What can go wrong while making objects.

/// Result of a call of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// Why an object or its embeddings could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A mesh or its file could not be made.
    #[error(transparent)]
    Geom(#[from] semfm_geom::Error),
    /// The views or their files could not be made.
    #[error(transparent)]
    Views(#[from] semfm_views::Error),
    /// A name that is not on the list.
    #[error("unknown {what} `{found}`, expected one of {expected}")]
    Unknown {
        /// Category or level.
        what: &'static str,
        /// The list.
        expected: String,
        /// What was given.
        found: String,
    },
}
