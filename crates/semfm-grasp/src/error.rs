//! What can go wrong between a region and a grasp.

/// Result of a call of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// Every way in which a gripper, a scene or a request for grasps can fail to be what it should.
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
    /// The ground floor refused something.
    #[error(transparent)]
    Geom(#[from] semfm_geom::Error),
}
