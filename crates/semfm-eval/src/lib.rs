//! Evaluation of transfers: datasets, methods, statistics, tables.
//!
//! A [`Dataset`] holds objects with a true region and ordered pairs among them: procedural ones, or a
//! folder of real meshes with labels. [`run()`](run::run) carries the region of every pair by every
//! [`Candidate`] and gives [`Results`]: a [`Row`](row::Row) for each, sums and intervals
//! ([`summary`]), methods against methods, and what a method's confidence is worth ([`trust`]).
//! [`table`] writes them down, [`compare`] holds them against an older run, [`published`] quotes the
//! paper. [`matching`] is the other evaluation: point maps against true correspondences.

pub mod actor;
pub mod bootstrap;
pub mod candidate;
pub mod compare;
pub mod dataset;
pub mod embeddings;
mod error;
pub mod journal;
pub mod matching;
pub mod prediction;
pub mod published;
pub mod results;
pub mod row;
pub mod run;
pub mod summary;
pub mod table;
pub mod trust;
pub mod vlm;
pub mod workers;

pub use candidate::{Candidate, Override};
pub use dataset::Dataset;
pub use embeddings::{EmbeddingSource, Encoder};
pub use error::{Error, Result};
pub use results::Results;
pub use run::{EvalSettings, run};
