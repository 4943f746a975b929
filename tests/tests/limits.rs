//! Full disks, limits of memory and threads, and kills: an error with exit code 2 and nothing half
//! done, whatever is missing.
#![cfg(unix)]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use semfm_tests::sample::{Sample, text};
use semfm_tests::shell::{Answer, answer, run, semfm_cli};

/// The files of a finished transfer.
const TRANSFER: [&str; 9] = [
    "features.png",
    "point_map.json",
    "region.json",
    "report.json",
    "source.ply",
    "target.glb",
    "target.ply",
    "transfer.mcap",
    "transfer.png",
];

/// Runs `semfm-cli` under a limit of the shell (`ulimit FLAG VALUE`).
fn limited(limit: &str, words: &[String]) -> Answer {
    let program = semfm_cli().get_program().to_owned();
    let mut shell = Command::new("sh");
    shell.arg("-c").arg(format!("ulimit {limit} && exec \"$0\" \"$@\"")).arg(program).args(words);
    for (name, value) in semfm_cli().get_envs() {
        shell.env(name, value.unwrap_or_default());
    }
    answer(shell.output().expect("a shell"))
}

/// Names in a folder, hidden ones included; empty where it is not there.
fn listed(folder: &Path) -> Vec<String> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let mut names: Vec<String> =
        entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// Every JSON file is whole, and nothing is half of an answer: all files of a transfer or no verdict.
fn check_transfer(folder: &Path) {
    let names = listed(folder);
    if !names.iter().any(|name| name == "region.json") {
        return;
    }
    for name in TRANSFER {
        assert!(names.iter().any(|n| n == name), "{name} is missing beside a verdict: {names:?}");
    }
    for name in ["region.json", "report.json", "point_map.json"] {
        let content = fs::read(folder.join(name)).unwrap();
        serde_json::from_slice::<serde_json::Value>(&content)
            .unwrap_or_else(|e| panic!("{name}: {e}"));
    }
}

#[test]
fn a_full_disk_leaves_no_answer_behind() {
    let folder = tempfile::tempdir().unwrap();
    let sample = Sample::write(&folder.path().join("in"));
    let out = folder.path().join("out");
    // In blocks of 512 bytes: the first files fit, a later one does not.
    for blocks in [0, 8, 20, 40, 80] {
        let told = limited(&format!("-f {blocks}"), &sample.transfer(&out, &[]));
        assert_eq!(told.code, Some(2), "{blocks} blocks: {told:?}");
        assert!(told.err.contains("too large") && !told.err.contains(".semfm-"), "{}", told.err);
        assert!(!out.exists(), "{blocks} blocks left {:?}", listed(&out));
        assert_eq!(listed(folder.path()), ["in"]);
    }
    let told = run(&sample.transfer(&out, &[]));
    assert!(matches!(told.code, Some(0 | 1)), "{told:?}");
    assert_eq!(listed(&out), TRANSFER);
    // An answer that is there stays when the next one does not fit.
    let before = fs::read(out.join("region.json")).unwrap();
    let told = limited("-f 20", &sample.transfer(&out, &["--seed", "5"]));
    assert_eq!(told.code, Some(2), "{told:?}");
    assert_eq!(listed(&out), TRANSFER);
    assert_eq!(fs::read(out.join("region.json")).unwrap(), before);
}

#[test]
fn a_small_file_system_that_fills_up_leaves_no_answer_behind() {
    let folder = tempfile::tempdir().unwrap();
    let small = folder.path().join("small");
    fs::create_dir(&small).unwrap();
    let mounted = Command::new("mount")
        .args(["-t", "tmpfs", "-o", "size=64k", "tmpfs"])
        .arg(&small)
        .stderr(Stdio::null())
        .status();
    if !mounted.is_ok_and(|status| status.success()) {
        return; // only root may mount, and not everywhere
    }
    let sample = Sample::write(&folder.path().join("in"));
    let told = run(&sample.transfer(&small.join("out"), &[]));
    let left = listed(&small);
    let unmounted = Command::new("umount").arg(&small).status();
    assert!(unmounted.is_ok_and(|status| status.success()));
    assert_eq!(told.code, Some(2), "{told:?}");
    assert!(told.err.contains("No space") && !told.err.contains(".semfm-"), "{}", told.err);
    assert!(left.is_empty(), "{left:?}");
}

#[test]
fn memory_and_threads_that_are_not_there_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let sample = Sample::write(&folder.path().join("in"));
    let out = folder.path().join("out");
    // In kilobytes: from what no thread starts in to what nearly suffices.
    let mut refused = 0;
    for kilobytes in [60_000, 100_000, 200_000, 400_000, 800_000] {
        let told = limited(&format!("-v {kilobytes}"), &sample.transfer(&out, &["--threads", "2"]));
        let code = told.code;
        assert!(matches!(code, Some(0..=2)), "{kilobytes} kB: {told:?}");
        assert!(code != Some(2) || !told.err.trim().is_empty(), "{kilobytes} kB: no word");
        check_transfer(&out);
        refused += u32::from(code == Some(2));
    }
    assert!(refused > 0, "no limit was too small");
    // A limit of processes does not hold for root.
    let told = limited("-u 1", &sample.transfer(&out, &["--threads", "4"]));
    assert!(matches!(told.code, Some(0..=2)), "{told:?}");
}

/// One round of a kill: the command is started, killed after a while, and what is left is looked at.
struct KillTest {
    words: Vec<String>,
    /// The folder in which it writes.
    folder: PathBuf,
    check: fn(&Path),
}

