//! Sheets: pictures in rows and columns with titles, and a legend below.

use std::path::Path;

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use semfm::geom::io::write_atomically;
use semfm::views::View;

use semfm::weight_colors::{color_bytes, weight_colors};

use super::stroke_font;
use crate::{Error, Result};

const INK: [u8; 3] = [29, 36, 48];
const QUIET: [u8; 3] = [91, 102, 117];
const LINE: [u8; 3] = [217, 222, 230];
/// Heights in pixels: of capitals, of the strip above each row, of the titles.
const TITLE: f32 = 17.0;
const LABEL: f32 = 14.0;
const NUMBER: f32 = 10.0;
const STRIP: usize = 46;
const HEADER: usize = 40;
/// Of a line of the legend.
const LEGEND: usize = 28;
const MARGIN: f32 = 18.0;

/// Writes pictures of one size as one PNG, in rows of `columns` (at least 1), each with its number
/// from 000 in the corner; whole or not at all.
///
/// # Errors
/// [`Error::Invalid`] for no pictures or pictures of several sizes, [`semfm::geom::Error::Io`].
pub fn write_sheet(path: &Path, pictures: &[View], columns: usize) -> Result<()> {
    let columns = columns.clamp(1, pictures.len().max(1));
    let rows: Vec<Row<'_>> =
        pictures.chunks(columns).map(|pictures| Row { title: String::new(), pictures }).collect();
    let mut pixels = Sheet { columns: &[], rows: &rows, legend: &[] }.drawn()?;
    let (width, height) = size_of(pictures)?;
    for i in 0..pictures.len() {
        let corner = ((i % columns) * width + 8, (i / columns) * height + 8);
        let foot = (corner.0 as f32, corner.1 as f32 + NUMBER);
        stroke_font::draw(&mut pixels, foot, NUMBER, QUIET, &format!("{i:03}"));
    }
    pixels.write_png(path)
}

/// What a sheet shows.
pub(super) struct Sheet<'a> {
    /// Titles of the columns; none for pictures edge to edge.
    pub columns: &'a [&'a str],
    pub rows: &'a [Row<'a>],
    /// Left to right, wrapped where a line is full.
    pub legend: &'a [Entry],
}

/// Pictures side by side.
pub(super) struct Row<'a> {
    pub title: String,
    pub pictures: &'a [View],
}

/// A line of the legend.
pub(super) enum Entry {
    /// The colours of weights from 0 to 1.
    Weights,
    /// One colour and what it means.
    Swatch([f32; 3], String),
    /// Words alone.
    Words(String),
}

impl Sheet<'_> {
    pub(super) fn write(&self, path: &Path) -> Result<()> {
        self.drawn()?.write_png(path)
    }

    fn drawn(&self) -> Result<Pixels> {
        let all: Vec<&View> = self.rows.iter().flat_map(|row| row.pictures).collect();
        let (width, height) = size_of(all.iter().copied())?;
        let n_columns = self.rows.iter().map(|row| row.pictures.len()).max().unwrap_or(1);
        let total_width = n_columns * width;
        let header = if self.columns.is_empty() { 0 } else { HEADER };
        let strip = if self.rows.iter().all(|row| row.title.is_empty()) { 0 } else { STRIP };
        let entries = self.places_of_entries(total_width as f32);
        let n_lines = entries.last().map_or(0, |&(_, line)| line + 1);
        let legend = if n_lines == 0 { 0 } else { n_lines * LEGEND + 20 };
        let total_height = header + self.rows.len() * (strip + height) + legend;
        let mut pixels = Pixels::new(total_width, total_height, [u8::MAX; 3]);

        for (column, title) in self.columns.iter().enumerate() {
            let middle = (column as f32 + 0.5) * width as f32;
            let left = middle - stroke_font::width(title, LABEL) / 2.0;
            stroke_font::draw(&mut pixels, (left, header as f32 - 12.0), LABEL, QUIET, title);
        }
        let mut top = header;
        for row in self.rows {
            if strip > 0 {
                pixels.fill((0, top), (total_width, 1), LINE);
                let foot = (MARGIN, top as f32 + 30.0);
                stroke_font::draw(&mut pixels, foot, TITLE, INK, &row.title);
            }
            top += strip;
            for (column, view) in row.pictures.iter().enumerate() {
                pixels.put(&view.rgb, width, (column * width, top));
            }
            top += height;
        }
        if legend > 0 {
            pixels.fill((0, top), (total_width, 1), LINE);
        }
        for (entry, &(left, line)) in self.legend.iter().zip(&entries) {
            let foot = (top + LEGEND + 2 + line * LEGEND) as f32;
            entry.draw(&mut pixels, (left, foot));
        }
        Ok(pixels)
    }

    /// Left edge and line of each entry.
    fn places_of_entries(&self, width: f32) -> Vec<(f32, usize)> {
        let (mut left, mut line) = (MARGIN, 0);
        self.legend
            .iter()
            .map(|entry| {
                let wide = entry.width();
                if left > MARGIN && left + wide > width - MARGIN {
                    (left, line) = (MARGIN, line + 1);
                }
                let place = (left, line);
                left += wide + 1.5 * MARGIN;
                place
            })
            .collect()
    }
}

