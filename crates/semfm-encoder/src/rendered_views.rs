//! The views of an object that an encoder is shown: cameras all around, light, and the object's
//! colours or a grey.

#[cfg(feature = "mcap")]
use std::path::Path;

use semfm_geom::io::MeshFile;
use semfm_geom::{Mesh, Task, noise_free};
#[cfg(feature = "mcap")]
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

/// An object as it can be drawn: with the colours of its file, or as a bare mesh.
#[derive(Clone, Copy, Debug)]
pub enum Drawable<'a> {
    /// A mesh with the colours of its file.
    File(&'a MeshFile),
    /// A mesh without colours.
    Mesh(&'a Mesh),
}

impl<'a> Drawable<'a> {
    /// The mesh.
    pub fn mesh(self) -> &'a Mesh {
        match self {
            Self::File(file) => &file.mesh,
            Self::Mesh(mesh) => mesh,
        }
    }

    /// Its file, where that has colours.
    fn colored(self) -> Option<&'a MeshFile> {
        match self {
            Self::File(file) => Some(file).filter(|file| !file.appearance.is_plain()),
            Self::Mesh(_) => None,
        }
    }

    /// Hash of its colours; `None` where it has none.
    pub fn hash_of_colors(self) -> Option<String> {
        self.colored().map(|file| file.appearance.content_hash())
    }
}

impl<'a> From<&'a MeshFile> for Drawable<'a> {
    fn from(file: &'a MeshFile) -> Self {
        Self::File(file)
    }
}

impl<'a> From<&'a Mesh> for Drawable<'a> {
    fn from(mesh: &'a Mesh) -> Self {
        Self::Mesh(mesh)
    }
}

impl Coloring {
    /// Their own colours where both objects have some, else grey: colour on one side alone misleads
    /// an encoder.
    pub fn of_pair(source: Drawable<'_>, target: Drawable<'_>) -> Self {
        let colored = source.colored().is_some() && target.colored().is_some();
        if colored { Self::Own } else { Self::Grey }
    }

    /// The name used by files.
    #[cfg(feature = "mcap")]
    fn name(self) -> &'static str {
        match self {
            Self::Grey => "grey",
            Self::Own => "own",
            Self::Normals => "normals",
        }
    }
}

/// The views of an object with how they were drawn: what an encoder is shown, and what a views file
/// holds.
#[derive(Clone, Debug)]
pub struct RenderedObject<'a> {
    /// The mesh as read.
    pub mesh: &'a Mesh,
    /// One picture per camera.
    pub views: Vec<View>,
    /// How it was drawn; the colouring is what was left of it for this object.
    pub settings: ViewSettings,
    /// Colours of the vertices (n), where the object was drawn in its own and has some.
    pub vertex_colors: Option<Vec<[u8; 3]>>,
    /// Name of the renderer.
    pub renderer: String,
}

impl<'a> RenderedObject<'a> {
    /// Renders the views of an object; of a noisy one the surface without its noise ([`noise_free`]).
    ///
    /// # Errors
    /// [`semfm_views::Error::Invalid`] for settings out of range, [`semfm_views::Error::Gpu`] where a
    /// graphics driver fails, [`semfm_geom::Error::NoArea`], [`semfm_geom::Error::Cancelled`].
    pub fn new(
        object: impl Into<Drawable<'a>>,
        settings: &ViewSettings,
        renderer: &Renderer,
        task: &Task,
    ) -> Result<Self> {
        let object = object.into();
        let own = object.colored().filter(|_| settings.coloring == Coloring::Own);
        let own_color = own.map(|file| {
            move |face: usize, barycentric: [f64; 3]| own_color(file, face, barycentric)
        });
        let (coloring, paint) = match (settings.coloring, &own_color) {
            (Coloring::Normals, _) => (Coloring::Normals, SurfaceColor::Normals),
            (_, Some(own_color)) => (Coloring::Own, SurfaceColor::Surface(own_color)),
            (_, None) => (Coloring::Grey, SurfaceColor::default()),
        };
        let mesh = object.mesh();
        let drawn = noise_free(mesh);
        let cameras = rig(&drawn, &settings.rig)?;
        let views = renderer.render(&drawn, &paint, &cameras, &settings.render, task)?;
        let of_vertices = own.and_then(|file| file.appearance.vertex_colors.as_ref());
        Ok(Self {
            mesh,
            views,
            settings: ViewSettings { coloring, ..settings.clone() },
            vertex_colors: of_vertices
                .map(|colors| colors.iter().map(|&[r, g, b, _]| [r, g, b]).collect()),
            renderer: renderer.name(),
        })
    }

    /// What a file of these views says of itself.
    #[cfg(feature = "mcap")]
    pub fn metadata(&self) -> ViewsMetadata {
        let ViewSettings { rig, render, coloring } = &self.settings;
        ViewsMetadata {
            rig: rig.to_string(),
            background: render.background.map(|c| c.to_string()).join(","),
            more: [
                ("colors".to_owned(), coloring.name().to_owned()),
                ("look".to_owned(), render.to_string()),
                ("renderer".to_owned(), self.renderer.clone()),
            ]
            .into(),
            ..ViewsMetadata::of(self.mesh, rig.size, rig.size)
        }
    }

    /// Writes the views file (`NAME.views.mcap`).
    ///
    /// # Errors
    /// [`semfm_views::Error::Io`] where the file cannot be written.
    #[cfg(feature = "mcap")]
    pub fn write(&self, path: &Path) -> Result<()> {
        let colors = self.vertex_colors.as_deref();
        Ok(write_views(path, &self.views, self.mesh, colors, &self.metadata())?)
    }
}

/// The colour of the object at a point of a triangle, RGB in 0..1.
fn own_color(file: &MeshFile, face: usize, barycentric: [f64; 3]) -> [f32; 3] {
    let [r, g, b, _] = file.appearance.color_at(face, file.mesh.faces()[face], barycentric);
    [r, g, b].map(|c| f32::from(c) / 255.0)
}
