//! Prepared shapes on disk, named by what went into them.
//!
//! An entry is one file, `<key>.shape`; the key is a hash of the mesh, the settings and the version
//! of this format. Writers write a file of their own and rename it, so that readers see a whole
//! entry or none and the last of several writers wins. Whatever is not exactly an entry with this
//! key (cut short, a flipped bit, another format, another mesh) counts as absent and is written
//! anew. Numbers are little-endian:
//!
//! | bytes | what |
//! |---|---|
//! | 8 + 32 | `SEMFMSH4`, key |
//! | 7 × 8 | n original vertices, n_w working vertices, m triangles, k, e entries of the stiffness on and below the diagonal, p original vertices beside the working ones, length of the report |
//! | 4 n_w + 12 m | `to_original`, from which the working vertices are read, and the triangles |
//! | 4 n + 4 p + 20 p | `of_original`; the p vertices that are no working vertex (nor one that they were welded to), and `point_of_original` of each: the last two weights in `f32`, then corners |
//! | 8 e + 4 e + 4 n_w | stiffness by column: values, rows, and how many each column has |
//! | 8 k + 4 n_w k + 8 n_w + 8 k | eigenvalues, eigenfunctions by column in `f32`, mass, residuals |
//! | report | JSON |
//! | 32 | BLAKE3 of everything before |
//!
//! A shape has its eigenfunctions and weights in single precision from the start, so that nothing is lost here.

use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use faer::Mat;
use faer::sparse::{SparseColMat, Triplet};

use crate::denoise::without_noise;
use crate::shape::ShapeParts;
use crate::working_mesh::{BarycentricPoint, WorkingMesh};
use crate::{Eigenbasis, Error, Laplacian, Mesh, MeshHash, Result, Shape, ShapeSettings, Task};

/// Names format and version. A change of the layout *or of any step that leads to a shape* must
/// change it: entries of other versions are never read.
const MAGIC: [u8; 8] = *b"SEMFMSH4";
const SUFFIX: &str = "shape";
const N_COUNTS: usize = 7;
const HEADER: usize = 8 + 32 + N_COUNTS * 8;
const TRAILER: usize = 32;

/// Where prepared shapes are kept.
///
/// ```
/// use semfm_geom::{Mesh, ShapeCache, ShapeSettings, Task, math::DVec3};
/// let folder = tempfile::tempdir()?;
/// let cache = ShapeCache::at(folder.path());
/// let points = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
/// let mesh = Mesh::new(points, vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])?;
/// let settings = ShapeSettings::default();
/// assert!(!cache.shape(mesh.clone(), &settings, &Task::default())?.hit);
/// assert!(cache.shape(mesh, &settings, &Task::default())?.hit);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct ShapeCache {
    folder: Option<PathBuf>,
    /// After each write the entries used least recently go until the rest is no larger than this.
    pub max_bytes: u64,
}

/// A shape and how the cache was involved.
#[derive(Clone, Debug)]
pub struct CachedShape {
    /// The shape. After a hit, the times in its report are those of its making.
    pub shape: Shape,
    /// Whether it was read rather than made.
    pub hit: bool,
    /// Why it could not be kept, where it could not: never a reason to fail.
    pub not_kept: Option<String>,
}

impl ShapeCache {
    /// Enough for about 600 shapes of 10 000 vertices and 60 eigenpairs.
    pub const DEFAULT_MAX_BYTES: u64 = 2 << 30;

    /// No cache: every shape is made.
    pub fn off() -> Self {
        Self { folder: None, max_bytes: 0 }
    }

    /// A cache in `folder`, which is made when the first shape is kept.
    pub fn at(folder: impl Into<PathBuf>) -> Self {
        Self { folder: Some(folder.into()), max_bytes: Self::DEFAULT_MAX_BYTES }
    }

    /// The user's cache: `$SEMFM_CACHE/shapes`, else `$XDG_CACHE_HOME/semfm/shapes`, else
    /// `~/.cache/semfm/shapes`; off where none of these is set.
    pub fn of_user() -> Self {
        // The XDG specification has relative paths ignored.
        let xdg = folder_of_variable("XDG_CACHE_HOME").filter(|path| path.is_absolute());
        let base = folder_of_variable("SEMFM_CACHE")
            .or_else(|| xdg.map(|path| path.join("semfm")))
            .or_else(|| folder_of_variable("HOME").map(|path| path.join(".cache/semfm")));
        base.map_or_else(Self::off, |base| Self::at(base.join("shapes")))
    }

