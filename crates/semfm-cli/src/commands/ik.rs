//! `semfm-cli ik`: joint values that bring an arm's tip to a pose.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::{Args, ValueEnum};
use semfm::files::read_rigid_pose;
use semfm::pose_of_numbers;
use semfm::robot::{
    Arm, ArmFiles, ArmJoint, IkAnswer, IkSettings, IkSolution, InverseKinematics, OpenedArm, Pose,
    Preference,
};
use serde_json::{Value, json};

use super::Outcome;
use crate::console;
use crate::options::Common;

/// Find joint values that bring an arm's tip to a pose
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    semfm-cli ik panda.urdf --pose 0.4,0,0.5,1,0,0,0\n  \
    semfm-cli ik panda.urdf --srdf panda.srdf --near ready --pose pose.json --json\n\n\
    One line a solution, the nearest to --near first: joint values between commas, base to tip, radians or metres. \
    Each was checked by forward kinematics.\n\
    Exit code 0: solutions. 1: none was found; stderr says how close the best try came. 2: bad input.")]
pub struct IkCommand {
    /// The robot (URDF)
    robot: PathBuf,
    /// Where the tip shall be, in the base's frame, metres: X,Y,Z and a quaternion QX,QY,QZ,QW, or angles about the
    /// fixed axes ROLL,PITCH,YAW in radians, or a JSON file with a 4 × 4 matrix, bare or in the field `pose`
    #[arg(long, value_name = "X,Y,Z,…|FILE", allow_hyphen_values = true)]
    pose: String,
    #[command(flatten)]
    arm: ArmOptions,
    /// Where the search begins: joint values, or a state of the SRDF; by default zero, or the limit next to it
    #[arg(long, value_name = "Q1,…|NAME", allow_hyphen_values = true)]
    near: Option<String>,
    /// Distinct solutions to look for
    #[arg(long, default_value_t = 8, value_name = "N")]
    solutions: usize,
    /// Random starts in a row without a new solution after which the search ends
    #[arg(long, default_value_t = IkSettings::default().restarts, value_name = "N")]
    restarts: usize,
    /// Seed of the random starts
    #[arg(long, default_value_t = 0, value_name = "N")]
    seed: u64,
    /// What an arm with more joints than it needs does with them
    #[arg(long, value_enum, default_value_t = PreferenceName::None)]
    preference: PreferenceName,
}

/// The files of an arm.
#[derive(Debug, Default, Args)]
pub struct ArmOptions {
    /// SRDF: the chain that is meant as the arm, named states
    #[arg(long, value_name = "FILE")]
    pub srdf: Option<PathBuf>,
    /// Joint limits (MoveIt's joint_limits.yaml)
    #[arg(long, value_name = "FILE")]
    pub limits: Option<PathBuf>,
    /// The link in whose frame the pose is told; by default the SRDF's, or the root
    #[arg(long, value_name = "LINK")]
    pub base: Option<String>,
    /// The link that is moved; by default the SRDF's, or the end of the one chain of joints
    #[arg(long, value_name = "LINK")]
    pub tip: Option<String>,
}

/// [`Preference`] by name.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum PreferenceName {
    /// Where the search arrived
    None,
    /// Nearest to where the search began
    Near,
    /// Away from limits
    Limits,
    /// To where the tip moves most easily
    Manipulability,
}

impl ArmOptions {
    /// The options of the arm that `urdf` describes.
    pub fn files(&self, urdf: &Path) -> ArmFiles {
        let Self { srdf, limits, base, tip } = self;
        ArmFiles {
            urdf: urdf.into(),
            srdf: srdf.clone(),
            limits: limits.clone(),
            base: base.clone(),
            tip: tip.clone(),
            fixed: Vec::new(),
        }
    }

    /// The files that it reads.
    pub fn inputs(&self) -> impl Iterator<Item = &Path> {
        self.srdf.iter().chain(&self.limits).map(PathBuf::as_path)
    }
}

impl IkCommand {
    pub fn run(self, common: &Common) -> Result<Outcome> {
        let opened = self.arm.files(&self.robot).open()?;
        let pose = pose_option("pose", &self.pose)?;
        let near = near(&opened, self.near.as_deref()).context("--near")?;
        let settings = IkSettings {
            seed: self.seed,
            restarts: self.restarts,
            solutions: self.solutions,
            preference: match self.preference {
                PreferenceName::None => Preference::None,
                PreferenceName::Near => Preference::Near,
                PreferenceName::Limits => Preference::Limits,
                PreferenceName::Manipulability => Preference::Manipulability,
            },
            ..Default::default()
        };
        let answer = InverseKinematics::new(opened.arm.clone(), settings)?.solve(&pose, &near)?;
        if common.json {
            console::data(report(&opened, &answer));
        } else {
            if !common.quiet {
                opened.notes.iter().for_each(|note| console::message(format_args!("note: {note}")));
                console::message(format_args!("joints: {}", joint_names(&opened.arm).join(",")));
            }
            answer.solutions.iter().for_each(|solution| console::data(joined(&solution.positions)));
        }
        let Some(closest) = &answer.closest else { return Ok(Outcome::Done) };
        console::message(why_not(&opened.arm, &answer, closest));
        Ok(Outcome::NoAnswer)
    }
}

