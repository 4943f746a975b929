//! Long work away from the interpreter: lock released, Ctrl-C heard, progress told, panics caught.
//!
//! Work runs on a thread pool of ours while the calling thread waits in short naps and asks Python
//! for signals in between. Interrupted work is told to stop and then left alone: it holds only
//! shared values, ends at its next check, and its result goes nowhere. So the answer to Ctrl-C does
//! not wait for the longest step between two checks.

use std::any::Any;
use std::cell::Cell;
use std::collections::HashMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, Once, PoisonError};
use std::time::Duration;

use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use semfm::Task;

use crate::errors;

/// Between two looks at Python's signals.
const NAP: Duration = Duration::from_millis(40);

enum News<T> {
    Progress(String, usize, usize),
    End(std::thread::Result<semfm::Result<T>>),
}

/// Runs `work` without the interpreter's lock.
///
/// `progress` is `None` or `False`, `True` for a bar, or a callable of stage, done and total, which
/// is called on the calling thread; an exception in it stops the work and is passed on.
pub fn run<T: Send + 'static>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Task) -> semfm::Result<T> + Send + 'static,
) -> PyResult<T> {
    let listener = Listener::new(py, progress)?;
    let mut furthest = Furthest::default();
    let (tell, mut news) = channel();
    let task = match &listener {
        Listener::Silent => Task::default(),
        _ => {
            let tell = Mutex::new(tell.clone());
            Task::with_progress(move |step| {
                let event = News::Progress(step.stage.to_owned(), step.done, step.total);
                // Nothing receives any more where the work was left alone.
                let _ = tell.lock().unwrap_or_else(PoisonError::into_inner).send(event);
            })
        }
    };
    let on_worker = task.clone();
    pool(py)?.spawn(move || {
        let end = catch_unwind(AssertUnwindSafe(|| work(&on_worker)));
        let _ = tell.send(News::End(end));
    });
    let result = loop {
        let (event, again) = py.detach(move || nap(news));
        news = again;
        let stop = match event {
            Ok(News::End(Ok(result))) => break result.map_err(|error| errors::raise(py, &error)),
            Ok(News::End(Err(panic))) => break Err(errors::internal(py, &message_of(&*panic))),
            Ok(News::Progress(stage, done, total)) if furthest.is_passed(&stage, done, total) => {
                listener.tell(&stage, done, total)
            }
            Ok(News::Progress(..)) => Ok(()),
            Err(RecvTimeoutError::Timeout) => Ok(()),
            Err(RecvTimeoutError::Disconnected) => {
                break Err(errors::internal(py, "a worker thread vanished"));
            }
        };
        if let Err(error) = stop.and_then(|()| py.check_signals()) {
            task.cancel();
            break Err(error);
        }
    };
    listener.close();
    result
}

/// How far each stage has come. Two objects are prepared side by side and tell of the same stages: what
/// is behind the one that is further is not told, so that nobody sees a count go back.
#[derive(Default)]
struct Furthest(HashMap<String, f64>);

impl Furthest {
    fn is_passed(&mut self, stage: &str, done: usize, total: usize) -> bool {
        let share = if total == 0 { done as f64 } else { done as f64 / total as f64 };
        match self.0.get_mut(stage) {
            Some(furthest) if share > *furthest => *furthest = share,
            Some(_) => return false,
            None => drop(self.0.insert(stage.to_owned(), share)),
        }
        true
    }
}

type Event<T> = Result<News<T>, RecvTimeoutError>;

fn nap<T>(news: Receiver<News<T>>) -> (Event<T>, Receiver<News<T>>) {
    (news.recv_timeout(NAP), news)
}

/// Short work on the calling thread, under the interpreter's lock: only its panics are caught.
pub fn guard<T>(py: Python<'_>, work: impl FnOnce() -> semfm::Result<T>) -> PyResult<T> {
    ended(py, caught(work))
}

/// Work of milliseconds on the calling thread, without the interpreter's lock. To hand it to another thread and back
/// would take longer; Ctrl-C is heard when it ends.
pub fn direct<T: Send>(
    py: Python<'_>,
    work: impl FnOnce() -> semfm::Result<T> + Send,
) -> PyResult<T> {
    let end = py.detach(|| caught(work));
    ended(py, end)
}

fn caught<T>(work: impl FnOnce() -> semfm::Result<T>) -> std::thread::Result<semfm::Result<T>> {
    IS_OURS.with(|ours| ours.set(true));
    let end = catch_unwind(AssertUnwindSafe(work));
    IS_OURS.with(|ours| ours.set(false));
    end
}

fn ended<T>(py: Python<'_>, end: std::thread::Result<semfm::Result<T>>) -> PyResult<T> {
    match end {
        Ok(result) => result.map_err(|error| errors::raise(py, &error)),
        Err(panic) => Err(errors::internal(py, &message_of(&*panic))),
    }
}

