//! The surface that a depth camera saw, as a mesh.

use semfm_align::DepthImage;
use semfm_geom::connectivity::components;
use semfm_geom::math::{DAffine3, DVec3};
use semfm_geom::{Mesh, Pinhole};

use crate::depth_filter::SmoothedDepth;
use crate::observation::{Mask, Observation};
use crate::{Error, Result};

/// How a depth image becomes a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceSettings {
    /// Radius in pixels of the window in which depth is smoothed; 0 takes it as measured. Noise of 1 mm between pixels that
    /// are 1 mm apart is a surface of spikes, far larger than the true one.
    pub smooth_pixels: usize,
    /// Pixels along the mask's outline that are left out: they show the object and what is behind it at once.
    pub trim_pixels: usize,
    /// Of a larger picture every second pixel or fewer become vertices, so that there are at most so many.
    pub most_vertices: usize,
}

impl Default for SurfaceSettings {
    fn default() -> Self {
        Self { smooth_pixels: 3, trim_pixels: 1, most_vertices: 20_000 }
    }
}

/// A window of more than 41 × 41 pixels, or a rim of more than 100, leaves little of any object; fewer vertices are no
/// surface to match.
const MOST_SMOOTH: usize = 20;
const MOST_TRIM: usize = 100;
const LEAST_VERTICES: usize = 100;

impl SurfaceSettings {
    /// Refuses settings that no object survives.
    ///
    /// # Errors
    /// [`Error::Invalid`], naming the setting.
    pub fn check(&self) -> Result<()> {
        let pixels =
            [("smooth", self.smooth_pixels, MOST_SMOOTH), ("trim", self.trim_pixels, MOST_TRIM)];
        for (name, found, most) in pixels {
            if found > most {
                return Err(Error::invalid(name, format!("0 to {most} pixels"), found));
            }
        }
        if self.most_vertices < LEAST_VERTICES {
            let expected = format!("at least {LEAST_VERTICES}");
            return Err(Error::invalid("vertices", expected, self.most_vertices));
        }
        Ok(())
    }
}

/// The side of an object that one camera saw.
#[derive(Clone, Debug, PartialEq)]
pub struct ObservedSurface {
    /// In the camera's frame, metres; triangles are counter-clockwise as the camera sees them, so that normals point to it.
    pub mesh: Mesh,
    /// The picture's colours at the vertices (n), where there is one.
    pub colors: Option<Vec<[u8; 3]>>,
    /// The camera, in its own frame.
    pub camera: Pinhole,
    /// What became of the pixels.
    pub report: SurfaceReport,
}

/// What became of the pixels of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SurfaceReport {
    /// Pixels of the object that have a depth, without those along its outline.
    pub n_pixels: usize,
    /// Those among them without a return, whose depth was taken from around them.
    pub n_filled: usize,
    /// Pixels from one vertex to the next.
    pub step: usize,
    /// Triangles that were cut since depth jumps across them.
    pub n_cut: usize,
}

/// A piece of less than this share of the surface is a return from between two things. With a tenth of it most of those
/// stay, with ten times as much a handle goes that something in front cuts in two.
const LEAST_PIECE: f64 = 0.01;

/// Depth may change between neighbours by this many times their distance across the ray: a surface seen at 80°. Beyond, the
/// pixels lie on two surfaces, or noise decides which way the triangle faces.
const STEEPEST: f64 = 5.7;

/// A change of depth by this share of it is noise and no jump.
const NOISE: f64 = 0.004;

impl Observation {
    /// The surface under a mask, or all that was seen: one vertex for each pixel, or for every second and so on, neighbours
    /// joined by triangles where depth does not jump. Depth is smoothed by planes, which also closes single missing pixels;
    /// where the sensor gave a cloud, it is drawn into a depth image first.
    ///
    /// # Errors
    /// [`Error::Invalid`] where there is neither depth nor a cloud, and where no three neighbouring pixels under the mask
    /// have a depth.
    pub fn surface(
        &self,
        mask: Option<&Mask>,
        settings: &SurfaceSettings,
    ) -> Result<ObservedSurface> {
        let camera = self.camera().posed(DAffine3::IDENTITY)?;
        let smoothed = self.smoothed_depth(mask, settings)?;
        let n_pixels = smoothed.n_pixels();
        let grid = SampledPixels::new(&smoothed.depth, &camera, settings.most_vertices);
        let triangles = grid.triangles();
        let step = grid.step;
        let report =
            SurfaceReport { n_pixels, n_filled: smoothed.n_filled, step, n_cut: triangles.n_cut };
        let Some(Pieces { mesh, kept }) = without_small_pieces(&grid.points, triangles.faces)?
        else {
            let under = mask.map_or(String::new(), |mask| format!(" under mask `{}`", mask.name));
            let found = format!("{n_pixels} pixels with a depth, none of them neighbours");
            let expected = "three neighbouring pixels with a depth";
            return Err(Error::invalid(format!("depth{under}"), expected, found));
        };
        let at = |color: &[[u8; 3]]| kept.iter().map(|&v| color[grid.pixels[v]]).collect();
        Ok(ObservedSurface { mesh, colors: self.color().map(at), camera, report })
    }

