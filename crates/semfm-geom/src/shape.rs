//! A mesh made ready for maps: cleaned, simplified, with its eigenbasis.

use std::time::Instant;

use faer::Mat;
use serde::{Deserialize, Serialize};

use crate::cholesky::SparseCholesky;
use crate::clean::{CleanReport, CleanSettings};
use crate::denoise::without_noise;
use crate::eigensolver::{EigenSettings, eigenbasis};
use crate::laplacian::{BridgeSettings, Laplacian, LaplacianKind, bridge, laplacian};
use crate::simplify::{SimplifyReport, SimplifySettings};
use crate::working_mesh::{PreparedWorkingMesh, WorkingMesh};
use crate::{Eigenbasis, Error, Mesh, Result, Task};

/// How a [`Shape`] is prepared.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ShapeSettings {
    /// Eigenpairs k.
    pub k: usize,
    /// Whether k may be clipped to the number of working vertices, and the report says so. Set it
    /// to `false` for a k that somebody asked for: more than there are is then an error.
    pub clip_k: bool,
    /// Simplify above this many vertices; 0 keeps them all.
    pub working_vertices: usize,
    /// What counts as dust.
    pub cleaning: CleanSettings,
    /// Which Laplacian.
    pub laplacian: LaplacianKind,
    /// How components are joined; `None` leaves them apart, each with its own constant.
    pub bridges: Option<BridgeSettings>,
    /// How the eigenbasis is computed.
    pub eigen: EigenSettings,
}

impl Default for ShapeSettings {
    fn default() -> Self {
        Self {
            k: 60,
            clip_k: true,
            working_vertices: SimplifySettings::default().target_vertices,
            cleaning: CleanSettings::default(),
            laplacian: LaplacianKind::default(),
            bridges: Some(BridgeSettings::default()),
            eigen: EigenSettings::default(),
        }
    }
}

/// What preparing a shape did and how long each stage took.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ShapeReport {
    /// What cleaning did.
    pub cleaning: CleanReport,
    /// What simplification did; `None` where the mesh was small enough, or nothing smaller stayed
    /// close enough to it.
    pub simplification: Option<SimplifyReport>,
    /// Vertices of the working mesh.
    pub n_vertices: usize,
    /// Pieces of the Laplacian before bridges.
    pub n_components: usize,
    /// Bridges added between them.
    pub n_bridges: usize,
    /// Eigenpairs computed.
    pub k: usize,
    /// Why there are fewer eigenpairs than the settings name, where there are.
    pub clipped: Option<String>,
    /// Largest relative residual of the eigenpairs.
    pub residual: f64,
    /// Milliseconds by stage.
    pub stages_ms: ShapeTimes,
}

/// Milliseconds that each stage of preparing a shape took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ShapeTimes {
    /// Cleaning, simplification and the index maps.
    pub working_mesh: f64,
    /// Laplacian and bridges.
    pub laplacian: f64,
    /// Eigenbasis.
    pub eigenbasis: f64,
}

/// A mesh prepared for functional maps: working mesh, Laplacian and eigenbasis, made once and
/// asked often.
///
/// The basis is that of the working mesh scaled to area 1, so eigenvalues and diffusion times are
/// relative; positions keep the units of the original. Its eigenfunctions have single precision, so that a
/// shape that was kept is the same in half the bytes; eigenvalues and residuals are those of the eigensolver.
///
/// ```
/// use semfm_geom::{Mesh, Shape, ShapeSettings, Task, math::DVec3};
/// let points = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
/// let tetrahedron = Mesh::new(points, vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])?;
/// let shape = Shape::new(tetrahedron, &ShapeSettings::default(), &Task::default())?;
/// assert_eq!(shape.basis().k(), 4); // clipped from 60, which the report says
/// assert!(shape.report().clipped.is_some());
/// # Ok::<(), semfm_geom::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Shape {
    original: Mesh,
    /// Where the original is noisy, its surface without the noise.
    noise_free: Option<Mesh>,
    working: WorkingMesh,
    laplacian: Laplacian,
    basis: Eigenbasis,
    report: ShapeReport,
}

/// What is computed from the original mesh.
pub(crate) struct ShapeParts {
    pub noise_free: Option<Mesh>,
    pub working: WorkingMesh,
    pub laplacian: Laplacian,
    pub basis: Eigenbasis,
    pub report: ShapeReport,
}

