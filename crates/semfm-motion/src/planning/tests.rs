//! From a start to a goal in spaces whose free part is known: paths, shorter paths and curves that are free.

use std::f64::consts::{PI, TAU};

use proptest::prelude::*;

use super::joint_space::{between, straight_length};
use super::test_worlds::{Boxes, joints};
use super::*;
use crate::timing::{
    CheckSettings, JointMotionLimit, MotionLimits, RetimeSettings, check_trajectory, retime,
};

fn found(planned: Planned) -> PlannedPath {
    match planned {
        Planned::Path(path) => path,
        other => panic!("no path: {other:?}"),
    }
}

/// Two axes, −1 … 1, and three long boxes that leave a way in turns above and below.
fn maze() -> Boxes {
    Boxes::of(&[
        (&[-0.55, -1.5], &[-0.45, 0.8]),
        (&[-0.05, -0.8], &[0.05, 1.5]),
        (&[0.45, -1.5], &[0.55, 0.8]),
    ])
}

/// A box around the middle of the first axis, as wide as all others but for a hole.
fn hole(n_joints: usize, half_width: f64) -> Boxes {
    let mut boxes = Vec::new();
    for joint in 1..n_joints {
        for side in [-1.0, 1.0] {
            let (mut lower, mut upper) = (vec![-2.0; n_joints], vec![2.0; n_joints]);
            (lower[0], upper[0]) = (-0.1, 0.1);
            let (a, b) = (side * 2.0, 0.4 + side * half_width);
            (lower[joint], upper[joint]) = (a.min(b), a.max(b));
            boxes.push((lower, upper));
        }
    }
    let boxes: Vec<(&[f64], &[f64])> = boxes.iter().map(|(a, b)| (&a[..], &b[..])).collect();
    Boxes::of(&boxes)
}

/// What planning keeps away from obstacles more than the check of the timed motion, which leaves the curve by a little.
const MARGIN: f64 = 2e-3;
/// Between two free points that are .001 apart, as these worlds look, a box comes nearer by half of that at most.
const BETWEEN_LOOKS: f64 = 5e-4;

/// Plans, shortens, rounds, times; asserts that all of it is free, near and between the same ends.
fn solved(
    space: &JointSpace,
    world: &Boxes,
    start: &[f64],
    goal: &[f64],
    seed: u64,
) -> (PlannedPath, Curve) {
    let settings = PlanSettings { seed, ..PlanSettings::default() };
    let checked_again = world;
    let between_looks = world.with_margin(MARGIN - BETWEEN_LOOKS);
    let world = &world.with_margin(MARGIN);
    let path = found(plan_path(space, world, start, &[goal.to_vec()], &settings).unwrap());
    let short =
        shorten(world, &path.waypoints, &ShortenSettings { seed, ..ShortenSettings::default() });
    assert!(path_length(&short) <= path.length() + 1e-12);
    let end = &path.waypoints[path.waypoints.len() - 1];
    assert!(space.distance(end, goal) < 1e-9);
    for path in [&path.waypoints, &short] {
        assert_eq!((&path[0][..], &path[path.len() - 1]), (start, end));
        assert!(path.windows(2).all(|edge| world.motion_is_free(&edge[0], &edge[1])));
    }
    let tube = 0.05;
    let curve = blend(world, &short, &BlendSettings { tube }).unwrap();
    assert_eq!((curve.start(), curve.end()), (&short[0][..], &end[..]));
    let n = 2000;
    for i in 0..=n {
        let q = curve.position(curve.length() * f64::from(i) / f64::from(n));
        assert!(between_looks.is_free(&q), "{q:?}");
        let distance = distance_from(&short, &q);
        assert!(distance <= tube + 1e-3, "{distance} away from the path");
    }
    let limit = |joint: &JointRange| JointMotionLimit {
        name: joint.name.clone(),
        velocity: 2.0,
        acceleration: 6.0,
        jerk: None,
    };
    let limits = MotionLimits::new(space.joints().iter().map(limit).collect()).unwrap();
    let timed = retime(&curve, &limits, 0.0, &RetimeSettings::default()).unwrap();
    let checked =
        check_trajectory(space, checked_again, &limits, &timed.points, &CheckSettings::default());
    assert_eq!(checked.unwrap().map(|violation| violation.to_string()), None);
    (path, curve)
}

