//! Published grippers: what is found in their descriptions, beside their makers' figures and ours.

mod shared_data;

use parry3d_f64::bounding_volume::{Aabb, BoundingVolume};
use parry3d_f64::math::Pose;
use parry3d_f64::query::intersection_test;
use parry3d_f64::shape::Cuboid;
use semfm_geom::math::DVec3;
use semfm_robot::{Gripper, GripperSettings, PosedPart, Role};

use shared_data::shared;

struct Published {
    file: &'static str,
    builtin: &'static str,
    /// Maker's stroke, metres, and how far the description's may be off.
    stroke: (f64, f64),
    /// TCP above the flange when closed, metres, and how far the description's may be off.
    tcp: (f64, f64),
}

const PUBLISHED: [Published; 3] = [
    Published {
        file: "panda/urdf/panda_local.urdf",
        builtin: "franka",
        stroke: (0.08, 1e-4),
        tcp: (0.1034, 5e-4),
    },
    // The model ends 1.5 mm before its pads touch and opens to 86.1 mm.
    Published {
        file: "robotiq_2f_85/urdf/2f85_local.urdf",
        builtin: "robotiq-2f85",
        stroke: (0.085, 2e-3),
        tcp: (0.1442, 1e-3),
    },
    // The model's pads are boxes 5.7 mm thicker on each side than the maker's stroke leaves room
    // for: it opens to 128.5 mm.
    Published {
        file: "robotiq_2f_140/urdf/2f140_local.urdf",
        builtin: "robotiq-2f140",
        stroke: (0.14, 12e-3),
        tcp: (0.2006, 1e-3),
    },
];

fn grippers() -> Option<Vec<(Published, Gripper)>> {
    let robots = shared("data/robots")?;
    let mut found = Vec::new();
    for published in PUBLISHED {
        let path = robots.join(published.file);
        let gripper = Gripper::from_urdf(path, &GripperSettings::default());
        found.push((published, gripper.unwrap_or_else(|error| panic!("{error}"))));
    }
    Some(found)
}

#[test]
fn openings_and_tcps_are_those_that_the_makers_publish() {
    for (published, gripper) in grippers().unwrap_or_default() {
        let name = published.builtin;
        let (stroke, off) = published.stroke;
        assert!(*gripper.opening.start() <= 2e-3, "{name}: {:?}", gripper.opening);
        assert!((gripper.opening.end() - stroke).abs() <= off, "{name}: {:?}", gripper.opening);
        let (height, tcp_off) = published.tcp;
        let tcp = gripper.flange_from_tcp.translation;
        assert!((tcp - DVec3::Z * height).length() <= tcp_off, "{name}: {tcp}");
        // Where the model differs from the hand, both are told, with the source.
        if off > 5e-3 {
            let notes = gripper.notes.join("; ");
            assert!(notes.contains("128.5 mm") && notes.contains("140.0 mm"), "{notes}");
            assert!(
                notes.contains("27.0 × 65.0 mm") && notes.contains("30.0 × 70.0 mm"),
                "{notes}"
            );
            assert!(notes.contains("manual"), "{notes}");
            assert_eq!(gripper.pad, Gripper::builtin(name).unwrap().pad);
        } else {
            assert!(gripper.notes.is_empty(), "{name}: {:?}", gripper.notes);
        }
    }
}

/// The box around all parts of a role, 60 mm open.
fn bounds_of(gripper: &Gripper, role: Role) -> Aabb {
    let parts = gripper.parts_at(0.06).into_iter().filter(|posed| posed.part.role == role);
    parts
        .map(|posed| posed.part.shape.compute_aabb(&posed.tcp_from_part))
        .reduce(|a, b| a.merged(&b))
        .unwrap()
}

#[test]
fn the_built_in_grippers_agree_with_the_descriptions() {
    for (published, gripper) in grippers().unwrap_or_default() {
        let name = published.builtin;
        let ours = Gripper::builtin(name).unwrap();
        let (a, b) = (gripper.flange_from_tcp, ours.flange_from_tcp);
        assert!(a.rotation.angle_between(b.rotation) < 1e-6, "{name}: {a:?} {b:?}");
        for (found, ours) in gripper.pad.iter().zip(ours.pad) {
            assert!((found - ours).abs() <= 5e-3, "{name}: pad {:?}", gripper.pad);
        }
        // The same width, the same height of the palm, within what the strokes differ by.
        for width in [0.01, 0.04, 0.08] {
            let drift = (gripper.flange_from_tcp_at(width).translation
                - ours.flange_from_tcp_at(width).translation)
                .length();
            assert!(drift < 4e-3, "{name} at {width}: {drift}");
        }
        // Outer size at a common width, finger by finger and palm by palm: our boxes neither miss
        // a centimetre of the gripper nor add two.
        for role in [Role::Palm, Role::Left, Role::Right] {
            let [found, ours] = [&gripper, &ours].map(|one| bounds_of(one, role));
            let low = (found.mins - ours.mins).abs().max_element();
            let high = (found.maxs - ours.maxs).abs().max_element();
            assert!(low < 0.012 && high < 0.012, "{name} {role:?}: {found:?} {ours:?}");
        }
    }
}

#[test]
fn the_space_between_open_pads_is_free() {
    for (published, gripper) in grippers().unwrap_or_default() {
        for share in [0.3, 0.6, 1.0] {
            let width = share * gripper.opening.end();
            let half = DVec3::new(gripper.pad[0], width - 1e-4, gripper.pad[1]) / 2.0;
            let gap = Cuboid::new(half);
            for PosedPart { tcp_from_part: pose, part } in gripper.parts_at(width) {
                let hit = intersection_test(&pose, &*part.shape, &Pose::IDENTITY, &gap)
                    .unwrap()
                    .intersecting;
                assert!(!hit, "{}: {} at {width}", published.builtin, part.link);
            }
        }
    }
}

#[test]
fn an_arm_without_a_gripper_says_so() {
    let Some(robots) = shared("data/robots") else { return };
    let settings = GripperSettings::default();
    for arm in ["ur5/urdf/ur5_local.urdf", "ur5e/urdf/ur5e_local.urdf"] {
        let error = Gripper::from_urdf(robots.join(arm), &settings).unwrap_err();
        assert_eq!(error.code(), "no-gripper", "{error}");
    }
}
