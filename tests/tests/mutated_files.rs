//! Damaged files through every reader: each is read or refused, within a second's patience and a gigabyte.
//!
//! Every reader runs in a process of its own under a limit of memory, since an abort, a hang or an overflow of the stack
//! cannot be caught from inside. `SEMFM_MUTATED_SECONDS=120` tries each reader for so long instead of a count of inputs;
//! `SEMFM_MUTATED_READERS=obj,png` names the readers; `SEMFM_MUTATED_FROM=1000` begins at that input. What went wrong is
//! kept in the folder that the message names, and `fuzz/` finds more with libFuzzer.
#![cfg(unix)]
#![allow(clippy::print_stderr)]

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant, SystemTime};

use semfm_tests::mutation::mutated;
use semfm_tests::readers::{MOST_BYTES, MOST_SECONDS, READERS, Reader};
use semfm_tests::seeds::{from_corpus, own_seeds};

/// Inputs of each reader where no time is asked for: some seconds each.
const N_INPUTS: u64 = 2000;

/// What the process maps before it reads a byte.
const OWN_BYTES: u64 = 256 << 20;

/// Tells a child which reader it tries and where it works.
const CHILD: &str = "SEMFM_MUTATED_CHILD";

#[test]
fn damaged_files_are_read_or_refused() {
    if let Ok(child) = std::env::var(CHILD) {
        let (name, folder) = child.split_once('=').expect("a reader and a folder");
        let reader = READERS.iter().find(|reader| reader.name == name).expect("a reader");
        return try_reader(reader, Path::new(folder));
    }
    let wanted = std::env::var("SEMFM_MUTATED_READERS").ok();
    let folder = std::env::temp_dir().join(format!("semfm-mutated-{}", std::process::id()));
    let mut faults = Vec::new();
    for reader in &READERS {
        if wanted.as_ref().is_none_or(|names| names.split(',').any(|name| name == reader.name)) {
            faults.extend(watch(reader, &folder.join(reader.name)));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    let _ = std::fs::remove_dir_all(&folder);
}

/// Tries a reader in processes of its own, one after the other where one dies, and gives what went wrong.
fn watch(reader: &Reader, folder: &Path) -> Vec<String> {
    const MOST_FAULTS: usize = 10;
    let mut faults = Vec::new();
    let mut from: u64 = number("SEMFM_MUTATED_FROM").unwrap_or(0);
    let first = from;
    std::fs::create_dir_all(folder).unwrap();
    // Made here: a transfer is made for those of JSON files, and matrix products reserve more than a reader may.
    write_seeds(reader, folder);
    let start = Instant::now();
    loop {
        let mut child = start_child(reader, folder, from);
        let outcome = wait(&mut child, folder);
        let report = std::fs::read_to_string(folder.join("panics.txt")).unwrap_or_default();
        let tried = std::fs::read_to_string(folder.join("tried.txt")).unwrap_or_default();
        let tried: u64 = tried.trim().parse().unwrap_or(from);
        if let Some(outcome) = outcome {
            let kept = folder.join(format!("{tried}.{}", reader.extension));
            let _ = std::fs::copy(input(reader, folder), &kept);
            faults.push(format!("{}: input {tried} {outcome}: {}", reader.name, kept.display()));
            from = tried + 1;
            if faults.len() < MOST_FAULTS && !is_over(start, from - first) {
                continue;
            }
        }
        faults.extend(report.lines().map(|line| format!("{}: {line}", reader.name)));
        let seconds = start.elapsed().as_secs_f64();
        let n = tried + 1 - first;
        eprintln!("{}: {n} inputs, {} faults, {seconds:.1} s", reader.name, faults.len());
        return faults;
    }
}

/// Writes the seeds of a reader: those made in code, then those of the shared corpus.
fn write_seeds(reader: &Reader, folder: &Path) {
    for (kind, seeds) in [("own", own_seeds(reader.name)), ("corpus", from_corpus(reader.name))] {
        std::fs::create_dir_all(folder.join(kind)).unwrap();
        for (number, seed) in seeds.iter().enumerate() {
            std::fs::write(folder.join(kind).join(format!("{number:04}")), seed).unwrap();
        }
    }
}

fn read_seeds(folder: &Path) -> Vec<Vec<u8>> {
    let files = std::fs::read_dir(folder).unwrap();
    let mut files: Vec<PathBuf> = files.map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files.iter().map(|path| std::fs::read(path).unwrap()).collect()
}

fn start_child(reader: &Reader, folder: &Path, from: u64) -> Child {
    let kilobytes = (MOST_BYTES + OWN_BYTES) / 1024;
    Command::new("sh")
        .args(["-c", r#"ulimit -v "$0"; exec "$@""#, &kilobytes.to_string()])
        .arg(std::env::current_exe().unwrap())
        .args([
            "--exact",
            "damaged_files_are_read_or_refused",
            "--nocapture",
            "--test-threads",
            "1",
        ])
        .env(CHILD, format!("{}={}", reader.name, folder.display()))
        .env("SEMFM_MUTATED_FROM", from.to_string())
        .env("RAYON_NUM_THREADS", "1")
        .env("MALLOC_ARENA_MAX", "2")
        .env("TMPDIR", folder)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

/// Why a child ended before its time; `None` where it came to its end.
fn wait(child: &mut Child, folder: &Path) -> Option<String> {
    let start = SystemTime::now();
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return (!status.success()).then(|| format!("ends the process ({status})"));
        }
        let began = std::fs::metadata(folder.join("tried.txt")).and_then(|about| about.modified());
        // Seeds are made before the first input.
        let (since, patience) = match began {
            Ok(began) if began > start => (began, MOST_SECONDS),
            _ => (start, 120),
        };
        if since.elapsed().unwrap_or_default() > Duration::from_secs(patience) {
            child.kill().unwrap();
            child.wait().unwrap();
            return Some(format!("takes more than {patience} s"));
        }
        std::thread::sleep(Duration::from_millis(20));
    }
}

fn input(reader: &Reader, folder: &Path) -> PathBuf {
    folder.join("input").with_extension(reader.extension)
}

fn number(name: &str) -> Option<u64> {
    std::env::var(name).ok()?.parse().ok()
}

fn is_over(start: Instant, n_tried: u64) -> bool {
    match number("SEMFM_MUTATED_SECONDS") {
        Some(seconds) => start.elapsed() > Duration::from_secs(seconds),
        None => n_tried >= N_INPUTS,
    }
}

/// The child: inputs one after the other, panics caught and kept.
fn try_reader(reader: &Reader, folder: &Path) {
    let own = read_seeds(&folder.join("own"));
    let seeds = [own.clone(), read_seeds(&folder.join("corpus"))].concat();
    let from = number("SEMFM_MUTATED_FROM").unwrap_or(0);
    let path = input(reader, folder);
    let known = own.iter().filter(|seed| {
        std::fs::write(&path, seed).unwrap();
        (reader.read)(&path)
    });
    // Damage to what the reader refuses anyway would try nothing.
    let n_known = known.count();
    assert!(2 * n_known >= own.len(), "{}: only {n_known} of {} seeds", reader.name, own.len());
    let start = Instant::now();
    let (mut round, mut panics) = (from, String::new());
    while !is_over(start, round - from) {
        let bytes = mutated(&seeds, reader.name, round);
        std::fs::write(&path, &bytes).unwrap();
        std::fs::write(folder.join("tried.txt"), round.to_string()).unwrap();
        let read = std::panic::catch_unwind(|| {
            (reader.read)(&path);
        });
        if read.is_err() {
            let kept = folder.join(format!("{round}.{}", reader.extension));
            std::fs::write(&kept, &bytes).unwrap();
            panics += &format!("input {round} panics: {}\n", kept.display());
            std::fs::write(folder.join("panics.txt"), &panics).unwrap();
        }
        round += 1;
    }
}
