//! What the program says: answers on stdout, talk and progress on stderr.

use std::fmt::Display;
use std::io::{IsTerminal, Write};
use std::sync::Mutex;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use semfm::Task;

/// A line of data. A reader that has gone away (`| head`) is no failure.
pub fn say(line: impl Display) {
    let _ = writeln!(std::io::stdout(), "{line}");
}

/// A line of talk.
pub fn remark(line: impl Display) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// An error with the chain of its causes, each told once.
pub fn complain(error: &anyhow::Error) {
    let mut told = String::new();
    for cause in error.chain() {
        let text = cause.to_string();
        if !told.contains(&text) {
            told = if told.is_empty() { text } else { format!("{told}: {text}") };
        }
    }
    remark(format_args!("error: {told}"));
}

/// A task whose progress shows as a bar, on a terminal only.
pub fn watched(quiet: bool) -> Task {
    if quiet || !std::io::stderr().is_terminal() {
        return Task::default();
    }
    let style = ProgressStyle::with_template("{msg:>12} {bar:30} {pos}/{len}")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr()).with_style(style);
    let stage = Mutex::new(String::new());
    Task::with_progress(move |progress| {
        let Ok(mut stage) = stage.lock() else { return };
        if *stage != progress.stage {
            progress.stage.clone_into(&mut stage);
            bar.reset();
            bar.set_message(stage.clone());
        }
        bar.set_length(progress.total as u64);
        bar.set_position(progress.done as u64);
        if progress.done >= progress.total {
            bar.finish_and_clear();
        }
    })
}

/// As [`watched`], for long runs of one stage: with the time that is left. It is reckoned from the
/// first report on, so that what an interrupted run had done does not count as speed.
pub fn watched_with_time_left(quiet: bool) -> Task {
    if quiet || !std::io::stderr().is_terminal() {
        return Task::default();
    }
    let style = ProgressStyle::with_template("{prefix:>12} {bar:30} {pos}/{len} {msg}")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr()).with_style(style);
    let start = std::time::Instant::now();
    Task::with_progress(move |progress| {
        bar.set_prefix(progress.stage.to_owned());
        bar.set_length(progress.total as u64);
        bar.set_position(progress.done as u64);
        let left = progress.total.saturating_sub(progress.done) as f64;
        let each = start.elapsed().as_secs_f64() / progress.done.max(1) as f64;
        let seconds = (left * each).round() as u64;
        bar.set_message(format!("{}:{:02} left", seconds / 60, seconds % 60));
        if progress.done >= progress.total {
            bar.finish_and_clear();
        }
    })
}
