//! Hashes of settings, and of what an encoder is made of.

use std::path::{Path, PathBuf};

use semfm::files::FileHash;
use serde_json::Value;

/// BLAKE3 of a value as JSON, keys in alphabetical order.
pub fn of_settings(settings: &Value) -> String {
    blake3::hash(settings.to_string().as_bytes()).to_hex().to_string()
}

/// The files at a path, and those in a folder and in its folders, by name.
pub fn files_under(path: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    let mut folders = vec![path.to_owned()];
    while let Some(folder) = folders.pop() {
        let Ok(entries) = std::fs::read_dir(&folder) else {
            files.push(folder);
            continue;
        };
        let entries = entries.flatten().map(|entry| entry.path());
        let (more, plain): (Vec<PathBuf>, Vec<PathBuf>) = entries.partition(|path| path.is_dir());
        folders.extend(more);
        files.extend(plain);
    }
    files.sort();
    files
}

/// The hashes of files that can be read, named as files of `folder` name them, each once, by name.
pub fn hashes(files: impl IntoIterator<Item = PathBuf>, folder: &Path) -> Vec<FileHash> {
    let mut hashes: Vec<FileHash> =
        files.into_iter().filter_map(|path| FileHash::of(&path, folder)).collect();
    hashes.sort_by(|a, b| a.file.cmp(&b.file));
    hashes.dedup_by(|a, b| a.file == b.file);
    hashes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_all_files_in_it() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir(at("a")).unwrap();
        for name in ["b.txt", "a/c.txt"] {
            std::fs::write(at(name), name).unwrap();
        }
        assert_eq!(files_under(folder.path()), [at("a/c.txt"), at("b.txt")]);
        let named = hashes([at("b.txt"), at("a/c.txt"), at("b.txt"), at("gone")], &at("a"));
        let names: Vec<&str> = named.iter().map(|hash| hash.file.as_str()).collect();
        assert_eq!(names, ["../b.txt", "c.txt"]);
    }

    #[test]
    fn settings_have_one_hash_whatever_the_order_of_their_keys() {
        let [a, b] = [r#"{"x": 1, "y": [2]}"#, r#"{"y": [2], "x": 1}"#];
        let [a, b] = [a, b].map(|text| of_settings(&serde_json::from_str(text).unwrap()));
        assert_eq!(a, b);
        assert_ne!(a, of_settings(&serde_json::json!({ "x": 1 })));
    }
}
