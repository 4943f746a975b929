//! The views of an object that an encoder is shown: cameras all around, light, and the object's
//! colours or a grey.

use std::path::Path;

use semfm_geom::io::MeshFile;
use semfm_geom::{MeshIdentity, Task};
use semfm_views::mcap::{ViewsMetadata, write_views};
use semfm_views::{RenderSettings, Renderer, RigSettings, SurfaceColor, View, rig};
use serde::Serialize;

use crate::Result;

/// How an object is shown.
#[derive(Clone, Debug, Default, Serialize)]
pub struct ViewSettings {
    /// Where the cameras stand.
    pub rig: RigSettings,
    /// Light and background.
    pub render: RenderSettings,
    /// What gives the surface its colour.
    pub coloring: Coloring,
}

/// What gives the surface its colour.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Coloring {
    /// Everything in the same grey.
    #[default]
    Grey,
    /// The object's own colours, where it has some.
    Own,
    /// The surface's directions.
    Normals,
}

impl Coloring {
    /// Their own colours where both objects have some, else grey: colour on one side alone misleads
    /// an encoder.
    pub fn of_pair(source: &MeshFile, target: &MeshFile) -> Self {
        let colored = !source.appearance.is_plain() && !target.appearance.is_plain();
        if colored { Self::Own } else { Self::Grey }
    }

    /// What is left of it for an object: one without colours is shown in grey.
    fn of(self, file: &MeshFile) -> Self {
        if self == Self::Own && file.appearance.is_plain() { Self::Grey } else { self }
    }

    /// The name used by files.
    fn name(self) -> &'static str {
        match self {
            Self::Grey => "grey",
            Self::Own => "own",
            Self::Normals => "normals",
        }
    }
}

/// Renders the views of an object.
///
/// # Errors
/// [`semfm_views::Error::Invalid`] for settings out of range, [`semfm_views::Error::Gpu`] where a
/// graphics driver fails, [`semfm_geom::Error::NoArea`], [`semfm_geom::Error::Cancelled`].
pub fn render_views(
    file: &MeshFile,
    settings: &ViewSettings,
    renderer: &Renderer,
    task: &Task,
) -> Result<Vec<View>> {
    let cameras = rig(&file.mesh, &settings.rig)?;
    let own_color = |face: usize, barycentric: [f64; 3]| own_color(file, face, barycentric);
    let paint = match settings.coloring.of(file) {
        Coloring::Grey => SurfaceColor::default(),
        Coloring::Own => SurfaceColor::Surface(&own_color),
        Coloring::Normals => SurfaceColor::Normals,
    };
    Ok(renderer.render(&file.mesh, &paint, &cameras, &settings.render, task)?)
}

/// The colour of the object at a point of a triangle, RGB in 0..1.
fn own_color(file: &MeshFile, face: usize, barycentric: [f64; 3]) -> [f32; 3] {
    let [r, g, b, _] = file.appearance.color_at(face, file.mesh.faces()[face], barycentric);
    [r, g, b].map(|c| f32::from(c) / 255.0)
}

/// Renders the views of an object, writes its views file (`NAME.views.mcap`) and returns the views.
///
/// # Errors
/// As [`render_views`]; [`semfm_views::Error::Io`] where the file cannot be written.
pub fn write_rendered_views(
    path: &Path,
    file: &MeshFile,
    settings: &ViewSettings,
    renderer: &Renderer,
    task: &Task,
) -> Result<Vec<View>> {
    let views = render_views(file, settings, renderer, task)?;
    let coloring = settings.coloring.of(file);
    let metadata = ViewsMetadata {
        mesh: MeshIdentity::of(&file.mesh),
        width: settings.rig.size,
        height: settings.rig.size,
        rig: settings.rig.to_string(),
        background: settings.render.background.map(|c| c.to_string()).join(","),
        seed: 0,
        more: [
            ("colors".to_owned(), coloring.name().to_owned()),
            ("look".to_owned(), settings.render.to_string()),
            ("renderer".to_owned(), renderer.name()),
        ]
        .into(),
    };
    let own = &file.appearance.vertex_colors;
    let vertex_colors: Option<Vec<[u8; 3]>> = match (coloring, own) {
        (Coloring::Own, Some(colors)) => {
            Some(colors.iter().map(|&[r, g, b, _]| [r, g, b]).collect())
        }
        _ => None,
    };
    write_views(path, &views, &file.mesh, vertex_colors.as_deref(), &metadata)?;
    Ok(views)
}
