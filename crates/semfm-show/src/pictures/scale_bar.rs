//! A bar in a picture that tells how large things are.

use semfm::views::View;

use super::canvas::{Canvas, Rect};
use super::stroke_font::{self, Text};

const INK: [u8; 3] = [29, 36, 48];
/// Height of its letters and of its end marks, and space around it, in pixels.
const SIZE: f32 = 11.0;
const MARK: usize = 7;
const MARGIN: usize = 14;
/// The longest that it may be, as a share of the picture's width.
const LONGEST: f64 = 0.3;

/// Draws a bar into the lower left corner that has a round length in metres at this depth.
pub(super) fn draw_scale_bar(view: &mut View, depth: f64) {
    let (width, height) = (view.camera.width() as usize, view.camera.height() as usize);
    let pixels_per_metre = view.camera.fx() / depth;
    let Some(metres) = round_length(LONGEST * width as f64 / pixels_per_metre) else { return };
    let length = (metres * pixels_per_metre).round() as usize;
    let mut canvas = Canvas::of_picture(std::mem::take(&mut view.rgb), width);
    let bottom = height.saturating_sub(MARGIN);
    for (left, top, width, height) in [
        (MARGIN, bottom - MARK / 2, length, 2),
        (MARGIN, bottom - MARK, 2, MARK + 2),
        ((MARGIN + length).saturating_sub(2), bottom - MARK, 2, MARK + 2),
    ] {
        canvas.fill(Rect { left, top, width, height }, INK);
    }
    let text = name_of(metres);
    let left = MARGIN as f32 + (length as f32 - stroke_font::width(&text, SIZE)) / 2.0;
    let baseline = (bottom - MARK) as f32 - 6.0;
    Text { text: &text, left: left.max(4.0), baseline, size: SIZE, color: INK }.draw(&mut canvas);
    view.rgb = canvas.into_picture();
}

/// The largest of 1, 2 and 5 times a power of ten that is not above a length.
fn round_length(most: f64) -> Option<f64> {
    if !(most > 0.0 && most.is_finite()) {
        return None;
    }
    let power = 10f64.powf(most.log10().floor());
    // The logarithm may be rounded up.
    [5.0, 2.0, 1.0, 0.5].into_iter().map(|k| k * power).find(|&length| length <= most)
}

fn name_of(metres: f64) -> String {
    // Powers of ten are rounded: a little less than a metre is one.
    match metres * (1.0 + 1e-9) {
        m if m >= 1.0 => format!("{m:.0} m"),
        m if m >= 0.01 => format!("{:.0} cm", 100.0 * m),
        m if m >= 0.001 => format!("{:.0} mm", 1e3 * m),
        m => format!("{m:e} m"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bar_has_a_round_length() {
        for (most, length, name) in [
            (0.13, 0.1, "10 cm"),
            (0.0999, 0.05, "5 cm"),
            (0.021, 0.02, "2 cm"),
            (3.0, 2.0, "2 m"),
            (0.0012, 0.001, "1 mm"),
        ] {
            let found = round_length(most).unwrap();
            assert!((found - length).abs() < 1e-12, "{most}: {found}");
            assert_eq!(name_of(found), name);
        }
        assert_eq!(round_length(0.0), None);
        assert_eq!(round_length(f64::NAN), None);
    }
}
