//! The surface on which contacts are sought, where the mesh itself has far more triangles than pads can feel, or noise
//! that turns every triangle somewhere else.
//!
//! Collisions are with the mesh as it is, always. A dense mesh is simplified; of what is found there, every grasp that
//! may be returned is closed and examined once more on the mesh itself. A noisy one (a reconstruction) is smoothed,
//! contacts and normals stay those of the smooth surface, and the pads stop where the first point of the mesh stops
//! them.

use semfm_geom::connectivity::{VertexAdjacency, edges};
use semfm_geom::math::DVec3;
use semfm_geom::{CleanSettings, Mesh, SimplifySettings, Task, WorkingMesh};

use crate::Result;

/// How contacts are sought on a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SurfaceSettings {
    /// Vertices of the working surface of a mesh that has half as many again or more; 0 keeps them all.
    pub working_vertices: usize,
    /// Whether the working surface of a noisy mesh is smoothed.
    pub smooth: bool,
}

impl Default for SurfaceSettings {
    /// 16,000 triangles are 2 mm apart on a hammer and 4 mm on a pitcher: a pad of 18 mm feels some fifty.
    fn default() -> Self {
        Self { working_vertices: 8000, smooth: true }
    }
}

impl SurfaceSettings {
    /// The mesh as it is, whatever its size and noise.
    pub fn exact() -> Self {
        Self { working_vertices: 0, smooth: false }
    }
}

/// The surface on which contacts were sought.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SurfaceReport {
    /// Its triangles; 0 for points.
    pub n_triangles: usize,
    /// Whether it has fewer triangles than the mesh.
    pub is_simplified: bool,
    /// Standard deviation of the noise of the mesh's vertices along the normal, metres; 0 where there is none to speak of.
    pub noise: f64,
    /// Steps of smoothing; 0 where the vertices are where they were.
    pub smoothing_steps: usize,
    /// Greatest distance of the mesh from it that is looked for, metres.
    pub deviation: f64,
}

/// A surface that stands for a mesh where contacts are sought.
pub(crate) struct WorkingSurface {
    pub(crate) mesh: Mesh,
    /// For each of its vertices that of the mesh as given.
    pub(crate) to_given: Vec<u32>,
    pub(crate) report: SurfaceReport,
}

/// A mesh is simplified where it has this many times the wanted vertices.
const LARGE: f64 = 1.5;

/// Simplification may move the surface by this, metres: a third of what a pad gives way.
const MOST_DEVIATION: f64 = 5e-4;

/// Noise below either of these is none: a share of the mean edge, and metres. Scans of YCB objects have up to .18 mm, and
/// pads that give way by 1.5 mm do not feel it.
const LEAST_NOISE: (f64, f64) = (0.06, 2e-4);

/// Edges longer than this, metres, are somebody's facets and not samples of a surface.
const LONGEST_SAMPLED_EDGE: f64 = 6e-3;

/// Spikes of this many standard deviations are looked for where pads close: of 10,000 vertices one is beyond.
const SPIKES: f64 = 4.0;

/// Factors of a step of Taubin's filter: frequencies below 1/λ + 1/μ = 0.11 of a normalised Laplacian's [0, 2], that is
/// wavelengths of ten edges and more, pass.
const TAUBIN: (f64, f64) = (0.5, -0.53);

/// Steps for noise as large as the edges are long, and the most: 15 leave normals of a surface with noise of .8 edges
/// 20° off, 60 7°, and more eat the rims of mugs.
const STEPS: (f64, f64) = (75.0, 60.0);

