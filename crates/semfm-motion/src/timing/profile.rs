//! The fastest way along a curve: TOPP-RA (Pham & Pham, A New Approach to Time-Optimal Path Parameterization Based on
//! Reachability Analysis, IEEE T-RO 2018).
//!
//! With x = ṡ² and u = s̈ a joint has velocity q′ṡ and acceleration q′u + q″x. The curve is divided into intervals with
//! constant u, in which x = xᵢ + 2u (s − sᵢ). On lines and parabolas q″ is constant and q′ linear in s, so the
//! acceleration is linear in s as well: limits that hold at both ends of an interval hold within it. We therefore ask
//! for both ends (the paper's "first-order interpolation scheme"), and the result keeps the acceleration limits
//! everywhere, not only on the grid.

use crate::planning::{Curve, CurvePiece};

/// Speed along a curve over time.
pub(super) struct TimedCurve<'a> {
    pub curve: &'a Curve,
    pub intervals: Vec<Interval>,
}

/// A part of one piece with constant acceleration of the parameter.
pub(super) struct Interval {
    pub piece: usize,
    /// Parameter since the piece's beginning.
    pub sigma: f64,
    pub length: f64,
    /// Seconds since the motion began.
    pub time: f64,
    pub duration: f64,
    /// ṡ at its beginning.
    pub speed: f64,
    /// s̈ within.
    pub acceleration: f64,
}

/// Joint values and their first derivative by time.
pub(super) struct State {
    pub positions: Vec<f64>,
    pub velocities: Vec<f64>,
}

impl<'a> TimedCurve<'a> {
    /// The fastest motion along `curve` that is at rest at its ends and stops, within `velocity` and `acceleration`.
    pub fn fastest(curve: &'a Curve, velocity: &[f64], acceleration: &[f64]) -> Self {
        let grid = Grid::new(curve, velocity, acceleration);
        let squares = grid.forward(&grid.backward());
        let rates = |i: usize| (squares[i + 1] - squares[i]) / (2.0 * grid.spans[i].length);
        let greatest = (0..grid.spans.len()).map(|i| rates(i).abs()).fold(0.0, f64::max);
        let mut intervals: Vec<Interval> = Vec::with_capacity(grid.spans.len());
        for (i, span) in grid.spans.iter().enumerate() {
            let (before, after) = (squares[i], squares[i + 1]);
            let acceleration = rates(i);
            let piece = &curve.pieces()[span.piece];
            let grows = intervals.last().is_some_and(|last| {
                last.piece == span.piece
                    && piece.is_line()
                    && (last.acceleration - acceleration).abs() <= SAME * greatest
            });
            if grows {
                // The speed at its beginning and now at its end decide.
                let Some(last) = intervals.last_mut() else { continue };
                last.length += span.length;
                last.acceleration = (after - last.speed * last.speed) / (2.0 * last.length);
                last.duration = 2.0 * last.length / (last.speed + after.sqrt());
                continue;
            }
            intervals.push(Interval {
                piece: span.piece,
                sigma: span.sigma,
                length: span.length,
                time: 0.0,
                duration: 2.0 * span.length / (before.sqrt() + after.sqrt()),
                speed: before.sqrt(),
                acceleration,
            });
        }
        let mut time = 0.0;
        for interval in &mut intervals {
            interval.time = time;
            time += interval.duration;
        }
        Self { curve, intervals }
    }

    pub fn duration(&self) -> f64 {
        self.intervals.last().map_or(0.0, |last| last.time + last.duration)
    }

    /// Joint values and velocities; before the beginning and after the end at rest.
    pub fn state(&self, time: f64) -> State {
        let rest = |positions: &[f64]| State {
            positions: positions.to_vec(),
            velocities: vec![0.0; positions.len()],
        };
        if time <= 0.0 {
            return rest(self.curve.start());
        }
        if time >= self.duration() {
            return rest(self.curve.end());
        }
        let interval = &self.intervals[self.interval_at(time)];
        let piece = &self.curve.pieces()[interval.piece];
        let since = time - interval.time;
        let way = (interval.speed + 0.5 * interval.acceleration * since) * since;
        let speed = (interval.speed + interval.acceleration * since).max(0.0);
        let sigma = (interval.sigma + way).clamp(0.0, piece.length);
        State {
            positions: piece.position(sigma),
            velocities: piece.slope(sigma).iter().map(|slope| slope * speed).collect(),
        }
    }

    /// Number of the interval at a time.
    pub fn interval_at(&self, time: f64) -> usize {
        self.intervals.partition_point(|interval| interval.time <= time).max(1) - 1
    }
}

/// Accelerations of neighbouring intervals that differ by less than this share of the greatest are one.
const SAME: f64 = 1e-6;

/// The curve's intervals with all that limits ask of them.
struct Grid {
    spans: Vec<Span>,
    /// Greatest x by velocity limits and stops, one more than intervals.
    greatest: Vec<f64>,
}

/// One interval of the grid.
struct Span {
    piece: usize,
    sigma: f64,
    length: f64,
    /// slope · u + bend · x ≤ limit; two a joint and end that bind.
    rows: Vec<Row>,
}

struct Row {
    u: f64,
    x: f64,
    limit: f64,
}

/// Intervals that a curve is divided into, by its length. With 100 instead of 200 durations of shortened paths grow by .1 %, with 400
/// they shrink by .03 %.
const INTERVALS: f64 = 200.0;

/// Least number of intervals of a line, and of a parabola. At least two: rest at both ends needs motion between.
const LEAST_INTERVALS: [usize; 2] = [4, 6];

/// By this share x stays below its bound: room for rounding where a joint's slope passes through zero.
const ROUNDING: f64 = 1e-9;