    /// The folder; `None` where the cache is off.
    pub fn folder(&self) -> Option<&Path> {
        self.folder.as_deref()
    }

    /// The shape of `mesh`: read where it was made before, else made and kept.
    ///
    /// # Errors
    /// Those of [`Shape::new`]; trouble with the cache itself is never an error.
    pub fn shape(&self, mesh: Mesh, settings: &ShapeSettings, task: &Task) -> Result<CachedShape> {
        let Some(folder) = &self.folder else {
            let shape = Shape::new(mesh, settings, task)?;
            return Ok(CachedShape { shape, hit: false, not_kept: None });
        };
        let key = key(mesh.hash(), settings);
        let path =
            folder.join(blake3::Hash::from_bytes(key).to_hex().as_str()).with_extension(SUFFIX);
        task.check()?;
        let mesh = match read(&path, &key, mesh) {
            Ok(shape) => return Ok(CachedShape { shape, hit: true, not_kept: None }),
            Err(mesh) => mesh,
        };
        let shape = Shape::new(*mesh, settings, task)?;
        let kept = encode(&shape, &key).and_then(|bytes| write(folder, &path, &bytes));
        let not_kept = kept.and_then(|()| self.shrink(folder, &path)).err().map(|e| e.to_string());
        Ok(CachedShape { shape, hit: false, not_kept })
    }

    /// Removes the entries used least recently, and what crashed writers left, but not `newest`.
    fn shrink(&self, folder: &Path, newest: &Path) -> Result<()> {
        let mut entries: Vec<(SystemTime, u64, PathBuf)> = fs::read_dir(folder)
            .map_err(Error::io(folder))?
            .flatten()
            .filter(|entry| entry.path().extension().is_some_and(|suffix| suffix == SUFFIX))
            .filter_map(|entry| {
                let meta = entry.metadata().ok()?;
                Some((meta.modified().ok()?, meta.len(), entry.path()))
            })
            .collect();
        entries.sort();
        let mut total: u64 = entries.iter().map(|(_, size, _)| size).sum();
        for (_, size, path) in entries.iter().filter(|(_, _, path)| path != newest) {
            if total <= self.max_bytes {
                break;
            }
            // Another process may have removed it already; that is as good.
            let _ = fs::remove_file(path);
            total -= size;
        }
        Ok(())
    }
}

impl Shape {
    /// Everything but the original mesh, in the layout of a cache entry; the key is the mesh's hash.
    ///
    /// # Errors
    /// [`Error::Io`] where the report cannot be written, which does not happen.
    pub fn to_bytes(&self) -> Result<Vec<u8>> {
        encode(self, &self.original().hash().0)
    }

    /// The shape that [`to_bytes`](Self::to_bytes) wrote, of the same mesh; `None` for any other
    /// bytes.
    pub fn from_bytes(original: Mesh, bytes: &[u8]) -> Option<Self> {
        let parts = decode(bytes, &original.hash().0, &original)?;
        Some(Self::from_parts(original, parts))
    }
}

/// The folder that an environment variable names; `None` where it is not set or empty.
fn folder_of_variable(name: &str) -> Option<PathBuf> {
    std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from)
}

/// BLAKE3 of the format, the mesh's hash and the settings as JSON.
fn key(mesh: MeshHash, settings: &ShapeSettings) -> [u8; 32] {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&MAGIC);
    hasher.update(env!("CARGO_PKG_VERSION").as_bytes());
    hasher.update(&mesh.0);
    hasher.update(&serde_json::to_vec(settings).expect("settings are numbers and names"));
    *hasher.finalize().as_bytes()
}

fn write(folder: &Path, path: &Path, bytes: &[u8]) -> Result<()> {
    let io = Error::io(path);
    fs::create_dir_all(folder).map_err(&io)?;
    // No fsync: after a power cut the checksum tells, and the entry is made again.
    let mut file =
        tempfile::Builder::new().suffix(".partial.shape").tempfile_in(folder).map_err(&io)?;
    file.write_all(bytes).map_err(&io)?;
    file.persist(path).map_err(|failed| io(failed.error))?;
    Ok(())
}

