//! Text in pictures, drawn as strokes: a font of our own, so that no font file is needed.
//!
//! A glyph is a few strokes on a grid where capitals are 14 units high, small letters 10, and tails
//! reach 4 below the line. A stroke that starts with `~` is smooth (a quadratic B-spline whose ends
//! are its first and last point), one that starts with `o` is smooth and closed, any other is made of
//! straight lines.

use super::canvas::Canvas;

/// Height of a capital in grid units.
const CAPITAL: f32 = 14.0;
/// Width of a stroke and of the gap between letters, in grid units.
const STROKE: f32 = 2.0;
const GAP: f32 = 4.4;
/// Segments of each piece of a smooth stroke.
const STEPS: usize = 6;

/// Character, width and strokes.
#[rustfmt::skip]
const GLYPHS: [(char, i8, &str); 95] = [
    (' ', 3, ""),
    ('A', 11, "0,0 5.5,14 11,0;2,5 9,5"),
    ('B', 9, "0,0 0,14;~0,14 4,14 9,14 9,7.3 4,7.3 0,7.3;~0,7.3 5,7.3 10,7.3 10,0 5,0 0,0"),
    ('C', 10, "~10,11 9,14 5,14 0,14 0,7 0,0 5,0 9,0 10,3"),
    ('D', 10, "0,0 0,14;~0,14 4,14 10,14 10,7 10,0 4,0 0,0"),
    ('E', 8, "8,14 0,14 0,0 8,0;0,7.3 7,7.3"),
    ('F', 8, "8,14 0,14 0,0;0,7 7,7"),
    ('G', 10, "~10,11 9,14 5,14 0,14 0,7 0,0 5,0 10,0 10,4 10,6.5;6,6.5 10,6.5"),
    ('H', 10, "0,0 0,14;10,0 10,14;0,7.3 10,7.3"),
    ('I', 2, "1,0 1,14"),
    ('J', 7, "~7,14 7,4 7,0 3.5,0 0,0 0,3"),
    ('K', 9, "0,0 0,14;9,14 0,5;3,8 9,0"),
    ('L', 8, "0,14 0,0 8,0"),
    ('M', 12, "0,0 0,14 6,4 12,14 12,0"),
    ('N', 10, "0,0 0,14 10,0 10,14"),
    ('O', 11, "o0,0 11,0 11,7 11,14 0,14 0,7"),
    ('P', 9, "0,0 0,14;~0,14 4,14 9,14 9,6.5 4,6.5 0,6.5"),
    ('Q', 11, "o0,0 11,0 11,7 11,14 0,14 0,7;7,4 11,-1"),
    ('R', 9, "0,0 0,14;~0,14 4,14 9,14 9,7 4,7 0,7;5,7 9,0"),
    ('S', 9, "~9,12 7.5,14 4.5,14 0,14 0,10.5 0,7.6 4.5,7.3 9,7 9,3.5 9,0 4.5,0 1.5,0 0,2"),
    ('T', 10, "0,14 10,14;5,14 5,0"),
    ('U', 10, "~0,14 0,5 0,0 5,0 10,0 10,5 10,14"),
    ('V', 10, "0,14 5,0 10,14"),
    ('W', 14, "0,14 3.5,0 7,12 10.5,0 14,14"),
    ('X', 10, "0,0 10,14;0,14 10,0"),
    ('Y', 10, "0,14 5,7 10,14;5,7 5,0"),
    ('Z', 9, "0,14 9,14 0,0 9,0"),
    ('a', 8, "8,10 8,0;o0,0 8,0 8,5 8,10 0,10 0,5"),
    ('b', 8, "0,0 0,14;o0,0 8,0 8,5 8,10 0,10 0,5"),
    ('c', 8, "~8,8 7,10 4,10 0,10 0,5 0,0 4,0 7,0 8,2"),
    ('d', 8, "8,0 8,14;o0,0 8,0 8,5 8,10 0,10 0,5"),
    ('e', 8, "0,5.2 8,5.2;~8,5.2 8,10 4,10 0,10 0,5 0,0 4,0 7,0 8,2"),
    ('f', 5, "~5.5,14 2,14 2,11 2,0;0,10 5,10"),
    ('g', 8, "o0,0 8,0 8,5 8,10 0,10 0,5;~8,10 8,0 8,-4 4,-4 1.5,-4 0.5,-3"),
    ('h', 8, "0,0 0,14;~0,5 0,10 4,10 8,10 8,6 8,0"),
    ('i', 2, "1,0 1,10;1,13.3 1,13.6"),
    ('j', 3, "~2,10 2,-1 2,-4 -1,-4;2,13.3 2,13.6"),
    ('k', 7, "0,0 0,14;7,10 0,4;2.7,6.3 7,0"),
    ('l', 2, "1,0 1,14"),
    ('m', 13, "0,0 0,10;~0,5 0,10 3.5,10 6.5,10 6.5,6 6.5,0;~6.5,5 6.5,10 10,10 13,10 13,6 13,0"),
    ('n', 8, "0,0 0,10;~0,5 0,10 4,10 8,10 8,6 8,0"),
    ('o', 9, "o0,0 9,0 9,5 9,10 0,10 0,5"),
    ('p', 8, "0,10 0,-4;o0,0 8,0 8,5 8,10 0,10 0,5"),
    ('q', 8, "8,10 8,-4;o0,0 8,0 8,5 8,10 0,10 0,5"),
    ('r', 5, "0,0 0,10;~0,5 0,10 5,10"),
    ('s', 7, "~7,8.5 5.5,10 3.5,10 0,10 0,7.5 0,5.4 3.5,5.2 7,5 7,2.5 7,0 3.5,0 1,0 0,1.7"),
    ('t', 5, "~2,13 2,3 2,0 5.5,0;0,10 5,10"),
    ('u', 8, "~0,10 0,4 0,0 4,0 8,0 8,5;8,10 8,0"),
    ('v', 8, "0,10 4,0 8,10"),
    ('w', 12, "0,10 3,0 6,9 9,0 12,10"),
    ('x', 8, "0,0 8,10;0,10 8,0"),
    ('y', 8, "0,10 4,0;8,10 3.2,-2;~3.2,-2 2.5,-4 0,-4"),
    ('z', 8, "0,10 8,10 0,0 8,0"),
    ('0', 9, "o0,0 9,0 9,7 9,14 0,14 0,7"),
    ('1', 5, "0,11 4,14 4,0"),
    ('2', 9, "~0,10.5 0,14 4.5,14 9,14 9,10 9,7 0,0;0,0 9,0"),
    ('3', 9, "~0,12 1.5,14 4,14 8.5,14 8.5,10.5 8.5,7.3 3.5,7.3;~3.5,7.3 9,7.3 9,3.5 9,0 4,0 1,0 0,2"),
    ('4', 9, "7,0 7,14 0,4 9.5,4"),
    ('5', 9, "8,14 1,14 0.5,7;~0.5,7 2,9 5,9 9,9 9,4.5 9,0 4,0 1,0 0,2"),
    ('6', 9, "o0,0 9,0 9,4.5 9,9 0,9 0,4.5;~0,4.5 0,14 6,14 7.5,14 8.5,12.3"),
    ('7', 9, "0,14 9,14 3,0"),
    ('8', 9, "o0.7,7.3 8.3,7.3 8.3,14 0.7,14;o0,0 9,0 9,7.3 0,7.3"),
    ('9', 9, "o0,5 9,5 9,9.5 9,14 0,14 0,9.5;~9,9.5 9,0 3,0 1.5,0 0.5,1.7"),
    ('.', 2, "1,0.2 1,0.5"),
    (',', 2, "1.3,0.5 0.3,-2.7"),
    (':', 2, "1,0.2 1,0.5;1,8.2 1,8.5"),
    (';', 2, "1.3,0.5 0.3,-2.7;1,8.2 1,8.5"),
    ('-', 5, "0,5.5 5,5.5"),
    ('–', 9, "0,5.5 9,5.5"),
    ('·', 2, "1,6.2 1,6.5"),
    ('/', 7, "0,-2 7,15"),
    ('|', 2, "1,-3 1,15"),
    ('(', 4, "~4,16 0,13 0,6.5 0,0 4,-3"),
    (')', 4, "~0,16 4,13 4,6.5 4,0 0,-3"),
    ('[', 4, "4,15 0,15 0,-3 4,-3"),
    (']', 4, "0,15 4,15 4,-3 0,-3"),
    ('%', 13, "o0,8.5 5,8.5 5,14 0,14;o8,0 13,0 13,5.5 8,5.5;2.5,-0.5 10.5,14.5"),
    ('=', 8, "0,4 8,4;0,8 8,8"),
    ('+', 8, "0,6 8,6;4,2 4,10"),
    ('<', 8, "8,10 0,6 8,2"),
    ('>', 8, "0,10 8,6 0,2"),
    ('≥', 8, "0,12 8,8 0,4;0,0.5 8,0.5"),
    ('≤', 8, "8,12 0,8 8,4;0,0.5 8,0.5"),
    ('→', 11, "0,6 11,6;7,10 11,6 7,2"),
    ('×', 7, "0,2.5 7,9.5;0,9.5 7,2.5"),
    ('°', 4, "o0,9.5 4.5,9.5 4.5,14 0,14"),
    ('\'', 2, "1,14.5 1,10.5"),
    ('"', 5, "0.5,14.5 0.5,10.5;4.5,14.5 4.5,10.5"),
    ('#', 10, "2,0 4,14;7,0 9,14;0.5,5 9.5,5;1.2,9.5 10.2,9.5"),
    ('_', 8, "0,-3 8,-3"),
    ('*', 6, "3,14 3,8;0.4,12.5 5.6,9.5;0.4,9.5 5.6,12.5"),
    ('!', 2, "1,14 1,4.5;1,0.2 1,0.5"),
    ('?', 8, "~0,11 0,14 4,14 8,14 8,10.5 8,8 4,8 4,4.5;4,0.2 4,0.5"),
    ('&', 11, "~11,0 2,9 2,14 5,14 8,14 8,11 8,9 0,7 0,3.5 0,0 4,0 9,0 10,7"),
    ('…', 10, "1,0.2 1,0.5;5,0.2 5,0.5;9,0.2 9,0.5"),
];
/// Drawn for a character that the font has not.
const UNKNOWN: (char, i8, &str) = ('\u{fffd}', 8, "0,0 8,0 8,14 0,14 0,0");

