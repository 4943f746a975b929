//! One file for each command.

pub mod align;
pub mod completions;
pub mod demo;
pub mod embed;
pub mod eval;
pub mod eval_maps;
pub mod grasp;
pub mod info;
pub mod page;
pub mod region;
pub mod show;
pub mod transfer;
pub mod views;

/// How a sound run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// With an answer: exit 0.
    Done,
    /// Without one: exit 1.
    NoAnswer,
    /// With a verdict against the input, already told: exit 2.
    Refused,
}
