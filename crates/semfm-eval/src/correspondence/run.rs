//! Every map made and measured.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use semfm::Task;
use semfm::fmap::fit::FitSettings;
use semfm::geom::ShapeCache;

use super::annotated_shape::AnnotatedShape;
use super::dataset::{CorrespondenceDataset, CorrespondenceSet};
use super::geodesic_error::GeodesicError;
use super::map_method::MapMethod;
use super::results::{MAP_FORMAT, MapResults, MapRow, MapSummary};
use crate::bootstrap::BootstrapSettings;
use crate::workers::Workers;
use crate::{Error, Result};

/// Commutation with the descriptors (Nogneng & Ovsjanikov 2017) decides. On the first six pairs of
/// FAUST_r, 250 samples: without it WKS errs by 44.7 and five landmarks by 10.4, with it by 24.1 and
/// 3.4. μ = .001 is the same and takes longer; μ = .001 with ten times the commutation gives 24.3 and
/// 4.4.
const FIT: FitSettings =
    FitSettings { laplacian: 0.01, descriptors: 1.0, orientation: 0.0, reversing: false };

/// How maps are made and measured.
#[derive(Clone, Debug)]
pub struct MapSettings {
    /// The methods.
    pub methods: Vec<MapMethod>,
    /// What a map made from descriptors must fulfil besides them.
    pub fit: FitSettings,
    /// Samples that the error is the mean of, at most, evenly out of all; 0 for all.
    pub n_samples: usize,
    /// Whether vertices are sent to points of triangles instead of vertices.
    pub precise: bool,
    /// How the machine is shared.
    pub workers: Workers,
    /// Where prepared shapes are kept.
    pub cache: ShapeCache,
    /// How intervals are made.
    pub bootstrap: BootstrapSettings,
}

impl Default for MapSettings {
    fn default() -> Self {
        Self {
            methods: MapMethod::ALL.to_vec(),
            fit: FIT,
            n_samples: 1000,
            precise: false,
            workers: Workers::new(0, 0),
            cache: ShapeCache::off(),
            bootstrap: BootstrapSettings::default(),
        }
    }
}

/// Makes and measures every map. Progress is counted in pairs. What goes wrong with one pair stands
/// in its rows.
///
/// # Errors
/// [`Error::Invalid`] without a method, cancellation.
pub fn run_maps(
    dataset: &CorrespondenceDataset,
    settings: &MapSettings,
    task: &Task,
) -> Result<MapResults> {
    if settings.methods.is_empty() {
        return Err(Error::invalid("methods", "at least one", "none"));
    }
    let run = MapRun { settings, task, total: dataset.n_pairs(), done: AtomicUsize::new(0) };
    let mut rows = Vec::new();
    for set in &dataset.sets {
        rows.extend(run.set(set)?);
    }
    let mut summaries = Vec::new();
    for set in &dataset.sets {
        for &method in &settings.methods {
            summaries.push(MapSummary::of(&set.name, method, &rows, &settings.bootstrap));
        }
    }
    Ok(MapResults {
        format: MAP_FORMAT.into(),
        path: dataset.path.clone(),
        dataset: dataset.hash.clone(),
        n_samples: settings.n_samples,
        precise: settings.precise,
        rows,
        summaries,
    })
}

/// A shape, or why it could not be prepared.
type Attempt = std::result::Result<AnnotatedShape, String>;

struct MapRun<'a> {
    settings: &'a MapSettings,
    task: &'a Task,
    total: usize,
    done: AtomicUsize,
}

