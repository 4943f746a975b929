//! A file of grasps as a group of the page: the best grasp on the object, and the best few.

use std::path::Path;

use parry3d_f64::transformation::try_convex_hull;
use semfm::files::{GraspRecord, GraspsFile, MatrixRows};
use semfm::geom::math::{DMat3, DVec3};
use semfm::{Mesh, Region, Task};

use super::group::{Fact, Group, Layer, LegendEntry, Panel, VIEWPOINT_SIDE, VertexColors};
use super::mesh::file_name;
use crate::Result;
use crate::colors::{MARKED, PLAIN, color_bytes, grasp_color};
use crate::pictures::{N_SHOWN, Viewpoints, WeightedMesh, viewpoints_with_grippers};

/// The grasps of `path` on `mesh`, which must be the one they were found on; `weights` are those of
/// the region, where it is known. Nothing where there is no grasp.
///
/// # Errors
/// [`Error::Format`](crate::Error::Format) for another file or another mesh, [`Error::Semfm`](crate::Error::Semfm) where it cannot be read or
/// drawn.
pub(super) fn grasps_group(
    path: &Path,
    mesh: &Mesh,
    weights: Option<&[f64]>,
    task: &Task,
) -> Result<Option<Group>> {
    let file = GraspsFile::read(path, mesh)?;
    if file.grasps.is_empty() {
        return Ok(None);
    }
    let none = vec![0.0; mesh.n_vertices()];
    let object = WeightedMesh { mesh, weights: weights.unwrap_or(&none) };
    let shown = &file.grasps[..file.grasps.len().min(N_SHOWN)];
    let alone = Scene::new(&file, object, &shown[..1])?;
    // Both are seen from where the best gripper hides least.
    let viewpoints = viewpoints_with_grippers(object, &alone.mesh, VIEWPOINT_SIDE, task)?;
    let mut layer =
        Layer { name: "hands".into(), legend: legend(shown), colors: vec![alone.colors] };
    let mut panels = vec![panel(&file, "the best grasp", 1, alone.mesh, viewpoints)];
    if shown.len() > 1 {
        let all = Scene::new(&file, object, shown)?;
        panels.push(panel(&file, "the best few", shown.len(), all.mesh, viewpoints));
        layer.colors.push(all.colors);
    }
    Ok(Some(Group {
        title: file_name(path),
        facts: vec![
            Fact::new("gripper", &file.gripper.name),
            Fact::new("metres per unit", file.object_scale),
        ],
        panels,
        layers: vec![layer],
        source_of: None,
        pictures: Vec::new(),
    }))
}

fn legend(grasps: &[GraspRecord]) -> Vec<LegendEntry> {
    let mut legend = vec![
        LegendEntry::swatch(color_bytes(PLAIN), "the object"),
        LegendEntry::swatch(color_bytes(MARKED), "the region"),
    ];
    legend.extend(grasps.iter().enumerate().map(|(rank, GraspRecord { width, score, .. })| {
        let text = format!("grasp {}: {:.0} mm, score {score:.2}", rank + 1, 1e3 * width);
        LegendEntry::swatch(color_bytes(grasp_color(rank, N_SHOWN)), text)
    }));
    legend
}

/// The object with grippers as one mesh. Classes: the object, its region, then one for each grasp.
struct Scene {
    mesh: Mesh,
    colors: VertexColors,
}

impl Scene {
    fn new(file: &GraspsFile, object: WeightedMesh<'_>, grasps: &[GraspRecord]) -> Result<Self> {
        let mut vertices = object.mesh.vertices().to_vec();
        let mut faces = object.mesh.faces().to_vec();
        let weights = object.weights.iter();
        let mut classes: Vec<u8> =
            weights.map(|&weight| u8::from(weight >= Region::COUNTS)).collect();
        for (rank, grasp) in grasps.iter().enumerate() {
            add_gripper(file, grasp, &mut vertices, &mut faces);
            classes.resize(vertices.len(), rank as u8 + 2);
        }
        let mesh = Mesh::new(vertices, faces)?;
        Ok(Self { mesh, colors: VertexColors::Classes(classes) })
    }
}

fn panel(file: &GraspsFile, name: &str, n: usize, mesh: Mesh, viewpoints: Viewpoints) -> Panel {
    let note = format!("{n} of {} grasps", file.grasps.len());
    Panel { name: name.into(), note, mesh, viewpoints }
}

/// Adds the closed gripper at a grasp, in the units of the mesh.
fn add_gripper(
    file: &GraspsFile,
    grasp: &GraspRecord,
    vertices: &mut Vec<DVec3>,
    faces: &mut Vec<[u32; 3]>,
) {
    for (part, tcp_from_part) in file.gripper.parts.iter().zip(&grasp.hand.closed) {
        for hull in &part.hulls {
            let corners: Vec<DVec3> = hull.iter().copied().map(DVec3::from_array).collect();
            // A piece without a hull (fewer than three corners) is not drawn.
            let Ok((points, triangles)) = try_convex_hull(&corners) else { continue };
            // Every triangle has corners of its own, so that edges stay sharp.
            for triangle in triangles {
                let first = vertices.len() as u32;
                vertices.extend(triangle.map(|v| {
                    let at_tcp = moved(tcp_from_part, points[v as usize]);
                    moved(&grasp.object_from_tcp, at_tcp) / file.object_scale
                }));
                faces.push([first, first + 1, first + 2]);
            }
        }
    }
}

/// A point moved by a matrix whose rows come first.
fn moved(rows: &MatrixRows, p: DVec3) -> DVec3 {
    let [x, y, z] = [0, 1, 2].map(|k| DVec3::new(rows[k][0], rows[k][1], rows[k][2]));
    let rotation = DMat3::from_cols(x, y, z).transpose();
    rotation * p + DVec3::new(rows[0][3], rows[1][3], rows[2][3])
}
