//! A patch that one camera sees, completed to the part of the surface that it belongs to.
//!
//! A camera tells two things: which of the visible surface belongs to a part, and which does not. What it
//! does not see is filled in by the harmonic function h with
//!
//! > Δh = 0, h = 1 on the patch, h = 0 on what was seen outside of it,
//!
//! and belongs to the part where h ≥ ½: where a random walk on the surface reaches the patch sooner than
//! the rest (Grady, "Random Walks for Image Segmentation", 2006; on meshes Lai et al., "Fast mesh
//! segmentation using random walks", 2008, whose edge weights for concave creases we do not need). The back
//! of a handle is near its front and far from the body, however large the body is.
//!
//! Where the camera is unknown, it is looked for ([`CameraSearch`]): from its side all of the patch is
//! visible, and the patch ends where the surface turns away. A part that is known all around is visible to
//! no camera, and stays as it is.
//!
//! Limits: a part that the camera did not see at all cannot be found; where the border of the part lies on
//! the hidden side it is put half-way, by distance, between what was seen of both; what is far behind a
//! silhouette (the far end of a handle behind the body) goes to whichever is nearer along the surface.

use faer::Mat;
use faer::sparse::SparseColMat;

use crate::connectivity::VertexAdjacency;
use crate::laplacian::{TuftedSettings, tufted_laplacian};
use crate::math::DVec3;
use crate::sampling::fibonacci_directions;
use crate::{
    CleanSettings, Error, Mesh, Pinhole, PixelDepth, Result, SparseCholesky, SurfaceIndex, clean,
};

/// Weight of a value that is given, and of zero where nothing is, against the mean of the stiffness's
/// diagonal: values are met to a millionth, and only a piece of the surface without a given value feels
/// the zero.
const GIVEN: f64 = 1e6;
const NOT_GIVEN: f64 = 1e-9;

/// How far in front of a surface something must be to hide it, as a share of the diagonal.
const HIDING: f64 = 2e-3;
/// Cosine between the surface and the line of sight below which what is seen tells nothing: with .1, rims
/// of the part itself counted as seen outside of it (mean IoU on real parts .82); with .25, .86.
const GRAZING: f64 = 0.25;

/// Directions that are tried as the camera's, and points of the patch by which each is judged.
const N_DIRECTIONS: usize = 200;
const N_SAMPLES: usize = 400;
/// Directions that see nearly as much as the best one: so many at most, within this share.
const N_FINALISTS: usize = 24;
const NEARLY: f64 = 0.06;
/// A part of which one camera sees at least this share was seen by one. Of 55 labelled real objects, what one
/// camera sees of the region is visible from the likely camera by .86 or more (one in 110 by .79), the whole
/// region by .40 to .78, but for one controller's grip (.84).
const ONE_CAMERA: f64 = 0.85;

/// Completes a patch: `inside` and `outside` (n) say of which vertices it is known that they belong to the
/// part and that they do not; a vertex may be neither. Returns h (n), 1 on the patch: a vertex belongs to
/// the part from ½ on.
///
/// Doubled vertices count as one. A piece of the surface that holds no known vertex does not belong.
///
/// # Errors
/// [`Error::Length`] for masks of another length, [`Error::OutOfRange`] where nothing is inside,
/// [`Error::NoArea`].
pub fn complete_patch(mesh: &Mesh, inside: &[bool], outside: &[bool]) -> Result<Vec<f64>> {
    let n = mesh.n_vertices();
    Error::check_length("vertices inside the patch", n, inside.len())?;
    Error::check_length("vertices outside the patch", n, outside.len())?;
    if !inside.contains(&true) {
        let (what, expected) = ("patch", "at least one vertex".into());
        return Err(Error::OutOfRange { what, expected, found: "none".into() });
    }
    let cleaned = clean(mesh, &CleanSettings::default())?;
    let mut given = vec![None; cleaned.mesh.n_vertices()];
    // Of vertices at one place, inside counts more than outside.
    for (value, known) in [(0.0, outside), (1.0, inside)] {
        for (vertex, clean) in cleaned.of_original.iter().enumerate() {
            if let (true, Some(clean)) = (known[vertex], clean) {
                given[*clean as usize] = Some(value);
            }
        }
    }
    let h = harmonic(&cleaned.mesh, &given)?;
    let of_vertex = cleaned.of_original.iter().zip(inside);
    Ok(of_vertex
        .map(|(clean, &inside)| match (inside, clean) {
            (true, _) => 1.0,
            (false, Some(clean)) => h[*clean as usize].clamp(0.0, 1.0),
            (false, None) => 0.0,
        })
        .collect())
}

