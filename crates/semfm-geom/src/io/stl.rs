//! STL, ascii and binary: a soup of triangles whose equal corners become one vertex.
//!
//! Two corners are the same vertex when their coordinates are equal bit for bit, in order of first
//! appearance; nearby corners are kept apart. All solids of an ascii file are read.

use std::collections::HashMap;
use std::io::Write;

use super::VertexAttributes;
use super::appearance::Appearance;
use super::blocks::write_blocks;
use super::format_row::{FormatRow, FormatWriter, MeshParts};
use super::input::Input;
use super::text::{Lines, Words};
use crate::math::DVec3;
use crate::{Mesh, Result};

/// Bytes before the triangles of a binary file: 80 of anything, then their number.
const HEADER: usize = 84;
/// Bytes of a binary triangle: normal, three corners, two bytes of anything.
const TRIANGLE: usize = 50;

/// The row of the table of formats.
pub(super) const FORMAT: FormatRow = FormatRow {
    name: "stl",
    extensions: &["stl"],
    summary: "stereolithography, ascii or binary",
    recognise: |bytes| bytes.trim_ascii_start().starts_with(b"solid"),
    read,
    read_points: None,
    writer: Some(FormatWriter {
        write,
        holds_colors: false,
        holds_scalars: false,
        is_single_precision: true,
    }),
};

/// Reads an STL file of either kind.
fn read(input: Input<'_>) -> Result<MeshParts> {
    let mut soup = Soup::default();
    if is_ascii(input.bytes) {
        read_ascii(input, &mut soup)?
    } else {
        read_binary(input, &mut soup)?
    }
    let n_faces = soup.faces.len();
    let appearance = Appearance::default();
    Ok(MeshParts { vertices: soup.vertices, faces: soup.faces, n_faces, appearance })
}

/// Tells the kinds apart. The word `solid` is not enough: many binary files start with it, so the
/// length that a binary header announces goes first, and then whether the start reads as text.
fn is_ascii(bytes: &[u8]) -> bool {
    const LOOK_AT: usize = 512;
    let start = bytes.trim_ascii_start();
    let solid = start.get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    let binary_length = n_binary(bytes).and_then(|n| n.checked_mul(TRIANGLE)?.checked_add(HEADER));
    let is_text = bytes.iter().take(LOOK_AT).all(|b| *b >= b' ' || b.is_ascii_whitespace());
    solid && binary_length != Some(bytes.len()) && is_text
}

/// The number of triangles in the header of a binary file.
fn n_binary(bytes: &[u8]) -> Option<usize> {
    let count = bytes.get(80..HEADER)?;
    Some(u32::from_le_bytes(count.try_into().ok()?) as usize)
}

fn read_binary(input: Input<'_>, soup: &mut Soup) -> Result<()> {
    let Some(n_triangles) = n_binary(input.bytes) else {
        return Err(input.error("header", "84 bytes, or the word solid", input.left_after(0)));
    };
    let body = &input.bytes[HEADER..];
    let n_present = body.len() / TRIANGLE;
    if n_present < n_triangles {
        let found = format!("bytes for {n_present}");
        return Err(input.error("byte 80", format!("{n_triangles} triangles"), found));
    }
    soup.faces.reserve_exact(n_triangles);
    for triangle in body.chunks_exact(TRIANGLE).take(n_triangles) {
        // The normal's three numbers come first.
        let (numbers, _) = triangle[12..48].as_chunks::<4>();
        soup.add([0, 3, 6].map(|first| {
            let [x, y, z] = [0, 1, 2].map(|k| f64::from(f32::from_le_bytes(numbers[first + k])));
            DVec3::new(x, y, z)
        }));
    }
    Ok(())
}

fn read_ascii(input: Input<'_>, soup: &mut Soup) -> Result<()> {
    let mut words = Words::new(input, Lines::new(input)?, false);
    while let Some(word) = words.next_word() {
        expect(&words, word, "solid")?;
        // The name, which may hold anything, ends with its line.
        words.finish_line();
        while !read_facet(&mut words, soup)? {}
    }
    Ok(())
}

