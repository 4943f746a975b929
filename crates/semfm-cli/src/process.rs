//! What a process of its own needs to end with an exit code of ours, whatever happens: bugs, a full
//! disk, no memory, Ctrl-C.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Exit code after Ctrl-C, as shells have it (128 + SIGINT).
pub const INTERRUPTED: u8 = 130;

/// Where the last panic was.
static PLACE: Mutex<String> = Mutex::new(String::new());

/// Prepares a process that does nothing but run one command: call it first.
///
/// A panic prints nothing by itself, for the command says what happened. On Unix, a file beyond the
/// limit of the process (`ulimit -f`) becomes an error of the write instead of a signal, and an abort
/// (memory that is not there, a fault inside a library) ends with exit code 2 instead of a signal.
pub fn own_process() {
    std::panic::set_hook(Box::new(|panic| {
        let place = panic.location().map(ToString::to_string).unwrap_or_default();
        *PLACE.lock().unwrap_or_else(PoisonError::into_inner) = place;
    }));
    #[cfg(unix)]
    signals::prepare();
}

/// Runs `work`; a panic in it comes back as words for the user.
pub fn caught<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|panic| {
        let place = PLACE.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let place = if place.is_empty() { place } else { format!(" ({place})") };
        format!("a bug in semfm, please report it: {}{place}", words_of(&*panic))
    })
}

fn words_of(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<&str>().copied();
    text.or_else(|| panic.downcast_ref::<String>().map(String::as_str)).unwrap_or("no words")
}

/// While it lives, Ctrl-C sets a flag instead of ending the process; a second Ctrl-C ends it at once.
/// Only commands that can say how to go on listen: the others end as any program does.
pub struct CtrlC {
    flag: Arc<AtomicBool>,
    #[cfg(unix)]
    _handler: signals::Handler,
}

impl CtrlC {
    /// Listens from now on.
    pub fn listen() -> Self {
        static FLAG: OnceLock<Arc<AtomicBool>> = OnceLock::new();
        let flag = FLAG.get_or_init(Arc::default);
        flag.store(false, Ordering::Relaxed);
        Self {
            flag: flag.clone(),
            #[cfg(unix)]
            _handler: signals::Handler::set(flag),
        }
    }

    /// The flag, for a task.
    pub fn flag(&self) -> Arc<AtomicBool> {
        self.flag.clone()
    }

    /// Whether it was pressed.
    pub fn was_pressed(&self) -> bool {
        self.flag.load(Ordering::Relaxed)
    }
}

#[cfg(unix)]
#[allow(unsafe_code)]
mod signals {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, AtomicPtr, Ordering};

    pub fn prepare() {
        // SAFETY: the handler is async-signal-safe (`write` and `_exit` alone), and ignoring a signal
        // has no handler.
        unsafe {
            libc::signal(libc::SIGXFSZ, libc::SIG_IGN);
            libc::signal(libc::SIGABRT, on_abort as *const () as libc::sighandler_t);
        }
    }

    extern "C" fn on_abort(_signal: libc::c_int) {
        let words =
            b"error: the system refused memory, or a library gave up; nothing more is known\n";
        // SAFETY: both calls are async-signal-safe, and the bytes are static.
        unsafe {
            libc::write(2, words.as_ptr().cast(), words.len());
            libc::_exit(2);
        }
    }

    static INTERRUPT: AtomicPtr<AtomicBool> = AtomicPtr::new(std::ptr::null_mut());

    /// The handler of SIGINT, until it is dropped: then the one before is back.
    pub struct Handler {
        before: libc::sighandler_t,
    }

    impl Handler {
        pub fn set(flag: &'static Arc<AtomicBool>) -> Self {
            INTERRUPT.store(Arc::as_ptr(flag).cast_mut(), Ordering::Release);
            // SAFETY: the handler is async-signal-safe: it reads and sets atomics, and calls `_exit`.
            let before = unsafe {
                libc::signal(libc::SIGINT, on_interrupt as *const () as libc::sighandler_t)
            };
            Self { before }
        }
    }

    impl Drop for Handler {
        fn drop(&mut self) {
            if self.before != libc::SIG_ERR {
                // SAFETY: what the system gave as the handler before is set again.
                unsafe { libc::signal(libc::SIGINT, self.before) };
            }
        }
    }

    extern "C" fn on_interrupt(_signal: libc::c_int) {
        let flag = INTERRUPT.load(Ordering::Acquire);
        // SAFETY: the pointer is null or that of a value that a static holds, which is never dropped;
        // `_exit` is async-signal-safe.
        unsafe {
            if flag.is_null() || (*flag).swap(true, Ordering::Relaxed) {
                libc::_exit(i32::from(super::INTERRUPTED));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_words() {
        let words = caught(|| panic!("index {} is gone", 7)).unwrap_err();
        assert!(words.contains("index 7 is gone") && words.contains("report"), "{words}");
        assert_eq!(caught(|| 3), Ok(3));
    }
}
