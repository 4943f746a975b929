//! Grippers whose dimensions their makers publish, as boxes.
//!
//! A new one is a file with a [`BuiltinGripper`], and one line in [`BUILTIN_GRIPPERS`]. Couplings,
//! cameras and cables are not included.

mod franka;
mod parallelogram;
mod robotiq;

use parry3d_f64::math::Pose;
use parry3d_f64::shape::SharedShape;
use semfm_geom::math::DVec3;
use semfm_geom::suggestion::closest_name;

use super::Gripper;
use crate::{Error, Result};

/// A gripper that needs no file.
#[derive(Debug)]
#[non_exhaustive]
pub struct BuiltinGripper {
    /// The name that [`Gripper::builtin`] knows it by.
    pub name: &'static str,
    /// What it is, in a few words.
    pub summary: &'static str,
    /// Where its dimensions come from.
    pub source: &'static str,
    /// Other words that people call it by: for the message about a name that is not known.
    pub(crate) also_called: &'static [&'static str],
    /// Words that tell it in the names of a robot description, in lower case without `_` and `-`.
    pub(crate) known_by: &'static [&'static str],
    pub(crate) make: fn(&Self) -> Result<Gripper>,
}

/// The built-in grippers.
///
/// Franka's stands first: its arms carry other makers' grippers, and then its own names are in the
/// description as well.
pub const BUILTIN_GRIPPERS: &[BuiltinGripper] =
    &[franka::FRANKA_HAND, robotiq::ROBOTIQ_2F85, robotiq::ROBOTIQ_2F140];

impl BuiltinGripper {
    /// All names, as help texts and messages list them.
    pub fn names() -> String {
        let names: Vec<&str> = BUILTIN_GRIPPERS.iter().map(|gripper| gripper.name).collect();
        names.join(", ")
    }

    /// The last in the table that one of the names in a description tells.
    pub(crate) fn named_in<'a>(names: impl Iterator<Item = &'a str>) -> Option<&'static Self> {
        let plain: String = names
            .flat_map(|name| name.chars().chain([' ']))
            .filter(|c| !matches!(c, '_' | '-'))
            .map(|c| c.to_ascii_lowercase())
            .collect();
        BUILTIN_GRIPPERS
            .iter()
            .rev()
            .find(|gripper| gripper.known_by.iter().any(|word| plain.contains(word)))
    }

    /// The one that was probably meant by a name that is none.
    fn closest(name: &str) -> Option<&'static Self> {
        let names = BUILTIN_GRIPPERS
            .iter()
            .flat_map(|g| [g.name].into_iter().chain(g.also_called.iter().copied()));
        let found = closest_name(name, names)?;
        BUILTIN_GRIPPERS.iter().find(|g| g.name == found || g.also_called.contains(&found))
    }

    /// The gripper itself.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] where the table's dimensions make no gripper: none does.
    pub fn gripper(&self) -> Result<Gripper> {
        (self.make)(self)
    }
}

impl Gripper {
    /// A built-in gripper by its name, see [`BUILTIN_GRIPPERS`].
    ///
    /// # Errors
    /// [`Error::UnknownGripper`] with the names there are.
    pub fn builtin(name: &str) -> Result<Self> {
        match BUILTIN_GRIPPERS.iter().find(|gripper| gripper.name == name) {
            Some(gripper) => gripper.gripper(),
            None => {
                let known = BuiltinGripper::names();
                let meant = BuiltinGripper::closest(name);
                let meant =
                    meant.map_or_else(String::new, |m| format!("; did you mean `{}`?", m.name));
                Err(Error::UnknownGripper { name: name.into(), known, meant })
            }
        }
    }
}

/// A convex shape at its place.
struct PlacedShape {
    shape: SharedShape,
    /// Of the shape's own frame, in the TCP frame or in the one that the caller means.
    pose: Pose,
}

/// A box between two corners.
fn box_between(low: [f64; 3], high: [f64; 3]) -> PlacedShape {
    let (low, high) = (DVec3::from_array(low), DVec3::from_array(high));
    let half = (high - low) / 2.0;
    let pose = Pose::from_translation((low + high) / 2.0);
    PlacedShape { shape: SharedShape::cuboid(half.x, half.y, half.z), pose }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_makes_the_gripper_of_its_name() {
        for row in BUILTIN_GRIPPERS {
            assert_eq!(Gripper::builtin(row.name).unwrap().name, row.name);
            assert!(!row.summary.is_empty() && !row.source.is_empty());
        }
    }

    #[test]
    fn an_unknown_name_is_told_the_known_ones() {
        for name in ["panda", "Panda-Hand", "frnka", "fr3", "emika"] {
            let error = Gripper::builtin(name).unwrap_err().to_string();
            assert!(error.contains("did you mean `franka`"), "{error}");
        }
        let error = Gripper::builtin("2f-140").unwrap_err().to_string();
        assert!(error.contains("did you mean `robotiq-2f140`"), "{error}");
        let error = Gripper::builtin("barrett").unwrap_err().to_string();
        assert!(!error.contains("did you mean"), "{error}");
        assert!(BUILTIN_GRIPPERS.iter().all(|row| error.contains(row.name)), "{error}");
    }

    #[test]
    fn a_description_tells_its_gripper_by_its_names() {
        for (names, told) in [
            (["panda_link8", "panda_hand"], Some("franka")),
            (["panda_hand", "robotiq_2f_140_base"], Some("robotiq-2f140")),
            (["base", "gripper_2F-85"], Some("robotiq-2f85")),
            (["palm", "finger"], None),
        ] {
            let found = BuiltinGripper::named_in(names.into_iter());
            assert_eq!(found.map(|gripper| gripper.name), told);
        }
    }
}
