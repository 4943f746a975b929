//! The picture of grasps: hands at the object, drawn as the collision shapes that were checked.
//!
//! Above, all the grasps from two sides, the better the bluer; below, the first one alone.

use std::path::Path;

use parry3d_f64::math::Pose;
use parry3d_f64::shape::{Shape, TypedShape};
use semfm::geom::math::DVec3;
use semfm::geom::{Mesh, Task};
use semfm::grasp::Grasp;
use semfm::robot::Gripper;
use semfm::views::{Paint, RenderSettings, View, render};
use semfm::weight_colors::weight_colors;

use super::sheet::{Entry, Row, Sheet};
use super::upright::upright;
use super::viewpoints::viewpoints_around;
use super::{SIDE, Sides};
use crate::Result;

/// Colour of the worst and of the best hand shown, as sRGB in 0..1.
const WORST: [f32; 3] = [0.95, 0.75, 0.30];
const BEST: [f32; 3] = [0.13, 0.42, 0.80];
/// More hands than this hide each other and the object.
pub(crate) const SHOWN: usize = 6;

/// Writes the picture of the first few of `grasps`, best first, on `mesh` in metres; `weights` is
/// the region, one weight per vertex.
///
/// # Errors
/// Whatever rendering or writing reports.
pub fn write_grasp_picture(
    path: &Path,
    mesh: &Mesh,
    weights: &[f64],
    gripper: &Gripper,
    grasps: &[Grasp],
    task: &Task,
) -> Result<()> {
    let shown = &grasps[..grasps.len().min(SHOWN)];
    let all = sides(mesh, weights, gripper, shown, task)?;
    let Some(best) = shown.first() else {
        let rows = [Row { title: "no grasp was found".into(), pictures: &all }];
        return Sheet { columns: &[], rows: &rows, legend: &[Entry::Weights] }.write(path);
    };
    let alone = sides(mesh, weights, gripper, &shown[..1], task)?;
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
        Entry::Swatch(BEST, "best hand".into()),
        Entry::Swatch(hand_color(shown.len() - 1), "last of those shown".into()),
        Entry::Weights,
    ];
    let legend = if shown.len() > 1 { &legend[..] } else { &legend[2..] };
    Sheet { columns: &[], rows: &rows, legend }.write(path)
}

/// The better the bluer.
pub(crate) fn hand_color(rank: usize) -> [f32; 3] {
    let share = rank as f32 / (SHOWN - 1) as f32;
    std::array::from_fn(|c| BEST[c] + share * (WORST[c] - BEST[c]))
}

/// The object with hands, from where the region is seen best and from another side.
fn sides(
    mesh: &Mesh,
    weights: &[f64],
    gripper: &Gripper,
    grasps: &[Grasp],
    task: &Task,
) -> Result<Vec<View>> {
    let (mut vertices, mut faces) = (mesh.vertices().to_vec(), mesh.faces().to_vec());
    let mut colors = weight_colors(weights);
    for (rank, grasp) in grasps.iter().enumerate() {
        let (points, triangles) = hand(gripper, grasp);
        let first = vertices.len() as u32;
        vertices.extend(points);
        faces.extend(triangles.iter().map(|t| t.map(|v| v + first)));
        colors.resize(vertices.len(), hand_color(rank));
    }
    let scene = Mesh::new(vertices, faces)?;
    let sides = sides_with_hands(mesh, &scene, weights, SIDE, task)?;
    let cameras = [sides.best, sides.other];
    let light = RenderSettings::default();
    Ok(render(&scene, &Paint::Vertices(&colors), &cameras, &light, task)?)
}

/// From where an object with hands is looked at: `scene` is `mesh` with the hands behind its vertices,
/// and the object's own way up counts.
pub(crate) fn sides_with_hands(
    mesh: &Mesh,
    scene: &Mesh,
    weights: &[f64],
    side: u32,
    task: &Task,
) -> Result<Sides> {
    let mut marked = weights.to_vec();
    marked.resize(scene.n_vertices(), 0.0);
    viewpoints_around(upright(mesh)?.up, scene, &marked, side, task)
}

/// The hand's parts at a grasp, in the object's frame: vertices and triangles.
fn hand(gripper: &Gripper, grasp: &Grasp) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    for (tcp_from_part, part) in gripper.parts_at(grasp.width) {
        let pose = grasp.object_from_tcp * tcp_from_part;
        add_shape(&*part.shape, pose, &mut vertices, &mut faces);
    }
    (vertices, faces)
}

/// Adds a shape's surface. Boxes, convex hulls, triangle meshes and compounds of these are all that
/// a gripper is made of.
fn add_shape(shape: &dyn Shape, pose: Pose, vertices: &mut Vec<DVec3>, faces: &mut Vec<[u32; 3]>) {
    let (points, triangles) = match shape.as_typed_shape() {
        TypedShape::Cuboid(cuboid) => cuboid.to_trimesh(),
        TypedShape::ConvexPolyhedron(hull) => hull.to_trimesh(),
        TypedShape::TriMesh(mesh) => (mesh.vertices().to_vec(), mesh.indices().to_vec()),
        TypedShape::Compound(compound) => {
            for (part_pose, part) in compound.shapes() {
                add_shape(&**part, pose * *part_pose, vertices, faces);
            }
            return;
        }
        _ => return,
    };
    let first = vertices.len() as u32;
    vertices.extend(points.into_iter().map(|p| pose * p));
    faces.extend(triangles.into_iter().map(|t| t.map(|v| v + first)));
}

#[cfg(test)]
mod tests {
    use semfm::views::View;

    use super::*;

    /// A hand above a block, seen as pixels that are neither grey nor red.
    #[test]
    fn the_hand_is_in_the_picture() {
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
        let blue = |views: &[View]| {
            let pixels = views.iter().flat_map(|view| view.rgb.chunks_exact(3));
            pixels.filter(|rgb| rgb[2] > rgb[0].saturating_add(40)).count()
        };
        let weights = vec![1.0; block.n_vertices()];
        let shown =
            |grasps: &[Grasp]| sides(&block, &weights, &gripper, grasps, &Task::default()).unwrap();
        assert_eq!(blue(&shown(&[])), 0);
        assert!(blue(&shown(&[grasp])) > 2000);
    }
}
