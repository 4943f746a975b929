//! Meshes, Laplacians, eigenbases and spatial search: the ground floor of SemFM.
//!
//! Everything above this crate (views, functional maps, grasps) speaks in the types defined here:
//! a [`Mesh`] is checked once at its door, a [`Laplacian`] is positive semidefinite with a lumped
//! mass, an [`Eigenbasis`] is orthonormal for that mass, a [`SemanticCloud`] holds surface points
//! with image features. Lengths are in the units of the mesh file unless a name says otherwise.

pub mod algebra;
pub mod cache;
mod camera;
pub mod cholesky;
pub mod clean;
pub mod cloud;
mod collapse;
pub mod connectivity;
pub mod descriptors;
pub mod eigenbasis;
pub mod eigensolver;
mod error;
mod extent;
pub mod geodesic;
pub mod io;
pub mod laplacian;
pub mod math;
pub mod mesh;
pub mod nearest;
mod principal_axes;
pub mod sampling;
pub mod shape;
pub mod simplify;
pub mod surface;
pub mod task;
pub mod working;
#[cfg(any(test, feature = "zoo"))]
pub mod zoo;

pub use cache::{CachedShape, ShapeCache};
pub use camera::{Intrinsics, Pinhole, PixelDepth};
pub use cloud::SemanticCloud;
pub use eigenbasis::Eigenbasis;
pub use error::{Error, Result};
pub use extent::{Sphere, surface_sphere, surface_vertices};
pub use laplacian::Laplacian;
pub use mesh::{Mesh, MeshHash};
pub use nearest::PointIndex;
pub use principal_axes::principal_axes;
pub use shape::{Shape, ShapeReport, ShapeSettings};
pub use surface::{RayHit, SurfaceIndex, SurfacePoint};
pub use task::Task;
pub use working::WorkingMesh;
