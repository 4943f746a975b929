//! SemFM at the shell: arguments in, facade calls, files out.
//!
//! stdout is data, stderr is messages. Exit codes: 0 success, 1 a sound run without an answer (verdict
//! `refuse`), 2 bad input or failure, a bug of ours included; 130 after Ctrl-C.

mod address_space;
mod commands;
mod console;
mod options;
mod output;
mod process;

use std::ffi::OsString;

use clap::{Parser, Subcommand};

use commands::{
    NoAnswer, Outcome, align, completions, demo, embed, eval, eval_maps, frames, grasp, ik, info,
    plan, region, remember, run, show, surface, track, transfer, views,
};
use options::Common;
pub use process::own_process;

/// Transfer a demonstrated region from one object to another.
///
/// A demonstration touches one object (the handle of a mug). SemFM finds where to act on a different
/// object of the same kind (a kettle).
#[derive(Debug, Parser)]
#[command(version, propagate_version = true, after_help = "Start with:  semfm-cli demo")]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    common: Common,
}

#[derive(Debug, Subcommand)]
enum Command {
    Demo(demo::DemoCommand),
    Views(views::ViewsCommand),
    Embed(embed::EmbedCommand),
    Region(Box<region::RegionCommand>),
    Frames(Box<frames::FramesCommand>),
    Run(run::RunCommand),
    Surface(Box<surface::SurfaceCommand>),
    Track(Box<track::TrackCommand>),
    Transfer(Box<transfer::TransferCommand>),
    Remember(remember::RememberCommand),
    Grasp(Box<grasp::GraspCommand>),
    Show(show::ShowCommand),
    Align(Box<align::AlignCommand>),
    Eval(Box<eval::EvalCommand>),
    EvalMaps(eval_maps::EvalMapsCommand),
    Ik(Box<ik::IkCommand>),
    Plan(Box<plan::PlanCommand>),
    Info(info::InfoCommand),
    Completions(completions::CompletionsCommand),
}

/// Runs one command line, the program's name first, and returns the exit code: 0 success, 1 a sound
/// run without an answer, 2 bad input or failure, 130 after Ctrl-C. The binary and the Python package
/// call it.
pub fn run<T: Into<OsString> + Clone>(arguments: impl IntoIterator<Item = T>) -> u8 {
    console::begin();
    let words: Vec<OsString> = arguments.into_iter().map(Into::into).collect();
    let code = match process::caught(|| run_words(words)) {
        Ok(code) => code,
        Err(bug) => {
            console::message(format_args!("error: {bug}"));
            2
        }
    };
    match console::end() {
        Ok(()) => code,
        Err(error) => {
            console::message(format_args!("error: stdout: {error}"));
            2
        }
    }
}

fn run_words(words: Vec<OsString>) -> u8 {
    let arguments = match Arguments::try_parse_from(&words) {
        Ok(arguments) => arguments,
        Err(error) if !error.use_stderr() => {
            // Help and version are data. `render` leaves colours to the terminal.
            console::help(&error.render());
            return 0;
        }
        Err(error) => {
            console::usage(&error, &words);
            return 2;
        }
    };
    let common = arguments.common;
    let run = || match arguments.command {
        Command::Demo(command) => command.run(&common),
        Command::Views(command) => command.run(&common),
        Command::Embed(command) => command.run(&common),
        Command::Region(command) => command.run(&common),
        Command::Frames(command) => command.run(&common),
        Command::Run(command) => command.run(&common),
        Command::Surface(command) => command.run(&common),
        Command::Track(command) => command.run(&common),
        Command::Transfer(command) => command.run(&common),
        Command::Remember(command) => command.run(&common),
        Command::Grasp(command) => command.run(&common),
        Command::Show(command) => command.run(&common),
        Command::Align(command) => command.run(&common),
        Command::Eval(command) => command.run(&common),
        Command::EvalMaps(command) => command.run(&common),
        Command::Ik(command) => command.run(&common),
        Command::Plan(command) => command.run(&common),
        Command::Info(command) => command.run(&common),
        Command::Completions(command) => command.run(),
    };
    let outcome = common.workers().and_then(|workers| workers.install(run));
    match outcome {
        Ok(Outcome::Done) => 0,
        Ok(Outcome::NoAnswer) => 1,
        Ok(Outcome::Refused) => 2,
        Ok(Outcome::Interrupted) => process::INTERRUPTED,
        Err(error) => {
            console::error(&error);
            if error.is::<NoAnswer>() { 1 } else { 2 }
        }
    }
}

/// The command line itself, for completions and for the test that checks it.
fn command_line() -> clap::Command {
    <Arguments as clap::CommandFactory>::command()
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_command_line_is_consistent() {
        super::command_line().debug_assert();
    }

    #[test]
    fn every_command_shows_an_example() {
        for command in super::command_line().get_subcommands() {
            let help = command.get_after_help().map(ToString::to_string).unwrap_or_default();
            assert!(help.contains("semfm-cli"), "{} has no example", command.get_name());
        }
    }
}
