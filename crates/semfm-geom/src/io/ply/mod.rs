//! PLY: vertices, faces and triangle strips of an ascii or binary file, in file order.
//!
//! Any further elements and properties are skipped. Colours come from `red green blue [alpha]`
//! (bytes, or floats in 0..1), texture coordinates from `s t`, `u v` or `texture_u texture_v` of the
//! vertices or from the list `texcoord` of the faces.

mod body;
mod header;
mod write;

use self::body::Body;
use self::header::{Element, Header, Property};
use super::PointCloud;
use super::appearance::{Appearance, rgba_from_floats};
use super::format_row::{FormatRow, FormatWriter, MeshParts};
use super::input::Input;
use super::polygon::{NO_UV, Polygons, Triangles};
use crate::Result;
use crate::math::DVec3;

/// The row of the table of formats.
pub(super) const FORMAT: FormatRow = FormatRow {
    name: "ply",
    extensions: &["ply"],
    summary: "Stanford's Polygon File Format, ascii or binary",
    recognise: |bytes| bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r"),
    read,
    read_points: Some(read_points),
    writer: Some(FormatWriter {
        write: write::write,
        holds_colors: true,
        holds_scalars: true,
        is_single_precision: false,
    }),
};

/// Reads a PLY file as a mesh.
fn read(input: Input<'_>) -> Result<MeshParts> {
    let file = PlyFile::read(input)?;
    let Triangles { n_faces, faces, corner_uvs, notes } =
        file.polygons.into_triangles(&file.vertices, &file.uvs);
    let appearance =
        Appearance { vertex_colors: file.colors, corner_uvs, notes, ..Default::default() };
    Ok(MeshParts { vertices: file.vertices, faces, n_faces, appearance })
}

/// Reads the vertices of a PLY file; it needs no faces.
fn read_points(input: Input<'_>) -> Result<PointCloud> {
    let file = PlyFile::read(input)?;
    Ok(PointCloud { points: file.vertices, colors: file.colors })
}

#[derive(Default)]
struct PlyFile {
    vertices: Vec<DVec3>,
    colors: Option<Vec<[u8; 4]>>,
    /// Of the vertices, then of the face corners that have their own.
    uvs: Vec<[f32; 2]>,
    polygons: Polygons,
}

impl PlyFile {
    fn read(input: Input<'_>) -> Result<Self> {
        let header = Header::parse(input)?;
        let elements = header.elements.clone();
        let n_vertices = elements.iter().find(|e| e.name == "vertex").map_or(0, |e| e.count);
        let vertex_uvs = elements.iter().any(|e| e.name == "vertex" && uv_columns(e).is_some());
        let mut body = Body::new(input, header);
        let mut file = Self::default();
        if vertex_uvs {
            file.polygons = Polygons::with_uvs_by_vertex();
        }
        for element in &elements {
            body.begin(element)?;
            match element.name.as_str() {
                "vertex" => file.read_vertices(input, &mut body, element)?,
                "face" | "tristrips" if element.count > 0 => {
                    let faces = Faces { element, n_vertices, vertex_uvs };
                    faces.read(input, &mut body, &mut file)?;
                }
                _ => skip_rows(&mut body, element)?,
            }
        }
        Ok(file)
    }

    fn read_vertices(
        &mut self,
        input: Input<'_>,
        body: &mut Body<'_>,
        element: &Element,
    ) -> Result<()> {
        let xyz = columns(element, &["x", "y", "z"]);
        let Some(xyz) = xyz.filter(|_| element.count < NO_UV as usize) else {
            let place = format!("header, element {}", element.name);
            return Err(input.error(place, "properties x, y and z", "other ones"));
        };
        let rgb = columns(element, &["red", "green", "blue"]);
        let rgb = rgb.or_else(|| columns(element, &["r", "g", "b"]));
        let alpha = columns(element, &["alpha"]).or_else(|| columns(element, &["a"]));
        let uv = uv_columns(element);
        // Face corners may have pushed their own already.
        let face_uvs = std::mem::take(&mut self.uvs);
        let mut colors = Vec::with_capacity(if rgb.is_some() { element.count } else { 0 });
        self.vertices.reserve_exact(element.count);
        let mut values = vec![f64::NAN; element.properties.len()];
        for _ in 0..element.count {
            for (value, property) in values.iter_mut().zip(&element.properties) {
                match property.length {
                    Some(_) => body.skip(property)?,
                    None => *value = body.scalar(property.scalar)?,
                }
            }
            body.end_row()?;
            self.vertices.push(DVec3::new(values[xyz[0]], values[xyz[1]], values[xyz[2]]));
            if let Some(rgb) = &rgb {
                let alpha = alpha.as_ref().map(|alpha| alpha[0]);
                let channels = [Some(rgb[0]), Some(rgb[1]), Some(rgb[2]), alpha];
                colors.push(rgba_from_floats(channels.map(|column| {
                    column.map_or(f32::NAN, |column| channel(element, &values, column))
                })));
            }
            if let Some(uv) = &uv {
                // PLY counts v from the bottom of the image.
                self.uvs.push([values[uv[0]] as f32, 1.0 - values[uv[1]] as f32]);
            }
        }
        self.uvs.extend(face_uvs);
        self.colors = rgb.is_some().then_some(colors);
        Ok(())
    }
}

