//! Plots as SVG text. Sizes are pixels of an unscaled page; the page's style sheet chooses the font.

pub(super) mod against_views;
pub(super) mod calibration;
pub(super) mod error_curves;
pub(super) mod forest;

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// What the library reports.
pub(super) type DrawError = DrawingAreaErrorKind<std::io::Error>;
type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

const FONT: &str = "system-ui, 'DejaVu Sans', sans-serif";
/// The SVG backend writes 1/1.24 of what it is told.
const SVG_FONT_SCALE: f64 = 1.24;
const TEXT_INK: RGBColor = RGBColor(40, 45, 50);
const SOFT_INK: RGBColor = RGBColor(120, 128, 136);
const GRID: RGBColor = RGBColor(228, 231, 234);

/// A colour of ours in the library's words.
pub(super) fn ink([r, g, b]: [u8; 3]) -> RGBColor {
    RGBColor(r, g, b)
}

/// An SVG element of this size.
fn svg(
    size: (u32, u32),
    paint: impl FnOnce(&Area<'_>) -> Result<(), DrawError>,
) -> Result<String, DrawError> {
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, size).into_drawing_area();
        paint(&area)?;
        area.present()?;
    }
    Ok(text)
}

/// Text of so many pixels.
fn font(pixels: f64) -> TextStyle<'static> {
    inked(pixels, TEXT_INK)
}

/// Text of so many pixels in a colour.
fn inked(pixels: f64, color: RGBColor) -> TextStyle<'static> {
    let mut style = TextStyle::from((FONT, pixels * SVG_FONT_SCALE).into_font());
    style.color = color.to_backend_color();
    style
}

fn at(style: TextStyle<'static>, horizontal: HPos, vertical: VPos) -> TextStyle<'static> {
    style.pos(Pos::new(horizontal, vertical))
}

/// A horizontal line through a panel, in dashes of so many pixels.
fn dashes(
    from: (f64, f64),
    to: (f64, f64),
    dash: u32,
    gap: u32,
    style: ShapeStyle,
) -> DashedLineSeries<std::vec::IntoIter<(f64, f64)>, u32> {
    DashedLineSeries::new(vec![from, to], dash, gap, style)
}
