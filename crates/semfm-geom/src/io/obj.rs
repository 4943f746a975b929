//! Wavefront OBJ: vertices and faces as they stand, in file order.
//!
//! Grammar: Wavefront, *Advanced Visualizer manual, appendix B1*. Vertices are never merged, split
//! or sorted, whatever their normals and texture coordinates; groups, materials and smoothing do
//! not change the geometry, and a material library is never opened. Vertex colours are the de
//! facto extension `v x y z r g b [a]`.

use std::borrow::Cow;
use std::io::Write;

use super::appearance::{Appearance, rgba_from_floats};
use super::blocks::{push, write_blocks};
use super::format_row::{FormatRow, FormatWriter, MeshParts};
use super::input::{Input, quote};
use super::polygon::{NO_UV, Polygons, Triangles};
use super::text::{Line, Lines, integer, number};
use super::{PointCloud, VertexAttributes};
use crate::math::DVec3;
use crate::{Mesh, Result};

/// The row of the table of formats.
pub(super) const FORMAT: FormatRow = FormatRow {
    name: "obj",
    extensions: &["obj"],
    summary: "Wavefront OBJ",
    recognise: |_| false,
    read,
    read_points: Some(read_points),
    writer: Some(FormatWriter {
        write,
        holds_colors: true,
        holds_scalars: false,
        is_single_precision: false,
    }),
};

/// Reads the faces of an OBJ file; those with one or two corners are points and edges.
fn read(input: Input<'_>) -> Result<MeshParts> {
    let file = ObjFile::read(input)?;
    let vertex_colors = file.vertex_colors();
    // OBJ counts v from the bottom of the image, we from the top as glTF does.
    let uvs: Vec<_> = file.uvs.iter().map(|&[u, v]| [u, 1.0 - v]).collect();
    let Triangles { n_faces, faces, corner_uvs, notes } =
        file.polygons.into_triangles(&file.vertices, &uvs);
    let notes = [file.notes, notes].concat();
    let appearance = Appearance { vertex_colors, corner_uvs, notes, ..Default::default() };
    Ok(MeshParts { vertices: file.vertices, faces, n_faces, appearance })
}

/// Reads the vertices of an OBJ file and drops its faces.
fn read_points(input: Input<'_>) -> Result<PointCloud> {
    let file = ObjFile::read(input)?;
    let colors = file.vertex_colors();
    Ok(PointCloud { points: file.vertices, colors })
}

/// What we take from the file.
#[derive(Default)]
struct ObjFile {
    vertices: Vec<DVec3>,
    /// As written; shorter than `vertices` until the next coloured vertex, NaN for an uncoloured one.
    colors: Vec<[f32; 4]>,
    uvs: Vec<[f32; 2]>,
    polygons: Polygons,
    /// The largest vertex id named and its line: a face may stand before its vertices.
    highest: Option<(usize, u32)>,
    n_bad_uvs: usize,
    notes: Vec<String>,
}

impl ObjFile {
    fn read(input: Input<'_>) -> Result<Self> {
        let mut file = Self::default();
        let mut lines = Lines::new(input)?;
        let mut continued = Vec::new();
        while let Some(mut line) = lines.next() {
            // A backslash at the end of a line continues it on the next one.
            continued.clear();
            while let Some(head) = line.text.strip_suffix(b"\\") {
                let Some(next) = lines.next() else { break };
                continued.extend_from_slice(head);
                continued.push(b' ');
                line.text = next.text;
            }
            let mut text = Cow::Borrowed(line.text);
            if !continued.is_empty() {
                continued.extend_from_slice(line.text);
                text = Cow::Borrowed(&continued);
            }
            file.read_line(input, Line { number: line.number, text: &text }.without_comment())?;
        }
        if let Some((line, id)) = file.highest.filter(|&(_, id)| id as usize >= file.vertices.len())
        {
            let expected = format!("the number of one of the {} vertices", file.vertices.len());
            return Err(input.error(
                format!("line {line}"),
                expected,
                format!("{}", u64::from(id) + 1),
            ));
        }
        let n_uvs = file.uvs.len() as u32;
        let n_missing = file.n_bad_uvs + file.polygons.count_uvs_from(n_uvs);
        if n_missing > 0 {
            file.notes.push(format!(
                "{n_missing} corners name a texture coordinate that does not exist (there are \
                 {n_uvs}) and go without"
            ));
        }
        Ok(file)
    }

    fn read_line(&mut self, input: Input<'_>, line: Line<'_>) -> Result<()> {
        let mut words = line.words();
        match words.next() {
            Some(b"v") => self.read_vertex(input, line),
            Some(b"vt") => self.read_uv(input, line),
            Some(b"f" | b"fo") => self.read_face(input, line),
            _ => Ok(()),
        }
    }