/// Pixels of the bar of weights, and of a swatch with the gap behind it.
const BAR: usize = 150;
const SWATCH: f32 = 24.0;

impl Entry {
    fn words(&self) -> &str {
        match self {
            Self::Weights => "0 to 1, counts from the mark on",
            Self::Swatch(_, words) | Self::Words(words) => words,
        }
    }

    fn width(&self) -> f32 {
        let mark = match self {
            Self::Weights => stroke_font::width("weight", LABEL) + BAR as f32 + 20.0,
            Self::Swatch(..) => SWATCH,
            Self::Words(_) => 0.0,
        };
        mark + stroke_font::width(self.words(), LABEL)
    }

    fn draw(&self, pixels: &mut Pixels, (mut left, foot): (f32, f32)) {
        match self {
            Self::Weights => {
                stroke_font::draw(pixels, (left, foot), LABEL, INK, "weight");
                left += stroke_font::width("weight", LABEL) + 10.0;
                let corner = (left as usize, (foot - LABEL) as usize);
                let shares: Vec<f64> = (0..BAR).map(|x| x as f64 / (BAR - 1) as f64).collect();
                for (x, color) in weight_colors(&shares).into_iter().enumerate() {
                    pixels.fill((corner.0 + x, corner.1), (1, LABEL as usize), color_bytes(color));
                }
                let middle = (corner.0 + BAR / 2, corner.1.saturating_sub(3));
                pixels.fill(middle, (2, LABEL as usize + 6), INK);
                left += BAR as f32 + 10.0;
            }
            Self::Swatch(color, _) => {
                let side = LABEL as usize;
                pixels.fill(
                    (left as usize, (foot - LABEL) as usize),
                    (side, side),
                    color_bytes(*color),
                );
                left += SWATCH;
            }
            Self::Words(_) => {}
        }
        stroke_font::draw(pixels, (left, foot), LABEL, INK, self.words());
    }
}

/// Width and height that all pictures have.
fn size_of<'a>(pictures: impl IntoIterator<Item = &'a View>) -> Result<(usize, usize)> {
    let size = |view: &View| (view.camera.width() as usize, view.camera.height() as usize);
    let mut sizes = pictures.into_iter().map(size);
    let Some(first) = sizes.next() else {
        return Err(Error::invalid("pictures of a sheet", "at least one", "none"));
    };
    match sizes.find(|&other| other != first) {
        None => Ok(first),
        Some(other) => {
            let expected = format!("{} × {} pixels each", first.0, first.1);
            Err(Error::invalid("pictures of a sheet", expected, format!("{other:?}")))
        }
    }
}

/// An sRGB image being drawn.
pub(super) struct Pixels {
    pub width: usize,
    height: usize,
    rgb: Vec<u8>,
}

impl Pixels {
    pub(super) fn new(width: usize, height: usize, color: [u8; 3]) -> Self {
        Self { width, height, rgb: color.repeat(width * height) }
    }

    fn place(&self, x: usize, y: usize) -> usize {
        3 * (y * self.width + x)
    }

    #[cfg(test)]
    pub(super) fn at(&self, x: usize, y: usize) -> [u8; 3] {
        let at = self.place(x, y);
        [self.rgb[at], self.rgb[at + 1], self.rgb[at + 2]]
    }

    /// Fills a rectangle; what lies outside is cut off.
    fn fill(&mut self, (x, y): (usize, usize), (width, height): (usize, usize), color: [u8; 3]) {
        let right = (x + width).min(self.width);
        for row in y..(y + height).min(self.height) {
            let (from, to) = (self.place(x.min(right), row), self.place(right, row));
            self.rgb[from..to].as_chunks_mut::<3>().0.fill(color);
        }
    }

