//! Colour: the surface's own times light, averaged over the samples of each pixel.

use std::fmt;

use semfm_geom::math::DVec3;
use semfm_geom::{Mesh, Pinhole};

use super::raster::{Hit, Raster};
use super::triangle::{Projection, TriangleForms};
use super::{RenderSettings, Request};
use crate::{Error, Result};

/// Colour of the surface before lighting, as sRGB values 0 to 1.
///
/// Light is multiplied onto these values as they are, without going through linear light: that is
/// how the pictures that the encoder was measured with were made.
#[derive(Clone, Copy)]
pub enum SurfaceColor<'a> {
    /// The same colour everywhere.
    Uniform([f32; 3]),
    /// A colour per vertex (n), mixed over each triangle.
    Vertices(&'a [[f32; 3]]),
    /// A function of triangle and barycentric weights (sum 1): textures, corner colors.
    Surface(&'a (dyn Fn(usize, [f64; 3]) -> [f32; 3] + Sync)),
    /// The shading normal as a colour, not lit: x right, y up and z towards the viewer, each from
    /// −1 … 1 to 0 … 1.
    Normals,
}

impl SurfaceColor<'_> {
    /// Grey of albedo .72.
    pub const GREY: Self = Self::Uniform([0.72; 3]);

    pub(super) fn check(&self, mesh: &Mesh) -> Result<()> {
        match self {
            Self::Vertices(colors) if colors.len() != mesh.n_vertices() => {
                let expected = format!("{}, one per vertex", mesh.n_vertices());
                Err(Error::invalid("vertex colours", expected, colors.len().to_string()))
            }
            _ => Ok(()),
        }
    }
}

impl Default for SurfaceColor<'_> {
    fn default() -> Self {
        Self::GREY
    }
}

impl fmt::Debug for SurfaceColor<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Uniform(colour) => f.debug_tuple("Uniform").field(colour).finish(),
            Self::Vertices(colors) => f.debug_tuple("Vertices").field(&colors.len()).finish(),
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
pub(crate) fn light_direction(camera: &Pinhole, settings: &RenderSettings) -> DVec3 {
    let [right, up, back] = settings.light;
    // The camera's own axes are x right, y down, z forward.
    let light = DVec3::new(right, -up, -back).normalize_or_zero();
    camera.camera_from_world().matrix3.transpose() * light
}

/// The bytes of a pixel of which every sample sees the background.
pub(super) fn background(settings: &RenderSettings) -> [u8; 3] {
    let mut sum = [0f32; 3];
    for _ in 0..settings.supersampling.pow(2) {
        sum = [0, 1, 2].map(|k| sum[k] + settings.background[k]);
    }
    sum.map(|sum| byte(sum * share(settings.supersampling)))
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

    /// Colours the window of a raster: the mean of each pixel's samples. `rgb` starts at the window's
    /// first row and holds `width` pixels a row.
    pub fn mix(&self, raster: &Raster, rgb: &mut [u8], width: usize) {
        pulp::Arch::new().dispatch(Mix { shader: self, raster, rgb, width });
    }

    /// Light on each corner of a triangle, on whichever side it comes from:
    ///
    /// > b = (a + (1 − a)·|n·l|) · o
    ///
    /// with the ambient share a, the corner's normal n, the direction l of the light, and the share o
    /// of the light that reaches the vertex.
    fn brightness(&self, face: usize) -> [f64; 3] {
        let (ambient, ids) = (self.settings.ambient, self.request.mesh.faces()[face]);
        let normals = self.request.normals.0[face];
        [0, 1, 2].map(|corner| {
            let normal = DVec3::from_array(normals[corner].map(f64::from));
            let cosine = normal.dot(self.light).abs();
            let reaching = f64::from(self.request.light_at(ids[corner] as usize));
            (ambient + (1.0 - ambient) * cosine) * reaching
        })
    }

    /// The corners' normals in camera axes, on the side that the camera sees, as colors.
    fn normal_colours(&self, face: usize) -> [[f32; 3]; 3] {
        let (mesh, camera) = (self.request.mesh, self.projection.camera);
        let towards = camera.eye() - mesh.vertices()[mesh.faces()[face][0] as usize];
        let side = mesh.face_normal_scaled(face).dot(towards).signum();
        self.request.normals.0[face].map(|normal| {
            let normal = DVec3::from_array(normal.map(f64::from)) * side;
            let [right, down, forward] =
                camera.camera_from_world().transform_vector3(normal).as_vec3().to_array();
            [right, -down, -forward].map(|x| 0.5 + 0.5 * x)
        })
    }
}

/// Samples whose colours are computed side by side.
const LANES: usize = 4;

/// Triangles whose forms are remembered from one row of samples to the next.
const REMEMBERED: usize = 512;

fn share(per_pixel: u32) -> f32 {
    255.0 / (per_pixel * per_pixel) as f32
}

#[inline(always)]
fn byte(x: f32) -> u8 {
    (x + 0.5) as u8 // saturates
}

/// [`Shader::mix`] on the widest registers that the processor has.
struct Mix<'a> {
    shader: &'a Shader<'a>,
    raster: &'a Raster,
    rgb: &'a mut [u8],
    width: usize,
}

