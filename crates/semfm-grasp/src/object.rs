//! What is to be grasped: a mesh or a point cloud in metres, made ready for many questions.

use std::fmt;

use parry3d_f64::glamx::DSymmetricEigen3;
use rand::{Rng, RngExt};
use semfm_geom::connectivity::{MeshReport, components};
use semfm_geom::math::{DMat3, DVec3};
use semfm_geom::sampling::sample_uniform;
use semfm_geom::{Mesh, PointIndex, without_repeated_faces};

use crate::obstacle::Obstacle;
use crate::settings::direction;
use crate::working_surface::{SurfaceReport, SurfaceSettings, WorkingSurface};
use crate::{Error, Result};

/// Distance between the samples that stand for a mesh where candidates are grown, metres: a tenth
/// of a finger's width, so that no finger slips through; 1.25 mm costs four times as much and finds
/// no more grasps.
const SAMPLE_SPACING: f64 = 2.5e-3;

/// Bounds on the number of those samples: enough for a pin, not too many for a car.
const SAMPLE_COUNTS: (f64, f64) = (1000.0, 40_000.0);

/// Neighbours of a point that its normal is fitted to.
const NORMAL_NEIGHBOURS: usize = 16;

/// An object in metres, prepared once for any number of regions, grippers and scenes.
///
/// Nothing is asked of a mesh: components, holes, non-manifold edges and faces wound any way are
/// allowed. Where it is watertight and wound consistently, its inside is known and used.
pub struct GraspObject {
    /// As it is: what must not be run into.
    exact: Body,
    /// Where contacts are sought, if that is another surface.
    working: Option<Working>,
    samples: Samples,
    report: SurfaceReport,
    centre_of_mass: DVec3,
    radius: f64,
}

/// A surface with its triangles or points under a tree.
pub(crate) struct Body {
    pub(crate) surface: Surface,
    pub(crate) tree: Obstacle,
    /// Whether normals are known to point outwards.
    pub(crate) is_signed: bool,
    /// Whether single triangles may be turned anywhere, so that normals are means.
    pub(crate) is_rough: bool,
}

/// A surface that stands for the exact one where contacts are sought.
pub(crate) struct Working {
    body: Body,
    /// For each of its vertices that of the exact mesh.
    to_given: Vec<u32>,
}

/// The surface itself.
pub(crate) enum Surface {
    /// Triangles with their outward unit normals (zero for a degenerate one).
    Mesh { mesh: Mesh, normals: Vec<DVec3> },
    /// Points with unit normals, and the area that each stands for.
    Cloud { points: Vec<DVec3>, normals: Vec<DVec3>, area: f64, spacing: f64 },
}

impl Surface {
    /// Unit normal of a triangle (zero where it has none) or a point.
    pub(crate) fn normal(&self, item: usize) -> DVec3 {
        match self {
            Self::Mesh { normals, .. } | Self::Cloud { normals, .. } => normals[item],
        }
    }
}

/// Points spread over the surface, with normals, for the growth of candidates.
pub(crate) struct Samples {
    pub(crate) points: Vec<DVec3>,
    pub(crate) normals: Vec<DVec3>,
    pub(crate) tree: Obstacle,
}

impl GraspObject {
    /// An object from a mesh in any unit; `scale` makes metres of it. Contacts on a mesh of very many triangles,
    /// or a noisy one, are sought on a working surface: see [`GraspObject::with_surface`].
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a scale that is not positive; [`semfm_geom::Error::NoArea`]
    /// for a mesh without area.
    pub fn from_mesh(mesh: &Mesh, scale: f64) -> Result<Self> {
        Self::with_surface(mesh, scale, SurfaceSettings::default())
    }