impl Grid {
    fn new(curve: &Curve, velocity: &[f64], acceleration: &[f64]) -> Self {
        let mut spans = Vec::new();
        let mut greatest: Vec<f64> = vec![0.0];
        for (number, piece) in curve.pieces().iter().enumerate() {
            if piece.begins_at_rest {
                *greatest.last_mut().unwrap_or(&mut 0.0) = 0.0;
            }
            let least = LEAST_INTERVALS[usize::from(!piece.is_line())];
            let n = ((INTERVALS * piece.length / curve.length()).ceil() as usize).max(least);
            for i in 0..n {
                let at = |i: usize| piece.length * i as f64 / n as f64;
                let length = piece.length / n as f64;
                let (before, after) = (piece.slope(at(i)), piece.slope(at(i + 1)));
                let square = greatest_square(&before, &after, velocity);
                if let Some(end) = greatest.last_mut() {
                    *end = end.min(square);
                }
                greatest.push(square);
                let rows = rows(piece, &before, &after, length, acceleration);
                spans.push(Span { piece: number, sigma: at(i), length, rows });
            }
        }
        if let Some(end) = greatest.last_mut() {
            *end = 0.0;
        }
        Self { spans, greatest }
    }

    /// For each grid point the greatest x from which the end can be reached. The least is 0: whoever stands may stay.
    fn backward(&self) -> Vec<f64> {
        let mut reachable = self.greatest.clone();
        for i in (0..self.spans.len()).rev() {
            let span = &self.spans[i];
            reachable[i] = greatest_x(span, reachable[i], reachable[i + 1]) * (1.0 - ROUNDING);
        }
        reachable
    }

    /// From rest at the beginning always the greatest acceleration that keeps within `reachable`.
    fn forward(&self, reachable: &[f64]) -> Vec<f64> {
        let mut squares = Vec::with_capacity(reachable.len());
        squares.push(0.0);
        for (i, span) in self.spans.iter().enumerate() {
            let x = squares[i];
            let u = range(span, x, reachable[i + 1]).most;
            squares.push((x + 2.0 * span.length * u).clamp(0.0, reachable[i + 1]));
        }
        squares
    }
}

/// Greatest x for which |q′| √x stays within the velocity limits along an interval on which q′ is linear.
fn greatest_square(before: &[f64], after: &[f64], velocity: &[f64]) -> f64 {
    let mut least = f64::INFINITY;
    for (limit, (before, after)) in velocity.iter().zip(before.iter().zip(after)) {
        least = least.min(limit / before.abs().max(after.abs()));
    }
    least * least
}

/// Acceleration limits at both ends. With x = xᵢ + 2u Δ at the far end, q′u + q″x there is (q′ + 2Δ q″) u + q″ xᵢ.
fn rows(
    piece: &CurvePiece,
    before: &[f64],
    after: &[f64],
    length: f64,
    acceleration: &[f64],
) -> Vec<Row> {
    let mut rows = Vec::with_capacity(4 * before.len());
    for (j, &limit) in acceleration.iter().enumerate() {
        let bend = piece.curvature[j];
        rows.push(Row { u: before[j], x: bend, limit });
        if bend != 0.0 {
            rows.push(Row { u: after[j] + 2.0 * length * bend, x: bend, limit });
        }
    }
    rows
}

/// The accelerations u that are allowed at an x, and the rows that bind.
struct Range {
    least: f64,
    most: f64,
    /// Lines u = (limit − x·b)/a that bind: intercept at x = 0, and slope.
    least_line: [f64; 2],
    most_line: [f64; 2],
    /// Greatest x that rows without u allow.
    x: f64,
}

fn range(span: &Span, x: f64, next: f64) -> Range {
    let step = 2.0 * span.length;
    // 0 ≤ x + 2Δu ≤ next.
    let mut range = Range {
        least: -x / step,
        most: (next - x) / step,
        least_line: [0.0, -1.0 / step],
        most_line: [next / step, -1.0 / step],
        x: f64::INFINITY,
    };
    for row in &span.rows {
        if row.u.abs() < NO_SLOPE {
            if row.x != 0.0 {
                range.x = range.x.min(row.limit / row.x.abs());
            }
            continue;
        }
        // |a u + b x| ≤ limit with a > 0 after a change of sign.
        let (a, b) = (row.u.abs(), row.x * row.u.signum());
        let (most, least) = ((row.limit - b * x) / a, (-row.limit - b * x) / a);
        if most < range.most {
            range.most = most;
            range.most_line = [row.limit / a, -b / a];
        }
        if least > range.least {
            range.least = least;
            range.least_line = [-row.limit / a, -b / a];
        }
    }
    range
}

/// A slope, of curves whose speed is 1, that counts as none.
const NO_SLOPE: f64 = 1e-12;

/// Greatest x ≤ `bound` at which some u is allowed. The allowed set is convex and holds x = u = 0. Where at some x the
/// least u is above the most, the two lines that bind there cross at the greatest x that both allow; so x falls from
/// crossing to crossing, at most once for each pair of lines, until the range is not empty.
fn greatest_x(span: &Span, bound: f64, next: f64) -> f64 {
    let mut x = bound.min(range(span, 0.0, next).x);
    for _ in 0..4 * span.rows.len() {
        let range = range(span, x, next);
        if range.least <= range.most {
            return x;
        }
        // least₀ + k x = most₀ + m x
        let crossing =
            (range.most_line[0] - range.least_line[0]) / (range.least_line[1] - range.most_line[1]);
        if crossing.is_nan() || crossing >= x {
            // Rounding: the lines are as good as one.
            return x * (1.0 - ROUNDING);
        }
        x = crossing.max(0.0);
    }
    x
}
