//! OFF, the Object File Format of Geomview, with its prefixes `ST`, `C` and `N`.
//!
//! Grammar: S. Levy et al., *Geomview manual*, "OFF files". Each vertex row is x y z, then a normal
//! for `N`, a colour for `C`, a texture coordinate for `ST`; a face row is its corner count, the
//! corners and an optional colour. A `#` hides the rest of its line. The edge count may be missing.

use std::io::Write;

use super::appearance::{Appearance, rgba_from_floats};
use super::blocks::{push, write_blocks};
use super::format_row::{FormatRow, FormatWriter, MeshParts};
use super::input::{Input, quote};
use super::polygon::{NO_UV, Polygons, Triangles};
use super::text::{Lines, Words, number};
use super::{PointCloud, VertexAttributes};
use crate::math::DVec3;
use crate::{Error, Mesh, Result};

/// The row of the table of formats.
pub(super) const FORMAT: FormatRow = FormatRow {
    name: "off",
    extensions: &["off"],
    summary: "Geomview's Object File Format",
    recognise,
    read,
    read_points: Some(read_points),
    writer: Some(FormatWriter {
        write,
        holds_colors: true,
        holds_scalars: false,
        is_single_precision: false,
    }),
};

/// Whether the first word is `OFF` with any prefix.
fn recognise(bytes: &[u8]) -> bool {
    let mut words = bytes.trim_ascii_start().split(|b| !b.is_ascii_uppercase());
    words.next().is_some_and(|word| word.ends_with(b"OFF"))
}

/// Reads an ascii OFF file.
fn read(input: Input<'_>) -> Result<MeshParts> {
    let mut reader = Reader::open(input)?;
    let vertices = reader.vertices()?;
    let polygons = reader.polygons()?;
    let Triangles { n_faces, faces, corner_uvs, notes } =
        polygons.into_triangles(&vertices, &reader.uvs);
    let vertex_colors = reader.vertex_colors();
    let appearance = Appearance { vertex_colors, corner_uvs, notes, ..Default::default() };
    Ok(MeshParts { vertices, faces, n_faces, appearance })
}

/// Reads the vertices alone.
fn read_points(input: Input<'_>) -> Result<PointCloud> {
    let mut reader = Reader::open(input)?;
    let points = reader.vertices()?;
    Ok(PointCloud { points, colors: reader.vertex_colors() })
}

struct Reader<'a> {
    input: Input<'a>,
    words: Words<'a>,
    has_normals: bool,
    has_colors: bool,
    has_uvs: bool,
    n_vertices: usize,
    n_faces: usize,
    colors: Vec<[f32; 4]>,
    uvs: Vec<[f32; 2]>,
}

impl<'a> Reader<'a> {
    fn open(input: Input<'a>) -> Result<Self> {
        let mut words = Words::new(input, Lines::new(input)?, true);
        let header = words.peek_line().unwrap_or_default();
        let mut rest = header;
        let [has_uvs, has_colors, has_normals, keyword] =
            [&b"ST"[..], b"C", b"N", b"OFF"].map(|prefix| take_prefix(&mut rest, prefix));
        // The counts may be glued to the keyword, as in a well-known data set.
        let sound = rest.first().is_none_or(|b| b.is_ascii_whitespace() || b.is_ascii_digit());
        if !keyword || !sound || rest.trim_ascii_start().starts_with(b"BINARY") {
            let found = if header.is_empty() { "an empty file".into() } else { quote(header) };
            let expected = "OFF, with or without ST, C or N before it, in ascii";
            return Err(input.error("header", expected, found));
        }
        let n_skipped = header.len() - rest.len();
        words.skip_bytes(n_skipped);
        let n_vertices = count(input, &mut words, "the number of vertices")?;
        let n_faces = count(input, &mut words, "the number of faces")?;
        words.finish_line();
        let mut reader = Self {
            input,
            words,
            has_normals,
            has_colors,
            has_uvs,
            n_vertices,
            n_faces,
            colors: vec![],
            uvs: vec![],
        };
        // The shortest vertex row is `0 0 0` and its line end, the shortest face row `0`.
        reader.require_bytes(
            n_vertices.saturating_mul(6).saturating_add(n_faces.saturating_mul(2)),
        )?;
        Ok(reader)
    }

    /// Refuses counts that the rest of the file cannot hold, before anything is reserved for them.
    fn require_bytes(&mut self, n_bytes: usize) -> Result<()> {
        // One line end may be missing at the end of the file.
        let left = self.words.bytes_left() + 1;
        if n_bytes <= left {
            return Ok(());
        }
        let expected = format!("{} vertices and {} faces", self.n_vertices, self.n_faces);
        Err(self.input.error(self.words.place(), expected, format!("only {left} bytes more")))
    }

