//! One surface of what several frames saw from known places.

use isosurface::MarchingCubes;
use isosurface::distance::Signed;
use isosurface::extractor::IndexedVertices;
use isosurface::math::Vec3;
use isosurface::sampler::Sampler;
use isosurface::source::ScalarSource;
use semfm_geom::math::DVec3;
use semfm_geom::{Mesh, Pinhole};

use crate::observation::{Mask, Observation};
use crate::surface::{Pieces, SurfaceSettings, without_small_pieces};
use crate::{Error, Result};

/// A frame with the object's mask in it; without one all that was seen is the object.
#[derive(Clone, Copy, Debug)]
pub struct MaskedFrame<'a> {
    /// What was seen, by a camera whose pose is known.
    pub seen: &'a Observation,
    /// The object in it.
    pub mask: Option<&'a Mask>,
}

/// The surface of an object that was seen from several sides.
#[derive(Clone, Debug, PartialEq)]
pub struct MergedSurface {
    /// In the frame in which the cameras' poses are given, metres; normals point outwards.
    pub mesh: Mesh,
    /// Colours at the vertices (n), of the frame that sees each best; where every frame has colours.
    pub colors: Option<Vec<[u8; 3]>>,
    /// The side of the lattice's cells, metres.
    pub spacing: f64,
}

/// Places of the lattice along the longest side of the object, and around it.
const ALONG_LONGEST: usize = 120;
const AROUND: usize = 4;
/// Behind the seen surface a frame says nothing from so many cells on. Thinner walls are told from both sides.
const TRUNCATION: f64 = 4.0;
/// No value of the lattice is nearer to 0 than this share of a cell, or two vertices would fall together.
const CLEARANCE: f64 = 0.02;

/// Merges the surfaces of frames by their signed distances on a lattice (Curless & Levoy 1996, "A volumetric method for
/// building complex models from range images"), from which marching cubes take the surface. Where we depart: a place keeps the
/// greatest distance that any frame gives it, not the mean, so that what one frame looked through is free; a mean moves the
/// two sides of a blade of 2 mm apart, since each frame takes what is behind its side for solid. Where nothing was seen there
/// is no surface, so what no frame shows stays open.
///
/// # Errors
/// [`Error::Invalid`] for no frame, frames without depth, a mask of nothing, and where nothing is left.
pub fn merged_surface(
    frames: &[MaskedFrame<'_>],
    settings: &SurfaceSettings,
) -> Result<MergedSurface> {
    let depths: Vec<FrameDepth<'_>> =
        frames.iter().map(|frame| FrameDepth::new(frame, settings)).collect::<Result<_>>()?;
    let points = depths.iter().flat_map(FrameDepth::points);
    let Some((low, high)) = points.map(|p| (p, p)).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
    else {
        return Err(Error::invalid("frames", "at least one with depth under its mask", "none"));
    };
    let lattice = Lattice::around(low, high);
    let field = lattice.field(&depths);
    let Some(Pieces { mesh, .. }) = lattice.surface(&field)? else {
        return Err(Error::invalid("surface of the frames", "some surface", "none"));
    };
    let colors: Option<Vec<[u8; 3]>> =
        mesh.vertices().iter().map(|&p| best_color(&depths, p)).collect();
    Ok(MergedSurface { mesh, colors, spacing: lattice.spacing })
}

/// The smoothed depth of a frame, and where there is more than the object.
struct FrameDepth<'a> {
    camera: Pinhole,
    /// Of the object (height × width), 0 elsewhere.
    object: Vec<f32>,
    /// Of what is beside the mask, 0 elsewhere.
    beside: Vec<f32>,
    color: Option<&'a [[u8; 3]]>,
}

/// What a frame knows of a place.
enum Evidence {
    /// In front of the seen surface, or behind it within what is told, by so many metres.
    Distance(f64),
    /// It looks through the place to what is behind.
    Free,
    /// Nothing.
    Unknown,
}

impl<'a> FrameDepth<'a> {
    fn new(frame: &MaskedFrame<'a>, settings: &SurfaceSettings) -> Result<Self> {
        let MaskedFrame { seen, mask } = *frame;
        let object = seen.smoothed_depth(mask, settings)?.depth;
        let mut beside = vec![0.0; object.len()];
        if let (Some(depth), Some(mask)) = (seen.depth(), mask) {
            for (pixel, &z) in depth.metres().iter().enumerate() {
                if !mask.marked[pixel] {
                    beside[pixel] = z;
                }
            }
        }
        Ok(Self { camera: *seen.camera(), object, beside, color: seen.color() })
    }

