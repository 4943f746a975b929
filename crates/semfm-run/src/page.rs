//! `index.html`: how a run went, from its files.

use std::path::Path;

use semfm::align::Sim3;
use semfm::files::{
    GraspsFile, NoAnswerRecord, PointMapFile, RunStageRecord, SURFACE_MESH, StageState,
    TransferredRegionFile, read_pose, read_region,
};
use semfm::geom::io::{read_file, read_json, read_mesh};
use semfm::observe::Observation;
use semfm::{Mesh, Region, Task};
use semfm_show::{
    Fact, Figure, Group, Photo, RgbPicture, Section, Table, TintedMask, contact_picture,
    groups_of_paths, write_page_with,
};
use serde_json::Value;

use crate::stages::{
    CONTACT_FILE, HAND_FILE, StageContext, aligned_of_frame, observation_of_frame,
    observation_of_target,
};
use crate::{Result, Stage};

/// The page's name, in the folder of the run.
pub const PAGE_FILE: &str = "index.html";

/// Colours of the masks of the object, the hand and anything else.
const OBJECT: [u8; 3] = [0, 114, 178];
const HAND: [u8; 3] = [230, 159, 0];

/// Writes the page of a run that came as far as these stages.
pub fn write_run_page(
    context: &StageContext<'_>,
    stages: &[RunStageRecord],
    no_answer: Option<&NoAnswerRecord>,
    path: &Path,
    task: &Task,
) -> Result<()> {
    let page = Page { context, stages, task };
    let mut sections = vec![page.outcome(no_answer)];
    sections.extend(page.demonstration()?);
    sections.extend(page.contact()?);
    sections.extend(page.transfer()?);
    sections.extend(page.target()?);
    sections.extend(page.motion()?);
    let title = context.recipe.title.as_deref().unwrap_or("From a demonstration to a grasp");
    Ok(write_page_with(path, title, &sections, &page.groups()?)?)
}

/// A run that is shown.
struct Page<'a> {
    context: &'a StageContext<'a>,
    stages: &'a [RunStageRecord],
    task: &'a Task,
}

