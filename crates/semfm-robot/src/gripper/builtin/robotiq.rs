//! Robotiq's grippers with two fingers on parallelograms.

use semfm_geom::math::DVec2;

use super::BuiltinGripper;
use super::parallelogram::Parallelogram;

/// The published ROS model of the 2F-140 opens to 128.5 mm only, since its pads are 7.5 mm thick boxes at the place of
/// the real ones, and its boxes for collisions (30 × 70 mm) are larger than the pads that it shows (27 × 65 mm). A
/// URDF keeps its own opening, which is what its robot will do in a simulator, takes the pads from here, and says both.
const SOURCE: &str = "instruction manual, section \"Specifications\" (strokes 85 and 140 mm, foot of \
                      75 mm diameter), and the published ROS model for the joints of the parallelogram and \
                      the pads (22 × 37.5 and 27 × 65 mm)";

pub(super) const ROBOTIQ_2F85: BuiltinGripper = BuiltinGripper {
    name: "robotiq-2f85",
    summary: "Robotiq 2F-85, 85 mm",
    source: SOURCE,
    also_called: &["2f85", "robotiq", "85"],
    known_by: &["2f85"],
    make: |row| DIMENSIONS_2F85.gripper(row.name),
};

pub(super) const ROBOTIQ_2F140: BuiltinGripper = BuiltinGripper {
    name: "robotiq-2f140",
    summary: "Robotiq 2F-140, 140 mm",
    source: SOURCE,
    also_called: &["2f140", "140"],
    known_by: &["2f140"],
    make: |row| DIMENSIONS_2F140.gripper(row.name),
};

const DIMENSIONS_2F85: Parallelogram = Parallelogram {
    stroke: 0.085,
    pad: [0.022, 0.0375],
    pivot: DVec2::new(0.0306, 0.0549),
    inner_pivot: DVec2::new(0.0127, 0.0614),
    length: 0.0571,
    elbow: DVec2::new(0.0315, -0.0041),
    inset: 0.0252,
    rise: 0.0324,
};

const DIMENSIONS_2F140: Parallelogram = Parallelogram {
    stroke: 0.14,
    pad: [0.027, 0.065],
    pivot: DVec2::new(0.0306, 0.0549),
    inner_pivot: DVec2::new(0.0127, 0.0614),
    length: 0.1,
    elbow: DVec2::new(0.0315, -0.0036),
    inset: 0.0252,
    rise: 0.0458,
};
