//! How much of what was seen speaks against a pose.
//!
//! The normal equations of the last steps know how the distances change near one pose, if each point
//! errs for itself. They cannot tell whether a heading is shown at all: the facets of a round wall,
//! the dents of a reconstruction and a few stray points resist a turn as well as a handle does. So
//! poses far from each other are compared by what they leave unexplained, in shares of what was
//! seen: a handle that is there and was not expected, or was expected and is not there, counts by its
//! area, and a dent within the noise hardly at all.

use semfm_geom::math::{DMat3, DVec3};

use crate::correspondence::Problem;
use crate::observed_cloud::Coverage;
use crate::sim3::Sim3;

/// Distance that counts half, as a share of the observed diameter: 1 mm on a mug. Reconstructions are
/// off by about as much, and half of it accepted headings that only dents told.
const LEAST_WIDTH: f64 = 0.01;

/// Widths beyond which a point lies off the surface altogether.
const REACH: f64 = 4.0;

impl Problem<'_> {
    /// Distance (metres) that counts half as unexplained: the `width` of the final kernel, four standard
    /// deviations of the noise. With 2.5 of them the dents of a reconstruction told headings.
    pub fn evidence_width(&self, width: f64) -> f64 {
        width.max(LEAST_WIDTH * self.observed.diameter())
    }

    /// What a pose leaves unexplained: [`Self::off_model`] and [`Self::conflict`], from 0 to about 2.
    pub fn unexplained(&self, pose: &Sim3, ids: &[u32], width: f64) -> f64 {
        self.off_model(pose, ids, width) + self.conflict(pose, width)
    }

    /// The share of the observed points that lie off the surface of a pose, graded by
    /// d²/(d² + width²).
    ///
    /// Only triangles that face the viewpoint count: what a camera saw is no far side. The normals of
    /// the points would be of no use on a handle, which is thinner than the surroundings they are
    /// computed from.
    pub fn off_model(&self, pose: &Sim3, ids: &[u32], width: f64) -> f64 {
        let back = DMat3::from_quat(pose.rotation).transpose();
        let eye = match &self.observed.coverage {
            Coverage::SingleView(silhouette) if !self.model.both_sides => {
                Some(pose.inverse().apply(silhouette.viewpoint()))
            }
            _ => None,
        };
        let within = width / pose.scale;
        let on_model = |&id: &u32| {
            let query = back * (self.observed.points[id as usize] - pose.translation) / pose.scale;
            let counts = |face: u32| {
                eye.is_none_or(|eye| self.model.normals[face as usize].dot(eye - query) > 0.0)
            };
            let hit = self.model.surface.closest_among(query, REACH * within, counts);
            hit.map_or(0.0, |hit| within * within / (within * within + hit.distance.powi(2)))
        };
        1.0 - ids.iter().map(on_model).sum::<f64>() / ids.len().max(1) as f64
    }

    /// The visible surface of a pose that should have been seen and was not, as a share of what was,
    /// graded likewise.
    fn conflict(&self, pose: &Sim3, width: f64) -> f64 {
        match &self.observed.coverage {
            Coverage::SingleView(silhouette) => silhouette.conflict(self.model, pose, width),
            Coverage::AllAround { index, spacing } => {
                let out = |point: DVec3| (index.nearest(pose.apply(point)).1 - spacing).max(0.0);
                let share = |d: f64| d * d / (d * d + width * width);
                let samples = &self.model.samples;
                samples.iter().map(|s| share(out(s.point))).sum::<f64>() / samples.len() as f64
            }
        }
    }
}
