//! The joints that open and close a hand.

/// A joint's position by the width between the pads.
#[derive(Clone, Debug, PartialEq)]
pub struct DriveJoint {
    /// Name, as in the robot description.
    pub name: String,
    /// Widths (metres, ascending) and positions (metres or radians); never empty.
    entries: Vec<(f64, f64)>,
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

    /// The position at a width, by straight lines between the entries and as the nearest outside.
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
    fn positions_are_met_and_lie_between() {
        let joint = DriveJoint::new("finger", [(0.08, 0.0), (0.0, 0.8)]).unwrap();
        for (width, position) in [(-1.0, 0.8), (0.0, 0.8), (0.02, 0.6), (0.08, 0.0), (1.0, 0.0)] {
            assert!((joint.at(width) - position).abs() < 1e-12);
        }
        assert!(DriveJoint::new("finger", []).is_none());
    }
}
