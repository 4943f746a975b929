//! Pictures of objects and answers: what is rendered, from where, and in which colours.
//!
//! An object looks the same in every picture of it: from where its true region shows best, and from
//! another side. The picture with its true region stands in the page once, as a style class, however
//! often it is shown.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use semfm::geom::Pinhole;
use semfm::views::{Paint, RenderSettings, render};
use semfm::{Mesh, Region, Task};
use semfm_show::{position_colors, viewpoints};
use serde::Deserialize;

use super::ReportSettings;
use super::html::{escape, img};
use super::{data_uri, palette};
use crate::dataset::Dataset;
use crate::results::Results;
use crate::row::Row;
use crate::{Error, Result};

/// The objects of the results, ready to be drawn.
pub(super) struct Album<'a> {
    folder: &'a Path,
    subjects: BTreeMap<(&'a str, &'a str), Subject>,
    /// Why there are fewer pictures than there could be.
    missing: Vec<String>,
    task: Task,
}

/// One object.
pub(super) struct Subject {
    pub name: String,
    mesh: Mesh,
    truth: Region,
    cameras: [Pinhole; 2],
    /// Number of its style class.
    place: usize,
    /// The picture with its true region.
    own: String,
}

/// From which side a picture is taken.
#[derive(Clone, Copy)]
pub(super) enum Side {
    /// Where the true region shows best.
    Best = 0,
    /// Farther round.
    Other = 1,
}

/// The answers on one pair, as the evaluation keeps them.
#[derive(Deserialize)]
struct Page {
    methods: BTreeMap<String, Answer>,
}

/// One method's answer on one pair.
#[derive(Clone, Deserialize)]
pub(super) struct Answer {
    vertices: Vec<u32>,
    weights: Vec<f64>,
    /// Source vertex for each target vertex; none without a map.
    #[serde(default)]
    point_map: Option<Vec<u32>>,
}

impl<'a> Album<'a> {
    /// No pictures, for this reason.
    pub fn closed(reason: &str) -> Self {
        let missing = vec![reason.to_owned()];
        Self { folder: Path::new(""), subjects: BTreeMap::new(), missing, task: Task::default() }
    }

    /// Loads and draws the objects that rows name. An object that cannot be loaded or drawn is left
    /// out, and the page says so.
    ///
    /// # Errors
    /// Only cancellation.
    pub fn open(
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
        let drawn: Vec<Result<Subject>> = names
            .par_iter()
            .enumerate()
            .map(|(place, (category, name))| {
                task.check()?;
                let found = dataset.find(category, name).ok_or_else(|| {
                    Error::invalid("object", "one of the dataset", format!("{category}/{name}"))
                })?;
                Subject::new(&dataset.objects[found], place, settings.picture_side, &quiet)
            })
            .collect();
        let (mut subjects, mut missing) = (BTreeMap::new(), Vec::new());
        for (name, subject) in names.into_iter().zip(drawn) {
            match subject {
                Ok(subject) => drop(subjects.insert(name, subject)),
                Err(error) if error.is_cancelled() => return Err(error),
                Err(error) => missing.push(format!("{} cannot be shown ({error})", name.1)),
            }
        }
        if !results.rows.iter().any(|row| row.prediction.is_some()) {
            missing.push("the predictions were not kept".into());
        }
        Ok(Self { folder, subjects, missing, task: quiet })
    }

    /// A style class for the picture of each object.
    pub fn shared_style(&self) -> String {
        self.subjects.values().fold(String::new(), |mut style, subject| {
            let _ = writeln!(style, ".o{}{{background-image:url({})}}", subject.place, subject.own);
            style
        })
    }

    /// What is not in the page, and why.
    pub fn missing(&self) -> String {
        if self.missing.is_empty() {
            return String::new();
        }
        let words = self.missing.iter().map(|reason| escape(reason)).collect::<Vec<_>>().join("; ");
        format!("<p class=\"note\">Pictures are missing: {words}.</p>\n")
    }

    /// Source and target of a row.
    pub fn pair(&self, row: &Row) -> Option<(&Subject, &Subject)> {
        let find = |name: &str| {
            let found = self.subjects.iter().find(|(key, _)| **key == (&*row.category, name));
            found.map(|(_, subject)| subject)
        };
        Some((find(&row.source)?, find(&row.target)?))
    }

