//! What each stage does: a call of the library on files, whose answers are files.

mod grasp;
mod plan;
mod pose;
mod region;
mod surface;
mod transfer;

use std::path::{Path, PathBuf};

use semfm::Task;
use semfm::files::{NoAnswerRecord, SURFACE_MESH};

use crate::recipe::Recipe;
use crate::{Result, Stage};

/// Where a stage finds what it needs.
#[derive(Clone, Copy, Debug)]
pub struct StageContext<'a> {
    /// The recipe, its paths from the current folder.
    pub recipe: &'a Recipe,
    /// The folder of the run.
    pub output: &'a Path,
    /// Worker threads for encoders of others; 0 takes one for each core.
    pub threads: usize,
    /// Whether encoders of others print nothing.
    pub quiet: bool,
    /// Whether shapes and embeddings may be kept between runs.
    pub cache: bool,
}

/// What came of a stage.
#[derive(Clone, Debug, Default)]
pub struct StageEnd {
    /// In words, a line each.
    pub summary: Vec<String>,
    /// Why there is no answer, where there is none.
    pub no_answer: Option<NoAnswerRecord>,
    /// Files that decide it and that it did not read by our readers.
    pub more_inputs: Vec<PathBuf>,
}

impl StageContext<'_> {
    /// Where a file of a finished stage is.
    pub fn file(&self, stage: Stage, name: &str) -> PathBuf {
        self.output.join(stage.name()).join(name)
    }

    /// The demonstrated object: the recipe's mesh, or the surface that was seen.
    pub fn source_mesh(&self) -> PathBuf {
        let seen = || self.file(Stage::DemonstrationSurface, SURFACE_MESH);
        self.recipe.demonstration.mesh.clone().unwrap_or_else(seen)
    }

    /// The target, likewise.
    pub fn target_mesh(&self) -> PathBuf {
        let seen = || self.file(Stage::TargetSurface, SURFACE_MESH);
        self.recipe.target.mesh.clone().unwrap_or_else(seen)
    }

    /// Does a stage and writes its files into `folder`, from where they go to the stage's own.
    pub fn work(&self, stage: Stage, folder: &Path, task: &Task) -> Result<StageEnd> {
        match stage {
            Stage::DemonstrationSurface => surface::demonstration(self, folder, task),
            Stage::DemonstrationPose => pose::demonstration(self, folder, task),
            Stage::Region => region::region(self, folder),
            Stage::TargetSurface => surface::target(self, folder, task),
            Stage::Transfer => transfer::transfer(self, folder, task),
            Stage::TargetPose => pose::target(self, folder, task),
            Stage::Grasp => grasp::grasp(self, folder, task),
            Stage::Plan => plan::plan(self, folder, task),
        }
    }
}

/// Why there is no answer.
fn no_answer(reason: impl Into<String>, next: impl Into<String>) -> Option<NoAnswerRecord> {
    Some(NoAnswerRecord { reason: reason.into(), next: next.into() })
}

pub use pose::{aligned_of_frame, observation_of_frame, observation_of_target};
pub use region::{CONTACT_FILE, HAND_FILE};
