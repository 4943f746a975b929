//! One object: a closed mesh of a smooth union, with part labels and its true grip region.

use std::f64::consts::PI;

use isosurface::MarchingCubes;
use isosurface::distance::Signed;
use isosurface::extractor::IndexedVertices;
use isosurface::math::Vec3;
use isosurface::sampler::Sampler;
use isosurface::source::ScalarSource;
use rayon::prelude::*;
use semfm_geom::connectivity::components;
use semfm_geom::math::{DMat3, DVec3, bounds};
use semfm_geom::{Mesh, SimplifySettings, Task, simplify};

use crate::seed::{Draw, stream};
use crate::shapes::{Blueprint, Part, blueprint};
use crate::{Category, Result};

/// What to make.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjectSettings {
    /// Vertices aimed at; the count reached is close to it.
    pub n_vertices: usize,
    /// Holes torn into the surface, as single-view reconstructions have them.
    pub holes: usize,
    /// Detached blobs floating near the surface, likewise.
    pub floaters: usize,
    /// Seed of the proportions, the damage and the pose.
    pub seed: u64,
}

impl Default for ObjectSettings {
    fn default() -> Self {
        Self { n_vertices: 3000, holes: 0, floaters: 0, seed: 0 }
    }
}

/// A procedural object with everything that is known about it.
#[derive(Clone, Debug)]
pub struct SynthObject {
    /// Its category.
    pub category: Category,
    /// Number within the category; six kinds take turns.
    pub instance: usize,
    /// Hammer, pickaxe, mug …
    pub kind: &'static str,
    /// The surface, bounding-box diagonal 1, in a random upright-ish pose.
    pub mesh: Mesh,
    /// Distinct part names, sorted.
    pub part_names: Vec<&'static str>,
    /// Part of each vertex (n), an index into `part_names`.
    pub parts: Vec<u8>,
    /// Whether each vertex (n) lies in the true grip region.
    pub region: Vec<bool>,
    /// The seed it was made from.
    pub seed: u64,
}

impl SynthObject {
    /// A short name, unique among objects: `containers_3_s0`.
    pub fn name(&self) -> String {
        format!("{}_{}_s{}", self.category, self.instance, self.seed)
    }
}

/// Makes the `instance`-th object of a category.
///
/// The same arguments give the same object at every thread count.
///
/// ```
/// use semfm_synth::{Category, ObjectSettings, make_object};
/// let mug = make_object(Category::Containers, 0, &ObjectSettings::default())?;
/// assert_eq!((mug.kind, &mug.part_names[..]), ("mug", &["body", "handle"][..]));
/// # Ok::<(), semfm_synth::Error>(())
/// ```
///
/// # Errors
/// [`Error::Geom`](crate::Error::Geom) where the mesh has no surface, which a blueprint never causes.
pub fn make_object(
    category: Category,
    instance: usize,
    settings: &ObjectSettings,
) -> Result<SynthObject> {
    let key = [category.name(), &instance.to_string(), &settings.seed.to_string()];
    let mut draw = stream(&key);
    let plan = blueprint(category, instance, &mut draw);
    let grid = Grid::around(&plan, settings.n_vertices)?;
    let mut distances = grid.sample(&plan);
    grid.float(&mut distances, settings.floaters, &mut draw);
    let dense = grid.mesh(&distances)?;
    let whole = if settings.floaters == 0 { largest_component(&dense)? } else { dense };
    let mut mesh = thin_out(whole, settings.n_vertices)?;
    if settings.holes > 0 {
        mesh = tear(&mesh, settings.holes, &mut draw)?;
    }
    let labels: Vec<usize> =
        mesh.vertices().iter().map(|&p| nearest_part(&plan.parts, p)).collect();
    let mut part_names: Vec<&'static str> = plan.parts.iter().map(|part| part.name).collect();
    part_names.sort_unstable();
    part_names.dedup();
    let parts = labels
        .iter()
        .map(|&label| part_names.binary_search(&plan.parts[label].name).unwrap_or(0) as u8)
        .collect();
    let region = mesh
        .vertices()
        .iter()
        .zip(&labels)
        .map(|(&p, &label)| plan.parts[label].holds(p))
        .collect();
    let mesh = pose(&mesh, &mut draw)?;
    Ok(SynthObject {
        category,
        instance,
        kind: plan.kind,
        mesh,
        part_names,
        parts,
        region,
        seed: settings.seed,
    })
}

fn nearest_part(parts: &[Part], p: DVec3) -> usize {
    let distances = parts.iter().map(|part| part.field.at(p).distance);
    distances.enumerate().min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(label, _)| label)
}