/// The shape in the file; gives the mesh back where there is none.
fn read(path: &Path, key: &[u8; 32], mesh: Mesh) -> std::result::Result<Shape, Box<Mesh>> {
    let Some(parts) = fs::read(path).ok().and_then(|bytes| decode(&bytes, key, &mesh)) else {
        return Err(Box::new(mesh));
    };
    // Marks the entry as used; a folder that may only be read is still a good cache.
    let _ = File::options().append(true).open(path).and_then(|f| f.set_modified(SystemTime::now()));
    Ok(Shape::from_parts(mesh, parts))
}

fn encode(shape: &Shape, key: &[u8; 32]) -> Result<Vec<u8>> {
    let (working, basis) = (shape.working(), shape.basis());
    let stiffness = &shape.laplacian().stiffness;
    let report = serde_json::to_vec(shape.report())
        .map_err(|source| Error::Io { path: "the shape's report".into(), source: source.into() })?;
    let beside: Vec<u32> = (0u32..)
        .zip(working.point_of_original.iter().zip(&working.of_original))
        .filter(|(_, (point, id))| **point != BarycentricPoint::vertex(**id))
        .map(|(vertex, _)| vertex)
        .collect();
    let lower = || stiffness.triplet_iter().filter(|entry| entry.row >= entry.col);
    let mut in_column = vec![0; working.mesh.n_vertices()];
    lower().for_each(|entry| in_column[entry.col] += 1);
    let n_entries = in_column.iter().map(|&n| n as usize).sum();
    let counts = [
        working.of_original.len(),
        working.mesh.n_vertices(),
        working.mesh.n_faces(),
        basis.k(),
        n_entries,
        beside.len(),
        report.len(),
    ];
    let mut bytes = Vec::with_capacity(total_bytes(counts).unwrap_or(0));
    bytes.extend(MAGIC);
    bytes.extend(key);
    bytes.extend(counts.iter().flat_map(|&count| (count as u64).to_le_bytes()));
    put_ids(&mut bytes, working.to_original.iter().copied());
    put_ids(&mut bytes, working.mesh.faces().iter().flatten().copied());
    put_ids(&mut bytes, working.of_original.iter().chain(&beside).copied());
    let points = || beside.iter().map(|&vertex| working.point_of_original[vertex as usize]);
    put_singles(&mut bytes, points().flat_map(|point| [point.weights[1], point.weights[2]]));
    put_ids(&mut bytes, points().flat_map(|point| point.corners));
    put_floats(&mut bytes, lower().map(|entry| *entry.val));
    put_ids(&mut bytes, lower().map(|entry| entry.row as u32));
    put_ids(&mut bytes, in_column.into_iter());
    put_floats(&mut bytes, basis.values.iter().copied());
    put_singles(&mut bytes, (0..basis.k()).flat_map(|j| basis.functions.col(j).iter().copied()));
    put_floats(&mut bytes, basis.mass.iter().chain(&basis.residuals).copied());
    bytes.extend(report);
    bytes.extend(blake3::hash(&bytes).as_bytes());
    Ok(bytes)
}

fn put_floats(bytes: &mut Vec<u8>, values: impl Iterator<Item = f64>) {
    values.for_each(|x| bytes.extend(x.to_le_bytes()));
}

fn put_singles(bytes: &mut Vec<u8>, values: impl Iterator<Item = f64>) {
    values.for_each(|x| bytes.extend((x as f32).to_le_bytes()));
}

fn put_ids(bytes: &mut Vec<u8>, ids: impl Iterator<Item = u32>) {
    ids.for_each(|id| bytes.extend(id.to_le_bytes()));
}

/// Length of an entry with these counts; `None` where no file is that long.
fn total_bytes(
    [n, n_working, m, k, n_entries, n_beside, report]: [usize; N_COUNTS],
) -> Option<usize> {
    let terms = [
        n.checked_mul(4)?,
        n_working.checked_mul(4 + 4 + 8)?,
        m.checked_mul(12)?,
        n_beside.checked_mul(4 + 20)?,
        k.checked_mul(16)?,
        n_entries.checked_mul(8 + 4)?,
        n_working.checked_mul(k)?.checked_mul(4)?,
        report,
    ];
    terms.into_iter().try_fold(HEADER + TRAILER, usize::checked_add)
}

