//! `Memory`: demonstrations in a folder, asked for new objects.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock, TryLockError};
use std::time::Duration;

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use semfm::encoder::rendered_views::Coloring;
use semfm::files::{MemoryReportFile, Provenance};
use semfm::memory::{
    Demonstration, Memory as Demonstrations, MemorySettings, MemoryTransfer as Answer,
};
use semfm::object_encoder::ObjectEncoder;
use semfm::{PipelineSettings, Task};
use semfm_show::{TransferFiles, write_memory_picture, write_memory_transfer};
use semfm_views::mcap::EmbeddingsFile;

use crate::cloud::embeddings_of;
use crate::interruptible::{guard, run};
use crate::mesh::GivenObject;
use crate::prepared::{PreparedObject, encoder_of};
use crate::region::{Region, region_of};
use crate::shape::{cache_of, check_shape_size};
use crate::shared::Shared;
use crate::transfer::Hypothesis;
use crate::{arrays_out, errors, json, pictures};

/// Demonstrations in a folder: objects with a region each, of one kind or of many.
///
/// Parameters
/// ----------
/// folder : path
///     A memory, or an empty or missing folder in which one begins with the first `remember`.
/// cache : cache, optional
///     Where prepared shapes and embeddings are kept: a folder, or True for the user's own.
///
/// Examples
/// --------
/// >>> import semfm, tempfile
/// >>> mug, pot, kettle = (semfm.demo_object("containers", instance=i, n_vertices=500) for i in range(3))
/// >>> memory = semfm.Memory(tempfile.mkdtemp())
/// >>> memory.remember("mug", mug.mesh, mug.region, kind="container")
/// >>> memory.remember("pot", pot.mesh, pot.region, kind="container")
/// >>> memory.names
/// ['mug', 'pot']
/// >>> answer = memory.transfer(kettle.mesh)
/// >>> answer.verdict in ("accept", "check", "refuse")
/// True
#[pyclass(frozen, module = "semfm")]
pub struct Memory {
    /// Replaced as a whole by changes: work on a pool's thread that held a lock could wait for itself.
    inner: RwLock<Arc<Demonstrations>>,
    /// Held by the calling thread of a change, never by a worker.
    changing: Mutex<()>,
}

/// Between two looks at whether another thread's change has ended.
const NAP: Duration = Duration::from_millis(10);

impl Memory {
    /// The memory as it is now.
    fn now(&self) -> Arc<Demonstrations> {
        Arc::clone(&self.inner.read().unwrap_or_else(PoisonError::into_inner))
    }

    /// Reads something off the memory.
    fn read<T>(&self, read: impl FnOnce(&Demonstrations) -> T) -> T {
        read(&self.now())
    }

    /// Waits, without the interpreter's lock, for the changes of other threads.
    fn alone(&self, py: Python<'_>) -> PyResult<MutexGuard<'_, ()>> {
        loop {
            match self.changing.try_lock() {
                Ok(alone) => return Ok(alone),
                Err(TryLockError::Poisoned(poisoned)) => return Ok(poisoned.into_inner()),
                Err(TryLockError::WouldBlock) => {
                    py.detach(|| std::thread::sleep(NAP));
                    py.check_signals()?;
                }
            }
        }
    }

    /// Changes a copy of the memory and takes it over.
    fn change(
        &self,
        py: Python<'_>,
        progress: Option<&Bound<'_, PyAny>>,
        change: impl FnOnce(&mut Demonstrations, &Task) -> semfm::Result<()> + Send + 'static,
    ) -> PyResult<()> {
        let _alone = self.alone(py)?;
        let mut memory = (*self.now()).clone();
        let changed = run(py, progress, move |task| {
            change(&mut memory, task)?;
            Ok(memory)
        })?;
        *self.inner.write().unwrap_or_else(PoisonError::into_inner) = Arc::new(changed);
        Ok(())
    }

    /// The encoder of this name, or the memory's own where none is given.
    fn open_encoder(&self, py: Python<'_>, name: Option<&str>) -> PyResult<ObjectEncoder> {
        let (own, settings) =
            self.read(|memory| (memory.encoder().cloned(), memory.settings().clone()));
        let rolls = own.as_ref().map(|own| own.rolls);
        let name = name.or(own.as_ref().map(|own| own.name.as_str()));
        let most_rolls = settings.transfer.method.info().features.rolls;
        encoder_of(py, name, rolls, most_rolls, &settings.cache)
    }
}

#[pymethods]
impl Memory {
    #[new]
    #[pyo3(signature = (folder, *, cache=None))]
    fn new(py: Python<'_>, folder: PathBuf, cache: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let settings = PipelineSettings { cache: cache_of(cache)?, ..PipelineSettings::default() };
        let memory =
            guard(py, || Ok(Demonstrations::open_or_begin(folder)?.with_settings(settings)))?;
        Ok(Self { inner: RwLock::new(Arc::new(memory)), changing: Mutex::new(()) })
    }

