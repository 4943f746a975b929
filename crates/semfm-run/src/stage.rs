//! The stages of a run, in their order, and what each is made by.

use serde_json::{Value, json};

use crate::recipe::{Demonstration, DemonstrationFrame, Recipe, Target};

/// A stage. Its name is that of its folder.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// What the camera saw of a demonstrated object without a mesh (`surface`).
    DemonstrationSurface,
    /// The demonstrated mesh found in the pictures (`align`).
    DemonstrationPose,
    /// Where it was touched (`region`).
    Region,
    /// What the camera saw of a target without a mesh (`surface`).
    TargetSurface,
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
    pub const ALL: [Self; 8] = [
        Self::DemonstrationSurface,
        Self::DemonstrationPose,
        Self::Region,
        Self::TargetSurface,
        Self::Transfer,
        Self::TargetPose,
        Self::Grasp,
        Self::Plan,
    ];

    /// Its name in files, folders and messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::DemonstrationSurface => "demonstration-surface",
            Self::DemonstrationPose => "demonstration-pose",
            Self::Region => "region",
            Self::TargetSurface => "target-surface",
            Self::Transfer => "transfer",
            Self::TargetPose => "target-pose",
            Self::Grasp => "grasp",
            Self::Plan => "plan",
        }
    }

    /// The stages whose files it reads, where they are part of the run.
    pub fn reads(self) -> &'static [Self] {
        match self {
            Self::DemonstrationSurface
            | Self::DemonstrationPose
            | Self::TargetSurface
            | Self::TargetPose => &[],
            Self::Region => &[Self::DemonstrationSurface, Self::DemonstrationPose],
            Self::Transfer => &[Self::DemonstrationSurface, Self::Region, Self::TargetSurface],
            Self::Grasp => &[Self::TargetSurface, Self::Transfer, Self::TargetPose],
            Self::Plan => &[Self::TargetSurface, Self::Grasp],
        }
    }

    /// The stages that a recipe asks for, in their order.
    pub fn of(recipe: &Recipe) -> Vec<Self> {
        let is_asked = |stage: &Self| match stage {
            Self::DemonstrationSurface => recipe.demonstration.mesh.is_none(),
            Self::DemonstrationPose => {
                let mut frames = recipe.demonstration.frames.iter();
                frames.any(|frame| recipe.demonstration.is_aligned_in(frame))
            }
            Self::TargetSurface => recipe.target.mesh.is_none(),
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
        let method = transfer.method.info();
        let of_method = json!([method.reads_features, method.features.rolls]);
        let encoder = json!([of_method, transfer.encoder, transfer.rolls]);
        match self {
            Self::DemonstrationSurface => {
                let frame = demonstration.frames.first().filter(|_| demonstration.mesh.is_none());
                let frame = frame.map(|frame| {
                    let DemonstrationFrame { color, depth, depth_scale, intrinsics, mask, .. } =
                        frame;
                    json!([color, depth, depth_scale, intrinsics, mask])
                });
                json!([frame, encoder])
            }
            Self::TargetSurface => {
                let frame = target.frame.as_ref().filter(|_| target.mesh.is_none());
                let frame = frame.map(|frame| {
                    let crate::TargetFrame { color, depth, depth_scale, intrinsics, mask, .. } =
                        frame;
                    json!([color, depth, depth_scale, intrinsics, mask])
                });
                json!([frame, encoder])
            }
            Self::DemonstrationPose => {
                let frames = demonstration.frames.iter();
                let frames = frames.filter(|frame| demonstration.is_aligned_in(frame));
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
                let Demonstration { mesh, region, near, radius, grow, .. } = demonstration;
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

impl Demonstration {
    /// Whether the mesh is looked for in the depth of a frame.
    pub(crate) fn is_aligned_in(&self, frame: &DemonstrationFrame) -> bool {
        self.mesh.is_some() && frame.is_aligned_here()
    }
}

impl Recipe {
    /// Whether the target is looked for in a depth image.
    pub fn aligns_target(&self) -> bool {
        let Target { mesh, aligned, frame, .. } = &self.target;
        let has_depth = frame.as_ref().is_some_and(|frame| frame.depth.is_some());
        mesh.is_some() && aligned.is_none() && has_depth
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
        let with_meshes = Stage::ALL.into_iter().filter(|stage| !stage.name().ends_with("surface"));
        assert_eq!(Stage::of(&recipe(all)), with_meshes.collect::<Vec<_>>());
        let frame = "depth = 'd'\nmask = 'm'\nintrinsics = 'K'\n";
        let observed =
            format!("[demonstration]\n[[demonstration.frames]]\n{frame}[target.frame]\n{frame}");
        let observed = Recipe::parse(Path::new("demo.toml"), &observed).unwrap();
        let stages = ["demonstration-surface", "region", "target-surface", "transfer"];
        assert_eq!(Stage::of(&observed).iter().map(|s| s.name()).collect::<Vec<_>>(), stages);
    }

    #[test]
    fn a_method_of_other_rotations_makes_what_is_seen_anew() {
        let of = |method: &str| {
            let text = format!(
                "[demonstration]\nmesh = 'mug.obj'\n[target]\n[target.frame]\ndepth = 'd'\n[transfer]\nmethod = '{method}'\n"
            );
            Recipe::parse(Path::new("demo.toml"), &text).unwrap()
        };
        let (a, b) = (of("semfm"), of("nearest"));
        let stages = Stage::of(&a).into_iter();
        let changed = stages.filter(|stage| stage.settings(&a) != stage.settings(&b));
        assert_eq!(changed.collect::<Vec<_>>(), [Stage::TargetSurface, Stage::Transfer]);
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
