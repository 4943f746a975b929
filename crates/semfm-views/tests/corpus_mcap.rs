//! Every MCAP file of the shared corpus gets the verdict that its manifest names.
#![cfg(feature = "mcap")]
#![allow(clippy::print_stderr, reason = "a test that skips says so")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use semfm_views::mcap::inspect;

/// The shared corpus, where this machine has it.
fn corpus() -> Option<PathBuf> {
    let shared = std::env::var_os("SEMFM_SHARED")
        .map(PathBuf::from)
        .unwrap_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared"));
    Some(shared.join("corpus")).filter(|corpus| corpus.join("MANIFEST.tsv").is_file())
}

/// What the manifest allows: numbers of messages, and whether a refusal is right.
#[derive(Debug, PartialEq)]
struct Verdict {
    n_messages: Option<u64>,
    may_refuse: bool,
}

impl Verdict {
    fn parse(expected: &str) -> Self {
        let words: Vec<&str> = expected.split_whitespace().collect();
        let numbers: Vec<u64> = words.iter().filter_map(|word| word.parse().ok()).collect();
        let accept = words.contains(&"accept");
        Self {
            n_messages: numbers.first().copied().filter(|_| accept),
            may_refuse: expected.contains("refuse"),
        }
    }
}

#[test]
fn verdicts_are_read_from_the_manifests_words() {
    let parse = Verdict::parse;
    assert_eq!(parse("accept 10 messages"), Verdict { n_messages: Some(10), may_refuse: false });
    assert_eq!(parse("refuse:size, under 64 MB"), Verdict { n_messages: None, may_refuse: true });
    let either = Verdict { n_messages: Some(1), may_refuse: true };
    assert_eq!(parse("accept 1 message or refuse; never 2"), either);
}

#[test]
fn every_file_of_the_corpus_gets_its_verdict() {
    let Some(corpus) = corpus() else {
        eprintln!("SKIPPED: no shared corpus (set SEMFM_SHARED)");
        return;
    };
    let manifest = std::fs::read_to_string(corpus.join("MANIFEST.tsv")).unwrap();
    let disputed: BTreeMap<&str, &str> = include_str!("corpus_disputed_mcap.tsv")
        .lines()
        .filter(|line| !line.starts_with('#'))
        .filter_map(|line| line.split_once('\t'))
        .collect();
    let mut wrong = Vec::new();
    let (mut n_files, mut n_accepted) = (0, 0);
    for line in manifest.lines().filter(|line| line.starts_with("mcap/")) {
        let columns: Vec<&str> = line.split('\t').collect();
        let (name, verdict) = (columns[0], Verdict::parse(columns[4]));
        if disputed.contains_key(name) {
            continue;
        }
        n_files += 1;
        let outcome = inspect(&corpus.join(name));
        n_accepted += usize::from(outcome.is_ok());
        let is_right = match &outcome {
            Ok(report) => verdict.n_messages == Some(report.n_messages),
            Err(_) => verdict.may_refuse,
        };
        if std::env::var_os("SEMFM_CORPUS_VERBOSE").is_some() {
            match &outcome {
                Ok(report) => eprintln!("{name}: {} messages", report.n_messages),
                Err(error) => eprintln!("{name}: [{}] {error}", error.code()),
            }
        }
        if !is_right {
            let outcome = outcome.map(|report| report.n_messages).map_err(|e| e.to_string());
            wrong.push(format!("{name}: manifest `{}`, found {outcome:?}", columns[4]));
        }
    }
    assert!(n_files > 0, "the manifest names no MCAP files");
    assert!(wrong.is_empty(), "{} wrong verdicts:\n{}", wrong.len(), wrong.join("\n"));
    eprintln!("{n_files} MCAP files, {n_accepted} accepted, every verdict as in the manifest");
}
