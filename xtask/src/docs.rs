//! The pages keep up with the code: a path that they name exists, and what `docs/paper.md` says is
//! computed in a file is defined there.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use crate::workspace::Workspace;

const PAGES: [&str; 6] = [
    "README.md",
    "ARCHITECTURE.md",
    "CONTRIBUTING.md",
    "docs/paper.md",
    "docs/formats.md",
    "docs/encoders.md",
];

/// What stands between backticks, line by line; fenced blocks are left out.
fn quoted(page: &str) -> Vec<Vec<&str>> {
    let mut fenced = false;
    let mut lines = Vec::new();
    for line in page.lines() {
        if line.trim_start().starts_with("```") {
            fenced = !fenced;
        } else if !fenced {
            lines.push(line.split('`').skip(1).step_by(2).collect());
        }
    }
    lines
}

/// Whether this is a path into the repository, as our pages write them: from the root.
fn is_path(text: &str) -> bool {
    let roots = ["crates/", "docs/", "python/", "tests/", "xtask/", "bench/", ".ci/"];
    roots.iter().any(|root| text.starts_with(root)) && !text.contains(['*', ' ', '<'])
}

fn is_name(text: &str) -> bool {
    !text.is_empty() && text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

fn is_defined(name: &str, code: &str) -> bool {
    let definitions = ["fn ", "struct ", "enum ", "const ", "type ", "def ", "class "];
    definitions.iter().any(|keyword| {
        let start = format!("{keyword}{name}");
        code.match_indices(&start).any(|(at, found)| {
            !code[at + found.len()..].starts_with(|c: char| c.is_alphanumeric() || c == '_')
        })
    })
}

fn root() -> PathBuf {
    Workspace::find().unwrap().root
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

#[test]
fn every_path_that_a_page_names_exists() {
    let mut missing = BTreeSet::new();
    for page in PAGES {
        let text = read(&root().join(page));
        for path in quoted(&text).into_iter().flatten().filter(|text| is_path(text)) {
            if !root().join(path).exists() {
                missing.insert(format!("{page}: {path}"));
            }
        }
    }
    assert!(missing.is_empty(), "{missing:#?}");
}

#[test]
fn the_paper_s_equations_are_where_the_page_says() {
    let page = read(&root().join("docs/paper.md"));
    let (mut missing, mut n_names) = (BTreeSet::new(), 0);
    for line in quoted(&page) {
        // Names belong to the file that stands before them in the same line.
        let mut file = None;
        for text in line {
            if is_path(text) {
                file = Some((text, read(&root().join(text))));
            } else if let Some((path, code)) = file.as_ref().filter(|_| is_name(text)) {
                n_names += 1;
                if !is_defined(text, code) {
                    missing.insert(format!("{path}: {text}"));
                }
            }
        }
    }
    assert!(missing.is_empty(), "{missing:#?}");
    assert!(n_names >= 20, "the page names only {n_names} functions");
}

#[test]
fn a_wrong_name_would_be_noticed() {
    assert!(is_defined("lift", "pub fn lift(mesh: &Mesh)"));
    assert!(!is_defined("lift", "pub fn lifted(mesh: &Mesh)"));
    assert_eq!(quoted("a `b` c `d`\n```\n`e`\n```"), [vec!["b", "d"]]);
}
