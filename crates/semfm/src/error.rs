//! What can go wrong between two meshes and a region.

use semfm_geom::io::FormatError;

/// Result of a facade call.
pub type Result<T> = std::result::Result<T, Error>;

/// An error of any crate below, of an argument or of a file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Meshes, matrices and their files.
    #[error(transparent)]
    Geom(#[from] semfm_geom::Error),
    /// Views, embeddings and their files.
    #[error(transparent)]
    Views(#[from] semfm_views::Error),
    /// Encoders and their files.
    #[error(transparent)]
    Encoder(#[from] semfm_encoder::Error),
    /// Maps and regions.
    #[error(transparent)]
    Fmap(#[from] semfm_fmap::Error),
    /// Robot descriptions and grippers.
    #[error(transparent)]
    Robot(#[from] semfm_robot::Error),
    /// Grasps.
    #[error(transparent)]
    Grasp(#[from] semfm_grasp::Error),
    /// The pose of a model in what a camera sees.
    #[error(transparent)]
    Align(#[from] semfm_align::Error),
    /// Motions: collisions, planning, timing.
    #[error(transparent)]
    Motion(#[from] semfm_motion::Error),
    /// An object followed through frames.
    #[error(transparent)]
    Track(#[from] semfm_track::Error),
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
    /// A file is not what its format demands.
    #[error(transparent)]
    Format(#[from] FormatError),
}

impl From<semfm_observe::Error> for Error {
    fn from(cause: semfm_observe::Error) -> Self {
        match cause {
            semfm_observe::Error::Geom(cause) => Self::Geom(cause),
            semfm_observe::Error::Align(cause) => Self::Align(cause),
            semfm_observe::Error::Format(cause) => Self::Format(cause),
            semfm_observe::Error::Invalid { what, expected, found } => {
                Self::Invalid { what, expected, found }
            }
            #[cfg(feature = "mcap")]
            semfm_observe::Error::Views(cause) => Self::Views(cause),
            other => Self::invalid("observation", "one that can be read", other.to_string()),
        }
    }
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
            Self::Encoder(cause) => cause.code(),
            Self::Fmap(semfm_fmap::Error::Geom(cause)) => cause.code(),
            Self::Robot(cause) => cause.code(),
            Self::Grasp(cause) => cause.code(),
            Self::Align(cause) => cause.code(),
            Self::Track(cause) => cause.code(),
            Self::Motion(semfm_motion::Error::Robot(cause)) => cause.code(),
            Self::Motion(semfm_motion::Error::Geom(cause)) => cause.code(),
            Self::Motion(_) => "invalid",
            Self::Fmap(_) | Self::Invalid { .. } => "invalid",
            Self::Format(_) => "format",
        }
    }

    /// Where in the file, or which argument; `None` where the failure has no place.
    pub fn place(&self) -> Option<String> {
        match self {
            Self::Geom(cause) => cause.place(),
            Self::Views(cause) => cause.place(),
            Self::Encoder(cause) => cause.place(),
            Self::Fmap(semfm_fmap::Error::Geom(cause)) => cause.place(),
            Self::Robot(cause) => cause.place(),
            Self::Grasp(cause) => cause.place(),
            Self::Align(cause) => cause.place(),
            Self::Track(cause) => cause.place(),
            Self::Motion(semfm_motion::Error::Robot(cause)) => cause.place(),
            Self::Motion(semfm_motion::Error::Geom(cause)) => cause.place(),
            Self::Motion(semfm_motion::Error::Invalid { what, .. }) => Some(what.clone()),
            Self::Motion(_) => None,
            Self::Fmap(_) => None,
            Self::Invalid { what, .. } => Some(what.clone()),
            Self::Format(error) => Some(error.place.clone()),
        }
    }
}
