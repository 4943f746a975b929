//! Arms out of small descriptions: ends, limits, kinematics, what is refused.

use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

use glam::{DQuat, DVec3};
use proptest::prelude::*;
use semfm_robot::{
    Arm, ArmSettings, DEFAULT_ACCELERATION, DEFAULT_VELOCITY, IkSettings, InverseKinematics,
    JointKind, JointLimitsFile, Pose, Robot, RobotDescription, ToldLimits,
};

/// A column that slides, an arm whose wrist follows its elbow, a tool, a finger; on a base that is turned.
const ARM: &str = r#"<robot name="arm"><link name="world"/><link name="base"/><link name="column"/>
    <link name="upper"/><link name="fore"/><link name="hand"/><link name="tool0"/><link name="finger"/>
    <link name="mark"/><joint name="mark" type="fixed"><parent link="base"/><child link="mark"/>
      <origin xyz="0.3 0 0" rpy="0 0.5 3.1"/></joint>
    <joint name="stand" type="fixed"><parent link="world"/><child link="base"/>
      <origin xyz="0 0 0.9" rpy="0 0 1.5707963267948966"/></joint>
    <joint name="lift" type="prismatic"><parent link="base"/><child link="column"/><axis xyz="0 0 1"/>
      <limit lower="-0.2" upper="0.5" effort="1" velocity="0.3"/></joint>
    <joint name="shoulder" type="continuous"><parent link="column"/><child link="upper"/>
      <origin xyz="0.1 0 0.2" rpy="0.1 0.2 0.3"/><axis xyz="1 2 -0.5"/></joint>
    <joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/>
      <origin xyz="0.4 0 0"/><axis xyz="0 1 0"/><limit lower="-2" upper="2.5" effort="1" velocity="2"/>
      <safety_controller soft_lower_limit="-1.5" k_velocity="1"/></joint>
    <joint name="wrist" type="revolute"><parent link="fore"/><child link="hand"/>
      <origin xyz="0.3 0.02 0" rpy="0 0 0.4"/><axis xyz="0 -1 0"/>
      <limit lower="-3" upper="3" effort="1" velocity="2"/><mimic joint="elbow" multiplier="0.5" offset="0.1"/></joint>
    <joint name="twist" type="revolute"><parent link="hand"/><child link="tool0"/>
      <origin xyz="0.1 0 0"/><axis xyz="1 0 0"/><limit lower="-3" upper="3" effort="1" velocity="2"/></joint>
    <joint name="slide" type="prismatic"><parent link="tool0"/><child link="finger"/>
      <axis xyz="0 1 0"/><limit lower="0.01" upper="0.04" effort="1" velocity="0"/></joint></robot>"#;

fn robot(text: &str) -> Arc<Robot> {
    Arc::new(RobotDescription::parse(text.as_bytes(), "arm.urdf").unwrap().tree().unwrap())
}

fn settings() -> ArmSettings {
    ArmSettings { tip: Some("tool0".into()), ..Default::default() }
}

fn arm() -> Arm {
    Arm::new(robot(ARM), &settings()).unwrap()
}

fn refused(settings: &ArmSettings) -> String {
    Arm::new(robot(ARM), settings).unwrap_err().to_string()
}

#[test]
fn joints_are_those_that_move_the_tip_with_the_limits_of_all_files() {
    let told = ToldLimits { acceleration: Some(4.0), upper: Some(2.0), ..Default::default() };
    let limits = JointLimitsFile { joints: [("elbow".to_owned(), told)].into() };
    let arm = Arm::new(robot(ARM), &ArmSettings { limits: Some(limits), ..settings() }).unwrap();
    let names: Vec<&str> = arm.joints().iter().map(|joint| joint.name.as_str()).collect();
    assert_eq!(names, ["lift", "shoulder", "elbow", "twist"]);
    let [lift, shoulder, elbow, _] = arm.joints() else { panic!("four joints") };
    assert_eq!((lift.lower, lift.upper, lift.velocity), (-0.2, 0.5, 0.3));
    assert_eq!(lift.acceleration, DEFAULT_ACCELERATION);
    assert_eq!((shoulder.kind, shoulder.velocity), (JointKind::Continuous, DEFAULT_VELOCITY));
    assert!(shoulder.is_continuous() && shoulder.upper == f64::INFINITY);
    // One soft limit narrows one side; the file's limit takes the place of the URDF's.
    assert_eq!((elbow.lower, elbow.upper, elbow.acceleration), (-1.5, 2.0, 4.0));
    let notes = arm.notes().join("\n");
    assert!(notes.contains("base: the root link `world`"), "{notes}");
    assert!(notes.contains("velocity limit 1.0 assumed"), "{notes}");
    assert!(notes.contains("lift, shoulder, twist"), "{notes}");
}

