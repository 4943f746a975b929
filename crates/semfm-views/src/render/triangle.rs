//! Triangles as a camera sees them, in homogeneous coordinates: no projection, no clipping.
//!
//! A ray r = ((u − cx)/fx, (v − cy)/fy, 1) through pixel position (u, v) meets the plane of the
//! triangle a, b, c (camera coordinates) at depth z with
//!
//! > 1/z = r·N / a·N,  N = (b − a) × (c − a),
//!
//! and at barycentric weights in the ratio r·(b×c) : r·(c×a) : r·(a×b). All four are linear in
//! (u, v), and the hit lies in front of the camera and inside the triangle exactly where the three
//! weights have the sign of a·N. Triangles that reach behind the camera need no clipping (Olano &
//! Greer, *Triangle scan conversion using 2D homogeneous coordinates*, 1997).
//!
//! An edge that two triangles share yields the same three numbers in both, up to an exact change of
//! sign, so with closed half-planes no sample falls between them, whatever the rounding.

use std::ops::Range;

use semfm_geom::Pinhole;
use semfm_geom::math::DVec3;

use super::ordered_mesh::{Block, OrderedMesh};

/// Bounding rectangles are widened by this many pixels, so that rounding in the projection never
/// cuts off what the exact half-planes would keep.
const MARGIN: f64 = 1e-6;

/// A function of the pixel position: `du·u + dv·v + constant`.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LinearForm {
    pub du: f64,
    pub dv: f64,
    pub constant: f64,
}

impl LinearForm {
    /// The form `ray(u, v) · n` for a vector in camera coordinates; odd in `n` to the last bit.
    fn of(n: DVec3, lens: &Lens) -> Self {
        let (du, dv) = (n.x * lens.per_fx, n.y * lens.per_fy);
        Self { du, dv, constant: n.z - (du * lens.cx + dv * lens.cy) }
    }

    pub fn at(&self, u: f64, v: f64) -> f64 {
        self.du * u + self.row(v)
    }

    /// The part that stays the same along a row of pixels.
    pub fn row(&self, v: f64) -> f64 {
        self.dv * v + self.constant
    }

    fn scaled(self, factor: f64) -> Self {
        Self { du: self.du * factor, dv: self.dv * factor, constant: self.constant * factor }
    }
}

/// The camera's intrinsics as the forms need them: 1/fx, 1/fy, cx, cy.
#[derive(Clone, Copy, Debug)]
struct Lens {
    per_fx: f64,
    per_fy: f64,
    cx: f64,
    cy: f64,
}

/// A rectangle of pixel positions; empty where `low > high`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PixelBox {
    pub low: [f64; 2],
    pub high: [f64; 2],
}

impl PixelBox {
    pub fn holds(&self, [u, v]: [f64; 2]) -> bool {
        self.low[0] <= u && u <= self.high[0] && self.low[1] <= v && v <= self.high[1]
    }
}

/// A mesh before a camera: vertices in camera coordinates and where they fall in the image.
pub(crate) struct Projection<'a> {
    pub camera: &'a Pinhole,
    pub mesh: &'a OrderedMesh<'a>,
    lens: Lens,
    points: Vec<DVec3>,
    /// Pixel position of each vertex; NaN at and behind the camera's plane.
    pixels: Vec<[f64; 2]>,
}

/// The four linear forms of a triangle.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct TriangleForms {
    /// Weights of the three corners, not normalised; all ≥ 0 inside.
    pub weights: [LinearForm; 3],
    /// 1/z.
    pub inverse_depth: LinearForm,
    /// Bounds of 1/z over the corners, against rounding where the triangle is seen edge-on.
    pub bounds: [f64; 2],
}

impl<'a> Projection<'a> {
    pub fn new(mesh: &'a OrderedMesh<'a>, camera: &'a Pinhole) -> Self {
        let points: Vec<DVec3> =
            mesh.vertices.iter().map(|&p| camera.camera_from_world().transform_point3(p)).collect();
        let pixel = |p: &DVec3| {
            if p.z > 0.0 {
                [camera.fx() * p.x / p.z + camera.cx(), camera.fy() * p.y / p.z + camera.cy()]
            } else {
                [f64::NAN; 2]
            }
        };
        let pixels = points.iter().map(pixel).collect();
        let lens = Lens {
            per_fx: 1.0 / camera.fx(),
            per_fy: 1.0 / camera.fy(),
            cx: camera.cx(),
            cy: camera.cy(),
        };
        Self { camera, mesh, lens, points, pixels }
    }