/// Who hears of progress.
enum Listener<'py> {
    Silent,
    Callable(Bound<'py, PyAny>),
    Bar(Bound<'py, PyAny>),
}

impl<'py> Listener<'py> {
    fn new(py: Python<'py>, progress: Option<&Bound<'py, PyAny>>) -> PyResult<Self> {
        let Some(progress) = progress.filter(|progress| !progress.is_none()) else {
            return Ok(Self::Silent);
        };
        if let Ok(wanted) = progress.extract::<bool>() {
            if !wanted {
                return Ok(Self::Silent);
            }
            return Ok(Self::Bar(py.import("semfm._progress")?.getattr("Bar")?.call0()?));
        }
        if progress.is_callable() {
            return Ok(Self::Callable(progress.clone()));
        }
        Err(errors::wrong_type("progress", "a bool or a callable(stage, done, total)", progress))
    }

    fn tell(&self, stage: &str, done: usize, total: usize) -> PyResult<()> {
        match self {
            Self::Silent => Ok(()),
            Self::Callable(listener) | Self::Bar(listener) => {
                listener.call1((stage, done, total)).map(drop)
            }
        }
    }

    fn close(&self) {
        if let Self::Bar(bar) = self {
            // A bar that cannot be closed is no reason to lose the answer.
            let _ = bar.call_method0("close");
        }
    }
}

struct Pool {
    process: u32,
    threads: Arc<ThreadPool>,
}

static POOL: Mutex<Option<Pool>> = Mutex::new(None);

/// The pool of this process. A forked child has none of its parent's threads and gets its own.
fn pool(py: Python<'_>) -> PyResult<Arc<ThreadPool>> {
    let mut pool = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    let process = std::process::id();
    match &*pool {
        Some(found) if found.process == process => Ok(Arc::clone(&found.threads)),
        _ => {
            let threads = build(py, 0)?;
            let fresh = Pool { process, threads: Arc::clone(&threads) };
            // The parent's pool is not dropped: its locks may be taken by threads that are not here.
            std::mem::forget(pool.replace(fresh));
            Ok(threads)
        }
    }
}

fn build(py: Python<'_>, n_threads: usize) -> PyResult<Arc<ThreadPool>> {
    ThreadPoolBuilder::new()
        .num_threads(n_threads)
        .thread_name(|i| format!("semfm-{i}"))
        .start_handler(|_| IS_OURS.with(|ours| ours.set(true)))
        .build()
        .map(Arc::new)
        .map_err(|error| errors::no_threads(py, &error.to_string()))
}

/// Sets the number of worker threads of later calls. Results do not depend on it.
///
/// Parameters
/// ----------
/// n_threads : int
///     Threads; 0 takes one for each core (or `RAYON_NUM_THREADS`).
///
/// Examples
/// --------
/// >>> import semfm
/// >>> semfm.set_num_threads(2)
/// >>> semfm.get_num_threads()
/// 2
/// >>> semfm.set_num_threads(0)
#[pyfunction]
pub fn set_num_threads(py: Python<'_>, n_threads: usize) -> PyResult<()> {
    if n_threads > 1024 {
        return Err(errors::invalid(py, "n_threads", "0 to 1024", &n_threads.to_string()));
    }
    let threads = build(py, n_threads)?;
    let fresh = Pool { process: std::process::id(), threads };
    *POOL.lock().unwrap_or_else(PoisonError::into_inner) = Some(fresh);
    Ok(())
}

/// The number of worker threads.
///
/// Returns
/// -------
/// int
#[pyfunction]
pub fn get_num_threads(py: Python<'_>) -> PyResult<usize> {
    Ok(pool(py)?.current_num_threads())
}

/// Panics or waits, as asked: for the tests of this package.
#[pyfunction]
#[pyo3(signature = (what, seconds=0.0, progress=None))]
pub fn _work_for_tests(
    py: Python<'_>,
    what: String,
    seconds: f64,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<()> {
    if what == "panic here" {
        return guard(py, || panic!("on purpose, on the calling thread"));
    }
    run(py, progress, move |task| {
        let steps = (seconds * 100.0) as usize;
        for step in 0..steps {
            std::thread::sleep(Duration::from_millis(10));
            if what == "sleep" {
                task.step("sleep", step + 1, steps)?;
            }
        }
        assert!(what != "panic", "on purpose, on a worker");
        Ok(())
    })
}

thread_local! {
    /// Whether a panic on this thread will be caught and raised.
    static IS_OURS: Cell<bool> = const { Cell::new(false) };
}

/// Where the last panic of ours was.
static LAST_PANIC: Mutex<Option<(String, String)>> = Mutex::new(None);

/// Keeps panics that become exceptions from being printed as well.
pub fn silence_panics() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            if !IS_OURS.with(Cell::get) {
                return before(panic);
            }
            let place = panic.location().map(ToString::to_string).unwrap_or_default();
            let mut last = LAST_PANIC.lock().unwrap_or_else(PoisonError::into_inner);
            *last = Some((text_of(panic.payload()), place));
        }));
    });
}

fn message_of(payload: &(dyn Any + Send)) -> String {
    let text = text_of(payload);
    let last = LAST_PANIC.lock().unwrap_or_else(PoisonError::into_inner);
    match &*last {
        Some((message, place)) if *message == text => format!("{text} ({place})"),
        _ => text,
    }
}

fn text_of(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().copied();
    let text = text.or_else(|| payload.downcast_ref::<String>().map(String::as_str));
    text.unwrap_or("a panic without words").to_owned()
}