    /// The depth of the object without its noise.
    pub(crate) fn smoothed_depth(
        &self,
        mask: Option<&Mask>,
        settings: &SurfaceSettings,
    ) -> Result<SmoothedDepth> {
        let [width, height] = self.size();
        let drawn;
        let image = match (self.depth(), self.cloud()) {
            (Some(image), _) => image,
            (None, Some(cloud)) => {
                drawn = drawn_cloud(cloud, &self.camera().posed(DAffine3::IDENTITY)?)?;
                &drawn
            }
            (None, None) => {
                return Err(Error::invalid("observation", "depth or a cloud", "colour alone"));
            }
        };
        let whole = vec![true; width * height];
        let marked = mask.map_or(&whole, |mask| &mask.marked);
        let trimmed = trimmed(marked, width, settings.trim_pixels);
        Ok(SmoothedDepth::new(image, &trimmed, settings.smooth_pixels))
    }
}

/// The nearest point in each pixel (camera's frame, metres).
fn drawn_cloud(cloud: &[DVec3], camera: &Pinhole) -> Result<DepthImage> {
    let (width, height) = (camera.width() as usize, camera.height() as usize);
    let mut depth = vec![0f32; width * height];
    for &p in cloud {
        let seen = camera.project(p);
        let on_picture = seen.z > 0.0
            && (0.0..width as f64).contains(&seen.u)
            && (0.0..height as f64).contains(&seen.v);
        if on_picture {
            let pixel = &mut depth[seen.v as usize * width + seen.u as usize];
            if *pixel == 0.0 || f64::from(*pixel) > seen.z {
                *pixel = seen.z as f32;
            }
        }
    }
    Ok(DepthImage::new(width, height, depth)?)
}

/// A mask without the pixels that are next to unmarked ones, so many times. The picture's edge is no outline.
pub(crate) fn trimmed(marked: &[bool], width: usize, times: usize) -> Vec<bool> {
    let mut now = marked.to_vec();
    let height = marked.len() / width;
    for _ in 0..times {
        let before = now.clone();
        let is_marked = |column: usize, row: usize| before[row * width + column];
        for (i, pixel) in now.iter_mut().enumerate() {
            let (column, row) = (i % width, i / width);
            *pixel = before[i]
                && (column == 0 || is_marked(column - 1, row))
                && (column + 1 == width || is_marked(column + 1, row))
                && (row == 0 || is_marked(column, row - 1))
                && (row + 1 == height || is_marked(column, row + 1));
        }
    }
    now
}

/// Every so many pixels, as points.
struct SampledPixels {
    /// Pixels from one to the next.
    step: usize,
    n_columns: usize,
    /// The point of each place of the grid (rows × columns), where there is one.
    point_at: Vec<Option<u32>>,
    /// In the camera's frame, metres.
    points: Vec<DVec3>,
    /// The pixel of each point.
    pixels: Vec<usize>,
}

/// What neighbouring points make.
struct Triangles {
    faces: Vec<[u32; 3]>,
    n_cut: usize,
}

impl SampledPixels {
    fn new(depth: &[f32], camera: &Pinhole, most: usize) -> Self {
        let (width, height) = (camera.width() as usize, camera.height() as usize);
        let n = depth.iter().filter(|&&z| z > 0.0).count();
        let step = ((n as f64 / most.max(1) as f64).sqrt().ceil() as usize).max(1);
        let (n_columns, n_rows) = (width.div_ceil(step), height.div_ceil(step));
        let (mut point_at, mut points, mut pixels) = (Vec::new(), Vec::new(), Vec::new());
        for place in 0..n_columns * n_rows {
            let (column, row) = (step * (place % n_columns), step * (place / n_columns));
            let pixel = row * width + column;
            let z = f64::from(depth[pixel]);
            point_at.push((z > 0.0).then_some(points.len() as u32));
            if z > 0.0 {
                points.push(z * camera.ray_in_camera(column as f64 + 0.5, row as f64 + 0.5));
                pixels.push(pixel);
            }
        }
        Self { step, n_columns, point_at, points, pixels }
    }

