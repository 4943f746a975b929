//! What can go wrong with an evaluation as a whole. What goes wrong with one pair is a row.

use std::path::{Path, PathBuf};

use semfm::geom::io::FormatError;

/// Result of an evaluation call.
pub type Result<T> = std::result::Result<T, Error>;

/// Why there is no evaluation.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An error of the facade or of a crate below it.
    #[error(transparent)]
    Facade(#[from] semfm::Error),
    /// A procedural object could not be made.
    #[error(transparent)]
    Synth(#[from] semfm_synth::Error),
    /// A file or folder cannot be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        #[source]
        source: std::io::Error,
    },
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
    /// Another process writes into the output folder.
    #[error(
        "{}: another evaluation writes here ({process}): wait for it, or choose another folder",
        path.display()
    )]
    Busy {
        /// The folder.
        path: PathBuf,
        /// Who, as far as the lock file says.
        process: String,
    },
    /// The output folder holds an unfinished run of something else.
    #[error(
        "{}: an unfinished run with another {what} (then {before}, now {now}): \
         give the same again to go on, start afresh, or choose another folder", path.display()
    )]
    OtherRun {
        /// The journal.
        path: PathBuf,
        /// What differs.
        what: String,
        /// What the journal names.
        before: String,
        /// What is asked for.
        now: String,
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

    pub(crate) fn format(
        path: &Path,
        place: impl Into<String>,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> Self {
        FormatError::new(path, place.into(), expected, found).into()
    }

    /// Wraps what the system said about `path`.
    pub(crate) fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io { path: semfm::geom::io::shown_path(path), source }
    }

    /// Whether the caller asked the work to stop.
    pub fn is_cancelled(&self) -> bool {
        let geom = match self {
            Self::Facade(semfm::Error::Geom(cause)) => cause,
            Self::Facade(semfm::Error::Fmap(semfm::fmap::Error::Geom(cause))) => cause,
            Self::Facade(semfm::Error::Views(semfm::views::Error::Geom(cause))) => cause,
            _ => return false,
        };
        matches!(geom, semfm::geom::Error::Cancelled)
    }

    /// A short name of the kind of failure, for programs.
    pub fn code(&self) -> &'static str {
        match self {
            Self::Facade(cause) => cause.code(),
            Self::Synth(_) => "synth",
            Self::Io { .. } => "io",
            Self::Format(_) => "format",
            Self::Invalid { .. } => "invalid",
            Self::Busy { .. } => "busy",
            Self::OtherRun { .. } => "other-run",
        }
    }
}

impl From<semfm::geom::Error> for Error {
    fn from(cause: semfm::geom::Error) -> Self {
        Self::Facade(cause.into())
    }
}

impl From<semfm::observe::Error> for Error {
    fn from(cause: semfm::observe::Error) -> Self {
        Self::Facade(cause.into())
    }
}

impl From<semfm::fmap::Error> for Error {
    fn from(cause: semfm::fmap::Error) -> Self {
        Self::Facade(cause.into())
    }
}

impl From<semfm_show::Error> for Error {
    fn from(cause: semfm_show::Error) -> Self {
        Self::Facade(cause.into())
    }
}

impl From<semfm::views::Error> for Error {
    fn from(cause: semfm::views::Error) -> Self {
        Self::Facade(cause.into())
    }
}