/// A colour's number in 0..1: whole numbers stand for 255ths.
fn channel(element: &Element, values: &[f64], column: usize) -> f32 {
    let full = if element.properties[column].scalar.is_integer() { 255.0 } else { 1.0 };
    (values[column] / full) as f32
}

/// How the rows of `face` or `tristrips` are to be read.
struct Faces<'a> {
    element: &'a Element,
    n_vertices: usize,
    vertex_uvs: bool,
}

/// Whether a property is the list of a face's vertices.
fn is_ids(property: &Property) -> bool {
    matches!(property.name.as_str(), "vertex_indices" | "vertex_index")
        && property.length.is_some()
        && property.scalar.is_integer()
}

impl Faces<'_> {
    fn read(&self, input: Input<'_>, body: &mut Body<'_>, file: &mut PlyFile) -> Result<()> {
        if !self.element.properties.iter().any(is_ids) {
            let place = format!("header, element {}", self.element.name);
            return Err(input.error(place, "a list vertex_indices of whole numbers", "none"));
        }
        let strips = self.element.name == "tristrips";
        let (mut ids, mut texture) = (Vec::new(), Vec::new());
        for _ in 0..self.element.count {
            texture.clear();
            for property in &self.element.properties {
                match property.length {
                    Some(_) if is_ids(property) => {
                        self.read_ids(input, body, property, strips, &mut ids)?
                    }
                    Some(length) if property.name == "texcoord" && !self.vertex_uvs => {
                        let n_items = body.length(length, property.scalar)?;
                        for _ in 0..n_items {
                            texture.push(body.scalar(property.scalar)? as f32);
                        }
                    }
                    _ => body.skip(property)?,
                }
            }
            body.end_row()?;
            if strips {
                push_strips(&mut file.polygons, &ids);
            } else {
                self.push_face(file, &ids, &texture);
            }
        }
        Ok(())
    }

    /// Vertex ids of one row; −1 restarts a strip.
    fn read_ids(
        &self,
        input: Input<'_>,
        body: &mut Body<'_>,
        property: &Property,
        strips: bool,
        ids: &mut Vec<u32>,
    ) -> Result<()> {
        ids.clear();
        let n_ids = body.length(property.length.unwrap_or(property.scalar), property.scalar)?;
        for _ in 0..n_ids {
            let given = body.scalar(property.scalar)?;
            if strips && given == -1.0 {
                ids.push(RESTART);
                continue;
            }
            if given < 0.0
                || given >= self.n_vertices as f64
                || given.fract() != 0.0
                || given.is_nan()
            {
                let expected = format!("one of the {} vertices, from 0", self.n_vertices);
                return Err(input.error(body.place(), expected, format!("{given:?}")));
            }
            ids.push(given as u32);
        }
        Ok(())
    }

    fn push_face(&self, file: &mut PlyFile, ids: &[u32], texture: &[f32]) {
        let own_uvs = !ids.is_empty() && texture.len() == 2 * ids.len();
        for (corner, &id) in ids.iter().enumerate() {
            let uv = if own_uvs {
                file.uvs.push([texture[2 * corner], 1.0 - texture[2 * corner + 1]]);
                file.uvs.len() as u32 - 1
            } else {
                NO_UV
            };
            file.polygons.push(id, uv);
        }
        file.polygons.close();
    }
}

/// Stands for −1 among the ids of strips; a file with so many vertices is refused.
const RESTART: u32 = u32::MAX;

/// Adds the triangles of strips, every other one turned so that all face the same way.
fn push_strips(polygons: &mut Polygons, ids: &[u32]) {
    for strip in ids.split(|&id| id == RESTART) {
        for (i, corners) in strip.windows(3).enumerate() {
            let [a, b, c] = [corners[0], corners[1], corners[2]];
            for id in if i % 2 == 0 { [a, b, c] } else { [b, a, c] } {
                polygons.push(id, NO_UV);
            }
            polygons.close();
        }
    }
}

/// The columns with these names, if all are there and none is a list.
fn columns(element: &Element, names: &[&str]) -> Option<Vec<usize>> {
    let column =
        |name: &&str| element.properties.iter().position(|p| p.name == *name && p.length.is_none());
    names.iter().map(column).collect()
}

fn uv_columns(element: &Element) -> Option<Vec<usize>> {
    [["s", "t"], ["u", "v"], ["texture_u", "texture_v"]]
        .iter()
        .find_map(|names| columns(element, names))
}

fn skip_rows(body: &mut Body<'_>, element: &Element) -> Result<()> {
    for _ in 0..element.count {
        element.properties.iter().try_for_each(|property| body.skip(property))?;
        body.end_row()?;
    }
    Ok(())
}
