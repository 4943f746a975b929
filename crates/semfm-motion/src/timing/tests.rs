//! What defines a timed motion: limits at every millisecond, rest at both ends, rising times, near the curve; and paths
//! at which other implementations are known to fail.

use proptest::prelude::*;

use super::*;
use crate::TrajectoryPoint;
use crate::planning::test_worlds::{Boxes, joints};
use crate::planning::{BlendSettings, Curve, blend};

fn limits(n_joints: usize, velocity: f64, acceleration: f64, jerk: Option<f64>) -> MotionLimits {
    let joint = |j| JointMotionLimit { name: format!("j{j}"), velocity, acceleration, jerk };
    MotionLimits::new((0..n_joints).map(joint).collect()).unwrap()
}

fn curve(waypoints: &[Vec<f64>], tube: f64) -> Curve {
    blend(&Boxes::none(waypoints[0].len()), waypoints, &BlendSettings { tube }).unwrap()
}

/// Half of the distance between points that stand for a curve.
const SPACING: f64 = 5e-4;

fn points_on(curve: &Curve) -> Vec<Vec<f64>> {
    let n = (curve.length() / (2.0 * SPACING)).ceil().max(1.0);
    (0..=n as usize).map(|i| curve.position(curve.length() * i as f64 / n)).collect()
}

/// Distance of the greatest joint from the nearest of some points.
fn distance_from(points: &[Vec<f64>], q: &[f64]) -> f64 {
    let distance = |on: &Vec<f64>| on.iter().zip(q).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    points.iter().map(distance).fold(f64::INFINITY, f64::min)
}

/// Times the curve and asserts all that is promised; the motion's duration.
fn timed(curve: &Curve, limits: &MotionLimits) -> Retimed {
    let n_joints = curve.n_joints();
    let settings = RetimeSettings::default();
    let retimed = retime(curve, limits, 0.04, &settings).unwrap();
    let space = joints(n_joints, -100.0, 100.0);
    let free = Boxes::none(n_joints);
    let checked =
        check_trajectory(&space, &free, limits, &retimed.points, &CheckSettings::default());
    assert_eq!(checked.unwrap().map(|violation| violation.to_string()), None);

    let points = &retimed.points;
    let (first, last) = (&points[0], &points[points.len() - 1]);
    assert_eq!((first.time, &first.positions[..]), (0.0, curve.start()));
    assert_eq!(last.positions, curve.end());
    assert!(first.velocities.iter().chain(&last.velocities).all(|&v| v == 0.0));
    assert!(
        points.windows(2).all(|pair| pair[1].time > pair[0].time + 1e-6),
        "times rise by more than a microsecond"
    );
    assert!(points.iter().all(|point| point.opening == 0.04));
    assert!(retimed.deviation <= settings.tolerance);

    let on_curve = points_on(curve);
    let mut part = 0;
    let millis = (retimed.duration() * 1e3).ceil() as usize;
    for millisecond in 0..=millis {
        let time = (millisecond as f64 * 1e-3).min(last.time);
        while points[part + 1].time < time {
            part += 1;
        }
        let state = points[part].between(&points[part + 1], time);
        for (j, limit) in limits.joints().iter().enumerate() {
            assert!(
                state.velocities[j].abs() <= limit.velocity * (1.0 + 1e-9),
                "velocity at {time}"
            );
            assert!(
                state.accelerations[j].abs() <= limit.acceleration * (1.0 + 1e-9),
                "acceleration at {time}"
            );
        }
        if millisecond % 16 == 0 {
            let distance = distance_from(&on_curve, &state.positions);
            assert!(distance <= settings.tolerance + SPACING, "distance {distance} at {time}");
        }
    }
    retimed
}

#[test]
fn one_joint_from_rest_to_rest_takes_what_a_trapezoid_takes() {
    let retimed = timed(&curve(&[vec![0.0], vec![2.0]], 0.1), &limits(1, 1.0, 4.0, None));
    // d/v + v/a
    assert!((retimed.fastest - 2.25).abs() < 1e-3, "{}", retimed.fastest);
    assert!(retimed.duration() < 2.25 + 0.011);
    let triangle = timed(&curve(&[vec![0.0], vec![0.04]], 0.1), &limits(1, 1.0, 4.0, None));
    // 2 √(d/a)
    assert!((triangle.fastest - 0.2).abs() < 2e-3, "{}", triangle.fastest);
}

