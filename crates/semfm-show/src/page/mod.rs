//! `show`: one HTML page that holds results and the viewer for them, and needs no network.
//!
//! Meshes stand side by side, with layers of colour to choose from. Where a point map joins the
//! first to the second, pointing at one lights the matched place of the other. The viewer (`*.js`)
//! is ours and draws with WebGL 2.

mod encoding;
mod grasps;
mod paths;
mod transfer_folder;
#[cfg(feature = "mcap")]
mod views;

use std::path::Path;

use semfm::geom::io::write_atomically;
use semfm::geom::math::{DMat3, DVec3};
use semfm::geom::{Mesh, Task};
use semfm::weight_colors::{MARKED, PLAIN, color_bytes};
use serde_json::{Value, json};

use self::encoding::{base64, packed, packed_mesh, packed_numbers};
use crate::pictures::{Sides, viewpoints};
use crate::{Error, Result};

pub use paths::groups_of_paths;

/// How a layer colours the vertices of one mesh.
#[derive(Clone, Debug)]
pub enum Paint {
    /// sRGB bytes (n).
    Colors(Vec<[u8; 3]>),
    /// Weights in 0..1 (n), from grey to red.
    Weights(Vec<f64>),
    /// Places in the layer's legend (n).
    Classes(Vec<u8>),
    /// The vertices' own positions as colours; where there is a point map, the second mesh takes those
    /// of the first.
    Places,
}

/// A way to colour all meshes of a group.
#[derive(Clone, Debug)]
pub struct Layer {
    /// What its button says.
    pub name: String,
    /// Colours and what they mean; words alone have no colour. An entry without words is not shown.
    pub legend: Vec<(Option<[u8; 3]>, String)>,
    /// One for each panel, all of one kind.
    pub paints: Vec<Paint>,
}

/// A mesh to be shown.
#[derive(Clone, Debug)]
pub struct Panel {
    /// What it is: `source`, say.
    pub name: String,
    /// A few words more.
    pub note: String,
    /// The mesh.
    pub mesh: Mesh,
    /// From where it is seen at first.
    pub sides: Sides,
}

/// A picture of the first panel's mesh.
#[derive(Clone, Debug)]
pub struct Picture {
    /// What stands below it.
    pub name: String,
    /// The PNG file.
    pub png: Vec<u8>,
    /// From the object to the eye.
    pub towards_eye: DVec3,
}

/// Meshes that are shown side by side.
#[derive(Clone, Debug)]
pub struct Group {
    /// Heading.
    pub title: String,
    /// Names and values for the line below; a verdict is drawn as such.
    pub facts: Vec<(String, String)>,
    /// The meshes, at least one.
    pub panels: Vec<Panel>,
    /// Ways to colour them, at least one.
    pub layers: Vec<Layer>,
    /// Vertex of the first panel matched to each vertex of the second.
    pub source_of: Option<Vec<u32>>,
    /// Pictures of the first panel's mesh.
    pub pictures: Vec<Picture>,
}

impl Panel {
    /// A mesh seen from where a region on it (a weight per vertex, or none) shows best.
    ///
    /// # Errors
    /// Whatever rendering reports.
    pub fn new(name: &str, mesh: Mesh, weights: Option<&[f64]>, task: &Task) -> Result<Self> {
        let none = vec![0.0; mesh.n_vertices()];
        let sides = viewpoints(&mesh, weights.unwrap_or(&none), 64, task)?;
        let note = format!("{} vertices, {} triangles", mesh.n_vertices(), mesh.n_faces());
        Ok(Self { name: name.into(), note, mesh, sides })
    }

    fn json(&self, paints: Vec<Value>) -> Value {
        let upright = self.sides.upright_from_object;
        let forward = self.sides.best.camera_from_world().matrix3.row(2);
        let (yaw, pitch) = angles(upright, -forward);
        let mut json = packed_mesh(&self.mesh);
        json["name"] = json!(self.name);
        json["note"] = json!(self.note);
        json["upright"] = json!(upright.transpose().to_cols_array());
        json["yaw"] = json!(yaw);
        json["pitch"] = json!(pitch);
        json["paints"] = json!(paints);
        json
    }
}

/// Heading and height of an eye: at 0 and 0 it looks along the upright frame's y.
fn angles(upright_from_object: DMat3, towards_eye: DVec3) -> (f64, f64) {
    let eye = (upright_from_object * towards_eye).normalize_or_zero();
    (eye.x.atan2(-eye.y), eye.z.clamp(-1.0, 1.0).asin())
}

