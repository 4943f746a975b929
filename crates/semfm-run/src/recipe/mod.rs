//! `demo.toml`: what there is of a demonstration and of a target, and what is wanted.

mod check;
mod paths;
mod tables;
mod values;

use std::path::Path;

use semfm::geom::io::{FormatError, foreign_kind, read_file};
use serde::{Deserialize, Serialize};

pub use paths::NamedPath;
pub use tables::{
    AlignTable, Demonstration, DemonstrationFrame, GraspTable, RobotTable, Target, TargetFrame,
    TransferTable,
};
pub use values::{PoseValue, StartValue, TableValue};

use crate::Result;
use crate::key_places::KeyPlaces;

/// A recipe as its file has it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recipe {
    /// Heading of the page.
    pub title: Option<String>,
    /// Seed of everything drawn by chance.
    #[serde(default)]
    pub seed: u64,
    /// The demonstrated object and what touched it.
    pub demonstration: Demonstration,
    /// The object to act on.
    pub target: Target,
    /// How the region travels.
    #[serde(default)]
    pub transfer: TransferTable,
    /// Grasps; without it the run ends with the region.
    pub grasp: Option<GraspTable>,
    /// The arm; without it the run ends with grasps.
    pub robot: Option<RobotTable>,
}

/// A recipe and its file.
#[derive(Clone, Debug)]
pub(crate) struct RecipeFile {
    /// As the file has it.
    pub written: Recipe,
    /// With paths from the current folder.
    pub resolved: Recipe,
}

impl RecipeFile {
    /// Reads it, once.
    ///
    /// # Errors
    /// As [`Recipe::read`].
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = read_file(path)?;
        let not_text = || foreign_kind(&bytes).unwrap_or("bytes that are no UTF-8").to_owned();
        let text = std::str::from_utf8(&bytes)
            .map_err(|_| FormatError::new(path, "file", "TOML in UTF-8", not_text()))?;
        let written = Recipe::parse(path, text)?;
        let mut resolved = written.clone();
        resolved.resolve(path.parent().unwrap_or(Path::new("")));
        let places = KeyPlaces::of(text);
        if let Some(fault) = resolved.fault() {
            let place = places.place_of(&fault.key);
            return Err(FormatError::new(path, place, fault.expected, fault.found).into());
        }
        for NamedPath { key, path: file } in resolved.paths() {
            if !file.exists() {
                let found = format!("no such file: {}", file.display());
                let expected = "a file that is there (paths are relative to this file)";
                return Err(FormatError::new(path, places.place_of(&key), expected, found).into());
            }
        }
        Ok(Self { written, resolved })
    }
}

impl Recipe {
    /// Reads a recipe and makes its paths, which are relative to the file, ones from the current folder.
    ///
    /// # Errors
    /// [`Error::Recipe`](crate::Error::Recipe) with the line and the key: no TOML, a key that is not known, a value of
    /// another kind, ways to say one thing that exclude each other, a file that is not there.
    pub fn read(path: &Path) -> Result<Self> {
        Ok(RecipeFile::read(path)?.resolved)
    }

    /// Of a text; `path` is for messages. Nothing is checked but keys and kinds of values, and paths stay as they are.
    ///
    /// # Errors
    /// As [`Recipe::read`].
    pub fn parse(path: &Path, text: &str) -> Result<Self> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        toml::from_str(text).map_err(|error| toml_error(path, text, &error).into())
    }
}

/// What the reader of TOML says, in our form: serde's `…, expected …` is taken apart.
fn toml_error(path: &Path, text: &str, error: &toml::de::Error) -> FormatError {
    let message = error.message().trim().replace('\n', "; ");
    let line = error.span().map(|span| {
        text.as_bytes()[..span.start.min(text.len())].iter().filter(|&&b| b == b'\n').count() + 1
    });
    let places = KeyPlaces::of(text);
    let place = match line {
        Some(line) => match places.key_at(line) {
            Some(key) => format!("line {line}, {key}"),
            None => format!("line {line}"),
        },
        None => "file".to_owned(),
    };
    let (found, expected) = match message.split_once(", expected ") {
        Some((found, expected)) => (found.to_owned(), expected.to_owned()),
        None => match message.strip_prefix("missing field ") {
            Some(key) => ("none".to_owned(), format!("the key {key}")),
            None => (message, "a recipe in TOML".to_owned()),
        },
    };
    FormatError::new(path, place, in_words(&expected), found)
}

/// Names of Rust's numbers as people say them.
fn in_words(expected: &str) -> String {
    match expected {
        "usize" | "u32" | "u64" => "a whole number, 0 or more".into(),
        "f64" => "a number".into(),
        other => other.to_owned(),
    }
}
