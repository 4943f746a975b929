//! The answer of a memory: the demonstrations that an object resembles, each transferred, and fused.

use std::sync::Arc;
use std::time::Instant;

use rayon::prelude::*;
use semfm_fmap::fusion::{Answer, FusedAnswer, FusionSettings, Trust, fuse};
use semfm_fmap::{Matching, Method, Stages};
use semfm_geom::{Mesh, Task, Verdict};

use super::Candidate;
use super::Memory;
use super::entry_objects::EntryObject;
use super::shortlist::similarity_of_kinds;
use crate::encoded_objects::milliseconds_since;
use crate::files::{EntryRecord, MemoryEncoder};
use crate::{Error, Prepared, Region, Result, Transfer};

/// How a memory answers.
#[derive(Clone, Debug)]
pub struct MemorySettings {
    /// Demonstrations that are matched, the most similar of all.
    pub shortlist: usize,
    /// Only demonstrations of this kind.
    pub kind: Option<String>,
    /// How their answers are fused.
    pub fusion: FusionSettings,
}

impl Default for MemorySettings {
    /// Five demonstrations: what more of them add is within the noise (`bench/README.md`), and each costs a
    /// matching.
    fn default() -> Self {
        Self { shortlist: 5, kind: None, fusion: FusionSettings::default() }
    }
}

/// What a memory says of a target.
#[derive(Clone, Debug)]
pub struct MemoryTransfer {
    /// The answer.
    pub fused: FusedAnswer,
    /// What each demonstration said, the most trusted first.
    pub answers: Vec<EntryAnswer>,
    /// Demonstrations of the memory.
    pub n_entries: usize,
    /// The method that matched.
    pub method: Method,
    /// Milliseconds by stage: `shortlist`, `objects` (those of the entries), `match`, `fuse`.
    pub stages_ms: Stages,
}

/// One demonstration and what it said.
#[derive(Clone, Debug)]
pub struct EntryAnswer {
    /// The entry.
    pub entry: EntryRecord,
    /// Cosine of its mean feature with that of the target.
    pub similarity: f64,
    /// How far it was trusted, and how it agreed with the others.
    pub trust: Trust,
    /// Its own answer.
    pub transfer: Transfer,
    object: Arc<EntryObject>,
}

impl EntryAnswer {
    /// The demonstrated object.
    pub fn source(&self) -> &Prepared {
        &self.object.prepared
    }

    /// Its mesh.
    pub fn mesh(&self) -> &Mesh {
        self.object.prepared.object.shape().original()
    }

    /// The region on it.
    pub fn region(&self) -> &Region {
        &self.object.region
    }
}

