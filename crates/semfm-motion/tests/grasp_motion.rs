//! From grasps to motions with a small arm: what is found keeps its limits and touches nothing, and what is not found
//! says why.

use std::f64::consts::PI;
use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;

use parry3d_f64::shape::SharedShape;
use semfm_geom::Task;
use semfm_geom::math::{DQuat, DVec3};
use semfm_motion::{
    CollisionBody, CollisionModel, CollisionSettings, Ending, Gate, GateCount, GraspOutcome, Hand,
    HandPart, MotionAnswer, MotionPlanner, MotionRequest, MotionSettings, Obstruction, Pose, Scene,
    SegmentKind, TargetGrasp, TargetObject,
};
use semfm_robot::{Arm, ArmSettings, Geometry, MeshPaths, RobotDescription, Role};

/// A posture above the table, hand down.
const START: [f64; 7] = [0.3, 0.2, 0.0, 1.6, 0.0, 1.3, 0.0];

/// Axes z, y, z, y, z, y, z over 0.2, 0.13, 0.2, 0.18, 0.2, 0.16, 0.07 m, the flange 0.06 m above the last.
fn urdf() -> String {
    let heights = [0.2, 0.13, 0.2, 0.18, 0.2, 0.16, 0.07];
    let mut urdf = String::from("<robot name=\"small\"><link name=\"base\"/>");
    for (i, height) in heights.iter().enumerate() {
        let (axis, limit) = if i % 2 == 0 { ("0 0 1", 2.9) } else { ("0 1 0", 2.2) };
        let parent = if i == 0 { "base".to_owned() } else { format!("link{i}") };
        let child = i + 1;
        write!(
            urdf,
            "<link name=\"link{child}\"><collision><origin xyz=\"0 0 0.05\"/><geometry><cylinder radius=\"0.05\" \
             length=\"0.1\"/></geometry></collision></link>\
             <joint name=\"joint{child}\" type=\"revolute\"><parent link=\"{parent}\"/><child link=\"link{child}\"/>\
             <origin xyz=\"0 0 {height}\"/><axis xyz=\"{axis}\"/>\
             <limit lower=\"-{limit}\" upper=\"{limit}\" velocity=\"2\" effort=\"9\"/></joint>"
        )
        .unwrap();
    }
    urdf + "<link name=\"flange\"/><joint name=\"f\" type=\"fixed\"><parent link=\"link7\"/><child link=\"flange\"/>\
            <origin xyz=\"0 0 0.06\"/></joint></robot>"
}

fn planner() -> MotionPlanner {
    let path = Path::new("small.urdf");
    let robot = RobotDescription::parse(urdf().as_bytes(), path).unwrap().tree().unwrap();
    let settings = ArmSettings { tip: Some("flange".into()), ..Default::default() };
    let arm = Arc::new(Arm::new(Arc::new(robot), &settings).unwrap());
    let paths = MeshPaths::new(path, &Default::default());
    let settings = CollisionSettings { n_samples: 500, ..Default::default() };
    MotionPlanner::new(Arc::new(CollisionModel::new(arm, &paths, None, &settings).unwrap()))
        .unwrap()
}

/// A palm and two fingers; the TCP is 0.11 m above the flange.
fn hand() -> Hand {
    let part = |name: &str, role, half: [f64; 3]| HandPart {
        name: name.into(),
        role,
        pieces: vec![(Pose::IDENTITY, SharedShape::cuboid(half[0], half[1], half[2]))],
    };
    let parts = vec![
        part("palm", Role::Palm, [0.025, 0.09, 0.03]),
        part("finger", Role::Left, [0.009, 0.008, 0.025]),
        part("finger", Role::Right, [0.009, 0.008, 0.025]),
    ];
    Hand::new(parts, &tcp_from_parts(0.04))
}

fn tcp_from_parts(width: f64) -> Vec<Pose> {
    let y = width / 2.0 + 0.008;
    vec![
        Pose::translation(0.0, 0.0, -0.07),
        Pose::translation(0.0, -y, -0.01),
        Pose::translation(0.0, y, -0.01),
    ]
}

