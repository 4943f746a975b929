//! Evaluation of transfers: datasets, methods, statistics, tables.
//!
//! A [`Dataset`] holds objects with a true region and ordered pairs among them: procedural ones, or a
//! folder of real meshes with labels. [`run()`](run::run) transfers the region of every pair by every
//! [`Variant`] and gives [`Results`]: a [`Row`](row::Row) for each, sums and intervals
//! ([`summary`]), methods against methods, and how well a method's confidence is calibrated
//! ([`calibration`]). [`table`] writes them down, [`compare`] compares them with an older run,
//! [`published`] quotes the paper. [`run_maps`] is the other evaluation: point maps against true
//! correspondences.

pub mod bootstrap;
pub mod calibration;
pub mod compare;
mod correspondence;
pub mod dataset;
pub mod embeddings;
mod error;
mod evaluation;
pub mod journal;
mod object;
mod prediction;
pub mod published;
pub mod report;
pub mod results;
pub mod row;
pub mod run;
mod settings;
pub mod summary;
pub mod table;
pub mod variant;
pub mod vlm;
pub mod workers;

pub use correspondence::{
    CorrespondenceDataset, CorrespondenceSet, MAP_FORMAT, MapMethod, MapResults, MapRow,
    MapSettings, MapSummary, run_maps,
};
pub use dataset::Dataset;
pub use embeddings::{EmbeddingSource, Encoder};
pub use error::{Error, Result};
pub use report::ReportSettings;
pub use results::Results;
pub use run::{Finished, evaluate, run};
pub use settings::EvalSettings;
pub use variant::{Override, Variant};
