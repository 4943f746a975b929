//! `read_observations`: the frames of a BOP scene or of a bag, one after the other.

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use pyo3::prelude::*;
use semfm::observe::{self, BagSettings, SourceReport, SourceSettings};

use crate::errors;
use crate::interruptible::run;
use crate::observation::{Observation, observation_of};

/// Between two looks at Python's signals.
const NAP: Duration = Duration::from_millis(40);
/// Frames that are kept beside the one that the reader waits to hand on.
const AHEAD: usize = 1;

/// The frames of a BOP scene or of a bag, in order: an iterator of `Observation`, made by `read_observations`.
///
/// Reading begins at once, in a thread of its own, and stays up to two frames ahead of what was asked for; a source of any
/// length needs the memory of some frames. What nobody iterates any more is not read on. A process that was forked off has
/// no such thread: it raises `InvalidInput`.
#[pyclass(frozen, module = "semfm")]
pub struct Observations {
    source: PathBuf,
    /// The process that has the reader's thread.
    process: u32,
    /// Taken by whoever waits for the next frame, without the interpreter's lock.
    news: Mutex<Option<Receiver<News>>>,
    notes: Mutex<Vec<String>>,
}

enum News {
    Seen(Box<observe::Observation>),
    End(semfm::Result<SourceReport>),
}

impl Observations {
    fn open(py: Python<'_>, source: PathBuf, settings: SourceSettings) -> PyResult<Self> {
        let (tell, news) = sync_channel(AHEAD);
        let path = source.clone();
        let read = move || {
            let end = observe::read_observations(&path, &settings, |seen| tell_of(&tell, seen));
            // Nothing receives any more where the frames were left alone.
            let _ = tell.send(News::End(end.map_err(Into::into)));
        };
        let reader = std::thread::Builder::new().name("semfm-reader".into()).spawn(read);
        reader.map_err(|error| errors::no_threads(py, &error.to_string()))?;
        let process = std::process::id();
        Ok(Self { source, process, news: Mutex::new(Some(news)), notes: Mutex::default() })
    }

    fn is_forked(&self) -> bool {
        self.process != std::process::id()
    }

    /// Waits for news, but not for long; `None` after the end.
    fn nap(&self) -> Option<Result<News, RecvTimeoutError>> {
        let news = self.news.lock().unwrap_or_else(PoisonError::into_inner);
        news.as_ref().map(|news| news.recv_timeout(NAP))
    }

    /// Forgets the reader, which then ends.
    fn close(&self, py: Python<'_>) {
        py.detach(|| *self.news.lock().unwrap_or_else(PoisonError::into_inner) = None);
    }
}

/// Hands a frame on; an error where nobody wants it any more, which ends the reader.
fn tell_of(tell: &SyncSender<News>, seen: observe::Observation) -> observe::Result<()> {
    let told = tell.send(News::Seen(Box::new(seen)));
    told.map_err(|_| semfm::geom::Error::Cancelled.into())
}

impl Drop for Observations {
    fn drop(&mut self) {
        if self.is_forked() {
            // Locks may be taken by the reader, which is not here.
            let news = std::mem::replace(&mut self.news, Mutex::new(None));
            std::mem::forget(news);
        }
    }
}

