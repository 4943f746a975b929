//! The one table of colours: weights, anchors and clusters, grasps, outcomes against the truth and
//! verdicts. What readers must tell apart stays apart for colour-blind ones, too (Okabe & Ito, "Color
//! Universal Design", 2008).

use semfm::Verdict;
use semfm::geom::math::{DVec3, bounds};
pub use semfm::weight_colors::{MARKED, PLAIN, color_bytes, weight_colors};

use crate::hand::PartKind;

// Okabe and Ito's palette.
const GREEN: [u8; 3] = [0, 158, 115];
const VERMILION: [u8; 3] = [213, 94, 0];
const BLUE: [u8; 3] = [0, 114, 178];
const PURPLE: [u8; 3] = [204, 121, 167];
const SKY_BLUE: [u8; 3] = [86, 180, 233];
const ORANGE: [u8; 3] = [230, 159, 0];

/// Right: in the true region, found or given.
pub const RIGHT: [u8; 3] = GREEN;
/// Too much: found, and not in the true region.
pub const EXTRA: [u8; 3] = VERMILION;
/// Missed: in the true region, and not found.
pub const MISSED: [u8; 3] = BLUE;
/// Numbers that are quoted from elsewhere.
pub const QUOTED: [u8; 3] = [110, 110, 110];
/// Numbers of a vision-language model that are quoted from elsewhere.
pub const QUOTED_VLM: [u8; 3] = SKY_BLUE;
/// A second series of our own.
pub const SECOND: [u8; 3] = PURPLE;
/// Series in one plot, in order.
pub const SERIES: [[u8; 3]; 6] = [GREEN, VERMILION, BLUE, PURPLE, SKY_BLUE, ORANGE];
/// Surface that is neither found nor true.
const NEUTRAL: [u8; 3] = [205, 205, 205];

/// Anchors, best first: Okabe and Ito's colours, rounded to hundredths.
const ANCHORS: [[f32; 3]; 6] = [
    [0.84, 0.37, 0.00],
    [0.00, 0.45, 0.70],
    [0.00, 0.62, 0.45],
    [0.80, 0.47, 0.65],
    [0.94, 0.89, 0.26],
    [0.34, 0.71, 0.91],
];
/// Clusters that are no anchors, by turns.
const OTHER_CLUSTERS: [[f32; 3]; 2] = [[0.82; 3], [0.68; 3]];

/// Grasps of several in one picture, from the best to the last shown: the lightness rises all the way, so
/// that they stay apart without colour.
const GRASPS: [[f32; 3]; 4] =
    [[0.10, 0.16, 0.42], [0.13, 0.44, 0.60], [0.36, 0.70, 0.58], [0.95, 0.84, 0.35]];
/// The object's two contacts with the pads.
pub(crate) const CONTACT: [f32; 3] = [0.98, 0.80, 0.10];
/// The arrow along which a hand comes: seen on white and on a dark page.
pub(crate) const APPROACH: [f32; 3] = [0.72, 0.33, 0.58];
/// The table below an object.
pub(crate) const TABLE: [f32; 3] = [0.90, 0.87, 0.81];

/// Links of a robot by turns, so that one is told from the next.
const LINKS: [[f32; 3]; 2] = [[0.87, 0.88, 0.90], [0.62, 0.68, 0.77]];
/// The object of a motion.
pub(crate) const OBJECT: [f32; 3] = [0.90, 0.62, 0.10];
/// What stands around it.
pub(crate) const OBSTACLE: [f32; 3] = [0.72, 0.69, 0.63];
/// Two things that touch and must not.
pub(crate) const COLLIDING: [f32; 3] = [0.84, 0.30, 0.08];

/// The colour of a robot's link by its place in the chain.
pub(crate) fn link_color(place: usize) -> [f32; 3] {
    LINKS[place % LINKS.len()]
}

/// The colours of a hand's parts: the nearer to the object the darker.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HandColors {
    pub palm: [f32; 3],
    pub finger: [f32; 3],
    pub pad: [f32; 3],
}

impl HandColors {
    /// A hand that is shown alone.
    pub(crate) fn of_one() -> Self {
        Self { palm: [0.52, 0.64, 0.82], finger: [0.24, 0.42, 0.68], pad: [0.05, 0.12, 0.28] }
    }

    /// A hand by the rank of its grasp, where `n_shown` are drawn in one picture.
    pub(crate) fn of_rank(rank: usize, n_shown: usize) -> Self {
        let palm = grasp_color(rank, n_shown);
        Self { palm, finger: palm.map(|c| 0.8 * c), pad: palm.map(|c| 0.5 * c) }
    }

    pub(crate) fn of(self, kind: PartKind) -> [f32; 3] {
        match kind {
            PartKind::Palm => self.palm,
            PartKind::Finger => self.finger,
            PartKind::Pad => self.pad,
        }
    }
}

