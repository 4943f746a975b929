//! Meshes, Laplacians, eigenbases and spatial search: what the other crates of SemFM stand on.
//!
//! Views, functional maps and grasps speak in the types defined here: a [`Mesh`] is checked once,
//! by its constructor, a [`Laplacian`] is positive semidefinite with a lumped mass, an
//! [`Eigenbasis`] is orthonormal for that mass, a [`SemanticCloud`] holds surface points with image
//! features. Lengths are in the units of the mesh file unless a name says otherwise.

mod cache;
mod camera;
mod cholesky;
mod clean;
mod collapse;
mod confidence_weights;
pub mod connectivity;
mod denoise;
pub mod descriptors;
mod disjoint_sets;
mod eigenbasis;
pub mod eigensolver;
mod error;
mod extent;
pub mod geodesic;
pub mod io;
pub mod laplacian;
mod likeness_scale;
pub mod math;
mod mesh;
mod mesh_identity;
mod patch_completion;
mod point_index;
mod principal_axes;
pub mod sampling;
mod semantic_cloud;
mod sequential_faer;
mod shape;
mod simplify;
mod spatial_order;
pub mod suggestion;
mod surface;
mod task;
mod verdict;
mod weld;
mod working_mesh;
#[cfg(any(test, feature = "zoo"))]
pub mod zoo;

pub use cache::{CachedShape, ShapeCache};
pub use camera::{Intrinsics, Pinhole, PixelDepth};
pub use cholesky::{CholeskyAnalysis, SparseCholesky};
pub use clean::{CleanReport, CleanSettings, Cleaned, clean};
pub use confidence_weights::ConfidenceWeights;
pub use denoise::noise_free;
pub use disjoint_sets::DisjointSets;
pub use eigenbasis::Eigenbasis;
pub use error::{Error, Result};
pub use extent::{Sphere, surface_sphere, surface_vertices};
pub use laplacian::Laplacian;
pub use likeness_scale::LikenessScale;
pub use mesh::{Mesh, MeshHash};
pub use mesh_identity::{MeshIdentity, MeshMismatch, PartialMeshIdentity};
pub use patch_completion::{CameraSearch, LikelyCamera, Viewpoint, complete_patch};
pub use point_index::PointIndex;
pub use principal_axes::{SurfaceMoments, principal_axes};
pub use semantic_cloud::SemanticCloud;
pub use sequential_faer::keep_faer_sequential;
pub use shape::{HeatStep, Shape, ShapeReport, ShapeSettings, ShapeTimes};
pub use simplify::{Simplified, SimplifyReport, SimplifySettings, Topology, simplify};
pub use spatial_order::SpatialOrder;
pub use surface::{RayHit, SurfaceIndex, SurfacePoint};
pub use task::{Progress, Task};
pub use verdict::Verdict;
pub use weld::{Welded, without_repeated_faces};
pub use working_mesh::{BarycentricPoint, PreparedWorkingMesh, WorkingMesh};
