//! The table of mesh formats: whatever reads, writes or names them takes it from here.
//!
//! A new format is one file beside this one, which defines a [`FormatRow`], and its line in
//! [`MeshFormat::ALL`].

use std::fmt;
use std::path::Path;
use std::str::FromStr;

use super::format_row::FormatRow;
use super::input::{Input, quote};
use super::{gltf, obj, off, ply, stl};
use crate::suggestion::unknown_name;
use crate::{Error, Result};

/// A format that meshes are read from and, mostly, written to.
///
/// ```
/// use semfm_geom::io::MeshFormat;
/// let format = MeshFormat::from_path("scans/Mug.PLY".as_ref()).unwrap();
/// assert_eq!((format.name(), format.is_writable()), ("ply", true));
/// assert_eq!(MeshFormat::readable_names(), "obj, off, ply, stl, gltf or glb");
/// ```
#[derive(Clone, Copy)]
pub struct MeshFormat(&'static FormatRow);

impl MeshFormat {
    /// All formats.
    pub const ALL: &'static [Self] = &[
        Self(&obj::FORMAT),
        Self(&off::FORMAT),
        Self(&ply::FORMAT),
        Self(&stl::FORMAT),
        Self(&gltf::GLTF),
        Self(&gltf::GLB),
    ];

    /// Its name in files and messages: `obj`, `ply`, ….
    pub fn name(self) -> &'static str {
        self.0.name
    }

    /// What it is, in a few words.
    pub fn summary(self) -> &'static str {
        self.0.summary
    }

    /// Extensions of its files, in lower case.
    pub fn extensions(self) -> &'static [&'static str] {
        self.0.extensions
    }

    /// Whether meshes can be written in it.
    pub fn is_writable(self) -> bool {
        self.0.writer.is_some()
    }

    /// The format that a file's extension names, in any case; `None` for another extension.
    pub fn from_path(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        Self::ALL.iter().copied().find(|format| format.0.extensions.contains(&&*extension))
    }

    /// The names of the formats that are read, for help texts and messages.
    pub fn readable_names() -> String {
        listed(Self::ALL.iter().copied())
    }

    /// The names of the formats that are written, for help texts and messages.
    pub fn writable_names() -> String {
        listed(Self::ALL.iter().copied().filter(|format| format.is_writable()))
    }

    /// The format that the first bytes of a file show; some formats show none.
    fn from_content(bytes: &[u8]) -> Option<Self> {
        Self::ALL.iter().copied().find(|format| (format.0.recognise)(bytes))
    }

    /// The format of a file: by its extension and, where that is unknown, by its first bytes.
    pub(super) fn of(input: Input<'_>) -> Result<Self> {
        if input.bytes.is_empty() {
            return Err(input.error("byte 0", "a mesh", "an empty file"));
        }
        match (Self::from_path(input.path), Self::from_content(input.bytes)) {
            // The two forms of glTF are told apart by their first bytes alone.
            (Some(named), Some(shown)) if named.name() == "gltf" && shown.name() == "glb" => {
                Ok(shown)
            }
            (Some(format), _) | (None, Some(format)) => Ok(format),
            (None, None) => {
                let expected = format!("a mesh file: {}", Self::readable_names());
                if let Some(error) = input.misnamed(&expected, "none of these") {
                    return Err(error);
                }
                let found = quote(&input.bytes[..input.bytes.len().min(16)]);
                Err(input.error("byte 0", expected, found))
            }
        }
    }

    /// The error of a file that this format cannot read because it is another, by its first bytes:
    /// another format of this table, or none. `None` where nothing shows.
    pub(super) fn misnamed(self, input: Input<'_>) -> Option<Error> {
        let expected = format!("a mesh in the format {self}, as the name says");
        input.misnamed(&expected, self.name()).or_else(|| {
            let shown = Self::from_content(input.bytes).filter(|shown| *shown != self)?;
            let found = match shown.name() {
                "gltf" => "JSON".to_owned(), // any: only its reader knows whether it is a mesh
                name => format!("a mesh in the format {name}: name the file accordingly"),
            };
            Some(input.error("first bytes", expected, found))
        })
    }

    pub(super) fn row(self) -> &'static FormatRow {
        self.0
    }
}

impl FromStr for MeshFormat {
    type Err = Error;

    /// # Errors
    /// [`Error::OutOfRange`] for another name.
    fn from_str(text: &str) -> Result<Self> {
        Self::ALL.iter().copied().find(|format| format.name() == text).ok_or_else(|| {
            let names = Self::ALL.iter().map(|format| format.name());
            let (expected, found) = (Self::readable_names(), unknown_name(text, names));
            Error::OutOfRange { what: "mesh format", expected, found }
        })
    }
}

impl PartialEq for MeshFormat {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}

impl Eq for MeshFormat {}

impl fmt::Display for MeshFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl fmt::Debug for MeshFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "MeshFormat({})", self.name())
    }
}

/// `a, b or c`.
fn listed(formats: impl Iterator<Item = MeshFormat>) -> String {
    let names: Vec<_> = formats.map(MeshFormat::name).collect();
    match names.split_last() {
        Some((last, rest)) if !rest.is_empty() => format!("{} or {last}", rest.join(", ")),
        _ => names.concat(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_extensions_are_told_once() {
        let extensions: Vec<_> = MeshFormat::ALL.iter().flat_map(|f| f.extensions()).collect();
        for (i, extension) in extensions.iter().enumerate() {
            assert!(!extensions[..i].contains(extension), "{extension} is named twice");
            let format = MeshFormat::from_path(Path::new(&format!("a.{extension}"))).unwrap();
            assert!(format.extensions().contains(extension));
        }
        assert_eq!(MeshFormat::from_path(Path::new("a.txt")), None);
        assert_eq!(MeshFormat::writable_names(), "obj, off, ply, stl or glb");
    }

    #[test]
    fn the_first_bytes_decide_where_the_extension_does_not() {
        let of = |name: &str, bytes: &[u8]| {
            MeshFormat::of(Input { path: Path::new(name), bytes }).map(MeshFormat::name).ok()
        };
        assert_eq!(of("a", b"ply\nformat"), Some("ply"));
        assert_eq!(of("a", b"  STCOFF 1 2 3"), Some("off"));
        assert_eq!(of("a", b"solid x"), Some("stl"));
        assert_eq!(of("a", b" {\"asset\""), Some("gltf"));
        assert_eq!(of("a.gltf", b"glTF\x02"), Some("glb"));
        assert_eq!(of("a.obj", b"glTF\x02"), Some("obj"));
        assert_eq!(of("a", b"v 0 0 0"), None);
    }
}
