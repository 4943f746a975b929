//! `ViewsFile`: the views of an object with their mesh and metadata, as in `NAME.views.mcap`.

use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

use pyo3::prelude::*;
use pyo3::types::PyDict;
use semfm::geom;
use semfm::views;
use semfm::views::mcap::{self, ViewsMetadata, find_mesh, write_views};

use crate::interruptible::run;
use crate::mesh::{Mesh, from_any};
use crate::pinhole::Pinhole;
use crate::shared::Shared;
use crate::view::View;
use crate::{errors, json};

/// The rendered views of an object, as a ``NAME.views.mcap`` holds them: for `semfm-embed`, and for
/// Foxglove.
///
/// Parameters
/// ----------
/// mesh : mesh_like
///     The mesh that was rendered.
/// views : list of View
///     At least one, all of one size.
/// rig : str, default "given as cameras"
///     How the cameras were placed, in words, for the file.
/// background : str, default "as rendered"
///     What stands behind the object, in words, for the file.
///
/// Examples
/// --------
/// >>> import pathlib, tempfile
/// >>> import semfm, semfm.zoo
/// >>> mesh = semfm.zoo.torus(40, 20)
/// >>> views = semfm.render(mesh, semfm.rig(mesh, count=3, size=64))
/// >>> folder = tempfile.TemporaryDirectory()
/// >>> path = pathlib.Path(folder.name, "torus.views.mcap")
/// >>> semfm.ViewsFile(mesh, views).write(path)
/// >>> file = semfm.ViewsFile.read(path)
/// >>> file, file.mesh == mesh, file.metadata["n_views"]
/// (ViewsFile(3 views, 64 × 64), True, '3')
/// >>> folder.cleanup()
#[pyclass(frozen, module = "semfm")]
pub struct ViewsFile {
    /// Where it was read; `None` for views of this process.
    path: Option<PathBuf>,
    pub metadata: ViewsMetadata,
    views: Vec<Arc<views::View>>,
    /// The mesh in the file, read when first asked for; `None` where the file has none.
    mesh: OnceLock<Option<Shared<semfm::Mesh>>>,
}

impl ViewsFile {
    /// The cameras, one for each view.
    pub fn camera_of_each(&self) -> Vec<geom::Pinhole> {
        self.views.iter().map(|view| view.camera).collect()
    }

    fn shared_mesh(&self, py: Python<'_>) -> PyResult<Option<Shared<semfm::Mesh>>> {
        if let Some(mesh) = self.mesh.get() {
            return Ok(mesh.clone());
        }
        let Some(path) = self.path.clone() else { return Ok(None) };
        let metadata = self.metadata.clone();
        let found = run(py, None, move |_| {
            let Some((mesh, _)) = find_mesh(&path)? else { return Ok(None) };
            metadata.check_mesh(&mesh, &path)?;
            Ok(Some(Shared::new(mesh)))
        })?;
        Ok(self.mesh.get_or_init(|| found).clone())
    }
}

#[pymethods]
impl ViewsFile {
    #[new]
    #[pyo3(signature = (mesh, views, *, rig="given as cameras", background="as rendered"))]
    fn new(
        mesh: &Bound<'_, PyAny>,
        views: &Bound<'_, PyAny>,
        rig: &str,
        background: &str,
    ) -> PyResult<Self> {
        let mesh = from_any(mesh, "mesh")?;
        let mut rendered = Vec::new();
        for view in views.try_iter()? {
            let view = view?;
            let view = view
                .cast::<View>()
                .map_err(|_| errors::wrong_type("views", "View objects", &view))?;
            rendered.push(Arc::clone(&view.get().view));
        }
        let Some(camera) = rendered.first().map(|view| view.camera) else {
            return Err(errors::invalid(views.py(), "views", "at least one view", "none"));
        };
        let mut metadata = ViewsMetadata::of(&mesh, camera.width(), camera.height());
        (metadata.rig, metadata.background) = (rig.to_owned(), background.to_owned());
        Ok(Self { path: None, metadata, views: rendered, mesh: OnceLock::from(Some(mesh)) })
    }

    /// Reads a ``NAME.views.mcap`` and checks everything in it.
    ///
    /// Parameters
    /// ----------
    /// path : path
    ///
    /// Returns
    /// -------
    /// ViewsFile
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let from = path.clone();
        let file = run(py, None, move |_| Ok(mcap::ViewsFile::read(&from)?))?;
        let views = file.views.into_iter().map(Arc::new).collect();
        Ok(Self { path: Some(path), metadata: file.metadata, views, mesh: OnceLock::new() })
    }

    /// Writes a ``NAME.views.mcap`` with its mesh, whole or not at all.
    ///
    /// Parameters
    /// ----------
    /// path : path
    fn write(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let Some(mesh) = self.shared_mesh(py)? else {
            return Err(errors::invalid(py, "mesh", "views with the mesh they show", "none"));
        };
        let (views, metadata) = (self.views.clone(), self.metadata.clone());
        run(py, None, move |_| Ok(write_views(&path, &views, &mesh, None, &metadata)?))
    }

    /// list of View: the views, as numbered.
    #[getter]
    fn views(&self) -> Vec<View> {
        self.views.iter().map(|view| View { view: Arc::clone(view) }).collect()
    }

    /// list of Pinhole: one per view.
    #[getter]
    fn cameras(&self) -> Vec<Pinhole> {
        self.camera_of_each().into_iter().map(|camera| Pinhole { camera }).collect()
    }

    /// int: number of views.
    #[getter]
    fn n_views(&self) -> usize {
        self.views.len()
    }

    /// Mesh, optional: the mesh that the views show, vertex by vertex as it was rendered; None where the file has none.
    #[getter]
    fn mesh(&self, py: Python<'_>) -> PyResult<Option<Mesh>> {
        Ok(self.shared_mesh(py)?.map(|shared| Mesh { inner: shared }))
    }

    /// str: hash of the mesh that the views show.
    #[getter]
    fn mesh_hash(&self) -> String {
        self.metadata.mesh.hash.to_string()
    }

    /// dict: the file's metadata record ``semfm``, all entries as text.
    #[getter]
    fn metadata<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        json::text_entries(py, &self.metadata.entries(self.views.len()))
    }

    fn __len__(&self) -> usize {
        self.views.len()
    }

    fn __repr__(&self) -> String {
        let (n, ViewsMetadata { width, height, .. }) = (self.views.len(), &self.metadata);
        format!("ViewsFile({n} views, {width} × {height})")
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }
}
