//! Published arms: what is found in their descriptions, SRDF files and joint limits.

mod shared_data;

use semfm_robot::{ArmFiles, JointKind, JointLimitsFile};

use shared_data::shared;

struct Published {
    urdf: &'static str,
    srdf: &'static str,
    /// Base and tip by the SRDF.
    ends: [&'static str; 2],
    /// Tip that is found without it.
    tip: &'static str,
    n_joints: usize,
    n_disabled: usize,
    /// A state of the arm.
    state: &'static str,
}

const PUBLISHED: [Published; 2] = [
    Published {
        urdf: "arms/moveit_panda/panda_description/urdf/panda.urdf",
        srdf: "arms/moveit_panda/panda_moveit_config/config/panda.srdf",
        ends: ["panda_link0", "panda_link8"],
        tip: "panda_hand",
        n_joints: 7,
        n_disabled: 34,
        state: "ready",
    },
    Published {
        urdf: "arms/roboplan/kinova_robot_model/kinova_robotiq.urdf",
        srdf: "arms/roboplan/kinova_robot_model/kinova_robotiq.srdf",
        ends: ["base_link", "end_effector_link"],
        tip: "end_effector_link",
        n_joints: 7,
        n_disabled: 97,
        state: "Home",
    },
];

#[test]
fn published_arms_are_read_as_their_makers_mean_them() {
    let Some(data) = shared("data") else { return };
    for published in PUBLISHED {
        let (urdf, srdf) = (data.join(published.urdf), data.join(published.srdf));
        let found = ArmFiles { urdf: urdf.clone(), ..Default::default() }.open().unwrap();
        let name = |link: usize| found.arm.robot().links[link].name.as_str();
        assert_eq!(name(found.arm.tip()), published.tip);
        assert_eq!(found.arm.n_joints(), published.n_joints);
        let opened = ArmFiles { urdf, srdf: Some(srdf), ..Default::default() }.open().unwrap();
        assert_eq!([opened.arm.base(), opened.arm.tip()].map(name), published.ends);
        let srdf = opened.srdf.as_ref().unwrap();
        assert_eq!(srdf.disabled.len(), published.n_disabled, "{:?}", srdf.warnings);
        let state = opened.named_state(published.state).unwrap();
        opened.arm.check_positions(published.state, &state).unwrap();
        assert!(opened.named_state("nowhere").unwrap_err().to_string().contains("`nowhere`"));
        assert_eq!(srdf.end_effectors.len(), 1);
    }
}

#[test]
fn an_srdf_without_groups_tells_its_pairs() {
    let Some(data) = shared("data/robots/ur5") else { return };
    let (urdf, srdf) = (data.join("urdf/ur5_robot.urdf"), data.join("srdf/ur5.srdf"));
    let opened = ArmFiles { urdf, srdf: Some(srdf), ..Default::default() }.open().unwrap();
    assert_eq!(opened.srdf.unwrap().disabled.len(), 10);
    let tip = &opened.arm.robot().links[opened.arm.tip()].name;
    assert_eq!((tip.as_str(), opened.arm.n_joints()), ("tool0", 6));
}

#[test]
fn published_limits_are_those_of_the_files() {
    let Some(arms) = shared("data/arms") else { return };
    let file = |name: &str| JointLimitsFile::read(arms.join(name)).unwrap();
    let panda = file("moveit_panda/panda_moveit_config/config/joint_limits.yaml");
    let joint = panda.joints["panda_joint4"];
    assert_eq!(panda.joints.len(), 9);
    assert_eq!(
        (joint.velocity, joint.acceleration, joint.jerk),
        (Some(2.175), Some(3.125), Some(300.0))
    );
    let gen3 = file("roboplan/kinova_robot_model/kinova_robotiq_config.yaml");
    assert_eq!(gen3.joints["joint_7"].acceleration, Some(2.0));
    assert_eq!(gen3.joints.len(), 7);
}

#[test]
fn soft_limits_narrow_the_panda_and_gen3_turns_without_end() {
    let Some(data) = shared("data") else { return };
    let open =
        |file: &str| ArmFiles { urdf: data.join(file), ..Default::default() }.open().unwrap();
    let panda = open("robots/panda/urdf/panda_local.urdf").arm;
    let range = |joint: usize| (panda.joints()[joint].lower, panda.joints()[joint].upper);
    assert_eq!((range(1), range(3)), ((-1.7628, 1.7628), (-3.0718, -0.0698)));
    let gen3 = open(PUBLISHED[1].urdf).arm;
    let kinds: Vec<JointKind> = gen3.joints().iter().map(|joint| joint.kind).collect();
    let turns = |kind: &&JointKind| **kind == JointKind::Continuous;
    assert_eq!(kinds.iter().filter(turns).count(), 4);
    assert!(gen3.joints()[0].is_continuous() && !gen3.joints()[1].is_continuous());
}
