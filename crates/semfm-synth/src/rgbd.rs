//! Pictures of a depth camera: colour, depth and which body each pixel shows, from meshes before a camera.

use std::path::Path;

use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};
use semfm_geom::io::{write_atomically, write_json};
use semfm_geom::{Mesh, Pinhole, Task};
use semfm_views::{RenderSettings, SurfaceColor, View, render};

use crate::Result;

/// A thing before the camera.
#[derive(Clone, Copy, Debug)]
pub struct Body<'a> {
    /// Its surface, in the world of the camera, metres.
    pub mesh: &'a Mesh,
    /// sRGB, 0 to 1.
    pub color: [f32; 3],
}

/// What a depth camera sees.
#[derive(Clone, Debug)]
pub struct RgbdPicture {
    view: View,
    /// Number of the body behind each pixel, −1 for none (height × width).
    bodies: Vec<i32>,
}

/// Brightness behind everything.
const BACKGROUND: [f32; 3] = [0.93, 0.93, 0.95];

impl RgbdPicture {
    /// Takes it.
    ///
    /// # Errors
    /// [`Error::Views`](crate::Error::Views) for what cannot be rendered, and for a cancelled task.
    pub fn take(bodies: &[Body<'_>], camera: Pinhole, task: &Task) -> Result<Self> {
        let (mut vertices, mut faces, mut colors) = (Vec::new(), Vec::new(), Vec::new());
        let mut body_of_face = Vec::new();
        for (number, body) in bodies.iter().enumerate() {
            let first = vertices.len() as u32;
            vertices.extend_from_slice(body.mesh.vertices());
            faces.extend(body.mesh.faces().iter().map(|face| face.map(|v| v + first)));
            colors.resize(vertices.len(), body.color);
            body_of_face.resize(faces.len(), number as i32);
        }
        let mesh = Mesh::new(vertices, faces)?;
        let settings = RenderSettings { background: BACKGROUND, ..Default::default() };
        let colors = SurfaceColor::Vertices(&colors);
        let view = render(&mesh, &colors, &[camera], &settings, task)?.remove(0);
        let of_face = |&face: &i32| {
            usize::try_from(face)
                .ok()
                .and_then(|face| body_of_face.get(face))
                .copied()
                .unwrap_or(-1)
        };
        let bodies = view.triangles.iter().map(of_face).collect();
        Ok(Self { view, bodies })
    }

    /// The number of the body behind each pixel, −1 for none (height × width).
    pub fn bodies(&self) -> &[i32] {
        &self.bodies
    }

    /// Writes the colours (PNG).
    ///
    /// # Errors
    /// [`Error::Geom`](crate::Error::Geom) where the file cannot be written.
    pub fn write_color(&self, path: &Path) -> Result<()> {
        self.write_png(path, &self.view.rgb, ExtendedColorType::Rgb8)
    }

    /// Writes the depth as cameras give it: millimetres in a grey PNG of 16 bits, 0 where nothing is.
    ///
    /// # Errors
    /// As [`RgbdPicture::write_color`].
    pub fn write_depth(&self, path: &Path) -> Result<()> {
        let millimetres = self.view.depth.iter().map(|&z| match z.is_finite() {
            true => (1e3 * f64::from(z)).round().clamp(0.0, 65_534.0) as u16,
            false => 0,
        });
        let bytes: Vec<u8> = millimetres.flat_map(u16::to_ne_bytes).collect();
        self.write_png(path, &bytes, ExtendedColorType::L16)
    }

    /// Writes the mask of a body: white where it is seen.
    ///
    /// # Errors
    /// As [`RgbdPicture::write_color`].
    pub fn write_mask(&self, path: &Path, body: usize) -> Result<()> {
        let is_seen = |&seen: &i32| if seen == body as i32 { u8::MAX } else { 0 };
        let bytes: Vec<u8> = self.bodies.iter().map(is_seen).collect();
        self.write_png(path, &bytes, ExtendedColorType::L8)
    }

    /// Writes the camera as calibrations have it: the centre of the first pixel is at (0, 0).
    ///
    /// # Errors
    /// As [`RgbdPicture::write_color`].
    pub fn write_intrinsics(&self, path: &Path) -> Result<()> {
        let camera = &self.view.camera;
        let (cx, cy) = (camera.cx() - 0.5, camera.cy() - 0.5);
        let intrinsics =
            serde_json::json!({ "fx": camera.fx(), "fy": camera.fy(), "cx": cx, "cy": cy });
        Ok(write_json(path, &intrinsics)?)
    }

    fn write_png(&self, path: &Path, bytes: &[u8], color: ExtendedColorType) -> Result<()> {
        let (width, height) = (self.view.camera.width(), self.view.camera.height());
        Ok(write_atomically(path, |out| {
            let encoder = PngEncoder::new(out);
            encoder.write_image(bytes, width, height, color).map_err(std::io::Error::other)
        })?)
    }
}
