//! Every URDF of the shared corpus: the verdict of its manifest, with the reason that it names.

mod shared_data;

use std::path::Path;

use semfm_robot::{MeshPaths, MeshPlace, RobotDescription};

use shared_data::shared;

#[test]
fn every_description_gets_its_verdict_and_the_reason_for_it() {
    let Some(corpus) = shared("corpus") else { return };
    let manifest = std::fs::read_to_string(corpus.join("MANIFEST.tsv")).unwrap();
    let (mut faults, mut n_files) = (Vec::new(), 0);
    for line in manifest.lines().filter(|line| line.starts_with("urdf/")) {
        let columns: Vec<&str> = line.split('\t').collect();
        n_files += 1;
        if let Some(fault) = fault(&corpus.join(columns[0]), columns[4]) {
            faults.push(format!("{}: expected {}: {fault}", columns[0], columns[4]));
        }
    }
    assert!(n_files >= 160, "only {n_files} descriptions in the corpus");
    assert!(faults.is_empty(), "{} of {n_files}:\n{}", faults.len(), faults.join("\n"));
}

fn fault(path: &Path, expected: &str) -> Option<String> {
    let read = RobotDescription::read(path).and_then(|description| {
        let meshes = description.meshes(&MeshPaths::new(path, &Default::default()))?;
        Ok((description, meshes))
    });
    let (description, meshes) = match read {
        Ok(read) => read,
        Err(error) => {
            let reason = expected.strip_prefix("refuse:").map(|rest| rest.split([',', ' ']).next());
            let code = error.code();
            let right = match reason {
                Some(reason) => reason == Some(code),
                None => expected.starts_with("refuse"),
            };
            return (!right).then(|| format!("[{code}] {error}"));
        }
    };
    if !expected.starts_with("accept") && !expected.contains("or report") {
        return Some("accepted".into());
    }
    let count = |key: &str| -> Option<usize> {
        let word = expected.split_whitespace().find_map(|word| word.strip_prefix(key))?;
        word.trim_end_matches(';').parse().ok()
    };
    let found = (description.n_links(), description.n_joints());
    if count("links=").is_some_and(|n| n != found.0)
        || count("joints=").is_some_and(|n| n != found.1)
    {
        return Some(format!("found {found:?}"));
    }
    let missing = meshes.iter().any(|mesh| matches!(mesh.place, MeshPlace::Missing(_)));
    if expected.contains("missing meshes reported") && !missing {
        return Some("no mesh is missing".into());
    }
    let finding = |words: &str| description.tree_findings().iter().any(|told| told.contains(words));
    let told = [
        ("unknown link", "is not here"),
        ("duplicate link", "occurs twice"),
        ("two parents", "two parents"),
        ("0 roots", "no root"),
    ];
    let silent = told.iter().find(|(word, ours)| expected.contains(word) && !finding(ours));
    silent.map(|(word, _)| format!("{word} is not reported: {:?}", description.tree_findings()))
}