    fn vertices(&mut self) -> Result<Vec<DVec3>> {
        let mut vertices = Vec::with_capacity(self.n_vertices);
        for _ in 0..self.n_vertices {
            let [x, y, z] = self.triple("a vertex coordinate")?;
            vertices.push(DVec3::new(x, y, z));
            if self.has_normals {
                self.triple("a normal")?;
            }
            let mut extras = Vec::new();
            while let Some(word) = self.words.next_on_line() {
                let value = number(word).ok_or_else(|| self.words.unexpected("a number", word))?;
                extras.push(value as f32);
            }
            self.extras_of_vertex(&extras)?;
        }
        Ok(vertices)
    }

    fn triple(&mut self, what: &str) -> Result<[f64; 3]> {
        Ok([self.words.number(what)?, self.words.number(what)?, self.words.number(what)?])
    }

    /// Colour of three or four numbers, then the texture coordinate: what the prefix announced.
    fn extras_of_vertex(&mut self, extras: &[f32]) -> Result<()> {
        let n_uv = if self.has_uvs { 2 } else { 0 };
        if extras.len() < n_uv {
            let expected = "a texture coordinate at the end of the row";
            return Err(self.too_few_numbers(expected, extras.len()));
        }
        let (color, uv) = extras.split_at(extras.len() - n_uv);
        if self.has_colors {
            let &[r, g, b, ..] = color else {
                return Err(self.too_few_numbers("a colour of 3 or 4 numbers", extras.len()));
            };
            self.colors.push([r, g, b, color.get(3).copied().unwrap_or(f32::NAN)]);
        }
        if self.has_uvs {
            self.uvs.push([uv[0], 1.0 - uv[1]]);
        }
        Ok(())
    }

    fn too_few_numbers(&self, expected: &str, n_found: usize) -> Error {
        self.input.error(self.words.place(), expected, format!("{n_found} numbers"))
    }

    fn polygons(&mut self) -> Result<Polygons> {
        let mut polygons =
            if self.has_uvs { Polygons::with_uvs_by_vertex() } else { Polygons::default() };
        for _ in 0..self.n_faces {
            let n_corners = count(self.input, &mut self.words, "the number of corners of a face")?;
            if n_corners > self.words.bytes_left() {
                let found = format!("only {} bytes more", self.words.bytes_left());
                return Err(self.input.error(
                    self.words.place(),
                    format!("{n_corners} corners"),
                    found,
                ));
            }
            for _ in 0..n_corners {
                let given = self.words.integer("the number of a vertex")?;
                let id = u32::try_from(given).ok().filter(|&id| (id as usize) < self.n_vertices);
                let id = id.ok_or_else(|| {
                    let expected = format!("one of the {} vertices, from 0", self.n_vertices);
                    self.input.error(self.words.place(), expected, given.to_string())
                })?;
                polygons.push(id, NO_UV);
            }
            polygons.close();
            // What is left on the row is the colour of the face.
            self.words.finish_line();
        }
        Ok(polygons)
    }

    /// Colours as bytes: the format says 0..1, many files have 0..255, and a value above 1 tells.
    fn vertex_colors(&self) -> Option<Vec<[u8; 4]>> {
        let scale = if self.colors.iter().flatten().any(|&x| x > 1.0) { 1.0 / 255.0 } else { 1.0 };
        let colors = self.colors.iter().map(|color| rgba_from_floats(color.map(|x| x * scale)));
        (!self.colors.is_empty()).then(|| colors.collect())
    }
}

/// Whether `rest` starts with `prefix`, which is then taken off.
fn take_prefix(rest: &mut &[u8], prefix: &[u8]) -> bool {
    let tail = rest.strip_prefix(prefix);
    *rest = tail.unwrap_or(*rest);
    tail.is_some()
}

fn count(input: Input<'_>, words: &mut Words<'_>, what: &str) -> Result<usize> {
    let given = words.integer(what)?;
    usize::try_from(given).map_err(|_| input.error(words.place(), what, given.to_string()))
}

/// Writes OFF, or COFF with colours in 0..255, which is what other readers understand.
fn write(
    out: &mut dyn Write,
    mesh: &Mesh,
    attributes: &VertexAttributes<'_>,
) -> std::io::Result<()> {
    let keyword = if attributes.colors.is_some() { "COFF" } else { "OFF" };
    writeln!(out, "{keyword}\n{} {} 0", mesh.n_vertices(), mesh.n_faces())?;
    write_blocks(out, mesh.vertices().iter().enumerate(), |block, (i, p)| {
        push(block, format_args!("{:?} {:?} {:?}", p.x, p.y, p.z));
        if let Some(colors) = attributes.colors {
            let [r, g, b, a] = colors[i];
            push(block, format_args!(" {r} {g} {b} {a}"));
        }
        block.push(b'\n');
    })?;
    write_blocks(out, mesh.faces(), |block, [a, b, c]| {
        push(block, format_args!("3 {a} {b} {c}\n"));
    })
}