/// From above, the closing direction turned by `angle` about the vertical.
fn grasp(at: DVec3, angle: f64) -> TargetGrasp {
    let down = DQuat::from_rotation_x(PI);
    TargetGrasp {
        base_from_tcp: Pose::from_parts(at, DQuat::from_rotation_z(angle) * down),
        tip_from_tcp: Pose::translation(0.0, 0.0, 0.11),
        width: 0.03,
        opening: 0.07,
        score: 0.8,
        closed: tcp_from_parts(0.03),
        open: tcp_from_parts(0.07),
    }
}

/// A bar of 3 × 3 × 12 cm that stands on the table z = 0 at x = 0.45 m.
fn request() -> MotionRequest {
    let body = SharedShape::cuboid(0.015, 0.015, 0.06);
    let body = CollisionBody::from_pieces(&[(Pose::IDENTITY, body)]).unwrap();
    let top = DVec3::new(0.45, 0.0, 0.11);
    MotionRequest {
        start: START.to_vec(),
        hand: hand(),
        grasps: vec![grasp(top, 0.0), grasp(top, PI / 2.0)],
        object: Some(TargetObject { body, base_from_object: Pose::translation(0.45, 0.0, 0.06) }),
        scene: Scene::new().with_table("table", DVec3::ZERO, DVec3::Z).unwrap(),
        settings: MotionSettings::default(),
    }
}

fn plan(request: &MotionRequest) -> MotionAnswer {
    planner().plan(request, &Task::default()).unwrap()
}

/// The gate and the reason of the first grasp.
fn first_gate(answer: &MotionAnswer) -> (Gate, Obstruction) {
    match &answer.outcomes[0].ending {
        Ending::Stopped { gate, obstruction } => (*gate, obstruction.clone()),
        other => panic!("{other:?}"),
    }
}

#[test]
fn the_motion_approaches_along_the_line_closes_and_lifts() {
    let request = request();
    let planner = planner();
    let answer = planner.plan(&request, &Task::default()).unwrap();
    let motion = answer.motion.as_ref().unwrap_or_else(|| panic!("{:?}", answer.gates()));
    let kinds: Vec<SegmentKind> = motion.trajectory.segments.iter().map(|s| s.kind).collect();
    let all =
        [SegmentKind::ToPreGrasp, SegmentKind::Approach, SegmentKind::Close, SegmentKind::Lift];
    assert_eq!(kinds, all);
    // Segments follow one another without a gap, at rest.
    for pair in motion.trajectory.segments.windows(2) {
        let (end, start) = (pair[0].points.last().unwrap(), &pair[1].points[0]);
        assert_eq!(end.time, start.time);
        let off = end.positions.iter().zip(&start.positions).map(|(a, b)| (a - b).abs());
        assert!(off.fold(0.0, f64::max) < 1e-9);
        assert!(end.velocities.iter().chain(&start.velocities).all(|&v| v == 0.0));
    }
    let tip = |time: f64| {
        let point = motion.trajectory.at(time).unwrap();
        planner.arm().base_from_tip(&point.positions) * motion.target.tip_from_tcp
    };
    let [_, approach, close, lift] = all.map(|kind| motion.trajectory.segment(kind).unwrap());
    // The TCP ends where the grasp is, on a straight line of 10 cm along its approach.
    let at_grasp = tip(close.points[0].time);
    let wanted = motion.target.base_from_tcp;
    assert!(at_grasp.translation.distance(wanted.translation) < 1e-4);
    let (from, to) = (approach.points[0].time, approach.points.last().unwrap().time);
    let direction = wanted.rotation * DVec3::Z;
    assert!((tip(from).translation + 0.1 * direction).distance(wanted.translation) < 1e-4);
    for i in 0..=100 {
        let at = tip(from + f64::from(i) / 100.0 * (to - from)).translation - wanted.translation;
        let off = (at - at.dot(direction) * direction).length();
        assert!(off < 2e-3, "{off} m off the line of the approach");
    }
    let lifted = tip(lift.points.last().unwrap().time).translation - at_grasp.translation;
    assert!(lifted.distance(DVec3::Z * 0.1) < 1e-4, "{lifted:?}");
    // One grasp was planned, the other one not tried.
    assert_eq!(answer.outcomes.iter().filter(|o| o.ending == Ending::Planned).count(), 1);
    assert_eq!(answer.outcomes.iter().filter(|o| o.ending == Ending::NotTried).count(), 1);
}

