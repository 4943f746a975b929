//! An arm with a hand, as URDF text: seven joints, links of primitive shapes, dimensions of our own.
//!
//! Shoulder, elbow and wrist are spherical (axes z, y, z · y · z, y, z), so that at zero the arm stands straight up
//! and all frames are parallel. The hand is bolted to the link `flange`: two fingers that slide.

use std::fmt::Write as _;

/// Name of the robot and of its file without extension.
pub const ARM_NAME: &str = "synth_arm";

/// The link that the hand is bolted to.
pub const ARM_FLANGE: &str = "flange";

/// A posture for the start of a motion, one value a joint, radians: elbow up, hand down, before the base.
pub const ARM_HOME: [f64; 7] = [0.0, -0.35, 0.0, 1.9, 0.0, 1.55, 0.0];

/// A joint of the arm with the link that it moves. All joint frames are parallel at zero.
struct ArmJoint {
    /// Height above the joint before it, metres.
    above: f64,
    axis: [f64; 3],
    /// Greatest angle to either side, radians.
    limit: f64,
    /// Radians per second.
    velocity: f64,
    /// Newton metres.
    effort: f64,
    /// Radius, low and high end along z of the link's cylinder, metres.
    cylinder: [f64; 3],
    /// Radius of the ball in which the next joint sits; zero where there is none.
    ball: f64,
}

const fn joint(
    above: f64,
    axis: [f64; 3],
    limit: f64,
    speed: [f64; 2],
    body: [f64; 4],
) -> ArmJoint {
    let [velocity, effort] = speed;
    let [radius, low, high, ball] = body;
    ArmJoint { above, axis, limit, velocity, effort, cylinder: [radius, low, high], ball }
}

const Y: [f64; 3] = [0.0, 1.0, 0.0];
const Z: [f64; 3] = [0.0, 0.0, 1.0];
const STRONG: [f64; 2] = [2.0, 90.0];
const FAST: [f64; 2] = [2.5, 20.0];

/// Shoulder at 0.33 m, upper arm 0.38 m, forearm 0.36 m, wrist to flange 0.13 m.
const JOINTS: [ArmJoint; 7] = [
    joint(0.20, Z, 2.9, STRONG, [0.075, 0.0, 0.13, 0.085]),
    joint(0.13, Y, 2.0, STRONG, [0.06, 0.0, 0.20, 0.0]),
    joint(0.20, Z, 2.9, STRONG, [0.06, 0.0, 0.18, 0.07]),
    joint(0.18, Y, 2.4, STRONG, [0.055, 0.0, 0.20, 0.0]),
    joint(0.20, Z, 2.9, FAST, [0.05, 0.0, 0.16, 0.06]),
    joint(0.16, Y, 2.1, FAST, [0.045, 0.0, 0.07, 0.0]),
    joint(0.07, Z, 2.9, FAST, [0.04, 0.0, 0.06, 0.0]),
];

/// Above the last joint, metres.
const FLANGE: f64 = 0.06;

/// Farthest that one finger slides, metres.
const FINGER_STROKE: f64 = 0.04;

/// Where the fingers begin above the flange, metres.
const FINGERS: f64 = 0.07;