/// A line of text.
pub(super) struct Text<'a> {
    pub text: &'a str,
    /// Where the first letter begins, in pixels.
    pub left: f32,
    /// The line that letters stand on, in pixels from the top.
    pub baseline: f32,
    /// Height of a capital in pixels.
    pub size: f32,
    pub color: [u8; 3],
}

/// One letter.
struct Glyph {
    /// In grid units.
    width: f32,
    strokes: &'static str,
}

impl Glyph {
    fn of(character: char) -> Self {
        let known = GLYPHS.iter().find(|row| row.0 == character);
        let &(_, width, strokes) = known.unwrap_or(&UNKNOWN);
        Self { width: f32::from(width), strokes }
    }

    fn strokes(&self) -> impl Iterator<Item = &'static str> {
        self.strokes.split(';').filter(|stroke| !stroke.is_empty())
    }
}

/// Pixels that a line of text takes in width, with capitals `size` pixels high.
pub(super) fn width(text: &str, size: f32) -> f32 {
    let units: f32 = text.chars().map(|c| Glyph::of(c).width + GAP).sum();
    (units - GAP).max(0.0) * size / CAPITAL
}

impl Text<'_> {
    /// Draws the text.
    pub(super) fn draw(&self, canvas: &mut Canvas) {
        let unit = self.size / CAPITAL;
        let mut left = self.left;
        for character in self.text.chars() {
            let glyph = Glyph::of(character);
            for stroke in glyph.strokes() {
                let line: Vec<[f32; 2]> = polyline(stroke)
                    .into_iter()
                    .map(|[u, v]| [left + u * unit, self.baseline - v * unit])
                    .collect();
                canvas.line(&line, STROKE * unit, self.color);
            }
            left += (glyph.width + GAP) * unit;
        }
    }
}

