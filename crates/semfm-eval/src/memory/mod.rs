//! What a memory of demonstrations is worth: every object is the target once, and others of its kind are its
//! memory.

mod draws;
mod results;
mod run;
mod table;

pub use results::{MEMORY_FORMAT, MemoryResults, MemoryRow, MemorySummary, ScoredAnswer};
pub use run::{MemoryEvalSettings, run_memory};