    /// Where a block of triangles can be in the image: everywhere, if its ball reaches behind the camera.
    ///
    /// The ball lies in the box |p − c| ≤ r of camera coordinates, in which u = fx·x/z + cx is least and
    /// largest at corners.
    pub fn block_box(&self, block: Block) -> PixelBox {
        let centre = self.camera.camera_from_world().transform_point3(block.centre);
        // A pose may be 1e-5 from orthonormal; rounding must not cut anything off either.
        let radius = (1.0 + 1e-4) * block.radius + 1e-9 * centre.abs().max_element();
        let (near, far) = (centre.z - radius, centre.z + radius);
        if near.is_nan() || near <= 0.0 {
            return PixelBox { low: [f64::NEG_INFINITY; 2], high: [f64::INFINITY; 2] };
        }
        let axes = [
            (centre.x, self.camera.fx(), self.camera.cx()),
            (centre.y, self.camera.fy(), self.camera.cy()),
        ];
        let over = |x: f64, if_positive: f64, if_negative: f64| {
            x / if x > 0.0 { if_positive } else { if_negative }
        };
        PixelBox {
            low: axes.map(|(x, f, c)| f * over(x - radius, far, near) + c - MARGIN),
            high: axes.map(|(x, f, c)| f * over(x + radius, near, far) + c + MARGIN),
        }
    }

    /// Where the triangle at a place of the order can be in the image: everywhere, if it reaches behind the
    /// camera.
    pub fn pixel_box(&self, place: usize) -> PixelBox {
        let [a, b, c] = self.mesh.faces[place].map(|id| self.pixels[id as usize]);
        let (mut low, mut high) = ([0.0; 2], [0.0; 2]);
        for k in 0..2 {
            // f64::min would pass over the NaN that marks a corner behind the camera.
            if a[k].is_nan() || b[k].is_nan() || c[k].is_nan() {
                return self.box_behind(place);
            }
            low[k] = a[k].min(b[k]).min(c[k]) - MARGIN;
            high[k] = a[k].max(b[k]).max(c[k]) + MARGIN;
        }
        PixelBox { low, high }
    }

    #[cold]
    fn box_behind(&self, place: usize) -> PixelBox {
        let in_front = self.mesh.faces[place].iter().any(|&id| self.points[id as usize].z > 0.0);
        let (low, high) = ([f64::NEG_INFINITY; 2], [f64::INFINITY; 2]);
        if in_front { PixelBox { low, high } } else { PixelBox { low: high, high: low } }
    }

    /// Columns and rows of pixels outside of which nothing is seen: all of them, if a vertex lies
    /// behind the camera.
    pub fn window(&self) -> [Range<usize>; 2] {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let sides = [self.camera.width(), self.camera.height()].map(f64::from);
        for pixel in &self.pixels {
            for k in 0..2 {
                if pixel[k].is_nan() {
                    (low[k], high[k]) = (0.0, sides[k]);
                }
                low[k] = low[k].min(pixel[k]);
                high[k] = high[k].max(pixel[k]);
            }
        }
        [0, 1].map(|k| {
            let low = (low[k] - MARGIN).floor().clamp(0.0, sides[k]);
            low as usize..(high[k] + MARGIN).ceil().clamp(low, sides[k]) as usize
        })
    }

    /// The linear forms of the triangle at a place of the order, `None` where it is seen exactly edge-on.
    pub fn forms(&self, place: usize) -> Option<TriangleForms> {
        let [a, b, c] = self.mesh.faces[place].map(|id| self.points[id as usize]);
        let normal = (b - a).cross(c - a);
        let volume = normal.dot(a);
        if volume == 0.0 || !volume.is_finite() {
            return None;
        }
        let sign = volume.signum();
        let weight =
            |from: DVec3, to: DVec3| LinearForm::of(from.cross(to), &self.lens).scaled(sign);
        let depths = [a.z, b.z, c.z];
        let nearest = depths.into_iter().fold(f64::INFINITY, f64::min);
        let farthest = depths.into_iter().fold(f64::NEG_INFINITY, f64::max);
        Some(TriangleForms {
            weights: [weight(b, c), weight(c, a), weight(a, b)],
            inverse_depth: LinearForm::of(normal, &self.lens).scaled(1.0 / volume),
            bounds: if nearest > 0.0 {
                [1.0 / farthest, 1.0 / nearest]
            } else {
                [0.0, f64::INFINITY]
            },
        })
    }
}

impl TriangleForms {
    /// 1/z at a pixel position, `None` outside the triangle.
    pub fn inverse_depth_at(&self, u: f64, v: f64) -> Option<f64> {
        let inside = self.weights.iter().all(|weight| weight.at(u, v) >= 0.0);
        let inverse = self.inverse_depth.at(u, v).clamp(self.bounds[0], self.bounds[1]);
        (inside && inverse > 0.0).then_some(inverse)
    }

    /// Barycentric weights (sum 1) of the plane's point seen at a pixel position.
    pub fn barycentric(&self, u: f64, v: f64) -> [f64; 3] {
        let weights = self.weights.map(|weight| weight.at(u, v).max(0.0));
        let sum: f64 = weights.iter().sum();
        if sum > 0.0 { weights.map(|w| w / sum) } else { [1.0 / 3.0; 3] }
    }
}