#[test]
fn near_equal_waypoints_cost_no_time() {
    let limits = limits(3, 2.0, 5.0, None);
    let (a, b) = (vec![0.0, 0.0, 0.0], vec![1.0, 0.5, -0.8]);
    let plain = timed(&curve(&[a.clone(), b.clone()], 0.05), &limits);
    for apart in [1e-15, 1e-9, 1e-6, 1e-4] {
        let near = |by: f64| vec![0.5 + by, 0.25 - by, -0.4 + by];
        let path = [a.clone(), near(0.0), near(apart), near(-apart), near(0.0), b.clone()];
        let retimed = timed(&curve(&path, 0.05), &limits);
        assert!(retimed.duration() < 1.01 * plain.duration(), "{apart}: {}", retimed.duration());
    }
    let doubled = [a.clone(), a.clone(), b.clone(), b.clone()];
    assert!((timed(&curve(&doubled, 0.05), &limits).duration() - plain.duration()).abs() < 1e-9);
}

#[test]
fn a_turn_by_180_degrees_is_a_short_stop() {
    let limits = limits(2, 2.0, 5.0, None);
    let path = [vec![0.0, 0.0], vec![1.0, 0.5], vec![0.0, 0.0]];
    let there = timed(&curve(&path[..2], 0.05), &limits).duration();
    let back = timed(&curve(&path, 0.05), &limits).duration();
    assert!(back > 1.6 * there && back < 2.0 * there + 0.02, "{back} {there}");
    let cornered = curve(&path, 0.0);
    assert_eq!(cornered.stops().len(), 1);
    assert!((timed(&cornered, &limits).duration() - 2.0 * there).abs() < 0.05);
}

#[test]
fn centimetre_moves_are_short() {
    let limits = limits(2, 1.0, 10.0, Some(1000.0));
    let retimed = timed(&curve(&[vec![0.3, 0.0], vec![0.31, 0.0]], 0.05), &limits);
    assert!(retimed.duration() < 0.1, "{}", retimed.duration());
    let corner =
        timed(&curve(&[vec![0.3, 0.0], vec![0.31, 0.0], vec![0.31, 0.01]], 0.001), &limits);
    assert!(corner.duration() < 0.2, "{}", corner.duration());
    for tiny in [1e-3, 1e-5, 1e-8, 1e-12] {
        timed(&curve(&[vec![0.3, 0.0], vec![0.3 + tiny, 0.0]], 0.05), &limits);
    }
}

#[test]
fn a_path_without_length_stands() {
    let limits = limits(2, 1.0, 10.0, None);
    for path in [vec![vec![0.3, 0.1]], vec![vec![0.3, 0.1]; 3]] {
        let retimed = timed(&curve(&path, 0.1), &limits);
        assert_eq!(retimed.points.len(), 2);
        assert!(retimed.duration() > 0.0);
    }
}

#[test]
fn jerk_is_limited_where_it_has_a_limit() {
    for jerk in [20.0, 200.0, 5000.0] {
        let limits = limits(2, 1.5, 8.0, Some(jerk));
        let retimed =
            timed(&curve(&[vec![0.0, 0.0], vec![1.0, 0.2], vec![1.2, 1.0]], 0.1), &limits);
        assert!(retimed.jerk_limited);
        for pair in retimed.points.windows(2) {
            let [a, b] =
                [0.001, 0.999].map(|share| pair[0].time + share * (pair[1].time - pair[0].time));
            let [from, to] = [a, b].map(|time| pair[0].between(&pair[1], time));
            for j in 0..2 {
                let found = (to.accelerations[j] - from.accelerations[j]) / (b - a);
                assert!(found.abs() < jerk * (1.0 + 1e-3), "{found} {jerk}");
            }
        }
    }
}

#[test]
fn many_small_edges_of_a_straight_line_are_as_fast_as_one() {
    let limits = limits(3, 2.0, 5.0, None);
    let along = |share: f64| vec![share, 0.5 * share, -0.8 * share];
    let whole = timed(&curve(&[along(0.0), along(1.0)], 1e-3), &limits).duration();
    let path: Vec<Vec<f64>> = (0..=40).map(|i| along(f64::from(i) / 40.0)).collect();
    assert!(timed(&curve(&path, 1e-3), &limits).duration() < 1.01 * whole);
}