impl Memory {
    /// Carries what was demonstrated to a target, which must be prepared with features by the encoder of the
    /// memory ([`Memory::encoder`]), with the same rotations. The answer does not depend on the order in which
    /// demonstrations were added.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a memory without demonstrations (of that kind), a shortlist of none, and features by
    /// another encoder; [`Error::Format`] and [`Error::Geom`] for an entry whose files cannot be read, or on
    /// cancellation; [`Error::Fmap`] where matching fails.
    pub fn transfer(
        &self,
        target: &Prepared,
        settings: &MemorySettings,
        task: &Task,
    ) -> Result<MemoryTransfer> {
        self.check_answerable(target, settings)?;
        let mut stages_ms = Stages::default();
        let mut start = Instant::now();
        let mut book = |stage: &'static str| {
            stages_ms.push(stage, milliseconds_since(start));
            start = Instant::now();
        };
        let plain = target.object.plain_features();
        let chosen = self.candidates(plain, settings.kind.as_deref(), settings.shortlist);
        book("shortlist");
        let objects = chosen.par_iter().map(|candidate| self.object(candidate, task));
        let objects = objects.collect::<Result<Vec<_>>>()?;
        book("objects");
        let transfers = objects.par_iter().map(|object| {
            let (source, target) = (&object.prepared.object, &target.object);
            Ok(Matching::new(source, target, &self.settings().transfer, task)?
                .transfer(&object.region)?)
        });
        let mut transfers = transfers.collect::<Result<Vec<_>>>()?;
        if target.object.confidence_weights().likeness.is_none()
            && let Some(scale) = similarity_of_kinds(self.entries())
        {
            let said = transfers.into_iter().zip(&chosen);
            let probability = |similarity| scale.probability_of_one_kind(similarity);
            transfers = said
                .map(|(transfer, of)| transfer.if_of_one_kind(probability(of.similarity)))
                .collect();
        }
        book("match");
        let answers: Vec<Answer<'_>> = objects
            .iter()
            .zip(&transfers)
            .map(|(object, transfer)| Answer {
                source: &object.prepared.object,
                region: &object.region,
                transfer,
            })
            .collect();
        let fused = fuse(&target.object, &answers, &settings.fusion)?;
        book("fuse");
        let said = chosen.into_iter().zip(objects).zip(transfers).zip(&fused.trusts);
        let mut answers: Vec<EntryAnswer> = said
            .map(|(((candidate, object), transfer), trust)| EntryAnswer {
                entry: self.entries()[candidate.place].clone(),
                similarity: candidate.similarity,
                trust: *trust,
                transfer,
                object,
            })
            .collect();
        answers.sort_by(|a, b| {
            let by_share = b.trust.share.total_cmp(&a.trust.share);
            by_share.then_with(|| a.entry.name.cmp(&b.entry.name))
        });
        let (n_entries, method) = (self.entries().len(), self.settings().transfer.method);
        Ok(MemoryTransfer { fused, answers, n_entries, method, stages_ms })
    }

    fn object(&self, candidate: &Candidate, task: &Task) -> Result<Arc<EntryObject>> {
        let entry = &self.entries()[candidate.place];
        self.objects.object(entry, &self.entry_folder(entry), self.settings(), task)
    }

    fn check_answerable(&self, target: &Prepared, settings: &MemorySettings) -> Result<()> {
        let folder = self.folder().display();
        if self.entries().is_empty() {
            let expected = "at least one demonstration; `semfm-cli remember` adds them";
            return Err(Error::invalid(format!("memory {folder}"), expected, "none"));
        }
        if settings.shortlist == 0 {
            return Err(Error::invalid("shortlist", "at least one demonstration", "0"));
        }
        if let Some(kind) = &settings.kind {
            let mut kinds: Vec<&str> =
                self.entries().iter().filter_map(|entry| entry.kind.as_deref()).collect();
            kinds.sort_unstable();
            kinds.dedup();
            if !kinds.contains(&kind.as_str()) {
                let known =
                    if kinds.is_empty() { "none is named".into() } else { kinds.join(", ") };
                let expected = format!("a kind of {folder} ({known})");
                return Err(Error::invalid("kind", expected, format!("{kind:?}")));
            }
        }
        let dim = target.object.cloud().dim();
        let found = target.report.encoder.as_ref().map(|record| MemoryEncoder::of(record, dim));
        self.check_encoder("the target", found.as_ref())
    }
}

impl MemoryTransfer {
    /// Why the answer is not accepted, in words; none where it is.
    pub fn why(&self) -> Option<String> {
        if self.fused.verdict == Verdict::Accept {
            return None;
        }
        let unlike = self.answers.iter().all(|said| said.transfer.report.is_not_alike());
        Some(match self.answers.len() {
            _ if unlike => "not alike: no demonstration shows an object of this kind".into(),
            _ if self.fused.region.is_empty() => {
                "no place is enough like what was demonstrated".into()
            }
            n if n > 1 && self.fused.agreement < LITTLE_AGREEMENT => {
                format!("the demonstrations disagree: {:.0} %", 100.0 * self.fused.agreement)
            }
            _ => "no demonstration is sure of its answer".into(),
        })
    }
}

/// Answers that overlap less than this, in the mean, with what they were fused to say different things.
const LITTLE_AGREEMENT: f64 = 0.6;
