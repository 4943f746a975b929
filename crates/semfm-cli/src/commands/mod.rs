//! One file for each command: it reads arguments, calls the library and prints.

pub mod align;
pub mod completions;
pub mod demo;
pub mod embed;
mod encoder_options;
pub mod eval;
pub mod eval_maps;
mod frame_options;
pub mod frames;
pub mod grasp;
mod hand_options;
pub mod ik;
pub mod info;
mod memory_options;
mod memory_transfer;
mod motion_options;
pub mod plan;
pub mod region;
pub mod remember;
mod report_options;
pub mod run;
pub mod show;
mod size;
pub mod surface;
pub mod track;
pub mod transfer;
mod transfer_output;
pub mod views;

/// Why sound input has no answer: reported as an error, exit 1.
#[derive(Debug)]
pub struct NoAnswer(pub String);

impl std::fmt::Display for NoAnswer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for NoAnswer {}

/// How a sound run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// With an answer: exit 0.
    Done,
    /// Without one: exit 1.
    NoAnswer,
    /// With a verdict against the input, already printed: exit 2.
    Refused,
    /// By Ctrl-C, which was answered: exit 130.
    Interrupted,
}
