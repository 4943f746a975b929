//! `NAME.views.mcap`: rendered views with cameras, depth and triangles, for encoders and viewers.

use std::borrow::Borrow;
use std::collections::BTreeMap;
use std::path::Path;

use foxglove::messages::{CompressedImage, RawImage};
use semfm_geom::io::refuse_input;
use semfm_geom::{Mesh, Pinhole};

use super::cameras::{Cameras, check_camera};
use super::decode::{Mismatch, check_count, decode, insert_once, message_error, topic_error};
use super::messages::{
    MeshEntity, camera_calibration, camera_transform, decode_png, picture, timestamp,
};
use super::metadata::{METADATA_NAME, ViewsMetadata};
use super::reader::{Message, read_messages};
use super::topics::{MESH, OBJECT, TF, frame, parse_topic, time_of, topic};
use super::writer::{ChunkCompression, McapWriter, write_mcap};
use crate::{Error, Result, View};

/// The rendered views of an object.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewsFile {
    /// Of which mesh, and how they were rendered.
    pub metadata: ViewsMetadata,
    /// The views, as numbered.
    pub views: Vec<View>,
}

/// Writes a views file whole or not at all; the mesh goes with it for viewers, grey or with the
/// colours given (one RGB per vertex).
///
/// # Errors
/// [`Error::OtherMesh`] where the metadata name another mesh, [`Error::Invalid`] for a view whose
/// arrays do not have the size of its camera or that names a triangle the mesh has not,
/// [`Error::Io`]; [`Error::Geom`] for a file that was read as an input
/// ([`refuse_input`]).
pub fn write_views<V: Borrow<View>>(
    path: &Path,
    views: &[V],
    mesh: &Mesh,
    colors: Option<&[[u8; 3]]>,
    metadata: &ViewsMetadata,
) -> Result<()> {
    refuse_input(path)?;
    metadata.check_mesh(mesh, path)?;
    if views.is_empty() {
        return Err(Error::invalid("views", "at least one", "none"));
    }
    for (view, rendered) in views.iter().enumerate() {
        check_view(view, rendered.borrow(), metadata)?;
    }
    let shown = MeshEntity {
        frame_id: OBJECT,
        name: "object",
        vertices: mesh.vertices(),
        faces: mesh.faces(),
        colors,
    };
    let shown = shown.update(MESH)?;
    write_mcap(path, "", ChunkCompression::Lz4, |file| {
        file.metadata(METADATA_NAME, metadata.entries(views.len()))?;
        file.log(MESH, 0, &shown)?;
        for (view, rendered) in views.iter().enumerate() {
            write_view(file, view, rendered.borrow())?;
        }
        Ok(())
    })
}

impl ViewsFile {
    /// Reads all views of a file.
    ///
    /// # Errors
    /// [`Error::Container`] for a damaged file; [`Error::Format`] with topic and message for
    /// anything missing, of the wrong size, or of another encoding than ours.
    pub fn read(path: &Path) -> Result<Self> {
        let Stored { metadata, n_views, pictures, cameras } = gather(path, None)?;
        check_count(path, "/views/NNN/image", n_views, pictures.images.len())?;
        let size = (metadata.width, metadata.height);
        let cameras = cameras.finish(path, n_views, size)?;
        let views = (0..n_views).zip(cameras);
        let views = views.map(|(view, camera)| pictures.view(path, view, camera, &metadata));
        Ok(Self { views: views.collect::<Result<_>>()?, metadata })
    }
}

/// One view of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct SingleView {
    /// What the file says of all its views.
    pub metadata: ViewsMetadata,
    /// The view.
    pub view: View,
}

/// Reads one view of a file, as in `V.views.mcap#003`, without keeping the others.
///
/// # Errors
/// [`Error::Container`] and [`Error::Format`] as in [`ViewsFile::read`]; [`Error::Invalid`] where the
/// file has no such view.
pub fn read_view(path: &Path, view: usize) -> Result<SingleView> {
    let Stored { metadata, n_views, pictures, cameras } = gather(path, Some(view))?;
    if view >= n_views {
        let expected = format!("000 to {:03} in {}", n_views.saturating_sub(1), path.display());
        return Err(Error::invalid("view", expected, format!("{view:03}")));
    }
    let camera = cameras.camera(path, view, (metadata.width, metadata.height))?;
    let view = pictures.view(path, view, camera, &metadata)?;
    Ok(SingleView { metadata, view })
}