impl WorkingSurface {
    /// `None` where the mesh (in metres) will do as it is.
    pub(crate) fn of(mesh: &Mesh, settings: SurfaceSettings) -> Result<Option<Self>> {
        let mut report = SurfaceReport::of(mesh);
        let mut working = mesh.clone();
        if settings.smooth {
            report.noise = smooth(&mut working, &mut report.smoothing_steps)?;
        }
        let mut to_given: Vec<u32> = (0..mesh.n_vertices() as u32).collect();
        let wanted = settings.working_vertices;
        if wanted > 0 && mesh.n_vertices() as f64 >= LARGE * wanted as f64 {
            let most_distance = MOST_DEVIATION / mesh.diagonal();
            let simplification = SimplifySettings { target_vertices: wanted, most_distance };
            let cleaning = CleanSettings::default();
            let task = Task::default();
            let prepared = WorkingMesh::prepare(&working, &cleaning, &simplification, &task)?;
            if let Some(simplified) = prepared.simplification {
                report.is_simplified = true;
                report.deviation = simplified.distance * mesh.diagonal();
                working = prepared.working.mesh;
                to_given = prepared.working.to_original;
                if report.noise > 0.0 {
                    // What is left of the noise has edges of another length now.
                    smooth(&mut working, &mut report.smoothing_steps)?;
                }
            }
        }
        if !report.is_simplified && report.smoothing_steps == 0 {
            return Ok(None);
        }
        report.n_triangles = working.n_faces();
        report.deviation += SPIKES * report.noise;
        Ok(Some(Self { mesh: working, to_given, report }))
    }
}

impl SurfaceReport {
    /// Of a mesh that stands for itself.
    pub fn of(mesh: &Mesh) -> Self {
        Self { n_triangles: mesh.n_faces(), ..Self::default() }
    }
}

/// Smooths a noisy mesh, adds the steps taken, and returns its noise; leaves another as it is and returns 0.
fn smooth(mesh: &mut Mesh, n_steps: &mut usize) -> Result<f64> {
    let rings = Rings::of(mesh);
    let edge = rings.mean_edge(mesh);
    let noise = noise(mesh, &rings);
    if edge > LONGEST_SAMPLED_EDGE || noise < LEAST_NOISE.1 || noise < LEAST_NOISE.0 * edge {
        return Ok(0.0);
    }
    let steps = (STEPS.0 * noise / edge).clamp(3.0, STEPS.1).ceil() as usize;
    *n_steps += steps;
    let mut points = mesh.vertices().to_vec();
    for _ in 0..steps {
        for factor in [TAUBIN.0, TAUBIN.1] {
            let pulls = rings.laplacian(&points);
            points.iter_mut().zip(pulls).for_each(|(p, pull)| *p += factor * pull);
        }
    }
    *mesh = Mesh::new(points, mesh.faces().to_vec())?;
    Ok(noise)
}

/// Standard deviation along the normal of independent noise of the vertices, in the mesh's unit.
///
/// A smooth surface has a Laplacian that varies little from vertex to vertex, so the Laplacian of the
/// Laplacian, L²x with L = mean over the ring − own, is that of the noise. For six neighbours its variance is
///
/// > (7/6)² + 6 · (5/18)² + 6/36² + 6 · (2/36)² = 1.85 of the noise's.
///
/// The median makes edges and corners of the object count for nothing.
fn noise(mesh: &Mesh, rings: &Rings) -> f64 {
    const SPREAD: f64 = 1.36; // √1.85
    const MEDIAN_OF_NORMAL: f64 = 0.6745; // of the absolute value, of a unit deviation
    let bent = rings.laplacian(&rings.laplacian(mesh.vertices()));
    let mut normals = vec![DVec3::ZERO; mesh.n_vertices()];
    for (face, corners) in mesh.faces().iter().enumerate() {
        let normal = mesh.face_normal_scaled(face);
        corners.iter().for_each(|&v| normals[v as usize] += normal);
    }
    // Over two rings, for those of one are as noisy as the vertices.
    let around = rings.laplacian(&normals);
    let mut parts: Vec<f64> = (0..mesh.n_vertices())
        .filter(|&v| !rings.of[v].is_empty())
        .filter_map(|v| Some(bent[v].dot((2.0 * normals[v] + around[v]).try_normalize()?).abs()))
        .collect();
    if parts.is_empty() {
        return 0.0;
    }
    let middle = parts.len() / 2;
    let (_, median, _) = parts.select_nth_unstable_by(middle, f64::total_cmp);
    *median / (MEDIAN_OF_NORMAL * SPREAD)
}

/// For each vertex those that it is averaged with: its neighbours, or on a border those along the border.
struct Rings {
    of: Vec<Vec<u32>>,
}

