//! A file of grasps as a group of the page: the object, and the hand at each grasp.

use std::path::Path;

use semfm::files::{GraspRecord, GraspsFile, MatrixRows};
use semfm::geom::math::{DAffine3, DMat3, DVec3, bounds};
use semfm::{Mesh, Task};
use serde::Serialize;

use super::group::{Fact, Group, Layer, Panel, VIEWPOINT_SIDE, VertexColors, mesh_note};
use super::mesh::file_name;
use crate::Result;
use crate::colors::{APPROACH, CONTACT, HandColors, TABLE};
use crate::hand::{DrawnHand, PartKind, affine};
use crate::pictures::{
    ARROW, ARROW_GAP, ARROW_RADIUS, N_SHOWN, OPACITY, TABLE_REACH, WeightedMesh, ball_radius,
    upright, viewpoints_around,
};
use crate::surface::Surface;

/// The grasp over time begins this far behind, and ends this far above, metres: enough to be seen, and little
/// beside the hand.
const RETREAT: f64 = 0.05;
const LIFT: f64 = 0.05;

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
    let Some(best) = file.grasps.first() else { return Ok(None) };
    let up = match &file.table {
        Some(table) => DVec3::from_array(table.normal),
        None => upright(mesh)?.up,
    };
    let hands = Hands::new(&file, mesh, up);
    let none = vec![0.0; mesh.n_vertices()];
    let weights = weights.unwrap_or(&none);
    let viewpoints = {
        let with_hand = with_hand(&file, &hands.hand, best, mesh)?;
        let mut weights = weights.to_vec();
        weights.resize(with_hand.n_vertices(), 0.0);
        let all = WeightedMesh { mesh: &with_hand, weights: &weights };
        viewpoints_around(up, all, VIEWPOINT_SIDE, task)?
    };
    let colors = vec![VertexColors::Weights(weights.to_vec())];
    let panel =
        Panel { name: "object".into(), note: mesh_note(mesh), mesh: mesh.clone(), viewpoints };
    Ok(Some(Group {
        title: file_name(path),
        facts: vec![
            Fact::new("gripper", &file.gripper.name),
            Fact::new("grasps", file.grasps.len()),
            Fact::new("metres per unit", file.object_scale),
        ],
        panels: vec![panel],
        layers: vec![Layer { name: "region".into(), legend: Vec::new(), colors }],
        notes: Vec::new(),
        source_of: None,
        pictures: Vec::new(),
        hands: Some(hands),
        motion: None,
    }))
}

/// The object with one hand, in the object's units.
fn with_hand(
    file: &GraspsFile,
    hand: &DrawnHand,
    grasp: &GraspRecord,
    mesh: &Mesh,
) -> Result<Mesh> {
    let mut surface = Surface { vertices: mesh.vertices().to_vec(), faces: mesh.faces().to_vec() };
    let object_from_metres = DAffine3::from_scale(DVec3::splat(1.0 / file.object_scale));
    let object_from_tcp = object_from_metres * affine(&grasp.object_from_tcp);
    for part in &hand.parts {
        surface.add_at(&part.surface, object_from_tcp * affine(&grasp.hand.closed[part.carrier]));
    }
    Ok(Mesh::new(surface.vertices, surface.faces)?)
}

/// Hands that stand at the mesh of a group, one for each grasp of a file.
#[derive(Clone, Debug)]
pub struct Hands {
    hand: DrawnHand,
    data: HandsData,
}

/// What `viewer/hands.js` reads. Places are 3 × 4 matrices by rows. The panel's frame has the axes and the
/// unit of the mesh, and its origin in the middle of the mesh's box.
#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct HandsData {
    /// In the frame of the part that carries each, metres.
    parts: Vec<PartData>,
    grasps: Vec<GraspData>,
    /// In the frame of the TCP, metres.
    arrow: Shape,
    /// Around the origin of the panel's frame.
    ball: Shape,
    /// In the panel's frame.
    table: Option<Shape>,
    table_normal: Option<[f64; 3]>,
    colors: ColorData,
    /// Colours of the best few where they are shown together.
    ranks: Vec<HandColorData>,
    opacity: f32,
    /// How far behind the grasp the hand begins, metres.
    retreat: f64,
    /// How far hand and object are lifted, in the panel's frame.
    lift: [f64; 3],
}

#[derive(Clone, Debug, Serialize)]
struct PartData {
    /// Number of the pose that it has.
    carrier: usize,
    kind: &'static str,
    #[serde(flatten)]
    shape: Shape,
}

/// Corners, three numbers each, and triangles, three corners each.
#[derive(Clone, Debug, Serialize)]
struct Shape {
    positions: Vec<f32>,
    faces: Vec<u32>,
}

