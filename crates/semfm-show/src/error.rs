//! What can go wrong while results are drawn.

use semfm::geom::io::FormatError;

/// Result of drawing or writing.
pub type Result<T> = std::result::Result<T, Error>;

/// Why results cannot be shown.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// From the crates below: a mesh, a map, a rendering or a file.
    #[error(transparent)]
    Semfm(#[from] semfm::Error),
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
    /// A file that cannot be shown, or not with the others.
    #[error(transparent)]
    Format(#[from] FormatError),
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
            Self::Semfm(cause) => cause.code(),
            Self::Invalid { .. } => "invalid",
            Self::Format(_) => "format",
        }
    }
}

impl From<semfm::geom::Error> for Error {
    fn from(error: semfm::geom::Error) -> Self {
        Self::Semfm(error.into())
    }
}

impl From<semfm::views::Error> for Error {
    fn from(error: semfm::views::Error) -> Self {
        Self::Semfm(error.into())
    }
}

impl From<semfm::fmap::Error> for Error {
    fn from(error: semfm::fmap::Error) -> Self {
        Self::Semfm(error.into())
    }
}

impl From<Error> for semfm::Error {
    /// For callers that have one kind of error for everything.
    fn from(error: Error) -> Self {
        match error {
            Error::Semfm(cause) => cause,
            Error::Invalid { what, expected, found } => Self::Invalid { what, expected, found },
            Error::Format(error) => Self::Format(error),
        }
    }
}
