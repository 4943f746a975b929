//! The shape of a link: what collides, as convex pieces, and the triangles of its surface.

use std::panic::{AssertUnwindSafe, catch_unwind};

use parry3d_f64::math::Pose;
use parry3d_f64::shape::{Cuboid, SharedShape};
use parry3d_f64::transformation::try_convex_hull;
use parry3d_f64::transformation::vhacd::{VHACD, VHACDParameters};
use semfm_geom::math::{DVec3, bounds};

use crate::Result;
use crate::link::{Geometry, Inertial, Link, LinkGeometry};
use crate::link_surface::{LinkMesh, MIN_HALF, Primitive};
use crate::urdf::MeshPaths;

/// A hull with more than this times the mesh's volume fills a space that is free (the bay between
/// finger and palm), and the mesh is cut into convex pieces. Hulls of the grippers that we know are
/// within 1.001.
const MAX_HULL_RATIO: f64 = 1.15;
/// Pieces of one mesh: with 11 for a whole gripper of three boxes a query takes 5 µs; more buys little.
const MAX_PIECES: u32 = 16;
/// A convex shape at its place in a link.
#[derive(Clone, Debug)]
pub struct ConvexPiece {
    /// Its place.
    pub link_from_piece: Pose,
    /// A cuboid, a ball, a capsule or cylinder along y, or a convex polyhedron.
    pub shape: SharedShape,
}

/// The shape of a link in its own frame.
#[derive(Clone, Debug, Default)]
pub struct LinkShape {
    /// What collides.
    pub pieces: Vec<ConvexPiece>,
    /// All surfaces.
    pub triangles: Vec<[DVec3; 3]>,
    /// Meshes that cannot be read, and why.
    pub missing: Vec<String>,
    /// Whether visuals stand in for collisions.
    pub from_visuals: bool,
    /// Meshes that could not be cut into convex pieces, and what stands for them.
    pub notes: Vec<String>,
}

impl LinkShape {
    /// Reads the collisions of a link; where it has none, or one of their meshes cannot be
    /// read, its visuals.
    ///
    /// # Errors
    /// [`Error::Urdf`](crate::Error::Urdf) for the name of a mesh that leads out of the allowed folders and for a mesh that is too large;
    /// [`Error::Geom`](crate::Error::Geom) for a mesh that breaks its format.
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

    fn of(geometries: &[LinkGeometry], link: &Link, paths: &MeshPaths) -> Result<Self> {
        let mut shape = Self::default();
        for geometry in geometries {
            shape.add(geometry, link, paths)?;
        }
        Ok(shape)
    }

    fn add(&mut self, placed: &LinkGeometry, link: &Link, paths: &MeshPaths) -> Result<()> {
        let place = placed.link_from_geometry;
        if let Some(primitive) = Primitive::new(&placed.geometry) {
            let place = place * primitive.geometry_from_shape;
            let piece = ConvexPiece { link_from_piece: place, shape: primitive.shape };
            self.pieces.push(piece);
            self.add_surface(place, &primitive.points, &primitive.faces);
        } else if let Geometry::Mesh { filename, scale } = &placed.geometry {
            match LinkMesh::read(filename, *scale, link, paths)? {
                LinkMesh::Read { points, faces } => {
                    self.add_mesh(filename, &points, &faces, place, link);
                }
                LinkMesh::Missing(why) => self.missing.push(why),
            }
        }
        Ok(())
    }

    fn add_mesh(
        &mut self,
        filename: &str,
        points: &[DVec3],
        faces: &[[u32; 3]],
        place: Pose,
        link: &Link,
    ) {
        let cut = ConvexPieces::new(points, faces);
        self.notes.extend(cut.note.map(|note| format!("link `{}`: {filename}: {note}", link.name)));
        let pieces = cut.shapes.into_iter();
        self.pieces.extend(pieces.map(|shape| ConvexPiece { link_from_piece: place, shape }));
        self.add_surface(place, points, faces);
    }

    /// Whether there is anything to it, be it a mesh that cannot be read.
    pub fn has_any(&self) -> bool {
        !self.pieces.is_empty() || !self.missing.is_empty()
    }

    fn add_surface(&mut self, place: Pose, points: &[DVec3], faces: &[[u32; 3]]) {
        let corners = faces.iter().map(|face| face.map(|i| points[i as usize]));
        self.triangles.extend(corners.map(|t| t.map(|p| place.transform_point(p))));
    }
}

/// A mesh as convex shapes that together cover it.
#[derive(Clone, Debug)]
pub struct ConvexPieces {
    /// Convex polyhedra in the frame of the mesh.
    pub shapes: Vec<SharedShape>,
    /// Why it is one piece although it should be several; `None` where all went well.
    pub note: Option<String>,
}

