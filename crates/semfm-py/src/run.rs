//! `run`: from pictures of a demonstration to a grasp, by one recipe.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use semfm::Task;
use semfm::files::{GraspsFile, RunFile, StageState};
use semfm_run::{Run, RunProgress, RunSettings, Stage};
use semfm_show::html::escape;

use crate::interruptible::run as run_work;
use crate::region::Region;
use crate::stored_transfer::{StoredTransfer, read_transfer};
use crate::{errors, json};

/// How a run from pictures to grasps went, stage by stage: see `run`.
#[pyclass(frozen, module = "semfm")]
pub struct RunResult {
    file: Arc<RunFile>,
    folder: PathBuf,
}

impl RunResult {
    /// The path of a file of a stage of this run; `None` where the stage wrote no such file.
    fn path_of(&self, stage: &str, name: &str) -> Option<PathBuf> {
        let record = self.file.stages.iter().find(|record| record.stage == stage)?;
        let is_there = record.files.iter().any(|file| file == name);
        is_there.then(|| self.folder.join(stage).join(name))
    }
}

#[pymethods]
impl RunResult {
    /// str: the folder.
    #[getter]
    fn folder(&self) -> String {
        self.folder.display().to_string()
    }

    /// str: the page that shows how it went, in the folder.
    #[getter]
    fn page(&self) -> String {
        self.folder.join(&self.file.page.file).display().to_string()
    }

    /// list of dict: the stages in their order, up to the first without an answer: ``stage``, its ``state``, ``seconds``
    /// when it was done, ``summary`` in words, and the names of its ``files``.
    #[getter]
    fn stages<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.file.stages)
    }

    /// dict: by stage, ``"done"`` where this run did it, ``"kept"`` where its inputs and settings were those of an earlier run.
    #[getter]
    fn states<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let states = PyDict::new(py);
        for record in &self.file.stages {
            states.set_item(&record.stage, name_of(record.state))?;
        }
        Ok(states)
    }

    /// dict, optional: why there is no answer: ``reason``, and what to do ``next``; None where there is one.
    #[getter]
    fn no_answer<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.file.no_answer)
    }

    /// StoredTransfer, optional: both objects, the region on each and how sure that is; None where the run did not come
    /// so far.
    #[getter]
    fn transfer(&self, py: Python<'_>) -> PyResult<Option<StoredTransfer>> {
        let name = Stage::Transfer.name();
        let is_there = self.file.stages.iter().any(|record| record.stage == name);
        is_there.then(|| read_transfer(py, self.folder.join(name))).transpose()
    }

    /// Region, optional: the region on the target; None where the run did not come so far.
    #[getter]
    fn region(&self, py: Python<'_>) -> PyResult<Option<Region>> {
        self.transfer(py)?.map(|transfer| transfer.region(py)).transpose()
    }

    /// dict, optional: the grasps, as `grasps.json` has them; None where none were asked for, or the run did not come so
    /// far. Its file (`file`) is what `plan` takes.
    #[getter]
    fn grasps<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let Some(path) = self.path_of(Stage::Grasp.name(), "grasps.json") else { return Ok(None) };
        let file = run_work(py, None, move |_| Ok(GraspsFile::read_alone(&path)?.to_json()))?;
        json::to_python(py, &file).map(Some)
    }

    /// The path of a file of a stage, such as ``file("target-pose", "aligned.json")`` or ``file("grasp", "grasps.json")``.
    ///
    /// Parameters
    /// ----------
    /// stage : str
    ///     Its name as `stages` has it, such as ``"region"`` or ``"grasp"``.
    /// name : str
    ///     One of the stage's ``files``.
    ///
    /// Returns
    /// -------
    /// str
    fn file(&self, py: Python<'_>, stage: &str, name: &str) -> PyResult<String> {
        let path = self.path_of(stage, name).ok_or_else(|| {
            let of_stage = self.file.stages.iter().find(|record| record.stage == stage);
            let known = match of_stage {
                Some(record) => format!("one of {}", record.files.join(", ")),
                None => "a file of a stage of this run".to_owned(),
            };
            errors::invalid(py, "name", &known, &format!("{stage}/{name}"))
        })?;
        Ok(path.display().to_string())
    }

    /// The content of `run.json`.
    ///
    /// Returns
    /// -------
    /// dict
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.file.to_json())
    }

    fn __repr__(&self) -> String {
        let stages = self.file.stages.iter();
        let stages: Vec<String> =
            stages.map(|record| format!("{} {}", record.stage, name_of(record.state))).collect();
        let end = self.file.no_answer.as_ref().map(|none| format!("; no answer: {}", none.reason));
        format!("RunResult({}{})", stages.join(", "), end.unwrap_or_default())
    }

    /// What a notebook shows: a line for each stage, and why there is no answer.
    fn _repr_html_(&self) -> String {
        let mut html = "<table>".to_owned();
        for record in &self.file.stages {
            let (stage, state) = (escape(&record.stage), name_of(record.state));
            let summary = escape(record.summary.first().map_or("", String::as_str));
            let _ = write!(html, "<tr><td>{stage}</td><td>{state}</td><td>{summary}</td></tr>");
        }
        html += "</table>";
        if let Some(none) = &self.file.no_answer {
            let (reason, next) = (escape(&none.reason), escape(&none.next));
            let _ = write!(html, "<p><b>No answer</b>: {reason}<br>{next}</p>");
        }
        html
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (String, String))> {
        let restore = py.import("semfm._semfm")?.getattr("_restore_run_result")?;
        Ok((restore, (self.file.to_json().to_string(), self.folder())))
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }
}

