//! The surface of a link, as it is seen: primitives as triangles, meshes as their files have them.

use parry3d_f64::math::Pose;
use parry3d_f64::shape::{Ball, Capsule, Cuboid, Cylinder, SharedShape};
use semfm_geom::io::{MeshFormat, read_mesh};
use semfm_geom::math::{DQuat, DVec3};

use crate::link::{Geometry, Link, LinkGeometry};
use crate::urdf::{MeshPaths, MeshPlace};
use crate::{Error, Result};

/// Most triangles of a mesh; published robots have some thousands a link.
const MAX_TRIANGLES: usize = 300_000;
/// Farthest corner of a mesh from its link's frame, metres: the earth has 1.3e7. Hulls of larger numbers lose their
/// last bits; what is too large for a gripper, [`MAX_SPAN`](crate::MAX_SPAN) refuses.
const MAX_COORDINATE: f64 = 1e7;
/// Thinnest half edge of a box: what is flat still collides.
pub(crate) const MIN_HALF: f64 = 1e-5;
/// Segments of a circle where round shapes are cut into triangles.
const N_SEGMENTS: u32 = 32;

/// The surface of a link in its own frame, metres.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LinkSurface {
    /// Corners (n).
    pub points: Vec<DVec3>,
    /// Triangles (m).
    pub faces: Vec<[u32; 3]>,
    /// Meshes that cannot be read, and why.
    pub missing: Vec<String>,
    /// Meshes of visuals that cannot be read, and why, for which the collisions stand.
    pub replaced: Vec<String>,
}

impl LinkSurface {
    /// Reads the visuals of a link; where it has none, or one of their meshes cannot be read, its collisions, where
    /// those can be.
    ///
    /// # Errors
    /// [`Error::Urdf`] for the name of a mesh that leads out of the allowed folders and for a mesh that is too large;
    /// [`Error::Geom`] for a mesh that breaks its format.
    pub fn new(link: &Link, paths: &MeshPaths) -> Result<Self> {
        let visuals = Self::of(&link.visuals, link, paths)?;
        if visuals.missing.is_empty() && !link.visuals.is_empty() || link.collisions.is_empty() {
            return Ok(visuals);
        }
        let collisions = Self::of(&link.collisions, link, paths)?;
        Ok(if collisions.missing.is_empty() || visuals.faces.is_empty() {
            Self { replaced: visuals.missing, ..collisions }
        } else {
            visuals
        })
    }

    /// A primitive around the origin; `None` for a mesh file.
    pub fn of_primitive(geometry: &Geometry) -> Option<Self> {
        let mut surface = Self::default();
        let Primitive { geometry_from_shape, points, faces, .. } = Primitive::new(geometry)?;
        surface.add(geometry_from_shape, &points, &faces);
        Some(surface)
    }

    fn of(geometries: &[LinkGeometry], link: &Link, paths: &MeshPaths) -> Result<Self> {
        let mut surface = Self::default();
        for LinkGeometry { link_from_geometry: place, geometry } in geometries {
            if let Some(primitive) = Primitive::new(geometry) {
                let place = *place * primitive.geometry_from_shape;
                surface.add(place, &primitive.points, &primitive.faces);
            } else if let Geometry::Mesh { filename, scale } = geometry {
                match LinkMesh::read(filename, *scale, link, paths)? {
                    LinkMesh::Read { points, faces } => surface.add(*place, &points, &faces),
                    LinkMesh::Missing(why) => surface.missing.push(why),
                }
            }
        }
        Ok(surface)
    }

    fn add(&mut self, place: Pose, points: &[DVec3], faces: &[[u32; 3]]) {
        let first = self.points.len() as u32;
        self.points.extend(points.iter().map(|&p| place.transform_point(p)));
        self.faces.extend(faces.iter().map(|face| face.map(|v| first + v)));
    }
}

/// A primitive as a convex shape and as triangles, both in the shape's frame.
pub(crate) struct Primitive {
    /// parry's cylinders stand along y, those of URDF along z.
    pub geometry_from_shape: Pose,
    pub shape: SharedShape,
    pub points: Vec<DVec3>,
    pub faces: Vec<[u32; 3]>,
}

impl Primitive {
    /// `None` for a mesh file.
    pub(crate) fn new(geometry: &Geometry) -> Option<Self> {
        let upright = Pose::from_rotation(DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2));
        let (geometry_from_shape, shape, (points, faces)) = match geometry {
            Geometry::Box { size } => {
                let cuboid = Cuboid::new((*size / 2.0).max(DVec3::splat(MIN_HALF)));
                (Pose::IDENTITY, SharedShape::new(cuboid), cuboid.to_trimesh())
            }
            &Geometry::Cylinder { radius, length } => {
                let cylinder = Cylinder::new((length / 2.0).max(MIN_HALF), radius.max(MIN_HALF));
                (upright, SharedShape::new(cylinder), cylinder.to_trimesh(N_SEGMENTS))
            }
            &Geometry::Capsule { radius, length } => {
                let capsule = Capsule::new_y(length / 2.0, radius.max(MIN_HALF));
                (upright, SharedShape::new(capsule), capsule.to_trimesh(N_SEGMENTS, N_SEGMENTS / 2))
            }
            &Geometry::Sphere { radius } => {
                let ball = Ball::new(radius.max(MIN_HALF));
                (Pose::IDENTITY, SharedShape::new(ball), ball.to_trimesh(N_SEGMENTS, N_SEGMENTS))
            }
            Geometry::Mesh { .. } => return None,
        };
        Some(Self { geometry_from_shape, shape, points, faces })
    }
}

