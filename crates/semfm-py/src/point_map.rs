//! `PointMap`: one source vertex for each target vertex.

use std::path::PathBuf;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use semfm::files::PointMapFile;
use semfm::fmap;

use crate::arrays_in::{self, Axis};
use crate::interruptible::{guard, run};
use crate::mesh::Reduced;
use crate::shared::Shared;
use crate::{arrays_out, errors, json};

/// A map target → source: ``source_of[j]`` is the source vertex matched to target vertex ``j``.
///
/// Functions and regions therefore travel source → target, by being looked up.
///
/// Parameters
/// ----------
/// source_of : (n_target,) array_like
///     Vertex ids of the source.
/// n_source : int
///     Number of source vertices.
///
/// Examples
/// --------
/// >>> import semfm
/// >>> to_source = semfm.PointMap([2, 0, 2], n_source=3)
/// >>> to_source.pull_back([10.0, 20.0, 30.0]).tolist()
/// [30.0, 10.0, 30.0]
#[pyclass(frozen, module = "semfm")]
pub struct PointMap {
    pub inner: Shared<fmap::PointMap>,
    pub n_source: usize,
}

impl PointMap {
    /// The map of a file.
    pub fn of_file(py: Python<'_>, file: &PointMapFile) -> PyResult<Self> {
        let n_source = file.source_weight.len();
        let map = guard(py, || Ok(fmap::PointMap::new(file.source_of.clone(), n_source)?))?;
        Ok(Self { inner: Shared::new(map), n_source })
    }
}

#[pymethods]
impl PointMap {
    #[new]
    fn new(source_of: &Bound<'_, PyAny>, n_source: usize) -> PyResult<Self> {
        let (ids, _) = arrays_in::ids(source_of, "source_of", &[Axis::Any("n_target")])?;
        let map = guard(source_of.py(), || Ok(fmap::PointMap::new(ids, n_source)?))?;
        Ok(Self { inner: Shared::new(map), n_source })
    }

    /// (n_target,) uint32 array: the source vertex of each target vertex, a read-only view.
    #[getter]
    fn source_of<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        arrays_out::vector(slf, |map| map.inner.source_of.as_slice())
    }

    /// int: number of source vertices.
    #[getter]
    fn n_source(&self) -> usize {
        self.n_source
    }

    /// int: number of target vertices.
    #[getter]
    fn n_target(&self) -> usize {
        self.inner.n_target()
    }

    /// A function on the source, looked up from the target: ``function[source_of]``.
    ///
    /// Parameters
    /// ----------
    /// function : (n_source, ...) array_like
    ///     Of any dtype, one entry (or row) per source vertex.
    ///
    /// Returns
    /// -------
    /// (n_target, ...) array
    fn pull_back<'py>(
        slf: &Bound<'py, Self>,
        function: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = slf.py();
        let function = py.import("numpy")?.call_method1("asarray", (function,))?;
        let n_source = slf.get().n_source;
        let rows = function.len().unwrap_or(0);
        if rows != n_source {
            let expected = format!("{n_source} rows, one per source vertex");
            return Err(errors::invalid(py, "function", &expected, &rows.to_string()));
        }
        function.call_method1("take", (Self::source_of(slf)?, 0))
    }

    /// Writes `source_of` and `n_source` to an .npz file.
    ///
    /// Parameters
    /// ----------
    /// path : path
    fn to_npz(slf: &Bound<'_, Self>, path: PathBuf) -> PyResult<()> {
        let arrays = PyDict::new(slf.py());
        arrays.set_item("source_of", Self::source_of(slf)?)?;
        arrays.set_item("n_source", slf.get().n_source)?;
        json::write_npz(slf.py(), path, &arrays)
    }

    /// Reads what `to_npz` wrote.
    ///
    /// Parameters
    /// ----------
    /// path : path
    ///
    /// Returns
    /// -------
    /// PointMap
    #[staticmethod]
    fn from_npz(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let [source_of, n_source] = json::read_npz(py, &path, ["source_of", "n_source"])?;
        Self::new(&source_of, arrays_in::count(&n_source, "n_source")?)
    }

    /// Reads the `point_map.json` of a transfer's folder.
    ///
    /// Parameters
    /// ----------
    /// path : path
    ///
    /// Returns
    /// -------
    /// PointMap
    ///
    /// See Also
    /// --------
    /// read_transfer : the whole folder.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let file = run(py, None, move |_| PointMapFile::read(&path))?;
        Self::of_file(py, &file)
    }

    fn __len__(&self) -> usize {
        self.inner.n_target()
    }

    fn __repr__(&self) -> String {
        format!("PointMap({} target vertices → {} source)", self.inner.n_target(), self.n_source)
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Self>().is_ok_and(|other| {
            let other = other.get();
            *other.inner == *self.inner && other.n_source == self.n_source
        })
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Reduced<'py>> {
        let parts = (Self::source_of(slf)?, slf.get().n_source);
        Ok((slf.get_type(), parts.into_pyobject(slf.py())?.into_any()))
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }
}