/// What a file holds, with pictures and cameras as they stand in it.
struct Stored {
    metadata: ViewsMetadata,
    n_views: usize,
    pictures: Pictures,
    cameras: Cameras,
}

/// The pictures of a file, encoded as they are in it.
#[derive(Default)]
struct Pictures {
    images: BTreeMap<usize, CompressedImage>,
    depths: BTreeMap<usize, RawImage>,
    triangles: BTreeMap<usize, RawImage>,
}

fn gather(path: &Path, only: Option<usize>) -> Result<Stored> {
    let mut cameras = Cameras::default();
    let mut pictures = Pictures::default();
    let contents = read_messages(path, |message| match parse_topic(&message.channel.topic) {
        Some((view, _)) if only.is_some_and(|only| only != view) => Ok(()),
        Some((view, "camera")) => cameras.calibration(path, view, &message),
        Some((view, what)) => pictures.take(path, view, what, &message),
        None if message.channel.topic == TF => cameras.transform(path, &message),
        None => Ok(()),
    })?;
    let (metadata, n_views) = ViewsMetadata::read(path, &contents.metadata)?;
    Ok(Stored { metadata, n_views, pictures, cameras })
}

impl Pictures {
    fn take(&mut self, path: &Path, view: usize, what: &str, message: &Message<'_>) -> Result<()> {
        match what {
            "image" => {
                let image: CompressedImage = decode(path, message, "foxglove.CompressedImage")?;
                if image.format != "png" {
                    let found = format!("`{}`", image.format);
                    return Err(message_error(path, message, "the format `png`", found));
                }
                insert_once(&mut self.images, view, image, path, message)
            }
            "depth" => {
                let image = packed_image(path, message, "32FC1")?;
                insert_once(&mut self.depths, view, image, path, message)
            }
            "triangles" => {
                let image = packed_image(path, message, "32SC1")?;
                insert_once(&mut self.triangles, view, image, path, message)
            }
            _ => Ok(()),
        }
    }

    /// Decodes one view and checks that its pictures belong together.
    fn view(
        &self,
        path: &Path,
        view: usize,
        camera: Pinhole,
        metadata: &ViewsMetadata,
    ) -> Result<View> {
        let size = (camera.width(), camera.height());
        let rgb = {
            let topic = topic(view, "image");
            let image = self
                .images
                .get(&view)
                .ok_or_else(|| topic_error(path, &topic, "one message", "none"))?;
            decode_png(&image.data, size).map_err(|mismatch| mismatch.on_topic(path, &topic))?
        };
        let depth = numbers(path, &self.depths, view, "depth", size, f32::from_le_bytes)?;
        let triangles =
            numbers(path, &self.triangles, view, "triangles", size, i32::from_le_bytes)?;
        let rendered = View { camera, rgb, depth, triangles };
        check_pixels(&rendered, metadata.mesh.n_triangles)
            .map_err(|mismatch| mismatch.on_topic(path, &topic(view, "depth")))?;
        Ok(rendered)
    }
}

/// A raw image of four bytes a pixel, without padding between its rows.
fn packed_image(path: &Path, message: &Message<'_>, encoding: &str) -> Result<RawImage> {
    let image: RawImage = decode(path, message, "foxglove.RawImage")?;
    let length = u64::from(image.step) * u64::from(image.height);
    let is_packed = u64::from(image.step) == 4 * u64::from(image.width);
    if image.encoding != encoding || !is_packed || length != image.data.len() as u64 {
        let RawImage { width, height, step, encoding: found, data, .. } = &image;
        let expected = format!("a packed {encoding} image");
        let found = format!("{width} × {height} {found}, step {step}, {} bytes", data.len());
        return Err(message_error(path, message, &expected, found));
    }
    Ok(image)
}