/// The harmonic function with these values where they are given: (S + W) h = W g, where the diagonal W is
/// large where a value g is given and next to nothing elsewhere.
fn harmonic(mesh: &Mesh, given: &[Option<f64>]) -> Result<Vec<f64>> {
    let mut system = tufted_laplacian(mesh, &TuftedSettings::default())?.stiffness;
    let n = given.len();
    let scale = diagonal_sum(&system) / n as f64;
    let weight = |i: usize| scale * if given[i].is_some() { GIVEN } else { NOT_GIVEN };
    for column in 0..n {
        for at in system.symbolic().col_range(column) {
            if system.symbolic().row_idx()[at] == column {
                system.val_mut()[at] += weight(column);
            }
        }
    }
    let mut h = Mat::from_fn(n, 1, |i, _| given[i].unwrap_or(0.0) * weight(i));
    SparseCholesky::new(system.as_ref())?.solve_in_place(h.as_mut());
    Ok(h.col(0).iter().copied().collect())
}

fn diagonal_sum(matrix: &SparseColMat<usize, f64>) -> f64 {
    matrix.triplet_iter().filter(|t| t.row == t.col).map(|t| *t.val).sum()
}

/// From where a patch was seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Viewpoint {
    /// A camera that is known.
    Camera(Pinhole),
    /// From far away, in the direction from the object to the eye (unit).
    Towards(DVec3),
}

/// A surface that is looked at, to tell what can be seen of it from where.
pub struct CameraSearch<'a> {
    mesh: &'a Mesh,
    surface: SurfaceIndex,
    normals: Vec<DVec3>,
    areas: Vec<f64>,
    /// Length from which on something in front of a point hides it.
    hiding: f64,
}

/// The camera that a patch was most likely seen by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LikelyCamera {
    /// From the object to the eye (unit).
    pub towards_eye: DVec3,
    /// Share of the patch's area that is visible from there.
    pub share: f64,
}

impl LikelyCamera {
    /// Whether the patch is what one camera sees of a part, and not a part known all around.
    pub fn is_one_sided(&self) -> bool {
        self.share >= ONE_CAMERA
    }
}

impl<'a> CameraSearch<'a> {
    /// Makes a surface ready.
    ///
    /// # Errors
    /// [`Error::NoArea`] where every triangle is degenerate.
    pub fn new(mesh: &'a Mesh) -> Result<Self> {
        let mut normals = vec![DVec3::ZERO; mesh.n_vertices()];
        for (face, ids) in mesh.faces().iter().enumerate() {
            ids.iter().for_each(|&id| normals[id as usize] += mesh.face_normal_scaled(face));
        }
        Ok(Self {
            mesh,
            surface: SurfaceIndex::new(mesh)?,
            normals: normals.into_iter().map(DVec3::normalize_or_zero).collect(),
            areas: mesh.vertex_areas(),
            hiding: HIDING * mesh.diagonal(),
        })
    }

    /// Which vertices (n) are seen from a viewpoint, and not at a grazing angle.
    pub fn seen(&self, viewpoint: Viewpoint) -> Vec<bool> {
        (0..self.mesh.n_vertices()).map(|v| self.sees(viewpoint, v, GRAZING)).collect()
    }

