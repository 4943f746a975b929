//! `semfm-cli views`: the pictures that an encoder is shown.

use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use clap::{Args, ValueEnum};
use semfm::encoder::rendered_views::{Coloring, RenderedObject, ViewSettings};
use semfm::geom::io::{MeshFormat, read_mesh, refuse_input};
use semfm::views::{RenderSettings, Renderer, RendererChoice, RigSettings};
use semfm_show::write_sheet;

use super::Outcome;
use crate::console;
use crate::options::Common;
use crate::output::{OutputFile, check_distinct, check_file};

/// Render the views of an object that an encoder is shown
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  semfm-cli views mug.obj -o mug.views.mcap\n  \
    semfm-embed mug.views.mcap -o mug.emb.mcap --model google/siglip2-base-patch16-224")]
pub struct ViewsCommand {
    #[arg(help = format!("The mesh: {}", MeshFormat::readable_names()))]
    mesh: PathBuf,
    /// Where to write (`NAME.views.mcap`); `-` is stdout
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    #[command(flatten)]
    rig: RigOptions,
    #[command(flatten)]
    look: LookOptions,
    /// What draws: auto takes a graphics processor where one answers, gpu any graphics driver or
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

impl ViewsCommand {
    pub fn run(self, common: &Common) -> Result<Outcome> {
        let mut inputs = vec![self.mesh.as_path()];
        inputs.extend(self.texture.as_deref());
        let output = OutputFile::new(&self.output, &inputs, common)?;
        if let Some(sheet) = &self.sheet {
            check_file(sheet, &inputs)?;
            check_distinct(&self.output, sheet)?;
        }
        let mut file = read_mesh(&self.mesh)?;
        if let Some(texture) = &self.texture {
            file.appearance.attach_image(texture)?;
        }
        if common.verbose {
            let notes = file.appearance.notes.iter();
            notes.for_each(|note| console::message(format_args!("note: {note}")));
        }
        output.check_again()?;
        self.sheet.iter().try_for_each(refuse_input)?;
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
        let task = console::progress(common.quiet);
        let rendered = RenderedObject::new(&file, &settings, &renderer, &task)
            .with_context(|| self.mesh.display().to_string())?;
        rendered.write(output.path())?;
        if let Some(note) = renderer.note().filter(|_| !common.quiet) {
            console::message(format_args!("note: {note}"));
        }
        output.finish(common)?;
        if let Some(sheet) = &self.sheet {
            let columns = (rendered.views.len() as f64).sqrt().ceil() as usize;
            write_sheet(sheet, &rendered.views, columns)?;
            console::data(sheet.display());
        }
        Ok(Outcome::Done)
    }
}
