//! Colours that stay apart for colour-blind readers (Okabe & Ito, "Color Universal Design", 2008).

use plotters::style::RGBColor;

/// Right: in the true region, found or given.
pub(super) const RIGHT: [u8; 3] = [0, 158, 115];
/// Too much: found, and not in the true region.
pub(super) const EXTRA: [u8; 3] = [213, 94, 0];
/// Missed: in the true region, and not found.
pub(super) const MISSED: [u8; 3] = [0, 114, 178];
/// What is quoted from elsewhere.
pub(super) const QUOTED: [u8; 3] = [110, 110, 110];
/// A second series of ours.
pub(super) const SECOND: [u8; 3] = [204, 121, 167];
/// Surface of no interest.
const PLAIN: [u8; 3] = [205, 205, 205];

/// The same colour for plots.
pub(super) fn ink([r, g, b]: [u8; 3]) -> RGBColor {
    RGBColor(r, g, b)
}

/// The colour of each weight: grey to `full`.
pub(super) fn by_weight(weights: &[f64], full: [u8; 3]) -> Vec<[f32; 3]> {
    weights.iter().map(|&w| mix(w.clamp(0.0, 1.0) as f32, full)).collect()
}

/// Right, too much, missed, or neither, for each vertex.
pub(super) fn by_error(found: &[bool], truth: &[bool]) -> Vec<[f32; 3]> {
    let color = |(found, truth): (&bool, &bool)| match (found, truth) {
        (true, true) => mix(1.0, RIGHT),
        (true, false) => mix(1.0, EXTRA),
        (false, true) => mix(1.0, MISSED),
        (false, false) => mix(0.0, RIGHT),
    };
    found.iter().zip(truth).map(color).collect()
}

fn mix(w: f32, full: [u8; 3]) -> [f32; 3] {
    std::array::from_fn(|c| {
        (f32::from(PLAIN[c]) + w * (f32::from(full[c]) - f32::from(PLAIN[c]))) / 255.0
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_four_outcomes_have_four_colours() {
        let colors = by_error(&[true, true, false, false], &[true, false, true, false]);
        for (i, a) in colors.iter().enumerate() {
            assert!(colors[..i].iter().all(|b| a != b), "{colors:?}");
        }
        assert_eq!(colors[0], by_weight(&[1.0], RIGHT)[0]);
        assert_eq!(colors[3], by_weight(&[-0.5], EXTRA)[0]);
    }
}