    /// [`GraspObject::from_mesh`], told on which surface contacts are sought. Collisions are with the mesh as it
    /// is, always.
    ///
    /// # Errors
    /// As [`GraspObject::from_mesh`].
    pub fn with_surface(mesh: &Mesh, scale: f64, settings: SurfaceSettings) -> Result<Self> {
        if !(scale > 0.0 && scale.is_finite()) {
            let expected = "a positive number of metres for a unit of the mesh".into();
            return Err(Error::OutOfRange { what: "scale", expected, found: scale.to_string() });
        }
        let vertices = mesh.vertices().iter().map(|&p| p * scale).collect();
        let mesh = Mesh::new(vertices, mesh.faces().to_vec())?;
        // Of a pile of coincident triangles one is enough to touch, and all of them together are no surface of a body.
        let mesh = without_repeated_faces(&mesh).unwrap_or(mesh);
        let signs = outward_signs(&mesh);
        let centre_of_mass = centre_of_mass(&mesh, signs.as_ref());
        let radius = radius(mesh.vertices(), centre_of_mass);
        let working = WorkingSurface::of(&mesh, settings)?;
        let report =
            working.as_ref().map_or_else(|| SurfaceReport::of(&mesh), |working| working.report);
        let working = working.map(|WorkingSurface { mesh, to_given, report }| {
            let signs = outward_signs(&mesh);
            Working { body: Body::of_mesh(mesh, signs, report.smoothing_steps > 0), to_given }
        });
        let exact = Body::of_mesh(mesh, signs, false);
        let samples = working.as_ref().map_or(&exact, |working| &working.body).samples()?;
        Ok(Self { exact, working, samples, report, centre_of_mass, radius })
    }

    /// An object from surface points in metres. Normals (one per point, any length) are estimated
    /// where absent, and turned towards `viewpoint` where one is given; otherwise their sign is
    /// taken for unknown.
    ///
    /// A cloud that shows one side of an object only says nothing of the other: a gripper may run into
    /// what was not seen. Complete it first, or put the unseen into the scene.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for fewer than 3 points, for a wrong number of normals and for numbers
    /// that are not finite.
    pub fn from_cloud(
        points: &[DVec3],
        normals: Option<&[DVec3]>,
        viewpoint: Option<DVec3>,
    ) -> Result<Self> {
        if points.len() < 3 {
            return Error::out_of_range("points of the cloud", "at least 3", points.len());
        }
        if normals.is_some_and(|normals| normals.len() != points.len()) {
            let found = normals.map_or(0, <[DVec3]>::len);
            return Error::out_of_range("normals of the cloud", "one for each point", found);
        }
        if let Some(eye) = viewpoint.filter(|eye| !eye.is_finite()) {
            return Error::out_of_range("viewpoint", "finite coordinates", eye);
        }
        for &normal in normals.unwrap_or_default() {
            direction("normal of the cloud", normal)?;
        }
        let index = PointIndex::new(points)?;
        let spacing = median_spacing(points, &index);
        let mut normals: Vec<DVec3> = match normals {
            Some(given) => given.iter().map(|n| n.normalize_or_zero()).collect(),
            None => points.iter().map(|&p| fitted_normal(points, &index, p)).collect(),
        };
        if let Some(eye) = viewpoint {
            for (normal, &p) in normals.iter_mut().zip(points) {
                *normal *= if normal.dot(eye - p) < 0.0 { -1.0 } else { 1.0 };
            }
        }
        let centre_of_mass = points.iter().sum::<DVec3>() / points.len() as f64;
        Ok(Self {
            radius: radius(points, centre_of_mass),
            samples: Samples::new(points.to_vec(), normals.clone()),
            exact: Body {
                tree: Obstacle::of_points(points.to_vec(), 0.0),
                surface: Surface::Cloud {
                    points: points.to_vec(),
                    normals,
                    // Points at distance s on a hexagonal lattice stand for √3/2 s² each.
                    area: 0.866 * spacing * spacing,
                    spacing,
                },
                is_signed: viewpoint.is_some(),
                is_rough: false,
            },
            working: None,
            report: SurfaceReport::default(),
            centre_of_mass,
        })
    }

    /// Number of vertices or points: a region has one weight for each.
    pub fn n_weights(&self) -> usize {
        match &self.exact.surface {
            Surface::Mesh { mesh, .. } => mesh.n_vertices(),
            Surface::Cloud { points, .. } => points.len(),
        }
    }

    /// The surface on which contacts are sought.
    pub fn surface_report(&self) -> SurfaceReport {
        self.report
    }

    /// Centre of the volume where the mesh is watertight, otherwise of the area, or of the points; in the object's
    /// frame, metres.
    pub fn centre_of_mass(&self) -> DVec3 {
        self.centre_of_mass
    }

    /// Distance from the centre of mass to the farthest vertex or point, metres.
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// The object as it is.
    pub(crate) fn exact(&self) -> &Body {
        &self.exact
    }

    /// Where contacts are sought.
    pub(crate) fn touched(&self) -> &Body {
        self.working.as_ref().map_or(&self.exact, |working| &working.body)
    }

