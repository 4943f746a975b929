//! Point maps against true correspondences: the functional-map half beside other libraries.
//!
//! A dataset is a folder of sets; a set is a folder of `NAME.npz` (`V` vertices, `F` triangles, `gt`
//! the vertex at each sample of a template, perhaps `gt_sym` the one at its mirror image) and
//! `pairs.txt`, one "source target" a line. The map goes target → source; its error is the mean
//! geodesic distance, on the source, between where the target's vertex at a sample is sent and the
//! source's vertex at that sample, × 100 / √area.

mod maps;
mod measure;
mod npz;
mod shape;
pub mod table;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use semfm::Task;
use semfm::fmap::fit::FitSettings;
use semfm::geom::ShapeCache;
use semfm::geom::io::write_atomically;
use serde::{Deserialize, Serialize};

use crate::bootstrap::{BootstrapSettings, PairDraws, weighted_mean};
use crate::workers::Workers;
use crate::{Error, Result};

pub use maps::MapMethod;
use measure::Measure;
use shape::MatchingShape;

/// The format that is written.
pub const FORMAT: &str = "semfm.eval-matching/1";
/// Commutation with the descriptors (Nogneng & Ovsjanikov 2017) decides. On the first six pairs of
/// FAUST_r, 250 samples: without it WKS errs by 44.7 and five landmarks by 10.4, with it by 24.1 and
/// 3.4. μ = .001 is the same and takes longer; μ = .001 with ten times the commutation gives 24.3 and
/// 4.4.
const FIT: FitSettings =
    FitSettings { laplacian: 0.01, descriptors: 1.0, orientation: 0.0, reversing: false };
/// The list of pairs in a set's folder.
const PAIRS: &str = "pairs.txt";

/// Sets of shapes with true correspondences.
#[derive(Clone, Debug)]
pub struct MatchingDataset {
    /// The folder.
    pub path: PathBuf,
    /// Hash of all shapes and pairs.
    pub hash: String,
    /// The sets, by name.
    pub sets: Vec<MatchingSet>,
}

/// Shapes of one kind and pairs among them.
#[derive(Clone, Debug)]
pub struct MatchingSet {
    /// The folder's name.
    pub name: String,
    folder: PathBuf,
    /// (source, target) by name.
    pub pairs: Vec<[String; 2]>,
}

impl MatchingDataset {
    /// Whether a folder is laid out as one.
    pub fn is_one(path: &Path) -> bool {
        let entries =
            std::fs::read_dir(path).map(|entries| entries.flatten()).into_iter().flatten();
        entries.into_iter().any(|entry| entry.path().join(PAIRS).is_file())
    }

    /// Reads the lists of pairs and hashes everything that they name.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Format`] for a line that is not two names, or no pair at all.
    pub fn open(path: &Path) -> Result<Self> {
        let mut folders: Vec<PathBuf> = std::fs::read_dir(path)
            .and_then(|entries| entries.map(|entry| Ok(entry?.path())).collect())
            .map_err(Error::io(path))?;
        folders.retain(|folder| folder.join(PAIRS).is_file());
        folders.sort();
        let sets = folders.into_iter().map(MatchingSet::open).collect::<Result<Vec<_>>>()?;
        if sets.iter().all(|set| set.pairs.is_empty()) {
            return Err(Error::format(path, "folder", "at least one pair", "none"));
        }
        let mut hasher = blake3::Hasher::new();
        for set in &sets {
            hasher.update(format!("{} {:?}\n", set.name, set.pairs).as_bytes());
            for name in set.shapes() {
                let path = set.file(name);
                let bytes = std::fs::read(&path).map_err(Error::io(&path))?;
                hasher.update(blake3::hash(&bytes).as_bytes());
            }
        }
        let hash = format!("blake3:{}", hasher.finalize().to_hex());
        Ok(Self { path: path.to_owned(), hash, sets })
    }

    /// Number of pairs in all sets.
    pub fn n_pairs(&self) -> usize {
        self.sets.iter().map(|set| set.pairs.len()).sum()
    }
}

