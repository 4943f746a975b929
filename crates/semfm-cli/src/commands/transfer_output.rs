//! What `transfer` and `demo` write and print of a finished transfer.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use anyhow::Result;
use semfm::demonstration::is_one_sided;
use semfm::files::{GraspsFile, Provenance, TransferResult, put_transfer, stages_ms};
use semfm::fmap::Stages;
use semfm::geom::io::StagedFolder;
use semfm::grasp::Grasps;
use semfm::{GraspPlan, GraspProblem, PlanObject, Prepared, Region, Task, Transfer, Verdict};
use semfm_show::{TransferFiles, write_plan, write_transfer};
use serde_json::{Value, json};

use super::Outcome;
use super::grasp::{
    draw_grasps, print_grasps, summary as grasps_summary, warn_of_dependent_grasps,
};
use super::motion_options::{PreparedMotion, print_plan, summary as plan_summary};
use crate::console;
use crate::options::Common;

/// A finished transfer and what it was made from.
pub struct TransferOutput<'a> {
    pub source: &'a Prepared,
    pub target: &'a Prepared,
    pub region: &'a Region,
    pub transfer: &'a Transfer,
    pub provenance: Provenance,
    /// Which files are written.
    pub files: TransferFiles,
    /// Grasps in the transferred region, where a gripper was given.
    pub grasps: Option<GraspProblem>,
    /// The arm that carries one of them out, with the target's mesh file, where a robot was given.
    pub motion: Option<ArmMotion>,
}

/// An arm for the grasps of a transfer.
pub struct ArmMotion {
    pub motion: PreparedMotion,
    /// The file of the target's mesh.
    pub target: PathBuf,
    /// Where the plan goes.
    pub folder: PathBuf,
}

/// The folder of the plan in that of the transfer, where no other is told.
pub const PLAN: &str = "plan";