    /// str: the folder.
    #[getter]
    fn folder(&self) -> String {
        self.read(|memory| memory.folder().display().to_string())
    }

    /// list of str: names of the demonstrations, in alphabetical order.
    #[getter]
    fn names(&self) -> Vec<String> {
        self.read(|memory| memory.entries().iter().map(|entry| entry.name.clone()).collect())
    }

    /// list of dict: the demonstrations as `memory.json` has them: name, kind, mesh, provenance.
    #[getter]
    fn entries<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let entries = self.read(|memory| memory.entries().to_vec());
        json::to_python(py, &entries)
    }

    /// dict, optional: the encoder behind all features; None while the memory is empty.
    #[getter]
    fn encoder<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let encoder = self.read(|memory| memory.encoder().cloned());
        json::to_python(py, &encoder)
    }

    fn __len__(&self) -> usize {
        self.read(|memory| memory.entries().len())
    }

    /// Adds a demonstration. Its files are complete before the memory names it.
    ///
    /// Parameters
    /// ----------
    /// name : str
    ///     Its name in the memory.
    /// mesh : mesh_like or MeshFile
    ///     The demonstrated object.
    /// region : Region or path
    ///     Where one acts on it.
    /// kind : str, optional
    ///     What kind of object it is, in your words.
    /// embeddings : Embeddings or path, optional
    ///     Patch embeddings of its views, instead of an encoder.
    /// encoder : str, optional
    ///     Shown rendered views in grey; that of the memory, or ``builtin``, where none is given.
    /// replace : bool, default False
    ///     Replace the entry of that name, or with the same mesh and region.
    /// progress : progress, optional
    #[pyo3(signature = (name, mesh, region, *, kind=None, embeddings=None, encoder=None, replace=false, progress=None))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments, one per setting")]
    fn remember(
        &self,
        py: Python<'_>,
        name: String,
        mesh: &Bound<'_, PyAny>,
        region: &Bound<'_, PyAny>,
        kind: Option<String>,
        embeddings: Option<&Bound<'_, PyAny>>,
        encoder: Option<&str>,
        replace: bool,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let object = GivenObject::of(mesh, "mesh")?;
        check_shape_size(py, object.mesh.n_vertices(), &PipelineSettings::default().shape)?;
        let region = region_of(region, &object.mesh)?;
        let given = match (embeddings, encoder) {
            (Some(_), Some(_)) => {
                let expected = "one of embeddings and encoder";
                return Err(errors::invalid(py, "encoder", expected, "both"));
            }
            (Some(embeddings), None) => {
                Features::Given(embeddings_of(embeddings, "embeddings", &object.mesh)?)
            }
            (None, encoder) => Features::Encoder(self.open_encoder(py, encoder)?),
        };
        self.change(py, progress, move |memory, task| {
            let embeddings = given.of(&object, task)?;
            let demonstration = Demonstration {
                name,
                kind,
                mesh: &object.mesh,
                region: &region,
                embeddings: &embeddings,
                mesh_file: None,
                region_file: None,
            };
            memory.remember(&demonstration, replace, task)?;
            Ok(())
        })
    }

    /// Takes a demonstration away.
    ///
    /// Parameters
    /// ----------
    /// name : str
    fn forget(&self, py: Python<'_>, name: String) -> PyResult<()> {
        self.change(py, None, move |memory, _| memory.forget(&name))
    }

    /// Carries what was demonstrated to an object: the most similar demonstrations are matched and their
    /// answers fused.
    ///
    /// Parameters
    /// ----------
    /// target : mesh_like or MeshFile or PreparedObject
    ///     The object to act on.
    /// kind : str, optional
    ///     Only demonstrations of this kind.
    /// shortlist : int, default 5
    ///     Demonstrations that are matched.
    /// embeddings : Embeddings or path, optional
    ///     Patch embeddings of the target's views, instead of an encoder.
    /// encoder : str, optional
    ///     Must be that of the memory, which is opened where none is given.
    /// progress : progress, optional
    ///
    /// Returns
    /// -------
    /// MemoryTransfer
    #[pyo3(signature = (target, *, kind=None, shortlist=5, embeddings=None, encoder=None, progress=None))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments, one per setting")]
    fn transfer(
        &self,
        py: Python<'_>,
        target: &Bound<'_, PyAny>,
        kind: Option<String>,
        shortlist: usize,
        embeddings: Option<&Bound<'_, PyAny>>,
        encoder: Option<&str>,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<MemoryTransfer> {
        let settings = MemorySettings { kind, shortlist, ..MemorySettings::default() };
        let memory = self.now();
        let target = match target.cast::<PreparedObject>() {
            Ok(prepared) => {
                if embeddings.is_some() || encoder.is_some() {
                    let expected = "nothing beside a PreparedObject, which has its features";
                    return Err(errors::invalid(py, "embeddings", expected, "more"));
                }
                Target::Ready(prepared.get().clone())
            }
            Err(_) => {
                let object = GivenObject::of(target, "target")?;
                check_shape_size(py, object.mesh.n_vertices(), &PipelineSettings::default().shape)?;
                let given = match embeddings {
                    Some(given) => {
                        Features::Given(embeddings_of(given, "embeddings", &object.mesh)?)
                    }
                    None => Features::Encoder(self.open_encoder(py, encoder)?),
                };
                Target::Raw(object, given)
            }
        };
        run(py, progress, move |task| {
            let target = match target {
                Target::Ready(prepared) => prepared,
                Target::Raw(object, given) => {
                    let embeddings = given.of(&object, task)?;
                    let source = semfm::FeatureSource::from(&*embeddings);
                    let mesh = (*object.mesh).clone();
                    let prepared = semfm::prepare(mesh, source, memory.settings(), task)?;
                    PreparedObject::new(prepared)
                }
            };
            let answer = Arc::new(memory.transfer(&target.inner, &settings, task)?);
            let provenance = Provenance {
                version: Some(env!("CARGO_PKG_VERSION").to_owned()),
                ..Provenance::default()
            };
            let report = MemoryReportFile::new(&memory, &target.inner, &answer, provenance);
            let report = Arc::new(report);
            Ok(MemoryTransfer { answer, target, report })
        })
    }

    fn __repr__(&self) -> String {
        self.read(|memory| {
            let n = memory.entries().len();
            format!("Memory({:?}, {n} demonstrations)", memory.folder().display().to_string())
        })
    }
}

