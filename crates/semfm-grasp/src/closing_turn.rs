//! By how much an object turns while two pads close on it.

use parry3d_f64::math::Rotation;
use semfm_geom::math::{DQuat, DVec3};

use crate::grasp_distance::angle;
use crate::pad_view::PadView;
use crate::pressure::{PressedSurface, Pressure};

/// Shares of the grip force at which the balance is asked for, in turn: pads first touch lightly, when only
/// what stands out is pressed, and what turned then has turned.
const LOADS: [f64; 4] = [0.03, 0.1, 0.3, 1.0];

/// Steps of the turn, radians.
const STEP: f64 = 0.0087; // half a degree

/// Beyond this the object is no longer the one that was grasped, radians.
const MOST: f64 = 0.7;

/// The object between pads that have closed, where friction holds it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TurnedObject {
    /// Angle by which it has turned, radians in [0, [`MOST`]].
    pub(crate) turn: f64,
    /// The pressure of each pad then, at the full force.
    pub(crate) pressures: [Pressure; 2],
}

/// Turns the object until friction holds it.
///
/// Two pads press with equal forces along the closing axis. Where their pressures' centres lie apart by `d`
/// across that axis they turn the object; friction in both contacts holds it where d ≤ μ w, with `w` the
/// distance of the centres along the axis (both forces then lie in both friction cones, Nguyen 1988). Inertia
/// and weight are left out. `None` where a pad has nothing before it.
pub(crate) fn turn_until_held(view: &PadView, friction: f64, force: f64) -> Option<TurnedObject> {
    let mut rotation = Rotation::IDENTITY;
    let mut surfaces = before_pads(view, rotation);
    let mut pressures = pressed(&surfaces, LOADS[0] * force)?;
    for load in LOADS {
        let mut last = DVec3::ZERO;
        // What has turned away from under a pad is held as well as it was.
        while let Some(now) = pressed(&surfaces, load * force) {
            pressures = now;
            let apart = pressures[0].centre - pressures[1].centre;
            let across = DVec3::new(apart.x, 0.0, apart.z);
            if across.length() <= friction * apart.y.abs() || angle(rotation) >= MOST {
                break;
            }
            // Torque of a force along +y at the first centre and one along -y at the second.
            let axis = across.cross(DVec3::Y).normalize_or_zero();
            if axis.dot(last) < 0.0 {
                break; // half a step to either side of the balance
            }
            last = axis;
            rotation = DQuat::from_axis_angle(axis, STEP) * rotation;
            surfaces = before_pads(view, rotation);
        }
    }
    Some(TurnedObject { turn: angle(rotation), pressures })
}

/// What lies before each pad of the object turned about the TCP.
fn before_pads(view: &PadView, rotation: Rotation) -> [PressedSurface; 2] {
    [-1.0, 1.0].map(|side| {
        let points = &view.points[usize::from(side > 0.0)];
        let turned = points.iter().map(|&p| rotation * p);
        PressedSurface::new(turned.filter(|&p| view.before_pad(p)).collect(), side, view.cell_area)
    })
}

fn pressed(surfaces: &[PressedSurface; 2], force: f64) -> Option<[Pressure; 2]> {
    let [left, right] = surfaces;
    Some([left.pressure(force)?, right.pressure(force)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two surfaces before pads of 18 mm, heights over x.
    fn view(left: impl Fn(f64) -> f64, right: impl Fn(f64) -> f64) -> PadView {
        let cell = 1.5e-3;
        let at = |i: usize| (i as f64 - 7.5) * cell;
        let grid = |y: &dyn Fn(f64) -> f64| {
            let places = (0..256).map(|i| (at(i / 16), at(i % 16)));
            places.map(|(x, z)| DVec3::new(x, y(x), z)).collect()
        };
        let points = [grid(&left), grid(&right)];
        PadView { points, cell_area: cell * cell, half_pad: [9e-3; 2] }
    }

    #[test]
    fn a_block_stays_and_a_turned_block_turns_until_it_lies_flat() {
        let block = view(|_| -0.01, |_| 0.01);
        assert_eq!(turn_until_held(&block, 0.5, 30.0).unwrap().turn, 0.0);
        // A bar of 2 cm, askew by 8°: its corners' contacts lie 18 mm apart, more than μ w = 10 mm.
        let slope = 8f64.to_radians().tan();
        let askew = view(|x| -0.01 + slope * x, |x| 0.01 + slope * x);
        let turned = turn_until_held(&askew, 0.5, 30.0).unwrap();
        assert!((4f64.to_radians()..=8.5f64.to_radians()).contains(&turned.turn), "{turned:?}");
        // More friction holds it earlier.
        assert!(turn_until_held(&askew, 2.0, 30.0).unwrap().turn < turned.turn);
    }

    #[test]
    fn a_thin_plate_comes_to_rest() {
        // Of 2 mm, a little askew and with a ridge: no force may lie 1 mm beside the other.
        let slope = 3f64.to_radians().tan();
        let plate =
            view(|x| -1e-3 + slope * x, |x| 1e-3 + slope * x + if x > 6e-3 { 2e-4 } else { 0.0 });
        let turned = turn_until_held(&plate, 0.5, 30.0).unwrap();
        assert!(turned.turn < 5f64.to_radians(), "{turned:?}");
    }

    #[test]
    fn a_cylinder_across_the_pads_does_not_turn() {
        let y = |x: f64| (0.02f64.powi(2) - x * x).sqrt();
        let turned = turn_until_held(&view(|x| -y(x), y), 0.3, 30.0).unwrap();
        assert_eq!(turned.turn, 0.0);
        assert!(turned.pressures[0].area < 0.5 * 0.018 * 0.018);
        let nothing = PadView { points: [Vec::new(), Vec::new()], ..view(|_| 0.0, |_| 0.0) };
        assert!(turn_until_held(&nothing, 0.3, 30.0).is_none());
    }
}
