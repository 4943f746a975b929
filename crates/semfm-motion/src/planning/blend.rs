//! Round corners: each corner of a path gives way to a parabola within a stated distance.

use super::bisection::{Stretch, first_contact};
use super::curve::{Curve, CurvePiece};
use super::joint_space::straight_length;
use super::validity::Validity;
use crate::{Error, Result};

/// How far a curve may leave its path.
#[derive(Clone, Debug, PartialEq)]
pub struct BlendSettings {
    /// Greatest distance of any joint from the path, radians or metres; 0 keeps all corners, and a motion stops at each.
    pub tube: f64,
}

impl Default for BlendSettings {
    fn default() -> Self {
        Self { tube: 0.1 }
    }
}

/// The path with round corners. Near-equal waypoints (closer than an eighth of the tube) become one first. The parabola
/// at a corner reaches as far as the tube and half of each edge allow; where `validity` finds something touching
/// along it, it is halved until it is free, and after five halvings the corner stays: see [`Curve::stops`].
///
/// Of a free path the curve is free: lines lie on its edges, parabolas were checked.
///
/// With unit slopes d₁ and d₂ before and after a corner p and the reach l, q(σ) = p − l d₁ + σ d₁ + ½ σ² (d₂ − d₁) / 2l for
/// 0 ≤ σ ≤ 2l. Its slope runs from d₁ to d₂, and its middle is l (d₂ − d₁) / 4 away from the corner.
///
/// # Errors
/// [`Error::Invalid`] where there is no waypoint, one has another number of joints, a number is not finite, or the tube
/// is negative.
pub fn blend(
    validity: &impl Validity,
    waypoints: &[Vec<f64>],
    settings: &BlendSettings,
) -> Result<Curve> {
    check(waypoints, settings)?;
    let merged = merge(waypoints, settings.tube * NEAR);
    let changed = merged.len() != waypoints.len();
    let merged_free =
        !changed || merged.windows(2).all(|edge| validity.motion_is_free(&edge[0], &edge[1]));
    let (corners, tube) = if merged_free {
        (merged, settings.tube * (1.0 - NEAR))
    } else {
        (merge(waypoints, 0.0), settings.tube)
    };
    Ok(rounded(validity, &corners, tube))
}

/// Share of the tube within which waypoints count as one.
const NEAR: f64 = 0.125;

/// How often a parabola that is not free is halved before its corner stays.
const HALVINGS: usize = 5;

/// Waypoints that are farther than `near` from the one before, in the greatest joint; the first and the last stay.
fn merge(waypoints: &[Vec<f64>], near: f64) -> Vec<Vec<f64>> {
    let last = &waypoints[waypoints.len() - 1];
    let mut merged = vec![waypoints[0].clone()];
    for waypoint in &waypoints[..waypoints.len() - 1] {
        if apart(waypoint, &merged[merged.len() - 1]) > near {
            merged.push(waypoint.clone());
        }
    }
    while merged.len() > 1 && apart(last, &merged[merged.len() - 1]) <= near {
        merged.pop();
    }
    if merged[merged.len() - 1] != *last {
        merged.push(last.clone());
    }
    merged
}

