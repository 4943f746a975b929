//! The joints that open and close a gripper.

/// A joint's position by the width between the pads.
#[derive(Clone, Debug, PartialEq)]
pub struct DriveJoint {
    /// Name, as in the robot description.
    pub name: String,
    /// Widths (metres, ascending) and positions (metres or radians); never empty.
    entries: Vec<(f64, f64)>,
}

/// A joint's position at one width between the pads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointPosition<'a> {
    /// Name of the joint.
    pub name: &'a str,
    /// Metres or radians.
    pub position: f64,
}

impl DriveJoint {
    /// From widths and positions, in any order; `None` without any.
    pub fn new(
        name: impl Into<String>,
        entries: impl IntoIterator<Item = (f64, f64)>,
    ) -> Option<Self> {
        let mut entries: Vec<(f64, f64)> = entries.into_iter().collect();
        entries.sort_by(|a, b| a.0.total_cmp(&b.0));
        (!entries.is_empty()).then(|| Self { name: name.into(), entries })
    }

    /// The position at a width, linear between the entries and that of the nearest outside.
    pub fn at(&self, width: f64) -> f64 {
        let above = self.entries.partition_point(|entry| entry.0 <= width);
        if above == 0 {
            return self.entries[0].1;
        }
        let (from, start) = self.entries[above - 1];
        let Some(&(to, end)) = self.entries.get(above) else { return start };
        start + (end - start) * (width - from) / (to - from)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_are_met_at_the_entries_and_interpolated_between() {
        let joint = DriveJoint::new("finger", [(0.08, 0.0), (0.0, 0.8)]).unwrap();
        for (width, position) in [(-1.0, 0.8), (0.0, 0.8), (0.02, 0.6), (0.08, 0.0), (1.0, 0.0)] {
            assert!((joint.at(width) - position).abs() < 1e-12);
        }
        assert!(DriveJoint::new("finger", []).is_none());
    }
}