#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "camelCase")]
struct GraspData {
    /// Of the TCP in the panel's frame.
    place: [f64; 12],
    /// Of each part in the frame of the TCP.
    closed: Vec<[f64; 12]>,
    open: Vec<[f64; 12]>,
    width: f64,
    opening: f64,
    closing_turn: f64,
    score: f64,
    terms: Vec<(String, f64)>,
    /// In the panel's frame.
    contacts: [[f64; 3]; 2],
}

/// sRGB in 0..1.
#[derive(Clone, Copy, Debug, Serialize)]
struct HandColorData {
    palm: [f32; 3],
    finger: [f32; 3],
    pad: [f32; 3],
}

#[derive(Clone, Copy, Debug, Serialize)]
struct ColorData {
    #[serde(flatten)]
    hand: HandColorData,
    contact: [f32; 3],
    approach: [f32; 3],
    table: [f32; 3],
}

impl Hands {
    fn new(file: &GraspsFile, mesh: &Mesh, up: DVec3) -> Self {
        let hand = DrawnHand::of(file);
        let (low, high) = bounds(mesh.vertices()).unwrap_or_default();
        let middle = (low + high) / 2.0;
        let panel_from_object = DAffine3::from_translation(-middle)
            * DAffine3::from_scale(DVec3::splat(1.0 / file.object_scale));
        let back = file.grasps.first().map_or(0.0, |grasp| hand.back(grasp));
        let (length, tip) = (-ARROW * back, (1.0 + ARROW_GAP) * back);
        let radius = ball_radius(mesh.diagonal() * file.object_scale) / file.object_scale;
        let table = file.table.map(|table| {
            let [point, normal] = [table.point, table.normal].map(DVec3::from_array);
            table_shape(panel_from_object.transform_point3(point), normal, mesh)
        });
        let n_together = file.grasps.len().min(N_SHOWN);
        let data = HandsData {
            parts: hand.parts.iter().map(PartData::new).collect(),
            grasps: file.grasps.iter().map(|g| GraspData::new(g, panel_from_object)).collect(),
            arrow: Shape::new(&Surface::arrow(tip - length, tip, ARROW_RADIUS * length)),
            ball: Shape::new(&Surface::ball(DVec3::ZERO, radius)),
            table,
            table_normal: file.table.map(|table| table.normal),
            colors: ColorData {
                hand: HandColors::of_one().into(),
                contact: CONTACT,
                approach: APPROACH,
                table: TABLE,
            },
            ranks: (0..n_together).map(|i| HandColors::of_rank(i, n_together).into()).collect(),
            opacity: OPACITY,
            retreat: RETREAT,
            lift: (LIFT / file.object_scale * up.normalize_or_zero()).to_array(),
        };
        Self { hand, data }
    }

    /// What the viewer reads.
    pub(super) fn data(&self) -> &HandsData {
        &self.data
    }
}

/// The part of a table below the mesh, in the panel's frame, where the mesh is around the origin.
fn table_shape(point: DVec3, normal: DVec3, mesh: &Mesh) -> Shape {
    let (_, radius) = mesh.bounding_sphere();
    Shape::new(&Surface::disc(point.dot(normal) * normal, normal, TABLE_REACH * radius))
}

impl PartData {
    fn new(part: &crate::hand::DrawnPart) -> Self {
        let kind = match part.kind {
            PartKind::Palm => "palm",
            PartKind::Finger => "finger",
            PartKind::Pad => "pad",
        };
        Self { carrier: part.carrier, kind, shape: Shape::new(&part.surface) }
    }
}

impl Shape {
    fn new(surface: &Surface) -> Self {
        let points = surface.vertices.iter();
        let positions = points.flat_map(|p| p.as_vec3().to_array()).collect();
        Self { positions, faces: surface.faces.as_flattened().to_vec() }
    }
}

impl GraspData {
    fn new(grasp: &GraspRecord, panel_from_object: DAffine3) -> Self {
        let contact =
            |&p: &[f64; 3]| panel_from_object.transform_point3(DVec3::from_array(p)).to_array();
        let places = |poses: &[MatrixRows]| poses.iter().map(|pose| place(affine(pose))).collect();
        Self {
            place: place(panel_from_object * affine(&grasp.object_from_tcp)),
            closed: places(&grasp.hand.closed),
            open: places(&grasp.hand.open),
            width: grasp.width,
            opening: grasp.opening,
            closing_turn: grasp.closing_turn,
            score: grasp.score,
            terms: grasp.terms.clone().into_iter().collect(),
            contacts: [contact(&grasp.contacts[0]), contact(&grasp.contacts[1])],
        }
    }
}

/// A motion as 3 × 4 numbers by rows.
fn place(motion: DAffine3) -> [f64; 12] {
    let DMat3 { x_axis, y_axis, z_axis } = motion.matrix3;
    let columns = [x_axis, y_axis, z_axis, motion.translation];
    std::array::from_fn(|i| columns[i % 4][i / 4])
}

impl From<HandColors> for HandColorData {
    fn from(HandColors { palm, finger, pad }: HandColors) -> Self {
        Self { palm, finger, pad }
    }
}