#[pymethods]
impl Observations {
    /// list of str: what was chosen or left out (topics, messages without a counterpart), known at the end.
    #[getter]
    fn notes(&self) -> Vec<String> {
        self.notes.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn __iter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __next__(&self, py: Python<'_>) -> PyResult<Option<Observation>> {
        if self.is_forked() {
            let expected = "the process that opened them (open the source in each process)";
            return Err(errors::invalid(py, "observations", expected, "one forked off it"));
        }
        loop {
            let Some(news) = py.detach(|| self.nap()) else { return Ok(None) };
            match news {
                Ok(News::Seen(seen)) => return Ok(Some(Observation { inner: Arc::new(*seen) })),
                Ok(News::End(end)) => {
                    self.close(py);
                    let report = end.map_err(|error| errors::raise(py, &error))?;
                    *self.notes.lock().unwrap_or_else(PoisonError::into_inner) = report.notes;
                    return Ok(None);
                }
                Err(RecvTimeoutError::Timeout) => py.check_signals()?,
                Err(RecvTimeoutError::Disconnected) => {
                    self.close(py);
                    return Err(errors::internal(py, "the reader of frames vanished"));
                }
            }
        }
    }

    fn __repr__(&self) -> String {
        format!("Observations({:?})", self.source.display().to_string())
    }
}

/// The frames of a BOP scene or of a bag, as ``semfm-cli frames`` and ``semfm-cli track`` read them.
///
/// Parameters
/// ----------
/// source : path
///     A bag (`.mcap`, or a folder of them) or the folder of a BOP scene.
/// every : int, default 1
///     Take the first frame and each that is so many further on.
/// most : int, optional
///     Take at most so many.
/// color_topic : str, optional
///     Topic of the colour in a bag, where several could be meant.
/// depth_topic : str, optional
///     Topic of the depth, or of the clouds.
/// info_topic : str, optional
///     Topic of the camera; ``camera_info`` beside the depth where none is given.
/// fixed_frame : str, optional
///     Frame in which the camera's poses are given; the camera's own where none is given.
/// max_gap : float, default 0.03
///     Farthest apart that colour, depth and transforms of one frame may be, seconds.
///
/// Returns
/// -------
/// Observations
///     Reading begins at once and stays up to two frames ahead; what is wrong with the source is raised when the frame
///     is asked for that could not be read.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> import semfm, tempfile
/// >>> k = [[60, 0, 31.5], [0, 60, 23.5], [0, 0, 1]]
/// >>> frames = [semfm.Observation(k, depth=np.full((48, 64), z)) for z in (0.5, 0.6, 0.7)]
/// >>> with tempfile.TemporaryDirectory() as folder:
/// ...     path = semfm.write_observations(folder + "/seen.mcap", frames)
/// ...     for seen in semfm.read_observations(path, every=2):
/// ...         print(seen, round(float(seen.depth[0, 0]), 3))
/// Observation(64 × 48, depth) 0.5
/// Observation(64 × 48, depth) 0.7
#[pyfunction]
#[pyo3(signature = (
    source, *, every=1, most=None, color_topic=None, depth_topic=None, info_topic=None, fixed_frame=None, max_gap=0.03
))]
#[expect(clippy::too_many_arguments, reason = "keyword arguments, one per setting")]
pub fn read_observations(
    py: Python<'_>,
    source: PathBuf,
    every: usize,
    most: Option<usize>,
    color_topic: Option<String>,
    depth_topic: Option<String>,
    info_topic: Option<String>,
    fixed_frame: Option<String>,
    max_gap: f64,
) -> PyResult<Observations> {
    if every == 0 {
        return Err(errors::invalid(py, "every", "at least 1", "0"));
    }
    let bag = BagSettings {
        color: color_topic,
        depth: depth_topic,
        camera_info: info_topic,
        fixed_frame,
        ..BagSettings::default()
    };
    let bag = bag.with_max_gap(max_gap).map_err(|error| errors::raise(py, &error.into()))?;
    Observations::open(py, source, SourceSettings { bag, every, most })
}

/// Writes frames as ``semfm-cli frames`` does.
///
/// Parameters
/// ----------
/// path : path
///     A ROS 2 bag (``NAME.mcap``), or a folder, which becomes a BOP scene.
/// observations : list of Observation
///
/// Returns
/// -------
/// str
///     The path.
#[pyfunction]
pub fn write_observations(path: PathBuf, observations: &Bound<'_, PyAny>) -> PyResult<String> {
    let list = observations.try_iter();
    let list =
        list.map_err(|_| errors::wrong_type("observations", "Observations", observations))?;
    let frames = list.map(|seen| Ok(observation_of(&seen?)?.inner.clone()));
    let frames = frames.collect::<PyResult<Vec<_>>>()?;
    let written = path.display().to_string();
    run(observations.py(), None, move |_| Ok(observe::write_observations(&path, &frames)?))?;
    Ok(written)
}
