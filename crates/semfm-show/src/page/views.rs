//! A views file as a group of the page: the mesh, and the pictures with the sides they were taken from.

use std::path::Path;

use image::ImageEncoder;
use semfm::geom::Task;
use semfm::views::View;
use semfm::views::mcap::{ViewsFile, read_mesh};

use super::{Group, Layer, Paint, Panel, Picture};
use crate::{Error, Result};

/// More pictures make a page that nobody scrolls through.
const SHOWN: usize = 64;

pub(super) fn views_group(path: &Path, task: &Task) -> Result<Group> {
    let file = ViewsFile::read(path)?;
    let (mesh, colors) = read_mesh(path)?;
    file.metadata.mesh.check(&mesh, path)?;
    let colors = colors.unwrap_or_else(|| vec![[184; 3]; mesh.n_vertices()]);
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    let metadata = &file.metadata;
    let fact = |name: &str, value: String| (name.to_owned(), value);
    let mut facts = vec![
        fact("views", file.views.len().to_string()),
        fact("size", format!("{} × {}", metadata.width, metadata.height)),
        fact("rig", metadata.rig.clone()),
    ];
    facts.extend(metadata.more.iter().map(|(name, value)| fact(name, value.clone())));
    if file.views.len() > SHOWN {
        facts.push(fact("shown", format!("the first {SHOWN}")));
    }
    let pictures = file.views.iter().take(SHOWN).enumerate();
    let pictures = pictures
        .map(|(i, view)| {
            let png = png(view).map_err(|source| Error::Format {
                path: path.to_owned(),
                place: format!("view {i:03}"),
                expected: "a picture".into(),
                found: source.to_string(),
            })?;
            let towards_eye = -view.camera.camera_from_world().matrix3.row(2);
            Ok(Picture { name: format!("{i:03}"), png, towards_eye })
        })
        .collect::<Result<_>>()?;
    let layer =
        Layer { name: "colours".into(), legend: Vec::new(), paints: vec![Paint::Colors(colors)] };
    Ok(Group {
        panels: vec![Panel::new("object", mesh, None, task)?],
        title: name,
        facts,
        layers: vec![layer],
        source_of: None,
        pictures,
    })
}

fn png(view: &View) -> image::ImageResult<Vec<u8>> {
    let mut png = Vec::new();
    let (width, height) = (view.camera.width(), view.camera.height());
    image::codecs::png::PngEncoder::new(&mut png).write_image(
        &view.rgb,
        width,
        height,
        image::ExtendedColorType::Rgb8,
    )?;
    Ok(png)
}
