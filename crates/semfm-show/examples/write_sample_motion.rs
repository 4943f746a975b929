//! Writes a small motion into a folder, as a plan's folder has it: an arm of primitives with three joints and two
//! fingers reaches for a post, closes and lifts. For tests, and for readers in another language to check.
//!
//! `cargo run -p semfm-show --example write_sample_motion -- FOLDER`

use std::path::{Path, PathBuf};
use std::sync::Arc;

use semfm::geom::io::write_mesh;
use semfm::geom::math::DVec3;
use semfm::motion::{Segment, SegmentKind, Trajectory, TrajectoryPoint};
use semfm::robot::{Geometry, Pose, RobotDescription};
use semfm::{
    FingerJoint, Mesh, MotionObject, MotionObstacle, MotionRobot, MotionScene, ObstacleShape,
    PlannedMotion, Task,
};

const URDF: &str = r#"<robot name="sample">
  <link name="base"><visual><origin xyz="0 0 0.05"/><geometry><cylinder radius="0.09" length="0.1"/></geometry></visual></link>
  <joint name="turn" type="revolute"><parent link="base"/><child link="shoulder"/><origin xyz="0 0 0.1"/>
    <axis xyz="0 0 1"/><limit lower="-3" upper="3" velocity="2" effort="50"/></joint>
  <link name="shoulder"><visual><origin xyz="0 0 0.05"/><geometry><box size="0.12 0.14 0.1"/></geometry></visual></link>
  <joint name="pitch" type="revolute"><parent link="shoulder"/><child link="upper"/><origin xyz="0 0 0.1"/>
    <axis xyz="0 1 0"/><limit lower="-1" upper="2" velocity="2" effort="50"/></joint>
  <link name="upper"><visual><origin xyz="0 0 0.17"/><geometry><cylinder radius="0.05" length="0.34"/></geometry></visual></link>
  <joint name="slide" type="prismatic"><parent link="upper"/><child link="fore"/><origin xyz="0 0 0.3"/>
    <axis xyz="0 0 1"/><limit lower="0" upper="0.2" velocity="0.5" effort="50"/></joint>
  <link name="fore"><visual><origin xyz="0 0 0.01"/><geometry><box size="0.06 0.06 0.22"/></geometry></visual></link>
  <joint name="mount" type="fixed"><parent link="fore"/><child link="hand"/><origin xyz="0 0 0.12"/></joint>
  <link name="hand"><visual><origin xyz="0 0 0.02"/><geometry><box size="0.05 0.16 0.04"/></geometry></visual></link>
  <joint name="left_finger" type="prismatic"><parent link="hand"/><child link="left"/><origin xyz="0 0 0.04"/>
    <axis xyz="0 -1 0"/><limit lower="0" upper="0.04" velocity="0.1" effort="20"/></joint>
  <link name="left"><visual><origin xyz="0 -0.01 0.03"/><geometry><box size="0.02 0.02 0.06"/></geometry></visual></link>
  <joint name="right_finger" type="prismatic"><parent link="hand"/><child link="right"/><origin xyz="0 0 0.04"/>
    <axis xyz="0 1 0"/><limit lower="0" upper="0.04" velocity="0.1" effort="20"/><mimic joint="left_finger"/></joint>
  <link name="right"><visual><origin xyz="0 0.01 0.03"/><geometry><box size="0.02 0.02 0.06"/></geometry></visual></link>
</robot>
"#;

/// The arm at the ends of its segments (radians, radians, metres), and how long each takes.
const START: [f64; 3] = [-1.2, 0.2, 0.0];
const BEFORE: [f64; 3] = [0.3, 1.45, 0.0];
const GRASP: [f64; 3] = [0.3, 1.45, 0.12];
const LIFTED: [f64; 3] = [0.3, 1.2, 0.12];
const SECONDS: [f64; 4] = [1.6, 0.7, 0.4, 0.8];
const OPEN: f64 = 0.07;
const WIDTH: f64 = 0.04;

/// The motion; files that it names are written into `folder`, which is there.
pub fn sample_motion(folder: &Path) -> Result<PlannedMotion, Box<dyn std::error::Error>> {
    let urdf = folder.join("sample.urdf");
    std::fs::write(&urdf, URDF)?;
    let robot = RobotDescription::read(&urdf)?.tree()?;
    let link = |name: &str| robot.link(name).ok_or("a link of the sample");
    let (base, tip) = (link("base")?, link("hand")?);
    let fingers = FingerJoint::new("left_finger", vec![[0.0, 0.0], [0.08, 0.04]]);
    let mut arm = MotionRobot::new(Arc::new(robot), urdf, base, tip);
    arm.fingers = fingers.into_iter().collect();
    let mut scene = MotionScene::new(arm);
    scene.object = Some(post(&scene, folder.join("post.obj"))?);
    scene.obstacles = vec![
        MotionObstacle {
            name: "crate".into(),
            base_from_obstacle: Pose::translation(0.0, 0.55, 0.1),
            shape: ObstacleShape::Primitive(Geometry::Box { size: DVec3::new(0.3, 0.2, 0.2) }),
        },
        MotionObstacle {
            name: "table".into(),
            base_from_obstacle: Pose::IDENTITY,
            shape: ObstacleShape::HalfSpace,
        },
    ];
    Ok(PlannedMotion { scene, trajectory: trajectory(), grasp: Some(2), notes: Vec::new() })
}

