//! A smooth curve through joint space: straight lines and parabolas.

/// A curve of straight and parabolic pieces over its parameter 0 … [`Curve::length`]. Lines are run through at unit
/// speed; where a line meets a parabola the slope is continuous. At [`Curve::stops`] it is not: there a motion has to
/// stand still for a moment.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    pieces: Vec<CurvePiece>,
    start: Vec<f64>,
    end: Vec<f64>,
}

/// One piece: q(σ) = value + slope σ + ½ curvature σ², 0 ≤ σ ≤ length.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct CurvePiece {
    /// The curve's parameter at which the piece begins.
    pub start: f64,
    pub length: f64,
    pub value: Vec<f64>,
    pub slope: Vec<f64>,
    pub curvature: Vec<f64>,
    /// True where the slope at its beginning is not the one at the end of the piece before.
    pub begins_at_rest: bool,
}

impl CurvePiece {
    pub fn is_line(&self) -> bool {
        self.curvature.iter().all(|&c| c == 0.0)
    }

    /// Joint values at σ after the piece's beginning.
    pub fn position(&self, sigma: f64) -> Vec<f64> {
        (0..self.value.len())
            .map(|j| self.value[j] + (self.slope[j] + 0.5 * self.curvature[j] * sigma) * sigma)
            .collect()
    }

    /// Derivative of the joint values by the parameter.
    pub fn slope(&self, sigma: f64) -> Vec<f64> {
        self.slope
            .iter()
            .zip(&self.curvature)
            .map(|(slope, curvature)| slope + curvature * sigma)
            .collect()
    }
}

impl Curve {
    /// Pieces that follow one another from `start` to `end`; none where the two are the same.
    pub(super) fn new(pieces: Vec<CurvePiece>, start: Vec<f64>, end: Vec<f64>) -> Self {
        Self { pieces, start, end }
    }

    pub(crate) fn pieces(&self) -> &[CurvePiece] {
        &self.pieces
    }

    /// Number of joints.
    pub fn n_joints(&self) -> usize {
        self.start.len()
    }

    /// Where it begins, exactly the path's first waypoint.
    pub fn start(&self) -> &[f64] {
        &self.start
    }

    /// Where it ends, exactly the path's last waypoint.
    pub fn end(&self) -> &[f64] {
        &self.end
    }

    /// The parameter's range, 0 where start and end are all there is.
    pub fn length(&self) -> f64 {
        self.pieces.last().map_or(0.0, |piece| piece.start + piece.length)
    }

    /// Joint values at the parameter `s`, which is cut to 0 … length.
    pub fn position(&self, s: f64) -> Vec<f64> {
        if s <= 0.0 || self.pieces.is_empty() {
            return self.start.clone();
        }
        if s >= self.length() {
            return self.end.clone();
        }
        let piece = &self.pieces[self.piece_at(s)];
        piece.position(s - piece.start)
    }

    /// Parameters between 0 and length at which the slope is not continuous: corners that could not be rounded.
    pub fn stops(&self) -> Vec<f64> {
        self.pieces
            .iter()
            .skip(1)
            .filter(|piece| piece.begins_at_rest)
            .map(|piece| piece.start)
            .collect()
    }

    /// Pieces as numbers, for other programs: start, length and the three coefficients of each.
    pub fn coefficients(&self) -> Vec<CurveCoefficients> {
        self.pieces
            .iter()
            .map(|piece| CurveCoefficients {
                start: piece.start,
                length: piece.length,
                value: piece.value.clone(),
                slope: piece.slope.clone(),
                curvature: piece.curvature.clone(),
            })
            .collect()
    }

    fn piece_at(&self, s: f64) -> usize {
        self.pieces.partition_point(|piece| piece.start <= s).max(1) - 1
    }
}

/// One piece of a [`Curve`]: q(σ) = value + slope σ + ½ curvature σ² for 0 ≤ σ ≤ length, at the parameter start + σ.
#[derive(Clone, Debug, PartialEq)]
pub struct CurveCoefficients {
    /// Parameter at its beginning.
    pub start: f64,
    /// Length of its parameter.
    pub length: f64,
    /// Joint values at its beginning.
    pub value: Vec<f64>,
    /// First derivative there.
    pub slope: Vec<f64>,
    /// Second derivative, the same everywhere.
    pub curvature: Vec<f64>,
}
