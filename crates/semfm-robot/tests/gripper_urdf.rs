//! Grippers out of robot descriptions: small ones written here, whose answers are known by hand.

use std::fs;
use std::path::PathBuf;

use parry3d_f64::math::Pose;
use parry3d_f64::query::intersection_test;
use parry3d_f64::shape::Cuboid;
use semfm_geom::math::DVec3;
use semfm_robot::{Gripper, GripperSettings, PosedPart, RobotDescription, Role};

const BASE: &str = r#"<link name="palm"><collision><origin xyz="0 0 0.03"/>
    <geometry><box size="0.06 0.2 0.06"/></geometry></collision></link>"#;

/// A finger of a box of 20 × 10 × 40 mm whose inner face lies in the plane y = 0 of its link.
fn finger(name: &str, side: f64) -> String {
    format!(
        r#"<link name="{name}"><collision><origin xyz="0 {} 0.02"/>
        <geometry><box size="0.02 0.01 0.04"/></geometry></collision></link>"#,
        side * 0.005
    )
}

fn slide(name: &str, child: &str, axis: f64, mimic: &str) -> String {
    format!(
        r#"<joint name="{name}" type="prismatic"><parent link="palm"/><child link="{child}"/>
        <origin xyz="0 0 0.06"/><axis xyz="0 {axis} 0"/>
        <limit lower="0" upper="0.03" effort="1" velocity="1"/>{mimic}</joint>"#
    )
}

fn two_fingers(mimic: &str) -> String {
    format!(
        "<robot name=\"two\">{BASE}{}{}{}{}</robot>",
        finger("a", -1.0),
        finger("b", 1.0),
        slide("ja", "a", -1.0, ""),
        slide("jb", "b", 1.0, mimic)
    )
}

struct File {
    folder: tempfile::TempDir,
    path: PathBuf,
}

fn file(text: &str) -> File {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("robot.urdf");
    fs::write(&path, text).unwrap();
    File { folder, path }
}

fn load(text: &str) -> semfm_robot::Result<Gripper> {
    Gripper::from_urdf(file(text).path, &GripperSettings::default())
}

#[test]
fn sliding_fingers_are_found_with_opening_pads_and_tcp() {
    let coupled = r#"<mimic joint="ja"/>"#;
    for mimic in [coupled, ""] {
        let gripper = load(&two_fingers(mimic)).unwrap();
        assert!(*gripper.opening.start() < 1e-12 && (gripper.opening.end() - 0.06).abs() < 1e-12);
        assert!((gripper.pad[0] - 0.02).abs() < 1e-12 && (gripper.pad[1] - 0.04).abs() < 1e-12);
        let tcp = gripper.flange_from_tcp;
        assert!((tcp.translation - DVec3::new(0.0, 0.0, 0.08)).length() < 1e-12);
        assert!(tcp.rotation.angle_between(Default::default()) < 1e-7);
        let roles: Vec<(&str, Role)> =
            gripper.parts.iter().map(|part| (part.link.as_str(), part.role)).collect();
        assert_eq!(roles, [("palm", Role::Palm), ("a", Role::Left), ("b", Role::Right)]);
        // By hand: at 40 mm the right finger's box is centred 20 + 5 mm from the middle.
        let parts = gripper.parts_at(0.04);
        assert!(
            (parts[2].tcp_from_part.translation - DVec3::new(0.0, 0.025, 0.0)).length() < 1e-12
        );
        assert!(
            (parts[0].tcp_from_part.translation - DVec3::new(0.0, 0.0, -0.05)).length() < 1e-12
        );
    }
}

