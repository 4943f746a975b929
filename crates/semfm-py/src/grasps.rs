//! `Grasps`: ranked, collision-free gripper poses in a region.

use std::f64::consts::FRAC_PI_4;
use std::path::PathBuf;
use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyList};
use semfm::align::Verdict;
use semfm::files::{AlignedPose, GraspsFile, read_aligned, write_isaac_grasps, write_ros2_grasps};
use semfm::geom::math::DVec3;
use semfm::grasp::{self, ApproachCone, GraspSettings, Pose, SurfaceSettings};
use semfm::{GraspRequest, GraspResult, Obstacle, Table};
use semfm_show::write_grasp_picture;

use crate::align::Alignment;
use crate::arrays_in::{self, rigid};
use crate::grasp::{Grasp, columns, of_columns};
use crate::grasp_pickle::PickledGrasps;
use crate::gripper::Gripper;
use crate::interruptible::run;
use crate::mesh::from_any;
use crate::region::{Region, region_of};
use crate::shared::Shared;
use crate::{arrays_out, errors, json, pictures};

/// Grasps of an object, best first, and what became of the other candidates: see `find_grasps`.
///
/// A sequence of `Grasp`.
#[pyclass(frozen, module = "semfm", sequence)]
pub struct Grasps {
    found: Arc<grasp::Grasps>,
    mesh: Shared<semfm::Mesh>,
    region: Shared<semfm::Region>,
    gripper: Py<Gripper>,
    scale: f64,
    camera_from_object: Option<Pose>,
    /// In the frame of the object in metres.
    table: Option<Table>,
}

impl Grasps {
    /// The content of `grasps.json`.
    pub fn file(&self, py: Python<'_>) -> PyResult<GraspsFile> {
        let table = self.table;
        self.with_answer(py, move |answer| Ok(GraspsFile::new(answer).with_table(table)))
    }

    /// The object's mesh, in its own units.
    pub fn object(&self) -> &Shared<semfm::Mesh> {
        &self.mesh
    }

    /// Runs `write` with all that a file of grasps tells, away from the interpreter.
    fn with_answer<T: Send + 'static>(
        &self,
        py: Python<'_>,
        write: impl FnOnce(&GraspResult<'_>) -> semfm::Result<T> + Send + 'static,
    ) -> PyResult<T> {
        let (found, mesh) = (self.found.clone(), self.mesh.clone());
        let gripper = self.gripper.get().inner.clone();
        let (object_scale, camera_from_object) = (self.scale, self.camera_from_object);
        run(py, None, move |_| {
            let (mesh, gripper, found) = (&*mesh, &*gripper, &*found);
            write(&GraspResult { mesh, object_scale, camera_from_object, gripper, found })
        })
    }
}

#[pymethods]
impl Grasps {
    fn __len__(&self) -> usize {
        self.found.grasps.len()
    }

    fn __getitem__(&self, py: Python<'_>, index: isize) -> PyResult<Grasp> {
        let n = self.found.grasps.len();
        let at = if index < 0 { index + n as isize } else { index };
        let grasp = usize::try_from(at).ok().and_then(|at| self.found.grasps.get(at));
        grasp
            .map(|grasp| Grasp {
                grasp: grasp.clone(),
                camera_from_object: self.camera_from_object,
                least_opening: *self.gripper.get().inner.opening.start(),
            })
            .ok_or_else(|| errors::index_out_of_range(py, &format!("grasp {index} of {n}")))
    }

