//! What can go wrong with meshes, matrices and their files.

use std::path::{Path, PathBuf};

use crate::Mesh;
use crate::io::FormatError;
use crate::math::DVec3;

/// Result of a call of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// Every way in which a mesh, a matrix or a file can fail to be what it should.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    // ---- meshes
    /// A mesh needs at least one vertex and one triangle.
    #[error(
        "empty mesh: {n_vertices} vertices and {n_faces} triangles, expected at least one of each"
    )]
    EmptyMesh {
        /// Vertices given.
        n_vertices: usize,
        /// Triangles given.
        n_faces: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("vertex {vertex} has a coordinate that is not finite: ({x}, {y}, {z})")]
    NotFinite {
        /// Vertex id, 0-based.
        vertex: usize,
        /// First coordinate.
        x: f64,
        /// Second coordinate.
        y: f64,
        /// Third coordinate.
        z: f64,
    },
    /// A coordinate is so large that areas and volumes of it lose their meaning.
    #[error(
        "vertex {vertex} has a coordinate beyond ±{most:e}: ({x:e}, {y:e}, {z:e}); is the file damaged, or its unit odd?"
    )]
    TooFar {
        /// Vertex id, 0-based.
        vertex: usize,
        /// Largest coordinate that is taken.
        most: f64,
        /// First coordinate.
        x: f64,
        /// Second coordinate.
        y: f64,
        /// Third coordinate.
        z: f64,
    },
    /// A triangle names a vertex that does not exist.
    #[error(
        "triangle {face} names vertex {vertex}, but there are {n_vertices} vertices (ids from 0)"
    )]
    VertexOutOfRange {
        /// Triangle id, 0-based.
        face: usize,
        /// The id it names.
        vertex: u64,
        /// Vertices there are.
        n_vertices: usize,
    },
    /// A surface without area has no Laplacian, no samples and no scale.
    #[error("the surface has no area: all {n_faces} triangles are degenerate")]
    NoArea {
        /// Triangles in the mesh.
        n_faces: usize,
    },

    // ---- arrays
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

    // ---- eigenbasis
    /// More eigenpairs were asked for than the mesh has.
    #[error(
        "{asked} eigenpairs asked of a mesh with {n_vertices} vertices, which has at most {n_vertices}"
    )]
    TooManyEigenpairs {
        /// Pairs asked.
        asked: usize,
        /// Vertices, which is the number of pairs there are.
        n_vertices: usize,
    },
    /// The solver stopped before the residuals reached the tolerance.
    #[error(
        "the eigensolver did not converge: relative residual {residual:.1e} after {restarts} restarts, \
         tolerance {tolerance:.1e}"
    )]
    NotConverged {
        /// Largest relative residual reached.
        residual: f64,
        /// The tolerance asked.
        tolerance: f64,
        /// Restarts done.
        restarts: usize,
    },
    /// A matrix that must be positive definite is not.
    #[error("{what} is not positive definite (failed at row {row})")]
    NotPositiveDefinite {
        /// Which matrix.
        what: &'static str,
        /// Pivot at which the factorisation failed.
        row: usize,
    },
    /// Dense or sparse linear algebra failed for a reason of its own.
    #[error("linear algebra failed in {0}")]
    LinearAlgebra(&'static str),

    // ---- files
    /// A file is not what its format demands.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// A file that follows its format holds something that is not a mesh.
    #[error("{}: {cause}", path.display())]
    InFile {
        /// The file.
        path: PathBuf,
        /// What is wrong with its contents; [`Error::code`] and [`Error::place`] are those of it.
        cause: Box<Error>,
    },
    /// The file cannot be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        #[source]
        source: std::io::Error,
    },

    // ---- work
    /// The caller asked the work to stop.
    #[error("cancelled")]
    Cancelled,
}

impl Error {
    /// [`Error::NotFinite`] or [`Error::TooFar`] for the first point that cannot be one of a surface.
    pub(crate) fn check_points(points: &[DVec3]) -> Result<()> {
        // The largest of several numbers passes over NaN.
        let far = |p: &DVec3| !p.is_finite() || p.abs().max_element() > Mesh::MAX_COORDINATE;
        let Some(vertex) = points.iter().position(far) else { return Ok(()) };
        let DVec3 { x, y, z } = points[vertex];
        Err(if points[vertex].is_finite() {
            Self::TooFar { vertex, most: Mesh::MAX_COORDINATE, x, y, z }
        } else {
            Self::NotFinite { vertex, x, y, z }
        })
    }

    /// [`Error::Length`] unless both counts are the same.
    pub(crate) fn check_length(what: &'static str, expected: usize, found: usize) -> Result<()> {
        if expected == found { Ok(()) } else { Err(Self::Length { what, expected, found }) }
    }

    /// [`Error::Io`] about `path`, for `map_err`; a file in a temporary folder is named by the place
    /// that it will have.
    pub(crate) fn io(path: &Path) -> impl Fn(std::io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io { path: crate::io::shown_path(&path), source }
    }

    /// A stable name for the kind of failure, for scripts: kebab-case, one per variant.
    pub fn code(&self) -> &'static str {
        match self {
            Self::EmptyMesh { .. } => "no-faces",
            Self::NotFinite { .. } => "non-finite",
            Self::TooFar { .. } => "too-large",
            Self::VertexOutOfRange { .. } => "index-out-of-range",
            Self::NoArea { .. } => "no-area",
            Self::Length { .. } => "length",
            Self::OutOfRange { .. } => "out-of-range",
            Self::TooManyEigenpairs { .. } => "too-many-eigenpairs",
            Self::NotConverged { .. } => "not-converged",
            Self::NotPositiveDefinite { .. } => "not-positive-definite",
            Self::LinearAlgebra(_) => "linear-algebra",
            Self::Format(_) => "format",
            Self::InFile { cause, .. } => cause.code(),
            Self::Io { .. } => "io",
            Self::Cancelled => "cancelled",
        }
    }

    /// Where it went wrong: a line, a byte offset, an element, a vertex; `None` where the failure
    /// has no place.
    pub fn place(&self) -> Option<String> {
        match self {
            Self::NotFinite { vertex, .. } | Self::TooFar { vertex, .. } => {
                Some(format!("vertex {vertex}"))
            }
            Self::VertexOutOfRange { face, .. } => Some(format!("triangle {face}")),
            Self::NotPositiveDefinite { row, .. } => Some(format!("row {row}")),
            Self::Format(error) => Some(error.place.clone()),
            Self::InFile { cause, .. } => cause.place(),
            _ => None,
        }
    }
}
