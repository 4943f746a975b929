//! What can go wrong between a region and a grasp.

use std::fmt::Display;

/// Result of a call of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// Every way in which an object, a scene or a request for grasps can fail to be what it should.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A number outside its allowed range.
    #[error("{what}: expected {expected}, found {found}")]
    OutOfRange {
        /// Name of the argument.
        what: &'static str,
        /// The allowed range, in words.
        expected: String,
        /// What was given.
        found: String,
    },
    /// The gripper or its description cannot be used.
    #[error(transparent)]
    Robot(#[from] semfm_robot::Error),
    /// The mesh cannot be used, or the task was cancelled.
    #[error(transparent)]
    Geom(#[from] semfm_geom::Error),
}

impl Error {
    pub(crate) fn out_of_range<T>(
        what: &'static str,
        expected: impl Display,
        found: impl Display,
    ) -> Result<T> {
        let (expected, found) = (expected.to_string(), found.to_string());
        Err(Self::OutOfRange { what, expected, found })
    }

    /// A stable name for the kind of failure, for scripts.
    pub fn code(&self) -> &'static str {
        match self {
            Self::OutOfRange { .. } => "out-of-range",
            Self::Robot(cause) => cause.code(),
            Self::Geom(cause) => cause.code(),
        }
    }

    /// Where it went wrong; `None` where the failure has no place.
    pub fn place(&self) -> Option<String> {
        match self {
            Self::OutOfRange { what, .. } => Some((*what).into()),
            Self::Robot(cause) => cause.place(),
            Self::Geom(cause) => cause.place(),
        }
    }
}
