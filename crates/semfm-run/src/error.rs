//! What can go wrong on the way.

use semfm::geom::io::FormatError;

/// Result of a run.
pub type Result<T> = std::result::Result<T, Error>;

/// Why a run cannot be made or cannot go on. A stage without an answer is none.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A stage, or a file of one.
    #[error(transparent)]
    Semfm(#[from] semfm::Error),
    /// The recipe, with the place in it.
    #[error(transparent)]
    Recipe(#[from] FormatError),
    /// A stage that failed.
    #[error("stage {stage}: {cause}")]
    Stage {
        /// Its name.
        stage: &'static str,
        /// Why.
        cause: Box<Error>,
    },
}

impl Error {
    /// A short name of the kind of failure, for programs.
    pub fn code(&self) -> &'static str {
        match self {
            Self::Semfm(cause) => cause.code(),
            Self::Recipe(_) => "format",
            Self::Stage { cause, .. } => cause.code(),
        }
    }
}

impl From<semfm::geom::Error> for Error {
    fn from(error: semfm::geom::Error) -> Self {
        Self::Semfm(error.into())
    }
}

impl From<semfm::observe::Error> for Error {
    fn from(error: semfm::observe::Error) -> Self {
        Self::Semfm(error.into())
    }
}

impl From<semfm_show::Error> for Error {
    fn from(error: semfm_show::Error) -> Self {
        Self::Semfm(error.into())
    }
}