/// A cubic lattice around the object, fine enough for the vertices asked.
struct Grid {
    origin: DVec3,
    spacing: f64,
    /// Lattice points along each edge of the cube.
    n: usize,
    /// Points along x, y, z that can hold surface; the rest of the cube is outside.
    used: [usize; 3],
}

/// No blueprint reaches beyond these corners.
const LOWEST: DVec3 = DVec3::new(-1.6, -1.2, -1.2);
const HIGHEST: DVec3 = DVec3::new(1.9, 1.2, 2.0);
/// Spacing of the lattice that finds where the object is.
const COARSE: f64 = 0.05;
/// Finer than aimed at by this factor, then thinned out to the count asked for. 1.6 makes triangles
/// a little better shaped on average (.82 for .80) but spends them where the surface bends: edges on
/// flat blades grow to 3.5 times the median, with 1.25 to 3 times.
const OVERSAMPLING: f64 = 1.25;
/// Distances on the lattice are at least this share of its spacing, so that no vertex falls on a
/// lattice point: without it there are triangles of no area, .2 keeps their quality above .1.
const CLEARANCE: f64 = 0.2;
/// Thinning may move the surface by this share of the object's diagonal; no blueprint comes near.
const FARTHEST_FROM_LATTICE: f64 = 0.05;
/// Finest and coarsest lattice: thin blades need .03, memory forbids less than .008.
const FINEST: f64 = 0.008;
const COARSEST: f64 = 0.03;

impl Grid {
    /// Fine enough that the surface of `plan` has some more than `n_vertices`.
    fn around(plan: &Blueprint, n_vertices: usize) -> Result<Self> {
        let [low, high] = surroundings(plan);
        // The number of vertices goes with the inverse square of the spacing.
        let coarse = Self::new(low, high, COARSEST);
        let n_coarse = coarse.mesh(&coarse.sample(plan))?.n_vertices() as f64;
        let wanted = n_vertices as f64 * OVERSAMPLING;
        let spacing = COARSEST * (n_coarse / wanted).sqrt();
        Ok(Self::new(low, high, spacing.clamp(FINEST, COARSEST)))
    }

    fn new(low: DVec3, high: DVec3, spacing: f64) -> Self {
        let used = ((high - low) / spacing).to_array().map(|e| e.ceil() as usize + 1);
        Self { origin: low, spacing, n: used.into_iter().max().unwrap_or(2), used }
    }

    fn point(&self, i: usize) -> DVec3 {
        let [nx, ny, _] = self.used;
        self.origin
            + self.spacing * DVec3::new((i % nx) as f64, (i / nx % ny) as f64, (i / nx / ny) as f64)
    }

    fn sample(&self, plan: &Blueprint) -> Vec<f32> {
        let [nx, ny, nz] = self.used;
        (0..nx * ny * nz).into_par_iter().map(|i| plan.distance(self.point(i)) as f32).collect()
    }

    /// Adds `count` blobs a little way off the surface.
    fn float(&self, distances: &mut [f32], count: usize, draw: &mut Draw) {
        let off: Vec<usize> =
            (0..distances.len()).filter(|&i| (0.09..0.13).contains(&distances[i])).collect();
        for _ in 0..count.min(off.len()) {
            let centre = self.point(off[draw.below(off.len())]);
            let radius = draw.between(0.03, 0.06);
            for (i, d) in distances.iter_mut().enumerate() {
                *d = d.min((self.point(i).distance(centre) - radius) as f32);
            }
        }
    }

    /// The zero level as a mesh.
    fn mesh(&self, distances: &[f32]) -> Result<Mesh> {
        struct Lattice<'a>(&'a Grid, &'a [f32]);
        impl ScalarSource for Lattice<'_> {
            fn sample_scalar(&self, p: Vec3) -> Signed {
                let steps = (self.0.n - 1) as f32;
                let [x, y, z] = [p.x, p.y, p.z].map(|t| (t * steps).round() as usize);
                let [nx, ny, nz] = self.0.used;
                let outside = x >= nx || y >= ny || z >= nz;
                if outside {
                    return Signed(f32::MAX);
                }
                let distance = self.1[(z * ny + y) * nx + x];
                let least = (CLEARANCE * self.0.spacing) as f32;
                Signed(distance.abs().max(least).copysign(distance))
            }
        }
        let (mut coordinates, mut ids) = (Vec::new(), Vec::new());
        let lattice = Lattice(self, distances);
        MarchingCubes::<Signed>::new(self.n).extract(
            &Sampler::new(&lattice),
            &mut IndexedVertices::new(&mut coordinates, &mut ids),
        );
        let side = self.spacing * (self.n - 1) as f64;
        let (corners, _) = coordinates.as_chunks::<3>();
        let vertices = corners
            .iter()
            .map(|c| self.origin + side * DVec3::new(c[0].into(), c[1].into(), c[2].into()))
            .collect();
        // The extractor winds clockwise as seen from outside.
        let (faces, _) = ids.as_chunks::<3>();
        let faces = faces.iter().map(|&[a, b, c]| [a, c, b]).collect();
        Ok(Mesh::new(vertices, faces)?)
    }
}

