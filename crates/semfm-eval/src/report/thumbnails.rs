//! Thumbnails of objects and answers: what is rendered, from where, and in which colours.
//!
//! An object looks the same in every picture of it: from where its true region shows best, and from
//! another side. The picture with its true region stands in the page once, as a style class, however
//! often it is shown.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::{Component, Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;
use semfm::geom::Pinhole;
use semfm::views::{RenderSettings, SurfaceColor, render};
use semfm::{Mesh, Region, Task};
use semfm_show::colors::{EXTRA, RIGHT, outcome_colors, position_colors, weight_colors_to};
use semfm_show::html::jpeg_data_uri;
use semfm_show::viewpoints;

use super::ReportSettings;
use super::html::{escape, img};
use crate::dataset::{Dataset, ObjectEntry};
use crate::prediction::{PairPredictions, Prediction};
use crate::results::Results;
use crate::row::Row;
use crate::{Error, Result};

/// The objects of the results, prepared for drawing.
pub(super) struct Thumbnails<'a> {
    folder: &'a Path,
    objects: BTreeMap<(&'a str, &'a str), DrawnObject>,
    /// Why there are fewer pictures than there could be.
    missing: Vec<String>,
    /// Files of predictions that rows name and that cannot be read, with the reason.
    unread: Mutex<BTreeMap<PathBuf, String>>,
    task: Task,
}

/// One object.
pub(super) struct DrawnObject {
    pub name: String,
    mesh: Mesh,
    truth: Region,
    cameras: [Pinhole; 2],
    /// Number of its style class.
    place: usize,
    /// The picture with its true region.
    own: String,
}

/// Source and target of a row.
pub(super) struct DrawnPair<'a> {
    pub source: &'a DrawnObject,
    pub target: &'a DrawnObject,
}

/// From which side a picture is taken.
#[derive(Clone, Copy)]
pub(super) enum Side {
    /// Where the true region shows best.
    Best = 0,
    /// Farther round.
    Other = 1,
}

impl<'a> Thumbnails<'a> {
    /// No pictures, for this reason.
    pub fn none(reason: &str) -> Self {
        let missing = vec![reason.to_owned()];
        Self {
            folder: Path::new(""),
            objects: BTreeMap::new(),
            missing,
            unread: Mutex::default(),
            task: Task::default(),
        }
    }

    /// Loads and draws the objects that rows name. An object that cannot be loaded or drawn is left
    /// out, and the page says so.
    ///
    /// # Errors
    /// Only cancellation.
    pub fn draw(
        dataset: &Dataset,
        results: &'a Results,
        folder: &'a Path,
        settings: &ReportSettings,
        task: &Task,
    ) -> Result<Self> {
        let names: BTreeSet<(&str, &str)> = results
            .rows
            .iter()
            .flat_map(|row| [(&*row.category, &*row.source), (&*row.category, &*row.target)])
            .collect();
        let names: Vec<_> = names.into_iter().collect();
        let quiet = Task::default();
        let drawn: Vec<Result<DrawnObject>> = names
            .par_iter()
            .enumerate()
            .map(|(place, (category, name))| {
                task.check()?;
                let found = dataset.find(category, name).ok_or_else(|| {
                    Error::invalid("object", "one of the dataset", format!("{category}/{name}"))
                })?;
                DrawnObject::new(&dataset.objects[found], place, settings.picture_side, &quiet)
            })
            .collect();
        let (mut objects, mut missing) = (BTreeMap::new(), Vec::new());
        for (name, object) in names.into_iter().zip(drawn) {
            match object {
                Ok(object) => drop(objects.insert(name, object)),
                Err(error) if error.is_cancelled() => return Err(error),
                Err(error) => missing.push(format!("{} cannot be shown ({error})", name.1)),
            }
        }
        if !results.rows.iter().any(|row| row.prediction.is_some()) {
            missing.push("the predictions were not kept".into());
        }
        Ok(Self { folder, objects, missing, unread: Mutex::default(), task: quiet })
    }

    /// A style class for the picture of each object.
    pub fn shared_style(&self) -> String {
        self.objects.values().fold(String::new(), |mut style, object| {
            let _ = writeln!(style, ".o{}{{background-image:url({})}}", object.place, object.own);
            style
        })
    }

