//! What the page shows: groups of meshes side by side, and the ways to colour them.

use semfm::geom::math::DVec3;
use semfm::{Mesh, Task};

use super::grasps::Hands;
use super::motion::Motion;
use crate::pictures::{Viewpoints, viewpoints};
use crate::{Error, Result};

/// Side of the pictures that a panel's camera is chosen for. The viewer takes the direction alone.
pub(super) const VIEWPOINT_SIDE: u32 = 64;

/// How a layer colours the vertices of one mesh.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum VertexColors {
    /// sRGB bytes (n).
    Colors(Vec<[u8; 3]>),
    /// Weights in 0..1 (n), from grey to red.
    Weights(Vec<f64>),
    /// Places in the layer's legend (n).
    Classes(Vec<u8>),
    /// The vertices' own positions as colours; where there is a point map, the second mesh takes those
    /// of the first.
    Positions,
}

/// A line of a layer's legend.
#[derive(Clone, Debug)]
pub struct LegendEntry {
    /// The colour that it explains, as sRGB bytes; none for a note.
    pub color: Option<[u8; 3]>,
    /// What the colour stands for. An entry without text is not shown.
    pub text: String,
}

/// A way to colour all meshes of a group.
#[derive(Clone, Debug)]
pub struct Layer {
    /// Label of its button.
    pub name: String,
    /// Colours and what they stand for, those of classes first.
    pub legend: Vec<LegendEntry>,
    /// One for each panel, all of one kind.
    pub colors: Vec<VertexColors>,
}

/// A mesh to be shown.
#[derive(Clone, Debug)]
pub struct Panel {
    /// What it is: `source`, say.
    pub name: String,
    /// A short remark beside the name.
    pub note: String,
    /// The mesh.
    pub mesh: Mesh,
    /// From where it is seen at first.
    pub viewpoints: Viewpoints,
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

/// A name and a value for the line below a group's heading.
#[derive(Clone, Debug)]
pub struct Fact {
    /// What the value is; a `verdict` is drawn as such.
    pub name: String,
    /// The value as text.
    pub value: String,
}

/// Meshes that are shown side by side.
#[derive(Clone, Debug)]
pub struct Group {
    /// Heading.
    pub title: String,
    /// What is known about them.
    pub facts: Vec<Fact>,
    /// What was assumed, a sentence each.
    pub notes: Vec<String>,
    /// The meshes, at least one.
    pub panels: Vec<Panel>,
    /// Ways to colour them, at least one.
    pub layers: Vec<Layer>,
    /// Vertex of the first panel matched to each vertex of the second.
    pub source_of: Option<Vec<u32>>,
    /// Pictures of the first panel's mesh.
    pub pictures: Vec<Picture>,
    /// Hands at the first panel's mesh.
    pub hands: Option<Hands>,
    /// What moves around the first panel's mesh.
    pub motion: Option<Motion>,
}

impl VertexColors {
    /// What the viewer calls it.
    pub(super) fn kind(&self) -> &'static str {
        match self {
            Self::Colors(_) => "colors",
            Self::Weights(_) => "weights",
            Self::Classes(_) => "classes",
            Self::Positions => "positions",
        }
    }

    /// Entries, where it has any.
    fn len(&self) -> Option<usize> {
        match self {
            Self::Colors(colors) => Some(colors.len()),
            Self::Weights(weights) => Some(weights.len()),
            Self::Classes(classes) => Some(classes.len()),
            Self::Positions => None,
        }
    }
}

impl LegendEntry {
    pub(super) fn swatch(color: [u8; 3], text: impl Into<String>) -> Self {
        Self { color: Some(color), text: text.into() }
    }

    pub(super) fn note(text: impl Into<String>) -> Self {
        Self { color: None, text: text.into() }
    }
}

impl Layer {
    /// Vertices in the colours of their file.
    pub(super) fn own_colors(colors: Vec<[u8; 3]>) -> Self {
        let colors = vec![VertexColors::Colors(colors)];
        Self { name: "colours".into(), legend: Vec::new(), colors }
    }
}

impl Fact {
    pub(super) fn new(name: impl Into<String>, value: impl ToString) -> Self {
        Self { name: name.into(), value: value.to_string() }
    }
}

impl Panel {
    /// A mesh seen from where a region on it (a weight per vertex, or none) shows best.
    ///
    /// # Errors
    /// [`Error::Semfm`] for a mesh that cannot be rendered, and where the task was cancelled.
    pub fn new(name: &str, mesh: Mesh, weights: Option<&[f64]>, task: &Task) -> Result<Self> {
        let none = vec![0.0; mesh.n_vertices()];
        let viewpoints = viewpoints(&mesh, weights.unwrap_or(&none), VIEWPOINT_SIDE, task)?;
        Ok(Self { name: name.into(), note: mesh_note(&mesh), mesh, viewpoints })
    }
}

/// How large a mesh is, for the line below it.
pub(super) fn mesh_note(mesh: &Mesh) -> String {
    format!("{} vertices, {} triangles", mesh.n_vertices(), mesh.n_faces())
}

impl Group {
    /// Refuses parts that do not fit each other.
    pub(super) fn check(&self) -> Result<()> {
        if self.panels.is_empty() || self.layers.is_empty() {
            return Err(self.invalid("panels and layers", "at least one of each", "none"));
        }
        self.layers.iter().try_for_each(|layer| self.check_layer(layer))?;
        self.source_of.as_ref().map_or(Ok(()), |source_of| self.check_point_map(source_of))
    }

    fn check_layer(&self, Layer { name, legend, colors }: &Layer) -> Result<()> {
        let kinds: Vec<&str> = colors.iter().map(VertexColors::kind).collect();
        if kinds.len() != self.panels.len() || kinds.iter().any(|kind| *kind != kinds[0]) {
            let expected = format!("colours of one kind for each of {}", self.panels.len());
            return Err(self.invalid(&format!("layer `{name}`"), &expected, &kinds.join(", ")));
        }
        for (panel, colors) in self.panels.iter().zip(colors) {
            let what = format!("layer `{name}` of {}", panel.name);
            let n = panel.mesh.n_vertices();
            if let Some(found) = colors.len().filter(|&found| found != n) {
                let expected = format!("{n}, one per vertex");
                return Err(self.invalid(&what, &expected, &found.to_string()));
            }
            let VertexColors::Classes(classes) = colors else { continue };
            let n_named = legend.iter().take_while(|entry| entry.color.is_some()).count();
            if let Some(class) = classes.iter().find(|&&class| usize::from(class) >= n_named) {
                let expected = format!("classes below {n_named}");
                return Err(self.invalid(&what, &expected, &class.to_string()));
            }
        }
        Ok(())
    }

    fn check_point_map(&self, source_of: &[u32]) -> Result<()> {
        let [source, target] = &self.panels[..] else {
            let found = self.panels.len().to_string();
            return Err(self.invalid("panels joined by a point map", "two", &found));
        };
        let (n_source, n_target) = (source.mesh.n_vertices(), target.mesh.n_vertices());
        if source_of.len() != n_target || source_of.iter().any(|&v| v as usize >= n_source) {
            let expected = format!("{n_target} vertex ids below {n_source}");
            return Err(self.invalid("point map", &expected, &format!("{} ids", source_of.len())));
        }
        Ok(())
    }

    fn invalid(&self, what: &str, expected: &str, found: &str) -> Error {
        Error::invalid(format!("{}: {what}", self.title), expected, found)
    }
}