    /// (g, 4, 4) float64 array: the gripper's TCP frames in the object's frame, metres.
    #[getter]
    fn object_from_tcp<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        stack(py, self.found.grasps.iter().map(|grasp| grasp.object_from_tcp))
    }

    /// (g, 4, 4) float64 array, optional: the same in the camera's frame, where one is known.
    #[getter]
    fn camera_from_tcp<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let poses = |camera: Pose| {
            stack(py, self.found.grasps.iter().map(|grasp| camera * grasp.object_from_tcp))
        };
        self.camera_from_object.map(poses).transpose()
    }

    /// (g,) float64 array: scores, falling.
    #[getter]
    fn scores<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        arrays_out::owned(py, self.found.grasps.iter().map(|grasp| grasp.score).collect())
    }

    /// (g,) float64 array: distances between the closed pads, metres.
    #[getter]
    fn widths<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        arrays_out::owned(py, self.found.grasps.iter().map(|grasp| grasp.width).collect())
    }

    /// Mesh: the object, in its own units.
    #[getter]
    fn mesh(&self) -> crate::mesh::Mesh {
        crate::mesh::Mesh { inner: self.mesh.clone() }
    }

    /// Region: where the pads close.
    #[getter]
    fn region(&self) -> Region {
        Region { inner: self.region.clone() }
    }

    /// float: metres per unit of the mesh.
    #[getter]
    fn scale(&self) -> f64 {
        self.scale
    }

    /// Gripper: the gripper.
    #[getter]
    fn gripper(&self, py: Python<'_>) -> Py<Gripper> {
        self.gripper.clone_ref(py)
    }

    /// int: gripper poses examined.
    #[getter]
    fn n_candidates(&self) -> usize {
        self.found.n_candidates
    }

    /// dict: candidates refused, by the first thing that each failed.
    #[getter]
    fn rejected<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let rejected = PyDict::new(py);
        for (reason, count) in self.found.rejected.iter() {
            rejected.set_item(reason.name(), count)?;
        }
        Ok(rejected)
    }

    /// object, optional: what the nearest miss failed, by how much, and the unit (str,
    /// float, str).
    #[getter]
    fn nearest_miss(&self) -> Option<(&'static str, f64, &'static str)> {
        let miss = self.found.nearest_miss.as_ref()?;
        Some((miss.reason.name(), miss.by, miss.reason.unit()))
    }

    /// str, optional: what kept most candidates from being grasps, what to do about it, and the options of
    /// `find_grasps` that would change it.
    #[getter]
    fn advice(&self) -> Option<String> {
        let reason = self.found.nearest_miss.as_ref()?.reason;
        let options = reason.options().join(", ");
        Some(format!("{}: {} ({options})", reason.explanation(), reason.advice()))
    }

    /// The content of `grasps.json`.
    ///
    /// Returns
    /// -------
    /// dict
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.file(py)?.to_json())
    }

    /// A picture of the best grasps on the object, which notebooks show by themselves.
    ///
    /// Returns
    /// -------
    /// bytes
    ///     PNG.
    fn picture<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let file = self.file(py)?;
        let (mesh, region) = (self.mesh.clone(), self.region.clone());
        pictures::png(py, move |path, task| {
            Ok(write_grasp_picture(path, &mesh, region.weights(), &file, task)?)
        })
    }

    fn _repr_png_<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyBytes>> {
        pictures::shown(self.picture(py))
    }

    /// Writes the grasps, whole or not at all.
    ///
    /// Parameters
    /// ----------
    /// path : path
    /// format : str, optional
    ///     ``"json"``, ``"ros2"`` or ``"isaac"``: `grasps.json`, a ROS 2 MCAP with a `geometry_msgs/msg/PoseArray` and the widths and scores beside it, or Isaac's YAML.
    #[pyo3(signature = (path, *, format="json"))]
    fn write(&self, py: Python<'_>, path: PathBuf, format: &str) -> PyResult<()> {
        match format {
            "json" => {
                let file = self.file(py)?;
                run(py, None, move |_| file.write(&path))
            }
            "ros2" => self.with_answer(py, move |answer| write_ros2_grasps(&path, answer)),
            "isaac" => self.with_answer(py, move |answer| write_isaac_grasps(&path, answer)),
            other => Err(errors::invalid(py, "format", "json, ros2 or isaac", other)),
        }
    }

    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(
        Bound<'py, PyAny>,
        (String, crate::mesh::Mesh, Region, Py<Gripper>, f64, Option<[f64; 16]>, Option<[f64; 6]>),
    )> {
        let restore = py.import("semfm._semfm")?.getattr("_restore_grasps")?;
        let plain = serde_json::to_string(&PickledGrasps::of(&self.found))
            .map_err(|error| errors::internal(py, &error.to_string()))?;
        let camera = self.camera_from_object.map(columns);
        let table = self.table.map(|Table { point: p, normal: n }| [p.x, p.y, p.z, n.x, n.y, n.z]);
        let gripper = self.gripper.clone_ref(py);
        Ok((restore, (plain, self.mesh(), self.region(), gripper, self.scale, camera, table)))
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }

    fn __repr__(&self) -> String {
        format!("Grasps({} of {} candidates)", self.found.grasps.len(), self.found.n_candidates)
    }
}