impl pulp::WithSimd for Mix<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { shader, raster, rgb, width } = self;
        let per_pixel = raster.per_pixel as usize;
        let n_columns = raster.columns.len();
        let window = raster.columns.start / per_pixel..raster.columns.end / per_pixel;
        let mut grid = raster.hits.chunks_exact(n_columns.max(1)).zip(raster.rows.clone());
        let mut line = Line::new(n_columns);
        let mut sums = [0; 3].map(|_| vec![0f32; window.len()]);
        for pixels in rgb.chunks_exact_mut(width * 3).take(raster.rows.len() / per_pixel) {
            sums.iter_mut().for_each(|sums| sums.fill(0.0));
            for (hits, row) in grid.by_ref().take(per_pixel) {
                shader.colour(raster, hits, raster.position(row), &mut line);
                for (sums, line) in sums.iter_mut().zip(&line.colors) {
                    match per_pixel {
                        2 => add_pairs(sums, line),
                        _ => {
                            for (sum, samples) in sums.iter_mut().zip(line.chunks_exact(per_pixel))
                            {
                                samples.iter().for_each(|sample| *sum += sample);
                            }
                        }
                    }
                }
            }
            let pixels = &mut pixels[window.start * 3..window.end * 3];
            for (k, sums) in sums.iter().enumerate() {
                for (pixel, sum) in pixels.as_chunks_mut::<3>().0.iter_mut().zip(sums) {
                    pixel[k] = byte(sum * share(raster.per_pixel));
                }
            }
        }
    }
}

/// The usual case of two samples along each side of a pixel.
#[inline(always)]
fn add_pairs(sums: &mut [f32], samples: &[f32]) {
    for (sum, [a, b]) in sums.iter_mut().zip(samples.as_chunks::<2>().0) {
        *sum = *sum + a + b;
    }
}

/// The colours of one row of samples.
struct Line {
    /// By channel, a block of lanes longer than the samples.
    colors: [Vec<f32>; 3],
    known: Vec<Known>,
}

/// What the shader keeps of a triangle.
#[derive(Clone, Copy)]
struct Known {
    face: usize,
    forms: Option<TriangleForms>,
    light: [f64; 3],
    /// Lit colours of the corners, where the surface's colours are those of its corners.
    corners: [[f32; 3]; 3],
}

impl Line {
    fn new(n_columns: usize) -> Self {
        let nothing =
            Known { face: usize::MAX, forms: None, light: [0.0; 3], corners: [[0.0; 3]; 3] };
        Self {
            colors: [0; 3].map(|_| vec![0.0; n_columns + LANES]),
            known: vec![nothing; REMEMBERED],
        }
    }
}

impl Shader<'_> {
    /// Colours one row of samples at height `v`. Neighbours mostly see the same triangle.
    #[inline(always)]
    fn colour(&self, raster: &Raster, hits: &[Hit], v: f64, line: &mut Line) {
        let mut column = 0;
        for run in hits.chunk_by(|a, b| a.face() == b.face()) {
            let columns = column..column + run.len();
            column = columns.end;
            let Some(face) = run[0].face().map(|face| face as usize) else {
                for (line, background) in line.colors.iter_mut().zip(self.settings.background) {
                    line[columns.clone()].fill(background);
                }
                continue;
            };
            let known = &mut line.known[face % REMEMBERED];
            if known.face != face {
                *known = self.look_up(face);
            }
            let Some(forms) = known.forms else {
                line.colors.iter_mut().for_each(|line| line[columns.clone()].fill(0.0));
                continue;
            };
            if let SurfaceColor::Surface(color_at) = self.request.color {
                for column in columns {
                    let u = raster.position(raster.columns.start + column);
                    let weights = forms.barycentric(u, v);
                    let light: f64 = weights.iter().zip(known.light).map(|(w, l)| w * l).sum();
                    let colour = color_at(face, weights).map(|c| c * light as f32);
                    line.colors.iter_mut().zip(colour).for_each(|(line, c)| line[column] = c);
                }
                continue;
            }
            let [a, b, c] = known.corners;
            // Lanes beyond the run's end are overwritten by the next one.
            for first in columns.step_by(LANES) {
                let weights: [[f32; 3]; LANES] = std::array::from_fn(|lane| {
                    let u = raster.position(raster.columns.start + first + lane);
                    forms.barycentric(u, v).map(|weight| weight as f32)
                });
                for (k, line) in line.colors.iter_mut().enumerate() {
                    let place = line[first..]
                        .first_chunk_mut()
                        .expect("a line is a block longer than its samples");
                    *place = weights.map(|[wa, wb, wc]| wa * a[k] + wb * b[k] + wc * c[k]);
                }
            }
        }
    }

    fn look_up(&self, face: usize) -> Known {
        let light = self.brightness(face);
        let ids = self.request.mesh.faces()[face];
        let corners = match self.request.color {
            SurfaceColor::Uniform(colour) => light.map(|light| lit(*colour, light)),
            SurfaceColor::Vertices(colors) => {
                [0, 1, 2].map(|corner| lit(colors[ids[corner] as usize], light[corner]))
            }
            SurfaceColor::Normals => self.normal_colours(face),
            SurfaceColor::Surface(_) => [[0.0; 3]; 3],
        };
        let forms = self.projection.forms(self.projection.mesh.place(face));
        Known { face, forms, light, corners }
    }
}

fn lit(color: [f32; 3], light: f64) -> [f32; 3] {
    color.map(|c| c * light as f32)
}
