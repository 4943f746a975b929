//! Gripper poses by place, to ask whether one is near another without asking all.

use std::collections::HashMap;

use parry3d_f64::math::Pose;
use semfm_geom::math::DVec3;

use crate::grasp_distance::GraspDistance;
use crate::settings::Separation;

/// A set of gripper poses under a grid of cells as wide as the separation.
pub(crate) struct PoseGrid {
    separation: Separation,
    // Cells are looked up, never listed, so that the map's order decides nothing.
    cells: HashMap<[i64; 3], Vec<Pose>>,
}

impl PoseGrid {
    pub(crate) fn new(separation: Separation) -> Self {
        Self { separation, cells: HashMap::new() }
    }

    pub(crate) fn insert(&mut self, pose: &Pose) {
        self.cells.entry(self.cell(pose.translation)).or_default().push(*pose);
    }

    /// Whether a pose of the set is nearer than the separation in both translation and rotation.
    pub(crate) fn has_near(&self, pose: &Pose) -> bool {
        let middle = self.cell(pose.translation);
        (0..27).any(|k| {
            let offset = [k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1];
            let cell = std::array::from_fn(|axis| middle[axis].saturating_add(offset[axis]));
            self.cells
                .get(&cell)
                .is_some_and(|poses| poses.iter().any(|other| self.is_near(other, pose)))
        })
    }

    fn is_near(&self, a: &Pose, b: &Pose) -> bool {
        let Separation { translation, rotation } = self.separation;
        a.translation.distance_squared(b.translation) < translation * translation
            && GraspDistance::is_turned_less(a, b, rotation)
    }

    fn cell(&self, place: DVec3) -> [i64; 3] {
        // Without a separation nothing is near, in whatever cell.
        let width = self.separation.translation.max(1e-6);
        place.to_array().map(|x| (x / width).floor() as i64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Poses without a pattern.
    fn pose(i: u32) -> Pose {
        let t = f64::from(i);
        let place = 0.03 * DVec3::new((7.3 * t).sin(), (3.1 * t).cos(), (1.7 * t).sin());
        Pose::new(place, DVec3::new(t.sin(), 0.5 * (2.0 * t).cos(), (5.0 * t).sin()))
    }

    #[test]
    fn the_grid_answers_as_a_full_search_does() {
        let separation = Separation { translation: 0.01, rotation: 0.3 };
        let mut grid = PoseGrid::new(separation);
        (0..300).for_each(|i| grid.insert(&pose(i)));
        let mut found = 0;
        for query in (1000..1400).map(pose) {
            let near = (0..300).any(|i| {
                let apart = GraspDistance::between(&pose(i), &query);
                apart.translation < separation.translation && apart.rotation < separation.rotation
            });
            assert_eq!(grid.has_near(&query), near);
            found += u32::from(near);
        }
        assert!((20..380).contains(&found), "{found}");
        let mut apart = PoseGrid::new(Separation { translation: 0.0, rotation: 0.0 });
        apart.insert(&pose(1));
        assert!(!apart.has_near(&pose(1)));
    }
}
