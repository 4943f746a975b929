//! The two streams of the program: data on stdout, messages and progress on stderr. What is printed
//! may be other people's text (names of files, what a file says), so all of it is made safe for a
//! terminal here.

use std::fmt::Display;
use std::io::{ErrorKind, IsTerminal, Read, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use semfm::Task;
use semfm::geom::io::printable;

/// Whether a file goes to stdout: what would be printed there goes to stderr then.
static STDOUT_IS_RESERVED: AtomicBool = AtomicBool::new(false);

/// Why stdout could not be written, if it could not.
static FAILURE: Mutex<Option<std::io::Error>> = Mutex::new(None);

/// Begins a command: a process may run several, one after another.
pub fn begin() {
    STDOUT_IS_RESERVED.store(false, Ordering::Relaxed);
    *FAILURE.lock().unwrap_or_else(PoisonError::into_inner) = None;
}

/// Gives stdout to a file: [`data`] goes to stderr from now on.
pub fn reserve_stdout() {
    STDOUT_IS_RESERVED.store(true, Ordering::Relaxed);
}

/// Prints a line of data. That it could not be written is told by [`end`].
pub fn data(line: impl Display) {
    let line = line.to_string();
    if STDOUT_IS_RESERVED.load(Ordering::Relaxed) {
        return message(line);
    }
    note(writeln!(std::io::stdout(), "{}", printable(&line)));
}

/// Prints help, in colours on a terminal.
pub fn help(text: &clap::builder::StyledStr) {
    let mut stdout = std::io::stdout();
    let written = if stdout.is_terminal() {
        write!(stdout, "{}", text.ansi())
    } else {
        write!(stdout, "{text}")
    };
    note(written);
}

/// Prints what is wrong with a command line; words that a terminal would obey are quoted by it, so
/// they are made safe, at the price of the colours.
pub fn usage(error: &clap::Error, words: &[std::ffi::OsString]) {
    let is_plain = |word: &std::ffi::OsString| {
        let word = word.to_string_lossy();
        printable(&word) == word
    };
    if words.iter().all(is_plain) {
        let _ = error.print();
    } else {
        message(error.render().to_string().trim_end());
    }
}

/// Sends a file to stdout as it is.
pub fn copy_to_stdout(file: &mut impl Read) {
    note(std::io::copy(file, &mut std::io::stdout()).map(|_| ()));
}

/// Ends a command: an error where its answer did not get through. A reader that has gone away
/// (`| head`) is no failure.
pub fn end() -> std::io::Result<()> {
    note(std::io::stdout().flush());
    match FAILURE.lock().unwrap_or_else(PoisonError::into_inner).take() {
        Some(error) => Err(error),
        None => Ok(()),
    }
}

/// Keeps the first failure.
fn note(written: std::io::Result<()>) {
    if let Err(error) = written
        && error.kind() != ErrorKind::BrokenPipe
    {
        let mut failure = FAILURE.lock().unwrap_or_else(PoisonError::into_inner);
        failure.get_or_insert(error);
    }
}

/// Prints a message.
pub fn message(line: impl Display) {
    let _ = writeln!(std::io::stderr(), "{}", printable(&line.to_string()));
}

/// Prints an error with the chain of its causes, each once.
pub fn error(error: &anyhow::Error) {
    let mut chain = String::new();
    for cause in error.chain() {
        let text = cause.to_string();
        if !chain.contains(&text) {
            chain = if chain.is_empty() { text } else { format!("{chain}: {text}") };
        }
    }
    message(format_args!("error: {chain}"));
}

/// A task whose progress shows as a bar, on a terminal only.
pub fn progress(quiet: bool) -> Task {
    let Some(bar) = bar(quiet, "{msg:>12} {bar:30} {pos}/{len}") else { return Task::default() };
    let stage = Mutex::new(String::new());
    Task::with_progress(move |progress| {
        let Ok(mut stage) = stage.lock() else { return };
        if *stage != progress.stage {
            progress.stage.clone_into(&mut stage);
            bar.reset();
            bar.set_message(stage.clone());
        }
        move_bar(&bar, progress.done, progress.total);
    })
}

/// A task that shows how much is done where nobody knows how much there is, on a terminal only.
pub fn count(quiet: bool) -> Task {
    let Some(bar) = bar(quiet, "{msg:>12} {pos}") else { return Task::default() };
    Task::with_progress(move |progress| {
        bar.set_message(progress.stage.to_owned());
        bar.set_position(progress.done as u64);
        if progress.total > 0 {
            bar.finish_and_clear();
        }
    })
}

/// As [`progress`], for long runs of one stage: with the time that is left, and off a terminal a line
/// now and then. The time is estimated from the first report on, so that what an interrupted run had
/// done does not count as speed.
pub fn progress_with_time_left(quiet: bool) -> Task {
    if quiet {
        return Task::default();
    }
    let start = Instant::now();
    let Some(bar) = bar(quiet, "{prefix:>12} {bar:30} {pos}/{len} {msg}") else {
        return progress_lines(start);
    };
    Task::with_progress(move |progress| {
        bar.set_prefix(progress.stage.to_owned());
        bar.set_message(time_left(start, progress.done, progress.total));
        move_bar(&bar, progress.done, progress.total);
    })
}

/// Between two lines of progress where no terminal shows a bar.
const BETWEEN_LINES: Duration = Duration::from_secs(20);
/// The first line comes sooner: it says how long all of it will take.
const FIRST_LINE: Duration = Duration::from_secs(5);

fn progress_lines(start: Instant) -> Task {
    let next = Mutex::new(start + FIRST_LINE);
    Task::with_progress(move |progress| {
        let Ok(mut next) = next.lock() else { return };
        if Instant::now() < *next || progress.done >= progress.total {
            return;
        }
        *next = Instant::now() + BETWEEN_LINES;
        let left = time_left(start, progress.done, progress.total);
        message(format_args!(
            "{} {}/{}, about {left}",
            progress.stage, progress.done, progress.total
        ));
    })
}

/// `M:SS left`, from the mean of what is done.
fn time_left(start: Instant, done: usize, total: usize) -> String {
    let left = total.saturating_sub(done) as f64;
    let each = start.elapsed().as_secs_f64() / done.max(1) as f64;
    let seconds = (left * each).round() as u64;
    format!("{}:{:02} left", seconds / 60, seconds % 60)
}

/// A bar, unless nobody would see it.
fn bar(quiet: bool, template: &str) -> Option<ProgressBar> {
    if quiet || !std::io::stderr().is_terminal() {
        return None;
    }
    let style =
        ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
    Some(ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr()).with_style(style))
}

fn move_bar(bar: &ProgressBar, done: usize, total: usize) {
    bar.set_length(total as u64);
    bar.set_position(done as u64);
    if done >= total {
        bar.finish_and_clear();
    }
}