impl Paint {
    fn kind(&self) -> &'static str {
        match self {
            Self::Colors(_) => "colors",
            Self::Weights(_) => "weights",
            Self::Classes(_) => "classes",
            Self::Places => "places",
        }
    }

    /// Entries, where it has any.
    fn len(&self) -> Option<usize> {
        match self {
            Self::Colors(colors) => Some(colors.len()),
            Self::Weights(weights) => Some(weights.len()),
            Self::Classes(classes) => Some(classes.len()),
            Self::Places => None,
        }
    }

    fn json(&self) -> Value {
        match self {
            Self::Colors(colors) => json!(packed(colors.as_flattened())),
            Self::Weights(weights) => {
                let byte = |&w: &f64| (w.clamp(0.0, 1.0) * 255.0).round() as u8;
                json!(packed(&weights.iter().map(byte).collect::<Vec<u8>>()))
            }
            Self::Classes(classes) => json!(packed(classes)),
            Self::Places => Value::Null,
        }
    }
}

impl Layer {
    fn json(&self) -> Value {
        let hex = |[r, g, b]: [u8; 3]| format!("#{r:02x}{g:02x}{b:02x}");
        let legend: Vec<Value> =
            self.legend.iter().map(|(color, text)| json!([color.map(hex), text])).collect();
        json!({
            "name": self.name, "legend": legend, "kind": self.paints[0].kind(),
            "plain": color_bytes(PLAIN), "marked": color_bytes(MARKED),
        })
    }
}

impl Group {
    fn check(&self) -> Result<()> {
        let fault = |what: String, expected: String, found: String| {
            Err(Error::invalid(format!("{}: {what}", self.title), expected, found))
        };
        if self.panels.is_empty() || self.layers.is_empty() {
            return fault("panels and layers".into(), "at least one of each".into(), "none".into());
        }
        for Layer { name, legend, paints } in &self.layers {
            let kinds: Vec<&str> = paints.iter().map(Paint::kind).collect();
            if kinds.len() != self.panels.len() || kinds.iter().any(|kind| *kind != kinds[0]) {
                let expected = format!("one paint of one kind for each of {}", self.panels.len());
                return fault(format!("layer `{name}`"), expected, kinds.join(", "));
            }
            for (panel, paint) in self.panels.iter().zip(paints) {
                let what = format!("layer `{name}` of {}", panel.name);
                let n = panel.mesh.n_vertices();
                if let Some(found) = paint.len().filter(|&found| found != n) {
                    return fault(what, format!("{n}, one per vertex"), found.to_string());
                }
                let Paint::Classes(classes) = paint else { continue };
                let named = legend.iter().take_while(|entry| entry.0.is_some()).count();
                if let Some(class) = classes.iter().find(|&&class| usize::from(class) >= named) {
                    return fault(what, format!("classes below {named}"), class.to_string());
                }
            }
        }
        let Some(source_of) = &self.source_of else { return Ok(()) };
        let [source, target] = &self.panels[..] else {
            let found = self.panels.len().to_string();
            return fault("panels joined by a point map".into(), "two".into(), found);
        };
        let n_source = source.mesh.n_vertices();
        if source_of.len() != target.mesh.n_vertices()
            || source_of.iter().any(|&v| v as usize >= n_source)
        {
            let expected = format!("{} vertex ids below {n_source}", target.mesh.n_vertices());
            return fault("point map".into(), expected, format!("{} ids", source_of.len()));
        }
        Ok(())
    }

    fn json(&self) -> Value {
        let paints =
            |k: usize| self.layers.iter().map(|layer| layer.paints[k].json()).collect::<Vec<_>>();
        let panels: Vec<Value> =
            self.panels.iter().enumerate().map(|(k, panel)| panel.json(paints(k))).collect();
        let facts: Vec<Value> = self
            .facts
            .iter()
            .map(|(name, value)| json!([name, value, (name == "verdict").then_some(value)]))
            .collect();
        let upright = self.panels[0].sides.upright_from_object;
        let picture = |picture: &Picture| {
            let (yaw, pitch) = angles(upright, picture.towards_eye);
            json!({ "name": picture.name, "png": base64(&picture.png), "yaw": yaw, "pitch": pitch })
        };
        json!({
            "title": self.title,
            "facts": facts,
            "linked": self.panels.len() > 1,
            "layers": self.layers.iter().map(Layer::json).collect::<Vec<_>>(),
            "panels": panels,
            "sourceOf": self.source_of.as_ref().map(|ids| packed_numbers(ids.iter().copied())),
            "pictures": self.pictures.iter().map(picture).collect::<Vec<_>>(),
        })
    }
}