    /// What each of the methods answered on the pair of `row`; empty where nobody kept it.
    pub fn answers(&self, row: &Row) -> BTreeMap<String, Answer> {
        let Some(path) = row.prediction.as_ref().and_then(|name| self.inside(name)) else {
            return BTreeMap::new();
        };
        let page = std::fs::read(path).ok().and_then(|bytes| serde_json::from_slice(&bytes).ok());
        page.map_or_else(BTreeMap::new, |page: Page| page.methods)
    }

    /// What the method of `row` answered.
    pub fn answer(&self, row: &Row) -> Option<Answer> {
        self.answers(row).remove(&row.method)
    }

    /// A file of the results' folder: names that lead out of it are none.
    fn inside(&self, name: &str) -> Option<PathBuf> {
        let plain =
            |part: std::path::Component<'_>| matches!(part, std::path::Component::Normal(_));
        Path::new(name).components().all(plain).then(|| self.folder.join(name))
    }

    /// The region that was found.
    pub fn region(&self, target: &Subject, answer: &Answer, alt: &str) -> Option<String> {
        let found = answer.region(&target.mesh)?;
        let colors = palette::by_weight(found.weights(), palette::EXTRA);
        target.draw(&colors, Side::Best, alt, &self.task)
    }

    /// What is right, too much and missed.
    pub fn error(
        &self,
        target: &Subject,
        answer: &Answer,
        side: Side,
        alt: &str,
    ) -> Option<String> {
        let found = answer.region(&target.mesh)?;
        let colors = palette::by_error(&found.mask(), &target.truth.mask());
        target.draw(&colors, side, alt, &self.task)
    }

    /// The source painted by position: what a map carries over.
    pub fn places(&self, source: &Subject, alt: &str) -> Option<String> {
        source.draw(&position_colors(source.mesh.vertices()), Side::Best, alt, &self.task)
    }

    /// The target in the colours of the places that its vertices are mapped to.
    pub fn carried(
        &self,
        (source, target): (&Subject, &Subject),
        answer: &Answer,
        alt: &str,
    ) -> Option<String> {
        let places = position_colors(source.mesh.vertices());
        let map = answer.point_map.as_ref().filter(|map| map.len() == target.mesh.n_vertices())?;
        let colors: Option<Vec<[f32; 3]>> =
            map.iter().map(|&vertex| places.get(vertex as usize).copied()).collect();
        target.draw(&colors?, Side::Best, alt, &self.task)
    }
}

impl Subject {
    fn new(
        entry: &crate::dataset::ObjectEntry,
        place: usize,
        side: u32,
        task: &Task,
    ) -> Result<Self> {
        let object = entry.load()?;
        let (mesh, truth) = (object.file.mesh, object.truth);
        let sides = viewpoints(&mesh, truth.weights(), side, task)?;
        let cameras = [sides.best, sides.other];
        let mut subject =
            Self { name: entry.name.clone(), mesh, truth, cameras, place, own: String::new() };
        let colors = palette::by_weight(subject.truth.weights(), palette::RIGHT);
        subject.own = subject.uri(&colors, Side::Best, task).ok_or_else(|| {
            Error::invalid(&entry.name, "a surface that can be drawn", "one that cannot")
        })?;
        Ok(subject)
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
            render(&self.mesh, &Paint::Vertices(colors), &[camera], &settings, task).ok()?;
        data_uri::jpeg(&views.first()?.rgb, camera.width(), camera.height())
    }
}

impl Answer {
    /// As a region of this mesh; none where it does not fit.
    fn region(&self, mesh: &Mesh) -> Option<Region> {
        let mut weights = vec![0.0; mesh.n_vertices()];
        for (&vertex, &weight) in self.vertices.iter().zip(&self.weights) {
            *weights.get_mut(vertex as usize)? = weight;
        }
        Region::from_weights(weights).ok()
    }

    /// Whether there is a map to show.
    pub fn has_map(&self) -> bool {
        self.point_map.is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_do_not_lead_out_of_the_folder_and_wrong_answers_are_none() {
        let album = Album { folder: Path::new("report"), ..Album::closed("nothing there") };
        assert_eq!(album.inside("predictions/a.json"), Some("report/predictions/a.json".into()));
        for name in ["../a", "/etc/passwd", "a/../../b"] {
            assert_eq!(album.inside(name), None, "{name}");
        }
        let triangle = Mesh::new(
            [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].map(Into::into).to_vec(),
            vec![[0, 1, 2]],
        );
        let answer =
            |vertex: u32| Answer { vertices: vec![vertex], weights: vec![0.8], point_map: None };
        let triangle = triangle.unwrap();
        assert_eq!(answer(2).region(&triangle).unwrap().vertices(), [2]);
        assert!(answer(3).region(&triangle).is_none());
    }
}
