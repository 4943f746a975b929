//! Every mesh, MCAP and URDF file of the shared corpus through `info --json`, each in a process of its own
//! under a limit of memory: an abort or a hang cannot be caught from inside.

use std::collections::HashSet;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use semfm_tests::shell::{Answer, answer, semfm_cli, shared};
use serde_json::Value;

/// What the program itself maps before it reads a byte (code, stacks, allocator arenas), beside the
/// 64 MB + 40 × the file's size that it may use.
const OWN_KILOBYTES: u64 = 192 << 10;
/// Nothing takes a tenth of this; a file that takes all of it hangs.
const PATIENCE: Duration = Duration::from_secs(60);

fn info(path: &Path) -> Answer {
    let size = std::fs::metadata(path).unwrap().len();
    let limit = OWN_KILOBYTES + (64 << 10) + 40 * size / 1024;
    let cli = semfm_cli();
    let mut child = Command::new("sh")
        .args(["-c", r#"ulimit -v "$0"; exec "$@""#, &limit.to_string()])
        .arg(cli.get_program())
        .args(["info", "--json", "--threads", "1"])
        .arg(path)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let start = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if start.elapsed() > PATIENCE {
            child.kill().unwrap();
            panic!("{} hangs", path.display());
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    answer(child.wait_with_output().unwrap())
}

/// Paths where we are sure that the manifest is wrong; the crates' own tests hold us to the reasons.
fn disputed() -> HashSet<&'static str> {
    let lists = [
        include_str!("../../crates/semfm-geom/tests/corpus_disputed.tsv"),
        include_str!("../../crates/semfm-views/tests/corpus_disputed_mcap.tsv"),
    ];
    lists
        .into_iter()
        .flat_map(|list| list.lines().skip(1))
        .filter_map(|line| line.split('\t').next())
        .collect()
}

#[test]
fn every_file_of_the_corpus_gets_its_verdict_and_none_a_crash() {
    let Some(corpus) = shared("corpus") else { return };
    let manifest = std::fs::read_to_string(corpus.join("MANIFEST.tsv")).unwrap();
    let disputed = disputed();
    let (mut faults, mut n_files) = (Vec::new(), 0);
    let kinds = ["mesh/", "mcap/", "urdf/"];
    for line in manifest.lines().filter(|line| kinds.iter().any(|kind| line.starts_with(kind))) {
        let columns: Vec<&str> = line.split('\t').collect();
        let (path, expected) = (columns[0], columns[4]);
        let told = info(&corpus.join(path));
        n_files += 1;
        if let Some(fault) = fault(expected, disputed.contains(path), &told) {
            faults.push(format!("{path}: expected {expected}: {fault}"));
        }
    }
    assert!(n_files > 1000, "only {n_files} files in the corpus");
    assert!(faults.is_empty(), "{} of {n_files}:\n{}", faults.len(), faults.join("\n"));
}

fn fault(expected: &str, disputed: bool, told: &Answer) -> Option<String> {
    let Ok(report) = serde_json::from_str::<Value>(told.out.trim()) else {
        return Some(format!("no answer: {told:?}"));
    };
    let accepted = match told.code {
        Some(0) => true,
        Some(2) => false,
        _ => return Some(format!("exit {:?}: {}", told.code, told.err)),
    };
    let reason = &report["error"];
    let reasoned = reason["code"].is_string() && reason["message"].is_string();
    if !accepted && !reasoned {
        return Some(format!("a refusal without code and message: {report}"));
    }
    if disputed || expected.starts_with("any") {
        return None;
    }
    let verdict = if accepted { "accept" } else { "refuse" };
    if !(expected.starts_with(verdict) || expected.contains(&format!("or {verdict}"))) {
        return Some(format!("found {report}"));
    }
    // Where one plain count is expected, it is this one.
    let plain = accepted && !expected.contains('[') && !expected.contains(" or ");
    let counts = [
        ("v=", "n_vertices"),
        ("f=", "n_faces"),
        ("tri=", "n_triangles"),
        ("links=", "links"),
        ("joints=", "joints"),
    ];
    let list = |field: &str| report[field].as_array().map_or(0, Vec::len);
    if expected.contains("tree check reports") && list("tree") == 0 {
        return Some(format!("the tree check reports nothing: {report}"));
    }
    if expected.contains("missing meshes reported") && list("missing_meshes") == 0 {
        return Some(format!("no missing mesh is named: {report}"));
    }
    counts.into_iter().filter(|_| plain).find_map(|(key, field)| {
        let word = expected.split_whitespace().find_map(|word| word.strip_prefix(key))?;
        let count: u64 = word.trim_end_matches([',', ';']).parse().ok()?;
        (report[field] != count).then(|| format!("{field}: found {}", report[field]))
    })
}
