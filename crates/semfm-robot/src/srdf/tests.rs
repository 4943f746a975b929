//! What an SRDF means for a robot of three links and a finger.

use super::*;
use crate::RobotDescription;

const ARM: &str = r#"<robot name="arm"><link name="base"/><link name="upper"/><link name="tool"/><link name="finger"/>
    <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
    <limit lower="-1" upper="2" effort="1" velocity="1"/></joint>
    <joint name="wrist" type="continuous"><parent link="upper"/><child link="tool"/></joint>
    <joint name="slide" type="prismatic"><parent link="tool"/><child link="finger"/>
    <limit lower="0" upper="0.04" effort="1" velocity="1"/></joint></robot>"#;

fn robot() -> Robot {
    RobotDescription::parse(ARM.as_bytes(), "arm.urdf").unwrap().tree().unwrap()
}

fn parse(inner: &str) -> Result<Srdf> {
    Srdf::parse(format!("<robot name=\"arm\">{inner}</robot>").as_bytes(), "arm.srdf", &robot())
}

#[test]
fn groups_hold_what_links_joints_chains_and_subgroups_name() {
    let srdf = parse(
        r#"<group name="all"><group name="arm"/><group name="hand"/></group>
        <group name="arm"><chain base_link="base" tip_link="tool"/></group>
        <group name="hand"><link name="finger"/><group name="all"/></group>
        <group_state name="home" group="arm"><joint name="shoulder" value="0.5"/>
        <joint name="wrist" value="-3"/></group_state>
        <end_effector name="grip" parent_link="tool" group="hand"/>
        <virtual_joint name="v" type="fixed" parent_frame="world" child_link="base"/>"#,
    )
    .unwrap();
    assert_eq!(srdf.warnings, Vec::<String>::new());
    let joints = |name: &str| srdf.group(name).unwrap().joints.clone();
    assert_eq!(joints("arm"), [0, 1]);
    // Subgroups in a circle are one set.
    assert_eq!((joints("all"), joints("hand")), (vec![0, 1, 2], vec![0, 1, 2]));
    assert_eq!(srdf.group("arm").unwrap().links, [0, 1, 2]);
    assert_eq!(srdf.state("home").unwrap().positions, [(0, 0.5), (1, -3.0)]);
    assert_eq!(srdf.arm_ends(&robot()), Some(ChainEnds { base: 0, tip: 2 }));
    assert_eq!(srdf.end_effectors[0].parent_link, 2);
    assert_eq!(srdf.virtual_joints[0].child_link, 0);
}

#[test]
fn pairs_are_switched_off_once_and_whole_links_with_exceptions() {
    let srdf = parse(
        r#"<disable_collisions link1="tool" link2="base" reason="Never"/>
        <disable_collisions link1="base" link2="tool" reason="Never"/>
        <disable_default_collisions link="finger"/>
        <enable_collisions link1="base" link2="finger"/>"#,
    )
    .unwrap();
    let pairs: Vec<[usize; 2]> = srdf.disabled.iter().map(|pair| pair.links).collect();
    assert_eq!(pairs, [[0, 2], [1, 3], [2, 3]]);
    assert_eq!(srdf.disabled[0].reason, "Never");
}

#[test]
fn what_the_robot_does_not_have_is_a_warning() {
    let srdf = parse(
        r#"<disable_collisions link1="tool" link2="nothing"/><group name="g"><link name="nowhere"/>
        <chain base_link="tool" tip_link="base"/><group name="h"/></group>
        <group_state name="s" group="g"><joint name="none" value="1"/></group_state>"#,
    )
    .unwrap();
    assert_eq!(srdf.warnings.len(), 5, "{:?}", srdf.warnings);
    assert!(srdf.warnings[0].contains("`nowhere`"), "{:?}", srdf.warnings);
    assert!(srdf.disabled.is_empty() && srdf.groups[0].joints.is_empty());
}

#[test]
fn damaged_files_are_refused_with_their_place() {
    let error = |inner: &str| parse(inner).unwrap_err().to_string();
    assert!(error("<disable_collisions link1='tool'/>").contains("line 1: disable_collisions"));
    let state = |value: &str| {
        error(&format!(
            "<group_state name='s' group='g'><joint name='wrist' value='{value}'/></group_state>"
        ))
    };
    assert!(state("nan").contains("finite") && state("x").contains("a number"));
    let not_robot = Srdf::parse(b"<sdf/>", "arm.srdf", &robot()).unwrap_err();
    assert_eq!(not_robot.code(), "srdf");
}
