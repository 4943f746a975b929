//! Inverse kinematics of published arms: random reachable poses are reached, on every branch.

mod shared_data;

use std::f64::consts::TAU;
use std::path::Path;
use std::sync::Arc;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use semfm_robot::{
    Arm, ArmSettings, IkSettings, InverseKinematics, Pose, Preference, RobotDescription,
};

use shared_data::shared;

/// Random poses for each arm; `bench/ik.py` tries 1,000.
const N_POSES: usize = 200;

/// Files and tips of published arms.
const ARMS: [(&str, &str); 4] = [
    ("robots/panda/urdf/panda_local.urdf", "panda_link8"),
    ("robots/ur5/urdf/ur5_local.urdf", "tool0"),
    ("robots/ur5e/urdf/ur5e_local.urdf", "tool0"),
    ("arms/roboplan/kinova_robot_model/kinova_robotiq.urdf", "end_effector_link"),
];

fn arm(file: &Path, tip: &str) -> Arc<Arm> {
    let robot = Arc::new(RobotDescription::read(file).unwrap().tree().unwrap());
    let settings = ArmSettings { tip: Some(tip.into()), ..Default::default() };
    Arc::new(Arm::new(robot, &settings).unwrap())
}

fn random(arm: &Arm, random: &mut ChaCha8Rng) -> Vec<f64> {
    let ranges = arm.joints().iter().map(|joint| joint.sampling_range());
    ranges.map(|[lower, upper]| lower + (upper - lower) * random.random::<f64>()).collect()
}

#[test]
fn random_reachable_poses_are_reached_and_the_answers_hold() {
    let Some(data) = shared("data") else { return };
    for (file, tip) in ARMS {
        let arm = arm(&data.join(file), tip);
        let ik = InverseKinematics::new(arm.clone(), IkSettings::default()).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut solved = 0;
        for _ in 0..N_POSES {
            let pose = arm.base_from_tip(&random(&arm, &mut rng));
            let near = random(&arm, &mut rng);
            let answer = ik.solve(&pose, &near).unwrap();
            for solution in &answer.solutions {
                arm.check_positions("solution", &solution.positions).unwrap();
                // By the other way of forward kinematics: link after link, with quaternions.
                let mut poses = Vec::new();
                arm.link_poses(&solution.positions, &mut poses);
                let off = poses[arm.tip()].inverse() * pose;
                assert!(off.translation.length() < 1.1e-6, "{file}: {off:?}");
                assert!(off.rotation.angle_between(glam::DQuat::IDENTITY) < 1.1e-6, "{file}");
                for (joint, (q, near)) in
                    arm.joints().iter().zip(solution.positions.iter().zip(&near))
                {
                    let turned = if q < near { q + TAU } else { q - TAU };
                    let allowed = turned >= joint.lower && turned <= joint.upper;
                    assert!(!allowed || (q - near).abs() <= (turned - near).abs() + 1e-9);
                }
            }
            solved += usize::from(!answer.solutions.is_empty());
        }
        assert!(solved * 1000 >= N_POSES * 996, "{file}: {solved} of {N_POSES}");
    }
}

#[test]
fn arms_of_six_joints_show_every_branch() {
    let Some(data) = shared("data") else { return };
    for (file, tip) in &ARMS[1..3] {
        let arm = arm(&data.join(file), tip);
        let ik = |solutions, restarts, seed| {
            let settings = IkSettings { solutions, restarts, seed, ..Default::default() };
            InverseKinematics::new(arm.clone(), settings).unwrap()
        };
        let (ours, more) = (ik(8, 50, 0), ik(9, 1000, 1));
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let (mut all, near) = (0, [0.0; 6]);
        for _ in 0..20 {
            let pose = arm.base_from_tip(&random(&arm, &mut rng));
            let found = ours.solve(&pose, &near).unwrap().solutions;
            let there_are = more.solve(&pose, &near).unwrap().solutions.len();
            assert!(there_are <= 8 && there_are % 2 == 0, "{file}: {there_are}");
            assert!(found.is_sorted_by(|a, b| a.distance <= b.distance));
            all += usize::from(found.len() == there_are);
        }
        assert!(all >= 19, "{file}: all branches of {all} of 20 poses");
    }
}

#[test]
fn a_seventh_joint_follows_the_preference_and_the_tip_stays() {
    let Some(data) = shared("data") else { return };
    let (file, tip) = ARMS[0];
    let arm = arm(&data.join(file), tip);
    let solve = |preference, pose: &Pose, near: &[f64]| {
        let settings = IkSettings { preference, ..Default::default() };
        let answer = InverseKinematics::new(arm.clone(), settings).unwrap().solve(pose, near);
        answer.unwrap().solutions.into_iter().next()
    };
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let (mut n, mut gains) = (0, [0, 0, 0]);
    for _ in 0..50 {
        let pose = arm.base_from_tip(&random(&arm, &mut rng));
        let near = random(&arm, &mut rng);
        let Some(plain) = solve(Preference::None, &pose, &near) else { continue };
        let [near_by, central, easy] =
            [Preference::Near, Preference::Limits, Preference::Manipulability]
                .map(|preference| solve(preference, &pose, &near).expect("reached as before"));
        let from_near = |q: &[f64]| q.iter().zip(&near).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
        let from_middle = |q: &[f64]| -> f64 {
            let joints = arm.joints().iter().zip(q);
            joints.map(|(j, q)| ((2.0 * q - j.lower - j.upper) / (j.upper - j.lower)).powi(2)).sum()
        };
        n += 1;
        gains[0] += usize::from(from_near(&near_by.positions) < from_near(&plain.positions));
        gains[1] += usize::from(from_middle(&central.positions) < from_middle(&plain.positions));
        let [ours, before] =
            [&easy, &plain].map(|solution| arm.manipulability(&solution.positions));
        gains[2] += usize::from(ours > before);
    }
    assert!(n >= 49 && gains.iter().all(|&gain| gain * 10 >= n * 9), "{gains:?} of {n}");
}