    /// The side from which most of a patch (n) is visible; of those that see nearly as much, the one from
    /// which least is visible just outside of the patch: what a camera sees of a part ends where the part
    /// does or where the surface turns away. None for a patch without area.
    pub fn likely_camera(&self, inside: &[bool]) -> Option<LikelyCamera> {
        let patch = self.sampled(|v| inside[v] && self.areas[v] > 0.0);
        let total: f64 = patch.iter().map(|&v| self.areas[v]).sum();
        if patch.is_empty() {
            return None;
        }
        let mut seen: Vec<LikelyCamera> = fibonacci_directions(N_DIRECTIONS)
            .map(|towards_eye| {
                let viewpoint = Viewpoint::Towards(towards_eye);
                let visible = patch.iter().filter(|&&v| self.sees(viewpoint, v, 0.0));
                let share = visible.map(|&v| self.areas[v]).sum::<f64>() / total;
                LikelyCamera { towards_eye, share }
            })
            .collect();
        seen.sort_by(|a, b| b.share.total_cmp(&a.share));
        let most = seen[0].share;
        let ring = self.ring(inside);
        let cost = |camera: &LikelyCamera| {
            let viewpoint = Viewpoint::Towards(camera.towards_eye);
            let open = ring.iter().filter(|&&v| self.sees(viewpoint, v, GRAZING / 2.0)).count();
            open as f64 / ring.len().max(1) as f64 + 2.0 * (most - camera.share)
        };
        let finalists =
            seen.iter().take(N_FINALISTS).filter(|camera| camera.share >= most - NEARLY);
        finalists
            .map(|camera| (cost(camera), camera))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map(|best| *best.1)
    }

    /// Some of the neighbours of a patch that are not in it.
    fn ring(&self, inside: &[bool]) -> Vec<usize> {
        let adjacency = VertexAdjacency::new(self.mesh);
        self.sampled(|v| {
            !inside[v] && adjacency.of(v).iter().any(|&neighbour| inside[neighbour as usize])
        })
    }

    /// Vertices for which something holds, thinned out evenly by their number where they are many.
    fn sampled(&self, holds: impl Fn(usize) -> bool) -> Vec<usize> {
        let all: Vec<usize> = (0..self.mesh.n_vertices()).filter(|&v| holds(v)).collect();
        let step = all.len().div_ceil(N_SAMPLES).max(1);
        all.into_iter().step_by(step).collect()
    }

