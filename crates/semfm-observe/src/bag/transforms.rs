//! Frames over time, as `/tf` and `/tf_static` tell them.

use std::collections::BTreeMap;

use semfm_geom::math::{DAffine3, DQuat};

use super::compressed_depth::Fault;
use super::messages::Transform;

/// Longest chain of frames that is followed; robots have some dozens.
const LONGEST_CHAIN: usize = 200;

/// How each frame stands in its parent, over time.
#[derive(Debug, Default)]
pub(super) struct Transforms {
    frames: BTreeMap<String, Frame>,
}

#[derive(Debug)]
struct Frame {
    parent: String,
    is_static: bool,
    /// By time, in nanoseconds.
    poses: BTreeMap<u64, DAffine3>,
}

impl Transforms {
    /// Takes a transform.
    pub fn add(&mut self, transform: Transform, is_static: bool) -> Result<(), Fault> {
        let Transform { time, parent, child, parent_from_child } = transform;
        let frame = self.frames.entry(child.clone()).or_insert_with(|| Frame {
            parent: parent.clone(),
            is_static,
            poses: BTreeMap::new(),
        });
        if frame.parent != parent {
            let expected = format!("`{}`, the parent of `{child}` before", frame.parent);
            return Err(Fault::new(expected, format!("`{parent}`")));
        }
        frame.poses.insert(time, parent_from_child);
        Ok(())
    }

    /// How `child` stands in `ancestor` or in a frame that both descend from, at a time, if the nearest transforms are no
    /// farther than `gap` from it.
    pub fn lookup(&self, fixed: &str, child: &str, time: u64, gap: u64) -> Result<DAffine3, Fault> {
        let fixed = fixed.trim_start_matches('/');
        let (of_child, of_fixed) = (self.chain(child, time, gap), self.chain(fixed, time, gap));
        // What is missing above the frame where both meet does not matter.
        let meeting = of_child.frames.iter().find_map(|(name, root_from_child)| {
            let other = of_fixed.frames.iter().find(|(other, _)| other == name)?;
            Some(other.1.inverse() * *root_from_child)
        });
        meeting.ok_or_else(|| {
            of_child.broken.or(of_fixed.broken).unwrap_or_else(|| {
                let names: Vec<&str> = of_child.frames.iter().map(|(n, _)| n.as_str()).collect();
                let expected = format!("transforms that lead from `{child}` to `{fixed}`");
                Fault::new(expected, format!("only {}", names.join(" → ")))
            })
        })
    }

    /// The frames above one, as far up as the transforms lead.
    fn chain(&self, child: &str, time: u64, gap: u64) -> Chain {
        let child = child.trim_start_matches('/');
        let mut frames = vec![(child.to_owned(), DAffine3::IDENTITY)];
        let mut broken = None;
        while let Some((name, motion)) = frames.last() {
            let Some(frame) = self.frames.get(name) else { break };
            if frames.len() > LONGEST_CHAIN {
                let found = format!("a circle at `{name}`");
                broken = Some(Fault::new("frames that form a tree", found));
                break;
            }
            let Some(pose) = frame.at(time, gap) else {
                let expected = format!("a transform of `{name}` within {:.3} s", gap as f64 / 1e9);
                let (first, last) = frame.span();
                let found = format!("time {time} ns, and transforms from {first} to {last} ns");
                broken = Some(Fault::new(expected, found));
                break;
            };
            let entry = (frame.parent.clone(), pose * *motion);
            frames.push(entry);
        }
        Chain { frames, broken }
    }
}

/// A frame and those above it.
struct Chain {
    /// Names, the frame itself first, and how it stands in each.
    frames: Vec<(String, DAffine3)>,
    /// Why it ends below the root, where it does.
    broken: Option<Fault>,
}

impl Frame {
    fn at(&self, time: u64, gap: u64) -> Option<DAffine3> {
        if self.is_static {
            return self.poses.values().next_back().copied();
        }
        let before = self.poses.range(..=time).next_back().filter(|(t, _)| time - **t <= gap);
        let after = self.poses.range(time..).next().filter(|(t, _)| **t - time <= gap);
        match (before, after) {
            (Some((t0, a)), Some((t1, b))) if t0 != t1 => {
                let s = (time - t0) as f64 / (t1 - t0) as f64;
                Some(between(a, b, s))
            }
            (Some((_, pose)), _) | (_, Some((_, pose))) => Some(*pose),
            (None, None) => None,
        }
    }

    fn span(&self) -> (u64, u64) {
        let first = self.poses.keys().next().copied().unwrap_or(0);
        (first, self.poses.keys().next_back().copied().unwrap_or(0))
    }
}

fn between(a: &DAffine3, b: &DAffine3, s: f64) -> DAffine3 {
    let turn = |m: &DAffine3| DQuat::from_mat3(&m.matrix3);
    let shift = a.translation.lerp(b.translation, s);
    DAffine3::from_rotation_translation(turn(a).slerp(turn(b), s), shift)
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_geom::math::DVec3;

    fn step(time: u64, parent: &str, child: &str, x: f64) -> Transform {
        let parent_from_child = DAffine3::from_translation(DVec3::new(x, 0.0, 0.0));
        Transform { time, parent: parent.into(), child: child.into(), parent_from_child }
    }

    #[test]
    fn chains_are_followed_between_the_times_that_are_there() {
        let mut all = Transforms::default();
        all.add(step(0, "tool", "camera", 0.5), true).unwrap();
        all.add(step(100, "base", "tool", 1.0), false).unwrap();
        all.add(step(200, "base", "tool", 3.0), false).unwrap();
        all.add(step(0, "base", "table", -4.0), true).unwrap();
        let x = |fixed: &str, time| all.lookup(fixed, "camera", time, 100).map(|m| m.translation.x);
        assert_eq!(x("base", 150).unwrap(), 2.5);
        assert_eq!(x("/base", 100).unwrap(), 1.5);
        assert_eq!(x("table", 200).unwrap(), 7.5, "up to the frame that both share, and down");
        assert_eq!(x("camera", 150).unwrap(), 0.0);
        assert_eq!(x("base", 250).unwrap(), 3.5);
        assert_eq!(x("tool", 900).unwrap(), 0.5, "what lies above the tool is not needed");
        assert!(x("base", 900).unwrap_err().found.contains("100 to 200"));
        assert!(x("map", 150).unwrap_err().found.contains("camera → tool → base"));
        assert!(all.add(step(0, "hand", "camera", 0.0), true).is_err());
        let mut circle = Transforms::default();
        circle.add(step(0, "a", "b", 0.0), true).unwrap();
        circle.add(step(0, "b", "a", 0.0), true).unwrap();
        assert!(circle.lookup("c", "a", 0, 1).unwrap_err().found.contains("circle"));
    }
}
