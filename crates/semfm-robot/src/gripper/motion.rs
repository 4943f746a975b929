//! A pose that depends on the width between the pads.

use parry3d_f64::math::Pose;

/// Poses at ascending widths; in between, translations are interpolated linearly and rotations along
/// the shortest arc.
///
/// Fingers that slide need two entries and are exact. For a crank of length L = 0.1 m sampled at 65
/// angles over 0.8 rad, δ apart, the chord leaves the circle by at most L δ²/8 = 2 µm.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// Never empty; widths ascend.
    entries: Vec<(f64, Pose)>,
}

impl Motion {
    /// From widths and poses, in any order. Equal widths keep their first pose; no entry at all
    /// means the identity.
    pub fn new(entries: impl IntoIterator<Item = (f64, Pose)>) -> Self {
        let mut entries: Vec<(f64, Pose)> = entries.into_iter().collect();
        entries.sort_by(|a, b| a.0.total_cmp(&b.0));
        entries.dedup_by(|next, kept| next.0 == kept.0);
        if entries.is_empty() {
            entries.push((0.0, Pose::IDENTITY));
        }
        Self { entries }
    }

    /// The pose at a width; outside the entries, that of the nearest.
    pub fn at(&self, width: f64) -> Pose {
        let above = self.entries.partition_point(|entry| entry.0 <= width);
        if above == 0 {
            return self.entries[0].1;
        }
        let (from, start) = self.entries[above - 1];
        let Some(&(to, end)) = self.entries.get(above) else { return start };
        let share = (width - from) / (to - from);
        Pose::from_parts(
            start.translation.lerp(end.translation, share),
            start.rotation.slerp(end.rotation, share),
        )
    }
}

impl From<Pose> for Motion {
    fn from(pose: Pose) -> Self {
        Self::new([(0.0, pose)])
    }
}

#[cfg(test)]
mod tests {
    use semfm_geom::math::{DQuat, DVec3};

    use super::*;

    #[test]
    fn poses_are_met_at_their_widths_and_blend_between() {
        let a = Pose::from_translation(DVec3::X);
        let b = Pose::from_parts(DVec3::Y, DQuat::from_rotation_z(1.0));
        let motion = Motion::new([(2.0, b), (1.0, a)]);
        assert_eq!(motion.at(1.0), a);
        assert_eq!(motion.at(0.0), a);
        assert_eq!(motion.at(5.0), b);
        let middle = motion.at(1.5);
        assert!((middle.translation - DVec3::new(0.5, 0.5, 0.0)).length() < 1e-15);
        assert!(middle.rotation.angle_between(DQuat::from_rotation_z(0.5)) < 1e-7);
        assert_eq!(Motion::new([]).at(3.0), Pose::IDENTITY);
        assert_eq!(Motion::from(a).at(7.0), a);
    }
}