    /// The points of the object, in the world's frame.
    fn points(&self) -> impl Iterator<Item = DVec3> + '_ {
        let width = self.camera.width() as usize;
        let pixels = self.object.iter().enumerate().filter(|(_, z)| **z > 0.0);
        pixels.map(move |(pixel, &z)| {
            let (u, v) = ((pixel % width) as f64 + 0.5, (pixel / width) as f64 + 0.5);
            self.camera.eye() + f64::from(z) * self.camera.ray(u, v)
        })
    }

    fn pixel(&self, u: f64, v: f64) -> Option<usize> {
        let (width, height) = (f64::from(self.camera.width()), f64::from(self.camera.height()));
        let is_inside = (0.0..width).contains(&u) && (0.0..height).contains(&v);
        is_inside.then(|| v as usize * self.camera.width() as usize + u as usize)
    }

    /// Of a place, with what is known behind the surface up to `reach`.
    fn evidence(&self, p: DVec3, reach: f64) -> Evidence {
        let seen = self.camera.project(p);
        let Some(pixel) = self.pixel(seen.u, seen.v).filter(|_| seen.z > 0.0) else {
            return Evidence::Unknown;
        };
        let (object, beside) = (f64::from(self.object[pixel]), f64::from(self.beside[pixel]));
        if object > 0.0 {
            let along_ray = (object - seen.z) * self.camera.ray(seen.u, seen.v).length();
            return if along_ray < -reach {
                Evidence::Unknown
            } else {
                Evidence::Distance(along_ray)
            };
        }
        if beside > seen.z { Evidence::Free } else { Evidence::Unknown }
    }
}

/// Places in space, `n` along each side.
struct Lattice {
    origin: DVec3,
    spacing: f64,
    n: usize,
}

/// A signed distance at each place, negative inside; `None` where nobody knows.
type Field = Vec<Option<f32>>;

impl Lattice {
    fn around(low: DVec3, high: DVec3) -> Self {
        let n = ALONG_LONGEST + 2 * AROUND;
        let spacing = (high - low).max_element().max(1e-6) / ALONG_LONGEST as f64;
        let origin = (low + high) / 2.0 - DVec3::splat(spacing * (n - 1) as f64 / 2.0);
        Self { origin, spacing, n }
    }

    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.n + y) * self.n + x
    }

    fn point(&self, place: [usize; 3]) -> DVec3 {
        self.origin + self.spacing * DVec3::from_array(place.map(|i| i as f64))
    }

    fn field(&self, frames: &[FrameDepth<'_>]) -> Field {
        let reach = TRUNCATION * self.spacing;
        let place = |i: usize| [i % self.n, i / self.n % self.n, i / self.n / self.n];
        let value = |i: usize| {
            let p = self.point(place(i));
            let known = frames.iter().filter_map(|frame| match frame.evidence(p, reach) {
                Evidence::Distance(distance) => Some(distance.min(reach)),
                Evidence::Free => Some(reach),
                Evidence::Unknown => None,
            });
            known.max_by(f64::total_cmp).map(|distance| distance as f32)
        };
        (0..self.n.pow(3)).map(value).collect()
    }

    /// The surface between places that are known.
    fn surface(&self, field: &Field) -> Result<Option<Pieces>> {
        struct Source<'a>(&'a Lattice, &'a Field);
        impl ScalarSource for Source<'_> {
            fn sample_scalar(&self, p: Vec3) -> Signed {
                let steps = (self.0.n - 1) as f32;
                // The extractor asks for one place beyond the last, too.
                let last = self.0.n - 1;
                let place = [p.x, p.y, p.z].map(|t| ((t * steps).round() as usize).min(last));
                let least = (CLEARANCE * self.0.spacing) as f32;
                // What nobody knows is inside; its triangles are dropped below.
                let distance = self.1[self.0.index(place)].unwrap_or(-least * 100.0);
                Signed(distance.abs().max(least).copysign(distance))
            }
        }
        let (mut coordinates, mut ids) = (Vec::new(), Vec::new());
        let source = Source(self, field);
        MarchingCubes::<Signed>::new(self.n)
            .extract(&Sampler::new(&source), &mut IndexedVertices::new(&mut coordinates, &mut ids));
        let side = self.spacing * (self.n - 1) as f64;
        let (corners, _) = coordinates.as_chunks::<3>();
        let points: Vec<DVec3> = corners
            .iter()
            .map(|c| self.origin + side * DVec3::new(c[0].into(), c[1].into(), c[2].into()))
            .collect();
        // The extractor winds clockwise as seen from outside.
        let (faces, _) = ids.as_chunks::<3>();
        let faces = faces.iter().map(|&[a, b, c]| [a, c, b]);
        let known = faces.filter(|face| self.is_known(field, face.map(|v| points[v as usize])));
        without_small_pieces(&points, known.collect())
    }

    /// Whether all corners of the cell of a triangle are known.
    fn is_known(&self, field: &Field, corners: [DVec3; 3]) -> bool {
        let middle = corners.iter().sum::<DVec3>() / 3.0;
        let cell = ((middle - self.origin) / self.spacing).floor().to_array();
        let cell = cell.map(|c| (c.max(0.0) as usize).min(self.n - 2));
        (0..8).all(|corner| {
            let step = [corner & 1, corner >> 1 & 1, corner >> 2];
            field[self.index([0, 1, 2].map(|axis| cell[axis] + step[axis]))].is_some()
        })
    }
}