fn stack(py: Python<'_>, poses: impl Iterator<Item = Pose>) -> PyResult<Bound<'_, PyAny>> {
    let numbers = poses.flat_map(|pose| pose.to_mat4().transpose().to_cols_array());
    arrays_out::owned(py, numbers.collect()).call_method1("reshape", (-1, 4, 4))
}

/// Grasps out of a pickle.
#[pyfunction]
#[pyo3(signature = (plain, mesh, region, gripper, scale, camera_from_object, table=None))]
#[expect(clippy::too_many_arguments, reason = "what a pickle holds")]
pub fn _restore_grasps(
    py: Python<'_>,
    plain: &str,
    mesh: &Bound<'_, crate::mesh::Mesh>,
    region: &Bound<'_, Region>,
    gripper: Py<Gripper>,
    scale: f64,
    camera_from_object: Option<[f64; 16]>,
    table: Option<[f64; 6]>,
) -> PyResult<Grasps> {
    let plain: PickledGrasps = serde_json::from_str(plain)
        .map_err(|error| errors::invalid(py, "pickle", "grasps", &error.to_string()))?;
    Ok(Grasps {
        found: Arc::new(plain.restore()),
        mesh: mesh.get().inner.clone(),
        region: region.get().inner.clone(),
        gripper,
        scale,
        camera_from_object: camera_from_object.map(of_columns),
        table: table.map(|[x, y, z, nx, ny, nz]| Table {
            point: DVec3::new(x, y, z),
            normal: DVec3::new(nx, ny, nz),
        }),
    })
}

/// Parallel-jaw grasps whose pads close inside a region.
///
/// Every grasp that comes back was checked: the open gripper on its way in and where it closes meets
/// neither object nor scene, the contacts are in force closure, and the pads lie in the region.
/// Nothing found is an answer: see `Grasps.rejected` and `Grasps.nearest_miss`.
///
/// Parameters
/// ----------
/// mesh : mesh_like
///     The object.
/// region : Region or path
///     Where the pads shall close; of the mesh.
/// gripper : Gripper or path
///     A gripper, or what `Gripper` takes.
/// scale : float, optional
///     Metres per unit of the mesh; 1 for a mesh in metres. Not with `alignment`, needed without.
/// alignment : Alignment or path, optional
///     Pose and scale before a camera, from `align` or `aligned.json`: in place of `scale` and `camera_from_object`.
///     What is uncertain of the pose keeps the gripper away until the pads close.
/// use_refused : bool, optional
///     Take an alignment whose verdict is `refuse`, which is an error otherwise.
/// camera_from_object : (4, 4) array_like, optional
///     Rigid pose of the object, scaled to metres, before a camera. Scene, table and directions
///     are then given in the camera's frame, else in the object's in metres.
/// table : object, optional
///     A table top as a pair: a point of it, and its normal, away from the table.
/// scene_meshes : list of mesh_like, optional
///     What the gripper must not touch, metres.
/// scene_points : (p, 3) array_like, optional
///     Points that it must keep `scene_margin` away from, metres.
/// scene_margin : float, optional
/// unseen : float, optional
///     The mesh is what one camera saw (`ObservedObject.mesh`): keep out of what it hides, the volume behind it up to so
///     many metres or down to the table, of which nothing is known.
/// seen_from : (3,) array_like, optional
///     Where that camera stood, metres, in the frame of the mesh; its origin where none is given.
/// top : int, optional
///     Grasps to return.
/// n_samples : int, optional
///     Points of the region from which candidates are grown.
/// working_vertices : int, optional
///     Vertices of the surface on which contacts are sought on larger meshes; 0: on the mesh as it is, neither
///     simplified nor, where it is noisy, smoothed. Collisions are always with the mesh as it is.
/// friction : float, optional
///     Coulomb coefficient between pad and object.
/// diversity : float, optional
///     Share of the score that grasps may give up to differ from each other; 0 returns the best, however near.
/// mass : float, optional
///     Kilograms: `hold` is then the probability that the grasp holds.
/// grip_force : float, optional
///     Force with which each pad presses, newtons.
/// width_range : tuple of float, float, optional
///     Least and largest distance between the closed pads, metres.
/// approach : (3,) array_like, optional
///     Middle of the allowed directions of approach.
/// approach_cone : float, optional
///     Half-angle of the allowed directions around `approach`, radians; π/4 by default.
/// demonstrated_approach : (3,) array_like, optional
///     The direction in which the demonstrator's hand came; agreement raises the score.
/// clearance : float, optional
///     Least distance of the open gripper to everything, metres.
/// pad_in_region : float, optional
///     Share of each pad's contact that must lie in the region.
/// seed : int, optional
/// progress : progress, optional
///
/// Returns
/// -------
/// Grasps
///
/// Examples
/// --------
/// >>> import semfm
/// >>> import semfm.zoo
/// >>> ball = semfm.zoo.icosphere(3)
/// >>> everywhere = semfm.Region([1.0] * ball.n_vertices)
/// >>> grasps = semfm.find_grasps(ball, everywhere, "franka", scale=0.03, n_samples=100)
/// >>> bool(abs(grasps[0].width - 0.06) < 0.002)
/// True
#[pyfunction]
#[pyo3(signature = (mesh, region, gripper, *, scale=None, camera_from_object=None, alignment=None,
    use_refused=false, table=None, scene_meshes=None, scene_points=None, scene_margin=0.005, unseen=None,
    seen_from=None, top=20, n_samples=1000, working_vertices=None, friction=0.5,
    diversity=0.1, mass=None, grip_force=30.0, width_range=None, approach=None, approach_cone=None,
    demonstrated_approach=None, clearance=0.0, pad_in_region=0.5, seed=0, progress=None))]