    fn triangles(&self) -> Triangles {
        let mut found = Triangles { faces: Vec::new(), n_cut: 0 };
        let n_rows = self.point_at.len() / self.n_columns;
        for row in 1..n_rows {
            for column in 1..self.n_columns {
                let below = row * self.n_columns + column;
                let above = below - self.n_columns;
                // 0 1
                // 2 3
                let corners = [above - 1, above, below - 1, below].map(|at| self.point_at[at]);
                for face in self.cell(corners) {
                    let [a, b, c] = face;
                    if [[a, b], [b, c], [c, a]].iter().all(|&edge| self.is_smooth(edge)) {
                        found.faces.push(face);
                    } else {
                        found.n_cut += 1;
                    }
                }
            }
        }
        found
    }

    /// The triangles of four neighbours, of which some may be missing: cut along the diagonal along which depth changes less.
    fn cell(&self, corners: [Option<u32>; 4]) -> Vec<[u32; 3]> {
        match corners {
            [Some(a), Some(b), Some(c), Some(d)] => {
                let change = |i: u32, j: u32| (self.depth(i) - self.depth(j)).abs();
                if change(a, d) < change(b, c) {
                    vec![[a, c, d], [a, d, b]]
                } else {
                    vec![[a, c, b], [b, c, d]]
                }
            }
            [Some(a), Some(b), Some(c), None] => vec![[a, c, b]],
            [Some(a), Some(b), None, Some(d)] => vec![[a, d, b]],
            [Some(a), None, Some(c), Some(d)] => vec![[a, c, d]],
            [None, Some(b), Some(c), Some(d)] => vec![[b, c, d]],
            _ => Vec::new(),
        }
    }

    fn depth(&self, point: u32) -> f64 {
        self.points[point as usize].z
    }

    /// Whether depth does not jump from one point to the other.
    fn is_smooth(&self, [i, j]: [u32; 2]) -> bool {
        let [p, q] = [i, j].map(|i| self.points[i as usize]);
        let z = p.z.min(q.z);
        let across = z * (p / p.z).distance(q / q.z);
        (p.z - q.z).abs() <= STEEPEST * across + NOISE * z
    }
}

/// A mesh with the number that each of its vertices had.
pub(crate) struct Pieces {
    pub mesh: Mesh,
    pub kept: Vec<usize>,
}