impl MatchingSet {
    fn open(folder: PathBuf) -> Result<Self> {
        let path = folder.join(PAIRS);
        let text = std::fs::read_to_string(&path).map_err(Error::io(&path))?;
        let lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
        let pairs = lines.map(|(number, line)| {
            let words: Vec<String> = line.split_whitespace().map(str::to_owned).collect();
            <[String; 2]>::try_from(words).map_err(|_| {
                Error::format(&path, format!("line {}", number + 1), "two names", line)
            })
        });
        let pairs = pairs.collect::<Result<_>>()?;
        let name = folder.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        Ok(Self { name, folder, pairs })
    }

    fn file(&self, name: &str) -> PathBuf {
        self.folder.join(format!("{name}.npz"))
    }

    fn shapes(&self) -> std::collections::BTreeSet<&str> {
        self.pairs.iter().flatten().map(String::as_str).collect()
    }
}

/// How maps are made and measured.
#[derive(Clone, Debug)]
pub struct MatchingSettings {
    /// The methods.
    pub methods: Vec<MapMethod>,
    /// What a map made from descriptors is asked besides them.
    pub fit: FitSettings,
    /// Samples that the error is the mean of, at most, evenly out of all; 0 for all.
    pub n_samples: usize,
    /// How the machine is shared.
    pub workers: Workers,
    /// Where prepared shapes are kept.
    pub cache: ShapeCache,
    /// How intervals are made.
    pub bootstrap: BootstrapSettings,
}

impl Default for MatchingSettings {
    fn default() -> Self {
        Self {
            methods: MapMethod::ALL.to_vec(),
            fit: FIT,
            n_samples: 1000,
            workers: Workers::new(0, 0),
            cache: ShapeCache::off(),
            bootstrap: BootstrapSettings::default(),
        }
    }
}

/// One pair and one method.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MatchingRow {
    /// Name of the set.
    pub set: String,
    /// Name of the source.
    pub source: String,
    /// Name of the target.
    pub target: String,
    /// Name of the method.
    pub method: String,
    /// Mean geodesic error × 100 / √area.
    pub error: Option<f64>,
    /// The same against the mirrored truth, where it is known.
    pub mirror_error: Option<f64>,
    /// Whether the mirrored answer is the nearer one.
    pub flipped: Option<bool>,
    /// Why there is no error.
    pub failure: Option<String>,
    /// Milliseconds for the map, shapes at hand.
    pub map_ms: Option<f64>,
}

/// One method on one set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MatchingSummary {
    /// Name of the set.
    pub set: String,
    /// Name of the method.
    pub method: String,
    /// Pairs with an error.
    pub n: usize,
    /// Mean error.
    pub error: Option<f64>,
    /// 95 % interval, shapes resampled.
    pub interval: Option<[f64; 2]>,
    /// Mean error against the mirrored truth.
    pub mirror_error: Option<f64>,
    /// Mean of the smaller of the two, pair by pair.
    pub best_error: Option<f64>,
    /// Share of pairs whose mirrored answer is the nearer one.
    pub flip_rate: Option<f64>,
    /// Median milliseconds for the map.
    pub median_map_ms: Option<f64>,
}

/// What came out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MatchingResults {
    /// Name and version of this format.
    pub format: String,
    /// The folder.
    pub path: PathBuf,
    /// Its hash.
    pub dataset: String,
    /// Samples that errors are means of, at most; 0 for all.
    pub n_samples: usize,
    /// One row per pair and method.
    pub rows: Vec<MatchingRow>,
    /// Every set and method.
    pub summaries: Vec<MatchingSummary>,
}