    /// `v x y z`, then nothing, a weight (which only free-form surfaces use), or a colour.
    fn read_vertex(&mut self, input: Input<'_>, line: Line<'_>) -> Result<()> {
        let mut values = [f64::NAN; 7];
        let n_values = numbers(input, line, &mut values)?;
        if n_values < 3 {
            return Err(input.error(line.place(), "3 coordinates", format!("{n_values}")));
        }
        self.vertices.push(DVec3::new(values[0], values[1], values[2]));
        if n_values >= 6 {
            self.colors.resize(self.vertices.len() - 1, [f32::NAN; 4]);
            let alpha = if n_values == 7 { values[6] } else { f64::NAN };
            self.colors.push([values[3], values[4], values[5], alpha].map(|x| x as f32));
        }
        Ok(())
    }

    fn read_uv(&mut self, input: Input<'_>, line: Line<'_>) -> Result<()> {
        let mut values = [0.0; 3];
        if numbers(input, line, &mut values)? == 0 {
            return Err(input.error(line.place(), "a texture coordinate", "nothing"));
        }
        self.uvs.push([values[0] as f32, values[1] as f32]);
        Ok(())
    }

    /// `f` and corners `v`, `v/vt`, `v//vn` or `v/vt/vn`; numbers from 1, or negative from the end.
    fn read_face(&mut self, input: Input<'_>, line: Line<'_>) -> Result<()> {
        let mut n_corners = 0;
        for word in line.words().skip(1) {
            let mut fields = word.split(|&b| b == b'/');
            let vertex = fields.next().unwrap_or_default();
            let id = resolve(vertex, self.vertices.len()).ok_or_else(|| {
                let expected =
                    format!("a vertex number, with {} defined so far", self.vertices.len());
                input.error(line.place(), expected, quote(word))
            })?;
            let uv = match fields.next().filter(|field| !field.is_empty()) {
                None => NO_UV,
                Some(field) => resolve(field, self.uvs.len()).unwrap_or_else(|| {
                    self.n_bad_uvs += 1;
                    NO_UV
                }),
            };
            if self.highest.is_none_or(|(_, highest)| id > highest) {
                self.highest = Some((line.number, id));
            }
            self.polygons.push(id, uv);
            n_corners += 1;
        }
        if n_corners == 0 {
            return Err(input.error(line.place(), "the corners of a face", "none"));
        }
        self.polygons.close();
        Ok(())
    }

    /// Colours as bytes. They are in 0..1 or, in some files, in 0..255: one value above 1 tells.
    fn vertex_colors(&self) -> Option<Vec<[u8; 4]>> {
        let bytes = self.colors.iter().flatten().any(|&x| x > 1.0);
        let scale = if bytes { 1.0 / 255.0 } else { 1.0 };
        let missing = [f32::NAN; 4];
        (!self.colors.is_empty()).then(|| {
            (0..self.vertices.len())
                .map(|i| {
                    rgba_from_floats(self.colors.get(i).unwrap_or(&missing).map(|x| x * scale))
                })
                .collect()
        })
    }
}

/// Fills `values` with the numbers after the keyword and tells how many the line has (at most
/// `values.len()`; what follows is not ours).
fn numbers(input: Input<'_>, line: Line<'_>, values: &mut [f64]) -> Result<usize> {
    let mut n_values = 0;
    for (value, word) in values.iter_mut().zip(line.words().skip(1)) {
        *value = number(word).ok_or_else(|| input.error(line.place(), "a number", quote(word)))?;
        n_values += 1;
    }
    Ok(n_values)
}

/// The 0-based id meant by a number that counts from 1, or back from the last of `n_so_far`.
fn resolve(word: &[u8], n_so_far: usize) -> Option<u32> {
    let given = integer(word)?;
    let id = match given {
        0 => return None,
        1.. => given - 1,
        _ => given.checked_add(n_so_far as i64)?,
    };
    u32::try_from(id).ok().filter(|&id| id != NO_UV)
}

/// Writes `v x y z [r g b]` and `f` lines, in the shortest digits that read back as the same number.
fn write(
    out: &mut dyn Write,
    mesh: &Mesh,
    attributes: &VertexAttributes<'_>,
) -> std::io::Result<()> {
    write_blocks(out, mesh.vertices().iter().enumerate(), |block, (i, p)| {
        push(block, format_args!("v {:?} {:?} {:?}", p.x, p.y, p.z));
        if let Some(colors) = attributes.colors {
            let [r, g, b, _] = colors[i].map(|c| f32::from(c) / 255.0);
            push(block, format_args!(" {r} {g} {b}"));
        }
        block.push(b'\n');
    })?;
    write_blocks(out, mesh.faces(), |block, face| {
        let [a, b, c] = face.map(|id| u64::from(id) + 1);
        push(block, format_args!("f {a} {b} {c}\n"));
    })
}