/// What stands for a colour where no frame sees a vertex, along outlines.
const GREY: [u8; 3] = [128; 3];

/// The colour of a place in the frame whose surface is nearest to it; `None` where a frame has no colours.
fn best_color(frames: &[FrameDepth<'_>], p: DVec3) -> Option<[u8; 3]> {
    let mut best = (f64::INFINITY, GREY);
    for frame in frames {
        let (color, at) = (frame.color?, frame.camera.project(p));
        let pixel =
            frame.pixel(at.u, at.v).filter(|&pixel| at.z > 0.0 && frame.object[pixel] > 0.0);
        if let Some(pixel) = pixel {
            let off = (f64::from(frame.object[pixel]) - at.z).abs();
            if off < best.0 {
                best = (off, color[pixel]);
            }
        }
    }
    Some(best.1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_align::DepthImage;
    use semfm_geom::Intrinsics;
    use semfm_geom::connectivity::MeshReport;
    use semfm_geom::math::{DAffine3, DMat3};

    const SIDE: usize = 120;

    /// A ball of 5 cm in the origin before a wall, seen from .5 m away along `from`.
    fn frame(from: DVec3, color: [u8; 3]) -> Observation {
        let z = -from.normalize();
        let x = z.any_orthonormal_vector();
        let rotation = DMat3::from_cols(x, z.cross(x), z).transpose();
        let pose = DAffine3::from_mat3_translation(rotation, DVec3::new(0.0, 0.0, 0.5));
        let side = SIDE as u32;
        let intrinsics =
            Intrinsics { width: side, height: side, fx: 300.0, fy: 300.0, cx: 60.0, cy: 60.0 };
        let camera = Pinhole::with_pixel_centres_at_half(intrinsics, pose).unwrap();
        let depth_at = |i: usize| {
            let ray = camera.ray_in_camera((i % SIDE) as f64 + 0.5, (i / SIDE) as f64 + 0.5);
            let (a, b) = (ray.length_squared(), 0.5 * ray.z);
            let inside = b * b - a * (0.25 - 0.0025);
            (inside > 0.0).then(|| (b - inside.sqrt()) / a)
        };
        let depths: Vec<Option<f64>> = (0..SIDE * SIDE).map(depth_at).collect();
        let depth = depths.iter().map(|z| z.unwrap_or(0.8) as f32).collect();
        Observation::new(camera)
            .with_depth(DepthImage::new(SIDE, SIDE, depth).unwrap())
            .and_then(|seen| seen.with_color(vec![color; SIDE * SIDE]))
            .and_then(|seen| seen.with_mask("ball", depths.iter().map(Option::is_some).collect()))
            .unwrap()
    }

    fn merged(frames: &[Observation]) -> MergedSurface {
        let frames: Vec<MaskedFrame<'_>> =
            frames.iter().map(|seen| MaskedFrame { seen, mask: seen.masks().first() }).collect();
        merged_surface(&frames, &SurfaceSettings::default()).unwrap()
    }

    #[test]
    fn two_sides_of_a_ball_are_one_ball_and_one_side_stays_open() {
        let (red, blue) = ([200, 0, 0], [0, 0, 200]);
        let sides = [frame(DVec3::X, red), frame(-DVec3::X, blue)];
        let both = merged(&sides);
        for p in both.mesh.vertices() {
            assert!((p.length() - 0.05).abs() < 1.5e-3, "{p}");
        }
        let outwards = (0..both.mesh.n_faces())
            .all(|face| both.mesh.face_normal_scaled(face).dot(both.mesh.corners(face)[0]) > 0.0);
        assert!(outwards);
        let colors = both.colors.unwrap();
        for (p, color) in both.mesh.vertices().iter().zip(colors) {
            if p.x.abs() > 0.02 {
                assert_eq!(color, if p.x > 0.0 { red } else { blue });
            }
        }
        let one = merged(&sides[..1]);
        let report = MeshReport::new(&one.mesh);
        assert!(report.boundary_edges > 50 && report.components == 1);
        assert!(one.mesh.area() < 0.55 * both.mesh.area());
        let error = merged_surface(&[], &SurfaceSettings::default()).unwrap_err().to_string();
        assert!(error.contains("frames"), "{error}");
    }
}
