//! `semfm-cli views`: the pictures that an encoder is shown.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Args;
use semfm::geom::io::MeshFile;
use semfm::picture::write_sheet;
use semfm::views::mcap::{MeshIdentity, ViewsMetadata, write_views};
use semfm::views::{RenderSettings, Renderer, RendererChoice, RigSettings, View, rig};

use super::Outcome;
use crate::options::Common;
use crate::{load, talk};

/// Render the views of an object that an encoder is shown
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  semfm-cli views mug.obj -o mug.views.mcap\n  \
    semfm-embed mug.views.mcap -o mug.emb.mcap --model google/siglip2-base-patch16-224")]
pub struct Views {
    /// The mesh: OBJ, PLY, STL, OFF, glTF or GLB
    mesh: PathBuf,
    /// Where to write (`NAME.views.mcap`)
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    #[command(flatten)]
    rig: RigOptions,
    /// Who draws: auto takes a graphics processor where one answers, gpu any graphics driver or
    /// nothing, cpu needs neither
    #[arg(long, default_value_t = RendererChoice::Auto, value_name = "auto|gpu|cpu", help_heading = "Rendering")]
    renderer: RendererChoice,
    /// An image for a mesh with texture coordinates (OBJ, PLY)
    #[arg(long, value_name = "IMAGE", help_heading = "Rendering")]
    texture: Option<PathBuf>,
    /// Also put all pictures on one sheet (PNG)
    #[arg(long, value_name = "SHEET.png", help_heading = "Rendering")]
    sheet: Option<PathBuf>,
    /// Ignore the object's colours
    #[arg(long, conflicts_with = "texture", help_heading = "Rendering")]
    grey: bool,
}

/// Where the cameras stand.
#[derive(Clone, Debug, Args)]
pub struct RigOptions {
    /// Number of views
    #[arg(long, default_value_t = RigSettings::default().count, value_name = "N", help_heading = "Rendering")]
    pub count: usize,
    /// Side of the square images in pixels
    #[arg(long, default_value_t = RigSettings::default().size, value_name = "PIXELS", help_heading = "Rendering")]
    pub size: u32,
}

impl RigOptions {
    pub fn settings(&self) -> RigSettings {
        RigSettings { count: self.count, size: self.size, ..Default::default() }
    }
}

impl Views {
    pub fn run(self, common: &Common) -> Result<Outcome> {
        let file = load::mesh(&self.mesh, self.texture.as_deref())?;
        if common.verbose {
            file.appearance
                .notes
                .iter()
                .for_each(|note| talk::remark(format_args!("note: {note}")));
        }
        let renderer = Renderer::open(self.renderer).context("--renderer")?;
        if let Some(note) = renderer.note().filter(|_| !common.quiet) {
            talk::remark(format_args!("note: {note}"));
        }
        let settings = self.rig.settings();
        let views = make_views(&file, !self.grey, &settings, &renderer, &self.output, common)
            .with_context(|| self.mesh.display().to_string())?;
        talk::say(self.output.display());
        if let Some(sheet) = &self.sheet {
            let columns = (views.len() as f64).sqrt().ceil() as usize;
            write_sheet(sheet, &views, columns)?;
            talk::say(sheet.display());
        }
        Ok(Outcome::Done)
    }
}

/// Renders an object, writes its views file and hands the views back.
pub fn make_views(
    file: &MeshFile,
    colored: bool,
    settings: &RigSettings,
    renderer: &Renderer,
    output: &Path,
    common: &Common,
) -> Result<Vec<View>> {
    let task = talk::watched(common.quiet);
    let cameras = rig(&file.mesh, settings)?;
    let appearance = Some(&file.appearance).filter(|appearance| colored && !appearance.is_plain());
    let views = load::with_paint(&file.mesh, appearance, |paint| {
        renderer.render(&file.mesh, paint, &cameras, &RenderSettings::default(), &task)
    })?;
    let metadata = ViewsMetadata {
        mesh: MeshIdentity::of(&file.mesh),
        width: settings.size,
        height: settings.size,
        rig: format!("fibonacci {}, principal frame", settings.count),
        background: "white".into(),
        seed: 0,
        more: [
            ("colors".to_owned(), if appearance.is_some() { "own" } else { "grey" }.to_owned()),
            ("renderer".to_owned(), renderer.name()),
        ]
        .into(),
    };
    let colors: Option<Vec<[u8; 3]>> = appearance
        .and_then(|appearance| appearance.vertex_colors.as_ref())
        .map(|colors| colors.iter().map(|&[r, g, b, _]| [r, g, b]).collect());
    write_views(output, &views, &file.mesh, colors.as_deref(), &metadata)?;
    Ok(views)
}