impl MapRun<'_> {
    /// The rows of all pairs of a set.
    fn set(&self, set: &CorrespondenceSet) -> Result<Vec<MapRow>> {
        let names: Vec<&str> = set.shapes().into_iter().collect();
        let workers = &self.settings.workers;
        let shapes = workers.each(names.len(), |i| self.shape(set, names[i]))?;
        let shapes: BTreeMap<&str, Attempt> = names.iter().copied().zip(shapes).collect();
        let rows = workers.each(set.pairs.len(), |i| {
            let [source, target] = &set.pairs[i];
            let mut rows = self.pair(&shapes[source.as_str()], &shapes[target.as_str()])?;
            for row in &mut rows {
                row.set.clone_from(&set.name);
                row.source.clone_from(source);
                row.target.clone_from(target);
            }
            let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
            self.task.step("maps", done, self.total)?;
            Ok(rows)
        })?;
        Ok(rows.into_iter().flatten().collect())
    }

    fn shape(&self, set: &CorrespondenceSet, name: &str) -> Result<Attempt> {
        self.task.check()?;
        match AnnotatedShape::read(&set.file(name), &self.settings.cache, self.task) {
            Err(error) if error.is_cancelled() => Err(error),
            shape => Ok(shape.map_err(|error| error.to_string())),
        }
    }

    /// One row for each method, without the names of set and shapes.
    fn pair(&self, source: &Attempt, target: &Attempt) -> Result<Vec<MapRow>> {
        let (source, target) = match (source, target) {
            (Ok(source), Ok(target)) => (source, target),
            (Err(failure), _) | (_, Err(failure)) => return Ok(self.failed(failure)),
        };
        let measure = GeodesicError::new(source, target, self.settings.n_samples);
        let (fit, precise) = (&self.settings.fit, self.settings.precise);
        let mut rows = Vec::new();
        for method in &self.settings.methods {
            let mut row = MapRow { method: method.name().into(), ..MapRow::default() };
            let start = Instant::now();
            let scored = method.map(source, target, fit, precise, self.task).and_then(|map| {
                row.map_ms = Some(start.elapsed().as_secs_f64() * 1e3);
                let measure = measure
                    .as_ref()
                    .map_err(|reason| Error::invalid("pair", "one that can be measured", reason))?;
                measure.of(&map)
            });
            match scored {
                Err(error) if error.is_cancelled() => return Err(error),
                Err(error) => row.failure = Some(error.to_string()),
                Ok(errors) => {
                    (row.error, row.mirror_error) = (Some(errors.to_truth), errors.to_mirror);
                    row.flipped = errors.to_mirror.map(|mirror| mirror < errors.to_truth);
                }
            }
            rows.push(row);
        }
        Ok(rows)
    }

    /// Rows of a pair that cannot be tried.
    fn failed(&self, failure: &str) -> Vec<MapRow> {
        let methods = self.settings.methods.iter();
        methods
            .map(|method| MapRow {
                method: method.name().into(),
                failure: Some(failure.to_owned()),
                ..MapRow::default()
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::dataset::PAIRS;
    use super::*;
    use semfm::Mesh;
    use semfm::observe::testing::{npy, zip};
    use semfm_synth::{Category, ObjectSettings, make_object};
    use std::path::Path;

    /// A set of one shape under two names: the second has its vertices in reverse order, is turned
    /// and twice as large.
    fn write_set(folder: &Path) {
        std::fs::create_dir_all(folder).unwrap();
        let settings = ObjectSettings { n_vertices: 700, ..Default::default() };
        let mesh = make_object(Category::Scissors, 3, &settings).unwrap().mesh;
        write_shape(folder, &mesh, "a", false);
        write_shape(folder, &mesh, "b", true);
        std::fs::write(folder.join(PAIRS), "a b\nb a\n\n").unwrap();
    }

    fn write_shape(folder: &Path, mesh: &Mesh, name: &str, reversed: bool) {
        let n = mesh.n_vertices();
        let new = |v: u32| if reversed { n as u32 - 1 - v } else { v };
        let mut values = vec![0.0f32; 3 * n];
        for (v, p) in (0..).zip(mesh.vertices()) {
            let p = if reversed { [2.0 * p.y, -2.0 * p.x, 2.0 * p.z] } else { p.to_array() };
            (0..3).for_each(|c| values[3 * new(v) as usize + c] = p[c] as f32);
        }
        let faces: Vec<i32> = mesh.faces().iter().flatten().map(|&v| new(v) as i32).collect();
        let truth: Vec<i32> = (0..n as u32).map(|v| new(v) as i32).collect();
        let files = [
            ("V.npy", npy(&[n as u64, 3], &values)),
            ("F.npy", npy(&[mesh.n_faces() as u64, 3], &faces)),
            ("gt.npy", npy(&[n as u64], &truth)),
        ];
        std::fs::write(folder.join(format!("{name}.npz")), zip(&files, true)).unwrap();
    }

    fn settings() -> MapSettings {
        MapSettings { n_samples: 60, workers: Workers::new(1, 1), ..Default::default() }
    }

    #[test]
    fn a_shape_and_its_turned_twin_are_matched_and_threads_do_not_matter() {
        let folder = tempfile::tempdir().unwrap();
        write_set(&folder.path().join("twins"));
        let dataset = CorrespondenceDataset::open(folder.path()).unwrap();
        assert_eq!((dataset.sets.len(), dataset.n_pairs()), (1, 2));
        let results = run_maps(&dataset, &settings(), &Task::default()).unwrap();
        assert_eq!(results.rows.len(), 2 * MapMethod::ALL.len());
        for summary in &results.summaries {
            // An isometry: whatever knows the truth a little finds it, to about an edge length.
            let error = summary.error.unwrap();
            let bound = if summary.method.starts_with("wks") { 60.0 } else { 3.0 };
            assert!(error < bound, "{}: {error}", summary.method);
            assert_eq!((summary.n, summary.flip_rate), (2, None));
        }
        let many = MapSettings { workers: Workers::new(3, 2), ..settings() };
        let again = run_maps(&dataset, &many, &Task::default()).unwrap();
        assert_eq!(again.without_times(), results.without_times());
        let precise = MapSettings { precise: true, ..settings() };
        let precise = run_maps(&dataset, &precise, &Task::default()).unwrap();
        for summary in &precise.summaries {
            let error = summary.error.unwrap();
            let bound = if summary.method.starts_with("wks") { 60.0 } else { 3.0 };
            assert!(error < bound, "{} to points: {error}", summary.method);
        }
        assert!(precise.to_markdown().contains("points of triangles"));
        let text = results.to_markdown();
        assert!(text.contains("## twins") && text.contains("`true20+zoomout`"), "{text}");
    }

    #[test]
    fn shapes_in_parts_are_measured_and_their_page_is_made() {
        let folder = tempfile::tempdir().unwrap();
        let set = folder.path().join("parts");
        std::fs::create_dir_all(&set).unwrap();
        let settings_of = ObjectSettings { n_vertices: 300, ..Default::default() };
        let one = make_object(Category::Scissors, 3, &settings_of).unwrap().mesh;
        let n = one.n_vertices() as u32;
        // Twice beside itself, and a vertex that no triangle uses.
        let shift = semfm::geom::math::DVec3::X * 2.0 * one.diagonal();
        let moved = one.vertices().iter().map(|&p| p + shift);
        let vertices = one.vertices().iter().copied().chain(moved).chain([-shift]).collect();
        let other = one.faces().iter().map(|ids| ids.map(|v| v + n));
        let faces = one.faces().iter().copied().chain(other).collect();
        let mesh = Mesh::new(vertices, faces).unwrap();
        write_shape(&set, &mesh, "a", false);
        write_shape(&set, &mesh, "b", true);
        std::fs::write(set.join(PAIRS), "a b\nb a\n").unwrap();
        let dataset = CorrespondenceDataset::open(folder.path()).unwrap();
        let results = run_maps(&dataset, &settings(), &Task::default()).unwrap();
        for row in &results.rows {
            assert!(row.error.is_some_and(f64::is_finite), "{}: {:?}", row.method, row.failure);
        }
        let out = folder.path().join("out");
        assert_eq!(crate::report::write_maps(&results, &out).unwrap().len(), 3);
    }

    #[test]
    fn a_missing_array_is_a_failed_pair_and_a_missing_file_no_dataset() {
        let folder = tempfile::tempdir().unwrap();
        let set = folder.path().join("twins");
        write_set(&set);
        std::fs::write(set.join("b.npz"), zip(&[("V.npy", npy(&[1, 3], &[0f32; 3]))], false))
            .unwrap();
        let dataset = CorrespondenceDataset::open(folder.path()).unwrap();
        let results = run_maps(&dataset, &settings(), &Task::default()).unwrap();
        assert!(
            results
                .rows
                .iter()
                .all(|row| row.failure.as_ref().is_some_and(|f| f.contains("b.npz")))
        );
        std::fs::remove_file(set.join("a.npz")).unwrap();
        assert!(CorrespondenceDataset::open(folder.path()).is_err());
        std::fs::write(set.join(PAIRS), "a\n").unwrap();
        let error = CorrespondenceDataset::open(folder.path()).unwrap_err().to_string();
        assert!(error.contains("line 1"), "{error}");
    }
}
