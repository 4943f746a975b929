//! The surface of a gripper, for pictures and viewers.

use parry3d_f64::math::Pose;
use parry3d_f64::shape::{Shape, TypedShape};
use semfm_geom::Mesh;
use semfm_geom::math::DVec3;

use super::Gripper;
use super::part::PosedPart;
use crate::Result;

impl Gripper {
    /// The collision shapes of all parts as one mesh in the TCP frame, metres, with the pads `width`
    /// apart (outside of the opening, the nearest inside).
    ///
    /// # Errors
    /// [`Error::Geom`](crate::Error::Geom) for a gripper whose shapes have no triangle.
    pub fn mesh_at(&self, width: f64) -> Result<Mesh> {
        let mut surface = Surface::default();
        for PosedPart { tcp_from_part, part } in self.parts_at(width) {
            surface.add(&*part.shape, tcp_from_part);
        }
        Ok(Mesh::new(surface.vertices, surface.faces)?)
    }
}

/// Triangles being gathered.
#[derive(Default)]
struct Surface {
    vertices: Vec<DVec3>,
    faces: Vec<[u32; 3]>,
}

impl Surface {
    /// Boxes, convex hulls, triangle meshes and compounds of these are all that a gripper is made of.
    fn add(&mut self, shape: &dyn Shape, pose: Pose) {
        let (points, triangles) = match shape.as_typed_shape() {
            TypedShape::Cuboid(cuboid) => cuboid.to_trimesh(),
            TypedShape::ConvexPolyhedron(hull) => hull.to_trimesh(),
            TypedShape::TriMesh(mesh) => (mesh.vertices().to_vec(), mesh.indices().to_vec()),
            TypedShape::Compound(compound) => {
                for (part_pose, part) in compound.shapes() {
                    self.add(&**part, pose * *part_pose);
                }
                return;
            }
            _ => return,
        };
        let first = self.vertices.len() as u32;
        self.vertices.extend(points.into_iter().map(|p| pose * p));
        self.faces.extend(triangles.into_iter().map(|face| face.map(|v| v + first)));
    }
}

#[cfg(test)]
mod tests {
    use crate::{BUILTIN_GRIPPERS, Gripper};

    #[test]
    fn the_pads_are_as_far_apart_as_asked_and_nothing_is_between() {
        for builtin in BUILTIN_GRIPPERS {
            let gripper = Gripper::builtin(builtin.name).unwrap();
            let width = 0.6 * gripper.opening.end();
            let mesh = gripper.mesh_at(width).unwrap();
            assert!(mesh.n_faces() >= 3 * 12, "{}", builtin.name);
            let (low, high) = mesh.bounds();
            assert!(low.y < -width / 2.0 && high.y > width / 2.0, "{}", builtin.name);
            // Around the TCP, between the pads, there is no vertex.
            let near =
                |p: &&semfm_geom::math::DVec3| p.y.abs() < width / 2.0 - 1e-6 && p.z > -0.005;
            assert_eq!(mesh.vertices().iter().find(near), None, "{}", builtin.name);
        }
    }
}
