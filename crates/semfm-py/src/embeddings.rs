//! `PatchEmbeddings` of single views and `Embeddings` of a whole object.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use semfm::geom;
use semfm::views::mcap::{Dtype, EmbeddingsFile, EmbeddingsMetadata, ViewsMetadata};
use semfm::views::{self, EmbeddedView};

use crate::arrays_in::{self, Axis};
use crate::interruptible::{guard, run};
use crate::mesh::from_any;
use crate::pinhole::Pinhole;
use crate::views_file::ViewsFile;
use crate::{arrays_out, errors, json};

/// What an encoder says about a view: one vector per image patch.
///
/// Parameters
/// ----------
/// data : (rows, cols, d) array_like
///     Vectors, top-left patch first; finite in valid patches.
/// rect : (4,) array_like
///     The grid's rectangle in pixels, edges not centres: left, top, right, bottom.
/// coverage : (rows, cols) array_like, optional
///     Share of each patch covered by the object, 0 to 255 (uint8); 255 where none is given.
/// valid : (rows, cols) array_like, optional
///     False where the patch is to be ignored (bool).
#[pyclass(frozen, module = "semfm")]
pub struct PatchEmbeddings {
    pub inner: Arc<views::PatchEmbeddings>,
}

#[pymethods]
impl PatchEmbeddings {
    #[new]
    #[pyo3(signature = (data, rect, *, coverage=None, valid=None))]
    fn new(
        data: &Bound<'_, PyAny>,
        rect: &Bound<'_, PyAny>,
        coverage: Option<&Bound<'_, PyAny>>,
        valid: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let py = data.py();
        let axes = [Axis::Any("rows"), Axis::Any("cols"), Axis::Any("d")];
        // Numbers of patches that do not count may be anything.
        let (data, shape) = arrays_in::any32(data, "data", &axes)?;
        let [rows, cols, dim] = [shape[0], shape[1], shape[2]];
        let grid = [Axis::Is(rows), Axis::Is(cols)];
        let coverage = match coverage {
            Some(coverage) => arrays_in::bytes(coverage, "coverage", &grid)?.0,
            None => vec![255; rows * cols],
        };
        let valid = match valid {
            Some(valid) => arrays_in::mask(valid, "valid", &grid)?.0,
            None => vec![true; rows * cols],
        };
        let rect = arrays_in::floats32(rect, "rect", &[Axis::Is(4)])?.0;
        let rect = [rect[0], rect[1], rect[2], rect[3]];
        let grid = views::PatchGrid { rows, cols, rect };
        let patches =
            guard(py, || Ok(views::PatchEmbeddings::new(grid, dim, data, coverage, valid)?))?;
        Ok(Self { inner: Arc::new(patches) })
    }

    /// (rows, cols, d) float32 array: the vectors, a read-only view.
    #[getter]
    fn data<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let patches = &slf.get().inner;
        let shape = (patches.grid().rows, patches.grid().cols, patches.dim());
        arrays_out::vector(slf, |patches| patches.inner.data())?.call_method1("reshape", (shape,))
    }

    /// (4,) float32 array: left, top, right, bottom of the grid in pixels.
    #[getter]
    fn rect<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        arrays_out::owned(py, self.inner.grid().rect.to_vec())
    }

    /// (rows, cols) uint8 array: share of each patch covered by the object, a read-only view.
    #[getter]
    fn coverage<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        arrays_out::rows(slf, slf.get().inner.grid().cols, |patches| patches.inner.coverage())
    }

    /// (rows, cols) bool array: False where the patch is to be ignored, a read-only view.
    #[getter]
    fn valid<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        arrays_out::rows(slf, slf.get().inner.grid().cols, |patches| patches.inner.valid())
    }

    /// int: dimension d of each vector.
    #[getter]
    fn dim(&self) -> usize {
        self.inner.dim()
    }

    fn __repr__(&self) -> String {
        let views::PatchGrid { rows, cols, .. } = self.inner.grid();
        format!("PatchEmbeddings({rows} × {cols}, dim {})", self.inner.dim())
    }

    fn __reduce__<'py>(
        slf: &Bound<'py, Self>,
    ) -> PyResult<(
        Bound<'py, PyAny>,
        (Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>),
    )> {
        let restore = slf.py().import("semfm._semfm")?.getattr("_restore_patches")?;
        let rect = slf.get().rect(slf.py());
        Ok((restore, (Self::data(slf)?, rect, Self::coverage(slf)?, Self::valid(slf)?)))
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }
}

/// Patch embeddings out of a pickle.
#[pyfunction]
pub fn _restore_patches(
    data: &Bound<'_, PyAny>,
    rect: &Bound<'_, PyAny>,
    coverage: &Bound<'_, PyAny>,
    valid: &Bound<'_, PyAny>,
) -> PyResult<PatchEmbeddings> {
    PatchEmbeddings::new(data, rect, Some(coverage), Some(valid))
}