/// Corner points of a stroke on the grid.
fn polyline(stroke: &str) -> Vec<[f32; 2]> {
    let points = control_points(stroke);
    let n = points.len();
    let mut line = Vec::new();
    match stroke.chars().next() {
        Some('o') => {
            for i in 0..n {
                let (before, after) = (points[(i + n - 1) % n], points[(i + 1) % n]);
                add_bend(&mut line, middle(before, points[i]), points[i], middle(points[i], after));
            }
            line
        }
        Some('~') if n > 2 => {
            for i in 1..n - 1 {
                let first = if i == 1 { points[0] } else { middle(points[i - 1], points[i]) };
                let last =
                    if i == n - 2 { points[n - 1] } else { middle(points[i], points[i + 1]) };
                add_bend(&mut line, first, points[i], last);
            }
            line
        }
        _ => points,
    }
}

/// The points that a stroke is written with.
fn control_points(stroke: &str) -> Vec<[f32; 2]> {
    stroke
        .trim_start_matches(['~', 'o'])
        .split(' ')
        .filter_map(|pair| pair.split_once(','))
        .map(|(u, v)| [u, v].map(|number| number.parse().unwrap_or(0.0)))
        .collect()
}

fn middle(a: [f32; 2], b: [f32; 2]) -> [f32; 2] {
    [(a[0] + b[0]) / 2.0, (a[1] + b[1]) / 2.0]
}

