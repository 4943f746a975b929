//! A file of grasps as a group of the page: the best hand at the object, and the best few.

use std::path::Path;

use parry3d_f64::transformation::try_convex_hull;
use semfm::Region;
use semfm::geom::math::{DMat3, DVec3};
use semfm::geom::{Mesh, Task};
use semfm::weight_colors::{MARKED, PLAIN, color_bytes};
use serde::Deserialize;
use serde_json::Value;

use super::transfer_folder::read_json;
use super::{Group, Layer, Paint, Panel};
use crate::pictures::{SHOWN, hand_color, sides_with_hands};
use crate::{Error, Result};

/// The grasps of `path` at `mesh`, which must be the one they were found on; `weights` are those of
/// the region, where it is known. Nothing where there is no grasp.
///
/// # Errors
/// [`Error::Format`] for another file or another mesh.
pub(super) fn grasps_group(
    path: &Path,
    mesh: &Mesh,
    weights: Option<&[f64]>,
    task: &Task,
) -> Result<Option<Group>> {
    let file: GraspsFile = read_json(path)?;
    let fault = |place: &str, expected: String, found: String| {
        Err(Error::Format { path: path.to_owned(), place: place.into(), expected, found })
    };
    let hash = mesh.hash().to_string();
    if let Some(found) = file.mesh["hash"].as_str().filter(|found| *found != hash) {
        return fault("mesh", format!("the mesh before it, {hash}"), found.into());
    }
    if !(file.object_scale > 0.0 && file.object_scale.is_finite()) {
        return fault("object_scale", "a positive number".into(), file.object_scale.to_string());
    }
    if file.grasps.is_empty() {
        return Ok(None);
    }
    let shown = &file.grasps[..file.grasps.len().min(SHOWN)];
    let none = vec![0.0; mesh.n_vertices()];
    let weights = weights.unwrap_or(&none);
    let mut legend = vec![
        (Some(color_bytes(PLAIN)), "the object".to_owned()),
        (Some(color_bytes(MARKED)), "the region".to_owned()),
    ];
    legend.extend(shown.iter().enumerate().map(|(rank, grasp)| {
        let words = format!("{}: {:.0} mm, score {:.2}", rank + 1, 1e3 * grasp.width, grasp.score);
        (Some(color_bytes(hand_color(rank))), format!("grasp {words}"))
    }));
    let scene = |grasps: &[Grasp]| -> Result<(Mesh, Paint)> {
        let (mut vertices, mut faces) = (mesh.vertices().to_vec(), mesh.faces().to_vec());
        let mut classes: Vec<u8> =
            weights.iter().map(|&weight| u8::from(weight >= Region::COUNTS)).collect();
        for (rank, grasp) in grasps.iter().enumerate() {
            file.add_hand(grasp, &mut vertices, &mut faces);
            classes.resize(vertices.len(), rank as u8 + 2);
        }
        Ok((Mesh::new(vertices, faces)?, Paint::Classes(classes)))
    };
    // Both are seen from where the best hand hides least.
    let (alone, paint) = scene(&shown[..1])?;
    let sides = sides_with_hands(mesh, &alone, weights, 64, task)?;
    let panel = |name: &str, n: usize, mesh: Mesh| {
        let note = format!("{n} of {} grasps", file.grasps.len());
        Panel { name: name.into(), note, mesh, sides }
    };
    let (mut panels, mut paints) = (vec![panel("the best grasp", 1, alone)], vec![paint]);
    if shown.len() > 1 {
        let (all, paint) = scene(shown)?;
        panels.push(panel("the best few", shown.len(), all));
        paints.push(paint);
    }
    let title = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    let facts = vec![
        ("gripper".to_owned(), file.gripper.name.clone()),
        ("metres per unit".to_owned(), file.object_scale.to_string()),
    ];
    let layers = vec![Layer { name: "hands".into(), legend, paints }];
    Ok(Some(Group { title, facts, panels, layers, source_of: None, pictures: Vec::new() }))
}

/// `grasps.json`, what is of interest here.
#[derive(Deserialize)]
struct GraspsFile {
    mesh: Value,
    object_scale: f64,
    gripper: Gripper,
    grasps: Vec<Grasp>,
}

#[derive(Deserialize)]
struct Gripper {
    name: String,
    parts: Vec<Part>,
}

/// A rigid part: corners of its convex pieces.
#[derive(Deserialize)]
struct Part {
    hulls: Vec<Vec<[f64; 3]>>,
}

type Rows = [[f64; 4]; 4];

#[derive(Deserialize)]
struct Grasp {
    object_from_tcp: Rows,
    width: f64,
    score: f64,
    hand: Hand,
}

/// Poses of the parts in the TCP's frame.
#[derive(Deserialize)]
struct Hand {
    closed: Vec<Rows>,
}

impl GraspsFile {
    /// Adds the closed hand, in the units of the mesh.
    fn add_hand(&self, grasp: &Grasp, vertices: &mut Vec<DVec3>, faces: &mut Vec<[u32; 3]>) {
        for (part, tcp_from_part) in self.gripper.parts.iter().zip(&grasp.hand.closed) {
            for hull in &part.hulls {
                let corners: Vec<DVec3> = hull.iter().copied().map(DVec3::from_array).collect();
                // A piece without a hull (fewer than three corners) is not drawn.
                let Ok((points, triangles)) = try_convex_hull(&corners) else { continue };
                // Every triangle has corners of its own, so that edges stay sharp.
                for triangle in triangles {
                    let first = vertices.len() as u32;
                    vertices.extend(triangle.map(|v| {
                        let at_tcp = moved(tcp_from_part, points[v as usize]);
                        moved(&grasp.object_from_tcp, at_tcp) / self.object_scale
                    }));
                    faces.push([first, first + 1, first + 2]);
                }
            }
        }
    }
}

/// A point moved by a matrix whose rows come first.
fn moved(rows: &Rows, p: DVec3) -> DVec3 {
    let row = |k: usize| DVec3::new(rows[k][0], rows[k][1], rows[k][2]);
    let turn = DMat3::from_cols(row(0), row(1), row(2)).transpose();
    turn * p + DVec3::new(rows[0][3], rows[1][3], rows[2][3])
}