#[expect(clippy::too_many_arguments, reason = "keywords of a Python function")]
pub fn find_grasps(
    py: Python<'_>,
    mesh: &Bound<'_, PyAny>,
    region: &Bound<'_, PyAny>,
    gripper: &Bound<'_, PyAny>,
    scale: Option<f64>,
    camera_from_object: Option<&Bound<'_, PyAny>>,
    alignment: Option<&Bound<'_, PyAny>>,
    use_refused: bool,
    table: Option<(Bound<'_, PyAny>, Bound<'_, PyAny>)>,
    scene_meshes: Option<&Bound<'_, PyList>>,
    scene_points: Option<&Bound<'_, PyAny>>,
    scene_margin: f64,
    unseen: Option<f64>,
    seen_from: Option<&Bound<'_, PyAny>>,
    top: usize,
    n_samples: usize,
    working_vertices: Option<usize>,
    friction: f64,
    diversity: f64,
    mass: Option<f64>,
    grip_force: f64,
    width_range: Option<(f64, f64)>,
    approach: Option<&Bound<'_, PyAny>>,
    approach_cone: Option<f64>,
    demonstrated_approach: Option<&Bound<'_, PyAny>>,
    clearance: f64,
    pad_in_region: f64,
    seed: u64,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Grasps> {
    let mesh = from_any(mesh, "mesh")?;
    let gripper: Py<Gripper> = match gripper.cast::<Gripper>() {
        Ok(gripper) => gripper.clone().unbind(),
        Err(_) => py.get_type::<Gripper>().call1((gripper,))?.cast_into::<Gripper>()?.unbind(),
    };
    let mut request = match (scale, alignment) {
        (Some(scale), None) => GraspRequest::new(scale),
        (None, Some(alignment)) => {
            let pose = accepted_pose(py, alignment, &mesh, use_refused)?;
            GraspRequest::at_pose(&pose, &mesh)
        }
        (given, _) => {
            let found = if given.is_some() { "both" } else { "neither" };
            return Err(errors::invalid(py, "scale", "one of scale and alignment", found));
        }
    };
    let scale = request.object_scale;
    if let Some(pose) = camera_from_object {
        const NAME: &str = "camera_from_object";
        if alignment.is_some() {
            return Err(errors::invalid(py, NAME, "none beside an alignment", "one"));
        }
        request.camera_from_object = Some(rigid(pose, NAME)?);
    }
    if let Some(working_vertices) = working_vertices {
        request.surface = SurfaceSettings { working_vertices, smooth: working_vertices > 0 };
    }
    let pose_margin = request.settings.pose_margin;
    let settings = &mut request.settings;
    *settings = GraspSettings {
        top,
        n_samples,
        friction,
        diversity,
        mass,
        grip_force,
        seed,
        pose_margin,
        ..Default::default()
    };
    settings.demonstrated_approach = vector(demonstrated_approach, "demonstrated_approach")?;
    settings.limits.approach = vector(approach, "approach")?
        .map(|axis| ApproachCone { axis, half_angle: approach_cone.unwrap_or(FRAC_PI_4) });
    settings.limits.width = width_range.map(|(least, most)| least..=most);
    settings.limits.clearance = clearance;
    settings.limits.pad_in_region = pad_in_region;
    if let Some((point, normal)) = &table {
        let normal = arrays_in::point(normal, "normal of the table")?;
        let point = arrays_in::point(point, "point of the table")?;
        request.table = Some(Table { point, normal });
    }
    request.point_margin = scene_margin;
    for item in scene_meshes.into_iter().flatten() {
        let obstacle = from_any(&item, "scene_meshes")?;
        request.obstacles.push(Obstacle::Mesh((*obstacle).clone()));
    }
    let points =
        scene_points.map(|points| arrays_in::points(points, "scene_points")).transpose()?;
    request.obstacles.push(Obstacle::Points(points.unwrap_or_default()));
    let eye = vector(seen_from, "seen_from")?.unwrap_or(DVec3::ZERO);
    let camera_from_object = request.camera_from_object;
    let region = region_of(region, &mesh)?;
    let (weights, object) = (region.clone(), mesh.clone());
    let fingers = gripper.get().inner.clone();
    let (found, table) = run(py, progress, move |task| {
        if let Some(depth) = unseen {
            let hidden = request.hidden_behind(&object, eye, depth)?;
            request.obstacles.extend(hidden);
        }
        let problem = request.prepare(Arc::new((*object).clone()), (*fingers).clone())?;
        Ok((problem.find(weights.weights(), task)?, problem.table()))
    })?;
    let found = Arc::new(found);
    Ok(Grasps { found, mesh, region, gripper, scale, camera_from_object, table })
}

/// The pose of an `Alignment` or a file; one that is refused is an error unless told otherwise.
fn accepted_pose(
    py: Python<'_>,
    alignment: &Bound<'_, PyAny>,
    mesh: &semfm::Mesh,
    use_refused: bool,
) -> PyResult<AlignedPose> {
    let pose = match alignment.cast::<Alignment>() {
        Ok(alignment) => alignment.get().pose(),
        Err(_) => {
            let path: PathBuf = alignment.extract().map_err(|_| {
                let expected = "an Alignment, or the path of aligned.json";
                errors::wrong_type("alignment", expected, alignment)
            })?;
            read_aligned(&path, Some(mesh))
        }
    };
    let pose = pose.map_err(|error| errors::raise(py, &error))?;
    if pose.verdict == Some(Verdict::Refuse) && !use_refused {
        let found = format!("refuse ({})", pose.reasons.join("; "));
        let expected = "a pose with the verdict accept or check, or use_refused=True";
        return Err(errors::invalid(py, "alignment", expected, &found));
    }
    Ok(pose)
}

/// A vector (3), where there is one.
fn vector(value: Option<&Bound<'_, PyAny>>, name: &str) -> PyResult<Option<DVec3>> {
    value.map(|value| arrays_in::point(value, name)).transpose()
}
