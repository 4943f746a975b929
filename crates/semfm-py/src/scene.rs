//! `Scene`: what stands around an arm.

use std::path::PathBuf;

use pyo3::prelude::*;
use semfm::SceneContents;
use semfm::geom::math::DVec3;
use semfm::robot::{Geometry, Pose};

use crate::arrays_in::{self, rigid};
use crate::errors;
use crate::interruptible::{guard, run};
use crate::mesh::from_any;

/// What stands around an arm, in the frame of the arm's base, metres: each thing with a name of its own. A scene does not
/// change; ``with_…`` gives a new one.
///
/// Examples
/// --------
/// >>> import semfm
/// >>> scene = semfm.Scene().with_table("table", point=[0, 0, 0]).with_box("shelf", size=[0.6, 0.3, 0.02])
/// >>> scene.names
/// ['table', 'shelf']
#[pyclass(frozen, module = "semfm")]
#[derive(Clone)]
pub struct Scene {
    pub inner: SceneContents,
}

#[pymethods]
impl Scene {
    /// Nothing around.
    #[new]
    fn new() -> Self {
        Self { inner: SceneContents::new() }
    }

    /// Reads `scene.json`, meshes (metres) and point clouds; meshes and clouds are named after their files.
    ///
    /// Parameters
    /// ----------
    /// paths : path or list of path
    ///     At most one of them is a `scene.json`.
    ///
    /// Returns
    /// -------
    /// Scene
    #[staticmethod]
    fn read(py: Python<'_>, paths: &Bound<'_, PyAny>) -> PyResult<Self> {
        let files = match paths.extract::<PathBuf>() {
            Ok(path) => vec![path],
            Err(_) => paths
                .extract::<Vec<PathBuf>>()
                .map_err(|_| errors::wrong_type("paths", "a path or a list of paths", paths))?,
        };
        Ok(Self { inner: run(py, None, move |_| SceneContents::read(&files))? })
    }

    /// With a box around its own origin.
    ///
    /// Parameters
    /// ----------
    /// name : str
    /// size : (3,) array_like
    ///     Lengths along x, y and z.
    /// pose : (4, 4) array_like, optional
    ///     Where its centre stands, and how it is turned.
    ///
    /// Returns
    /// -------
    /// Scene
    #[pyo3(signature = (name, *, size, pose=None))]
    fn with_box(
        &self,
        py: Python<'_>,
        name: &str,
        size: &Bound<'_, PyAny>,
        pose: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let size = arrays_in::point(size, "size")?;
        self.with_primitive(py, name, Geometry::Box { size }, pose)
    }

    /// With a cylinder around its own origin, along its z.
    ///
    /// Parameters
    /// ----------
    /// name : str
    /// radius : float
    /// length : float
    /// pose : (4, 4) array_like, optional
    ///     Where its centre stands, and how it is turned.
    ///
    /// Returns
    /// -------
    /// Scene
    #[pyo3(signature = (name, *, radius, length, pose=None))]
    fn with_cylinder(
        &self,
        py: Python<'_>,
        name: &str,
        radius: f64,
        length: f64,
        pose: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        self.with_primitive(py, name, Geometry::Cylinder { radius, length }, pose)
    }

    /// With a ball.
    ///
    /// Parameters
    /// ----------
    /// name : str
    /// radius : float
    /// position : (3,) array_like
    ///     Its centre.
    ///
    /// Returns
    /// -------
    /// Scene
    #[pyo3(signature = (name, *, radius, position))]
    fn with_sphere(
        &self,
        py: Python<'_>,
        name: &str,
        radius: f64,
        position: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let at = Pose::from_translation(arrays_in::point(position, "position")?);
        let contents = self.inner.clone();
        let inner = guard(py, || contents.with_primitive(name, &Geometry::Sphere { radius }, at))?;
        Ok(Self { inner })
    }

    /// With a mesh; where it is watertight, its inside is solid.
    ///
    /// Parameters
    /// ----------
    /// name : str
    /// mesh : mesh_like
    /// scale : float, default 1
    ///     Metres per unit of the mesh.
    /// pose : (4, 4) array_like, optional
    ///     Where its origin stands, and how it is turned.
    ///
    /// Returns
    /// -------
    /// Scene
    #[pyo3(signature = (name, mesh, *, scale=1.0, pose=None))]
    fn with_mesh(
        &self,
        py: Python<'_>,
        name: String,
        mesh: &Bound<'_, PyAny>,
        scale: f64,
        pose: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let (mesh, at) = (from_any(mesh, "mesh")?, pose_or_origin(pose)?);
        let contents = self.inner.clone();
        let inner = run(py, None, move |_| contents.with_mesh(&name, &mesh, scale, at))?;
        Ok(Self { inner })
    }

    /// With observed points.
    ///
    /// Parameters
    /// ----------
    /// name : str
    /// points : (p, 3) array_like
    /// margin : float, default 0.005
    ///     Distance that is kept from each point.
    /// pose : (4, 4) array_like, optional
    ///     Of the frame in which the points are told, such as the camera's.
    ///
    /// Returns
    /// -------
    /// Scene
    #[pyo3(signature = (name, points, *, margin=0.005, pose=None))]
    fn with_cloud(
        &self,
        py: Python<'_>,
        name: String,
        points: &Bound<'_, PyAny>,
        margin: f64,
        pose: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let (points, at) = (arrays_in::points(points, "points")?, pose_or_origin(pose)?);
        let contents = self.inner.clone();
        let inner = run(py, None, move |_| contents.with_cloud(&name, points, margin, at))?;
        Ok(Self { inner })
    }

    /// With a table: everything below a plane is solid.
    ///
    /// Parameters
    /// ----------
    /// name : str
    /// point : (3,) array_like
    ///     A point of the plane.
    /// normal : (3,) array_like, optional
    ///     Away from the table, at any length; upwards by default.
    ///
    /// Returns
    /// -------
    /// Scene
    #[pyo3(signature = (name, *, point, normal=None))]
    fn with_table(
        &self,
        py: Python<'_>,
        name: &str,
        point: &Bound<'_, PyAny>,
        normal: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let point = arrays_in::point(point, "point")?;
        let normal = normal.map_or(Ok(DVec3::Z), |normal| arrays_in::point(normal, "normal"))?;
        let contents = self.inner.clone();
        Ok(Self { inner: guard(py, || contents.with_table(name, point, normal))? })
    }

    /// list of str: names of what stands there.
    #[getter]
    fn names(&self) -> Vec<String> {
        self.inner.obstacles.iter().map(|obstacle| obstacle.name.clone()).collect()
    }

    fn __len__(&self) -> usize {
        self.inner.obstacles.len()
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }

    fn __repr__(&self) -> String {
        format!("Scene({})", self.names().join(", "))
    }
}

impl Scene {
    fn with_primitive(
        &self,
        py: Python<'_>,
        name: &str,
        shape: Geometry,
        pose: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let (contents, at) = (self.inner.clone(), pose_or_origin(pose)?);
        Ok(Self { inner: guard(py, || contents.with_primitive(name, &shape, at))? })
    }
}

fn pose_or_origin(pose: Option<&Bound<'_, PyAny>>) -> PyResult<Pose> {
    pose.map_or(Ok(Pose::IDENTITY), |pose| rigid(pose, "pose"))
}