/// Joint values between commas, or a state of the SRDF; without text zero, or the limit next to it.
pub fn near(opened: &OpenedArm, text: Option<&str>) -> Result<Vec<f64>> {
    let zero = |joint: &ArmJoint| 0.0_f64.clamp(joint.lower, joint.upper);
    let Some(text) = text else {
        return Ok(opened.arm.joints().iter().map(zero).collect());
    };
    let numbers: Option<Vec<f64>> = text.split(',').map(|word| word.trim().parse().ok()).collect();
    match numbers {
        Some(numbers) => {
            opened.arm.check_positions("joint values", &numbers)?;
            Ok(numbers)
        }
        None => Ok(opened.named_state(text)?),
    }
}

/// The pose that an option tells: numbers between commas, or a file that has it bare or in the field `name`, the
/// option's name with `_`.
pub fn pose_option(name: &str, text: &str) -> Result<Pose> {
    let option = || format!("--{}", name.replace('_', "-"));
    let path = Path::new(text);
    let numbers: Option<Vec<f64>> = text.split(',').map(|word| word.trim().parse().ok()).collect();
    match numbers {
        Some(numbers) if !path.exists() => pose_of_numbers(&numbers).with_context(option),
        None if text.contains(',') && !path.exists() => {
            let expected = "6 or 7 numbers between commas or a file";
            bail!("{}: expected {expected}, found `{text}`", option())
        }
        _ => read_rigid_pose(path, name).with_context(option),
    }
}

/// Why there is no solution: what is left of the best try, and which joints it stopped at.
fn why_not(arm: &Arm, answer: &IkAnswer, closest: &IkSolution) -> String {
    let at_limit = |(joint, q): (&ArmJoint, &f64)| {
        (*q <= joint.lower || *q >= joint.upper).then(|| joint.name.clone())
    };
    let stopped: Vec<String> =
        arm.joints().iter().zip(&closest.positions).filter_map(at_limit).collect();
    let stopped = match stopped.as_slice() {
        [] => String::new(),
        names => format!("; joints at a limit: {}", names.join(", ")),
    };
    format!(
        "no solution in {} tries: the closest, {}, is {:.4} m and {:.2}° from the pose{stopped}",
        answer.tries,
        joined(&closest.positions),
        closest.position_error,
        closest.rotation_error.to_degrees()
    )
}

fn report(opened: &OpenedArm, answer: &IkAnswer) -> Value {
    let arm = &opened.arm;
    let solution = |solution: &IkSolution| {
        json!({
            "positions": solution.positions,
            "position_error": solution.position_error,
            "rotation_error": solution.rotation_error,
            "distance": solution.distance,
            "limit_margin": arm.limit_margin(&solution.positions),
            "manipulability": arm.manipulability(&solution.positions),
        })
    };
    json!({
        "base": arm.robot().links[arm.base()].name,
        "tip": arm.robot().links[arm.tip()].name,
        "joints": joint_names(arm),
        "solutions": answer.solutions.iter().map(solution).collect::<Vec<Value>>(),
        "closest": answer.closest.as_ref().map(solution),
        "tries": answer.tries,
        "notes": opened.notes,
    })
}

fn joint_names(arm: &Arm) -> Vec<&str> {
    arm.joints().iter().map(|joint| joint.name.as_str()).collect()
}

fn joined(positions: &[f64]) -> String {
    let words: Vec<String> = positions.iter().map(f64::to_string).collect();
    words.join(",")
}

#[cfg(test)]
mod tests {
    use semfm::geom::math::DVec3;

    use super::*;

    #[test]
    fn poses_come_as_quaternion_as_angles_or_from_a_file() {
        let parse_pose = |text: &str| pose_option("pose", text);
        let by_quaternion = parse_pose("1,-2,3, 0.7071,0,0,0.7071").unwrap();
        let by_angles = parse_pose(&format!("1,-2,3,{},0,0", std::f64::consts::FRAC_PI_2)).unwrap();
        assert!((by_quaternion.inverse() * by_angles).rotation.xyz().length() < 1e-9);
        assert_eq!(by_angles.translation, DVec3::new(1.0, -2.0, 3.0));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pose.json");
        std::fs::write(&path, "[[1,0,0,0.5],[0,1,0,0],[0,0,1,0],[0,0,0,1]]").unwrap();
        let from_file = parse_pose(&path.display().to_string()).unwrap();
        assert_eq!(from_file.translation, DVec3::X * 0.5);
        std::fs::write(&path, "{\"pose\": [[1,0,0,2],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}").unwrap();
        assert_eq!(parse_pose(&path.display().to_string()).unwrap().translation, DVec3::X * 2.0);
        for wrong in ["1,2,3", "1,2,3,0,0,0,2", "1,2,x,0,0,0", "1,2,3,0,0,nan", "no.json"] {
            assert!(parse_pose(wrong).is_err(), "{wrong}");
        }
    }
}