    /// How far (metres) the object as it is reaches beyond the surface on which contacts are sought; `None` where
    /// the two are one.
    pub(crate) fn deviation(&self) -> Option<f64> {
        self.working.as_ref().map(|_| self.report.deviation.max(1e-4))
    }

    /// The surface on which contacts are sought.
    pub(crate) fn surface(&self) -> &Surface {
        &self.touched().surface
    }

    /// Whether it is another surface than the mesh as it is, but as near as a pad feels: what is found is then to be
    /// examined on the mesh itself.
    pub(crate) fn is_simplified(&self) -> bool {
        self.report.is_simplified && self.report.smoothing_steps == 0
    }

    /// What the gripper must not run into.
    pub(crate) fn obstacle(&self) -> &Obstacle {
        &self.exact.tree
    }

    pub(crate) fn samples(&self) -> &Samples {
        &self.samples
    }

    /// Whether normals are known to point outwards where contacts are sought.
    pub(crate) fn is_signed(&self) -> bool {
        self.touched().is_signed
    }
}

impl Body {
    /// `signs` turns each face's normal outwards, where that is known.
    fn of_mesh(mesh: Mesh, signs: Option<Vec<f64>>, is_rough: bool) -> Self {
        let sign = |face: usize| signs.as_ref().map_or(1.0, |signs| signs[face]);
        let normals: Vec<DVec3> = (0..mesh.n_faces())
            .map(|face| mesh.face_normal_scaled(face).normalize_or_zero() * sign(face))
            .collect();
        Self {
            tree: Obstacle::of_mesh(&mesh),
            surface: Surface::Mesh { mesh, normals },
            is_signed: signs.is_some(),
            is_rough,
        }
    }

    /// Points spread over a mesh, or those of the cloud.
    fn samples(&self) -> Result<Samples> {
        let (mesh, normals) = match &self.surface {
            Surface::Mesh { mesh, normals } => (mesh, normals),
            Surface::Cloud { points, normals, .. } => {
                return Ok(Samples::new(points.clone(), normals.clone()));
            }
        };
        let wanted = mesh.area() / (SAMPLE_SPACING * SAMPLE_SPACING);
        let n_samples = wanted.clamp(SAMPLE_COUNTS.0, SAMPLE_COUNTS.1) as usize;
        let (points, normals) = sample_uniform(mesh, n_samples, 0)?
            .iter()
            .map(|sample| (sample.point, normals[sample.face as usize]))
            .unzip();
        Ok(Samples::new(points, normals))
    }
}

impl fmt::Debug for GraspObject {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("GraspObject")
            .field("n_weights", &self.n_weights())
            .field("n_samples", &self.samples.points.len())
            .field("signed", &self.is_signed())
            .field("surface", &self.report)
            .field("centre_of_mass", &self.centre_of_mass)
            .field("radius", &self.radius)
            .finish_non_exhaustive()
    }
}

impl Samples {
    fn new(points: Vec<DVec3>, normals: Vec<DVec3>) -> Self {
        let tree = Obstacle::of_points(points.clone(), 0.0);
        Self { points, normals, tree }
    }
}

/// A region on an object: a weight in [0, 1] for each vertex or point, and where to draw seeds.
pub(crate) struct Region {
    weights: Vec<f64>,
    /// The same on the working surface, if there is one.
    working: Option<Vec<f64>>,
    /// Running sums of area times weight over the faces or points that are touched.
    cumulative: Vec<f64>,
}

/// A point of the region: where, the outward normal, and the triangle or point it lies on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Seed {
    pub(crate) point: DVec3,
    pub(crate) normal: DVec3,
    pub(crate) item: u32,
}

