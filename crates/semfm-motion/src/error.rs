//! What can go wrong on the way from a grasp to a motion.

/// Result of a call of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// Every way in which a request for a motion can be unsound. That a sound request has no answer is no error.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A number or a list outside its allowed range.
    #[error("{what}: expected {expected}, found {found}")]
    Invalid {
        /// Name of the argument.
        what: String,
        /// What is allowed, in words.
        expected: String,
        /// What was given.
        found: String,
    },
    /// A robot description, or a file beside it.
    #[error(transparent)]
    Robot(#[from] semfm_robot::Error),
    /// A mesh of the robot, the scene or the object.
    #[error(transparent)]
    Geom(#[from] semfm_geom::Error),
}
