//! What the first bytes of a file show, where it is not what its name says.

use super::input::Input;
use crate::Error;

/// A pointer of Git LFS stands in for a file that was not downloaded.
const LFS_POINTER: &str =
    "a Git LFS pointer, which only stands for the file: fetch the file with `git lfs pull`";

/// What a file holds by its first bytes, in words; `None` for contents without a mark of their own.
pub(crate) fn kind_of(bytes: &[u8]) -> Option<&'static str> {
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start();
    let starts = |mark: &[u8]| bytes.starts_with(mark);
    let reads = |mark: &str| {
        text.get(..mark.len()).is_some_and(|start| start.eq_ignore_ascii_case(mark.as_bytes()))
    };
    if reads("version https://git-lfs.github.com/spec/") {
        Some(LFS_POINTER)
    } else if reads("/annex/objects/") || reads("../.git/annex/") {
        Some("a git-annex pointer, which only stands for the file: fetch it with `git annex get`")
    } else if reads("<!doctype html") || reads("<html") || reads("<head") {
        Some("an HTML page, as a server sends in place of a file: download the file itself")
    } else if starts(b"\x89PNG\r\n\x1a\n") {
        Some("a PNG picture")
    } else if starts(b"\xff\xd8\xff") {
        Some("a JPEG picture")
    } else if starts(b"RIFF") && bytes.get(8..12) == Some(b"WEBP") {
        Some("a WebP picture")
    } else if starts(b"GIF87a") || starts(b"GIF89a") {
        Some("a GIF picture")
    } else if starts(b"II*\0") || starts(b"MM\0*") {
        Some("a TIFF picture")
    } else if starts(b"PK\x03\x04") || starts(b"PK\x05\x06") {
        Some("a ZIP archive")
    } else if starts(b"\x1f\x8b") {
        Some("gzip-compressed data: unpack it first")
    } else if starts(b"\x28\xb5\x2f\xfd") {
        Some("zstd-compressed data: unpack it first")
    } else if starts(b"\xfd7zXZ\0") {
        Some("xz-compressed data: unpack it first")
    } else if starts(b"%PDF-") {
        Some("a PDF document")
    } else if starts(b"\x89HDF\r\n\x1a\n") {
        Some("an HDF5 file")
    } else if starts(b"\x93NUMPY") {
        Some("a NumPy array (.npy)")
    } else if starts(b"\x89MCAP0\r\n") {
        Some("an MCAP file")
    } else if starts(b"glTF\x02\0\0\0") || starts(b"glTF\x01\0\0\0") {
        Some("a binary glTF mesh (.glb)")
    } else if starts(b"ply\n") || starts(b"ply\r") {
        Some("a PLY mesh (.ply)")
    } else if starts(b"Kaydara FBX Binary") {
        Some("an FBX scene: export it as glTF (.glb)")
    } else if starts(b"BLENDER") {
        Some("a Blender scene: export it as glTF (.glb)")
    } else if starts(b"PXR-USDC") || reads("#usda") {
        Some("a USD scene: export it as glTF (.glb)")
    } else if starts(b"# .PCD") || reads("VERSION .7\nFIELDS") || reads("VERSION 0.7\nFIELDS") {
        Some("a point cloud (.pcd)")
    } else if reads("<?xml") || reads("<robot") || reads("<COLLADA") {
        Some("XML")
    } else {
        None
    }
}

/// Contents that no reader of ours takes under any name.
pub(crate) fn stand_in(bytes: &[u8]) -> Option<&'static str> {
    kind_of(bytes).filter(|kind| {
        *kind == LFS_POINTER || kind.starts_with("a git-annex") || kind.starts_with("an HTML")
    })
}

impl Input<'_> {
    /// The error of a file whose contents have a mark of their own, and not that of the format
    /// `name`; `None` where there is no such mark. A parser's complaint about the third byte of a
    /// picture helps nobody.
    pub fn misnamed(&self, expected: &str, name: &str) -> Option<Error> {
        let kind = kind_of(self.bytes)?;
        let is_own = kind.ends_with(&format!("(.{name})"));
        (!is_own).then(|| self.error("first bytes", expected, kind))
    }
}

/// What the file is instead, where its first bytes say so: for readers outside this crate, whose
/// own error is about a place in the file.
///
/// ```
/// use semfm_geom::io::foreign_kind;
/// let pointer = b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n";
/// assert!(foreign_kind(pointer).unwrap().contains("git lfs pull"));
/// assert_eq!(foreign_kind(b"{}"), None);
/// ```
pub fn foreign_kind(bytes: &[u8]) -> Option<&'static str> {
    kind_of(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_told_and_plain_text_has_none() {
        for (bytes, word) in [
            (&b"version https://git-lfs.github.com/spec/v1\noid"[..], "LFS"),
            (b"\xef\xbb\xbf\n<!DOCTYPE HTML>", "HTML"),
            (b"<html lang", "HTML"),
            (b"\x89PNG\r\n\x1a\n\0", "PNG"),
            (b"PK\x03\x04", "ZIP"),
            (b"glTF\x02\0\0\0", "glb"),
            (b"ply\nformat", "PLY"),
            (b"\x1f\x8b\x08", "gzip"),
        ] {
            assert!(kind_of(bytes).is_some_and(|kind| kind.contains(word)), "{word}");
        }
        for bytes in [&b""[..], b"{}", b"v 0 0 0\n", b"OFF\n3 1 0", b"solid x", b"plyx", b"glTFx"] {
            assert_eq!(kind_of(bytes), None);
        }
        assert!(stand_in(b"<html>").is_some() && stand_in(b"ply\n").is_none());
    }
}
