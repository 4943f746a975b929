//! What can go wrong between two shapes.

/// Result of a call of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// Every way in which a pair, a region or a setting can fail to be what it should.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An error of `semfm-geom`: a mesh, an eigenbasis, a cancelled task.
    #[error(transparent)]
    Geom(#[from] semfm_geom::Error),
    /// Two arrays that belong together differ in length.
    #[error("{what}: expected {expected}, found {found}")]
    Length {
        /// What was counted.
        what: &'static str,
        /// Count expected.
        expected: usize,
        /// Count found.
        found: usize,
    },
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
    /// A region without a vertex cannot be transferred.
    #[error("the region is empty: none of {n_vertices} vertices has a weight of at least 0.5")]
    EmptyRegion {
        /// Vertices of the mesh it belongs to.
        n_vertices: usize,
    },
    /// A map of this size needs more eigenpairs than the shape's basis holds.
    #[error("{what} needs {asked} eigenpairs, but the basis of the {side} holds {available}")]
    BasisTooSmall {
        /// Which step.
        what: &'static str,
        /// `source` or `target`.
        side: &'static str,
        /// Eigenpairs needed.
        asked: usize,
        /// Eigenpairs there are.
        available: usize,
    },
    /// A mesh without two sides, or whose triangles do not agree which is which.
    #[error(
        "orientation needs triangles that are wound consistently, and {found} of {n_faces} are not, \
         first at the edge {} – {}",
        edge[0],
        edge[1]
    )]
    NotOriented {
        /// The vertices of the first edge around which triangles do not agree.
        edge: [u32; 2],
        /// Triangles at such edges.
        found: usize,
        /// All triangles.
        n_faces: usize,
    },
    /// Dense linear algebra failed for a reason of its own.
    #[error("linear algebra failed in {0}")]
    LinearAlgebra(&'static str),
}

impl Error {
    pub(crate) fn length(what: &'static str, expected: usize, found: usize) -> Result<()> {
        if expected == found { Ok(()) } else { Err(Self::Length { what, expected, found }) }
    }

    pub(crate) fn out_of_range<T>(
        what: &'static str,
        expected: impl Into<String>,
        found: impl std::fmt::Display,
    ) -> Result<T> {
        Err(Self::OutOfRange { what, expected: expected.into(), found: found.to_string() })
    }
}
