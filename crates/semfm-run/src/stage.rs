//! The stages of a run, in their order, and what each is made by.

use serde_json::{Value, json};

use crate::recipe::{DemonstrationFrame, Recipe};

/// A stage. Its name is that of its folder.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// The demonstrated mesh found in the pictures (`align`).
    DemonstrationPose,
    /// Where it was touched (`region`).
    Region,
    /// The region on the target (`transfer`).
    Transfer,
    /// The target found in its picture (`align`).
    TargetPose,
    /// Grasps in the region (`grasp`).
    Grasp,
    /// The arm's motion to one of them (`plan`).
    Plan,
}

impl Stage {
    /// All, in the order in which they are done.
    pub const ALL: [Self; 6] = [
        Self::DemonstrationPose,
        Self::Region,
        Self::Transfer,
        Self::TargetPose,
        Self::Grasp,
        Self::Plan,
    ];

    /// Its name in files, folders and messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::DemonstrationPose => "demonstration-pose",
            Self::Region => "region",
            Self::Transfer => "transfer",
            Self::TargetPose => "target-pose",
            Self::Grasp => "grasp",
            Self::Plan => "plan",
        }
    }

    /// The stages whose files it reads, where they are part of the run.
    pub fn reads(self) -> &'static [Self] {
        match self {
            Self::DemonstrationPose | Self::TargetPose => &[],
            Self::Region => &[Self::DemonstrationPose],
            Self::Transfer => &[Self::Region],
            Self::Grasp => &[Self::Transfer, Self::TargetPose],
            Self::Plan => &[Self::Grasp],
        }
    }

    /// The stages that a recipe asks for, in their order.
    pub fn of(recipe: &Recipe) -> Vec<Self> {
        let is_asked = |stage: &Self| match stage {
            Self::DemonstrationPose => {
                let mut frames = recipe.demonstration.frames.iter();
                frames.any(DemonstrationFrame::is_aligned_here)
            }
            Self::Region | Self::Transfer => true,
            Self::TargetPose => recipe.aligns_target(),
            Self::Grasp => recipe.grasp.is_some(),
            Self::Plan => recipe.robot.is_some(),
        };
        Self::ALL.into_iter().filter(is_asked).collect()
    }

    /// What decides the stage besides the content of files: its part of the recipe as it is written. Pictures that only the
    /// page shows are no part of it.
    pub(crate) fn settings(self, recipe: &Recipe) -> Value {
        let Recipe { demonstration, target, transfer, grasp, robot, seed, .. } = recipe;
        match self {
            Self::DemonstrationPose => {
                let frames = demonstration.frames.iter().filter(|frame| frame.is_aligned_here());
                let frames: Vec<Value> = frames
                    .map(|frame| {
                        let DemonstrationFrame {
                            depth, depth_scale, intrinsics, mask, init, ..
                        } = frame;
                        json!([depth, depth_scale, intrinsics, mask, init])
                    })
                    .collect();
                let refused = demonstration.use_refused;
                json!([demonstration.mesh, demonstration.align, frames, seed, refused])
            }
            Self::Region => {
                // Colour counts where it tells the size of a mask.
                let frames = demonstration.frames.iter().map(|frame| {
                    let color = frame.color.clone().filter(|_| frame.depth.is_none());
                    DemonstrationFrame { color, mask: None, init: None, ..frame.clone() }
                });
                let frames: Vec<DemonstrationFrame> = frames.collect();
                let crate::Demonstration { mesh, region, near, radius, grow, .. } = demonstration;
                json!([mesh, region, near, radius, grow, frames])
            }
            Self::Transfer => json!([demonstration.mesh, target.mesh, transfer, seed]),
            Self::TargetPose => {
                let frame = target.frame.as_ref().map(|frame| {
                    let crate::TargetFrame { depth, depth_scale, intrinsics, mask, init, .. } =
                        frame;
                    json!([depth, depth_scale, intrinsics, mask, init])
                });
                json!([target.mesh, target.align, frame, seed, target.use_refused])
            }
            Self::Grasp => {
                json!([target.mesh, target.scale, target.aligned, target.use_refused, grasp, seed])
            }
            Self::Plan => json!([target.mesh, robot, seed]),
        }
    }
}

impl Recipe {
    /// Whether the target is looked for in a depth image.
    pub fn aligns_target(&self) -> bool {
        let has_depth = self.target.frame.as_ref().is_some_and(|frame| frame.depth.is_some());
        self.target.aligned.is_none() && has_depth
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn recipe(more: &str) -> Recipe {
        let text =
            format!("[demonstration]\nmesh = 'mug.obj'\n[target]\nmesh = 'kettle.obj'\n{more}");
        Recipe::parse(Path::new("demo.toml"), &text).unwrap()
    }

    #[test]
    fn a_recipe_has_the_stages_that_it_asks_for() {
        assert_eq!(Stage::of(&recipe("")), [Stage::Region, Stage::Transfer]);
        let all = "[target.frame]\ndepth = 'd'\n[[demonstration.frames]]\ndepth = 'd'\nhand = 'h'\n[grasp]\ngripper = 'g'\n\
                   [robot]\nurdf = 'u'\n";
        assert_eq!(Stage::of(&recipe(all)), Stage::ALL);
    }

    #[test]
    fn a_change_reaches_the_stages_that_it_decides() {
        let changed = |more: &str| -> Vec<Stage> {
            let (a, b) =
                (recipe("[grasp]\ngripper = 'g'\n[target.frame]\ndepth = 'd'\n"), recipe(more));
            Stage::ALL
                .into_iter()
                .filter(|stage| stage.settings(&a) != stage.settings(&b))
                .collect()
        };
        let frame = "[target.frame]\ndepth = 'd'\n";
        assert_eq!(changed(&format!("[grasp]\ngripper = 'g'\n{frame}color = 'c'\n")), []);
        assert_eq!(changed(&format!("[grasp]\ngripper = 'g'\ntop = 3\n{frame}")), [Stage::Grasp]);
        let other = format!("[grasp]\ngripper = 'g'\n{frame}[transfer]\nmethod = 'nearest'\n");
        assert_eq!(changed(&other), [Stage::Transfer]);
    }
}
