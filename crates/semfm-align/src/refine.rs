//! The last, exact steps: all points, the triangles, a kernel as wide as the noise.

use semfm_geom::Task;

use crate::Result;
use crate::correspondence::{NearestBy, Problem, noise};
use crate::kernel::WIDTH_PER_NOISE;
use crate::sim3::{Sim3, Tangent};

/// Least width of the kernel, as a share of the observed diameter, on clouds without noise.
const LEAST_WIDTH: f64 = 1e-4;

/// Steps at most; four to six are usual.
const MAX_STEPS: usize = 12;

/// Points of the first steps, in which the kernel finds its width.
const FIRST_POINTS: usize = 250;

/// Those first steps.
const FIRST_STEPS: usize = 2;

/// Steps in which the kernel still follows the noise; later it would make the pose tremble.
const WIDTH_STEPS: usize = 6;

/// A step is the last one where it is this share of what the noise leaves uncertain.
const SHORT_STEP: f64 = 0.25;

/// A pose after its last steps.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RefinedPose {
    pub pose: Sim3,
    /// Width of the kernel, metres.
    pub width: f64,
    /// Steps taken.
    pub iterations: usize,
}

impl Problem<'_> {
    /// The width of the kernel that belongs to the noise around a pose, `widest` (metres) at most.
    pub fn kernel_width(&self, pose: &Sim3, ids: &[u32], widest: f64) -> f64 {
        let mut correspondences = Vec::with_capacity(ids.len());
        self.for_each_correspondence(pose, ids, widest, NearestBy::Triangles, |c| {
            correspondences.push(c);
        });
        let noise = noise(&correspondences, widest).unwrap_or(widest);
        (WIDTH_PER_NOISE * noise).clamp(LEAST_WIDTH * self.observed.diameter(), widest)
    }

    /// All points, exact matches, a kernel as wide as the noise (`widest` at first), no step along
    /// the directions (unit) that are held.
    ///
    /// # Errors
    /// [`semfm_geom::Error::Cancelled`].
    pub fn refine(
        &self,
        start: Sim3,
        ids: &[u32],
        widest: f64,
        held: &[Tangent],
        task: &Task,
    ) -> Result<RefinedPose> {
        let size = self.observed.diameter();
        let few = self.observed.subset(FIRST_POINTS);
        let (mut pose, mut width) = (start, widest);
        let mut correspondences = Vec::with_capacity(ids.len());
        for iterations in 1..=MAX_STEPS {
            task.check()?;
            correspondences.clear();
            let ids_now = if iterations <= FIRST_STEPS { &few } else { ids };
            self.for_each_correspondence(&pose, ids_now, width, NearestBy::Triangles, |c| {
                correspondences.push(c);
            });
            if iterations <= WIDTH_STEPS {
                let noise = noise(&correspondences, width).unwrap_or(width);
                width = (WIDTH_PER_NOISE * noise).clamp(LEAST_WIDTH * size, width);
            }
            let Some(step) = self.gauss_newton_step(&pose, &correspondences, width, held) else {
                return Ok(RefinedPose { pose, width, iterations });
            };
            pose = step.pose;
            let uncertain = width / (WIDTH_PER_NOISE * pose.scale * (ids.len() as f64).sqrt());
            if iterations > FIRST_STEPS && step.length < SHORT_STEP * uncertain {
                return Ok(RefinedPose { pose, width, iterations });
            }
        }
        Ok(RefinedPose { pose, width, iterations: MAX_STEPS })
    }
}
