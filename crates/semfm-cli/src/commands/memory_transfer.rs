//! `semfm-cli transfer --memory`: what a memory says of an object.

use std::path::Path;
use std::time::Instant;

use anyhow::{Context, Result};
use semfm::files::{MemoryReportFile, Provenance};
use semfm::geom::io::{StagedFolder, printable, read_mesh};
use semfm::memory::{Memory, MemorySettings, MemoryTransfer};
use semfm::{Prepared, Verdict};
use semfm_show::{TransferFiles, write_memory_transfer};
use serde_json::json;

use super::encoder_options::EncoderOptions;
use super::{Outcome, memory_options};
use crate::console;
use crate::options::Common;

/// A question to a memory.
pub struct MemoryQuestion<'a> {
    pub memory: &'a Path,
    pub target: &'a Path,
    /// Embeddings of the target's views, where they are given.
    pub embeddings: Option<&'a Path>,
    pub encoder: &'a EncoderOptions,
    pub settings: MemorySettings,
    pub files: TransferFiles,
    pub no_cache: bool,
    pub seed: u64,
}

impl MemoryQuestion<'_> {
    /// Asks, writes every file into `folder`, prints the answer, and says how the run ended.
    pub fn answer(&self, folder: &Path, common: &Common) -> Result<Outcome> {
        let task = console::progress(common.quiet);
        let pipeline = memory_options::settings(self.no_cache, self.seed);
        let cache = pipeline.cache.clone();
        let memory = Memory::open(self.memory)?.with_settings(pipeline.clone());
        let file = read_mesh(self.target)?;
        let named = || self.target.display().to_string();
        let (given, own) = (self.embeddings, memory.encoder());
        let encoded =
            memory_options::embeddings(&file, given, self.encoder, own, &cache, &task, common)
                .with_context(named)?;
        let target = encoded.prepare(file.mesh, &pipeline, &task).with_context(named)?;
        let answer = memory.transfer(&target, &self.settings, &task)?;
        let start = Instant::now();
        let provenance =
            Provenance { version: Some(env!("CARGO_PKG_VERSION").into()), ..Provenance::default() };
        let staged = StagedFolder::new(folder)?;
        let report = MemoryReportFile::new(&memory, &target, &answer, provenance);
        write_memory_transfer(staged.path(), &target, &answer, &report, self.files, &task)?;
        let files = semfm::files::put_transfer(staged)?;
        let write_ms = start.elapsed().as_secs_f64() * 1e3;
        if common.json {
            console::data(json!({
                "verdict": answer.fused.verdict,
                "confidence": answer.fused.confidence,
                "agreement": answer.fused.agreement,
                "n_vertices": answer.fused.region.vertices().len(),
                "answers": answer.answers.iter().map(|said| json!({
                    "name": said.entry.name,
                    "kind": said.entry.kind,
                    "confidence": said.transfer.confidence,
                    "share": said.trust.share,
                })).collect::<Vec<_>>(),
                "files": files.iter().map(|file| file.display().to_string()).collect::<Vec<_>>(),
                "stages_ms": answer.stages_ms,
            }));
        } else {
            print(&answer, &target, write_ms, common);
            console::data("wrote");
            files.iter().for_each(|file| console::data(format_args!("  {}", file.display())));
        }
        let refused = answer.fused.verdict == Verdict::Refuse;
        Ok(if refused { Outcome::NoAnswer } else { Outcome::Done })
    }
}

fn print(answer: &MemoryTransfer, target: &Prepared, write_ms: f64, common: &Common) {
    let fused = &answer.fused;
    let (n, of) = (fused.region.vertices().len(), fused.region.n_vertices());
    console::data(format_args!(
        "verdict     {} (confidence {:.2})",
        fused.verdict, fused.confidence
    ));
    if let Some(why) = answer.why() {
        console::data(format_args!("why         {why}"));
    }
    console::data(format_args!("region      {n} of {of} vertices of the target"));
    console::data(format_args!(
        "asked       {} of {} demonstrations, which agree to {:.0} %",
        answer.answers.len(),
        answer.n_entries,
        100.0 * fused.agreement
    ));
    for said in &answer.answers {
        console::data(format_args!(
            "  {:24} {:3.0} % of the vote, alone {} (confidence {:.2})",
            printable(&said.entry.name),
            100.0 * said.trust.share,
            said.transfer.verdict,
            said.transfer.confidence
        ));
    }
    if fused.hypotheses.len() > 1 {
        let shares: Vec<String> =
            fused.hypotheses.iter().map(|h| format!("{:.0} %", 100.0 * h.probability)).collect();
        console::data(format_args!("places      {}", shares.join(", ")));
    }
    let prepared: f64 = target.report.stages_ms.iter().map(|(_, ms)| ms).sum();
    let total = prepared + answer.stages_ms.total_ms() + write_ms;
    console::data(format_args!("time        {total:.0} ms"));
    if common.verbose {
        for (name, ms) in answer.stages_ms.iter() {
            console::data(format_args!("  {name:20} {ms:8.1} ms"));
        }
    }
}
