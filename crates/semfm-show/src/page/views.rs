//! A views file as a group of the page: the mesh, and the pictures with the sides they were taken from.

use std::path::Path;

use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};
use semfm::Task;
use semfm::geom::io::FormatError;
use semfm::views::View;
use semfm::views::mcap::{ViewsFile, read_mesh};

use super::group::{Fact, Group, Layer, Panel, Picture};
use super::mesh::{GREY, file_name};
use crate::Result;

/// More pictures make a page that nobody scrolls through.
const N_SHOWN: usize = 64;

/// # Errors
/// [`Error::Semfm`](crate::Error::Semfm) for a damaged file or one of another mesh.
pub(super) fn views_group(path: &Path, task: &Task) -> Result<Group> {
    let file = ViewsFile::read(path)?;
    let (mesh, colors) = read_mesh(path)?;
    file.metadata.check_mesh(&mesh, path)?;
    let colors = colors.unwrap_or_else(|| vec![GREY; mesh.n_vertices()]);
    let shown = file.views.iter().take(N_SHOWN).enumerate();
    let pictures = shown.map(|(i, view)| picture(path, i, view)).collect::<Result<_>>()?;
    Ok(Group {
        title: file_name(path),
        facts: facts(&file),
        panels: vec![Panel::new("object", mesh, None, task)?],
        layers: vec![Layer::own_colors(colors)],
        notes: Vec::new(),
        source_of: None,
        pictures,
        hands: None,
        motion: None,
    })
}

fn facts(file: &ViewsFile) -> Vec<Fact> {
    let metadata = &file.metadata;
    let mut facts = vec![
        Fact::new("views", file.views.len()),
        Fact::new("size", format!("{} × {}", metadata.width, metadata.height)),
        Fact::new("rig", &metadata.rig),
    ];
    facts.extend(metadata.more.iter().map(|(name, value)| Fact::new(name, value)));
    if file.views.len() > N_SHOWN {
        facts.push(Fact::new("shown", format!("the first {N_SHOWN}")));
    }
    facts
}

fn picture(path: &Path, i: usize, view: &View) -> Result<Picture> {
    let png = png(view).map_err(|source| {
        FormatError::new(path, format!("view {i:03}"), "a picture", source.to_string())
    })?;
    let towards_eye = -view.camera.camera_from_world().matrix3.row(2);
    Ok(Picture { name: format!("{i:03}"), png, towards_eye })
}

fn png(view: &View) -> image::ImageResult<Vec<u8>> {
    let mut png = Vec::new();
    let (width, height) = (view.camera.width(), view.camera.height());
    PngEncoder::new(&mut png).write_image(&view.rgb, width, height, ExtendedColorType::Rgb8)?;
    Ok(png)
}