/// `None` for anything but the entry with this key.
fn decode(bytes: &[u8], key: &[u8; 32], original: &Mesh) -> Option<ShapeParts> {
    let (body, trailer) = bytes.split_last_chunk::<TRAILER>()?;
    let mut reader = Reader(body);
    if reader.take(8)? != MAGIC || reader.take(32)? != key {
        return None;
    }
    let mut counts = [0; N_COUNTS];
    for count in &mut counts {
        *count = usize::try_from(u64::from_le_bytes(reader.take(8)?.try_into().ok()?)).ok()?;
    }
    // Lengths first, so that no count makes us reserve more than the file holds.
    if total_bytes(counts)? != bytes.len() || blake3::hash(body).as_bytes() != trailer {
        return None;
    }
    let [n, n_working, m, k, n_entries, n_beside, n_report] = counts;
    let to_original = reader.ids(n_working)?;
    let faces = reader.ids(3 * m)?.as_chunks::<3>().0.to_vec();
    let (of_original, beside) = (reader.ids(n)?, reader.ids(n_beside)?);
    let (weights, corners) = (reader.singles(2 * n_beside)?, reader.ids(3 * n_beside)?);
    let (entries, rows) = (reader.floats(n_entries)?, reader.ids(n_entries)?);
    let in_column = reader.ids(n_working)?;
    let values = reader.floats(k)?;
    let functions = reader.singles(n_working * k)?;
    let functions = Mat::from_fn(n_working, k, |i, j| functions[j * n_working + i].into());
    let (mass, residuals) = (reader.floats(n_working)?, reader.floats(k)?);
    let report = serde_json::from_slice(reader.take(n_report)?).ok()?;

    let sound = n == original.n_vertices()
        && in_range(&of_original, n_working)
        && in_range(&to_original, n)
        && in_range(&rows, n_working)
        && in_range(&beside, n)
        && in_range(&corners, n_working)
        && in_column.iter().map(|&count| count as usize).sum::<usize>() == n_entries;
    if !sound {
        return None;
    }
    let noise_free = without_noise(original);
    let surface = noise_free.as_ref().unwrap_or(original);
    let points = to_original.iter().map(|&id| surface.vertices()[id as usize]).collect();
    let mesh = Mesh::new(points, faces).ok()?;
    let mut point_of_original: Vec<BarycentricPoint> =
        of_original.iter().map(|&id| BarycentricPoint::vertex(id)).collect();
    let points = weights.as_chunks::<2>().0.iter().zip(corners.as_chunks::<3>().0);
    for (&vertex, (&weights, &corners)) in beside.iter().zip(points) {
        point_of_original[vertex as usize] = BarycentricPoint::new(corners, weights);
    }
    let laplacian =
        Laplacian { stiffness: symmetric(&entries, &rows, &in_column)?, mass: mass.clone() };
    let basis = Eigenbasis { values, functions, mass, residuals };
    let working = WorkingMesh { mesh, of_original, to_original, point_of_original };
    Some(ShapeParts { noise_free, working, laplacian, basis, report })
}

/// The symmetric matrix with these entries on and below its diagonal, column after column.
fn symmetric(entries: &[f64], rows: &[u32], in_column: &[u32]) -> Option<SparseColMat<usize, f64>> {
    let columns =
        (0..).zip(in_column).flat_map(|(column, &n)| std::iter::repeat_n(column, n as usize));
    let lower = columns
        .zip(rows)
        .zip(entries)
        .map(|((column, &row), &value)| (row as usize, column, value));
    let mut all = Vec::with_capacity(2 * entries.len());
    for (row, column, value) in lower {
        all.push(Triplet::new(row, column, value));
        if row != column {
            all.push(Triplet::new(column, row, value));
        }
    }
    let n = in_column.len();
    SparseColMat::try_new_from_triplets(n, n, &all).ok()
}

fn in_range(ids: &[u32], n: usize) -> bool {
    ids.iter().all(|&id| (id as usize) < n)
}