/// The arm with its hand as URDF text. Base link `base`, flange `flange`, the hand's links `hand`, `left_finger` and
/// `right_finger`.
///
/// ```
/// assert!(semfm_synth::arm_urdf().contains("<link name=\"flange\"/>"));
/// ```
pub fn arm_urdf() -> String {
    let mut urdf = format!("<?xml version=\"1.0\"?>\n<robot name=\"{ARM_NAME}\">\n");
    push_link(&mut urdf, "base", 4.0, &[Shape::cylinder(0.09, 0.0, 0.2)]);
    let mut parent = "base".to_owned();
    for (i, joint) in JOINTS.iter().enumerate() {
        let child = format!("link{}", i + 1);
        let [radius, low, high] = joint.cylinder;
        let mut shapes = vec![Shape::cylinder(radius, low, high)];
        if joint.ball > 0.0 {
            shapes.push(Shape { at: [0.0, 0.0, high], body: Body::Sphere(joint.ball) });
        }
        push_link(&mut urdf, &child, 3.0 - 0.3 * i as f64, &shapes);
        let [x, y, z] = joint.axis;
        let ArmJoint { above, limit, velocity, effort, .. } = joint;
        let motion = format!(
            "<axis xyz=\"{x} {y} {z}\"/>\n    \
             <limit lower=\"{}\" upper=\"{limit}\" velocity=\"{velocity}\" effort=\"{effort}\"/>",
            -limit
        );
        push_joint(
            &mut urdf,
            &format!("joint{}", i + 1),
            "revolute",
            &parent,
            &child,
            [0.0, 0.0, *above],
            &motion,
        );
        parent = child;
    }
    urdf.push_str("  <link name=\"flange\"/>\n");
    push_joint(&mut urdf, "flange_joint", "fixed", &parent, ARM_FLANGE, [0.0, 0.0, FLANGE], "");
    push_hand(&mut urdf);
    urdf.push_str("</robot>\n");
    urdf
}

/// Palm and fingers; the right finger follows the left one.
fn push_hand(urdf: &mut String) {
    let palm = Shape::block([0.05, 0.2, FINGERS], [0.0, 0.0, FINGERS / 2.0]);
    push_link(urdf, "hand", 0.7, &[palm]);
    push_joint(urdf, "hand_joint", "fixed", ARM_FLANGE, "hand", [0.0; 3], "");
    for (name, side, mimic) in [
        ("left_finger", 1.0, ""),
        ("right_finger", -1.0, "\n    <mimic joint=\"left_finger_joint\"/>"),
    ] {
        // Carriage, then a tip whose flat face touches the other's when closed.
        let carriage = Shape::block([0.022, 0.024, 0.022], [0.0, side * 0.016, 0.011]);
        let tip = Shape::block([0.018, 0.016, 0.026], [0.0, side * 0.008, 0.035]);
        push_link(urdf, name, 0.05, &[carriage, tip]);
        let motion = format!(
            "<axis xyz=\"0 {side} 0\"/>\n    \
             <limit lower=\"0\" upper=\"{FINGER_STROKE}\" velocity=\"0.1\" effort=\"40\"/>{mimic}"
        );
        push_joint(
            urdf,
            &format!("{name}_joint"),
            "prismatic",
            "hand",
            name,
            [0.0, 0.0, FINGERS],
            &motion,
        );
    }
}

/// A primitive at its place in a link.
struct Shape {
    at: [f64; 3],
    body: Body,
}

enum Body {
    /// Radius and length, along z.
    Cylinder(f64, f64),
    Sphere(f64),
    /// Edge lengths.
    Block([f64; 3]),
}

impl Shape {
    /// About z, between two heights.
    fn cylinder(radius: f64, low: f64, high: f64) -> Self {
        Self { at: [0.0, 0.0, (low + high) / 2.0], body: Body::Cylinder(radius, high - low) }
    }

    fn block(size: [f64; 3], at: [f64; 3]) -> Self {
        Self { at, body: Body::Block(size) }
    }

    /// Its URDF element.
    fn element(&self) -> String {
        let [x, y, z] = self.at.map(rounded);
        let geometry = match self.body {
            Body::Cylinder(radius, length) => {
                format!("<cylinder radius=\"{radius}\" length=\"{}\"/>", rounded(length))
            }
            Body::Sphere(radius) => format!("<sphere radius=\"{radius}\"/>"),
            Body::Block([x, y, z]) => format!("<box size=\"{x} {y} {z}\"/>"),
        };
        format!("<origin xyz=\"{x} {y} {z}\"/><geometry>{geometry}</geometry>")
    }

