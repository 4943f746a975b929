//! `show`: one HTML page that holds results and the viewer for them, and needs no network.
//!
//! Meshes stand side by side, with layers of colour to choose from. Where a point map joins the
//! first to the second, pointing at the source lights the matched place of the target. The viewer
//! (`viewer.js`) is ours and draws with WebGL 2.

mod folder;

use std::path::Path;

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use semfm_geom::Mesh;
use semfm_geom::io::write_atomically;
use serde_json::{Map, Value, json};

pub use folder::group_of_path;

use crate::{Error, Result};

/// Named colours of the vertices, as sRGB bytes (n).
pub type Layer = (String, Vec<[u8; 3]>);

/// A mesh to be shown.
#[derive(Clone, Debug)]
pub struct Panel {
    /// What it is: `source`, say.
    pub name: String,
    /// A few words more.
    pub note: String,
    /// The mesh.
    pub mesh: Mesh,
    /// One or more layers; those of a group's panels have the same names in the same order.
    pub layers: Vec<Layer>,
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
    /// Vertex of the first panel matched to each vertex of the second.
    pub source_of: Option<Vec<u32>>,
}

impl Group {
    fn check(&self) -> Result<()> {
        let names = |panel: &Panel| {
            panel.layers.iter().map(|layer| layer.0.clone()).collect::<Vec<_>>().join(", ")
        };
        let fault = |what: String, expected: String, found: String| {
            Err(Error::invalid(format!("{}: {what}", self.title), expected, found))
        };
        let Some(first) = self.panels.first() else {
            return fault("panels".into(), "at least one".into(), "none".into());
        };
        for panel in &self.panels {
            if panel.layers.is_empty() || names(panel) != names(first) {
                return fault(format!("layers of {}", panel.name), names(first), names(panel));
            }
            for (name, colors) in &panel.layers {
                let n = panel.mesh.n_vertices();
                if colors.len() != n {
                    let what = format!("colours `{name}` of {}", panel.name);
                    return fault(what, format!("{n}, one per vertex"), colors.len().to_string());
                }
            }
        }
        let (Some(source_of), [source, target, ..]) = (&self.source_of, &self.panels[..]) else {
            return Ok(());
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
        let panels: Vec<Value> = self
            .panels
            .iter()
            .map(|panel| {
                let points = panel.mesh.vertices().iter().flat_map(|p| p.as_vec3().to_array());
                let positions: Vec<u8> = points.flat_map(f32::to_le_bytes).collect();
                let faces = panel.mesh.faces().as_flattened().iter();
                let faces: Vec<u8> = faces.flat_map(|id| id.to_le_bytes()).collect();
                let colors: Map<String, Value> = panel
                    .layers
                    .iter()
                    .map(|(name, colors)| (name.clone(), json!(base64(colors.as_flattened()))))
                    .collect();
                json!({
                    "name": panel.name, "note": panel.note, "colors": colors,
                    "positions": base64(&positions), "faces": base64(&faces),
                })
            })
            .collect();
        let facts: Vec<Value> = self
            .facts
            .iter()
            .map(|(name, value)| json!([name, value, (name == "verdict").then_some(value)]))
            .collect();
        let source_of = self
            .source_of
            .as_ref()
            .map(|ids| base64(&ids.iter().flat_map(|id| id.to_le_bytes()).collect::<Vec<u8>>()));
        let layers: Vec<&String> = self.panels[0].layers.iter().map(|layer| &layer.0).collect();
        json!({
            "title": self.title, "facts": facts, "layers": layers, "panels": panels,
            "sourceOf": source_of,
        })
    }
}

/// Writes the page, whole or not at all.
///
/// # Errors
/// [`Error::Invalid`] for groups whose parts do not fit each other, [`semfm_geom::Error::Io`].
pub fn write_page(path: &Path, title: &str, groups: &[Group]) -> Result<()> {
    groups.iter().try_for_each(Group::check)?;
    let data = json!({ "groups": groups.iter().map(Group::json).collect::<Vec<_>>() });
    // `</script>` inside a string would end the element that holds it.
    let data = data.to_string().replace('<', "\\u003c");
    let page = include_str!("page.html")
        .replace("{{title}}", &escaped(title))
        .replace("{{version}}", env!("CARGO_PKG_VERSION"))
        .replace("{{script}}", include_str!("viewer.js"))
        .replace("{{data}}", &data);
    Ok(write_atomically(path, |out| out.write_all(page.as_bytes()))?)
}

/// Text for the body of an HTML page.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('{', "&#123;")
}

fn base64(bytes: &[u8]) -> String {
    BASE64_STANDARD.encode(bytes)
}

#[cfg(test)]
mod tests {
    use semfm_geom::math::DVec3;

    use super::*;

    fn group(source_of: Option<Vec<u32>>) -> Group {
        let mesh = Mesh::new(vec![DVec3::ZERO, DVec3::X, DVec3::Y], vec![[0, 1, 2]]).unwrap();
        let panel = |name: &str| Panel {
            name: name.into(),
            note: "</script><b>".into(),
            mesh: mesh.clone(),
            layers: vec![("region".into(), vec![[1, 2, 3]; 3])],
        };
        Group {
            title: "pair".into(),
            facts: vec![("verdict".into(), "accept".into())],
            panels: vec![panel("source"), panel("target")],
            source_of,
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
        let mut other = group(None);
        other.panels[1].layers[0].1.pop();
        assert!(write_page(&path, "t", &[other]).is_err());
        assert!(!path.exists());
    }
}