impl Shape {
    /// Prepares a mesh: noise off, clean, simplify, Laplacian at area 1, bridges, eigenbasis.
    ///
    /// # Errors
    /// [`Error::NoArea`]; [`Error::TooManyEigenpairs`] for a k of 0, or one above the number of
    /// working vertices where it may not be clipped; [`Error::OutOfRange`] for settings outside
    /// their ranges; [`Error::NotConverged`], [`Error::NotPositiveDefinite`] and
    /// [`Error::LinearAlgebra`] of the eigensolver; [`Error::Cancelled`].
    pub fn new(original: Mesh, settings: &ShapeSettings, task: &Task) -> Result<Self> {
        let mut clock = Stopwatch::start();
        let simplification = SimplifySettings {
            target_vertices: settings.working_vertices,
            ..SimplifySettings::default()
        };
        task.step("working mesh", 0, 3)?;
        let noise_free = without_noise(&original);
        let surface = noise_free.as_ref().unwrap_or(&original);
        let PreparedWorkingMesh { working, cleaning, simplification } =
            WorkingMesh::prepare(surface, &settings.cleaning, &simplification, task)?;
        let (k, clipped) = number_of_pairs(settings, working.mesh.n_vertices())?;
        let mut stages_ms = ShapeTimes { working_mesh: clock.lap(), ..ShapeTimes::default() };

        task.step("laplacian", 1, 3)?;
        let operator = Operator::new(&at_area_1(&working.mesh)?, settings)?;
        stages_ms.laplacian = clock.lap();

        task.step("eigenbasis", 2, 3)?;
        let mut basis = eigenbasis(&operator.laplacian, k, &settings.eigen, task)?;
        in_single_precision(&mut basis.functions);
        stages_ms.eigenbasis = clock.lap();

        let report = ShapeReport {
            cleaning,
            simplification,
            n_vertices: working.mesh.n_vertices(),
            n_components: operator.n_components,
            n_bridges: operator.n_bridges,
            k,
            clipped,
            residual: basis.residuals.iter().copied().fold(0.0, f64::max),
            stages_ms,
        };
        task.step("eigenbasis", 3, 3)?;
        Ok(Self { original, noise_free, working, laplacian: operator.laplacian, basis, report })
    }

    /// Puts a shape together from its parts, as the cache does. All of them must be of
    /// `original`.
    pub(crate) fn from_parts(original: Mesh, parts: ShapeParts) -> Self {
        let ShapeParts { noise_free, working, laplacian, basis, report } = parts;
        Self { original, noise_free, working, laplacian, basis, report }
    }

    /// The mesh as the caller gave it.
    pub fn original(&self) -> &Mesh {
        &self.original
    }

    /// The surface that everything here was computed from, vertex by vertex that of the original: without its noise
    /// where it is noisy ([`noise_free`](crate::noise_free)), the original itself where it is not.
    pub fn surface(&self) -> &Mesh {
        self.noise_free.as_ref().unwrap_or(&self.original)
    }

    /// The working mesh and its index maps.
    pub fn working(&self) -> &WorkingMesh {
        &self.working
    }

    /// The mesh that maps are computed on (n_working vertices, units of the original).
    pub fn mesh(&self) -> &Mesh {
        &self.working.mesh
    }

    /// Laplacian of the working mesh at area 1, bridges included.
    pub fn laplacian(&self) -> &Laplacian {
        &self.laplacian
    }

    /// One implicit step of heat diffusion, (M + t L) u = M f with L the stiffness, on the working vertices at area 1.
    ///
    /// Unlike [`Eigenbasis::diffuse`] it is not cut off at the k-th frequency: a region smaller
    /// than the wavelengths of the basis (the handle of a kettle) keeps its outline.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`] for a negative `t`, [`Error::Length`] for a function on
    /// other vertices.
    pub fn smooth(&self, function: &[f64], t: f64) -> Result<Vec<f64>> {
        self.heat_step(t)?.smooth(function)
    }

    /// The same step, made ready for any number of functions.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`] for a negative `t`.
    pub fn heat_step(&self, t: f64) -> Result<HeatStep> {
        let Laplacian { stiffness, mass } = &self.laplacian;
        let mut system = stiffness.clone();
        for (j, &mass) in mass.iter().enumerate() {
            let rows = stiffness.row_idx_of_col_raw(j);
            for (value, &i) in system.val_of_col_mut(j).iter_mut().zip(rows) {
                *value = t * *value + if i == j { mass } else { 0.0 };
            }
        }
        Ok(HeatStep { factor: SparseCholesky::new(system.as_ref())?, mass: mass.clone() })
    }