/// The corners of a box around the object that is large enough for floaters.
fn surroundings(plan: &Blueprint) -> [DVec3; 2] {
    let coarse = Grid::new(LOWEST, HIGHEST, COARSE);
    let distances = coarse.sample(plan);
    let near = (0..distances.len()).filter(|&i| distances[i] < 1.2 * COARSE as f32);
    let near: Vec<DVec3> = near.map(|i| coarse.point(i)).collect();
    let (low, high) =
        bounds(&near).expect("a blueprint has at least one part between LOWEST and HIGHEST");
    [low - 0.16, high + 0.16]
}

/// The component with most vertices: thin parts of a coarse lattice may leave crumbs.
fn largest_component(mesh: &Mesh) -> Result<Mesh> {
    let components = components(mesh);
    let mut sizes = vec![0usize; components.count];
    components.of_vertex.iter().for_each(|&component| sizes[component as usize] += 1);
    let largest = (0..sizes.len()).rev().max_by_key(|&component| sizes[component]).unwrap_or(0);
    keep(mesh, |face| components.of_vertex[mesh.faces()[face][0] as usize] as usize == largest)
}

/// Collapses edges until `n_vertices` are left.
fn thin_out(mesh: Mesh, n_vertices: usize) -> Result<Mesh> {
    let settings =
        SimplifySettings { target_vertices: n_vertices, most_distance: FARTHEST_FROM_LATTICE };
    let thinned = simplify(&mesh, &settings, &Task::default())?;
    Ok(thinned.map_or(mesh, |thinned| thinned.mesh))
}

/// Tears `count` round holes into the surface, of radii from .04 to .09.
fn tear(mesh: &Mesh, count: usize, draw: &mut Draw) -> Result<Mesh> {
    let holes: Vec<(DVec3, f64)> = (0..count)
        .map(|_| (centre(mesh, draw.below(mesh.n_faces())), draw.between(0.04, 0.09)))
        .collect();
    keep(mesh, |face| {
        let centre = centre(mesh, face);
        holes.iter().all(|&(hole, radius)| centre.distance(hole) >= radius)
    })
}

fn centre(mesh: &Mesh, face: usize) -> DVec3 {
    mesh.corners(face).iter().sum::<DVec3>() / 3.0
}

/// The triangles that `wanted` names, with the vertices that they use, in the same order.
fn keep(mesh: &Mesh, wanted: impl Fn(usize) -> bool) -> Result<Mesh> {
    let faces: Vec<[u32; 3]> =
        (0..mesh.n_faces()).filter(|&face| wanted(face)).map(|face| mesh.faces()[face]).collect();
    let mut used: Vec<u32> = faces.iter().flatten().copied().collect();
    used.sort_unstable();
    used.dedup();
    let mut new_id = vec![u32::MAX; mesh.n_vertices()];
    (0..).zip(&used).for_each(|(new, &old)| new_id[old as usize] = new);
    let vertices = used.iter().map(|&old| mesh.vertices()[old as usize]).collect();
    let faces = faces.iter().map(|ids| ids.map(|id| new_id[id as usize])).collect();
    Ok(Mesh::new(vertices, faces)?)
}

/// Centres the object, scales its bounding-box diagonal to 1 and turns it: any heading, a little tilt.
fn pose(mesh: &Mesh, draw: &mut Draw) -> Result<Mesh> {
    let (low, high) = mesh.bounds();
    let heading = DMat3::from_rotation_z(draw.between(-PI, PI));
    let tilt =
        DMat3::from_rotation_y(0.25 * draw.normal()) * DMat3::from_rotation_x(0.25 * draw.normal());
    let turn = heading * tilt * (1.0 / mesh.diagonal());
    let vertices = mesh.vertices().iter().map(|&p| turn * (p - (low + high) / 2.0)).collect();
    Ok(Mesh::new(vertices, mesh.faces().to_vec())?)
}