    /// What is not in the page, and why. Files of predictions are known once sections were made.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = self.missing.clone();
        let unread = self.unread.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(reason) = unread.values().next() {
            let n = unread.len();
            let files = if n == 1 { "file" } else { "files" };
            notes.push(format!("{n} {files} of predictions cannot be read ({reason})"));
        }
        notes
    }

    /// The notes as a paragraph; empty without any.
    pub fn missing(&self) -> String {
        let notes = self.notes();
        if notes.is_empty() {
            return String::new();
        }
        let words = notes.iter().map(|reason| escape(reason)).collect::<Vec<_>>().join("; ");
        format!("<p class=\"note\">Pictures are missing: {words}.</p>\n")
    }

    /// Source and target of a row.
    pub fn pair(&self, row: &Row) -> Option<DrawnPair<'_>> {
        Some(DrawnPair {
            source: self.object(&row.category, &row.source)?,
            target: self.object(&row.category, &row.target)?,
        })
    }

    fn object(&self, category: &str, name: &str) -> Option<&DrawnObject> {
        let found = self.objects.iter().find(|(key, _)| **key == (category, name));
        found.map(|(_, object)| object)
    }

    /// What each of the methods answered on the pair of `row`; empty where nobody kept it.
    pub fn answers(&self, row: &Row) -> BTreeMap<String, Prediction> {
        let Some(path) = row.prediction.as_ref().and_then(|name| self.inside(name)) else {
            return BTreeMap::new();
        };
        match PairPredictions::read(&path) {
            Ok(predictions) => predictions.methods,
            Err(error) => {
                let mut unread = self.unread.lock().unwrap_or_else(PoisonError::into_inner);
                unread.insert(path, error.to_string());
                BTreeMap::new()
            }
        }
    }

    /// What the method of `row` answered.
    pub fn answer(&self, row: &Row) -> Option<Prediction> {
        self.answers(row).remove(&row.method)
    }

    /// A file of the results' folder: names that lead out of it are none.
    fn inside(&self, name: &str) -> Option<PathBuf> {
        let mut parts = Path::new(name).components();
        parts.all(|part| matches!(part, Component::Normal(_))).then(|| self.folder.join(name))
    }

    /// The region that was found.
    pub fn region(&self, target: &DrawnObject, answer: &Prediction, alt: &str) -> Option<String> {
        let found = answer.region(target.mesh.n_vertices())?;
        let colors = weight_colors_to(EXTRA, found.weights());
        target.draw(&colors, Side::Best, alt, &self.task)
    }

    /// What is right, too much and missed.
    pub fn error(
        &self,
        target: &DrawnObject,
        answer: &Prediction,
        side: Side,
        alt: &str,
    ) -> Option<String> {
        let found = answer.region(target.mesh.n_vertices())?;
        let colors = outcome_colors(&found.mask(), &target.truth.mask());
        target.draw(&colors, side, alt, &self.task)
    }

    /// The source coloured by position: what a map transfers.
    pub fn places(&self, source: &DrawnObject, alt: &str) -> Option<String> {
        source.draw(&position_colors(source.mesh.vertices()), Side::Best, alt, &self.task)
    }

    /// The target in the colours of the places that its vertices are mapped to.
    pub fn mapped(&self, pair: &DrawnPair<'_>, answer: &Prediction, alt: &str) -> Option<String> {
        let DrawnPair { source, target } = pair;
        let places = position_colors(source.mesh.vertices());
        let map = answer.point_map.as_ref().filter(|map| map.len() == target.mesh.n_vertices())?;
        let colors: Option<Vec<[f32; 3]>> =
            map.iter().map(|&vertex| places.get(vertex as usize).copied()).collect();
        target.draw(&colors?, Side::Best, alt, &self.task)
    }
}

impl DrawnObject {
    fn new(entry: &ObjectEntry, place: usize, side: u32, task: &Task) -> Result<Self> {
        let object = entry.load()?;
        let (mesh, truth) = (object.file.mesh, object.truth);
        let sides = viewpoints(&mesh, truth.weights(), side, task)?;
        let cameras = [sides.best, sides.other];
        let mut object =
            Self { name: entry.name.clone(), mesh, truth, cameras, place, own: String::new() };
        let colors = weight_colors_to(RIGHT, object.truth.weights());
        object.own = object.uri(&colors, Side::Best, task).ok_or_else(|| {
            Error::invalid(&entry.name, "a surface that can be drawn", "one that cannot")
        })?;
        Ok(object)
    }

    /// The object with its true region.
    pub fn own(&self, words: &str) -> String {
        let label = escape(&format!("{} {words}", self.name));
        format!("<span class=\"pic o{}\" role=\"img\" aria-label=\"{label}\"></span>", self.place)
    }

    fn draw(&self, colors: &[[f32; 3]], side: Side, alt: &str, task: &Task) -> Option<String> {
        Some(img(&self.uri(colors, side, task)?, alt))
    }

    fn uri(&self, colors: &[[f32; 3]], side: Side, task: &Task) -> Option<String> {
        let camera = self.cameras[side as usize];
        let settings = RenderSettings { supersampling: 3, ..RenderSettings::default() };
        let views =
            render(&self.mesh, &SurfaceColor::Vertices(colors), &[camera], &settings, task).ok()?;
        jpeg_data_uri(&views.first()?.rgb, camera.width(), camera.height())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_do_not_lead_out_of_the_folder_and_wrong_answers_are_none() {
        let thumbnails =
            Thumbnails { folder: Path::new("report"), ..Thumbnails::none("nothing there") };
        assert_eq!(
            thumbnails.inside("predictions/a.json"),
            Some("report/predictions/a.json".into())
        );
        for name in ["../a", "/etc/passwd", "a/../../b"] {
            assert_eq!(thumbnails.inside(name), None, "{name}");
        }
        let triangle = Mesh::new(
            [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].map(Into::into).to_vec(),
            vec![[0, 1, 2]],
        );
        let answer = |vertex: u32| Prediction {
            vertices: vec![vertex],
            weights: vec![0.8],
            ..Prediction::default()
        };
        let n = triangle.unwrap().n_vertices();
        assert_eq!(answer(2).region(n).unwrap().vertices(), [2]);
        assert!(answer(3).region(n).is_none());
    }
}
