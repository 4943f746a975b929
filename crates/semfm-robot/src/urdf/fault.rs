//! What is wrong with a description, before the path of its file is known.

use std::path::Path;

use crate::Error;

/// What is wrong, where, and what should stand there.
#[derive(Clone, Debug)]
pub(crate) struct Fault {
    /// Kind of failure, kebab-case.
    pub code: &'static str,
    /// Line, element, name.
    pub place: String,
    /// What should stand there.
    pub expected: String,
    /// What stands there.
    pub found: String,
}

impl Fault {
    pub(crate) fn new(
        code: &'static str,
        place: impl Into<String>,
        expected: impl Into<String>,
        found: impl ToString,
    ) -> Self {
        Self { code, place: place.into(), expected: expected.into(), found: found.to_string() }
    }

    /// With the file that it is about.
    pub(crate) fn in_file(self, path: &Path) -> Error {
        let Self { code, place, expected, found } = self;
        Error::Urdf { path: path.to_owned(), code, place, expected, found }
    }
}

/// A piece of the file for a message, in backquotes: printable and short.
pub(crate) fn quoted(text: &str) -> String {
    format!("`{}`", short(text))
}

/// A piece of the file for a message: printable and short.
pub(crate) fn short(text: &str) -> String {
    const SHOWN: usize = 60;
    let escaped: String = text.chars().take(SHOWN).flat_map(char::escape_debug).collect();
    if text.chars().count() > SHOWN { escaped + "…" } else { escaped }
}