    /// Whether a vertex is seen at an angle whose cosine is at least this. Both sides of a surface count:
    /// what lies on its far side is hidden by what lies before it.
    fn sees(&self, viewpoint: Viewpoint, vertex: usize, least: f64) -> bool {
        let (point, normal) = (self.mesh.vertices()[vertex], self.normals[vertex]);
        match viewpoint {
            Viewpoint::Towards(towards_eye) => {
                normal.dot(towards_eye).abs() >= least && {
                    let origin = point + self.hiding * towards_eye;
                    self.surface.first_hit(origin, towards_eye).is_none()
                }
            }
            Viewpoint::Camera(camera) => {
                let PixelDepth { u, v, z } = camera.project(point);
                let (width, height) = (f64::from(camera.width()), f64::from(camera.height()));
                let on_image = z > 0.0 && u >= 0.0 && v >= 0.0 && u < width && v < height;
                let eye = camera.eye();
                on_image
                    && normal.dot((eye - point).normalize_or_zero()).abs() >= least
                    && !self.surface.blocked(eye, point, self.hiding)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Intrinsics;
    use crate::math::DAffine3;
    use crate::zoo;

    /// A torus in the plane of x and y, whose part is the half at positive x.
    fn torus() -> (Mesh, Vec<bool>) {
        let mesh = zoo::torus(64, 32);
        let part = mesh.vertices().iter().map(|p| p.x > 0.0).collect();
        (mesh, part)
    }

    fn both(a: &[bool], b: &[bool]) -> Vec<bool> {
        a.iter().zip(b).map(|(&a, &b)| a && b).collect()
    }

    fn without(a: &[bool], b: &[bool]) -> Vec<bool> {
        a.iter().zip(b).map(|(&a, &b)| a && !b).collect()
    }

    fn iou(a: &[bool], b: &[bool]) -> f64 {
        let both = a.iter().zip(b).filter(|(a, b)| **a && **b).count();
        let either = a.iter().zip(b).filter(|(a, b)| **a || **b).count();
        both as f64 / either as f64
    }

    fn counts(h: &[f64]) -> Vec<bool> {
        h.iter().map(|&h| h >= 0.5).collect()
    }

    #[test]
    fn the_hidden_half_is_completed() {
        let (mesh, part) = torus();
        let search = CameraSearch::new(&mesh).unwrap();
        let seen = search.seen(Viewpoint::Towards(DVec3::Z));
        let (inside, outside) = (both(&seen, &part), without(&seen, &part));
        assert!(iou(&inside, &part) < 0.55);
        let whole = counts(&complete_patch(&mesh, &inside, &outside).unwrap());
        assert!(iou(&whole, &part) > 0.95, "{}", iou(&whole, &part));
    }

    #[test]
    fn a_camera_that_is_known_tells_the_same() {
        let (mesh, part) = torus();
        let search = CameraSearch::new(&mesh).unwrap();
        let turn = crate::math::DMat3::from_rotation_x(std::f64::consts::PI);
        let pose = DAffine3::from_mat3_translation(turn, DVec3::new(0.0, 0.0, 6.0));
        let intrinsics =
            Intrinsics { width: 200, height: 200, fx: 250.0, fy: 250.0, cx: 100.0, cy: 100.0 };
        let camera = Pinhole::with_pixel_centres_at_half(intrinsics, pose).unwrap();
        assert!(camera.eye().distance(DVec3::new(0.0, 0.0, 6.0)) < 1e-9);
        let seen = search.seen(Viewpoint::Camera(camera));
        assert!(iou(&seen, &search.seen(Viewpoint::Towards(DVec3::Z))) > 0.85);
        let whole = complete_patch(&mesh, &both(&seen, &part), &without(&seen, &part)).unwrap();
        assert!(iou(&counts(&whole), &part) > 0.95);
    }

    #[test]
    fn the_camera_is_found_and_a_part_known_all_around_has_none() {
        let (mesh, part) = torus();
        let search = CameraSearch::new(&mesh).unwrap();
        for towards_eye in [DVec3::Z, DVec3::new(0.6, 0.0, 0.8), DVec3::new(0.3, 0.5, -0.8)] {
            let towards_eye = towards_eye.normalize();
            let seen = search.seen(Viewpoint::Towards(towards_eye));
            let found = search.likely_camera(&both(&seen, &part)).unwrap();
            assert!(found.is_one_sided(), "{found:?}");
            assert!(found.towards_eye.dot(towards_eye) > 0.8, "{towards_eye}: {found:?}");
        }
        assert!(!search.likely_camera(&part).unwrap().is_one_sided());
        assert_eq!(search.likely_camera(&vec![false; part.len()]), None);
    }

    #[test]
    fn doubled_vertices_are_one_and_pieces_without_a_known_vertex_stay_out() {
        let (mesh, part) = torus();
        let search = CameraSearch::new(&mesh).unwrap();
        let seen = search.seen(Viewpoint::Towards(DVec3::Z));
        let expected = complete_patch(&mesh, &both(&seen, &part), &without(&seen, &part)).unwrap();
        // Every triangle with corners of its own, and another object far away.
        let of_corner: Vec<usize> =
            mesh.faces().as_flattened().iter().map(|&v| v as usize).collect();
        let mut points: Vec<DVec3> = of_corner.iter().map(|&v| mesh.vertices()[v]).collect();
        let n = points.len();
        points.extend([
            DVec3::splat(9.0),
            DVec3::splat(9.0) + DVec3::X,
            DVec3::splat(9.0) + DVec3::Y,
        ]);
        let faces = (0..points.len() as u32 / 3).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
        let soup = Mesh::new(points, faces).unwrap();
        let onto = |of: &[bool]| {
            let mut mask: Vec<bool> = of_corner.iter().map(|&v| of[v]).collect();
            mask.resize(n + 3, false);
            mask
        };
        let (inside, outside) = (both(&seen, &part), without(&seen, &part));
        let found = complete_patch(&soup, &onto(&inside), &onto(&outside)).unwrap();
        assert!(of_corner.iter().zip(&found).all(|(&v, h)| (h - expected[v]).abs() < 1e-6));
        assert!(found[n..].iter().all(|&h| h < 0.5));
    }

    #[test]
    fn nonsense_is_refused() {
        let (mesh, part) = torus();
        let none = vec![false; part.len()];
        assert!(complete_patch(&mesh, &none, &part).is_err());
        assert!(complete_patch(&mesh, &part[1..], &none).is_err());
        // Nothing known outside: everything belongs.
        let all = complete_patch(&mesh, &part, &none).unwrap();
        assert!(all.iter().all(|&h| h >= 0.5));
    }
}
