//! An sRGB image that is drawn on: rectangles, pictures and smooth lines.

use std::ops::Range;
use std::path::Path;

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use semfm::geom::io::{refuse_input, write_atomically};

use crate::Result;

/// An sRGB image being drawn.
pub(super) struct Canvas {
    pub width: usize,
    height: usize,
    rgb: Vec<u8>,
}

/// A rectangle of whole pixels.
#[derive(Clone, Copy)]
pub(super) struct Rect {
    pub left: usize,
    pub top: usize,
    pub width: usize,
    pub height: usize,
}

impl Canvas {
    /// An image of one colour.
    pub(super) fn new(width: usize, height: usize, color: [u8; 3]) -> Self {
        Self { width, height, rgb: color.repeat(width * height) }
    }

    /// A picture of this width to be drawn on.
    pub(super) fn of_picture(rgb: Vec<u8>, width: usize) -> Self {
        Self { width, height: rgb.len() / (3 * width), rgb }
    }

    /// The picture as it is now.
    pub(super) fn into_picture(self) -> Vec<u8> {
        self.rgb
    }

    fn offset(&self, x: usize, y: usize) -> usize {
        3 * (y * self.width + x)
    }

    #[cfg(test)]
    pub(super) fn at(&self, x: usize, y: usize) -> [u8; 3] {
        let at = self.offset(x, y);
        [self.rgb[at], self.rgb[at + 1], self.rgb[at + 2]]
    }

    /// Fills a rectangle; what lies outside is cut off.
    pub(super) fn fill(&mut self, rect: Rect, color: [u8; 3]) {
        let right = (rect.left + rect.width).min(self.width);
        for row in rect.top..(rect.top + rect.height).min(self.height) {
            let (from, to) = (self.offset(rect.left.min(right), row), self.offset(right, row));
            self.rgb[from..to].as_chunks_mut::<3>().0.fill(color);
        }
    }

    /// Puts an image of this width at a corner.
    pub(super) fn put(&mut self, rgb: &[u8], width: usize, left: usize, top: usize) {
        for (row, line) in rgb.chunks_exact(3 * width).enumerate() {
            let start = self.offset(left, top + row);
            self.rgb[start..start + line.len()].copy_from_slice(line);
        }
    }

    /// Draws a line through points with round ends, its edge smooth over one pixel.
    pub(super) fn line(&mut self, points: &[[f32; 2]], thickness: f32, color: [u8; 3]) {
        let margin = thickness / 2.0 + 1.0;
        for y in pixels_along(1, points, margin, self.height) {
            for x in pixels_along(0, points, margin, self.width) {
                let p = [x as f32 + 0.5, y as f32 + 0.5];
                let distance = points.windows(2).map(|ends| distance(p, ends[0], ends[1]));
                let distance = distance.fold(f32::INFINITY, f32::min);
                let cover = (thickness / 2.0 + 0.5 - distance).clamp(0.0, 1.0);
                let at = self.offset(x, y);
                for (channel, ink) in self.rgb[at..at + 3].iter_mut().zip(color) {
                    let (under, over) = (f32::from(*channel), f32::from(ink));
                    *channel = (under + cover * (over - under)).round() as u8;
                }
            }
        }
    }

    /// Writes the image whole or not at all.
    ///
    /// # Errors
    /// [`semfm::geom::Error::Io`].
    pub(super) fn write_png(&self, path: &Path) -> Result<()> {
        let (width, height) = (self.width as u32, self.height as u32);
        refuse_input(path)?;
        write_atomically(path, |out| {
            // Time counts more than size: most pictures are looked at once.
            PngEncoder::new_with_quality(out, CompressionType::Fast, FilterType::Up)
                .write_image(&self.rgb, width, height, ExtendedColorType::Rgb8)
                .map_err(std::io::Error::other)
        })?;
        Ok(())
    }
}

/// The pixels that a line may touch along an axis, from 0 to `limit`.
fn pixels_along(axis: usize, points: &[[f32; 2]], margin: f32, limit: usize) -> Range<usize> {
    let values = points.iter().map(|p| p[axis]);
    let low = values.clone().fold(f32::INFINITY, f32::min) - margin;
    let high = values.fold(f32::NEG_INFINITY, f32::max) + margin;
    (low.max(0.0) as usize)..((high.max(0.0).ceil() as usize).min(limit))
}

/// From a point to the piece of line between two:
/// |p − a − t (b − a)| with t = (p − a)·(b − a) / |b − a|², held to 0..1.
fn distance(p: [f32; 2], a: [f32; 2], b: [f32; 2]) -> f32 {
    let (along, to) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
    let length = along[0] * along[0] + along[1] * along[1];
    let t = (along[0] * to[0] + along[1] * to[1]) / length.max(f32::MIN_POSITIVE);
    let t = t.clamp(0.0, 1.0);
    (to[0] - t * along[0]).hypot(to[1] - t * along[1])
}
