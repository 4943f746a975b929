//! Sheets: pictures in rows and columns with titles, and a legend below.

use std::path::Path;

use semfm::views::View;

use super::canvas::{Canvas, Rect};
use super::stroke_font::{self, Text};
use crate::colors::{color_bytes, weight_colors};
use crate::{Error, Result};

/// Side of each picture in pixels, where we choose it.
pub(super) const PICTURE_SIDE: u32 = 420;

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
    let mut canvas = Sheet { columns: &[], rows: &rows, legend: &[] }.drawn()?;
    let size = Size::of_all(pictures)?;
    for i in 0..pictures.len() {
        let (left, top) = ((i % columns) * size.width + 8, (i / columns) * size.height + 8);
        let (text, baseline) = (format!("{i:03}"), top as f32 + NUMBER);
        Text { text: &text, left: left as f32, baseline, size: NUMBER, color: QUIET }
            .draw(&mut canvas);
    }
    canvas.write_png(path)
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
    /// One colour and what it stands for.
    Swatch([f32; 3], String),
    /// Text alone.
    Note(String),
}

/// Heights of the parts of a sheet, in pixels, and the size of each picture.
struct Layout {
    picture: Size,
    width: usize,
    header: usize,
    strip: usize,
    legend: usize,
    entries: Vec<EntryPlace>,
}

/// Where an entry of the legend stands.
#[derive(Clone, Copy, Debug, PartialEq)]
struct EntryPlace {
    left: f32,
    line: usize,
}

impl Sheet<'_> {
    pub(super) fn write(&self, path: &Path) -> Result<()> {
        self.drawn()?.write_png(path)
    }

    fn drawn(&self) -> Result<Canvas> {
        let layout = self.layout()?;
        let rows = self.rows.len() * (layout.strip + layout.picture.height);
        let height = layout.header + rows + layout.legend;
        let mut canvas = Canvas::new(layout.width, height, [u8::MAX; 3]);
        self.draw_titles(&layout, &mut canvas);
        self.draw_rows(&layout, &mut canvas);
        self.draw_legend(&layout, &mut canvas);
        Ok(canvas)
    }

    fn layout(&self) -> Result<Layout> {
        let picture = Size::of_all(self.rows.iter().flat_map(|row| row.pictures))?;
        let n_columns = self.rows.iter().map(|row| row.pictures.len()).max().unwrap_or(1);
        let width = n_columns * picture.width;
        let entries = self.places_of_entries(width as f32);
        let n_lines = entries.last().map_or(0, |place| place.line + 1);
        let is_untitled = self.rows.iter().all(|row| row.title.is_empty());
        Ok(Layout {
            picture,
            width,
            header: if self.columns.is_empty() { 0 } else { HEADER },
            strip: if is_untitled { 0 } else { STRIP },
            legend: if n_lines == 0 { 0 } else { n_lines * LEGEND + 20 },
            entries,
        })
    }

    fn draw_titles(&self, layout: &Layout, canvas: &mut Canvas) {
        for (column, title) in self.columns.iter().enumerate() {
            let middle = (column as f32 + 0.5) * layout.picture.width as f32;
            let left = middle - stroke_font::width(title, LABEL) / 2.0;
            let baseline = layout.header as f32 - 12.0;
            Text { text: title, left, baseline, size: LABEL, color: QUIET }.draw(canvas);
        }
    }

    fn draw_rows(&self, layout: &Layout, canvas: &mut Canvas) {
        let mut top = layout.header;
        for row in self.rows {
            if layout.strip > 0 {
                draw_rule(canvas, top, layout.width);
                let baseline = top as f32 + 30.0;
                let room = layout.width as f32 - 2.0 * MARGIN;
                let size = TITLE * (room / stroke_font::width(&row.title, TITLE)).min(1.0);
                Text { text: &row.title, left: MARGIN, baseline, size, color: INK }.draw(canvas);
            }
            top += layout.strip;
            for (column, view) in row.pictures.iter().enumerate() {
                canvas.put(&view.rgb, layout.picture.width, column * layout.picture.width, top);
            }
            top += layout.picture.height;
        }
    }

    fn draw_legend(&self, layout: &Layout, canvas: &mut Canvas) {
        let top = layout.header + self.rows.len() * (layout.strip + layout.picture.height);
        if layout.legend > 0 {
            draw_rule(canvas, top, layout.width);
        }
        for (entry, place) in self.legend.iter().zip(&layout.entries) {
            let baseline = (top + LEGEND + 2 + place.line * LEGEND) as f32;
            entry.draw(canvas, place.left, baseline);
        }
    }

    fn places_of_entries(&self, width: f32) -> Vec<EntryPlace> {
        let mut next = EntryPlace { left: MARGIN, line: 0 };
        self.legend
            .iter()
            .map(|entry| {
                let wide = entry.width();
                if next.left > MARGIN && next.left + wide > width - MARGIN {
                    next = EntryPlace { left: MARGIN, line: next.line + 1 };
                }
                let place = next;
                next.left += wide + 1.5 * MARGIN;
                place
            })
            .collect()
    }
}