    /// Principal moments of inertia of a kilogram of it about its centre, m².
    fn moments(&self) -> [f64; 3] {
        match self.body {
            Body::Cylinder(radius, length) => {
                let across = (3.0 * radius * radius + length * length) / 12.0;
                [across, across, radius * radius / 2.0]
            }
            Body::Sphere(radius) => [0.4 * radius * radius; 3],
            Body::Block([x, y, z]) => {
                [y * y + z * z, x * x + z * z, x * x + y * y].map(|sum| sum / 12.0)
            }
        }
    }
}

/// A link that is seen and collides as the same shapes; its mass sits in the first of them.
fn push_link(urdf: &mut String, name: &str, mass: f64, shapes: &[Shape]) {
    let [x, y, z] = shapes[0].at.map(rounded);
    let [xx, yy, zz] = shapes[0].moments().map(|moment| mass * moment);
    // Text grows in memory: writing to it cannot fail.
    let _ = write!(
        urdf,
        "  <link name=\"{name}\">\n    \
         <inertial><origin xyz=\"{x} {y} {z}\"/><mass value=\"{mass:.2}\"/><inertia ixx=\"{xx:.6}\" ixy=\"0\" \
         ixz=\"0\" iyy=\"{yy:.6}\" iyz=\"0\" izz=\"{zz:.6}\"/></inertial>\n"
    );
    for shape in shapes {
        let element = shape.element();
        let _ =
            write!(urdf, "    <visual>{element}</visual>\n    <collision>{element}</collision>\n");
    }
    urdf.push_str("  </link>\n");
}

/// A joint whose frame stands at `at` in its parent's, unturned; `motion` is the text of axis, limits and mimic.
fn push_joint(
    urdf: &mut String,
    name: &str,
    kind: &str,
    parent: &str,
    child: &str,
    at: [f64; 3],
    motion: &str,
) {
    let [x, y, z] = at;
    let motion = if motion.is_empty() { String::new() } else { format!("\n    {motion}") };
    let _ = write!(
        urdf,
        "  <joint name=\"{name}\" type=\"{kind}\">\n    <parent link=\"{parent}\"/>\n    <child link=\"{child}\"/>\n    \
         <origin xyz=\"{x} {y} {z}\"/>{motion}\n  </joint>\n"
    );
}

/// To a micrometre, so that the text has no digits of rounding.
fn rounded(length: f64) -> f64 {
    (length * 1e6).round() / 1e6
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use semfm_robot::{Gripper, GripperSettings, RobotDescription};

    use super::*;

    #[test]
    fn the_text_is_a_robot_of_seven_joints_and_a_hand() {
        let description =
            RobotDescription::parse(arm_urdf().as_bytes(), Path::new("arm.urdf")).unwrap();
        assert!(description.tree_findings().is_empty(), "{:?}", description.tree_findings());
        assert_eq!(description.n_movable(), 8); // seven joints and the finger that the other follows
        let robot = description.tree().unwrap();
        let poses = robot.link_poses(&[0.0; 16]);
        let flange = poses[robot.link(ARM_FLANGE).unwrap()];
        // Straight up: the sum of its lengths.
        assert!((flange.translation.z - 1.2).abs() < 1e-12, "{flange:?}");
        for (i, home) in ARM_HOME.iter().enumerate() {
            assert!(home.abs() < JOINTS[i].limit);
        }
    }

    #[test]
    fn the_hand_is_found_as_a_gripper() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("arm.urdf");
        std::fs::write(&path, arm_urdf()).unwrap();
        let gripper = Gripper::from_urdf(&path, &GripperSettings::default()).unwrap();
        assert!((gripper.opening.start() - 0.0).abs() < 1e-9);
        assert!((gripper.opening.end() - 2.0 * FINGER_STROKE).abs() < 1e-9);
        // The flange is the bare link that the palm is bolted to; the TCP lies above it along the approach.
        let tcp = gripper.flange_from_tcp.translation;
        assert!(tcp.x.abs() < 1e-9 && tcp.y.abs() < 1e-9);
        assert!((0.09..0.14).contains(&tcp.z), "{tcp:?}");
    }
}