/// Adds a quadratic Bézier curve: (1 − t)² a + 2 t (1 − t) b + t² c for t from 0 to 1.
fn add_bend(line: &mut Vec<[f32; 2]>, a: [f32; 2], b: [f32; 2], c: [f32; 2]) {
    line.extend((0..=STEPS).map(|i| {
        let t = i as f32 / STEPS as f32;
        let weights = [(1.0 - t) * (1.0 - t), 2.0 * t * (1.0 - t), t * t];
        [0, 1].map(|k| weights[0] * a[k] + weights[1] * b[k] + weights[2] * c[k])
    }));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_character_has_one_glyph_inside_its_box() {
        for (i, &(character, width, _)) in GLYPHS.iter().enumerate() {
            assert!(GLYPHS[i + 1..].iter().all(|other| other.0 != character), "{character} twice");
            for stroke in Glyph::of(character).strokes() {
                let line = polyline(stroke);
                assert!(line.len() > 1, "{character}: {stroke}");
                for [u, v] in line {
                    let fits =
                        (-1.0..=f32::from(width) + 1.0).contains(&u) && (-4.0..=16.0).contains(&v);
                    assert!(fits, "{character}: {u}, {v}");
                }
            }
        }
    }

    #[test]
    fn text_covers_what_its_width_says() {
        let size = 14.0;
        let wide = width("Anchor 1", size);
        let mut canvas = Canvas::new(wide.ceil() as usize + 8, 30, [255; 3]);
        Text { text: "Anchor 1", left: 4.0, baseline: 22.0, size, color: [0; 3] }.draw(&mut canvas);
        let dark: Vec<usize> =
            (0..canvas.width).filter(|&x| (0..30).any(|y| canvas.at(x, y)[0] < 128)).collect();
        assert!(dark[0] <= 5 && (dark[dark.len() - 1] as f32 - 4.0 - wide).abs() < 6.0, "{dark:?}");
    }
}
