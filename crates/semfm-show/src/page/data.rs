//! The data of the page, as its viewer reads them (`viewer/viewer.js`).

use semfm::geom::math::{DMat3, DVec3};
use serde::Serialize;

use super::encoding::{EncodedMesh, encode_bytes, encode_numbers};
use super::grasps::{Hands, HandsData};
use super::group::{Group, Layer, Panel, Picture, VertexColors};
use super::motion::{Motion, MotionData};
use crate::colors::{MARKED, PLAIN, color_bytes, hex};
use crate::html::base64;

/// Everything on the page.
#[derive(Serialize)]
pub(super) struct PageData<'a> {
    /// Colours of no weight and of full weight.
    plain: [u8; 3],
    marked: [u8; 3],
    groups: Vec<GroupData<'a>>,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct GroupData<'a> {
    title: &'a str,
    facts: Vec<FactData<'a>>,
    notes: &'a [String],
    layers: Vec<LayerData<'a>>,
    panels: Vec<PanelData<'a>>,
    source_of: Option<String>,
    pictures: Vec<PictureData<'a>>,
    hands: Option<&'a HandsData>,
    motion: Option<&'a MotionData>,
}

#[derive(Serialize)]
struct FactData<'a> {
    name: &'a str,
    value: &'a str,
}

#[derive(Serialize)]
struct LayerData<'a> {
    name: &'a str,
    kind: &'static str,
    legend: Vec<LegendData<'a>>,
}

#[derive(Serialize)]
struct LegendData<'a> {
    color: Option<String>,
    text: &'a str,
}

#[derive(Serialize)]
struct PanelData<'a> {
    name: &'a str,
    note: &'a str,
    #[serde(flatten)]
    mesh: EncodedMesh,
    /// Rows of `upright_from_object`.
    upright: [f64; 9],
    #[serde(flatten)]
    eye: EyeAngles,
    /// One for each layer; none where the viewer makes the colours itself.
    colors: Vec<Option<String>>,
}

#[derive(Serialize)]
struct PictureData<'a> {
    name: &'a str,
    png: String,
    #[serde(flatten)]
    eye: EyeAngles,
}

/// Heading and height of an eye, in radians: at 0 and 0 it looks along the upright frame's y.
#[derive(Serialize)]
struct EyeAngles {
    yaw: f64,
    pitch: f64,
}

impl<'a> PageData<'a> {
    pub(super) fn new(groups: &'a [Group]) -> Self {
        let groups = groups.iter().map(GroupData::new).collect();
        Self { plain: color_bytes(PLAIN), marked: color_bytes(MARKED), groups }
    }
}

impl<'a> GroupData<'a> {
    fn new(group: &'a Group) -> Self {
        let upright = group.panels[0].viewpoints.upright_from_object;
        let facts = group.facts.iter();
        let panels = group.panels.iter().enumerate();
        let pictures = group.pictures.iter();
        Self {
            title: &group.title,
            facts: facts.map(|fact| FactData { name: &fact.name, value: &fact.value }).collect(),
            notes: &group.notes,
            layers: group.layers.iter().map(LayerData::new).collect(),
            panels: panels.map(|(k, panel)| PanelData::new(panel, k, &group.layers)).collect(),
            source_of: group.source_of.as_ref().map(|ids| encode_numbers(ids.iter().copied())),
            pictures: pictures.map(|picture| PictureData::new(picture, upright)).collect(),
            hands: group.hands.as_ref().map(Hands::data),
            motion: group.motion.as_ref().map(Motion::data),
        }
    }
}

impl<'a> LayerData<'a> {
    fn new(layer: &'a Layer) -> Self {
        let legend = layer.legend.iter();
        let legend =
            legend.map(|entry| LegendData { color: entry.color.map(hex), text: &entry.text });
        Self { name: &layer.name, kind: layer.colors[0].kind(), legend: legend.collect() }
    }
}

impl<'a> PanelData<'a> {
    /// The `k`-th panel of a group.
    fn new(panel: &'a Panel, k: usize, layers: &[Layer]) -> Self {
        let upright_from_object = panel.viewpoints.upright_from_object;
        let forward = panel.viewpoints.best.camera_from_world().matrix3.row(2);
        Self {
            name: &panel.name,
            note: &panel.note,
            mesh: EncodedMesh::new(&panel.mesh),
            upright: upright_from_object.transpose().to_cols_array(),
            eye: EyeAngles::new(upright_from_object, -forward),
            colors: layers.iter().map(|layer| encode_colors(&layer.colors[k])).collect(),
        }
    }
}

impl<'a> PictureData<'a> {
    fn new(picture: &'a Picture, upright_from_object: DMat3) -> Self {
        let eye = EyeAngles::new(upright_from_object, picture.towards_eye);
        Self { name: &picture.name, png: base64(&picture.png), eye }
    }
}

impl EyeAngles {
    fn new(upright_from_object: DMat3, towards_eye: DVec3) -> Self {
        let eye = (upright_from_object * towards_eye).normalize_or_zero();
        Self { yaw: eye.x.atan2(-eye.y), pitch: eye.z.clamp(-1.0, 1.0).asin() }
    }
}

fn encode_colors(colors: &VertexColors) -> Option<String> {
    match colors {
        VertexColors::Colors(colors) => Some(encode_bytes(colors.as_flattened())),
        VertexColors::Weights(weights) => {
            let bytes = weights.iter().map(|&w| (w.clamp(0.0, 1.0) * 255.0).round() as u8);
            Some(encode_bytes(&bytes.collect::<Vec<u8>>()))
        }
        VertexColors::Classes(classes) => Some(encode_bytes(classes)),
        VertexColors::Positions => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_eye_is_told_by_two_angles() {
        for (towards_eye, yaw, pitch) in [
            (-DVec3::Y, 0.0, 0.0),
            (DVec3::X, std::f64::consts::FRAC_PI_2, 0.0),
            (DVec3::new(0.0, -1.0, 1.0), 0.0, std::f64::consts::FRAC_PI_4),
        ] {
            let eye = EyeAngles::new(DMat3::IDENTITY, towards_eye);
            assert!((eye.yaw - yaw).hypot(eye.pitch - pitch) < 1e-12, "{towards_eye}");
        }
        let above = EyeAngles::new(DMat3::IDENTITY, DVec3::Z);
        assert!((above.pitch - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
    }
}