/// Makes and measures every map. Failures of a pair are rows.
///
/// # Errors
/// No methods, cancellation.
pub fn run(
    dataset: &MatchingDataset,
    settings: &MatchingSettings,
    task: &Task,
) -> Result<MatchingResults> {
    if settings.methods.is_empty() {
        return Err(Error::invalid("methods", "at least one", "none"));
    }
    let total = dataset.n_pairs();
    let done = std::sync::atomic::AtomicUsize::new(0);
    let mut rows = Vec::new();
    for set in &dataset.sets {
        let names: Vec<&str> = set.shapes().into_iter().collect();
        let shapes = settings.workers.each(names.len(), |i| {
            task.check()?;
            match MatchingShape::read(&set.file(names[i]), &settings.cache, task) {
                Err(error) if error.is_cancelled() => Err(error),
                shape => Ok(shape.map(Arc::new).map_err(|error| error.to_string())),
            }
        })?;
        let shapes: BTreeMap<&str, _> = names.iter().copied().zip(shapes).collect();
        let found = settings.workers.each(set.pairs.len(), |i| {
            let [source, target] = &set.pairs[i];
            let rows = match (&shapes[source.as_str()], &shapes[target.as_str()]) {
                (Ok(a), Ok(b)) => pair_rows(a, b, settings, task)?,
                (Err(error), _) | (_, Err(error)) => settings
                    .methods
                    .iter()
                    .map(|method| MatchingRow {
                        method: method.name().into(),
                        failure: Some(error.clone()),
                        ..MatchingRow::default()
                    })
                    .collect(),
            };
            let done = done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1;
            task.step("matching", done, total)?;
            let name = |row: MatchingRow| MatchingRow {
                set: set.name.clone(),
                source: source.clone(),
                target: target.clone(),
                ..row
            };
            Ok(rows.into_iter().map(name).collect::<Vec<_>>())
        })?;
        rows.extend(found.into_iter().flatten());
    }
    Ok(MatchingResults {
        format: FORMAT.into(),
        path: dataset.path.clone(),
        dataset: dataset.hash.clone(),
        n_samples: settings.n_samples,
        summaries: summaries(dataset, &rows, settings),
        rows,
    })
}

fn pair_rows(
    source: &MatchingShape,
    target: &MatchingShape,
    settings: &MatchingSettings,
    task: &Task,
) -> Result<Vec<MatchingRow>> {
    let measure = Measure::new(source, target, settings.n_samples);
    let mut rows = Vec::new();
    for method in &settings.methods {
        let mut row = MatchingRow { method: method.name().into(), ..MatchingRow::default() };
        let start = std::time::Instant::now();
        let scored = method.map(source, target, &settings.fit, task).and_then(|map| {
            row.map_ms = Some(start.elapsed().as_secs_f64() * 1e3);
            measure
                .as_ref()
                .map_err(|reason| Error::invalid("pair", "one that can be measured", reason))?
                .of(&map)
        });
        match scored {
            Err(error) if error.is_cancelled() => return Err(error),
            Err(error) => row.failure = Some(error.to_string()),
            Ok((error, mirror)) => {
                (row.error, row.mirror_error) = (Some(error), mirror);
                row.flipped = mirror.map(|mirror| mirror < error);
            }
        }
        rows.push(row);
    }
    Ok(rows)
}

fn summaries(
    dataset: &MatchingDataset,
    rows: &[MatchingRow],
    settings: &MatchingSettings,
) -> Vec<MatchingSummary> {
    let mut all = Vec::new();
    for set in &dataset.sets {
        for method in &settings.methods {
            let own: Vec<&MatchingRow> =
                rows.iter().filter(|r| r.set == set.name && r.method == method.name()).collect();
            let ones = vec![1.0; own.len()];
            let mean = |of: &dyn Fn(&MatchingRow) -> Option<f64>| {
                weighted_mean(&own.iter().map(|row| of(row)).collect::<Vec<_>>(), &ones)
            };
            let named: Vec<[&str; 3]> =
                own.iter().map(|r| [&*r.set, &*r.source, &*r.target]).collect();
            let errors: Vec<Option<f64>> = own.iter().map(|row| row.error).collect();
            let draws = PairDraws::new(&named, &settings.bootstrap);
            let mut times: Vec<f64> = own.iter().filter_map(|row| row.map_ms).collect();
            times.sort_by(f64::total_cmp);
            all.push(MatchingSummary {
                set: set.name.clone(),
                method: method.name().into(),
                n: errors.iter().flatten().count(),
                error: mean(&|row| row.error),
                interval: draws.interval(|weights| weighted_mean(&errors, weights)),
                mirror_error: mean(&|row| row.mirror_error),
                best_error: mean(&|row| Some(row.error?.min(row.mirror_error?))),
                flip_rate: mean(&|row| row.flipped.map(|flipped| f64::from(u8::from(flipped)))),
                median_map_ms: times.get(times.len() / 2).copied(),
            });
        }
    }
    all
}

