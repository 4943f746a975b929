//! `Matching`: a pair, matched once, that transfers any number of regions.

use std::sync::Arc;

use pyo3::prelude::*;
use semfm::fmap;
use semfm::fmap::Matching as Matched;

use crate::anchors::Anchors;
use crate::functional_map::FunctionalMap;
use crate::interruptible::run;
use crate::point_map::PointMap;
use crate::prepared::PreparedObject;
use crate::region::region_of;
use crate::settings::{Options, TransferSettings};
use crate::shared::Shared;
use crate::transfer::Transfer;

/// A matched pair: computed once, it transfers any number of regions.
///
/// Parameters
/// ----------
/// source : PreparedObject
///     The demonstrated object.
/// target : PreparedObject
///     The one to act on.
/// method : str, optional
///     ``fused`` (where neither this nor `settings` is given), ``semfm``, ``anchored``,
///     ``sinkhorn``, ``nearest`` or ``wks``.
/// rule : str, optional
///     How a map transfers the region: ``preimage`` (where none is given) or ``image``.
/// seed : int, optional
///     Of everything drawn by chance; 0 where none is given.
/// second_opinion : bool, optional
///     Whether an independent method judges the result, too; the method's own default where none is
///     given: True where its confidence is the agreement of the two.
/// settings : TransferSettings, optional
///     Everything that can be set, in place of `method` and `rule`.
/// progress : progress, optional
///
/// Examples
/// --------
/// >>> import semfm
/// >>> mug, kettle = (semfm.demo_object("containers", instance=i, n_vertices=500) for i in (0, 1))
/// >>> source, target = (
/// ...     semfm.prepare(o.mesh, features=o.shared_features(), k=30) for o in (mug, kettle))
/// >>> matching = semfm.Matching(source, target)
/// >>> matching.transfer(mug.region).verdict in ("accept", "check", "refuse")
/// True
#[pyclass(frozen, module = "semfm")]
#[derive(Clone)]
pub struct Matching {
    pair: Arc<Matched>,
    source: PreparedObject,
    target: PreparedObject,
    settings: fmap::TransferSettings,
}

#[pymethods]
impl Matching {
    #[new]
    #[pyo3(signature = (
        source, target, *, method=None, rule=None, seed=None, second_opinion=None, settings=None,
        progress=None
    ))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments, one per setting")]
    fn new(
        py: Python<'_>,
        source: &Bound<'_, PreparedObject>,
        target: &Bound<'_, PreparedObject>,
        method: Option<&str>,
        rule: Option<&str>,
        seed: Option<u64>,
        second_opinion: Option<bool>,
        settings: Option<&Bound<'_, TransferSettings>>,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let options = Options {
            method,
            rule,
            seed,
            second_opinion,
            settings,
            k: None,
            working_vertices: None,
            cache: None,
        };
        let settings = options.pipeline(py)?.transfer;
        let (source, target) = (source.get().clone(), target.get().clone());
        run(py, progress, move |task| Self::of(source, target, &settings, task))
    }

    /// Transfers one region.
    ///
    /// Parameters
    /// ----------
    /// region : Region or path
    ///     On the source's mesh as given.
    ///
    /// Returns
    /// -------
    /// Transfer
    fn transfer(&self, region: &Bound<'_, PyAny>) -> PyResult<Transfer> {
        let py = region.py();
        let region = region_of(region, &self.source.mesh_inner())?;
        let matching = self.clone();
        run(py, None, move |_| matching.transferred(region))
    }

    /// Anchors: the paired parts of the two objects.
    #[getter]
    fn anchors(&self, py: Python<'_>) -> PyResult<Anchors> {
        let pair = Arc::clone(&self.pair);
        let anchors = run(py, None, move |task| Ok(pair.anchors(task)?.clone()))?;
        Ok(Anchors { inner: Arc::new(anchors) })
    }

    /// FunctionalMap, optional: C between the working shapes; None for methods without a map.
    #[getter]
    fn functional_map(&self) -> Option<FunctionalMap> {
        let map = self.pair.functional_map()?;
        Some(FunctionalMap { inner: Arc::new(map.clone()) })
    }

    /// PointMap: target → source, between the working meshes.
    #[getter]
    fn working_point_map(&self) -> PointMap {
        let map = self.pair.working_point_map();
        let n_source = self.source.inner.object.shape().mesh().n_vertices();
        PointMap { inner: Shared::new(map.clone()), n_source }
    }

    /// PreparedObject: the demonstrated object.
    #[getter]
    fn source(&self) -> PreparedObject {
        self.source.clone()
    }

    /// PreparedObject: the one to act on.
    #[getter]
    fn target(&self) -> PreparedObject {
        self.target.clone()
    }

    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, (PreparedObject, PreparedObject, TransferSettings))> {
        let restore = py.import("semfm._semfm")?.getattr("_restore_matching")?;
        let settings = TransferSettings { settings: self.settings.clone() };
        Ok((restore, (self.source(), self.target(), settings)))
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }

    fn __repr__(&self) -> &'static str {
        "Matching(PreparedObject, PreparedObject)"
    }
}

impl Matching {
    /// Matches two prepared objects.
    pub fn of(
        source: PreparedObject,
        target: PreparedObject,
        settings: &fmap::TransferSettings,
        task: &semfm::Task,
    ) -> semfm::Result<Self> {
        let pair = Matched::new(&source.inner.object, &target.inner.object, settings, task)?;
        if pair.source().has_features() {
            pair.anchors(task)?; // its reports list them, as those of the short call
        }
        Ok(Self { pair: Arc::new(pair), source, target, settings: settings.clone() })
    }

    /// Transfers one region, which must be of the source's mesh.
    pub fn transferred(&self, region: Shared<semfm::Region>) -> semfm::Result<Transfer> {
        let transfer = Arc::new(self.pair.transfer(&region)?);
        let (source, target) = (self.source.clone(), self.target.clone());
        Ok(Transfer { inner: transfer, source, target, region })
    }
}

/// A matching out of a pickle: matched again, which gives the same.
#[pyfunction]
pub fn _restore_matching(
    source: &Bound<'_, PreparedObject>,
    target: &Bound<'_, PreparedObject>,
    settings: &Bound<'_, TransferSettings>,
) -> PyResult<Matching> {
    let (py, settings) = (source.py(), settings.get().settings.clone());
    let (source, target) = (source.get().clone(), target.get().clone());
    run(py, None, move |task| Matching::of(source, target, &settings, task))
}
