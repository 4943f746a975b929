//! The solids of a link: what collides, as convex parts, and the triangles that pads are sought in.

use parry3d_f64::math::Pose;
use parry3d_f64::shape::{Ball, Capsule, Cuboid, Cylinder, SharedShape};
use parry3d_f64::transformation::try_convex_hull;
use parry3d_f64::transformation::vhacd::{VHACD, VHACDParameters};
use semfm_geom::Mesh;
use semfm_geom::io::{MeshFormat, read_mesh};
use semfm_geom::math::{DQuat, DVec3, bounds};

use crate::urdf::{Geometry, Link, MeshPaths, MeshPlace, Solid};
use crate::{Error, Result};

/// Most triangles of a collision mesh; hands in the wild have some thousands.
const MAX_TRIANGLES: usize = 300_000;
/// A hull with more than this times the mesh's volume fills a space that is free (the bay between
/// jaw and palm), and the mesh is cut into convex pieces. Hulls of the hands that we know are
/// within 1.001.
const MAX_HULL_RATIO: f64 = 1.15;
/// Pieces of one mesh: with 11 for a whole three-box hand a query takes 5 µs; more buys little.
const MAX_PIECES: u32 = 16;
/// Thinnest half edge of a box: what is flat still collides.
const MIN_HALF: f64 = 1e-5;
/// Segments of a circle where round shapes are cut into triangles.
const N_SEGMENTS: u32 = 32;

/// The shape of a link in its own frame.
#[derive(Clone, Debug, Default)]
pub(super) struct LinkShape {
    /// Convex parts at their places.
    pub parts: Vec<(Pose, SharedShape)>,
    /// All surfaces.
    pub triangles: Vec<[DVec3; 3]>,
    /// Meshes that could not be had, and why.
    pub missing: Vec<String>,
    /// Whether visuals stand in for collisions.
    pub from_visuals: bool,
}

impl LinkShape {
    /// Reads the collisions of a link; where it has none, or one of their meshes cannot be had, its
    /// visuals.
    pub fn new(link: &Link, paths: &MeshPaths) -> Result<Self> {
        let collisions = Self::of(&link.collisions, link, paths)?;
        if collisions.missing.is_empty() && !link.collisions.is_empty() || link.visuals.is_empty() {
            return Ok(collisions);
        }
        let visuals = Self::of(&link.visuals, link, paths)?;
        if visuals.missing.is_empty() {
            return Ok(Self { from_visuals: true, ..visuals });
        }
        Ok(if link.collisions.is_empty() { visuals } else { collisions })
    }

    fn of(solids: &[Solid], link: &Link, paths: &MeshPaths) -> Result<Self> {
        let mut shape = Self::default();
        for solid in solids {
            shape.add(solid, link, paths)?;
        }
        Ok(shape)
    }

