//! `semfm-cli views`: the pictures that an encoder is shown.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::{Args, ValueEnum};
use semfm::geom::MeshIdentity;
use semfm::geom::io::{MeshFile, MeshFormat};
use semfm::views::mcap::{ViewsMetadata, write_views};
use semfm::views::{
    RenderSettings, Renderer, RendererChoice, RigSettings, SurfaceColor, View, rig,
};
use semfm_show::write_sheet;

use super::Outcome;
use crate::options::Common;
use crate::{load, talk};

/// Render the views of an object that an encoder is shown
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  semfm-cli views mug.obj -o mug.views.mcap\n  \
    semfm-embed mug.views.mcap -o mug.emb.mcap --model google/siglip2-base-patch16-224")]
pub struct Views {
    #[arg(help = format!("The mesh: {}", MeshFormat::readable_names()))]
    mesh: PathBuf,
    /// Where to write (`NAME.views.mcap`)
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    #[command(flatten)]
    rig: RigOptions,
    #[command(flatten)]
    look: LookOptions,
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

/// Where the cameras stand and what they frame.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Cameras")]
struct RigOptions {
    /// Number of views
    #[arg(long, default_value_t = RigSettings::default().count, value_name = "N")]
    count: usize,
    /// Side of the square images in pixels
    #[arg(long, default_value_t = RigSettings::default().size, value_name = "PIXELS")]
    size: u32,
    /// Close-ups beside each view, along the silhouette's longer side
    #[arg(long, default_value_t = RigSettings::default().close_ups, value_name = "N")]
    close_ups: usize,
    /// Angle of view, in degrees
    #[arg(long, default_value_t = RigSettings::default().field_of_view.to_degrees().round(), value_name = "DEGREES", value_parser = degrees)]
    fov: f64,
    /// Share of the image's side that the silhouette fills
    #[arg(long, default_value_t = RigSettings::default().fill, value_name = "SHARE")]
    fill: f64,
    /// Largest zoom beyond the fit of the bounding sphere
    #[arg(long, default_value_t = RigSettings::default().max_zoom, value_name = "FACTOR")]
    max_zoom: f64,
    /// What is upright: the object's principal axis, or z of the file
    #[arg(long, value_enum, default_value_t = Upright::Principal)]
    upright: Upright,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Upright {
    Principal,
    Z,
}

impl RigOptions {
    fn settings(&self) -> RigSettings {
        RigSettings {
            count: self.count,
            size: self.size,
            field_of_view: self.fov.to_radians(),
            fill: self.fill,
            max_zoom: self.max_zoom,
            principal_frame: self.upright == Upright::Principal,
            close_ups: self.close_ups,
        }
    }
}

/// An angle of view that a flat picture can have.
fn degrees(text: &str) -> std::result::Result<f64, String> {
    let angle: f64 = text.parse().map_err(|_| "expected a number of degrees".to_owned())?;
    if (1.0..=150.0).contains(&angle) { Ok(angle) } else { Err("expected 1 to 150 degrees".into()) }
}

/// How the surface looks.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Look")]
struct LookOptions {
    /// Darken what is closed in (ambient occlusion), 0 to 1
    #[arg(long, default_value_t = RenderSettings::default().occlusion, value_name = "STRENGTH")]
    occlusion: f64,
    /// Draw silhouettes and creases, 0 to 1
    #[arg(long, default_value_t = RenderSettings::default().edges, value_name = "STRENGTH")]
    edges: f64,
    /// Brightness of a surface that the light grazes, 0 to 1
    #[arg(long, default_value_t = RenderSettings::default().ambient, value_name = "SHARE")]
    ambient: f64,
    /// Colour behind the object: R,G,B from 0 to 1, or one number for a grey
    #[arg(long, default_value = "1", value_delimiter = ',', value_name = "R,G,B")]
    background: Vec<f32>,
    /// Draw the surface's directions as colours, instead of light
    #[arg(long, conflicts_with_all = ["grey", "texture"])]
    normals: bool,
}

impl LookOptions {
    fn settings(&self) -> Result<RenderSettings> {
        let background = match self.background[..] {
            [grey] => [grey; 3],
            [r, g, b] => [r, g, b],
            _ => {
                bail!("--background: expected one number or three, found {}", self.background.len())
            }
        };
        Ok(RenderSettings {
            occlusion: self.occlusion,
            edges: self.edges,
            ambient: self.ambient,
            background,
            ..Default::default()
        })
    }
}

/// How an object is shown.
#[derive(Clone, Debug, Default)]
pub struct ViewSettings {
    pub rig: RigSettings,
    pub render: RenderSettings,
    pub coloring: Coloring,
}

/// What gives the surface its colour.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Coloring {
    /// Everything in the same grey.
    #[default]
    Grey,
    /// The object's own colours, where it has some.
    Own,
    /// The surface's directions.
    Normals,
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
        let settings = ViewSettings {
            rig: self.rig.settings(),
            render: self.look.settings()?,
            coloring: match (self.look.normals, self.grey) {
                (true, _) => Coloring::Normals,
                (false, true) => Coloring::Grey,
                (false, false) => Coloring::Own,
            },
        };
        let views = make_views(&file, &settings, &renderer, &self.output, common)
            .with_context(|| self.mesh.display().to_string())?;
        if let Some(note) = renderer.note().filter(|_| !common.quiet) {
            talk::remark(format_args!("note: {note}"));
        }
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
    settings: &ViewSettings,
    renderer: &Renderer,
    output: &Path,
    common: &Common,
) -> Result<Vec<View>> {
    let ViewSettings { rig: cameras, render: look, coloring } = settings;
    let task = talk::watched(common.quiet);
    let shots = rig(&file.mesh, cameras)?;
    let own = Some(&file.appearance).filter(|own| *coloring == Coloring::Own && !own.is_plain());
    let views = load::with_paint(&file.mesh, own, |paint| {
        let paint = if *coloring == Coloring::Normals { &SurfaceColor::Normals } else { paint };
        renderer.render(&file.mesh, paint, &shots, look, &task)
    })?;
    let colors = match (coloring, own) {
        (Coloring::Normals, _) => "normals",
        (_, Some(_)) => "own",
        (_, None) => "grey",
    };
    let metadata = ViewsMetadata {
        mesh: MeshIdentity::of(&file.mesh),
        width: cameras.size,
        height: cameras.size,
        rig: cameras.to_string(),
        background: look.background.map(|c| c.to_string()).join(","),
        seed: 0,
        more: [
            ("colors".to_owned(), colors.to_owned()),
            ("look".to_owned(), look.to_string()),
            ("renderer".to_owned(), renderer.name()),
        ]
        .into(),
    };
    let vertex_colors: Option<Vec<[u8; 3]>> = own
        .and_then(|own| own.vertex_colors.as_ref())
        .map(|colors| colors.iter().map(|&[r, g, b, _]| [r, g, b]).collect());
    write_views(output, &views, &file.mesh, vertex_colors.as_deref(), &metadata)?;
    Ok(views)
}