/// Writes the page, whole or not at all.
///
/// # Errors
/// [`Error::Invalid`] for groups whose parts do not fit each other, [`semfm::geom::Error::Io`].
pub fn write_page(path: &Path, title: &str, groups: &[Group]) -> Result<()> {
    groups.iter().try_for_each(Group::check)?;
    let data = json!({ "groups": groups.iter().map(Group::json).collect::<Vec<_>>() });
    // `</script>` inside a string would end the element that holds it.
    let data = data.to_string().replace('<', "\\u003c");
    let script = [
        "\"use strict\";\n",
        include_str!("viewer/painter.js"),
        include_str!("viewer/panel.js"),
        include_str!("viewer/viewer.js"),
    ]
    .concat();
    let page = include_str!("viewer/page.html")
        .replace("{{title}}", &escaped(title))
        .replace("{{version}}", env!("CARGO_PKG_VERSION"))
        .replace("{{script}}", &script)
        .replace("{{data}}", &data);
    Ok(write_atomically(path, |out| out.write_all(page.as_bytes()))?)
}

/// Text for the body of an HTML page.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('{', "&#123;")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn group(source_of: Option<Vec<u32>>) -> Group {
        let mesh = Mesh::new(vec![DVec3::ZERO, DVec3::X, DVec3::Y], vec![[0, 1, 2]]).unwrap();
        let panel = |name: &str| {
            let panel = Panel::new(name, mesh.clone(), None, &Task::default()).unwrap();
            Panel { note: "</script><b>".into(), ..panel }
        };
        let layer = |name: &str, paint: Paint| Layer {
            name: name.into(),
            legend: vec![(Some([1, 2, 3]), "an anchor".into())],
            paints: vec![paint.clone(), paint],
        };
        Group {
            title: "pair".into(),
            facts: vec![("verdict".into(), "accept".into())],
            panels: vec![panel("source"), panel("target")],
            layers: vec![
                layer("region", Paint::Weights(vec![0.0, 0.5, 1.0])),
                layer("anchors", Paint::Classes(vec![0; 3])),
            ],
            source_of,
            pictures: Vec::new(),
        }
    }

    #[test]
    fn a_page_is_one_file_that_nothing_in_it_can_break() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("page.html");
        write_page(&path, "a < b {{data}}", &[group(Some(vec![0, 1, 2]))]).unwrap();
        let page = std::fs::read_to_string(&path).unwrap();
        assert!(!page.contains("http://") && !page.contains("https://"));
        assert_eq!(page.matches("</script>").count(), 2);
        assert!(page.contains("a &lt; b"));
    }

    #[test]
    fn parts_that_do_not_fit_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("page.html");
        for broken in [Some(vec![0, 1]), Some(vec![0, 1, 3])] {
            assert!(write_page(&path, "t", &[group(broken)]).is_err());
        }
        let spoil: [fn(&mut Group); 5] = [
            |group| {
                group.source_of = Some(vec![0, 1, 2]);
                group.panels.truncate(1);
                group.layers.iter_mut().for_each(|layer| layer.paints.truncate(1));
            },
            |group| group.layers.clear(),
            |group| group.layers[0].paints[1] = Paint::Weights(vec![0.0; 2]),
            |group| group.layers[0].paints[1] = Paint::Places,
            |group| group.layers[1].paints[1] = Paint::Classes(vec![0, 1, 0]),
        ];
        for spoil in spoil {
            let mut broken = group(None);
            spoil(&mut broken);
            assert!(write_page(&path, "t", &[broken]).is_err());
        }
        assert!(!path.exists());
    }

    #[test]
    fn the_eye_is_told_by_two_angles() {
        let close = |(a, b): (f64, f64), (c, d): (f64, f64)| (a - c).hypot(b - d) < 1e-12;
        let half = std::f64::consts::FRAC_PI_2;
        assert!(close(angles(DMat3::IDENTITY, -DVec3::Y), (0.0, 0.0)));
        assert!(close(angles(DMat3::IDENTITY, DVec3::X), (half, 0.0)));
        assert!((angles(DMat3::IDENTITY, DVec3::Z).1 - half).abs() < 1e-12);
    }
}