/// The mesh of a link in the frame of its geometry, metres.
pub(crate) enum LinkMesh {
    Read {
        points: Vec<DVec3>,
        faces: Vec<[u32; 3]>,
    },
    /// Its name, and why it cannot be read.
    Missing(String),
}

impl LinkMesh {
    /// # Errors
    /// As [`LinkSurface::new`].
    pub(crate) fn read(
        filename: &str,
        scale: DVec3,
        link: &Link,
        paths: &MeshPaths,
    ) -> Result<Self> {
        let named = format!("link `{}`: mesh", link.name);
        let file = match paths.find(filename, &named) {
            Ok(MeshPlace::Found(file)) => file,
            Ok(MeshPlace::Missing(why)) => return Ok(Self::Missing(format!("{filename}: {why}"))),
            Err(fault) => return Err(fault.in_file(std::path::Path::new(filename))),
        };
        if MeshFormat::from_path(&file).is_none() {
            let kind = file.extension().unwrap_or_default().to_string_lossy().to_uppercase();
            return Ok(Self::Missing(format!("{filename}: {kind} is not supported")));
        }
        let mesh = read_mesh(&file)?.mesh;
        if mesh.n_faces() > MAX_TRIANGLES {
            return Err(Error::Urdf {
                path: file,
                code: "size",
                place: named,
                expected: format!("a mesh of at most {MAX_TRIANGLES} triangles"),
                found: format!("{}", mesh.n_faces()),
            });
        }
        let points: Vec<DVec3> = mesh.vertices().iter().map(|&point| point * scale).collect();
        let is_far = |p: &&DVec3| !p.is_finite() || p.abs().max_element() > MAX_COORDINATE;
        if let Some(far) = points.iter().find(is_far) {
            return Err(Error::Urdf {
                path: file,
                code: "size",
                place: named,
                expected: format!(
                    "corners within {MAX_COORDINATE:e} m of the link (is a scale missing, as \
                     scale=\"0.001 0.001 0.001\" for millimetres?)"
                ),
                found: format!("{:.3e} {:.3e} {:.3e}", far.x, far.y, far.z),
            });
        }
        // A mirrored mesh faces outwards when its triangles are turned around.
        let is_mirrored = scale.x * scale.y * scale.z < 0.0;
        let turned = |&[a, b, c]: &[u32; 3]| if is_mirrored { [a, c, b] } else { [a, b, c] };
        Ok(Self::Read { points, faces: mesh.faces().iter().map(turned).collect() })
    }
}

#[cfg(test)]
mod tests {
    use semfm_geom::math::bounds;

    use super::*;
    use crate::link::Inertial;

    fn link(visuals: Vec<LinkGeometry>, collisions: Vec<LinkGeometry>) -> Link {
        let inertial = Inertial {
            mass: 0.0,
            link_from_inertial: Pose::IDENTITY,
            moments: [0.0; 3],
            products: [0.0; 3],
        };
        Link { name: "l".into(), collisions, visuals, inertial }
    }

    fn placed(geometry: Geometry) -> LinkGeometry {
        let link_from_geometry = Pose::translation(1.0, 0.0, 0.0);
        LinkGeometry { link_from_geometry, geometry }
    }

    #[test]
    fn what_is_seen_comes_first_and_what_collides_stands_in_for_what_is_missing() {
        let folder = tempfile::tempdir().unwrap();
        let paths = MeshPaths::new(&folder.path().join("r.urdf"), &Default::default());
        let cylinder = || placed(Geometry::Cylinder { radius: 0.1, length: 1.0 });
        let size = DVec3::splat(0.5);
        let block = || placed(Geometry::Box { size });
        let seen = LinkSurface::new(&link(vec![cylinder()], vec![block()]), &paths).unwrap();
        let (low, high) = bounds(&seen.points).unwrap();
        assert!((high - low - DVec3::new(0.2, 0.2, 1.0)).length() < 1e-9, "{low} {high}");
        assert!(((high + low) / 2.0 - DVec3::X).length() < 1e-9);
        let file = Geometry::Mesh { filename: "none.dae".into(), scale: DVec3::ONE };
        let stand_in = LinkSurface::new(&link(vec![placed(file.clone())], vec![block()]), &paths);
        assert_eq!(stand_in.unwrap().points.len(), 8);
        let nothing = LinkSurface::new(&link(vec![placed(file)], Vec::new()), &paths).unwrap();
        assert_eq!((nothing.faces.len(), nothing.missing.len()), (0, 1));
    }
}
