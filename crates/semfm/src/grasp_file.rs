//! What a file of grasps says besides the grasps: the table, the settings, and what each owes to an uncertain pose.

use semfm_grasp::Grasps;

use crate::files::{GraspSettingsRecord, GraspsFile};
use crate::{GraspProblem, Result};

impl GraspProblem {
    /// The content of `grasps.json`: what was found in a region (one weight per vertex), with the table, the settings of
    /// the search, and for each grasp the share of the poses that fit as well under which it stays in the region.
    ///
    /// # Errors
    /// As [`GraspProblem::shares_of_poses`].
    pub fn file(&self, weights: &[f64], found: &Grasps) -> Result<GraspsFile> {
        let shares = self.shares_of_poses(weights, found)?.unwrap_or_default();
        let settings = self.settings();
        let settings = GraspSettingsRecord {
            seed: settings.seed,
            friction: settings.friction,
            grip_force: settings.grip_force,
            mass: settings.mass,
            n_samples: settings.n_samples,
            version: env!("CARGO_PKG_VERSION").into(),
        };
        let file = GraspsFile::new(&self.result(found)).with_table(self.table());
        Ok(GraspsFile { settings: Some(settings), ..file }.with_pose_shares(&shares))
    }
}