/// The surface without pieces of less than [`LEAST_PIECE`] of its area and without points that no triangle uses; `None`
/// where nothing is left.
pub(crate) fn without_small_pieces(
    points: &[DVec3],
    faces: Vec<[u32; 3]>,
) -> Result<Option<Pieces>> {
    if faces.is_empty() {
        return Ok(None);
    }
    let all = Mesh::new(points.to_vec(), faces)?;
    let pieces = components(&all);
    let mut areas = vec![0.0; pieces.count];
    let piece_of = |face: usize| pieces.of_vertex[all.faces()[face][0] as usize] as usize;
    (0..all.n_faces()).for_each(|face| areas[piece_of(face)] += all.face_area(face));
    let least = LEAST_PIECE * areas.iter().sum::<f64>();
    let mut number = vec![None; points.len()];
    let (mut kept, mut faces) = (Vec::new(), Vec::new());
    for (face, corners) in all.faces().iter().enumerate() {
        if areas[piece_of(face)] < least {
            continue;
        }
        faces.push(corners.map(|v| {
            *number[v as usize].get_or_insert_with(|| {
                kept.push(v as usize);
                kept.len() as u32 - 1
            })
        }));
    }
    if faces.is_empty() {
        return Ok(None);
    }
    let mesh = Mesh::new(kept.iter().map(|&v| points[v]).collect(), faces)?;
    Ok(Some(Pieces { mesh, kept }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_geom::Intrinsics;
    use semfm_geom::connectivity::MeshReport;

    const SIDE: usize = 96;

    fn camera() -> Pinhole {
        let side = SIDE as u32;
        let intrinsics =
            Intrinsics { width: side, height: side, fx: 200.0, fy: 200.0, cx: 48.0, cy: 48.0 };
        Pinhole::with_pixel_centres_at_half(intrinsics, DAffine3::from_translation(DVec3::Y))
            .unwrap()
    }

    /// A ball of 8 cm at .5 m before a wall at 1 m, with a mask of the ball.
    fn ball() -> Observation {
        let own = camera();
        let depth_at = |i: usize| {
            let ray = own.ray_in_camera((i % SIDE) as f64 + 0.5, (i / SIDE) as f64 + 0.5);
            let middle = DVec3::new(0.0, 0.0, 0.5);
            // |t·ray − middle| = .08
            let (a, b) = (ray.length_squared(), ray.dot(middle));
            let inside = b * b - a * (middle.length_squared() - 0.0064);
            (inside > 0.0).then(|| (b - inside.sqrt()) / a)
        };
        let depths: Vec<Option<f64>> = (0..SIDE * SIDE).map(depth_at).collect();
        let depth = depths.iter().map(|z| z.unwrap_or(1.0) as f32).collect();
        let color = (0..SIDE * SIDE).map(|i| [(i % SIDE) as u8, (i / SIDE) as u8, 7]).collect();
        Observation::new(own)
            .with_depth(DepthImage::new(SIDE, SIDE, depth).unwrap())
            .and_then(|seen| seen.with_color(color))
            .and_then(|seen| seen.with_mask("ball", depths.iter().map(Option::is_some).collect()))
            .unwrap()
    }

    #[test]
    fn a_ball_is_half_a_ball_that_faces_the_camera() {
        let seen = ball();
        let found = seen.surface(seen.mask("ball").ok(), &SurfaceSettings::default()).unwrap();
        let middle = DVec3::new(0.0, 0.0, 0.5);
        for p in found.mesh.vertices() {
            assert!((p.distance(middle) - 0.08).abs() < 5e-4, "{p}");
        }
        for face in 0..found.mesh.n_faces() {
            let [a, ..] = found.mesh.corners(face);
            assert!(found.mesh.face_normal_scaled(face).dot(a) < 0.0, "it faces the camera");
        }
        let report = MeshReport::new(&found.mesh);
        assert_eq!((report.components, report.non_manifold_edges), (1, 0));
        // The cap in front of the tangent cone, 2πr·(r − r²/d), less its rim: one pixel of 32 that are trimmed holds a fifth.
        let cap = std::f64::consts::TAU * 0.08 * (0.08 - 0.0064 / 0.5);
        assert!((0.6..0.8).contains(&(found.mesh.area() / cap)), "{}", found.mesh.area() / cap);
        let (at, p) =
            (found.mesh.n_vertices() / 2, found.mesh.vertices()[found.mesh.n_vertices() / 2]);
        let pixel = found.camera.project(p);
        assert_eq!(found.colors.unwrap()[at], [pixel.u as u8, pixel.v as u8, 7]);
    }

    #[test]
    fn depth_that_jumps_is_cut_and_a_large_picture_is_sampled() {
        let seen = ball();
        let settings = SurfaceSettings { most_vertices: 1500, ..Default::default() };
        let found = seen.surface(None, &settings).unwrap();
        assert_eq!((found.report.step, MeshReport::new(&found.mesh).components), (3, 2));
        assert!(found.report.n_cut > 50 && found.mesh.n_vertices() <= 1500);
        let by_cloud = Observation::new(camera())
            .with_cloud(seen.points(None).unwrap().object)
            .and_then(|cloud| cloud.with_mask("ball", seen.masks()[0].marked.clone()))
            .unwrap();
        let mask = seen.masks().first();
        let settings = SurfaceSettings::default();
        let (a, b) =
            (seen.surface(mask, &settings).unwrap(), by_cloud.surface(mask, &settings).unwrap());
        assert_eq!(a.mesh.n_vertices(), b.mesh.n_vertices());
    }

    #[test]
    fn a_mask_without_a_surface_is_refused_by_name() {
        let seen = ball().with_mask("dot", (0..SIDE * SIDE).map(|i| i == 4000).collect()).unwrap();
        let settings = SurfaceSettings { trim_pixels: 0, ..Default::default() };
        let error = seen.surface(seen.mask("dot").ok(), &settings).unwrap_err().to_string();
        assert!(error.contains("`dot`") && error.contains("1 pixels"), "{error}");
        let color = Observation::new(camera()).with_color(vec![[0; 3]; SIDE * SIDE]).unwrap();
        assert!(color.surface(None, &settings).unwrap_err().to_string().contains("colour alone"));
    }
}
