//! From pictures to a grasp by one recipe: a demonstration (a mesh, and a hand that a camera saw on it) and a target (a mesh,
//! and a camera's picture of it) in, a region, grasps and, where a robot is named, its motion out.
//!
//! A [`Recipe`] (`demo.toml`) says what there is. [`Run`] turns it into stages, each of which does what one command does
//! and writes the same files, in a folder of its own:
//!
//! > demonstration-pose → region → transfer, target-pose → grasp → plan
//!
//! An object without a mesh is what the camera saw of it: demonstration-surface and target-surface stand in the place of its
//! pose.
//!
//! A stage that was done is kept while everything that it was made from (settings, files read, files written, version)
//! is as `stage.json` beside it says. A stage without an answer (a pose with the verdict `refuse`, no grasp) ends the
//! run. Either way one page, `index.html`, shows how it went.

mod error;
mod fingerprint;
mod key_places;
mod page;
mod recipe;
mod run;
mod stage;
mod stages;
mod template;

pub use error::{Error, Result};
pub use recipe::{
    AlignTable, Demonstration, DemonstrationFrame, GraspTable, PoseValue, Recipe, RobotTable,
    StartValue, TableValue, Target, TargetFrame, TransferTable,
};
pub use run::{PlannedStage, Run, RunProgress, RunSettings};
pub use stage::Stage;
pub use template::TEMPLATE;