impl Page<'_> {
    /// The record of a stage that the run came to.
    fn record(&self, stage: Stage) -> Option<&RunStageRecord> {
        self.stages.iter().find(|record| record.stage == stage.name())
    }

    /// Whether a stage wrote a file.
    fn has(&self, stage: Stage, name: &str) -> bool {
        self.record(stage).is_some_and(|record| record.files.iter().any(|file| file == name))
    }

    /// How it ended, and the time of each stage.
    fn outcome(&self, no_answer: Option<&NoAnswerRecord>) -> Section {
        let row = |record: &RunStageRecord| {
            let state = match record.state {
                StageState::Done => "done",
                StageState::Kept => "kept",
            };
            let seconds = format!("{:.2} s", record.seconds);
            vec![record.stage.clone(), state.into(), seconds, record.summary.join("\n")]
        };
        let total: f64 = self.stages.iter().map(|record| record.seconds).sum();
        let mut notes = Vec::new();
        let outcome = match no_answer {
            None => "with an answer".to_owned(),
            Some(NoAnswerRecord { reason, next }) => {
                notes = vec![format!("Why: {reason}"), format!("Next: {next}")];
                let last = self.stages.last().map_or("", |record| &record.stage);
                format!("without an answer, at the stage {last}")
            }
        };
        let head = ["stage", "", "time", "what came out"];
        Section {
            title: "How it went".into(),
            facts: vec![fact("ended", outcome), fact("time", format!("{total:.2} s"))],
            notes,
            table: Some(Table {
                head: head.map(String::from).into(),
                rows: self.stages.iter().map(row).collect(),
            }),
            ..Section::default()
        }
    }

    /// The pictures of the demonstration, with masks and with the region where the mesh was found.
    fn demonstration(&self) -> Result<Option<Section>> {
        let demonstration = &self.context.recipe.demonstration;
        let mut figures = Vec::new();
        for (i, frame) in demonstration.frames.iter().enumerate() {
            let Some(seen) = observation_of_frame(frame)? else { continue };
            let Some(photo) = Photo::of(&seen)? else { continue };
            let masks =
                [frame.mask.is_some(), frame.hand_mask.is_some(), frame.region_mask.is_some()];
            let colors =
                [OBJECT, HAND, semfm_show::colors::color_bytes(semfm_show::colors::MARKED)];
            let given = masks.into_iter().zip(colors).filter(|(given, _)| *given);
            let tints: Vec<TintedMask<'_>> = given
                .zip(seen.masks())
                .map(|((_, color), mask)| TintedMask { marked: &mask.marked, color })
                .collect();
            let caption = "what the camera saw: the object's mask in blue, the hand's in orange";
            figures.push(figure(caption, photo.with_masks(&tints)?));
            figures.extend(self.found_in(&photo, i)?);
        }
        let title = "The demonstration".into();
        Ok((!figures.is_empty()).then(|| Section { title, figures, ..Section::default() }))
    }

    /// The mesh where it was found in a picture of the demonstration, with the region.
    fn found_in(&self, photo: &Photo, frame: usize) -> Result<Option<Figure>> {
        let pose = match aligned_of_frame(self.context, frame) {
            // An object without a mesh stands in its camera's frame.
            None if self.has(Stage::DemonstrationSurface, SURFACE_MESH) => Sim3::IDENTITY,
            None => return Ok(None),
            Some(aligned) if aligned.is_made_here && !aligned.path.is_file() => return Ok(None),
            Some(aligned) => read_pose(&aligned.path)?,
        };
        let mesh = self.source()?;
        let weights = match self.record(Stage::Region) {
            Some(_) => self.region(Stage::Region, &mesh)?.weights().to_vec(),
            None => vec![0.0; mesh.n_vertices()],
        };
        let drawn = photo.with_region(&mesh, &weights, &pose, self.task)?;
        Ok(Some(figure("the mesh where it was found (outline), and the region on it (red)", drawn)))
    }

    fn source(&self) -> Result<Mesh> {
        Ok(read_mesh(self.context.source_mesh())?.mesh)
    }

    fn region(&self, stage: Stage, mesh: &Mesh) -> Result<Region> {
        Ok(read_region(&self.context.file(stage, "region.json"), mesh)?)
    }

    /// The region on the source, and which fingers touched it.
    fn contact(&self) -> Result<Option<Section>> {
        let Some(record) = self.record(Stage::Region) else { return Ok(None) };
        let mesh = self.source()?;
        let region = self.region(Stage::Region, &mesh)?;
        let hand = match self.has(Stage::Region, HAND_FILE) {
            true => Some(read_mesh(self.context.file(Stage::Region, HAND_FILE))?.mesh),
            false => None,
        };
        let picture = contact_picture(&mesh, region.weights(), hand.as_ref(), self.task)?;
        let caption = match hand {
            Some(_) => {
                "the region on the demonstrated mesh (red), and the hand where it rests (blue)"
            }
            None => "the region on the demonstrated mesh (red)",
        };
        let table = match self.has(Stage::Region, CONTACT_FILE) {
            true => fingers(&read_json(self.context.file(Stage::Region, CONTACT_FILE))?),
            false => None,
        };
        Ok(Some(Section {
            title: "What was touched".into(),
            notes: record.summary.clone(),
            figures: vec![figure(caption, picture)],
            table,
            ..Section::default()
        }))
    }

    /// Both objects with the region.
    fn transfer(&self) -> Result<Option<Section>> {
        let Some(record) = self.record(Stage::Transfer) else { return Ok(None) };
        let region =
            TransferredRegionFile::read(&self.context.file(Stage::Transfer, "region.json"))?;
        let picture = self.png(Stage::Transfer, "transfer.png")?;
        let caption = "the region on both objects, and which place of one is matched to which of the other (equal colours)";
        Ok(Some(Section {
            title: "What was carried over".into(),
            facts: vec![
                fact("verdict", region.verdict),
                fact("confidence", format!("{:.2}", region.confidence)),
                fact("method", region.method),
            ],
            notes: record.summary.iter().skip(1).cloned().collect(),
            figures: picture.map(|picture| figure(caption, picture)).into_iter().collect(),
            table: None,
        }))
    }

    /// The target's picture, with the region and the best grasp in it.
    fn target(&self) -> Result<Option<Section>> {
        let target = &self.context.recipe.target;
        let mut figures = Vec::new();
        let seen = match &target.frame {
            Some(frame) => observation_of_target(frame)?,
            None => None,
        };
        if let Some(seen) = &seen {
            figures.extend(self.grasp_in(seen)?);
        }
        if let Some(picture) = self.png(Stage::Grasp, "grasps.png")? {
            figures.push(figure("the best grasps on the mesh", picture));
        }
        let notes = [Stage::TargetSurface, Stage::TargetPose, Stage::Grasp];
        let notes = notes.iter().filter_map(|&stage| self.record(stage));
        let notes: Vec<String> = notes.flat_map(|record| record.summary.clone()).collect();
        let title = "The target".into();
        let is_empty = figures.is_empty() && notes.is_empty();
        Ok((!is_empty).then(|| Section { title, notes, figures, ..Section::default() }))
    }

    /// The grasp, or what came before it, in the target's picture.
    fn grasp_in(&self, seen: &Observation) -> Result<Vec<Figure>> {
        let Some(photo) = Photo::of(seen)? else { return Ok(Vec::new()) };
        let masks: Vec<TintedMask<'_>> = seen
            .masks()
            .iter()
            .map(|mask| TintedMask { marked: &mask.marked, color: OBJECT })
            .collect();
        let masked =
            figure("what the camera saw: the object's mask in blue", photo.with_masks(&masks)?);
        let recipe = self.context.recipe;
        let pose = match &recipe.target.aligned {
            Some(path) => Some(read_pose(path)?),
            None if self.has(Stage::TargetSurface, SURFACE_MESH) => Some(Sim3::IDENTITY),
            None if self.has(Stage::TargetPose, "aligned.json") => {
                Some(read_pose(&self.context.file(Stage::TargetPose, "aligned.json"))?)
            }
            None => None,
        };
        let Some(pose) = pose else { return Ok(vec![masked]) };
        let mesh = read_mesh(self.context.target_mesh())?.mesh;
        let weights = match self.record(Stage::Transfer) {
            Some(_) => self.transferred_weights(&mesh)?,
            None => vec![0.0; mesh.n_vertices()],
        };
        if self.has(Stage::Grasp, "grasps.json") {
            let grasps = GraspsFile::read(&self.context.file(Stage::Grasp, "grasps.json"), &mesh)?;
            if !grasps.grasps.is_empty() {
                let drawn = photo.with_grasp(&mesh, &weights, &grasps, 0, self.task)?;
                let caption = "the best grasp in the target's picture: the hand (blue), its contacts (yellow), the region (red)";
                return Ok(vec![masked, figure(caption, drawn)]);
            }
        }
        let drawn = photo.with_region(&mesh, &weights, &pose, self.task)?;
        let caption = "the mesh where it was found (outline), and the region on it (red)";
        Ok(vec![masked, figure(caption, drawn)])
    }

    /// Weights of the transferred region; zeros where it is empty, which no file of a region is.
    fn transferred_weights(&self, mesh: &Mesh) -> Result<Vec<f64>> {
        let map = PointMapFile::read(&self.context.file(Stage::Transfer, "point_map.json"))?;
        let weights = map.target_weight;
        Ok(if weights.len() == mesh.n_vertices() { weights } else { vec![0.0; mesh.n_vertices()] })
    }

    /// The motion, or the nearest miss.
    fn motion(&self) -> Result<Option<Section>> {
        let Some(record) = self.record(Stage::Plan) else { return Ok(None) };
        let mut figures = Vec::new();
        for (name, caption) in [("motion.png", "the motion"), ("miss.png", "the nearest miss")] {
            figures.extend(self.png(Stage::Plan, name)?.map(|picture| figure(caption, picture)));
        }
        let (title, notes) = ("The motion".into(), record.summary.clone());
        Ok(Some(Section { title, notes, figures, ..Section::default() }))
    }

    /// A picture that a stage wrote.
    fn png(&self, stage: Stage, name: &str) -> Result<Option<RgbPicture>> {
        if !self.has(stage, name) {
            return Ok(None);
        }
        Ok(RgbPicture::decode(&read_file(self.context.file(stage, name))?))
    }

    /// The same in three dimensions: contact, transfer, grasps, motion.
    fn groups(&self) -> Result<Vec<Group>> {
        let mut groups = Vec::new();
        let mut add = |title: &str, paths: &[std::path::PathBuf], first: usize| -> Result<()> {
            let found = groups_of_paths(paths, self.task)?;
            groups.extend(
                found.into_iter().skip(first).map(|group| Group { title: title.into(), ..group }),
            );
            Ok(())
        };
        if self.has(Stage::Region, "region.json") {
            let region = self.context.file(Stage::Region, "region.json");
            add("What was touched", &[self.context.source_mesh(), region], 0)?;
        }
        // A region without a vertex is none of a file that is shown.
        let region = self.context.file(Stage::Transfer, "region.json");
        if self.has(Stage::Transfer, "region.json")
            && !TransferredRegionFile::read(&region)?.region.vertices.is_empty()
        {
            let folder = self.context.output.join(Stage::Transfer.name());
            add("What was carried over", &[folder], 0)?;
        }
        if self.has(Stage::Grasp, "grasps.json") {
            let region = self.context.file(Stage::Transfer, "region.json");
            let grasps = self.context.file(Stage::Grasp, "grasps.json");
            // The mesh with its region alone is shown beside the source already.
            add("Grasps", &[self.context.target_mesh(), region, grasps], 1)?;
        }
        if self.has(Stage::Plan, "trajectory.json") {
            add("The motion", &[self.context.file(Stage::Plan, "trajectory.json")], 0)?;
        }
        Ok(groups)
    }
}