/// Reads a facet, or the end of the solid, which it reports.
fn read_facet(words: &mut Words<'_>, soup: &mut Soup) -> Result<bool> {
    let word = words.next_word().unwrap_or_default();
    if word.eq_ignore_ascii_case(b"endsolid") {
        words.finish_line();
        return Ok(true);
    }
    expect(words, word, "facet")?;
    // The word `normal` and its numbers: they follow from the corners, and files are careless.
    for _ in 0..4 {
        words.next_word();
    }
    for keyword in ["outer", "loop"] {
        let word = words.next_word().unwrap_or_default();
        expect(words, word, keyword)?;
    }
    let mut corners = [DVec3::ZERO; 3];
    for corner in &mut corners {
        let word = words.next_word().unwrap_or_default();
        expect(words, word, "vertex")?;
        for axis in 0..3 {
            corner[axis] = words.number("a vertex coordinate")?;
        }
    }
    for keyword in ["endloop", "endfacet"] {
        let word = words.next_word().unwrap_or_default();
        expect(words, word, keyword)?;
    }
    soup.add(corners);
    Ok(false)
}

fn expect(words: &Words<'_>, word: &[u8], keyword: &str) -> Result<()> {
    if word.eq_ignore_ascii_case(keyword.as_bytes()) {
        return Ok(());
    }
    let keyword = if keyword == "facet" { "facet or endsolid" } else { keyword };
    let found = if word.is_empty() { b"the end of the file" } else { word };
    Err(words.unexpected(keyword, found))
}

/// Triangles whose corners are joined where they are bitwise equal.
#[derive(Default)]
struct Soup {
    vertices: Vec<DVec3>,
    faces: Vec<[u32; 3]>,
    ids: HashMap<[u64; 3], u32>,
}

impl Soup {
    fn add(&mut self, corners: [DVec3; 3]) {
        let face = corners.map(|corner| {
            *self.ids.entry(corner.to_array().map(f64::to_bits)).or_insert_with(|| {
                self.vertices.push(corner);
                self.vertices.len() as u32 - 1
            })
        });
        self.faces.push(face);
    }
}

/// Writes binary STL.
fn write(out: &mut dyn Write, mesh: &Mesh, _: &VertexAttributes<'_>) -> std::io::Result<()> {
    // Anything but the word `solid`, which would look like an ascii file.
    let mut header = [b' '; 80];
    header[..15].copy_from_slice(b"binary STL mesh");
    out.write_all(&header)?;
    out.write_all(&(mesh.n_faces() as u32).to_le_bytes())?;
    write_blocks(out, 0..mesh.n_faces(), |block, face| {
        let normal = mesh.face_normal_scaled(face).normalize_or_zero();
        for p in std::iter::once(normal).chain(mesh.corners(face)) {
            block.extend(p.as_vec3().to_array().iter().flat_map(|x| x.to_le_bytes()));
        }
        block.extend([0, 0]);
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn corners_join_only_where_all_bits_agree() {
        let text = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n\
                    endloop\nendfacet\nfacet normal nan nan nan\nouter loop\nvertex -0 0 0\nvertex 1 0 0\n\
                    vertex 0 1 0.0000001\nendloop\nendfacet\nendsolid";
        let parts = read(Input { path: Path::new("x.stl"), bytes: text.as_bytes() }).unwrap();
        assert_eq!(parts.faces, [[0, 1, 2], [3, 1, 4]]);
    }

    #[test]
    fn a_cut_ascii_file_is_refused() {
        let text = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n\
                    endloop\nendfacet\n";
        let error = read(Input { path: Path::new("x.stl"), bytes: text.as_bytes() }).err().unwrap();
        assert!(error.to_string().contains("endsolid"), "{error}");
    }
}