impl MatchingResults {
    /// Writes `results.json` and `table.md` into `folder`, which is made.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn write(&self, folder: &Path) -> Result<Vec<PathBuf>> {
        std::fs::create_dir_all(folder).map_err(Error::io(folder))?;
        let (json, text) = (folder.join(crate::results::FILE), folder.join(crate::table::FILE));
        write_atomically(&json, |out| {
            serde_json::to_writer_pretty(&mut *out, self)?;
            out.write_all(b"\n")
        })?;
        write_atomically(&text, |out| out.write_all(table::render(self).as_bytes()))?;
        Ok(vec![json, text])
    }

    /// The same without times.
    pub fn without_times(&self) -> Self {
        let mut same = self.clone();
        same.rows.iter_mut().for_each(|row| row.map_ms = None);
        same.summaries.iter_mut().for_each(|summary| summary.median_map_ms = None);
        same
    }
}

#[cfg(test)]
mod tests {
    use super::npz::tests::{npy, zip};
    use super::*;
    use semfm::Mesh;
    use semfm_synth::{Category, ObjectSettings, make_object};

    /// A set of one shape under two names: the second has its vertices in reverse order, is turned
    /// and twice as large.
    fn write_set(folder: &Path) {
        std::fs::create_dir_all(folder).unwrap();
        let settings = ObjectSettings { n_vertices: 700, ..Default::default() };
        let mesh = make_object(Category::Scissors, 3, &settings).unwrap().mesh;
        let n = mesh.n_vertices();
        let shape = |mesh: &Mesh, name: &str, reversed: bool| {
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
        };
        shape(&mesh, "a", false);
        shape(&mesh, "b", true);
        std::fs::write(folder.join(PAIRS), "a b\nb a\n\n").unwrap();
    }

    fn settings() -> MatchingSettings {
        MatchingSettings { n_samples: 60, workers: Workers::new(1, 1), ..Default::default() }
    }

    #[test]
    fn a_shape_and_its_turned_twin_are_matched_and_threads_do_not_matter() {
        let folder = tempfile::tempdir().unwrap();
        write_set(&folder.path().join("twins"));
        assert!(MatchingDataset::is_one(folder.path()));
        let dataset = MatchingDataset::open(folder.path()).unwrap();
        assert_eq!((dataset.sets.len(), dataset.n_pairs()), (1, 2));
        let results = run(&dataset, &settings(), &Task::default()).unwrap();
        assert_eq!(results.rows.len(), 2 * MapMethod::ALL.len());
        for summary in &results.summaries {
            // An isometry: whatever knows the truth a little finds it, to about an edge length.
            let error = summary.error.unwrap();
            let bound = if summary.method.starts_with("wks") { 60.0 } else { 3.0 };
            assert!(error < bound, "{}: {error}", summary.method);
            assert_eq!((summary.n, summary.flip_rate), (2, None));
        }
        let many = MatchingSettings { workers: Workers::new(3, 2), ..settings() };
        let again = run(&dataset, &many, &Task::default()).unwrap();
        assert_eq!(again.without_times(), results.without_times());
        let text = table::render(&results);
        assert!(text.contains("## twins") && text.contains("`true20+zoomout`"), "{text}");
    }

    #[test]
    fn a_missing_array_is_a_failed_pair_and_a_missing_file_no_dataset() {
        let folder = tempfile::tempdir().unwrap();
        let set = folder.path().join("twins");
        write_set(&set);
        std::fs::write(set.join("b.npz"), zip(&[("V.npy", npy(&[1, 3], &[0f32; 3]))], false))
            .unwrap();
        let dataset = MatchingDataset::open(folder.path()).unwrap();
        let results = run(&dataset, &settings(), &Task::default()).unwrap();
        assert!(
            results
                .rows
                .iter()
                .all(|row| row.failure.as_ref().is_some_and(|f| f.contains("b.npz")))
        );
        std::fs::remove_file(set.join("a.npz")).unwrap();
        assert!(MatchingDataset::open(folder.path()).is_err());
        std::fs::write(set.join(PAIRS), "a\n").unwrap();
        let error = MatchingDataset::open(folder.path()).unwrap_err().to_string();
        assert!(error.contains("line 1"), "{error}");
    }
}