    fn add(&mut self, solid: &Solid, link: &Link, paths: &MeshPaths) -> Result<()> {
        let place = solid.link_from_solid;
        // parry's cylinders stand along y, those of URDF along z.
        let upright =
            place * Pose::from_rotation(DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2));
        let (place, shape, surface) = match &solid.geometry {
            Geometry::Box { size } => {
                let cuboid = Cuboid::new((*size / 2.0).max(DVec3::splat(MIN_HALF)));
                (place, SharedShape::new(cuboid), cuboid.to_trimesh())
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
                (place, SharedShape::new(ball), ball.to_trimesh(N_SEGMENTS, N_SEGMENTS))
            }
            Geometry::Mesh { filename, scale } => {
                return self.add_mesh(filename, *scale, place, link, paths);
            }
        };
        self.parts.push((place, shape));
        self.add_surface(place, &surface.0, &surface.1);
        Ok(())
    }

    fn add_mesh(
        &mut self,
        filename: &str,
        scale: DVec3,
        place: Pose,
        link: &Link,
        paths: &MeshPaths,
    ) -> Result<()> {
        let named = format!("link `{}`: mesh", link.name);
        let file = match paths.find(filename, &named) {
            Ok(MeshPlace::Found(file)) => file,
            Ok(MeshPlace::Missing(why)) => {
                self.missing.push(format!("{filename}: {why}"));
                return Ok(());
            }
            Err(fault) => return Err(fault.in_file(std::path::Path::new(filename))),
        };
        if MeshFormat::from_path(&file).is_none() {
            let kind = file.extension().unwrap_or_default().to_string_lossy().to_uppercase();
            self.missing.push(format!("{filename}: {kind} is not supported"));
            return Ok(());
        }
        let mesh = read_mesh(&file)?.mesh;
        if mesh.n_faces() > MAX_TRIANGLES {
            return Err(Error::Urdf {
                path: file,
                code: "size",
                place: named,
                expected: format!("a collision mesh of at most {MAX_TRIANGLES} triangles"),
                found: format!("{}", mesh.n_faces()),
            });
        }
        let points: Vec<DVec3> = mesh.vertices().iter().map(|&point| point * scale).collect();
        for shape in convex_parts(&points, &mesh) {
            self.parts.push((place, shape));
        }
        self.add_surface(place, &points, mesh.faces());
        Ok(())
    }

    fn add_surface(&mut self, place: Pose, points: &[DVec3], faces: &[[u32; 3]]) {
        let corner = |i: u32| place.transform_point(points[i as usize]);
        self.triangles.extend(faces.iter().map(|face| face.map(corner)));
    }
}

/// The hull of a mesh, or several where one hull would fill what is free.
fn convex_parts(points: &[DVec3], mesh: &Mesh) -> Vec<SharedShape> {
    let hull = convex_hull(points);
    let volume = |points: &[DVec3], faces: &[[u32; 3]]| -> f64 {
        let signed = |f: &[u32; 3]| {
            let [a, b, c] = f.map(|i| points[i as usize]);
            a.dot(b.cross(c)) / 6.0
        };
        faces.iter().map(signed).sum::<f64>().abs()
    };
    let Some((hull_points, hull_faces)) = hull else { return vec![bounding_box(points)] };
    let filled = volume(&hull_points, &hull_faces);
    if filled <= MAX_HULL_RATIO * volume(points, mesh.faces()) {
        return SharedShape::convex_mesh(hull_points, &hull_faces)
            .map_or_else(|| vec![bounding_box(points)], |shape| vec![shape]);
    }
    let parameters = VHACDParameters { max_convex_hulls: MAX_PIECES, ..Default::default() };
    let decomposition = VHACD::decompose(&parameters, points, mesh.faces(), true);
    let pieces = decomposition.compute_primitive_intersections(points, mesh.faces());
    pieces
        .iter()
        .filter(|piece| !piece.is_empty())
        .map(|piece| {
            convex_hull(piece)
                .and_then(|(points, faces)| SharedShape::convex_mesh(points, &faces))
                .unwrap_or_else(|| bounding_box(piece))
        })
        .collect()
}

/// The convex hull, `None` for points in a plane.
fn convex_hull(points: &[DVec3]) -> Option<(Vec<DVec3>, Vec<[u32; 3]>)> {
    let (low, high) = bounds(points)?;
    if (high - low).min_element() < MIN_HALF {
        return None;
    }
    try_convex_hull(points).ok()
}

/// The box around points with the axes of their frame, as a hull of its eight corners.
fn bounding_box(points: &[DVec3]) -> SharedShape {
    let (low, high) = bounds(points).unwrap_or((DVec3::ZERO, DVec3::ZERO));
    let (middle, half) = ((low + high) / 2.0, ((high - low) / 2.0).max(DVec3::splat(MIN_HALF)));
    let (corners, faces) = Cuboid::new(half).to_trimesh();
    let corners: Vec<DVec3> = corners.into_iter().map(|corner| corner + middle).collect();
    SharedShape::convex_mesh(corners, &faces)
        .unwrap_or_else(|| SharedShape::cuboid(half.x, half.y, half.z))
}

