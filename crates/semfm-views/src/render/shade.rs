//! Colour: paint times light, averaged over the samples of each pixel.

use std::fmt;
use std::ops::Range;

use semfm_geom::Mesh;
use semfm_geom::math::DVec3;

use super::raster::{Hit, Raster};
use super::triangle::Projection;
use super::{RenderSettings, Request};
use crate::{Camera, Error, Result};

/// Colour of the surface before lighting, as sRGB values 0 to 1.
///
/// Light is multiplied onto these values as they are, without going through linear light: that is
/// how the pictures that the encoder was measured with were made.
#[derive(Clone, Copy)]
pub enum Paint<'a> {
    /// The same colour everywhere.
    Plain([f32; 3]),
    /// A colour per vertex (n), mixed over each triangle.
    Vertices(&'a [[f32; 3]]),
    /// A function of triangle and barycentric weights (sum 1): textures, corner colours.
    Surface(&'a (dyn Fn(usize, [f64; 3]) -> [f32; 3] + Sync)),
    /// The shading normal as a colour, not lit: x right, y up and z towards the viewer, each from
    /// −1 … 1 to 0 … 1.
    Normals,
}

impl Paint<'_> {
    /// Grey of albedo .72.
    pub const GREY: Self = Self::Plain([0.72; 3]);

    pub(super) fn check(&self, mesh: &Mesh) -> Result<()> {
        match self {
            Self::Vertices(colours) if colours.len() != mesh.n_vertices() => {
                let expected = format!("{}, one per vertex", mesh.n_vertices());
                Err(Error::invalid("vertex colours", expected, colours.len().to_string()))
            }
            _ => Ok(()),
        }
    }
}

impl Default for Paint<'_> {
    fn default() -> Self {
        Self::GREY
    }
}

impl fmt::Debug for Paint<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Plain(colour) => f.debug_tuple("Plain").field(colour).finish(),
            Self::Vertices(colours) => f.debug_tuple("Vertices").field(&colours.len()).finish(),
            Self::Surface(_) => f.debug_tuple("Surface").finish_non_exhaustive(),
            Self::Normals => f.write_str("Normals"),
        }
    }
}

/// Shading normal at each corner of each triangle (m × 3): the area-weighted mean around the vertex
/// where that is within the crease angle of the triangle's own, else the triangle's own.
#[derive(Clone, Debug)]
pub struct CornerNormals(Vec<[[f32; 3]; 3]>);

impl CornerNormals {
    /// Smooths over edges of less than `crease` radians.
    pub fn new(mesh: &Mesh, crease: f64) -> Self {
        let scaled: Vec<DVec3> =
            (0..mesh.n_faces()).map(|face| mesh.face_normal_scaled(face)).collect();
        let mut smooth = vec![DVec3::ZERO; mesh.n_vertices()];
        for (ids, &normal) in mesh.faces().iter().zip(&scaled) {
            for &id in ids {
                smooth[id as usize] += normal;
            }
        }
        for normal in &mut smooth {
            *normal = normal.normalize_or_zero();
        }
        let sharpest = crease.cos();
        let corner_normals = mesh.faces().iter().zip(&scaled).map(|(ids, own)| {
            let own = own.normalize_or_zero();
            ids.map(|id| {
                let smooth = smooth[id as usize];
                let normal = if smooth.dot(own) < sharpest { own } else { smooth };
                normal.as_vec3().to_array()
            })
        });
        Self(corner_normals.collect())
    }

    /// The normals of each triangle's corners (m × 3), unit length or zero.
    pub fn corners(&self) -> &[[[f32; 3]; 3]] {
        &self.0
    }
}

/// Unit vector towards the light, in the object's frame.
pub(crate) fn light_direction(camera: &Camera, settings: &RenderSettings) -> DVec3 {
    let [right, up, back] = settings.light;
    // The camera's own axes are x right, y down, z forward.
    let light = DVec3::new(right, -up, -back).normalize_or_zero();
    camera.camera_from_object.matrix3.transpose() * light
}

/// All that colouring a view needs.
pub(super) struct Shader<'a> {
    projection: &'a Projection<'a>,
    request: &'a Request<'a>,
    settings: &'a RenderSettings,
    /// Unit vector towards the light, in the object's frame.
    light: DVec3,
}

impl<'a> Shader<'a> {
    pub fn new(projection: &'a Projection<'a>, request: &'a Request<'a>) -> Self {
        let settings = request.settings;
        let light = light_direction(projection.camera, settings);
        Self { projection, request, settings, light }
    }