#[test]
fn the_same_seed_gives_the_same_motion() {
    let (a, b) = (plan(&request()), plan(&request()));
    assert_eq!(a.motion.unwrap().trajectory, b.motion.unwrap().trajectory);
    assert_eq!(a.outcomes, b.outcomes);
}

#[test]
fn far_grasps_say_by_how_much_they_are_missed() {
    let far = DVec3::new(1.5, 0.0, 0.1);
    let answer = plan(&MotionRequest { grasps: vec![grasp(far, 0.0)], ..request() });
    let (gate, Obstruction::Unreachable { position, .. }) = first_gate(&answer) else { panic!() };
    assert_eq!(gate, Gate::Reach);
    assert!((0.3..1.2).contains(&position), "{position}");
    let [GateCount { gate: Gate::Reach, n: 1, .. }] = answer.gates()[..] else { panic!() };
}

#[test]
fn what_stands_in_the_way_is_named_with_its_depth() {
    // A bar where the palm would be at the grasp.
    let bar = Geometry::Box { size: DVec3::new(0.02, 0.3, 0.02) };
    let at = Pose::translation(0.45, 0.0, 0.2);
    let scene = request().scene.with_primitive("bar", &bar, at).unwrap();
    let answer = plan(&MotionRequest { scene, ..request() });
    assert!(answer.motion.is_none());
    let (gate, obstruction) = first_gate(&answer);
    assert_eq!(gate, Gate::Grasp, "{obstruction}");
    let text = obstruction.to_string();
    assert!(text.contains("bar") && text.contains("mm"), "{text}");
}

#[test]
fn a_line_that_leaves_the_reach_says_where() {
    let settings = MotionSettings { approach: 1.5, ..Default::default() };
    let answer = plan(&MotionRequest { settings, ..request() });
    let (gate, Obstruction::Line { at, length, .. }) = first_gate(&answer) else { panic!() };
    assert_eq!(gate, Gate::Approach);
    assert!((length - 1.5).abs() < 1e-12, "{length}");
    assert!((0.1..1.2).contains(&at), "{at}");
}

#[test]
fn a_start_that_touches_is_named_and_a_free_one_is_offered() {
    let mut start = START;
    start[1] = 1.9; // into the table
    let answer = plan(&MotionRequest { start: start.to_vec(), ..request() });
    let contact = answer.start_contact.as_ref().unwrap();
    assert!([&contact.contact.a, &contact.contact.b].contains(&&"table".to_owned()), "{contact:?}");
    let free = contact.nearest_free.clone().unwrap();
    let answer = plan(&MotionRequest { start: free, ..request() });
    assert!(answer.start_contact.is_none());
}

#[test]
fn without_grasps_there_is_no_motion() {
    let answer = plan(&MotionRequest { grasps: Vec::new(), ..request() });
    assert!(answer.motion.is_none() && answer.outcomes == Vec::<GraspOutcome>::new());
}

#[test]
fn unsound_requests_are_refused() {
    let planner = planner();
    let task = Task::default();
    let far = MotionRequest { start: vec![9.0; 7], ..request() };
    assert!(planner.plan(&far, &task).unwrap_err().to_string().contains("joint1"));
    let short = MotionRequest { start: vec![0.0; 3], ..request() };
    assert!(planner.plan(&short, &task).is_err());
    let settings = MotionSettings { speed: 0.0, ..Default::default() };
    let standing = MotionRequest { settings, ..request() };
    assert!(planner.plan(&standing, &task).unwrap_err().to_string().contains("speed"));
    let mut nowhere = request();
    nowhere.grasps[0].base_from_tcp.translation.x = f64::NAN;
    assert!(planner.plan(&nowhere, &task).is_err());
    let handless = MotionRequest { hand: Hand::new(Vec::new(), &[]), ..request() };
    assert!(planner.plan(&handless, &task).is_err());
    let task = Task::default();
    task.cancel();
    assert!(planner.plan(&request(), &task).is_err());
}