#[test]
fn a_tip_is_found_before_fingers_and_several_arms_are_refused() {
    let one = |prefix: &str, root: &str| {
        let mut text = String::new();
        for i in 1..=5 {
            let parent = if i == 1 { root.to_owned() } else { format!("{prefix}{}", i - 1) };
            text += &format!(
                r#"<link name="{prefix}{i}"/><joint name="{prefix}j{i}" type="continuous">
                <parent link="{parent}"/><child link="{prefix}{i}"/><axis xyz="0 0 1"/></joint>"#
            );
        }
        text
    };
    let fingers = r#"<link name="palm"/><joint name="p" type="fixed"><parent link="a5"/><child link="palm"/></joint>
        <link name="f"/><joint name="f" type="prismatic"><parent link="palm"/><child link="f"/>
        <limit lower="0" upper="0.1" effort="1" velocity="1"/></joint>
        <link name="g"/><joint name="g" type="prismatic"><parent link="palm"/><child link="g"/>
        <limit lower="0" upper="0.1" effort="1" velocity="1"/><mimic joint="f"/></joint>"#;
    let a = one("a", "root");
    let single = format!("<robot name='one'><link name='root'/>{a}{fingers}</robot>");
    let arm = Arm::new(robot(&single), &ArmSettings::default()).unwrap();
    assert_eq!(arm.robot().links[arm.tip()].name, "palm");
    assert_eq!(arm.n_joints(), 5);

    // A single jaw is known by its name.
    let jaw = fingers[..fingers.find(r#"<link name="g"/>"#).unwrap()]
        .replace("name=\"f\"", "name=\"jaw\"");
    let jaw = jaw.replace("link=\"f\"", "link=\"jaw\"");
    let single = format!("<robot name='one'><link name='root'/>{a}{jaw}</robot>");
    let arm = Arm::new(robot(&single), &ArmSettings::default()).unwrap();
    assert_eq!((arm.robot().links[arm.tip()].name.as_str(), arm.n_joints()), ("palm", 5));

    let b = one("b", "root");
    let double = format!("<robot name='two'><link name='root'/>{a}{b}</robot>");
    let error = Arm::new(robot(&double), &ArmSettings::default()).unwrap_err().to_string();
    assert!(error.contains("2 arms") && error.contains("`aj1`, `bj1`"), "{error}");
    let tip = ArmSettings { tip: Some("b5".into()), ..Default::default() };
    assert_eq!(Arm::new(robot(&double), &tip).unwrap().joints()[4].name, "bj5");
}

#[test]
fn bad_requests_name_what_is_wrong() {
    let with = |base: Option<&str>, tip: &str, fixed: &[(&str, f64)]| {
        refused(&ArmSettings {
            base: base.map(Into::into),
            tip: Some(tip.into()),
            fixed: fixed.iter().map(|(name, q)| ((*name).to_owned(), *q)).collect(),
            ..Default::default()
        })
    };
    assert!(with(None, "tool1", &[]).contains("did you mean `tool0`?"));
    assert!(with(Some("finger"), "tool0", &[]).contains("a link on another branch"));
    assert!(with(None, "base", &[]).contains("expected 1 to 100 joints that move, found 0"));
    assert!(with(None, "tool0", &[("lift", 0.1)]).contains("one that the arm moves"));
    assert!(with(None, "tool0", &[("wrist", 0.1)]).contains("follows another"));
    assert!(with(None, "tool0", &[("slide", 0.1)]).contains("expected 0.01 to 0.04, found 0.1"));
    let told = ToldLimits { upper: Some(-3.0), ..Default::default() };
    let limits = JointLimitsFile { joints: [("elbow".to_owned(), told)].into() };
    let crossed = refused(&ArmSettings { limits: Some(limits), ..settings() });
    assert!(
        crossed.contains("joint `elbow`: limits") && crossed.contains("-2 and -3"),
        "{crossed}"
    );
    let long: String = (0..101)
        .map(|i| {
            format!(
                r#"<link name="l{}"/><joint name="j{i}" type="continuous"><parent link="l{i}"/>
                <child link="l{}"/></joint>"#,
                i + 1,
                i + 1
            )
        })
        .collect();
    let long = robot(&format!(r#"<robot name="long"><link name="l0"/>{long}</robot>"#));
    let error = Arm::new(long, &ArmSettings::default()).unwrap_err().to_string();
    assert!(error.contains("found 101"), "{error}");
    let floating = ARM.replace(r#"name="stand" type="fixed""#, r#"name="stand" type="floating""#);
    let error = Arm::new(robot(&floating), &settings()).unwrap_err().to_string();
    assert!(error.contains("name a base beyond it, such as `base`"), "{error}");
}

#[test]
fn joint_values_are_checked_against_number_and_limits() {
    let arm = arm();
    let error = |q: &[f64]| arm.check_positions("start", q).unwrap_err().to_string();
    assert!(arm.check_positions("start", &[0.1, 100.0, -1.5, 0.0]).is_ok());
    assert!(error(&[0.0; 3]).contains("expected 4 joint values (lift, shoulder, elbow, twist)"));
    assert!(error(&[0.0, f64::NAN, 0.0, 0.0]).contains("joint `shoulder`"));
    assert!(
        error(&[0.0, 0.0, 2.6, 0.0]).contains("joint `elbow`: expected -1.5 to 2.5, found 2.6")
    );
}

#[test]
fn links_outside_of_the_chain_stand_where_they_are_put() {
    let fixed = vec![("slide".to_owned(), 0.03)];
    let put = Arm::new(robot(ARM), &ArmSettings { fixed, ..settings() }).unwrap();
    let finger = put.robot().link("finger").unwrap();
    for (arm, expected) in [(arm(), 0.01), (put, 0.03)] {
        let mut poses = Vec::new();
        arm.link_poses(&[0.1, 0.2, 0.3, 0.4], &mut poses);
        let tip_from_finger = poses[arm.tip()].inverse() * poses[finger];
        assert!((tip_from_finger.translation - DVec3::Y * expected).length() < 1e-12);
    }
}

proptest! {
    #[test]
    fn chain_and_links_agree_from_any_base_and_the_jacobian_is_the_derivative(
        lift in -0.2..0.5, shoulder in -PI..PI, elbow in -1.5..2.5, twist in -3.0..3.0,
    ) {
        for base in ["world", "base", "column", "mark"] {
            let arm = Arm::new(robot(ARM), &ArmSettings { base: Some(base.into()), ..settings() }).unwrap();
            let all = [lift, shoulder, elbow, twist];
            let q = &all[4 - arm.n_joints()..];
            let mut poses = Vec::new();
            arm.link_poses(q, &mut poses);
            let tip = arm.base_from_tip(q);
            let off = poses[arm.tip()].inverse() * tip;
            prop_assert!(off.translation.length() < 1e-14 + 1e-14);
            prop_assert!(off.rotation.xyz().length() < 1e-14);
            let n = arm.n_joints();
            let mut jacobian = vec![0.0; 6 * n];
            arm.jacobian(q, &mut jacobian);
            let step = 1e-6;
            for i in 0..n {
                let [before, after] = [-step, step].map(|d| {
                    let mut q = q.to_vec();
                    q[i] += d;
                    arm.base_from_tip(&q)
                });
                let linear = (after.translation - before.translation) / (2.0 * step);
                let turn = after.rotation * before.rotation.inverse();
                let angular = turn.to_scaled_axis() / (2.0 * step);
                for row in 0..3 {
                    prop_assert!((jacobian[row * n + i] - linear[row]).abs() < 1e-8);
                    prop_assert!((jacobian[(row + 3) * n + i] - angular[row]).abs() < 1e-8);
                }
            }
        }
    }
}

#[test]
fn what_cannot_be_reached_is_told_with_what_is_left() {
    let arm = Arc::new(arm());
    let ik = InverseKinematics::new(arm.clone(), IkSettings::default()).unwrap();
    let far = Pose::from_translation(DVec3::X * 10.0);
    let answer = ik.solve(&far, &[0.0; 4]).unwrap();
    assert!(answer.solutions.is_empty() && answer.tries == 51);
    let closest = answer.closest.unwrap();
    assert!(closest.position_error > 8.0 && closest.position_error < 10.5, "{closest:?}");
    arm.check_positions("closest", &closest.positions).unwrap();

    let nan = Pose::from_translation(DVec3::X * f64::NAN);
    assert!(ik.solve(&nan, &[0.0; 4]).unwrap_err().to_string().contains("pose"));
    let skewed = Pose::from_parts(DVec3::ZERO, DQuat::from_xyzw(0.0, 0.0, 0.0, 0.5));
    assert!(ik.solve(&skewed, &[0.0; 4]).is_err());
    assert!(ik.solve(&far, &[0.0; 3]).unwrap_err().to_string().contains("near"));
    let none = IkSettings { solutions: 0, ..Default::default() };
    assert!(InverseKinematics::new(arm, none).is_err());
}

#[test]
fn where_the_search_begins_is_an_answer_where_it_is_one_and_seeds_repeat() {
    let arm = Arc::new(arm());
    let q = [0.2, 0.5, 1.0, -0.5];
    let settings = IkSettings { solutions: 4, ..Default::default() };
    let ik = InverseKinematics::new(arm.clone(), settings).unwrap();
    let answer = ik.solve(&arm.base_from_tip(&q), &q).unwrap();
    assert_eq!(answer.solutions[0].positions, q);
    assert_eq!(answer, ik.solve(&arm.base_from_tip(&q), &q).unwrap());
    // A continuous joint is told on the turn that is nearest.
    let turned = [0.2, 0.5 + 6.0 * PI, 1.0, -0.5];
    let answer = ik.solve(&arm.base_from_tip(&q), &turned).unwrap();
    assert!((answer.solutions[0].positions[1] - turned[1]).abs() < 1e-9);
}

#[test]
fn margins_and_manipulability_of_a_planar_arm_are_those_of_the_formulas() {
    let text = r#"<robot name="planar"><link name="a"/><link name="b"/><link name="c"/><link name="d"/>
        <joint name="one" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
        <limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
        <joint name="two" type="continuous"><parent link="b"/><child link="c"/><origin xyz="0.5 0 0"/>
        <axis xyz="0 0 1"/></joint>
        <joint name="end" type="fixed"><parent link="c"/><child link="d"/><origin xyz="0.5 0 0"/></joint></robot>"#;
    let tip = ArmSettings { tip: Some("d".into()), ..Default::default() };
    let arm = Arm::new(robot(text), &tip).unwrap();
    // At an elbow of 90°, the columns of J are (−.5, .5, 0; 0, 0, 1) and (−.5, 0, 0; 0, 0, 1): det(JᵀJ) = .3125 … by hand:
    // (1.5)(1.25) − (1.25)² = .3125.
    let w = arm.manipulability(&[0.0, FRAC_PI_2]);
    assert!((w - 0.3125_f64.sqrt()).abs() < 1e-12, "{w}");
    assert_eq!(arm.limit_margin(&[1.0, 55.0]), 0.5);
    assert_eq!(arm.limit_margin(&[-2.0, 0.0]), 0.0);
}