impl KillTest {
    /// Kills at `rounds` moments, spread over the time that the command takes, then runs it again.
    fn run(&self, rounds: u32) {
        let start = Instant::now();
        let told = self.start().wait_with_output().map(answer).unwrap();
        assert!(matches!(told.code, Some(0 | 1)), "{told:?}");
        let whole = start.elapsed();
        for round in 0..rounds {
            // Most of the writing is at the end.
            let share = f64::from(round + 1) / f64::from(rounds);
            let mut child = self.start();
            std::thread::sleep(whole.mul_f64(0.2 + 0.85 * share.sqrt()));
            let _ = child.kill();
            child.wait().unwrap();
            (self.check)(&self.folder);
        }
        let told = self.start().wait_with_output().map(answer).unwrap();
        assert!(matches!(told.code, Some(0 | 1)), "again: {told:?}");
        (self.check)(&self.folder);
        let left = temporaries(self.folder.parent().unwrap());
        assert!(left.is_empty(), "left after the next run: {left:?}");
    }

    fn start(&self) -> std::process::Child {
        let mut command = semfm_cli();
        command.args(&self.words).stdout(Stdio::piped()).stderr(Stdio::piped());
        command.spawn().unwrap()
    }
}

/// Temporary files and folders anywhere below.
fn temporaries(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if entry.file_name().to_string_lossy().starts_with(".semfm-") {
            found.push(path);
        } else if path.is_dir() {
            found.extend(temporaries(&path));
        }
    }
    found
}

/// A few at each run; where everything is tested more than fifty kills in all.
fn rounds(few: u32) -> u32 {
    if std::env::var_os("SEMFM_FULL").is_some() { 15 } else { few }
}

#[test]
fn a_killed_transfer_leaves_a_whole_folder_or_none() {
    let folder = tempfile::tempdir().unwrap();
    let sample = Sample::write(&folder.path().join("in"));
    let fresh = folder.path().join("fresh/out");
    // Into a folder that is there, and into one that has never been.
    let check = |folder: &Path| check_transfer(folder);
    KillTest { words: sample.transfer(&fresh, &[]), folder: fresh.clone(), check }.run(rounds(6));
    for round in 0..rounds(3) {
        let _ = fs::remove_dir_all(&fresh);
        let mut command = semfm_cli();
        command.args(sample.transfer(&fresh, &[])).stdout(Stdio::null()).stderr(Stdio::null());
        let mut child = command.spawn().unwrap();
        std::thread::sleep(Duration::from_millis(100 + 40 * u64::from(round)));
        let _ = child.kill();
        child.wait().unwrap();
        assert!(!fresh.exists() || listed(&fresh) == TRANSFER, "{:?}", listed(&fresh));
    }
}

#[test]
fn killed_views_leave_a_whole_file_or_none() {
    let folder = tempfile::tempdir().unwrap();
    let sample = Sample::write(&folder.path().join("in"));
    let out = folder.path().join("out/v.views.mcap");
    let mut words = vec!["views".to_owned(), text(&sample.source), "-o".into(), text(&out)];
    words.extend(["--renderer", "cpu", "--count", "6", "--size", "160"].map(str::to_owned));
    let check = |file: &Path| {
        if file.exists() {
            semfm::views::mcap::ViewsFile::read(file).unwrap();
        }
    };
    KillTest { words, folder: out, check }.run(rounds(5));
}

#[test]
fn a_killed_evaluation_goes_on_and_its_results_are_whole() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("report/out");
    let mut words: Vec<String> = ["eval", "--synthetic", "--level", "easy", "--seeds", "0..1"]
        .into_iter()
        .chain(["--objects", "2", "--methods", "nearest,whole", "--gallery", "1", "-o"])
        .map(str::to_owned)
        .collect();
    words.push(text(&out));
    let check = |folder: &Path| {
        for name in listed(folder).iter().filter(|name| name.ends_with(".json")) {
            let content = fs::read(folder.join(name)).unwrap();
            serde_json::from_slice::<serde_json::Value>(&content).unwrap();
        }
        if folder.join("results.json").exists() {
            assert!(folder.join("index.html").exists() && folder.join("table.md").exists());
        }
    };
    KillTest { words, folder: out, check }.run(rounds(2));
}

#[test]
fn two_evaluations_do_not_share_a_folder_and_ctrl_c_says_how_to_go_on() {
    let folder = tempfile::tempdir().unwrap();
    let out = text(&folder.path().join("report"));
    let words = ["eval", "--synthetic", "--seeds", "0..2", "--objects", "4", "-o", &out];
    let mut first =
        semfm_cli().args(words).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let journal = folder.path().join("report/journal.jsonl");
    let start = Instant::now();
    while !journal.exists() && start.elapsed() < Duration::from_secs(120) {
        std::thread::sleep(Duration::from_millis(10));
    }
    let told = run(&words);
    assert_eq!(told.code, Some(2), "{told:?}");
    assert!(told.err.contains("another evaluation writes here"), "{}", told.err);
    assert!(told.err.contains(&first.id().to_string()), "{}", told.err);
    assert!(first.try_wait().unwrap().is_none(), "the first run goes on");
    let sent = Command::new("kill").args(["-INT", &first.id().to_string()]).status();
    assert!(sent.is_ok_and(|status| status.success()));
    let told = answer(first.wait_with_output().unwrap());
    assert_eq!(told.code, Some(130), "{told:?}");
    assert!(told.err.contains("the same command goes on from there"), "{}", told.err);
    assert!(journal.exists() && !folder.path().join("report/results.json").exists());
}