    /// Eigenbasis of the working mesh at area 1 (n_working × k).
    pub fn basis(&self) -> &Eigenbasis {
        &self.basis
    }

    /// What was done to get here.
    pub fn report(&self) -> &ShapeReport {
        &self.report
    }

    /// √area of the working mesh, in the units of the original: the length that becomes 1.
    pub fn unit(&self) -> f64 {
        self.working.mesh.area().sqrt()
    }

    /// Values on the working vertices, carried onto the original's vertices: exact where a vertex
    /// was kept, linear on the nearest working triangle where it was not.
    pub fn onto_original(&self, values: &[f64]) -> Vec<f64> {
        self.working.onto_original(values)
    }

    /// Values on the original's vertices, read off at the working vertices.
    pub fn onto_working(&self, values: &[f64]) -> Vec<f64> {
        self.working.onto_working(values)
    }
}

/// An implicit step of heat diffusion on the working vertices of a shape: [`Shape::heat_step`].
#[derive(Debug)]
pub struct HeatStep {
    /// M + t L.
    factor: SparseCholesky,
    mass: Vec<f64>,
}

impl HeatStep {
    /// u with (M + t L) u = M f for one value of f per working vertex.
    ///
    /// # Errors
    /// [`Error::Length`] for a function on other vertices.
    pub fn smooth(&self, function: &[f64]) -> Result<Vec<f64>> {
        if function.len() != self.mass.len() {
            let (expected, found) = (self.mass.len(), function.len());
            return Err(Error::Length { what: "values on the working mesh", expected, found });
        }
        let mut heat = Mat::from_fn(function.len(), 1, |i, _| function[i] * self.mass[i]);
        self.factor.solve_in_place(heat.as_mut());
        Ok(heat.col_as_slice(0).to_vec())
    }
}

/// How many eigenpairs to compute, and what to say where that is fewer than the settings name.
fn number_of_pairs(settings: &ShapeSettings, n_vertices: usize) -> Result<(usize, Option<String>)> {
    let asked = settings.k;
    if asked == 0 || (asked > n_vertices && !settings.clip_k) {
        return Err(Error::TooManyEigenpairs { asked, n_vertices });
    }
    if asked <= n_vertices {
        return Ok((asked, None));
    }
    let clipped = format!("{asked} eigenpairs clipped to {n_vertices}: one per working vertex");
    Ok((n_vertices, Some(clipped)))
}

/// Rounds to what `f32` holds.
fn in_single_precision(functions: &mut Mat<f64>) {
    for j in 0..functions.ncols() {
        functions.col_as_slice_mut(j).iter_mut().for_each(|x| *x = f64::from(*x as f32));
    }
}

fn at_area_1(mesh: &Mesh) -> Result<Mesh> {
    let (centre, side) = (mesh.bounding_sphere().0, mesh.area().sqrt());
    if !(side > 0.0 && side.is_finite()) {
        return Err(Error::NoArea { n_faces: mesh.n_faces() });
    }
    let scaled = mesh.vertices().iter().map(|&p| (p - centre) / side).collect();
    Mesh::new(scaled, mesh.faces().to_vec())
}

/// The operator whose eigenfunctions are the basis.
struct Operator {
    laplacian: Laplacian,
    n_components: usize,
    n_bridges: usize,
}

impl Operator {
    fn new(mesh: &Mesh, settings: &ShapeSettings) -> Result<Self> {
        let laplacian = laplacian(mesh, settings.laplacian)?;
        let Some(bridges) = &settings.bridges else {
            let n_components = crate::simplify::Topology::of(mesh).n_components;
            return Ok(Self { laplacian, n_components, n_bridges: 0 });
        };
        let bridged = bridge(&laplacian, mesh, bridges)?;
        Ok(Self {
            laplacian: bridged.laplacian,
            n_components: bridged.n_components,
            n_bridges: bridged.bridges.len(),
        })
    }
}

struct Stopwatch(Instant);

impl Stopwatch {
    fn start() -> Self {
        Self(Instant::now())
    }