/// The pixels of a raw image of the camera's size.
fn numbers<T>(
    path: &Path,
    images: &BTreeMap<usize, RawImage>,
    view: usize,
    what: &str,
    size: (u32, u32),
    number: impl Fn([u8; 4]) -> T,
) -> Result<Vec<T>> {
    let topic = topic(view, what);
    let image =
        images.get(&view).ok_or_else(|| topic_error(path, &topic, "one message", "none"))?;
    if (image.width, image.height) != size {
        let expected = format!("{} × {} pixels, as its camera", size.0, size.1);
        let found = format!("{} × {}", image.width, image.height);
        return Err(topic_error(path, &topic, &expected, found));
    }
    Ok(image.data.as_chunks::<4>().0.iter().map(|&bytes| number(bytes)).collect())
}

/// Depth and triangles agree on what is background, and name triangles that exist.
fn check_pixels(view: &View, n_triangles: usize) -> std::result::Result<(), Mismatch> {
    let mut pixels = view.depth.iter().zip(&view.triangles);
    let wrong = pixels.position(|(&depth, &triangle)| match triangle {
        -1 => depth != f32::INFINITY,
        0.. => triangle as usize >= n_triangles || !(depth.is_finite() && depth > 0.0),
        _ => true,
    });
    match wrong {
        None => Ok(()),
        Some(pixel) => {
            let width = view.camera.width() as usize;
            let (row, col) = (pixel / width, pixel % width);
            let (depth, triangle) = (view.depth[pixel], view.triangles[pixel]);
            let expected = format!(
                "a triangle below {n_triangles} and a positive depth, or −1 and an infinite one"
            );
            let found = format!("triangle {triangle} at depth {depth}, row {row}, column {col}");
            Err(Mismatch::new(expected, found))
        }
    }
}

fn check_view(view: usize, rendered: &View, metadata: &ViewsMetadata) -> Result<()> {
    let what = format!("view {view:03}");
    check_camera(view, &rendered.camera)?;
    let (width, height) = (rendered.camera.width(), rendered.camera.height());
    if (width, height) != (metadata.width, metadata.height) {
        let expected = format!("{} × {} pixels", metadata.width, metadata.height);
        return Err(Error::invalid(what, expected, format!("{width} × {height}")));
    }
    let n_pixels = width as usize * height as usize;
    let lengths = [rendered.rgb.len() / 3, rendered.depth.len(), rendered.triangles.len()];
    if !rendered.rgb.len().is_multiple_of(3) || lengths != [n_pixels; 3] {
        let expected = format!("{n_pixels} pixels in rgb, depth and triangles");
        let [rgb, depth, triangles] = lengths;
        let found = format!("{rgb} in rgb, {depth} in depth, {triangles} in triangles");
        return Err(Error::invalid(what, expected, found));
    }
    check_pixels(rendered, metadata.mesh.n_triangles).map_err(|mismatch| mismatch.of_argument(what))
}

fn write_view(file: &mut McapWriter<'_>, view: usize, rendered: &View) -> Result<()> {
    let camera = &rendered.camera;
    let time = time_of(view);
    file.log(TF, time, &camera_transform(OBJECT, frame(view), time, camera))?;
    file.log(&topic(view, "camera"), time, &camera_calibration(frame(view), time, camera))?;
    file.log(&topic(view, "image"), time, &picture(frame(view), time, rendered)?)?;
    let depth = rendered.depth.iter().flat_map(|z| z.to_le_bytes()).collect();
    file.log(&topic(view, "depth"), time, &raw_image(view, camera, "32FC1", depth))?;
    let triangles = rendered.triangles.iter().flat_map(|t| t.to_le_bytes()).collect();
    file.log(&topic(view, "triangles"), time, &raw_image(view, camera, "32SC1", triangles))
}

/// An image of four bytes a pixel.
fn raw_image(view: usize, camera: &Pinhole, encoding: &str, data: Vec<u8>) -> RawImage {
    RawImage {
        timestamp: Some(timestamp(time_of(view))),
        frame_id: frame(view),
        width: camera.width(),
        height: camera.height(),
        encoding: encoding.to_owned(),
        step: 4 * camera.width(),
        data: data.into(),
    }
}