fn apart(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn rounded(validity: &impl Validity, corners: &[Vec<f64>], tube: f64) -> Curve {
    let start = corners[0].clone();
    let end = corners[corners.len() - 1].clone();
    let lengths: Vec<f64> =
        corners.windows(2).map(|edge| straight_length(&edge[0], &edge[1])).collect();
    let slopes: Vec<Vec<f64>> = corners
        .windows(2)
        .zip(&lengths)
        .map(|(edge, length)| edge[0].iter().zip(&edge[1]).map(|(a, b)| (b - a) / length).collect())
        .collect();
    let mut pieces: Vec<CurvePiece> = Vec::new();
    let mut at = 0.0;
    let mut push = |pieces: &mut Vec<CurvePiece>, piece: Piece, rest: bool| {
        let (value, slope, curvature) = (piece.value, piece.slope, piece.curvature);
        pieces.push(CurvePiece {
            start: at,
            length: piece.length,
            value,
            slope,
            curvature,
            begins_at_rest: rest,
        });
        at += piece.length;
    };
    // Reach of the parabola at the beginning of an edge.
    let mut reach_before = 0.0;
    let mut rest = true;
    for edge in 0..lengths.len() {
        let parabola = (edge + 1 < lengths.len())
            .then(|| {
                let room = 0.5 * lengths[edge].min(lengths[edge + 1]);
                corner(validity, &corners[edge + 1], &slopes[edge], &slopes[edge + 1], room, tube)
            })
            .flatten();
        let reach = parabola.as_ref().map_or(0.0, |piece| 0.5 * piece.length);
        let straight = lengths[edge] - reach_before - reach;
        if straight > SHORTEST_LINE * lengths[edge] {
            let value = moved(&corners[edge], &slopes[edge], reach_before);
            let curvature = vec![0.0; value.len()];
            push(
                &mut pieces,
                Piece { length: straight, value, slope: slopes[edge].clone(), curvature },
                rest,
            );
            rest = false;
        }
        match parabola {
            Some(piece) => {
                push(&mut pieces, piece, rest);
                rest = false;
            }
            None => rest = true,
        }
        reach_before = reach;
    }
    Curve::new(pieces, start, end)
}

/// Share of an edge below which what two parabolas leave of it is rounding.
const SHORTEST_LINE: f64 = 1e-9;

struct Piece {
    length: f64,
    value: Vec<f64>,
    slope: Vec<f64>,
    curvature: Vec<f64>,
}

/// The parabola at a corner, or `None` where none is free.
fn corner(
    validity: &impl Validity,
    at: &[f64],
    before: &[f64],
    after: &[f64],
    room: f64,
    tube: f64,
) -> Option<Piece> {
    let turn: Vec<f64> = before.iter().zip(after).map(|(before, after)| after - before).collect();
    let greatest = turn.iter().fold(0.0f64, |greatest, turn| greatest.max(turn.abs()));
    // The middle is reach · turn / 4 away from the corner.
    let mut reach = room.min(4.0 * tube / greatest);
    for _ in 0..=HALVINGS {
        if reach.is_nan() || reach <= 0.0 {
            return None;
        }
        let piece = Piece {
            length: 2.0 * reach,
            value: moved(at, before, -reach),
            slope: before.to_vec(),
            curvature: turn.iter().map(|turn| turn / (2.0 * reach)).collect(),
        };
        if first_contact(validity, &piece, 0.0, piece.length).is_none() {
            return Some(piece);
        }
        reach *= 0.5;
    }
    None
}

impl Stretch for Piece {
    fn position(&self, at: f64) -> Vec<f64> {
        (0..self.value.len())
            .map(|j| self.value[j] + (self.slope[j] + 0.5 * self.curvature[j] * at) * at)
            .collect()
    }

    fn travel(&self, middle: f64, half: f64) -> Vec<f64> {
        self.slope
            .iter()
            .zip(&self.curvature)
            .map(|(slope, curvature)| {
                ((slope + curvature * middle).abs() + 0.5 * curvature.abs() * half) * half
            })
            .collect()
    }
}

fn moved(from: &[f64], slope: &[f64], by: f64) -> Vec<f64> {
    from.iter().zip(slope).map(|(from, slope)| from + slope * by).collect()
}

fn check(waypoints: &[Vec<f64>], settings: &BlendSettings) -> Result<()> {
    let invalid = |what: String, expected: &str, found: String| {
        Err(Error::Invalid { what, expected: expected.into(), found })
    };
    let Some(first) = waypoints.first() else {
        return invalid("waypoints".into(), "at least one", "none".into());
    };
    for (index, waypoint) in waypoints.iter().enumerate() {
        if waypoint.len() != first.len() || waypoint.iter().any(|value| !value.is_finite()) {
            let expected = format!("{} finite joint values, at least one", first.len());
            return invalid(format!("waypoint {index}"), &expected, format!("{waypoint:?}"));
        }
    }
    if first.is_empty() {
        return invalid("waypoint 0".into(), "at least one joint value", "none".into());
    }
    if !(settings.tube >= 0.0 && settings.tube.is_finite()) {
        return invalid("tube".into(), "a distance of at least 0", settings.tube.to_string());
    }
    Ok(())
}
