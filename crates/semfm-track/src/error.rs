//! What can go wrong between frames.

/// Result of a call of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// Every way in which a frame, a mesh or the settings can fail to be what they should. That an object is not found is no
/// error but a state: see [`TrackState`](crate::TrackState).
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Something given is not what it should be.
    #[error("{what}: expected {expected}, found {found}")]
    Invalid {
        /// What was given.
        what: String,
        /// What it should be.
        expected: String,
        /// What it is.
        found: String,
    },
    /// The first frame's alignment was given something that it cannot use.
    #[error(transparent)]
    Align(#[from] semfm_align::Error),
    /// The mesh cannot be used, or the task was cancelled.
    #[error(transparent)]
    Geom(#[from] semfm_geom::Error),
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
            Self::Invalid { .. } => "invalid",
            Self::Align(cause) => cause.code(),
            Self::Geom(cause) => cause.code(),
        }
    }

    /// Where it went wrong; `None` where the failure has no place.
    pub fn place(&self) -> Option<String> {
        match self {
            Self::Invalid { what, .. } => Some(what.clone()),
            Self::Align(cause) => cause.place(),
            Self::Geom(cause) => cause.place(),
        }
    }
}