    /// Paints the pixels of `rows` into `rgb` (rows × width × 3).
    pub fn colour(&self, rows: Range<usize>, rgb: &mut [u8]) {
        let per_pixel = self.settings.supersampling as usize;
        let grid_rows = rows.start * per_pixel..rows.end * per_pixel;
        let raster = Raster::new(self.projection, self.settings.supersampling, grid_rows);
        self.mix(&raster, rgb);
    }

    /// Paints the pixels under a raster into `rgb` (rows × width × 3): the mean of their samples.
    pub fn mix(&self, raster: &Raster, rgb: &mut [u8]) {
        let (per_pixel, grid_rows) = (raster.per_pixel as usize, raster.rows.clone());
        let mut grid = raster.hits.chunks_exact(raster.width).zip(grid_rows);
        let mut sums = vec![[0f32; 3]; raster.width / per_pixel];
        let share = 255.0 / (per_pixel * per_pixel) as f32;
        for pixels in rgb.chunks_exact_mut(sums.len() * 3) {
            sums.fill([0.0; 3]);
            for (hits, row) in grid.by_ref().take(per_pixel) {
                self.add_row(raster, hits, raster.position(row), &mut sums);
            }
            for (byte, sum) in pixels.iter_mut().zip(sums.as_flattened()) {
                *byte = (sum * share + 0.5) as u8; // saturates
            }
        }
    }

    /// Adds the colours of one row of samples at height `v` to the sums of its pixels. Neighbours
    /// mostly see the same triangle, so its forms are made once per run.
    fn add_row(&self, raster: &Raster, hits: &[Hit], v: f64, sums: &mut [[f32; 3]]) {
        let mut column = 0;
        for run in hits.chunk_by(|a, b| a.face() == b.face()) {
            let columns = column..column + run.len();
            column = columns.end;
            let mut add = |column: usize, colour: [f32; 3]| {
                let sum = &mut sums[column / raster.per_pixel as usize];
                *sum = [0, 1, 2].map(|k| sum[k] + colour[k]);
            };
            let Some(face) = run[0].face().map(|face| face as usize) else {
                columns.for_each(|column| add(column, self.settings.background));
                continue;
            };
            let Some(forms) = self.projection.forms(face) else { continue };
            let light = self.brightness(face);
            let lit = |corner: usize, colour: [f32; 3]| colour.map(|c| c * light[corner] as f32);
            let corners = match self.request.paint {
                Paint::Plain(colour) => Some([0, 1, 2].map(|corner| lit(corner, *colour))),
                Paint::Vertices(colours) => {
                    let ids = self.projection.mesh.faces()[face];
                    Some([0, 1, 2].map(|corner| lit(corner, colours[ids[corner] as usize])))
                }
                Paint::Normals => Some(self.normal_colours(face)),
                Paint::Surface(_) => None,
            };
            for column in columns {
                let weights = forms.barycentric(raster.position(column), v);
                let colour = match (corners, self.request.paint) {
                    (None, Paint::Surface(colour)) => {
                        let light: f64 = weights.iter().zip(light).map(|(w, l)| w * l).sum();
                        colour(face, weights).map(|c| c * light as f32)
                    }
                    (corners, _) => {
                        let [a, b, c] = corners.unwrap_or_default();
                        let [wa, wb, wc] = weights.map(|w| w as f32);
                        [0, 1, 2].map(|k| wa * a[k] + wb * b[k] + wc * c[k])
                    }
                };
                add(column, colour);
            }
        }
    }

    /// Light on each corner of a triangle, on whichever side it comes from.
    fn brightness(&self, face: usize) -> [f64; 3] {
        let (ambient, ids) = (self.settings.ambient, self.projection.mesh.faces()[face]);
        let normals = self.request.normals.0[face];
        [0, 1, 2].map(|corner| {
            let normal = DVec3::from_array(normals[corner].map(f64::from));
            let cosine = normal.dot(self.light).abs();
            let reaching = f64::from(self.request.light_at(ids[corner] as usize));
            (ambient + (1.0 - ambient) * cosine) * reaching
        })
    }

    /// The corners' normals in camera axes, on the side that the camera sees, as colours.
    fn normal_colours(&self, face: usize) -> [[f32; 3]; 3] {
        let (mesh, camera) = (self.projection.mesh, self.projection.camera);
        let towards = camera.eye() - mesh.vertices()[mesh.faces()[face][0] as usize];
        let side = mesh.face_normal_scaled(face).dot(towards).signum();
        self.request.normals.0[face].map(|normal| {
            let normal = DVec3::from_array(normal.map(f64::from)) * side;
            let [right, down, forward] =
                camera.camera_from_object.transform_vector3(normal).as_vec3().to_array();
            [right, -down, -forward].map(|x| 0.5 + 0.5 * x)
        })
    }
}