/// Where the features of an object come from.
enum Features {
    Given(Arc<EmbeddingsFile>),
    Encoder(ObjectEncoder),
}

impl Features {
    /// The embeddings; an encoder is shown the object in grey, for colour on one side misleads.
    fn of(self, object: &GivenObject, task: &Task) -> semfm::Result<Arc<EmbeddingsFile>> {
        Ok(match self {
            Self::Given(embeddings) => embeddings,
            Self::Encoder(encoder) => {
                Arc::new(encoder.embed(object.drawable(), Coloring::Grey, task)?.embeddings)
            }
        })
    }
}

/// The object to act on, prepared or to be prepared.
enum Target {
    Ready(PreparedObject),
    Raw(GivenObject, Features),
}

/// What a memory says of an object: the answers of several demonstrations, fused. Made by `Memory.transfer`.
#[pyclass(frozen, module = "semfm")]
pub struct MemoryTransfer {
    answer: Arc<Answer>,
    target: PreparedObject,
    report: Arc<MemoryReportFile>,
}

#[pymethods]
impl MemoryTransfer {
    /// Region: the region on the target.
    #[getter]
    fn region(&self) -> Region {
        Region { inner: Shared::part_of(&self.answer, |answer| &answer.fused.region) }
    }

    /// (n_target,) float64 array: weight of each target vertex, a read-only view.
    #[getter]
    fn weights<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        arrays_out::vector(slf, |transfer| transfer.answer.fused.region.weights())
    }

    /// float: the probability that the IoU with the true region is at least one half, in [0, 1].
    #[getter]
    fn confidence(&self) -> f64 {
        self.answer.fused.confidence
    }

    /// str: ``"accept"``, ``"check"`` or ``"refuse"``.
    #[getter]
    fn verdict(&self) -> String {
        self.answer.fused.verdict.to_string()
    }

    /// str, optional: why the answer is not accepted, where that is known.
    #[getter]
    fn why(&self) -> Option<String> {
        self.answer.why()
    }

    /// float: mean IoU of the answers with the fused region, by their shares of the vote.
    #[getter]
    fn agreement(&self) -> f64 {
        self.answer.fused.agreement
    }

    /// list of Hypothesis: where the region may belong, by falling probability.
    #[getter]
    fn hypotheses(&self) -> Vec<Hypothesis> {
        self.answer.fused.hypotheses.iter().map(Hypothesis::of).collect()
    }

    /// list of dict: what each demonstration said, the most trusted first: name, kind, similarity,
    /// confidence, verdict, evidence, share of the vote, agreement with the others.
    #[getter]
    fn answers<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.report.answers)
    }

    /// dict: the whole report, as ``report.json`` has it.
    #[getter]
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &*self.report)
    }

    /// PreparedObject: the object to act on.
    #[getter]
    fn target(&self) -> PreparedObject {
        self.target.clone()
    }

    /// Writes every file that `semfm-cli transfer --memory` writes: region, report, painted target, picture.
    ///
    /// Parameters
    /// ----------
    /// folder : path
    ///     Made if it is not there.
    /// pictures : bool, default True
    ///     Also draw ``memory.png``.
    /// progress : progress, optional
    ///
    /// Returns
    /// -------
    /// list of str
    ///     The files.
    #[pyo3(signature = (folder, *, pictures=true, progress=None))]
    fn write(
        &self,
        py: Python<'_>,
        folder: PathBuf,
        pictures: bool,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Vec<String>> {
        let which = if pictures { TransferFiles::All } else { TransferFiles::WithoutPictures };
        let (answer, target) = (Arc::clone(&self.answer), self.target.inner.clone());
        let report = Arc::clone(&self.report);
        let files = run(py, progress, move |task| {
            Ok(write_memory_transfer(&folder, &target, &answer, &report, which, task)?)
        })?;
        Ok(files.iter().map(|file| file.display().to_string()).collect())
    }

    /// A picture of who said what, which notebooks show by themselves: `memory.png` of `write`.
    ///
    /// Returns
    /// -------
    /// bytes
    ///     PNG.
    fn picture<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let (answer, target) = (Arc::clone(&self.answer), self.target.inner.clone());
        pictures::png(py, move |path, task| Ok(write_memory_picture(path, &target, &answer, task)?))
    }

    fn _repr_png_<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyBytes>> {
        pictures::shown(self.picture(py))
    }

    fn __repr__(&self) -> String {
        let fused = &self.answer.fused;
        let (n, of) = (fused.region.vertices().len(), fused.region.n_vertices());
        let (verdict, confidence) = (fused.verdict, fused.confidence);
        let answers = self.answer.answers.len();
        format!(
            "MemoryTransfer({verdict}, confidence {confidence:.2}, {n} of {of} vertices, {answers} demonstrations)"
        )
    }
}