/// Takes numbers off the front of a slice; `None` where it is too short.
struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    fn take(&mut self, n: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(n)?;
        self.0 = rest;
        Some(taken)
    }

    fn floats(&mut self, n: usize) -> Option<Vec<f64>> {
        let bytes = self.take(n.checked_mul(8)?)?;
        Some(bytes.as_chunks::<8>().0.iter().map(|&b| f64::from_le_bytes(b)).collect())
    }

    fn singles(&mut self, n: usize) -> Option<Vec<f32>> {
        let bytes = self.take(n.checked_mul(4)?)?;
        Some(bytes.as_chunks::<4>().0.iter().map(|&b| f32::from_le_bytes(b)).collect())
    }

    fn ids(&mut self, n: usize) -> Option<Vec<u32>> {
        let bytes = self.take(n.checked_mul(4)?)?;
        Some(bytes.as_chunks::<4>().0.iter().map(|&b| u32::from_le_bytes(b)).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::zoo;

    fn settings() -> ShapeSettings {
        ShapeSettings { k: 10, working_vertices: 200, ..Default::default() }
    }

    fn ask(cache: &ShapeCache, mesh: &Mesh) -> CachedShape {
        cache.shape(mesh.clone(), &settings(), &Task::default()).unwrap()
    }

    fn only_file(folder: &Path) -> PathBuf {
        let mut files = fs::read_dir(folder).unwrap();
        let file = files.next().unwrap().unwrap().path();
        assert!(files.next().is_none(), "more than one file in the cache");
        file
    }

    fn assert_same(a: &Shape, b: &Shape) {
        assert_eq!(a.original(), b.original());
        assert_eq!(a.working(), b.working());
        assert_eq!((&a.basis().values, &a.basis().mass), (&b.basis().values, &b.basis().mass));
        assert_eq!(a.basis().residuals, b.basis().residuals);
        assert_eq!(a.basis().functions, b.basis().functions);
        assert_eq!(a.laplacian().stiffness.val(), b.laplacian().stiffness.val());
        assert_eq!(a.report(), b.report());
    }

    #[test]
    fn what_is_read_is_what_was_made_to_the_last_bit() {
        let folder = tempfile::tempdir().unwrap();
        let cache = ShapeCache::at(folder.path().join("deep/er"));
        let mesh = zoo::icosphere(3);
        let (made, read) = (ask(&cache, &mesh), ask(&cache, &mesh));
        assert!(!made.hit && read.hit && made.not_kept.is_none());
        assert_same(&made.shape, &read.shape);
        let other = ShapeSettings { k: 11, ..settings() };
        assert!(!cache.shape(mesh.clone(), &other, &Task::default()).unwrap().hit);
        assert!(!ask(&cache, &zoo::torus(20, 12)).hit);
        assert!(!ask(&ShapeCache::off(), &mesh).hit);
    }

    #[test]
    fn shapes_of_every_kind_come_back_to_the_last_bit() {
        for (name, mesh) in zoo::all() {
            for working_vertices in [0, mesh.n_vertices() / 3] {
                let settings = ShapeSettings { k: 6, working_vertices, ..Default::default() };
                let made = Shape::new(mesh.clone(), &settings, &Task::default()).unwrap();
                let bytes = made.to_bytes().unwrap();
                let read = Shape::from_bytes(mesh.clone(), &bytes);
                assert_same(&made, &read.unwrap_or_else(|| panic!("{name}: not read")));
            }
        }
    }

    #[test]
    fn bytes_are_of_one_mesh_and_give_the_shape_back() {
        let mesh = zoo::icosphere(2);
        let made = ask(&ShapeCache::off(), &mesh).shape;
        let bytes = made.to_bytes().unwrap();
        assert_same(&made, &Shape::from_bytes(mesh, &bytes).unwrap());
        assert!(Shape::from_bytes(zoo::icosphere(1), &bytes).is_none());
    }

    #[test]
    fn every_truncation_and_every_flipped_bit_is_a_miss_and_is_mended() {
        let folder = tempfile::tempdir().unwrap();
        let cache = ShapeCache::at(folder.path());
        let mesh = zoo::tetrahedron();
        let made = ask(&cache, &mesh).shape;
        let file = only_file(folder.path());
        let sound = fs::read(&file).unwrap();
        let key: [u8; 32] = sound[8..40].try_into().unwrap();
        for length in 0..sound.len() {
            assert!(decode(&sound[..length], &key, &mesh).is_none(), "cut to {length} bytes");
        }
        for bit in 0..8 * sound.len() {
            let mut bad = sound.clone();
            bad[bit / 8] ^= 1 << (bit % 8);
            assert!(decode(&bad, &key, &mesh).is_none(), "bit {bit} flipped");
        }
        let foreign = [&sound[..], b"more"].concat();
        for bad in [&sound[..sound.len() / 2], b"", b"something else entirely", &foreign] {
            fs::write(&file, bad).unwrap();
            assert!(!ask(&cache, &mesh).hit);
            let mended = ask(&cache, &mesh);
            assert!(mended.hit);
            assert_eq!(mended.shape.working(), made.working());
        }
    }

    #[test]
    fn an_entry_under_another_name_is_not_taken_for_it() {
        let folder = tempfile::tempdir().unwrap();
        let cache = ShapeCache::at(folder.path());
        ask(&cache, &zoo::icosphere(1));
        let theirs = only_file(folder.path());
        let mut moved = zoo::icosphere(1).vertices().to_vec();
        moved[0] *= 1.1;
        let mesh = Mesh::new(moved, zoo::icosphere(1).faces().to_vec()).unwrap();
        let name = blake3::Hash::from_bytes(key(mesh.hash(), &settings())).to_hex();
        fs::rename(theirs, folder.path().join(name.as_str()).with_extension(SUFFIX)).unwrap();
        assert!(!ask(&cache, &mesh).hit && ask(&cache, &mesh).hit);
    }

    #[test]
    fn many_writers_and_readers_at_once_all_get_the_same_shape() {
        let folder = tempfile::tempdir().unwrap();
        let cache = ShapeCache::at(folder.path());
        let mesh = zoo::icosphere(2);
        let alone = ask(&ShapeCache::off(), &mesh).shape;
        std::thread::scope(|threads| {
            for _ in 0..8 {
                threads.spawn(|| {
                    for _ in 0..5 {
                        let got = ask(&cache, &mesh);
                        assert_eq!(got.not_kept, None);
                        assert_eq!(got.shape.basis().functions, alone.basis().functions);
                        // Half of the threads' work is to disturb the others.
                        let _ = fs::remove_file(only_entry(folder.path()));
                    }
                });
            }
        });
        ask(&cache, &mesh);
        assert!(ask(&cache, &mesh).hit);
        only_file(folder.path()); // no writer left anything else behind
    }

    fn only_entry(folder: &Path) -> PathBuf {
        let name = blake3::Hash::from_bytes(key(zoo::icosphere(2).hash(), &settings())).to_hex();
        folder.join(name.as_str()).with_extension(SUFFIX)
    }

    #[test]
    fn the_oldest_entries_go_when_there_are_too_many() {
        let folder = tempfile::tempdir().unwrap();
        let mut cache = ShapeCache::at(folder.path());
        ask(&cache, &zoo::icosphere(1));
        let one = fs::metadata(only_file(folder.path())).unwrap().len();
        cache.max_bytes = one + one / 2;
        std::thread::sleep(std::time::Duration::from_millis(20));
        let smaller = zoo::tetrahedron();
        ask(&cache, &smaller);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2, "both fit");
        std::thread::sleep(std::time::Duration::from_millis(20));
        assert!(ask(&cache, &zoo::icosphere(1)).hit, "used again, so the other one is older now");
        cache.max_bytes = one;
        std::thread::sleep(std::time::Duration::from_millis(20));
        assert!(!ask(&cache, &zoo::icosphere(0)).hit);
        assert!(!ask(&cache, &smaller).hit, "the least recently used one is gone");
    }

    #[test]
    fn a_folder_that_cannot_be_written_costs_the_entry_and_nothing_else() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let cache = ShapeCache::at(file.path().join("below a file"));
        let got = ask(&cache, &zoo::tetrahedron());
        assert!(!got.hit && got.not_kept.is_some());
    }
}