impl Region {
    /// Checks the weights and divides them by the largest.
    pub(crate) fn new(object: &GraspObject, weights: &[f64]) -> Result<Self> {
        const WHAT: &str = "weights of the region";
        if weights.len() != object.n_weights() {
            let expected = format!("one for each of {} vertices or points", object.n_weights());
            return Error::out_of_range(WHAT, expected, weights.len());
        }
        if let Some(i) = weights.iter().position(|w| !(w.is_finite() && *w >= 0.0)) {
            let found = format!("{} at {i}", weights[i]);
            return Error::out_of_range(WHAT, "finite numbers of at least 0", found);
        }
        let most = weights.iter().fold(0.0f64, |most, &w| most.max(w));
        if most <= 0.0 {
            return Error::out_of_range(WHAT, "at least one above 0", "only zeros");
        }
        let weights: Vec<f64> = weights.iter().map(|w| w / most).collect();
        let working: Option<Vec<f64>> = object
            .working
            .as_ref()
            .map(|working| working.to_given.iter().map(|&id| weights[id as usize]).collect());
        let touched = working.as_ref().unwrap_or(&weights);
        let mut total = 0.0;
        let mut cumulative: Vec<f64> = match object.surface() {
            Surface::Mesh { mesh, .. } => (0..mesh.n_faces())
                .map(|face| {
                    let mean = mesh.faces()[face].iter().map(|&v| touched[v as usize]).sum::<f64>();
                    mesh.face_area(face) * mean / 3.0
                })
                .collect(),
            Surface::Cloud { .. } => weights.clone(),
        };
        for mass in &mut cumulative {
            total += *mass;
            *mass = total;
        }
        if !(total > 0.0 && total.is_finite()) {
            let found = format!("area times weight {total}");
            return Error::out_of_range(WHAT, "a region with an area", found);
        }
        Ok(Self { weights, working, cumulative })
    }

    /// Weights (0 to 1) of the vertices or points as given.
    pub(crate) fn given(&self) -> &[f64] {
        &self.weights
    }

    /// Weights (0 to 1) where contacts are sought.
    pub(crate) fn touched(&self) -> &[f64] {
        self.working.as_ref().unwrap_or(&self.weights)
    }

    /// A point of the region: triangles or points by area times weight, uniform within.
    pub(crate) fn draw(&self, object: &GraspObject, rng: &mut impl Rng) -> Seed {
        let total = self.cumulative[self.cumulative.len() - 1];
        let pick = rng.random::<f64>() * total;
        let item = self.cumulative.partition_point(|&sum| sum <= pick);
        let item = item.min(self.cumulative.len() - 1);
        match object.surface() {
            Surface::Mesh { mesh, normals } => {
                let [a, b, c] = mesh.corners(item);
                let (u, v) = (rng.random::<f64>().sqrt(), rng.random::<f64>());
                let point = (1.0 - u) * a + u * (1.0 - v) * b + u * v * c;
                Seed { point, normal: normals[item], item: item as u32 }
            }
            Surface::Cloud { points, normals, .. } => {
                Seed { point: points[item], normal: normals[item], item: item as u32 }
            }
        }
    }
}

/// +1 or -1 for each face: the sign of the volume that its component bounds, so that a component
/// wound inside out is turned. `None` where the mesh bounds nothing or is wound inconsistently.
fn outward_signs(mesh: &Mesh) -> Option<Vec<f64>> {
    let report = MeshReport::new(mesh);
    if !(report.watertight && report.oriented) {
        return None;
    }
    let parts = components(mesh);
    let mut volumes = vec![0.0; parts.count];
    let part_of_face: Vec<usize> =
        mesh.faces().iter().map(|corners| parts.of_vertex[corners[0] as usize] as usize).collect();
    let (origin, _) = mesh.bounds();
    for (face, &part) in part_of_face.iter().enumerate() {
        volumes[part] += cone_volume(mesh, face, origin);
    }
    let sign = |&part: &usize| if volumes[part] < 0.0 { -1.0 } else { 1.0 };
    Some(part_of_face.iter().map(sign).collect())
}

/// Signed volume of the cone from `apex` over a face.
fn cone_volume(mesh: &Mesh, face: usize, apex: DVec3) -> f64 {
    let [a, b, c] = mesh.corners(face).map(|p| p - apex);
    a.dot(b.cross(c)) / 6.0
}

/// Centroid of the volume where the outward signs are known, otherwise of the area.
fn centre_of_mass(mesh: &Mesh, outward: Option<&Vec<f64>>) -> DVec3 {
    let (origin, _) = mesh.bounds();
    if let Some(signs) = outward {
        let (mut sum, mut volume) = (DVec3::ZERO, 0.0);
        for (face, sign) in signs.iter().enumerate() {
            let cone = sign * cone_volume(mesh, face, origin);
            let [a, b, c] = mesh.corners(face);
            sum += cone * (a + b + c + origin) / 4.0;
            volume += cone;
        }
        if volume > 1e-12 * mesh.diagonal().powi(3) {
            return sum / volume;
        }
    }
    let weighted = (0..mesh.n_faces()).map(|face| {
        let [a, b, c] = mesh.corners(face);
        mesh.face_area(face) * (a + b + c) / 3.0
    });
    weighted.sum::<DVec3>() / mesh.area()
}

