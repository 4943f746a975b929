//! Limits of joints that a URDF cannot tell: accelerations and jerks, and other values that take the place of its own.

use std::collections::BTreeMap;
use std::path::Path;

use semfm_geom::io::read_at_most;

use crate::Result;
use crate::urdf::{Fault, quoted};
use crate::yaml::{Yaml, YamlValue};

/// Largest file that is read: a hundred joints take 20 kB.
const MAX_BYTES: u64 = 1 << 20;

/// Tables above `joint_limits` in files for ROS 2's parameters.
const TABLES_ABOVE: [&str; 3] = ["/**", "ros__parameters", "robot_description_planning"];

/// Limits by the names of joints, as MoveIt's `joint_limits.yaml` tells them. They take the place of the URDF's.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JointLimitsFile {
    /// What is told of each joint.
    pub joints: BTreeMap<String, ToldLimits>,
}

/// What a joint limits file tells of one joint; `None` where it tells nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ToldLimits {
    /// Lowest position, radians or metres.
    pub lower: Option<f64>,
    /// Highest position, radians or metres.
    pub upper: Option<f64>,
    /// Greatest speed, per second.
    pub velocity: Option<f64>,
    /// Greatest acceleration, per second squared.
    pub acceleration: Option<f64>,
    /// Greatest jerk, per second cubed.
    pub jerk: Option<f64>,
}

impl JointLimitsFile {
    /// Reads a table `joint_limits` from a YAML file: `min_position`, `max_position`, `max_velocity`,
    /// `max_acceleration`, `max_jerk` for each joint, a number or a list of one. `has_velocity_limits: false` and its
    /// like mean that the file tells nothing. Other keys and other tables are passed over.
    ///
    /// # Errors
    /// [`Error::Geom`](crate::Error::Geom) where it cannot be read or is no regular file;
    /// [`Error::Urdf`](crate::Error::Urdf) with code and line where it is too large, is no YAML, nests too deeply, uses
    /// aliases, has no such table, or holds a limit that is not finite, not above zero, or crossed.
    pub fn read(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        Self::parse(&read_at_most(path, MAX_BYTES + 1)?, path)
    }

    /// Reads the bytes of such a file; `path` names it in messages.
    ///
    /// # Errors
    /// [`Error::Urdf`](crate::Error::Urdf), see [`JointLimitsFile::read`].
    pub fn parse(bytes: &[u8], path: impl AsRef<Path>) -> Result<Self> {
        parse(bytes).map_err(|fault| fault.in_file(path.as_ref()))
    }
}

fn parse(bytes: &[u8]) -> std::result::Result<JointLimitsFile, Fault> {
    if bytes.len() as u64 > MAX_BYTES {
        let expected = format!("at most {} MB", MAX_BYTES >> 20);
        return Err(Fault::new("size", "whole file", expected, "more"));
    }
    let text = std::str::from_utf8(bytes).map_err(|error| {
        let place = format!("byte {}", error.valid_up_to());
        Fault::new("encoding", place, "UTF-8", "bytes that are not UTF-8")
    })?;
    let root = Yaml::read(text)?;
    let mut at = &root;
    for table in TABLES_ABOVE {
        at = at.get(table).unwrap_or(at);
    }
    let Some(table) = at.get("joint_limits") else {
        return Err(Fault::new("joint-limits", "whole file", "a table `joint_limits`", "none"));
    };
    let mut joints = BTreeMap::new();
    for (name, told) in mapping(table, "joint_limits")? {
        joints.insert(name.clone(), told_limits(name, told)?);
    }
    Ok(JointLimitsFile { joints })
}

fn mapping<'a>(yaml: &'a Yaml, what: &str) -> std::result::Result<&'a [(String, Yaml)], Fault> {
    match &yaml.value {
        YamlValue::Mapping(entries) => Ok(entries),
        _ => {
            let place = format!("line {}: {what}", yaml.line);
            Err(Fault::new("joint-limits", place, "a table", yaml.describe()))
        }
    }
}