fn fact(name: &str, value: impl ToString) -> Fact {
    Fact { name: name.into(), value: value.to_string() }
}

fn figure(caption: &str, picture: RgbPicture) -> Figure {
    Figure { caption: caption.into(), picture }
}

/// Which fingers touched how much, from `contact.json`; nothing where fingers are not known.
fn fingers(contact: &Value) -> Option<Table> {
    let frames = contact["frames"].as_array()?;
    let mut rows = Vec::new();
    for (i, frame) in frames.iter().enumerate() {
        for part in frame["parts"].as_array().into_iter().flatten() {
            let number = |name: &str| part[name].as_f64().unwrap_or_default();
            rows.push(vec![
                (i + 1).to_string(),
                part["part"].as_str().unwrap_or_default().to_owned(),
                format!("{:.0} mm²", number("area_mm2")),
                format!("{:.0} %", 100.0 * number("probability")),
            ]);
        }
    }
    let head = ["picture", "part of the hand", "touched area", "probability that it touches"];
    (!rows.is_empty()).then(|| Table { head: head.map(String::from).into(), rows })
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn fingers_are_told_where_they_are_known() {
        let part =
            json!({ "part": "thumb", "area_mm2": 41.6, "probability": 0.934, "touches": true });
        let contact = json!({ "frames": [{ "parts": [] }, { "parts": [part] }] });
        let rows = fingers(&contact).unwrap().rows;
        assert_eq!(rows, [["2", "thumb", "42 mm²", "93 %"]]);
        assert!(fingers(&json!({ "frames": [{ "parts": [] }] })).is_none());
        assert!(fingers(&json!({})).is_none());
    }
}