fn radius(points: &[DVec3], centre: DVec3) -> f64 {
    points.iter().map(|p| p.distance(centre)).fold(1e-6, f64::max)
}

/// Median distance from a point to its nearest neighbour, over at most 2000 of the points.
fn median_spacing(points: &[DVec3], index: &PointIndex) -> f64 {
    let step = points.len().div_ceil(2000);
    let mut distances: Vec<f64> = points
        .iter()
        .step_by(step)
        .map(|&p| index.k_nearest(p, 2).get(1).map_or(0.0, |hit| hit.1))
        .collect();
    distances.sort_by(f64::total_cmp);
    distances[distances.len() / 2].max(1e-6)
}

/// Direction of least spread among a point's neighbours; its sign means nothing.
fn fitted_normal(points: &[DVec3], index: &PointIndex, p: DVec3) -> DVec3 {
    let near = index.k_nearest(p, NORMAL_NEIGHBOURS);
    let mean = near.iter().map(|hit| points[hit.0]).sum::<DVec3>() / near.len() as f64;
    let mut spread = DMat3::ZERO;
    for &(i, _) in &near {
        let d = points[i] - mean;
        spread += DMat3::from_cols(d * d.x, d * d.y, d * d.z);
    }
    // Scaled to unit trace: the solver's own tolerances are absolute.
    let trace = spread.x_axis.x + spread.y_axis.y + spread.z_axis.z;
    if trace <= 0.0 {
        return DVec3::Z;
    }
    DSymmetricEigen3::new(spread * (1.0 / trace))
        .eigenvectors
        .x_axis
        .try_normalize()
        .unwrap_or(DVec3::Z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_geom::zoo;

    #[test]
    fn normals_of_a_closed_mesh_point_outwards_whatever_its_winding() {
        let sphere = zoo::icosphere(2);
        let flipped: Vec<[u32; 3]> = sphere.faces().iter().map(|&[a, b, c]| [a, c, b]).collect();
        for mesh in [sphere.clone(), Mesh::new(sphere.vertices().to_vec(), flipped).unwrap()] {
            let object = GraspObject::from_mesh(&mesh, 0.1).unwrap();
            assert!(object.is_signed());
            let samples = object.samples();
            for (p, n) in samples.points.iter().zip(&samples.normals) {
                assert!(p.dot(*n) > 0.0);
            }
            assert!(object.centre_of_mass().length() < 1e-12);
            assert!((object.radius() - 0.1).abs() < 1e-12);
        }
    }

    #[test]
    fn a_cloud_gets_normals_that_face_the_eye() {
        let sphere = zoo::icosphere(3);
        let eye = DVec3::new(0.0, 0.0, 4.0);
        let seen: Vec<DVec3> =
            sphere.vertices().iter().copied().filter(|p| p.z > 0.3).map(|p| p * 0.1).collect();
        let object = GraspObject::from_cloud(&seen, None, Some(eye)).unwrap();
        for (p, n) in object.samples().points.iter().zip(&object.samples().normals) {
            assert!(n.dot(p.normalize()) > 0.9, "{p}: {n}");
        }
    }

    #[test]
    fn seeds_fall_where_the_weights_are() {
        let mesh = zoo::icosphere(3);
        let object = GraspObject::from_mesh(&mesh, 0.05).unwrap();
        let top: Vec<f64> =
            mesh.vertices().iter().map(|p| f64::from(u8::from(p.z > 0.5)) * 7.0).collect();
        let region = Region::new(&object, &top).unwrap();
        let mut rng = <rand_chacha::ChaCha8Rng as rand::SeedableRng>::seed_from_u64(1);
        for _ in 0..200 {
            assert!(region.draw(&object, &mut rng).point.z > 0.05 * 0.35);
        }
        for bad in [vec![0.0; mesh.n_vertices()], vec![1.0; 3], vec![f64::NAN; mesh.n_vertices()]] {
            assert!(Region::new(&object, &bad).is_err());
        }
    }

    #[test]
    fn what_is_no_object_is_refused() {
        assert!(GraspObject::from_mesh(&zoo::icosphere(1), 0.0).is_err());
        assert!(GraspObject::from_cloud(&[DVec3::ZERO], None, None).is_err());
        let points = [DVec3::ZERO, DVec3::X, DVec3::Y];
        assert!(GraspObject::from_cloud(&points, Some(&[DVec3::Z]), None).is_err());
        assert!(GraspObject::from_cloud(&[DVec3::NAN, DVec3::X, DVec3::Y], None, None).is_err());
    }
}