fn name_of(state: StageState) -> &'static str {
    match state {
        StageState::Done => "done",
        StageState::Kept => "kept",
    }
}

/// A result out of a pickle: its files stay where they are.
#[pyfunction]
pub fn _restore_run_result(py: Python<'_>, text: &str, folder: PathBuf) -> PyResult<RunResult> {
    let file: RunFile = serde_json::from_str(text)
        .map_err(|error| errors::invalid(py, "pickle", "a run's result", &error.to_string()))?;
    Ok(RunResult { file: Arc::new(file), folder })
}

/// Goes from pictures of a demonstration to a grasp by one recipe: pose, region, transfer, grasps and motion.
///
/// The same as ``semfm-cli run``: each stage keeps its files in a folder of its own and is done again only when
/// something that it was made from has changed. `docs/observations.md` tells of recipes and stages. Two runs must not write
/// one folder at once. Where a run is interrupted, the stage at work replaces nothing.
///
/// Parameters
/// ----------
/// recipe : path
///     The recipe (TOML); ``semfm-cli run --template`` prints one with every key explained.
/// output : path
///     Folder for the results; made if it is not there.
/// cache : bool, default True
///     Whether prepared shapes and embeddings are kept between runs, where the recipe does not forbid it.
/// progress : progress, optional
///     Hears of each stage by its name, 0 of 1 when it begins and 1 of 1 when it is there, and of the steps within.
///
/// Returns
/// -------
/// RunResult
///     That a stage has no answer is no error: see `RunResult.no_answer`.
#[pyfunction]
#[pyo3(signature = (recipe, output, *, cache=true, progress=None))]
pub fn run(
    py: Python<'_>,
    recipe: PathBuf,
    output: PathBuf,
    cache: bool,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<RunResult> {
    let folder = output.clone();
    let done = run_work(py, progress, move |task| Ok(carry_out(&recipe, &output, cache, task)))?;
    let file = done.map_err(|error| errors::raise_run(py, &error))?;
    Ok(RunResult { file: Arc::new(file), folder })
}

fn carry_out(recipe: &Path, output: &Path, cache: bool, task: &Task) -> semfm_run::Result<RunFile> {
    let settings = RunSettings { cache, ..RunSettings::default() };
    // That somebody wants it to stop is heard by the stages themselves.
    let mut tell = |progress: RunProgress<'_>| match progress {
        RunProgress::Begun { stage, .. } => drop(task.step(stage.name(), 0, 1)),
        RunProgress::Finished(record) => drop(task.step(&record.stage, 1, 1)),
        _ => {}
    };
    Run::open(recipe, output)?.carry_out(&settings, &mut tell, task)
}

/// What `run` would do with each stage, and why: ``semfm-cli run --dry-run``.
///
/// Parameters
/// ----------
/// recipe : path
///     The recipe (TOML).
/// output : path
///     The folder of the results.
///
/// Returns
/// -------
/// list of dict
///     ``stage``, and ``why`` it is to be done; None where it is kept.
#[pyfunction]
pub fn planned_stages(
    py: Python<'_>,
    recipe: PathBuf,
    output: PathBuf,
) -> PyResult<Vec<Bound<'_, PyDict>>> {
    let planned =
        run_work(py, None, move |_| Ok(Run::open(&recipe, &output).map(|run| run.planned())))?;
    let planned = planned.map_err(|error| errors::raise_run(py, &error))?;
    let entry = |stage: semfm_run::PlannedStage| {
        let entry = PyDict::new(py);
        entry.set_item("stage", stage.stage.name())?;
        entry.set_item("why", stage.why)?;
        Ok(entry)
    };
    planned.into_iter().map(entry).collect()
}
