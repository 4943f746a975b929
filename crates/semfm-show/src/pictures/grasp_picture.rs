//! The picture of grasps: grippers at the object, drawn as the collision shapes that were checked.
//!
//! Above, the best grasps from two sides, the better the bluer; below, the first one alone.

use std::path::Path;

use parry3d_f64::math::Pose;
use parry3d_f64::shape::{Shape, TypedShape};
use semfm::geom::math::DVec3;
use semfm::geom::{Mesh, Task};
use semfm::grasp::Grasp;
use semfm::robot::{Gripper, PosedPart};
use semfm::views::{RenderSettings, SurfaceColor, View, render};

use super::sheet::{Entry, PICTURE_SIDE, Row, Sheet};
use super::upright::upright;
use super::viewpoints::viewpoints_around;
use super::{Viewpoints, WeightedMesh};
use crate::Result;
use crate::colors::{grasp_color, weight_colors};

/// More grippers than this hide each other and the object.
pub(crate) const N_SHOWN: usize = 6;

/// Writes the picture of the first few of `grasps`, best first, on `mesh` in metres; `weights` is
/// the region, one weight per vertex.
///
/// # Errors
/// [`Error::Semfm`](crate::Error::Semfm) where rendering or writing fails, and where the task was
/// cancelled.
pub fn write_grasp_picture(
    path: &Path,
    mesh: &Mesh,
    weights: &[f64],
    gripper: &Gripper,
    grasps: &[Grasp],
    task: &Task,
) -> Result<()> {
    let object = WeightedMesh { mesh, weights };
    let shown = &grasps[..grasps.len().min(N_SHOWN)];
    let all = pictures(object, gripper, shown, task)?;
    let Some(best) = shown.first() else {
        let rows = [Row { title: "no grasp was found".into(), pictures: &all }];
        return Sheet { columns: &[], rows: &rows, legend: &[Entry::Weights] }.write(path);
    };
    let alone = pictures(object, gripper, &shown[..1], task)?;
    let first = match shown.len() {
        1 => "the only grasp".to_owned(),
        n => format!("the best {n} of {} grasps", grasps.len()),
    };
    let second = format!(
        "the best one: {:.0} mm between the pads, score {:.2}",
        1e3 * best.width,
        best.score
    );
    let rows = [Row { title: first, pictures: &all }, Row { title: second, pictures: &alone }];
    let legend = [
        Entry::Swatch(grasp_color(0, N_SHOWN), "best hand".into()),
        Entry::Swatch(grasp_color(shown.len() - 1, N_SHOWN), "last of those shown".into()),
        Entry::Weights,
    ];
    let legend = if shown.len() > 1 { &legend[..] } else { &legend[2..] };
    Sheet { columns: &[], rows: &rows, legend }.write(path)
}

/// The object with grippers, from where the region is seen best and from another side.
fn pictures(
    object: WeightedMesh<'_>,
    gripper: &Gripper,
    grasps: &[Grasp],
    task: &Task,
) -> Result<Vec<View>> {
    let mut surface = Surface::of(object.mesh);
    let mut colors = weight_colors(object.weights);
    for (rank, grasp) in grasps.iter().enumerate() {
        for PosedPart { tcp_from_part, part } in gripper.parts_at(grasp.width) {
            surface.add_shape(&*part.shape, grasp.object_from_tcp * tcp_from_part);
        }
        colors.resize(surface.vertices.len(), grasp_color(rank, N_SHOWN));
    }
    let with_grippers = Mesh::new(surface.vertices, surface.faces)?;
    let viewpoints = viewpoints_with_grippers(object, &with_grippers, PICTURE_SIDE, task)?;
    let cameras = [viewpoints.best, viewpoints.other];
    let light = RenderSettings::default();
    Ok(render(&with_grippers, &SurfaceColor::Vertices(&colors), &cameras, &light, task)?)
}

/// From where an object with grippers is looked at: `with_grippers` is the object's mesh with the
/// grippers' vertices behind its own; the object's own way up counts.
///
/// # Errors
/// As [`viewpoints`](super::viewpoints).
pub(crate) fn viewpoints_with_grippers(
    object: WeightedMesh<'_>,
    with_grippers: &Mesh,
    side: u32,
    task: &Task,
) -> Result<Viewpoints> {
    let mut weights = object.weights.to_vec();
    weights.resize(with_grippers.n_vertices(), 0.0);
    let all = WeightedMesh { mesh: with_grippers, weights: &weights };
    viewpoints_around(upright(object.mesh)?.up, all, side, task)
}

/// Triangles being gathered.
struct Surface {
    vertices: Vec<DVec3>,
    faces: Vec<[u32; 3]>,
}

impl Surface {
    fn of(mesh: &Mesh) -> Self {
        Self { vertices: mesh.vertices().to_vec(), faces: mesh.faces().to_vec() }
    }

    /// Adds a shape's surface. Boxes, convex hulls, triangle meshes and compounds of these are all that
    /// a gripper is made of.
    fn add_shape(&mut self, shape: &dyn Shape, pose: Pose) {
        let (points, triangles) = match shape.as_typed_shape() {
            TypedShape::Cuboid(cuboid) => cuboid.to_trimesh(),
            TypedShape::ConvexPolyhedron(hull) => hull.to_trimesh(),
            TypedShape::TriMesh(mesh) => (mesh.vertices().to_vec(), mesh.indices().to_vec()),
            TypedShape::Compound(compound) => {
                for (part_pose, part) in compound.shapes() {
                    self.add_shape(&**part, pose * *part_pose);
                }
                return;
            }
            _ => return,
        };
        let first = self.vertices.len() as u32;
        self.vertices.extend(points.into_iter().map(|p| pose * p));
        self.faces.extend(triangles.into_iter().map(|t| t.map(|v| v + first)));
    }
}

#[cfg(test)]
mod tests {
    use semfm::views::View;

    use super::*;

    fn n_blue(views: &[View]) -> usize {
        let pixels = views.iter().flat_map(|view| view.rgb.chunks_exact(3));
        pixels.filter(|rgb| rgb[2] > rgb[0].saturating_add(40)).count()
    }

    /// A gripper above a block, seen as pixels that are neither grey nor red.
    #[test]
    fn the_gripper_is_in_the_picture() {
        let gripper = Gripper::builtin("franka").unwrap();
        let (points, faces) = parry3d_f64::shape::Cuboid::new(DVec3::splat(0.02)).to_trimesh();
        let block = Mesh::new(points, faces).unwrap();
        let grasp = Grasp {
            object_from_tcp: Pose::from_translation(DVec3::new(0.0, 0.0, 0.05)),
            width: 0.04,
            opening: 0.08,
            contacts: [DVec3::ZERO; 2],
            normals: [DVec3::Y, -DVec3::Y],
            epsilon: 0.0,
            score: 1.0,
            terms: Vec::new(),
        };
        let weights = vec![1.0; block.n_vertices()];
        let object = WeightedMesh { mesh: &block, weights: &weights };
        let without = pictures(object, &gripper, &[], &Task::default()).unwrap();
        let with = pictures(object, &gripper, &[grasp], &Task::default()).unwrap();
        assert_eq!(n_blue(&without), 0);
        assert!(n_blue(&with) > 2000);
    }
}