fn draw_rule(canvas: &mut Canvas, top: usize, width: usize) {
    canvas.fill(Rect { left: 0, top, width, height: 1 }, LINE);
}

/// Pixels of the bar of weights, and of a swatch with the gap behind it.
const BAR: usize = 150;
const SWATCH: f32 = 24.0;

impl Entry {
    fn text(&self) -> &str {
        match self {
            Self::Weights => "0 to 1, counts from the mark on",
            Self::Swatch(_, text) | Self::Note(text) => text,
        }
    }

    fn width(&self) -> f32 {
        let mark = match self {
            Self::Weights => stroke_font::width("weight", LABEL) + BAR as f32 + 20.0,
            Self::Swatch(..) => SWATCH,
            Self::Note(_) => 0.0,
        };
        mark + stroke_font::width(self.text(), LABEL)
    }

    fn draw(&self, canvas: &mut Canvas, mut left: f32, baseline: f32) {
        match self {
            Self::Weights => {
                Text { text: "weight", left, baseline, size: LABEL, color: INK }.draw(canvas);
                left += stroke_font::width("weight", LABEL) + 10.0;
                draw_weight_bar(canvas, left as usize, (baseline - LABEL) as usize);
                left += BAR as f32 + 10.0;
            }
            Self::Swatch(color, _) => {
                let (top, side) = ((baseline - LABEL) as usize, LABEL as usize);
                let square = Rect { left: left as usize, top, width: side, height: side };
                canvas.fill(square, color_bytes(*color));
                left += SWATCH;
            }
            Self::Note(_) => {}
        }
        Text { text: self.text(), left, baseline, size: LABEL, color: INK }.draw(canvas);
    }
}

/// The colours of weights from 0 to 1, with a mark where a vertex begins to count.
fn draw_weight_bar(canvas: &mut Canvas, left: usize, top: usize) {
    let shares: Vec<f64> = (0..BAR).map(|x| x as f64 / (BAR - 1) as f64).collect();
    for (x, color) in weight_colors(&shares).into_iter().enumerate() {
        let column = Rect { left: left + x, top, width: 1, height: LABEL as usize };
        canvas.fill(column, color_bytes(color));
    }
    let (top, height) = (top.saturating_sub(3), LABEL as usize + 6);
    canvas.fill(Rect { left: left + BAR / 2, top, width: 2, height }, INK);
}

/// Width and height of a picture.
#[derive(Clone, Copy, PartialEq)]
struct Size {
    width: usize,
    height: usize,
}

impl Size {
    fn of(view: &View) -> Self {
        Self { width: view.camera.width() as usize, height: view.camera.height() as usize }
    }

    /// The size that all pictures have.
    fn of_all<'a>(pictures: impl IntoIterator<Item = &'a View>) -> Result<Self> {
        let mut sizes = pictures.into_iter().map(Self::of);
        let Some(first) = sizes.next() else {
            return Err(Error::invalid("pictures of a sheet", "at least one", "none"));
        };
        match sizes.find(|&other| other != first) {
            None => Ok(first),
            Some(other) => {
                let expected = format!("{} × {} pixels each", first.width, first.height);
                let found = format!("one of {} × {}", other.width, other.height);
                Err(Error::invalid("pictures of a sheet", expected, found))
            }
        }
    }
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
        assert_eq!(sheet.places_of_entries(200.0)[1], EntryPlace { left: MARGIN, line: 1 });
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