impl TransferOutput<'_> {
    /// Writes every file, prints the answer, and says how the run ended. A refused region is not
    /// grasped.
    pub fn write(&self, folder: &Path, task: &Task, common: &Common) -> Result<Outcome> {
        let start = Instant::now();
        // Grasps included, the folder has all files or none.
        let staged = StagedFolder::new(folder)?;
        write_transfer(staged.path(), &self.result(), self.files, task)?;
        let write_ms = start.elapsed().as_secs_f64() * 1e3;
        let refused = self.transfer.verdict == Verdict::Refuse;
        let (mut grasps, mut plan) = (None, None);
        if let Some(problem) = self.grasps.as_ref().filter(|_| !refused) {
            let weights = self.transfer.weights();
            let found = problem.find(weights, task)?;
            let [file, picture] = GRASPS.map(|name| staged.path().join(name));
            let grasps_file = problem.file(weights, &found)?;
            grasps_file.write(&file)?;
            if let Some(arm) = self.motion.as_ref().filter(|_| !found.grasps.is_empty()) {
                plan = Some((arm, self.plan(arm, grasps_file, task)?));
            }
            warn_of_dependent_grasps(problem, weights, &found)?;
            if self.files == TransferFiles::All {
                draw_grasps(&picture, problem, weights, &found, task)?;
            }
            grasps = Some(found);
        }
        let mut files = put_transfer(staged)?;
        if let Some((arm, plan)) = &plan {
            files.extend(write_plan(&arm.folder, &arm.motion.arm, plan, task)?);
        }
        let plan = plan.map(|(_, plan)| plan);
        let mut stages = stages_ms(self.source, self.target, self.transfer);
        stages.push("write", write_ms);
        if common.json {
            let mut summary = self.summary(&stages, &files, grasps.as_ref());
            if let Some(plan) = &plan {
                summary["plan"] = plan_summary(plan, &[]);
            }
            console::data(summary);
        } else {
            self.print(&stages, common);
            if let Some(found) = &grasps {
                print_grasps(found, common);
                let mesh = self.source.object.shape().original();
                if found.grasps.is_empty() && is_one_sided(mesh, self.region)? {
                    console::message(
                        "the region is what one camera sees of its part; the pads need both sides: \
                         transfer --grow completes it first",
                    );
                }
            }
            if let Some(plan) = &plan {
                print_plan(plan, common);
            }
            console::data("wrote");
            files.iter().for_each(|file| console::data(format_args!("  {}", file.display())));
        }
        let without = grasps.is_some_and(|found| found.grasps.is_empty())
            || plan.is_some_and(|plan| plan.answer.motion.is_none());
        Ok(if refused || without { Outcome::NoAnswer } else { Outcome::Done })
    }

    /// The motion to one of the grasps.
    fn plan(&self, arm: &ArmMotion, grasps: GraspsFile, task: &Task) -> Result<GraspPlan> {
        let mesh = Arc::new(self.result().target_mesh().clone());
        let object = PlanObject { mesh, file: Some(arm.target.clone()) };
        arm.motion.plan(grasps, Some(object), task)
    }

    fn result(&self) -> TransferResult<'_> {
        let Self { source, target, region, transfer, .. } = *self;
        TransferResult { source, target, region, transfer, provenance: &self.provenance }
    }

    /// The answer in short, for `--json`.
    fn summary(&self, stages: &Stages, files: &[PathBuf], grasps: Option<&Grasps>) -> Value {
        let mut summary = json!({
            "verdict": self.transfer.verdict,
            "confidence": self.transfer.confidence,
            "method": self.transfer.report.settings.method,
            "n_vertices": self.transfer.region.vertices().len(),
            "files": files.iter().map(|file| file.display().to_string()).collect::<Vec<_>>(),
            "stages_ms": stages,
        });
        if let Some(found) = grasps {
            summary["grasps"] = grasps_summary(found);
        }
        summary
    }

    /// Why nothing was found, as far as the demonstrated region tells.
    fn why_empty(&self) -> String {
        let mesh = self.result().source_mesh();
        let areas = mesh.vertex_areas();
        let inside: f64 = self.region.vertices().iter().map(|&v| areas[v as usize]).sum();
        let share = inside / areas.iter().sum::<f64>();
        let (n, of) = (self.region.vertices().len(), self.region.n_vertices());
        let region = format!(
            "the demonstrated region is {n} of {of} vertices, {:.2} % of the surface",
            100.0 * share
        );
        if share < SMALL_REGION {
            format!(
                "{region}: too little to be found again; mark more of the part (`region --near … --radius …`)"
            )
        } else {
            format!("{region}, and no place of the target is enough like it")
        }
    }

    fn print(&self, stages: &Stages, common: &Common) {
        let Transfer { region, verdict, confidence, hypotheses, .. } = self.transfer;
        let (n, of) = (region.vertices().len(), region.n_vertices());
        console::data(format_args!("verdict     {verdict} (confidence {confidence:.2})"));
        console::data(format_args!("region      {n} of {of} vertices of the target"));
        if let Some(why) = self.transfer.why() {
            console::data(format_args!("why         {why}"));
        } else if region.is_empty() {
            console::data(format_args!("why         {}", self.why_empty()));
        }
        if let Some(share) = self.transfer.report.same_surface {
            let share = 100.0 * share;
            console::data(format_args!(
                "surface     the source's once more: {share:.0} % of the target lies on it"
            ));
        }
        if hypotheses.len() > 1 {
            let shares: Vec<String> =
                hypotheses.iter().map(|h| format!("{:.0} %", 100.0 * h.probability)).collect();
            console::data(format_args!("places      {}", shares.join(", ")));
        }
        console::data(format_args!("time        {:.0} ms", stages.total_ms()));
        if common.verbose {
            for (name, ms) in stages.iter() {
                console::data(format_args!("  {name:20} {ms:8.1} ms"));
            }
            for (name, prepared) in [("source", self.source), ("target", self.target)] {
                let cleaning = &prepared.object.shape().report().cleaning;
                console::data(format_args!("{name:11} {cleaning}"));
            }
        }
    }
}

/// Regions of less than this share of the surface vanish on their way: smoothing spreads a vote over some hundredths.
const SMALL_REGION: f64 = 0.005;

/// Grasps and their picture.
const GRASPS: [&str; 2] = ["grasps.json", "grasps.png"];