    /// Puts an image of this width at a corner.
    fn put(&mut self, rgb: &[u8], width: usize, (x, y): (usize, usize)) {
        for (row, line) in rgb.chunks_exact(3 * width).enumerate() {
            let start = self.place(x, y + row);
            self.rgb[start..start + line.len()].copy_from_slice(line);
        }
    }

    /// Draws a line through points with round ends, its edge smooth over one pixel.
    pub(super) fn line(&mut self, points: &[[f32; 2]], thickness: f32, color: [u8; 3]) {
        let reach = thickness / 2.0 + 1.0;
        let range = |k: usize, limit: usize| {
            let values = points.iter().map(|p| p[k]);
            let low = values.clone().fold(f32::INFINITY, f32::min) - reach;
            let high = values.fold(f32::NEG_INFINITY, f32::max) + reach;
            (low.max(0.0) as usize)..((high.max(0.0).ceil() as usize).min(limit))
        };
        for y in range(1, self.height) {
            for x in range(0, self.width) {
                let p = [x as f32 + 0.5, y as f32 + 0.5];
                let distance = points.windows(2).map(|ends| distance(p, ends[0], ends[1]));
                let distance = distance.fold(f32::INFINITY, f32::min);
                let cover = (thickness / 2.0 + 0.5 - distance).clamp(0.0, 1.0);
                let at = self.place(x, y);
                for (channel, ink) in self.rgb[at..at + 3].iter_mut().zip(color) {
                    let (under, over) = (f32::from(*channel), f32::from(ink));
                    *channel = (under + cover * (over - under)).round() as u8;
                }
            }
        }
    }

    fn write_png(&self, path: &Path) -> Result<()> {
        let (width, height) = (self.width as u32, self.height as u32);
        write_atomically(path, |out| {
            PngEncoder::new_with_quality(out, CompressionType::Default, FilterType::Adaptive)
                .write_image(&self.rgb, width, height, ExtendedColorType::Rgb8)
                .map_err(std::io::Error::other)
        })?;
        Ok(())
    }
}

/// From a point to the piece of line between two.
fn distance(p: [f32; 2], a: [f32; 2], b: [f32; 2]) -> f32 {
    let (along, to) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
    let length = along[0] * along[0] + along[1] * along[1];
    let t = (along[0] * to[0] + along[1] * to[1]) / length.max(f32::MIN_POSITIVE);
    let t = t.clamp(0.0, 1.0);
    (to[0] - t * along[0]).hypot(to[1] - t * along[1])
}

#[cfg(test)]
mod tests {
    use semfm::geom::math::DAffine3;
    use semfm::geom::{Intrinsics, Pinhole};

    use super::*;

    fn view(side: u32, color: u8) -> View {
        let n = (side * side) as usize;
        let (f, c) = (f64::from(side), f64::from(side) / 2.0);
        let camera = Pinhole::with_pixel_centres_at_half(
            Intrinsics { width: side, height: side, fx: f, fy: f, cx: c, cy: c },
            DAffine3::IDENTITY,
        )
        .unwrap();
        View { camera, rgb: vec![color; 3 * n], depth: vec![1.0; n], triangles: vec![0; n] }
    }

    #[test]
    fn pictures_stand_where_they_belong_and_titles_above_them() {
        let pictures = [view(100, 10), view(100, 20)];
        let rows = [
            Row { title: "source".into(), pictures: &pictures },
            Row { title: "target".into(), pictures: &pictures },
        ];
        let legend = [Entry::Weights, Entry::Swatch([0.0, 1.0, 0.0], "an anchor".into())];
        let sheet = Sheet { columns: &["a", "b"], rows: &rows, legend: &legend };
        let drawn = sheet.drawn().unwrap();
        assert_eq!(drawn.width, 200);
        for (row, top) in [HEADER + STRIP, HEADER + 2 * STRIP + 100].into_iter().enumerate() {
            assert_eq!(drawn.at(50, top + 50), [10; 3], "row {row}");
            assert_eq!(drawn.at(150, top + 50), [20; 3], "row {row}");
        }
        // The second entry does not fit beside the first, and stands below it.
        assert_eq!(sheet.places_of_entries(200.0)[1], (MARGIN, 1));
    }

    #[test]
    fn pictures_of_several_sizes_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sheet.png");
        assert!(write_sheet(&path, &[], 2).is_err());
        assert!(write_sheet(&path, &[view(8, 0), view(9, 0)], 2).is_err());
        write_sheet(&path, &[view(40, 0), view(40, 9), view(40, 5)], 2).unwrap();
        assert_eq!(image::image_dimensions(&path).unwrap(), (80, 80));
    }
}