/// The box of equal mass and moments: edge² = 6 (sum of the other two moments − own) / mass.
pub(super) fn inertia_box(link: &Link) -> Option<(Pose, SharedShape)> {
    let [x, y, z] = link.moments;
    let squares = DVec3::new(y + z - x, x + z - y, x + y - z) * 6.0 / link.mass;
    if !(link.mass > 0.0 && squares.min_element() > 0.0 && squares.is_finite()) {
        return None;
    }
    let half = DVec3::new(squares.x.sqrt(), squares.y.sqrt(), squares.z.sqrt()) / 2.0;
    Some((link.link_from_inertia, SharedShape::cuboid(half.x, half.y, half.z)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A U of three boxes as one mesh: a block with a bay 0.6 wide and 0.8 deep.
    fn bay() -> Mesh {
        let outline = [
            [-0.5, 0.0],
            [0.5, 0.0],
            [0.5, 1.0],
            [0.3, 1.0],
            [0.3, 0.2],
            [-0.3, 0.2],
            [-0.3, 1.0],
            [-0.5, 1.0],
        ];
        let mut points = Vec::new();
        for z in [0.0, 0.3] {
            points.extend(outline.iter().map(|&[x, y]| DVec3::new(x, y, z)));
        }
        let lid = [[0, 5, 7], [5, 6, 7], [0, 4, 5], [0, 1, 4], [1, 2, 4], [2, 3, 4]];
        let mut faces: Vec<[u32; 3]> = lid.iter().map(|&[a, b, c]| [a, c, b]).collect();
        faces.extend(lid.iter().map(|face| face.map(|i| i + 8)));
        for i in 0..8u32 {
            let j = (i + 1) % 8;
            faces.extend([[i, j, j + 8], [i, j + 8, i + 8]]);
        }
        Mesh::new(points, faces).unwrap()
    }

    #[test]
    fn a_bay_stays_free() {
        let mesh = bay();
        let parts = convex_parts(mesh.vertices(), &mesh);
        assert!(parts.len() > 1 && parts.len() <= MAX_PIECES as usize, "{}", parts.len());
        let probe = Cuboid::new(DVec3::new(0.25, 0.3, 0.1));
        let middle = Pose::translation(0.0, 0.6, 0.15);
        for part in &parts {
            let hit =
                parry3d_f64::query::intersection_test(&Pose::IDENTITY, &**part, &middle, &probe);
            assert!(!hit.unwrap().intersecting);
        }
    }

    #[test]
    fn a_flat_mesh_becomes_a_thin_box() {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(1.0, 1.0, 0.0)];
        let mesh = Mesh::new(corners.to_vec(), vec![[0, 1, 2], [2, 1, 3]]).unwrap();
        let parts = convex_parts(mesh.vertices(), &mesh);
        assert_eq!(parts.len(), 1);
        let bounds = parts[0].compute_aabb(&Pose::IDENTITY);
        assert!((bounds.extents() - DVec3::new(1.0, 1.0, 2.0 * MIN_HALF)).length() < 1e-12);
    }

    #[test]
    fn the_box_of_an_inertia_has_its_edges() {
        let size = DVec3::new(0.1, 0.2, 0.3);
        let mass = 2.0;
        let square = size * size;
        let moment = |a: f64, b: f64| mass * (a + b) / 12.0;
        let link = Link {
            name: "l".into(),
            collisions: vec![],
            visuals: vec![],
            mass,
            link_from_inertia: Pose::IDENTITY,
            moments: [
                moment(square.y, square.z),
                moment(square.x, square.z),
                moment(square.x, square.y),
            ],
        };
        let (_, shape) = inertia_box(&link).unwrap();
        assert!((shape.compute_aabb(&Pose::IDENTITY).extents() - size).length() < 1e-12);
        assert!(inertia_box(&Link { mass: 0.0, ..link }).is_none());
    }
}