impl ConvexPieces {
    /// The hull of a mesh, or several hulls where one would fill what is free. parry's hull and its V-HACD may panic
    /// on degenerate input: then a hull, or else a box, stands for the mesh, and a note says so. (The panic's message
    /// still goes to the panic hook of the process.)
    pub fn new(points: &[DVec3], faces: &[[u32; 3]]) -> Self {
        let whole = |shape| Self { shapes: vec![shape], note: None };
        let Some(hull) = convex_hull(points) else { return whole(bounding_box(points)) };
        let is_full = volume(&hull.points, &hull.faces) <= MAX_HULL_RATIO * volume(points, faces);
        let hull = hull.into_shape().unwrap_or_else(|| bounding_box(points));
        if is_full {
            return whole(hull);
        }
        match guarded(|| decomposed(points, faces)) {
            Some(shapes) if !shapes.is_empty() => Self { shapes, note: None },
            _ => {
                let note = "it could not be cut into convex pieces; its convex hull stands for it";
                Self { shapes: vec![hull], note: Some(note.into()) }
            }
        }
    }
}

/// What `work` returns, `None` where it panics.
fn guarded<T>(work: impl FnOnce() -> T) -> Option<T> {
    catch_unwind(AssertUnwindSafe(work)).ok()
}

fn decomposed(points: &[DVec3], faces: &[[u32; 3]]) -> Vec<SharedShape> {
    let parameters = VHACDParameters { max_convex_hulls: MAX_PIECES, ..Default::default() };
    let decomposition = VHACD::decompose(&parameters, points, faces, true);
    let pieces = decomposition.compute_primitive_intersections(points, faces);
    pieces
        .iter()
        .filter(|piece| !piece.is_empty())
        .map(|piece| {
            convex_hull(piece).and_then(Hull::into_shape).unwrap_or_else(|| bounding_box(piece))
        })
        .collect()
}

/// Volume of a closed mesh: the sum of its tetrahedra with the origin.
///
/// > V = |Σ a · (b × c)| / 6
fn volume(points: &[DVec3], faces: &[[u32; 3]]) -> f64 {
    let corners = faces.iter().map(|face| face.map(|i| points[i as usize]));
    corners.map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum::<f64>().abs()
}

/// A convex hull as a mesh.
struct Hull {
    points: Vec<DVec3>,
    faces: Vec<[u32; 3]>,
}

impl Hull {
    /// `None` where it is degenerate after all.
    fn into_shape(self) -> Option<SharedShape> {
        guarded(|| SharedShape::convex_mesh(self.points, &self.faces)).flatten()
    }
}

/// The convex hull, `None` for points in a plane.
fn convex_hull(points: &[DVec3]) -> Option<Hull> {
    let (low, high) = bounds(points)?;
    if (high - low).min_element() < MIN_HALF {
        return None;
    }
    let (points, faces) = guarded(|| try_convex_hull(points).ok()).flatten()?;
    Some(Hull { points, faces })
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

/// The box of equal mass m and moments I. Its edge along x, and the others alike, is
///
/// > a² = 6 (I_yy + I_zz − I_xx) / m
pub(crate) fn inertia_box(inertial: &Inertial) -> Option<ConvexPiece> {
    let [x, y, z] = inertial.moments;
    let squares = DVec3::new(y + z - x, x + z - y, x + y - z) * 6.0 / inertial.mass;
    if !(inertial.mass > 0.0 && squares.min_element() > 0.0 && squares.is_finite()) {
        return None;
    }
    let half = DVec3::new(squares.x.sqrt(), squares.y.sqrt(), squares.z.sqrt()) / 2.0;
    let shape = SharedShape::cuboid(half.x, half.y, half.z);
    Some(ConvexPiece { link_from_piece: inertial.link_from_inertial, shape })
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_geom::Mesh;

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
        let parts = ConvexPieces::new(mesh.vertices(), mesh.faces()).shapes;
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
        let parts = ConvexPieces::new(mesh.vertices(), mesh.faces()).shapes;
        assert_eq!(parts.len(), 1);
        let bounds = parts[0].compute_aabb(&Pose::IDENTITY);
        assert!((bounds.extents() - DVec3::new(1.0, 1.0, 2.0 * MIN_HALF)).length() < 1e-12);
    }

    #[test]
    fn the_box_of_an_inertia_has_its_edges() {
        let size = DVec3::new(0.1, 0.2, 0.3);
        let mass = 2.0;
        let square = size * size;
        let moments = [square.y + square.z, square.x + square.z, square.x + square.y]
            .map(|s| mass * s / 12.0);
        let link_from_inertial = Pose::IDENTITY;
        let inertial = Inertial { mass, link_from_inertial, moments, products: [0.0; 3] };
        let piece = inertia_box(&inertial).unwrap();
        assert!((piece.shape.compute_aabb(&Pose::IDENTITY).extents() - size).length() < 1e-12);
        assert!(inertia_box(&Inertial { mass: 0.0, ..inertial }).is_none());
    }
}
