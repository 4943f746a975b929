//! Long work that can be watched and stopped.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::{Error, Result};

/// Where a long call stands: `done` of `total` steps of the named stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress<'a> {
    /// Stage name, as in the report's `stages_ms`.
    pub stage: &'a str,
    /// Steps finished so far.
    pub done: usize,
    /// Steps in all; 0 where it is not known.
    pub total: usize,
}

type Listener = Arc<dyn Fn(Progress<'_>) + Send + Sync>;

/// A cancel flag and a progress callback, handed down through every long call.
///
/// `Task::default()` listens to nothing and is never cancelled. Clones share flag and callback.
///
/// ```
/// use semfm_geom::Task;
/// let task = Task::default();
/// task.cancel();
/// assert!(task.check().is_err());
/// ```
#[derive(Clone, Default)]
pub struct Task {
    cancelled: Arc<AtomicBool>,
    listener: Option<Listener>,
}

impl Task {
    /// A task that reports its progress to `listener`, from whichever thread does the work.
    pub fn with_progress(listener: impl Fn(Progress<'_>) + Send + Sync + 'static) -> Self {
        Self { cancelled: Arc::default(), listener: Some(Arc::new(listener)) }
    }

    /// A task with the same cancel flag that reports nothing: for work inside other work that counts
    /// its own steps.
    #[must_use]
    pub fn silent(&self) -> Self {
        Self { cancelled: self.cancelled.clone(), listener: None }
    }

    /// The same task with somebody else's cancel flag (a signal handler's, say).
    pub fn with_cancel_flag(mut self, flag: Arc<AtomicBool>) -> Self {
        self.cancelled = flag;
        self
    }

    /// Asks the work to stop; it returns [`Error::Cancelled`] at its next check.
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    /// Fails with [`Error::Cancelled`] once [`cancel`](Self::cancel) was called.
    pub fn check(&self) -> Result<()> {
        if self.cancelled.load(Ordering::Relaxed) { Err(Error::Cancelled) } else { Ok(()) }
    }

    /// Reports progress and checks for cancellation, in one call for loops.
    pub fn step(&self, stage: &str, done: usize, total: usize) -> Result<()> {
        if let Some(listener) = &self.listener {
            listener(Progress { stage, done, total });
        }
        self.check()
    }
}

impl fmt::Debug for Task {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Task")
            .field("cancelled", &self.cancelled)
            .field("listener", &self.listener.is_some())
            .finish()
    }
}