fn told_limits(joint: &str, told: &Yaml) -> std::result::Result<ToldLimits, Fault> {
    let what = format!("joint {}", quoted(joint));
    mapping(told, &what)?;
    // A limit counts unless its flag says no.
    let limit = |key: &str, flag: &str, above_zero: bool| {
        let is_off = told.get(flag).map(|flag| is_no(flag, &what)).transpose()?.unwrap_or(false);
        let Some(value) = told.get(key).filter(|_| !is_off) else { return Ok(None) };
        let place = format!("line {}: {what}: {key}", value.line);
        number(value, place, above_zero).map(Some)
    };
    let limits = ToldLimits {
        lower: limit("min_position", "has_position_limits", false)?,
        upper: limit("max_position", "has_position_limits", false)?,
        velocity: limit("max_velocity", "has_velocity_limits", true)?,
        acceleration: limit("max_acceleration", "has_acceleration_limits", true)?,
        jerk: limit("max_jerk", "has_jerk_limits", true)?,
    };
    if let (Some(lower), Some(upper)) = (limits.lower, limits.upper)
        && lower > upper
    {
        let place = format!("line {}: {what}", told.line);
        let expected = format!("a max_position of at least {lower}");
        return Err(Fault::new("limit", place, expected, upper));
    }
    Ok(limits)
}

fn is_no(flag: &Yaml, what: &str) -> std::result::Result<bool, Fault> {
    match &flag.value {
        YamlValue::Text(text) if text.eq_ignore_ascii_case("true") => Ok(false),
        YamlValue::Text(text) if text.eq_ignore_ascii_case("false") => Ok(true),
        _ => {
            let place = format!("line {}: {what}", flag.line);
            Err(Fault::new("joint-limits", place, "true or false", flag.describe()))
        }
    }
}

/// A number, or a list of one, as roboplan writes them.
fn number(value: &Yaml, place: String, above_zero: bool) -> std::result::Result<f64, Fault> {
    let text = match &value.value {
        YamlValue::Text(text) => Some(text),
        YamlValue::Sequence(values) => match values.as_slice() {
            [Yaml { value: YamlValue::Text(text), .. }] => Some(text),
            _ => None,
        },
        YamlValue::Mapping(_) => None,
    };
    match text.and_then(|text| text.trim().parse::<f64>().ok()) {
        None => Err(Fault::new("number", place, "a number", value.describe())),
        Some(number) if !number.is_finite() => {
            Err(Fault::new("non-finite", place, "a finite number", value.describe()))
        }
        Some(number) if above_zero && number <= 0.0 => {
            Err(Fault::new("limit", place, "a number above zero", number))
        }
        Some(number) => Ok(number),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<JointLimitsFile> {
        JointLimitsFile::parse(text.as_bytes(), "joint_limits.yaml")
    }

    #[test]
    fn moveit_and_roboplan_files_tell_limits() {
        let moveit = read(
            "default_velocity_scaling_factor: 0.1\njoint_limits:\n  a:\n    has_velocity_limits: true\n    \
             max_velocity: 2.175\n    has_acceleration_limits: false\n    max_acceleration: 3\n    max_jerk: 300.0\n  \
             b: {min_position: -1.5, max_position: 1e0}\n",
        )
        .unwrap();
        let [a, b] = ["a", "b"].map(|name| moveit.joints[name]);
        assert_eq!((a.velocity, a.acceleration, a.jerk), (Some(2.175), None, Some(300.0)));
        assert_eq!((b.lower, b.upper, b.velocity), (Some(-1.5), Some(1.0), None));
        let roboplan = read("joint_limits:\n  j:\n    max_acceleration: [2.0]\n").unwrap();
        assert_eq!(roboplan.joints["j"].acceleration, Some(2.0));
        let ros = "/**:\n  ros__parameters:\n    robot_description_planning:\n      joint_limits:\n        j:\n          max_velocity: 1\n";
        assert_eq!(read(ros).unwrap().joints["j"].velocity, Some(1.0));
    }

    #[test]
    fn what_is_no_limit_is_refused_with_its_line() {
        let error = |limit: &str| {
            read(&format!("joint_limits:\n  j:\n    {limit}\n")).unwrap_err().to_string()
        };
        assert!(error("max_velocity: -1").contains("line 3: joint `j`: max_velocity"));
        assert!(error("max_velocity: .nan").contains("a number"));
        assert!(error("max_velocity: inf").contains("finite"));
        assert!(error("max_acceleration: [1, 2]").contains("a list of 2"));
        assert!(error("has_velocity_limits: perhaps").contains("true or false"));
        assert!(error("{min_position: 2, max_position: 1}").contains("at least 2"));
        assert!(read("limits: 1").unwrap_err().to_string().contains("a table `joint_limits`"));
        assert!(read("joint_limits: [1]").unwrap_err().to_string().contains("a list of 1"));
        assert!(JointLimitsFile::parse(b"\xff", "x").is_err());
    }
}