/// Distance of the greatest joint from the nearest of points on a path of straight edges, .001 apart.
fn distance_from(path: &[Vec<f64>], q: &[f64]) -> f64 {
    let mut least = q.iter().zip(&path[0]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    for edge in path.windows(2) {
        let n = (straight_length(&edge[0], &edge[1]) / 1e-3).ceil().max(1.0);
        for i in 0..=n as usize {
            let on = between(&edge[0], &edge[1], i as f64 / n);
            least = least.min(on.iter().zip(q).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max));
        }
    }
    least
}

#[test]
fn mazes_and_holes_are_passed() {
    for seed in 0..4 {
        solved(&joints(2, -1.0, 1.0), &maze(), &[-0.9, -0.9], &[0.9, -0.9], seed);
    }
    for n_joints in 2..=7 {
        let start = vec![-0.8; n_joints];
        let goal = vec![0.8; n_joints];
        solved(
            &joints(n_joints, -1.0, 1.0),
            &hole(n_joints, 0.15 + 0.05 * n_joints as f64),
            &start,
            &goal,
            1,
        );
    }
}

#[test]
fn a_free_line_is_taken_and_a_seed_decides() {
    let space = joints(3, -1.0, 1.0);
    let (path, curve) = solved(&space, &Boxes::none(3), &[-0.5; 3], &[0.5; 3], 0);
    assert_eq!((path.waypoints.len(), path.iterations), (2, 0));
    assert!((curve.length() - 3f64.sqrt()).abs() < 1e-12);

    let space = joints(2, -1.0, 1.0);
    let [a, b, other] =
        [3, 3, 4].map(|seed| solved(&space, &maze(), &[-0.9, -0.9], &[0.9, -0.9], seed).0);
    assert_eq!(a, b);
    assert_ne!(a.waypoints, other.waypoints);
}

#[test]
fn start_and_goal_may_be_one() {
    let (path, curve) = solved(&joints(2, -1.0, 1.0), &maze(), &[-0.9, -0.9], &[-0.9, -0.9], 0);
    assert_eq!((path.waypoints.len(), curve.length()), (1, 0.0));
}

#[test]
fn a_continuous_joint_takes_the_short_way_across_pi() {
    let range =
        |name: &str, limit: f64| JointRange { name: name.into(), lower: -limit, upper: limit };
    let space =
        JointSpace::new(vec![range("turning", f64::INFINITY), range("bounded", 1.0)]).unwrap();
    let mut world = Boxes::of(&[(&[-0.5, -2.0], &[0.5, 2.0])]);
    world.continuous[0] = true;
    let (path, _) = solved(&space, &world, &[3.0, 0.0], &[-3.0, 0.5], 0);
    assert_eq!(path.iterations, 0, "a straight line across π");
    assert!((path.waypoints[1][0] - (TAU - 3.0)).abs() < 1e-12);

    // With a part of the way across π closed, the search still finds it.
    world
        .boxes
        .push(super::test_worlds::BoxObstacle { lower: vec![3.05, -0.6], upper: vec![PI, 2.0] });
    let (path, curve) = solved(&space, &world, &[2.5, 0.0], &[-2.5, 0.5], 0);
    assert!((path.waypoints[path.waypoints.len() - 1][0] - (TAU - 2.5)).abs() < 1e-9);
    assert!(curve.length() < 3.0);
}

#[test]
fn one_of_several_goals_is_reached() {
    let space = joints(2, -1.0, 1.0);
    // The first is enclosed, the second touches.
    let world = Boxes::of(&[
        (&[0.3, -0.5], &[0.4, 0.5]),
        (&[0.8, -0.5], &[0.9, 0.5]),
        (&[0.3, -0.6], &[0.9, -0.5]),
        (&[0.3, 0.5], &[0.9, 0.6]),
    ]);
    let goals = [vec![0.6, 0.0], vec![0.35, 0.0], vec![0.95, 0.0]];
    let path =
        found(plan_path(&space, &world, &[-0.5, 0.0], &goals, &PlanSettings::default()).unwrap());
    assert_eq!(path.goal, 2);
    assert_eq!(path.waypoints[path.waypoints.len() - 1], goals[2]);
}