/// A four-bar finger: a crank of 50 mm about x, and a follower that turns the pad back.
fn crank_gripper() -> String {
    let mut text = format!("<robot name=\"cranks\">{BASE}");
    for (side, sign, y) in [("l", 1.0, -0.03), ("r", -1.0, 0.03)] {
        let mimic = if side == "r" { r#"<mimic joint="l_crank" multiplier="-1"/>"# } else { "" };
        let range = if side == "l" { "0 0.5" } else { "-0.5 0" };
        let (low, high) = range.split_once(' ').unwrap();
        text += &format!(
            r#"<link name="{side}_bar"/><link name="{side}_tip"><collision>
            <origin xyz="0 {} 0.02"/><geometry><box size="0.02 0.01 0.04"/></geometry></collision></link>
            <joint name="{side}_crank" type="revolute"><parent link="palm"/><child link="{side}_bar"/>
            <origin xyz="0 {y} 0.06"/><axis xyz="1 0 0"/>
            <limit lower="{low}" upper="{high}" effort="1" velocity="1"/>{mimic}</joint>
            <joint name="{side}_back" type="revolute"><parent link="{side}_bar"/><child link="{side}_tip"/>
            <origin xyz="0 0 0.05"/><axis xyz="1 0 0"/>
            <limit lower="-1" upper="1" effort="1" velocity="1"/>
            <mimic joint="l_crank" multiplier="{}"/></joint>"#,
            sign * 0.025,
            -sign
        );
    }
    text + "</robot>"
}

#[test]
fn a_linkage_keeps_the_tcp_between_the_pads_and_moves_the_palm() {
    let gripper = load(&crank_gripper()).unwrap();
    // The tip's inner face lies 30 mm inside its joint: closed at angle 0, and at angle q each pad
    // is 50 mm · sin q out and 50 mm · (1 − cos q) lower.
    let open = 2.0 * 0.05 * 0.5f64.sin();
    assert!(*gripper.opening.start() < 1e-9 && (gripper.opening.end() - open).abs() < 1e-9);
    for angle in [0.0, 0.1, 0.31, 0.5f64] {
        let width = 2.0 * 0.05 * angle.sin();
        let height = 0.06 + 0.05 * angle.cos() + 0.02;
        let tcp = gripper.flange_from_tcp_at(width).translation;
        // Chords of a table of 65 steps: 0.05 · (0.5 / 64)² / 8 = 0.4 µm.
        assert!((tcp - DVec3::Z * height).length() < 5e-7, "{angle}: {tcp}");
        let palm = gripper.parts_at(width)[0].tcp_from_part;
        assert!((palm.translation.z - (0.03 - height)).abs() < 5e-7);
    }
    assert!((gripper.flange_from_tcp.translation.z - 0.13).abs() < 1e-9);
}

#[test]
fn the_caller_may_name_fingers_flange_tcp_and_pad() {
    let file = file(&two_fingers(""));
    let tcp = Pose::translation(0.0, 0.0, 0.09);
    let settings = GripperSettings {
        fingers: Some(["b".into(), "a".into()]),
        flange: Some("palm".into()),
        palm_from_tcp: Some(tcp),
        pad: Some([0.01, 0.02]),
        ..Default::default()
    };
    let gripper = Gripper::from_urdf(&file.path, &settings).unwrap();
    assert_eq!((gripper.pad, gripper.flange_from_tcp), ([0.01, 0.02], tcp));
    assert!((gripper.parts_at(0.0)[1].tcp_from_part.translation.z + 0.01).abs() < 1e-12);
    let turned = Pose::from_parts(
        DVec3::Z * 0.08,
        parry3d_f64::math::Rotation::from_rotation_z(std::f64::consts::PI),
    );
    let settings = GripperSettings { palm_from_tcp: Some(turned), ..Default::default() };
    let gripper = Gripper::from_urdf(&file.path, &settings).unwrap();
    let right = gripper.parts.iter().find(|part| part.role == Role::Right).unwrap();
    assert_eq!(right.link, "a");
    let aslant =
        Pose::from_parts(DVec3::Z * 0.08, parry3d_f64::math::Rotation::from_rotation_z(0.3));
    for wrong in [
        GripperSettings { fingers: Some(["a".into(), "palm".into()]), ..Default::default() },
        GripperSettings { fingers: Some(["a".into(), "z".into()]), ..Default::default() },
        GripperSettings { flange: Some("a".into()), ..Default::default() },
        GripperSettings { palm_from_tcp: Some(aslant), ..Default::default() },
    ] {
        let error = Gripper::from_urdf(&file.path, &wrong).unwrap_err();
        assert_eq!(error.code(), "no-gripper", "{wrong:?}");
    }
}

#[test]
fn what_is_no_gripper_says_so() {
    let one = format!(
        "<robot name=\"one\">{BASE}{}{}</robot>",
        finger("a", -1.0),
        slide("ja", "a", -1.0, "")
    );
    // Both fingers move the same way: they never close.
    let same = two_fingers("").replace(r#"<axis xyz="0 -1 0"/>"#, r#"<axis xyz="0 1 0"/>"#);
    let same =
        same.replacen(r#"<limit lower="0" upper="0.03""#, r#"<limit lower="0" upper="0.02""#, 1);
    // Pads that miss each other.
    let aside = two_fingers("").replacen("0 0.005 0.02", "0.05 0.005 0.02", 1);
    for text in [one, same, aside, "<robot name=\"none\"><link name=\"l\"/></robot>".into()] {
        let error = load(&text).unwrap_err();
        assert_eq!(error.code(), "no-gripper", "{error}");
    }
}

/// A thumb `a` that meets `b`, and another finger 4 cm beside that, which the thumb meets where it is `wide`.
fn thumb_and_two(mimics: [&str; 2], wide: bool) -> String {
    let beside = finger("c", 1.0).replace("xyz=\"0 ", "xyz=\"0.04 ");
    let third = beside + &slide("jc", "c", 1.0, mimics[1]);
    let text = two_fingers(mimics[0]).replace("</robot>", &(third + "</robot>"));
    let across = if wide { "0.12 0.01 0.04" } else { "0.02 0.01 0.04" };
    text.replacen("0.02 0.01 0.04", across, 1)
}

#[test]
fn a_hand_with_a_third_finger_is_refused_in_words() {
    let coupled = r#"<mimic joint="ja"/>"#;
    for mimics in [[coupled, coupled], [coupled, ""], ["", ""]] {
        for wide in [false, true] {
            let file = file(&thumb_and_two(mimics, wide));
            let error = Gripper::from_urdf(&file.path, &GripperSettings::default()).unwrap_err();
            assert_eq!(error.code(), "no-gripper");
            let text = error.to_string();
            assert!(text.contains("three or more") && text.contains("`a`"), "{text}");
            assert!(text.contains("`b`") && text.contains("`c`"), "{text}");
            let fingers = Some(["a".into(), "b".into()]);
            let settings = GripperSettings { fingers, ..Default::default() };
            assert!(Gripper::from_urdf(&file.path, &settings).is_ok(), "told which two");
        }
    }
}

/// The gripper of two fingers, its names led by a letter, as a piece of a larger robot.
fn prefixed_gripper(k: &str) -> String {
    two_fingers("")
        .replace("<robot name=\"two\">", "")
        .replace("</robot>", "")
        .replace("\"palm\"", &format!("\"{k}palm\""))
        .replace("name=\"a\"", &format!("name=\"{k}a\""))
        .replace("name=\"b\"", &format!("name=\"{k}b\""))
        .replace("link=\"a\"", &format!("link=\"{k}a\""))
        .replace("link=\"b\"", &format!("link=\"{k}b\""))
        .replace("\"ja\"", &format!("\"{k}ja\""))
        .replace("\"jb\"", &format!("\"{k}jb\""))
}

/// The joint that carries it.
fn arm_to(k: &str) -> String {
    format!(
        r#"<joint name="{k}arm" type="continuous"><parent link="body"/>
        <child link="{k}palm"/><axis xyz="0 0 1"/></joint>"#
    )
}

#[test]
fn two_grippers_are_refused_until_one_is_named() {
    let text = format!(
        "<robot name=\"yu\"><link name=\"body\"/>{}{}{}{}</robot>",
        prefixed_gripper("x"),
        prefixed_gripper("y"),
        arm_to("x"),
        arm_to("y")
    );
    let file = file(&text);
    let error = Gripper::from_urdf(&file.path, &GripperSettings::default()).unwrap_err();
    assert!(error.to_string().contains("`xa` and `xb`; `ya` and `yb`"), "{error}");
    let fingers = Some(["ya".into(), "yb".into()]);
    let gripper =
        Gripper::from_urdf(&file.path, &GripperSettings { fingers, ..Default::default() }).unwrap();
    assert!(gripper.parts.iter().all(|part| part.link.starts_with('y')));
}

fn n_palms(gripper: &Gripper) -> usize {
    gripper.parts.iter().filter(|part| part.role == Role::Palm).count()
}

#[test]
fn a_mesh_that_cannot_be_read_is_replaced_and_noted() {
    let mesh = r#"<mesh filename="palm.dae"/>"#;
    let box_shape = r#"<box size="0.06 0.2 0.06"/>"#;
    let inertial = r#"<inertial><mass value="1"/>
        <inertia ixx="0.001" iyy="0.001" izz="0.001"/></inertial></link>"#;
    let with_mesh = two_fingers("").replace(box_shape, mesh);
    let alone = file(&with_mesh);
    fs::write(alone.folder.path().join("palm.dae"), "<COLLADA/>").unwrap();
    let refused = Gripper::from_urdf(&alone.path, &GripperSettings::default()).unwrap_err();
    assert!(refused.to_string().contains("DAE is not supported"), "{refused}");

    let weighed = with_mesh.replacen("</link>", inertial, 1);
    let gripper = load(&weighed).unwrap();
    assert!(gripper.notes[0].contains("box of its inertia"), "{:?}", gripper.notes);
    let side = gripper.parts[0].shape.compute_aabb(&Pose::IDENTITY).extents().x;
    assert!((side - (6.0f64 * 0.001).sqrt()).abs() < 1e-12);

    let known = with_mesh.replace("\"palm\"", "\"panda_hand\"");
    let gripper = load(&known).unwrap();
    assert!(gripper.notes[0].contains("boxes of `franka`"), "{:?}", gripper.notes);
    assert_eq!(n_palms(&gripper), n_palms(&Gripper::builtin("franka").unwrap()));

    let pads = r#"<box size="0.02 0.01 0.04"/>"#;
    let padless = known.replace(pads, r#"<mesh filename="package://p/finger.stl"/>"#);
    let gripper = load(&padless).unwrap();
    assert_eq!(gripper.name, "franka");
    assert!(gripper.notes[0].contains("instead of the description"), "{:?}", gripper.notes);
}

#[test]
fn meshes_come_from_mapped_packages_only() {
    let folder = tempfile::tempdir().unwrap();
    let package = folder.path().join("package");
    fs::create_dir_all(package.join("m")).unwrap();
    let (corners, faces) = Cuboid::new(DVec3::new(30.0, 100.0, 30.0)).to_trimesh();
    let mut obj = String::new();
    corners.iter().for_each(|p| obj += &format!("v {} {} {}\n", p.x, p.y, p.z));
    faces.iter().for_each(|f| obj += &format!("f {} {} {}\n", f[0] + 1, f[1] + 1, f[2] + 1));
    fs::write(package.join("m/palm.obj"), obj).unwrap();
    let mesh = r#"<mesh filename="package://p/m/palm.obj" scale="0.001 0.001 0.001"/>"#;
    let text = two_fingers("").replace(r#"<box size="0.06 0.2 0.06"/>"#, mesh);
    let file = file(&text);
    let settings =
        GripperSettings { packages: [("p".to_owned(), package)].into(), ..Default::default() };
    let gripper = Gripper::from_urdf(&file.path, &settings).unwrap();
    let size = gripper.parts[0].shape.compute_aabb(&Pose::IDENTITY).extents();
    assert!((size - DVec3::new(0.06, 0.2, 0.06)).length() < 1e-9 && gripper.notes.is_empty());
    assert!(load(&text).unwrap_err().to_string().contains("not mapped"));
    let escape = text.replace("package://p/m/palm.obj", "../../../../etc/passwd");
    assert_eq!(load(&escape).unwrap_err().code(), "path-outside");
}

#[test]
fn a_file_or_a_name_opens() {
    let settings = GripperSettings::default();
    let file = file(&two_fingers(""));
    assert_eq!(Gripper::open(file.path.to_str().unwrap(), &settings).unwrap().name, "two");
    assert_eq!(Gripper::open("robotiq-2f85", &settings).unwrap().name, "robotiq-2f85");
    assert_eq!(Gripper::open("panda", &settings).unwrap_err().code(), "unknown-gripper");
    assert_eq!(Gripper::open("nowhere.urdf", &settings).unwrap_err().code(), "io");
}

#[test]
fn no_part_reaches_between_open_pads() {
    for text in [two_fingers(""), crank_gripper()] {
        let gripper = load(&text).unwrap();
        for share in [0.1, 0.5, 1.0] {
            let width = share * gripper.opening.end();
            let half =
                (DVec3::new(gripper.pad[0], width, gripper.pad[1]) - DVec3::splat(1e-5)) / 2.0;
            for PosedPart { tcp_from_part: pose, part } in gripper.parts_at(width) {
                let gap = Cuboid::new(half);
                let hit = intersection_test(&pose, &*part.shape, &Pose::IDENTITY, &gap)
                    .unwrap()
                    .intersecting;
                assert!(!hit, "{} at {width}", part.link);
            }
        }
    }
}

const LINKS: &str = r#"<link name="a"/><link name="b"/>"#;

/// Two links and a revolute joint that holds what is given.
fn joint(inside: &str) -> String {
    format!(
        "<robot name=\"r\">\n{LINKS}\n<joint name=\"j\" type=\"revolute\"><parent link=\"a\"/>\
         <child link=\"b\"/>{inside}</joint></robot>"
    )
}

#[test]
fn hostile_descriptions_are_refused_with_code_and_place() {
    let limit = r#"<limit lower="0" upper="1" effort="1" velocity="1"/>"#;
    let circle = r#"<joint name="k" type="fixed"><parent link="b"/><child link="a"/></joint>"#;
    let twin = r#"<joint name="j" type="fixed"><parent link="b"/><child link="c"/></joint>"#;
    let cases = [
        ("non-finite", joint(&format!("{limit}<axis xyz=\"nan 0 1\"/>"))),
        ("axis", joint(&format!("{limit}<axis xyz=\"0 0 0\"/>"))),
        ("number", joint(&format!("{limit}<axis xyz=\"0 x 1\"/>"))),
        ("number", joint(&format!("{limit}<axis xyz=\"0 1\"/>"))),
        ("limit", joint(r#"<limit lower="2" upper="1" effort="1" velocity="1"/>"#)),
        ("non-finite", joint(r#"<limit lower="nan" upper="1" effort="1" velocity="1"/>"#)),
        ("cycle", joint(limit).replace("</robot>", &format!("{circle}</robot>"))),
        ("cycle", joint(&format!("{limit}<mimic joint=\"j\"/>"))),
        (
            "duplicate-name",
            joint(limit).replace("</robot>", &format!("<link name=\"c\"/>{twin}</robot>")),
        ),
        ("element", joint(&format!("{limit}{limit}"))),
        ("joint-type", joint(limit).replace("revolute", "wobbly")),
        ("attribute", joint(limit).replace("<joint name=\"j\"", "<joint")),
        ("name", "<robot name=\"r\"><link name=\"\"/></robot>".into()),
        (
            "geometry",
            "<robot name=\"r\"><link name=\"l\"><visual><geometry/></visual></link></robot>".into(),
        ),
        ("size", format!("<robot name=\"r\">{}</robot>", "<a/>".repeat(200_001))),
        ("size", " ".repeat((32 << 20) + 1)),
    ];
    for (code, text) in cases {
        let error = RobotDescription::parse(text.as_bytes(), "r.urdf").unwrap_err();
        assert_eq!(error.code(), code, "{error}");
        assert!(error.place().is_some());
    }
    let error =
        RobotDescription::parse(joint("<axis xyz=\"inf 0 1\"/>").as_bytes(), "r.urdf").unwrap_err();
    assert!(error.to_string().starts_with("r.urdf: line 3: axis: xyz"), "{error}");
    // Sound as a fragment, refused as a tree.
    let twice = format!(
        "<robot name=\"r\">{LINKS}<link name=\"a\"/><joint name=\"j\" type=\"fixed\"><parent link=\"a\"/><child link=\"b\"/></joint></robot>"
    );
    let description = RobotDescription::parse(twice.as_bytes(), "r.urdf");
    assert_eq!(description.and_then(|d| d.tree()).unwrap_err().code(), "tree");
}

#[test]
fn hands_of_kilometres_are_refused_before_anything_is_made_for_them() {
    let sound = two_fingers(r#"<mimic joint="ja"/>"#);
    for (from, to) in [
        (r#"upper="0.03""#, r#"upper="1e12""#),
        (r#"upper="0.03""#, r#"upper="1e5""#),
        (r#"upper="0.03""#, r#"upper="30""#),
        (r#"upper="0.03""#, r#"upper="1e300""#),
        (r#"xyz="0 0 0.06""#, r#"xyz="0 0 1e6""#),
        (r#"xyz="0 -0.005 0.02""#, r#"xyz="0 -1e6 0.02""#),
        (r#"xyz="0 0.005 0.02""#, r#"xyz="0 5e11 0.02""#),
        (r#"size="0.02 0.01 0.04""#, r#"size="20 10 40""#),
        (r#"size="0.06 0.2 0.06""#, r#"size="1e9 0.2 0.06""#),
        (r#"<mimic joint="ja"/>"#, r#"<mimic joint="ja" multiplier="1e9"/>"#),
    ] {
        assert!(sound.contains(from), "{from}");
        let start = std::time::Instant::now();
        let error = load(&sound.replacen(from, to, 2)).unwrap_err();
        assert_eq!(error.code(), "no-gripper", "{to}: {error}");
        assert!(start.elapsed().as_secs_f64() < 1.0, "{to}: {:?}", start.elapsed());
    }
    let error = load(&sound.replacen(r#"upper="0.03""#, r#"upper="30""#, 2)).unwrap_err();
    let text = error.to_string();
    assert!(text.contains("at most 5 m") && text.contains("`ja` from 0 to 30"), "{text}");
    // Numbers that no robot has, wherever they stand.
    for (from, to) in [
        (r#"xyz="0 0 0.06""#, r#"xyz="0 0 1e13""#),
        (r#"size="0.02 0.01 0.04""#, r#"size="1e200 1 1""#),
    ] {
        let text = load(&sound.replacen(from, to, 1)).unwrap_err().to_string();
        assert!(text.contains("at most 1e12"), "{text}");
    }
}

#[test]
fn meshes_of_kilometres_are_refused() {
    let mesh = "v 0 -0.005 0\nv 0.02 -0.005 0\nv 0 0.005 0\nv 0 0 0.04\nf 1 2 3\nf 1 4 2\nf 2 4 3\nf 3 4 1\n";
    for scale in ["1000 1000 1000", "1e12 1e12 1e12", "1e12 1 1"] {
        let link = format!(
            r#"<link name="a"><collision><geometry><mesh filename="f.obj" scale="{scale}"/>
            </geometry></collision></link>"#
        );
        let file = file(&two_fingers(r#"<mimic joint="ja"/>"#).replace(&finger("a", -1.0), &link));
        fs::write(file.folder.path().join("f.obj"), mesh).unwrap();
        let error = Gripper::from_urdf(&file.path, &GripperSettings::default()).unwrap_err();
        assert!(matches!(error.code(), "no-gripper" | "size"), "{scale}: {error}");
    }
}

#[test]
fn a_joint_without_limits_is_named() {
    let limit = r#"<limit lower="0" upper="0.03" effort="1" velocity="1"/>"#;
    for instead in ["", r#"<limit effort="1" velocity="1"/>"#] {
        let text = two_fingers("").replace(limit, instead);
        let error = load(&text).unwrap_err().to_string();
        assert!(error.contains("no range of motion") && error.contains("`ja`, `jb`"), "{error}");
        let description = RobotDescription::parse(text.as_bytes(), "r.urdf").unwrap();
        let notes = description.notes();
        assert!(
            notes.iter().any(|n| n.contains("`ja`: a prismatic joint without limits")),
            "{notes:?}"
        );
    }
}

/// A robot of `n` links: a chain, a star, or pairs of a leader and its mimic.
fn many_links(n: usize, kind: &str) -> String {
    let mut text = String::from("<robot name=\"many\"><link name=\"l0\"/>");
    let shape = r#"<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision>"#;
    for i in 1..n {
        let parent = if kind == "chain" { i - 1 } else { 0 };
        let mimic = match kind {
            "mimics" if i % 2 == 0 => format!(r#"<mimic joint="j{}"/>"#, i - 1),
            "one leader" if i > 1 => format!(r#"<mimic joint="j{}"/>"#, i - 1),
            _ => String::new(),
        };
        text += &format!(
            r#"<link name="l{i}">{shape}</link><joint name="j{i}" type="prismatic"><parent link="l{parent}"/>
            <child link="l{i}"/><origin xyz="0 0.001 0"/><axis xyz="0 1 0"/>
            <limit lower="0" upper="0.0{}1" effort="1" velocity="1"/>{mimic}</joint>"#,
            i % 7
        );
    }
    text + "</robot>"
}

#[test]
fn the_time_grows_with_the_links_not_with_their_square() {
    // Ten or eleven elements a link: nearly as many as a file may have.
    const N: usize = 18_000;
    let seconds = |kind: &str, n: usize| {
        let text = many_links(n, kind);
        let start = std::time::Instant::now();
        let description = RobotDescription::parse(text.as_bytes(), "many.urdf").unwrap();
        assert_eq!(description.tree().unwrap().links.len(), n);
        assert!(load(&text).is_err(), "{kind}");
        start.elapsed().as_secs_f64()
    };
    for kind in ["chain", "star", "mimics", "one leader"] {
        // Four times the links take sixteen times as long where the time grows with their square (it was ten seconds); two
        // seconds are for a machine that does something else meanwhile.
        let (quarter, all) = (seconds(kind, N / 4), seconds(kind, N));
        assert!(all < 8.0 * quarter + 2.0, "{kind}: {quarter} s for a quarter, {all} s for all");
    }
}