    /// Milliseconds since the start or the last lap.
    fn lap(&mut self) -> f64 {
        std::mem::replace(&mut self.0, Instant::now()).elapsed().as_secs_f64() * 1e3
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{DQuat, DVec3};
    use crate::zoo;

    fn shape(mesh: Mesh, settings: &ShapeSettings) -> Shape {
        Shape::new(mesh, settings, &Task::default()).unwrap()
    }

    #[test]
    fn every_mesh_of_the_zoo_gets_a_basis_on_its_own_vertices() {
        for (name, mesh) in zoo::all() {
            let n = mesh.n_vertices();
            let shape = shape(mesh, &ShapeSettings { k: 20, ..Default::default() });
            let constant = shape.basis().functions.col(0);
            let spread = constant.iter().fold(0.0f64, |s, x| s.max((x - constant[0]).abs()));
            assert!(spread < 1e-6, "{name}: with bridges the first function is constant");
            assert!(shape.basis().values[0] < 1e-8, "{name}");
            assert_eq!(shape.onto_original(&vec![1.0; shape.mesh().n_vertices()]).len(), n);
        }
    }

    #[test]
    fn motion_and_scale_leave_the_spectrum_alone() {
        let mesh = zoo::torus(24, 12);
        let turn = DQuat::from_axis_angle(DVec3::new(2.0, -1.0, 0.5).normalize(), 1.1);
        let moved = mesh.vertices().iter().map(|&p| 1e-3 * (turn * p) + DVec3::new(0.3, 7.0, -2.0));
        let moved = Mesh::new(moved.collect(), mesh.faces().to_vec()).unwrap();
        let settings = ShapeSettings { k: 30, ..Default::default() };
        let (here, there) = (shape(mesh, &settings), shape(moved, &settings));
        for (a, b) in here.basis().values.iter().zip(&there.basis().values) {
            // Positions near 7 with details of 1e-3 keep 12 digits of their detail.
            assert!((a - b).abs() <= 1e-9 * a.max(1.0), "eigenvalues {a} and {b}");
        }
    }

    #[test]
    fn a_k_by_default_is_clipped_and_a_k_by_request_is_refused() {
        let default = shape(zoo::tetrahedron(), &ShapeSettings::default());
        assert_eq!(default.basis().k(), 4);
        let why = default.report().clipped.as_deref().unwrap();
        assert!(why.contains("60") && why.contains('4'), "found {why:?}");
        let asked = ShapeSettings { k: 5, clip_k: false, ..Default::default() };
        let refused = Shape::new(zoo::tetrahedron(), &asked, &Task::default());
        assert!(matches!(refused, Err(Error::TooManyEigenpairs { asked: 5, n_vertices: 4 })));
    }

    #[test]
    fn without_bridges_each_component_has_its_own_constant() {
        let settings = ShapeSettings { k: 6, bridges: None, ..Default::default() };
        let apart = shape(zoo::two_components(), &settings);
        assert_eq!((apart.report().n_components, apart.report().n_bridges), (2, 0));
        assert!(apart.basis().values[1] < 1e-8 && apart.basis().values[2] > 1e-3);
        let joined = shape(zoo::two_components(), &ShapeSettings { k: 6, ..Default::default() });
        assert!(joined.report().n_bridges > 0 && joined.basis().values[1] > 1e-6);
    }

    #[test]
    fn a_simplified_shape_answers_on_all_original_vertices_and_says_what_it_did() {
        let mesh = zoo::icosphere(3);
        let n = mesh.n_vertices();
        let settings = ShapeSettings { k: 12, working_vertices: 300, ..Default::default() };
        let shape = shape(mesh, &settings);
        assert_eq!(shape.mesh().n_vertices(), 300);
        let height: Vec<f64> = shape.mesh().vertices().iter().map(|p| p.z).collect();
        let carried = shape.onto_original(&height);
        assert_eq!(carried.len(), n);
        for (z, p) in carried.iter().zip(shape.original().vertices()) {
            assert!((z - p.z).abs() < 0.05, "height {z} at {p}");
        }
        let report = serde_json::to_value(shape.report()).unwrap();
        assert_eq!(report["simplification"]["n_vertices"], 300);
        assert!(report["stages_ms"]["eigenbasis"].as_f64().unwrap() > 0.0);
    }

    #[test]
    fn a_mesh_without_area_and_a_cancelled_task_are_clear_errors() {
        let line = vec![DVec3::ZERO, DVec3::X, 2.0 * DVec3::X];
        let line = Mesh::new(line, vec![[0, 1, 2]]).unwrap();
        let refused = Shape::new(line, &ShapeSettings::default(), &Task::default());
        assert!(matches!(refused, Err(Error::NoArea { n_faces: 1 })));
        let task = Task::default();
        task.cancel();
        let stopped = Shape::new(zoo::icosphere(1), &ShapeSettings::default(), &task);
        assert!(matches!(stopped, Err(Error::Cancelled)));
    }
}