/// The colour of an anchor by its rank from 0, grey for none (negative).
pub(crate) fn anchor_color(rank: i64) -> [f32; 3] {
    usize::try_from(rank).map_or(OTHER_CLUSTERS[0], |rank| ANCHORS[rank % ANCHORS.len()])
}

/// The colour of a cluster: that of the anchor that it is, one of two greys where it is none.
pub(crate) fn cluster_color(cluster: u32, anchor_rank: i64) -> [f32; 3] {
    match anchor_rank {
        ..0 => OTHER_CLUSTERS[cluster as usize % OTHER_CLUSTERS.len()],
        rank => anchor_color(rank),
    }
}

/// The colour of the grasp of this rank where `n_shown` are drawn in one picture: the better the darker.
pub(crate) fn grasp_color(rank: usize, n_shown: usize) -> [f32; 3] {
    let pieces = GRASPS.len() - 1;
    let along = rank as f32 / n_shown.saturating_sub(1).max(1) as f32 * pieces as f32;
    let piece = (along as usize).min(pieces - 1);
    let (from, to) = (GRASPS[piece], GRASPS[piece + 1]);
    std::array::from_fn(|c| from[c] + (along - piece as f32) * (to[c] - from[c]))
}

/// Positions as colours: x, y, z over the bounding box.
pub fn position_colors(points: &[DVec3]) -> Vec<[f32; 3]> {
    let Some((low, high)) = bounds(points) else { return Vec::new() };
    let extent = (high - low).max(DVec3::splat(f64::MIN_POSITIVE));
    points.iter().map(|&p| ((p - low) / extent * 0.8 + 0.15).as_vec3().to_array()).collect()
}

/// The colour of each weight: neutral grey to `full`.
pub fn weight_colors_to(full: [u8; 3], weights: &[f64]) -> Vec<[f32; 3]> {
    weights.iter().map(|&w| neutral_to(full, w.clamp(0.0, 1.0) as f32)).collect()
}

/// Right, too much, missed, or neither, for each vertex.
pub fn outcome_colors(found: &[bool], truth: &[bool]) -> Vec<[f32; 3]> {
    found.iter().zip(truth).map(|(&found, &truth)| outcome_color(found, truth)).collect()
}

fn outcome_color(found: bool, truth: bool) -> [f32; 3] {
    match (found, truth) {
        (true, true) => neutral_to(RIGHT, 1.0),
        (true, false) => neutral_to(EXTRA, 1.0),
        (false, true) => neutral_to(MISSED, 1.0),
        (false, false) => neutral_to(RIGHT, 0.0),
    }
}

fn neutral_to(full: [u8; 3], share: f32) -> [f32; 3] {
    std::array::from_fn(|c| {
        (f32::from(NEUTRAL[c]) + share * (f32::from(full[c]) - f32::from(NEUTRAL[c]))) / 255.0
    })
}

/// The colour behind a verdict in white letters.
pub fn verdict_color(verdict: Verdict) -> [u8; 3] {
    match verdict {
        Verdict::Accept => [29, 125, 70],
        Verdict::Check => [154, 106, 0],
        Verdict::Refuse => [179, 38, 30],
    }
}

/// A name for a colour in a style sheet.
#[derive(Clone, Copy, Debug)]
pub struct NamedColor {
    /// Name of the property, without its dashes.
    pub name: &'static str,
    /// sRGB bytes.
    pub color: [u8; 3],
}

/// Colours as custom properties of CSS: `--name: #rrggbb;` for each.
pub fn css_properties(colors: &[NamedColor]) -> String {
    let properties =
        colors.iter().map(|NamedColor { name, color }| format!("--{name}: {};", hex(*color)));
    properties.collect::<Vec<_>>().join(" ")
}

/// A colour as CSS and SVG write it: `#rrggbb`.
pub fn hex([r, g, b]: [u8; 3]) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_four_outcomes_have_four_colours() {
        let colors = outcome_colors(&[true, true, false, false], &[true, false, true, false]);
        for (i, a) in colors.iter().enumerate() {
            assert!(colors[..i].iter().all(|b| a != b), "{colors:?}");
        }
        assert_eq!(colors[0], weight_colors_to(RIGHT, &[1.0])[0]);
        assert_eq!(colors[3], weight_colors_to(EXTRA, &[-0.5])[0]);
    }

    #[test]
    fn a_cluster_has_the_colour_of_its_anchor() {
        assert_eq!(cluster_color(5, 1), anchor_color(1));
        assert_eq!(cluster_color(4, -1), anchor_color(-1));
        assert_ne!(cluster_color(5, -1), cluster_color(4, -1));
        assert_eq!(hex([1, 16, 255]), "#0110ff");
    }
}