#[test]
fn a_violation_is_named_with_time_joint_and_numbers() {
    let limits = limits(2, 1.0, 4.0, None);
    let retimed = timed(&curve(&[vec![0.0, 0.0], vec![1.0, 0.0]], 0.1), &limits);
    let space = joints(2, -2.0, 2.0);
    let world = Boxes::of(&[(&[0.5, -0.1], &[0.6, 0.1])]);
    let named = |space: &crate::JointSpace,
                 world: &Boxes,
                 limits: &MotionLimits,
                 points: &[TrajectoryPoint]| {
        check_trajectory(space, world, limits, points, &CheckSettings::default()).unwrap().unwrap()
    };
    let contact = named(&space, &world, &limits, &retimed.points);
    // ½ at² up to 1/8 s … then v = 1: 0.5 is reached after .5 + .125 s, and half a window later.
    assert!((contact.time - 0.63).abs() < 2e-3, "{contact}");
    assert!(contact.to_string().contains("box 0"), "{contact}");

    let narrow =
        named(&joints(2, -2.0, 0.9), &Boxes::none(2), &limits, &retimed.points).to_string();
    assert!(narrow.contains("j0") && narrow.contains("0.9"), "{narrow}");
    let slow = self::limits(2, 0.5, 4.0, None);
    let fast = named(&space, &Boxes::none(2), &slow, &retimed.points).to_string();
    assert!(fast.contains("velocity") && fast.contains("0.5"), "{fast}");
    let weak = self::limits(2, 1.0, 3.0, None);
    let hard = named(&space, &Boxes::none(2), &weak, &retimed.points).to_string();
    assert!(hard.contains("acceleration") && hard.contains('3'), "{hard}");
    let smooth = self::limits(2, 1.0, 4.0, Some(10.0));
    assert!(named(&space, &Boxes::none(2), &smooth, &retimed.points).to_string().contains("jerk"));

    let cut = &retimed.points[..retimed.points.len() / 2];
    assert!(named(&space, &Boxes::none(2), &limits, cut).to_string().contains("at rest"));
    let mut standing = retimed.points.clone();
    standing[3].time = standing[2].time;
    assert!(matches!(
        named(&space, &Boxes::none(2), &limits, &standing).kind,
        ViolationKind::TimeStands { .. }
    ));
}

#[test]
fn an_obstacle_thinner_than_a_step_is_found() {
    // At a radian a second a millisecond is a milliradian; the box is .6 of it thick.
    let limits = limits(2, 1.0, 4.0, None);
    let retimed = timed(&curve(&[vec![0.0, 0.0], vec![1.0, 0.0]], 0.1), &limits);
    for at in [0.3, 0.7003, 0.9001] {
        let world = Boxes::of(&[(&[at, -0.1], &[at + 6e-4, 0.1])]);
        let space = joints(2, -2.0, 2.0);
        let violation =
            check_trajectory(&space, &world, &limits, &retimed.points, &CheckSettings::default());
        let Some(Violation { kind: ViolationKind::Contact { positions, .. }, .. }) =
            violation.unwrap()
        else {
            panic!("the box at {at} was not found")
        };
        assert!(positions[0] >= at && positions[0] <= at + 6e-4);
    }
}

#[test]
fn limits_and_settings_are_checked() {
    let bad =
        JointMotionLimit { name: "elbow".into(), velocity: 0.0, acceleration: 1.0, jerk: None };
    assert!(MotionLimits::new(vec![bad]).unwrap_err().to_string().contains("elbow"));
    let curve = curve(&[vec![0.0, 0.0], vec![1.0, 0.0]], 0.1);
    assert!(retime(&curve, &limits(3, 1.0, 1.0, None), 0.0, &RetimeSettings::default()).is_err());
    let settings = RetimeSettings { tolerance: 0.0, ..Default::default() };
    assert!(retime(&curve, &limits(2, 1.0, 1.0, None), 0.0, &settings).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn every_motion_keeps_its_promises(
        n_joints in 1usize..8,
        n_waypoints in 2usize..9,
        values in prop::collection::vec(-1.5..1.5f64, 64),
        tube in prop::sample::select(vec![0.0, 1e-3, 0.02, 0.2]),
        velocity in 0.3..3.0f64,
        acceleration in 0.5..20.0f64,
        jerk in prop::sample::select(vec![None, Some(30.0), Some(3000.0)]),
    ) {
        let waypoints: Vec<Vec<f64>> = values.chunks(n_joints).take(n_waypoints).map(<[f64]>::to_vec).collect();
        timed(&curve(&waypoints, tube), &limits(n_joints, velocity, acceleration, jerk));
    }
}