/// The embeddings of an object's views, with the cameras and the mesh they were made of.
///
/// Parameters
/// ----------
/// mesh : mesh_like
///     The mesh that the views show.
/// cameras : list of Pinhole
///     One per view, all of one size.
/// patches : list of PatchEmbeddings
///     One per view, all of one dimension.
/// encoder : str, default "unnamed"
///     Name of the encoder, for the file.
#[pyclass(frozen, module = "semfm")]
pub struct Embeddings {
    pub inner: Arc<EmbeddingsFile>,
}

impl Embeddings {
    fn of(
        metadata: EmbeddingsMetadata,
        cameras: Vec<geom::Pinhole>,
        grids: Vec<views::PatchEmbeddings>,
    ) -> Self {
        let views = cameras.into_iter().zip(grids);
        let views = views.map(|(camera, patches)| EmbeddedView { camera, patches }).collect();
        Self { inner: Arc::new(EmbeddingsFile { path: PathBuf::new(), metadata, views }) }
    }
}

/// The grids of a list of `PatchEmbeddings`.
fn grids_of(patches: &Bound<'_, PyAny>) -> PyResult<Vec<views::PatchEmbeddings>> {
    let mut grids = Vec::new();
    for grid in patches.try_iter()? {
        let grid = grid?;
        let grid = grid
            .cast::<PatchEmbeddings>()
            .map_err(|_| errors::wrong_type("patches", "PatchEmbeddings objects", &grid))?;
        grids.push((*grid.get().inner).clone());
    }
    Ok(grids)
}

#[pymethods]
impl Embeddings {
    #[new]
    #[pyo3(signature = (mesh, cameras, patches, *, encoder="unnamed"))]
    fn new(
        mesh: &Bound<'_, PyAny>,
        cameras: &Bound<'_, PyAny>,
        patches: &Bound<'_, PyAny>,
        encoder: &str,
    ) -> PyResult<Self> {
        let py = mesh.py();
        let shared = from_any(mesh, "mesh")?;
        let cameras = crate::pinhole::list(cameras)?;
        let grids = grids_of(patches)?;
        if cameras.len() != grids.len() || grids.is_empty() {
            let expected = format!("{}, one per camera, and at least one", cameras.len());
            return Err(errors::invalid(py, "patches", &expected, &grids.len().to_string()));
        }
        let (width, height) = (cameras[0].width(), cameras[0].height());
        let dim = grids[0].dim();
        for (view, (camera, grid)) in cameras.iter().zip(&grids).enumerate() {
            if (camera.width(), camera.height()) != (width, height) {
                let found = format!("{} × {} in view {view}", camera.width(), camera.height());
                return Err(errors::invalid(py, "cameras", &format!("{width} × {height}"), &found));
            }
            if grid.dim() != dim {
                let found = format!("{} in view {view}", grid.dim());
                return Err(errors::invalid(py, "patches", &format!("dimension {dim}"), &found));
            }
        }
        let mut views = ViewsMetadata::of(&shared, width, height);
        (views.rig, views.background) = ("given as cameras".into(), "unknown".into());
        let metadata = EmbeddingsMetadata {
            views,
            encoder: encoder.to_owned(),
            revision: "unknown".into(),
            preprocessing: "unknown".into(),
            rolls: 1,
            outliers: "unknown".into(),
            simulated: false,
        };
        Ok(Self::of(metadata, cameras, grids))
    }

