//! What can go wrong between a robot description and a gripper.

use std::path::PathBuf;

/// Result of a call of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// Every way in which a robot description or a gripper can fail to be what it should.
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
    /// A robot description (URDF, SRDF, joint limits) that is not what it should be, or that names what is not allowed.
    #[error("{}: {place}: expected {expected}, found {found}", path.display())]
    Urdf {
        /// The file.
        path: PathBuf,
        /// The kind of failure: `dtd`, `cycle`, `non-finite`, `path-outside`, …
        code: &'static str,
        /// Line, element, name.
        place: String,
        /// What should stand there.
        expected: String,
        /// What stands there.
        found: String,
    },
    /// A sound description that has not the arm that was asked for, or joint values that are not for it.
    #[error("{what}: expected {expected}, found {found}")]
    Arm {
        /// What is wrong: an argument, a link or a joint by name.
        what: String,
        /// What should be.
        expected: String,
        /// What is.
        found: String,
    },
    /// A description that is sound, but in which no parallel-jaw gripper was found.
    #[error("{}: no gripper found: expected {expected}, found {found}", path.display())]
    NoGripper {
        /// The file.
        path: PathBuf,
        /// What a gripper needs.
        expected: String,
        /// What the description has.
        found: String,
    },
    /// A name that is neither a built-in gripper nor a URDF file.
    #[error(
        "gripper `{name}`: expected {known} or a .urdf file of a hand with two parallel pads (suction cups and hands \
         of three or more fingers are not covered){meant}"
    )]
    UnknownGripper {
        /// The name.
        name: String,
        /// The built-in ones.
        known: String,
        /// A question after the one that was probably meant; empty where none is close.
        meant: String,
    },
    /// A file cannot be read.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        #[source]
        source: std::io::Error,
    },
    /// A mesh of a link cannot be read.
    #[error(transparent)]
    Geom(#[from] semfm_geom::Error),
}

impl Error {
    /// A stable name for the kind of failure, for scripts.
    pub fn code(&self) -> &'static str {
        match self {
            Self::OutOfRange { .. } => "out-of-range",
            Self::Urdf { code, .. } => code,
            Self::Arm { .. } => "arm",
            Self::NoGripper { .. } => "no-gripper",
            Self::UnknownGripper { .. } => "unknown-gripper",
            Self::Io { .. } => "io",
            Self::Geom(cause) => cause.code(),
        }
    }

    /// Where it went wrong; `None` where the failure has no place.
    pub fn place(&self) -> Option<String> {
        match self {
            Self::OutOfRange { what, .. } => Some((*what).into()),
            Self::Urdf { place, .. } => Some(place.clone()),
            Self::Arm { what, .. } => Some(what.clone()),
            Self::Geom(cause) => cause.place(),
            _ => None,
        }
    }
}
