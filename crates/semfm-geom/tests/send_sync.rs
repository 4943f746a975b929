//! Whatever the crate hands out may be shared between threads.

use semfm_geom::connectivity::{Components, MeshReport, VertexAdjacency};
use semfm_geom::geodesic::HeatGeodesics;
use semfm_geom::io::{
    Appearance, FormatError, Material, MeshFile, MeshFormat, PointCloud, Texture,
};
use semfm_geom::laplacian::BridgedLaplacian;
use semfm_geom::sampling::SurfaceSample;
use semfm_geom::{
    BarycentricPoint, CachedShape, Cleaned, Eigenbasis, Error, Laplacian, Mesh, MeshIdentity,
    MeshMismatch, PartialMeshIdentity, Pinhole, PointIndex, PreparedWorkingMesh, RayHit,
    SemanticCloud, Shape, ShapeCache, ShapeReport, ShapeSettings, Simplified, SparseCholesky,
    SurfaceIndex, SurfacePoint, Task, Verdict, WorkingMesh,
};

fn is_send_and_sync<T: Send + Sync>() {}

#[test]
fn public_types_are_send_and_sync() {
    is_send_and_sync::<(Mesh, MeshIdentity, PartialMeshIdentity, MeshMismatch, Verdict, Error)>();
    is_send_and_sync::<(Appearance, FormatError, Material, MeshFile, MeshFormat, Texture)>();
    is_send_and_sync::<(PointCloud, SemanticCloud, SurfaceSample, PointIndex, SurfaceIndex)>();
    is_send_and_sync::<(RayHit, SurfacePoint, Components, MeshReport, VertexAdjacency, Pinhole)>();
    is_send_and_sync::<(Laplacian, BridgedLaplacian, Eigenbasis, SparseCholesky, HeatGeodesics)>();
    is_send_and_sync::<(Cleaned, Simplified, WorkingMesh, PreparedWorkingMesh, BarycentricPoint)>();
    is_send_and_sync::<(Shape, ShapeCache, CachedShape, ShapeReport, ShapeSettings, Task)>();
}