    /// What an encoder made of the views of a file; `semfm-embed` calls this.
    ///
    /// Parameters
    /// ----------
    /// views : ViewsFile
    ///     The views that were encoded; their metadata are kept.
    /// patches : list of PatchEmbeddings
    ///     One per view, all of one dimension.
    /// encoder : str
    ///     Name of the encoder.
    /// revision : str, default "unknown"
    ///     Its revision, or the hash of its file.
    /// preprocessing : str, default "unknown"
    ///     How a picture was made into the encoder's input.
    /// rolls : int, default 1
    ///     Number of turned pictures of each view that were averaged.
    /// outliers : str, default "unknown"
    ///     What was done with outlier tokens.
    /// more : dict, optional
    ///     Further entries of the metadata, text by name.
    ///
    /// Returns
    /// -------
    /// Embeddings
    #[staticmethod]
    #[pyo3(signature = (
        views, patches, *, encoder, revision="unknown", preprocessing="unknown", rolls=1,
        outliers="unknown", more=None
    ))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments, one per entry of metadata")]
    fn of_views(
        views: &Bound<'_, ViewsFile>,
        patches: &Bound<'_, PyAny>,
        encoder: String,
        revision: &str,
        preprocessing: &str,
        rolls: u32,
        outliers: &str,
        more: Option<BTreeMap<String, String>>,
    ) -> PyResult<Self> {
        let py = views.py();
        let (views, grids) = (views.get(), grids_of(patches)?);
        let cameras = views.camera_of_each();
        if cameras.len() != grids.len() {
            let expected = format!("{}, one per view", cameras.len());
            return Err(errors::invalid(py, "patches", &expected, &grids.len().to_string()));
        }
        let mut metadata = EmbeddingsMetadata {
            views: views.metadata.clone(),
            encoder,
            revision: revision.to_owned(),
            preprocessing: preprocessing.to_owned(),
            rolls,
            outliers: outliers.to_owned(),
            simulated: false,
        };
        metadata.views.more.extend(more.into_iter().flatten());
        Ok(Self::of(metadata, cameras, grids))
    }

    /// Reads a ``NAME.emb.mcap`` and checks everything in it.
    ///
    /// Parameters
    /// ----------
    /// path : path
    ///
    /// Returns
    /// -------
    /// Embeddings
    #[staticmethod]
    pub fn read(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let file = run(py, None, move |_| Ok(EmbeddingsFile::read(&path)?))?;
        Ok(Self { inner: Arc::new(file) })
    }

    /// Writes a ``NAME.emb.mcap``, whole or not at all.
    ///
    /// Parameters
    /// ----------
    /// path : path
    /// dtype : str, default "f16"
    ///     ``"f16"`` or ``"f32"``.
    #[pyo3(signature = (path, *, dtype="f16"))]
    fn write(&self, py: Python<'_>, path: PathBuf, dtype: &str) -> PyResult<()> {
        let dtype = match dtype {
            "f16" => Dtype::F16,
            "f32" => Dtype::F32,
            other => {
                return Err(errors::invalid(py, "dtype", "'f16' or 'f32'", &format!("{other:?}")));
            }
        };
        let shared = self.inner.clone();
        run(py, None, move |_| {
            semfm::geom::io::refuse_input(&path)?;
            Ok(shared.write(&path, dtype)?)
        })
    }

    /// int: number of views.
    #[getter]
    fn n_views(&self) -> usize {
        self.inner.views.len()
    }

    /// int: dimension d of the vectors.
    #[getter]
    fn dim(&self) -> usize {
        self.inner.dim()
    }

    /// list of Pinhole: one per view.
    #[getter]
    fn cameras(&self) -> Vec<Pinhole> {
        self.inner.views.iter().map(|view| Pinhole { camera: view.camera }).collect()
    }

    /// list of PatchEmbeddings: one per view.
    #[getter]
    fn patches(&self) -> Vec<PatchEmbeddings> {
        let grid = |view: &EmbeddedView| PatchEmbeddings { inner: Arc::new(view.patches.clone()) };
        self.inner.views.iter().map(grid).collect()
    }

    /// str: hash of the mesh that the views show.
    #[getter]
    fn mesh_hash(&self) -> String {
        self.inner.metadata.views.mesh.hash.to_string()
    }

    /// str: name of the encoder.
    #[getter]
    fn encoder(&self) -> String {
        self.inner.metadata.encoder.clone()
    }

    /// dict: the file's metadata record ``semfm``, all entries as text.
    #[getter]
    fn metadata<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        json::text_entries(py, &self.inner.metadata.entries(self.inner.views.len()))
    }

    /// bool: True where the embeddings were made up, without a network.
    #[getter]
    fn simulated(&self) -> bool {
        self.inner.metadata.simulated
    }

    fn __len__(&self) -> usize {
        self.inner.views.len()
    }

    fn __repr__(&self) -> String {
        let (n, dim) = (self.inner.views.len(), self.inner.dim());
        format!("Embeddings({n} views, dim {dim}, by {:?})", self.inner.metadata.encoder)
    }

    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        let restore = py.import("semfm._semfm")?.getattr("_restore_embeddings")?;
        // The file is the one form that holds everything, to the last bit in f32.
        let bytes = in_scratch_file(py, |path| {
            self.write(py, path.to_owned(), "f32")?;
            Ok(std::fs::read(path)?)
        })?;
        Ok((restore, (PyBytes::new(py, &bytes),)))
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }
}

/// Embeddings out of a pickle.
#[pyfunction]
pub fn _restore_embeddings(bytes: &Bound<'_, PyBytes>) -> PyResult<Embeddings> {
    let py = bytes.py();
    in_scratch_file(py, |path| {
        std::fs::write(path, bytes.as_bytes())?;
        Embeddings::read(py, path.to_owned())
    })
}

fn in_scratch_file<T>(py: Python<'_>, work: impl FnOnce(&Path) -> PyResult<T>) -> PyResult<T> {
    let folder = py.import("tempfile")?.getattr("TemporaryDirectory")?.call0()?;
    let path = folder.getattr("name")?.extract::<PathBuf>()?.join("pickled.emb.mcap");
    let result = work(&path);
    folder.call_method0("cleanup")?;
    result
}
