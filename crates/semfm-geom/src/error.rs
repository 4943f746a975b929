//! What can go wrong on the ground floor.

use std::path::PathBuf;

/// Result of a ground-floor call.
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
    #[error("{}: {place}: expected {expected}, found {found}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// Line, byte offset, element or accessor.
        place: String,
        /// What the format demands there.
        expected: String,
        /// What stands there.
        found: String,
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