impl Rings {
    fn of(mesh: &Mesh) -> Self {
        let adjacency = VertexAdjacency::new(mesh);
        let mut of: Vec<Vec<u32>> =
            (0..mesh.n_vertices()).map(|v| adjacency.of(v).to_vec()).collect();
        let mut sides: Vec<[u32; 2]> = mesh
            .faces()
            .iter()
            .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
            .map(|[a, b]| [a.min(b), a.max(b)])
            .collect();
        sides.sort_unstable();
        let border: Vec<[u32; 2]> = sides
            .chunk_by(|a, b| a == b)
            .filter(|side| side.len() == 1)
            .map(|side| side[0])
            .collect();
        for &id in border.iter().flatten() {
            of[id as usize].clear();
        }
        for &[a, b] in &border {
            of[a as usize].push(b);
            of[b as usize].push(a);
        }
        Self { of }
    }

    /// Mean over the ring less the own value; zero where there is no ring.
    fn laplacian(&self, values: &[DVec3]) -> Vec<DVec3> {
        let pull = |(ring, &own): (&Vec<u32>, &DVec3)| {
            let sum = ring.iter().fold(DVec3::ZERO, |sum, &id| sum + values[id as usize]);
            if ring.is_empty() { DVec3::ZERO } else { sum / ring.len() as f64 - own }
        };
        self.of.iter().zip(values).map(pull).collect()
    }

    fn mean_edge(&self, mesh: &Mesh) -> f64 {
        let edges = edges(mesh);
        let points = mesh.vertices();
        let length = |&[a, b]: &[u32; 2]| points[a as usize].distance(points[b as usize]);
        edges.iter().map(length).sum::<f64>() / edges.len().max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_meshes::{cuboid, cylinder, moved, noisy};
    use semfm_geom::zoo;

    /// A ball of 3 cm with edges of 2 mm.
    fn ball() -> Mesh {
        moved(&zoo::icosphere(4), |p| 0.03 * p)
    }

    #[test]
    fn noise_is_measured_and_what_is_smooth_has_none() {
        for sigma in [0.3e-3, 0.5e-3, 1e-3] {
            let found = noise(&noisy(&ball(), sigma, 1), &Rings::of(&ball()));
            assert!((found / sigma - 1.0).abs() < 0.2, "{found} for {sigma}");
        }
        for mesh in [ball(), cylinder(0.02, 0.1, 96), cuboid(DVec3::splat(0.1))] {
            assert!(WorkingSurface::of(&mesh, SurfaceSettings::default()).unwrap().is_none());
        }
    }

    #[test]
    fn a_noisy_ball_becomes_a_ball_again() {
        let rough = noisy(&ball(), 0.6e-3, 2);
        let smooth = WorkingSurface::of(&rough, SurfaceSettings::default()).unwrap().unwrap();
        assert!(smooth.report.smoothing_steps > 5 && !smooth.report.is_simplified);
        let spread = |mesh: &Mesh| {
            let n = mesh.n_vertices() as f64;
            let squares: f64 = mesh.vertices().iter().map(|p| (p.length() - 0.03).powi(2)).sum();
            (squares / n).sqrt()
        };
        assert!(spread(&rough) > 0.5e-3 && spread(&smooth.mesh) < 0.25e-3);
        // Normals of triangles, which pads ask for, point outwards again.
        let off = (0..smooth.mesh.n_faces()).map(|face| {
            let [a, b, c] = smooth.mesh.corners(face);
            smooth.mesh.face_normal_scaled(face).angle_between(a + b + c)
        });
        let mut angles: Vec<f64> = off.collect();
        angles.sort_by(f64::total_cmp);
        assert!(angles[angles.len() * 9 / 10] < 0.25, "{}", angles[angles.len() * 9 / 10]);
        assert!(WorkingSurface::of(&rough, SurfaceSettings::exact()).unwrap().is_none());
    }

    #[test]
    fn a_dense_mesh_is_simplified_on_its_own_vertices() {
        let dense = moved(&zoo::icosphere(5), |p| 0.05 * p); // 10,242 vertices
        let settings = SurfaceSettings { working_vertices: 2000, smooth: true };
        let working = WorkingSurface::of(&dense, settings).unwrap().unwrap();
        assert!(working.report.is_simplified && working.report.smoothing_steps == 0);
        assert!(working.mesh.n_vertices() <= 3000 && working.report.deviation <= MOST_DEVIATION);
        for (p, &id) in working.mesh.vertices().iter().zip(&working.to_given) {
            assert_eq!(*p, dense.vertices()[id as usize]);
        }
    }
}