#[test]
fn what_cannot_be_is_said() {
    let space = joints(2, -1.0, 1.0);
    let world = Boxes::of(&[(&[-0.1, -2.0], &[0.1, 2.0])]);
    let settings = PlanSettings { iterations: 50, ..PlanSettings::default() };
    let plan = |start: [f64; 2], goal: [f64; 2]| {
        plan_path(&space, &world, &start, &[goal.to_vec()], &settings)
    };
    assert!(matches!(plan([-0.5, 0.0], [0.5, 0.0]), Ok(Planned::NotFound { iterations: 50, .. })));
    assert_eq!(plan([0.0, 0.0], [0.5, 0.0]).unwrap(), Planned::StartNotFree);
    assert_eq!(plan([-0.5, 0.0], [0.0, 0.0]).unwrap(), Planned::NoGoalFree);
    assert!(plan([-0.5, 0.0], [1.5, 0.0]).unwrap_err().to_string().contains("goal 0"));
    assert!(plan_path(&space, &world, &[-0.5, 0.0], &[], &settings).is_err());
}

#[test]
fn corners_are_rounded_no_farther_than_obstacles_allow() {
    // The corner's inside is all but filled.
    let world = Boxes::of(&[(&[0.0, 0.02], &[0.98, 1.0])]);
    let path = [vec![0.0, 0.0], vec![1.0, 0.0], vec![1.0, 1.0]];
    let curve = blend(&world, &path, &BlendSettings { tube: 0.1 }).unwrap();
    assert!(curve.stops().is_empty());
    let middle = curve.position(0.5 * curve.length());
    assert!(world.is_free(&middle) && middle[0] < 1.0 && middle[1] > 0.0);
    // Where there is no room at all the motion stops at the corner.
    let tight = Boxes::of(&[(&[0.0, 1e-9], &[1.0 - 1e-9, 1.0])]);
    assert_eq!(blend(&tight, &path, &BlendSettings { tube: 0.1 }).unwrap().stops(), [1.0]);
}

#[test]
fn bad_paths_are_refused() {
    let free = Boxes::none(2);
    let settings = BlendSettings::default();
    assert!(blend(&free, &[], &settings).is_err());
    assert!(blend(&free, &[vec![0.0, 0.0], vec![1.0]], &settings).is_err());
    assert!(blend(&free, &[vec![0.0, f64::NAN]], &settings).is_err());
    assert!(blend(&free, &[vec![0.0, 0.0]], &BlendSettings { tube: -1.0 }).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn random_boxes(
        n_joints in 2usize..6,
        seed in 0u64..1000,
        corners in prop::collection::vec(-1.0..1.0f64, 40),
        start in prop::collection::vec(-1.0..1.0f64, 6),
        goal in prop::collection::vec(-1.0..1.0f64, 6),
    ) {
        let boxes: Vec<(Vec<f64>, Vec<f64>)> = corners
            .chunks_exact(n_joints)
            .map(|lower| (lower.to_vec(), lower.iter().map(|lower| lower + 0.5).collect()))
            .collect();
        let boxes: Vec<(&[f64], &[f64])> = boxes.iter().map(|(a, b)| (&a[..], &b[..])).collect();
        let world = Boxes::of(&boxes);
        let (start, goal) = (&start[..n_joints], &goal[..n_joints]);
        let space = joints(n_joints, -1.0, 1.0);
        let settings = PlanSettings { seed, iterations: 200, ..PlanSettings::default() };
        let with_margin = world.with_margin(MARGIN);
        if let Planned::Path(_) = plan_path(&space, &with_margin, start, &[goal.to_vec()], &settings).unwrap() {
            solved(&space, &world, start, goal, seed);
        }
    }
}
