//! Evaluation of transfers: datasets, methods, statistics, tables.
//!
//! A [`Dataset`] holds objects with a true region and ordered pairs among them: procedural ones, or a
//! folder of real meshes with labels. [`run()`] transfers the region of every pair by every
//! [`Variant`] and gives [`Results`]: a [`Row`] for each, sums and intervals ([`Summary`]), methods
//! against methods ([`Difference`]), and how well a method's confidence is calibrated
//! ([`Calibration`]); [`evaluate`] does the same in memory. [`table`] and [`report`] write them down,
//! [`compare`] compares them with an older run, [`vlm`] adds the rows of a vision-language model.
//!
//! [`run_memory`] asks memories of several demonstrations for every object ([`semfm::memory`]), [`run_kinds`] whether
//! objects of different kinds are told from those of one.
//! [`run_maps`] is the other evaluation: point maps against true correspondences.

mod bootstrap;
mod calibration;
pub mod compare;
mod correspondence;
pub mod dataset;
pub mod embeddings;
mod error;
mod evaluation;
mod journal;
mod kinds;
mod memory;
mod object;
mod output_folder;
mod prediction;
mod prepared_objects;
mod published;
pub mod report;
mod results;
mod row;
mod run;
mod settings;
mod summary;
pub mod table;
mod variant;
pub mod vlm;
pub mod workers;

pub use bootstrap::{BootstrapSettings, PairDraws, PairKey};
pub use calibration::{Calibration, RIGHT, ReliabilityBin, VerdictScore};
pub use correspondence::{
    AnnotatedMesh, CorrespondenceDataset, CorrespondenceSet, MAP_FORMAT, MapMethod, MapResults,
    MapRow, MapSettings, MapSummary, run_maps,
};
pub use dataset::Dataset;
pub use embeddings::EmbeddingSource;
pub use error::{Error, Result};
pub use journal::{RunIdentity, RunSettings};
pub use kinds::{KINDS_FORMAT, KindResults, KindRow, KindSummary, run_kinds};
pub use memory::{
    MEMORY_FORMAT, MemoryEvalSettings, MemoryResults, MemoryRow, MemorySummary, ScoredAnswer,
    run_memory,
};
pub use output_folder::OutputFolder;
pub use prepared_objects::PreparationSettings;
pub use report::ReportSettings;
pub use results::{About, Results};
pub use row::{AnchorRow, Failure, ObjectRow, Row, VlmDetails};
pub use run::{Finished, evaluate, run};
pub use settings::EvalSettings;
pub use summary::{Difference, POOR, Scope, ScoreTable, Summary};
pub use variant::{Features, Override, Variant};
