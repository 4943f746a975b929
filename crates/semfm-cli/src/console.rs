//! The two streams of the program: data on stdout, messages and progress on stderr.

use std::fmt::Display;
use std::io::{IsTerminal, Write};
use std::sync::Mutex;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use semfm::Task;

/// Prints a line of data. A reader that has gone away (`| head`) is no failure.
pub fn data(line: impl Display) {
    let _ = writeln!(std::io::stdout(), "{line}");
}

/// Prints a message.
pub fn message(line: impl Display) {
    let _ = writeln!(std::io::stderr(), "{line}");
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

/// As [`progress`], for long runs of one stage: with the time that is left. It is estimated from
/// the first report on, so that what an interrupted run had done does not count as speed.
pub fn progress_with_time_left(quiet: bool) -> Task {
    let Some(bar) = bar(quiet, "{prefix:>12} {bar:30} {pos}/{len} {msg}") else {
        return Task::default();
    };
    let start = std::time::Instant::now();
    Task::with_progress(move |progress| {
        let left = progress.total.saturating_sub(progress.done) as f64;
        let each = start.elapsed().as_secs_f64() / progress.done.max(1) as f64;
        let seconds = (left * each).round() as u64;
        bar.set_prefix(progress.stage.to_owned());
        bar.set_message(format!("{}:{:02} left", seconds / 60, seconds % 60));
        move_bar(&bar, progress.done, progress.total);
    })
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
