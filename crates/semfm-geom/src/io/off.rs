//! OFF, the Object File Format of Geomview, with its prefixes `ST`, `C` and `N`.
//!
//! Grammar: S. Levy et al., *Geomview manual*, "OFF files". Each vertex row is x y z, then a normal
//! for `N`, a colour for `C`, a texture coordinate for `ST`; a face row is its corner count, the
//! corners and an optional colour. A `#` hides the rest of its line. The edge count may be missing.

use super::appearance::{Appearance, rgba_from_floats};
use super::input::{Input, quote};
use super::polygon::{NO_UV, Polygons, Triangles};
use super::text::{Lines, Words, number};
use super::{MeshParts, PointCloud};
use crate::Result;
use crate::math::DVec3;

/// Reads an ascii OFF file.
pub(crate) fn read(input: Input<'_>) -> Result<MeshParts> {
    let mut reader = Reader::open(input)?;
    let vertices = reader.vertices()?;
    let polygons = reader.polygons()?;
    let Triangles { n_faces, faces, corner_uvs } = polygons.into_triangles(&vertices, &reader.uvs);
    let appearance =
        Appearance { vertex_colors: reader.vertex_colors(), corner_uvs, ..Default::default() };
    Ok(MeshParts { vertices, faces, n_faces, appearance })
}

/// Reads the vertices alone.
pub(crate) fn read_points(input: Input<'_>) -> Result<PointCloud> {
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
        let header_error = || {
            let found = if header.is_empty() { "an empty file".into() } else { quote(header) };
            input.error("header", "OFF, with or without ST, C or N before it, in ascii", found)
        };
        let mut rest = header;
        let mut has = |prefix: &[u8]| match rest.strip_prefix(prefix) {
            Some(tail) => {
                rest = tail;
                true
            }
            None => false,
        };
        let (has_uvs, has_colors, has_normals) = (has(b"ST"), has(b"C"), has(b"N"));
        // The counts may be glued to the keyword, as in a well-known data set.
        let keyword = has(b"OFF");
        let sound = rest.first().is_none_or(|b| b.is_ascii_whitespace() || b.is_ascii_digit());
        if !keyword || !sound || rest.trim_ascii_start().starts_with(b"BINARY") {
            return Err(header_error());
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
        let missing = |reader: &Self, what: &str| {
            reader.input.error(reader.words.place(), what, format!("{} numbers", extras.len()))
        };
        if extras.len() < n_uv {
            return Err(missing(self, "a texture coordinate at the end of the row"));
        }
        let (color, uv) = extras.split_at(extras.len() - n_uv);
        if self.has_colors {
            let &[r, g, b, ..] = color else {
                return Err(missing(self, "a colour of 3 or 4 numbers"));
            };
            self.colors.push([r, g, b, color.get(3).copied().unwrap_or(f32::NAN)]);
        }
        if self.has_uvs {
            self.uvs.push([uv[0], 1.0 - uv[1]]);
        }
        Ok(())
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
        let bytes = |color: &[f32; 4]| rgba_from_floats(color.map(|x| x * scale));
        (!self.colors.is_empty()).then(|| self.colors.iter().map(bytes).collect())
    }
}

fn count(input: Input<'_>, words: &mut Words<'_>, what: &str) -> Result<usize> {
    let given = words.integer(what)?;
    usize::try_from(given).map_err(|_| input.error(words.place(), what, given.to_string()))
}