/// A post of 4 cm between the fingers at the grasp, in millimetres.
fn post(scene: &MotionScene, file: PathBuf) -> Result<MotionObject, Box<dyn std::error::Error>> {
    let arm: Vec<(String, f64)> = names().into_iter().zip(GRASP).collect();
    let hand = scene.base_from_tip(&arm, OPEN);
    let grip = hand * DVec3::new(0.0, 0.0, 0.08);
    let corners = (0..8).map(|i| {
        let side = |bit: usize, length: f64| if i >> bit & 1 == 1 { length } else { -length };
        DVec3::new(
            side(0, 20.0),
            side(1, 20.0),
            if i >> 2 & 1 == 1 { 1e3 * grip.z + 60.0 } else { 0.0 },
        )
    });
    let faces = [
        [0, 2, 1],
        [1, 2, 3],
        [4, 5, 6],
        [5, 7, 6],
        [0, 1, 4],
        [1, 5, 4],
        [2, 6, 3],
        [3, 6, 7],
        [0, 4, 2],
        [2, 4, 6],
        [1, 3, 5],
        [3, 7, 5],
    ];
    write_mesh(&file, &Mesh::new(corners.collect(), faces.to_vec())?)?;
    let mesh = Arc::new(semfm::geom::io::read_mesh(&file)?.mesh);
    let turn = semfm::geom::math::DQuat::from_rotation_z(GRASP[0]);
    let base_from_object = Pose::from_parts(DVec3::new(grip.x, grip.y, 0.0), turn);
    Ok(MotionObject { mesh, file: Some(file), scale: 1e-3, base_from_object })
}

fn names() -> Vec<String> {
    ["turn", "pitch", "slide"].map(str::to_owned).into()
}

fn trajectory() -> Trajectory {
    let stops = [
        (SegmentKind::ToPreGrasp, START, BEFORE, [OPEN; 2]),
        (SegmentKind::Approach, BEFORE, GRASP, [OPEN; 2]),
        (SegmentKind::Close, GRASP, GRASP, [OPEN, WIDTH]),
        (SegmentKind::Lift, GRASP, LIFTED, [WIDTH; 2]),
    ];
    let mut begin = 0.0;
    let segments = stops.into_iter().zip(SECONDS).map(|((kind, from, to, opening), seconds)| {
        let points =
            (0..=10).map(|i| point(begin, seconds, f64::from(i) / 10.0, from, to, opening));
        let segment = Segment { kind, points: points.collect() };
        begin += seconds;
        segment
    });
    Trajectory { segments: segments.collect(), joint_names: names() }
}

/// From rest to rest: q = from + (3 s² − 2 s³) (to − from).
fn point(
    begin: f64,
    seconds: f64,
    s: f64,
    from: [f64; 3],
    to: [f64; 3],
    opening: [f64; 2],
) -> TrajectoryPoint {
    let mix = |basis: f64| (0..3).map(|j| basis * (to[j] - from[j])).collect::<Vec<f64>>();
    let moved = mix(s * s * (3.0 - 2.0 * s));
    TrajectoryPoint {
        time: begin + s * seconds,
        positions: from.iter().zip(moved).map(|(q, moved)| q + moved).collect(),
        velocities: mix(6.0 * s * (1.0 - s) / seconds),
        accelerations: mix((6.0 - 12.0 * s) / (seconds * seconds)),
        opening: opening[0] + s * (opening[1] - opening[0]),
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args().nth(1).ok_or("usage: write_sample_motion FOLDER")?;
    let folder = Path::new(&folder);
    std::fs::create_dir_all(folder)?;
    let motion = sample_motion(folder)?;
    semfm_show::write_plan_folder(&folder.join("plan"), &motion, &Task::default())?;
    let state = motion.state_at(1.2).ok_or("the sample has points")?;
    let miss = semfm_show::NearMiss {
        title: "nearest miss: grasp 3, the hand would meet the crate, 4 mm deep".into(),
        state,
        pair: Some(["upper".into(), "crate".into()]),
        goal: motion.state_at(2.3).map(|state| motion.scene.base_from_tip(&state.arm, OPEN)),
    };
    semfm_show::write_miss_picture(
        &folder.join("miss.png"),
        &motion.scene,
        &miss,
        &Task::default(),
    )?;
    Ok(())
}
