//! `Clusters` of a cloud, and `Anchors` between the clusters of two.

use std::sync::Arc;

use pyo3::prelude::*;
use semfm::fmap;
use semfm::fmap::clusters::{self, ClusterSettings};

use crate::arrays_in::{self, Axis};
use crate::cloud::SemanticCloud;
use crate::interruptible::run;
use crate::mesh::Reduced;
use crate::{arrays_out, errors};

/// A cloud cut into parts: one label per point, every label from 0 on at least one.
///
/// Parameters
/// ----------
/// labels : (m,) array_like
///     Labels from elsewhere (ids); gaps in the numbering are closed.
///
/// See Also
/// --------
/// spectral_clusters : cuts a cloud by its features.
#[pyclass(frozen, module = "semfm")]
pub struct Clusters {
    pub inner: Arc<clusters::Clusters>,
}

#[pymethods]
impl Clusters {
    #[new]
    fn new(labels: &Bound<'_, PyAny>) -> PyResult<Self> {
        let (labels, _) = arrays_in::ids(labels, "labels", &[Axis::Any("m")])?;
        Ok(Self { inner: Arc::new(clusters::Clusters::from_labels(&labels)) })
    }

    /// (m,) uint32 array: label of each point, a read-only view.
    #[getter]
    fn labels<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        arrays_out::vector(slf, |clusters| clusters.inner.labels())
    }

    /// int: number of parts.
    #[getter]
    fn n_clusters(&self) -> usize {
        self.inner.n_clusters()
    }

    fn __repr__(&self) -> String {
        format!(
            "Clusters({} parts of {} points)",
            self.inner.n_clusters(),
            self.inner.labels().len()
        )
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Reduced<'py>> {
        let parts = (Self::labels(slf)?,);
        Ok((slf.get_type(), parts.into_pyobject(slf.py())?.into_any()))
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }
}

/// Counts in settings beyond this are mistakes, and would be taken at their word for memory.
pub const MOST: u64 = 100_000;

/// Cuts a cloud into parts: spectral clustering on its neighbour graph, weighed by features.
///
/// Parameters
/// ----------
/// cloud : SemanticCloud
/// n_clusters : int, default 5
///     Parts.
/// neighbours : int, default 10
///     Neighbours of each point in space.
/// starts : int, default 10
///     Seedings of k-means, the best of which is kept.
/// seed : int, default 0
/// progress : progress, optional
///
/// Returns
/// -------
/// Clusters
#[pyfunction]
#[pyo3(signature = (cloud, *, n_clusters=5, neighbours=10, starts=10, seed=0, progress=None))]
pub fn spectral_clusters(
    cloud: &Bound<'_, SemanticCloud>,
    n_clusters: usize,
    neighbours: usize,
    starts: usize,
    seed: u64,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Clusters> {
    let py = cloud.py();
    for (name, count) in
        [("n_clusters", n_clusters), ("neighbours", neighbours), ("starts", starts)]
    {
        if count as u64 > MOST {
            return Err(errors::invalid(py, name, &format!("at most {MOST}"), &count.to_string()));
        }
    }
    let cloud = cloud.get().inner.clone();
    let settings = ClusterSettings { n_clusters, neighbours, starts, seed };
    let cut =
        run(py, progress, move |task| Ok(clusters::spectral_clusters(&cloud, &settings, task)?))?;
    Ok(Clusters { inner: Arc::new(cut) })
}

/// The paired parts of two objects, by falling cosine.
///
/// See Also
/// --------
/// Anchors.select, Matching.anchors
#[pyclass(frozen, module = "semfm")]
pub struct Anchors {
    pub inner: Arc<fmap::Anchors>,
}

#[pymethods]
impl Anchors {
    /// The one-to-one pairs of clusters with the largest total cosine between mean features.
    ///
    /// Parameters
    /// ----------
    /// source_cloud : SemanticCloud
    /// source_clusters : Clusters
    /// target_cloud : SemanticCloud
    /// target_clusters : Clusters
    /// alpha : int, default 2
    ///     How many pairs; fewer where there are fewer clusters.
    ///
    /// Returns
    /// -------
    /// Anchors
    #[staticmethod]
    #[pyo3(signature = (source_cloud, source_clusters, target_cloud, target_clusters, *, alpha=2))]
    fn select(
        source_cloud: &Bound<'_, SemanticCloud>,
        source_clusters: &Bound<'_, Clusters>,
        target_cloud: &Bound<'_, SemanticCloud>,
        target_clusters: &Bound<'_, Clusters>,
        alpha: usize,
    ) -> PyResult<Self> {
        let py = source_cloud.py();
        let clouds = (source_cloud.get().inner.clone(), target_cloud.get().inner.clone());
        let cuts = (source_clusters.get().inner.clone(), target_clusters.get().inner.clone());
        for (name, cloud, cut) in
            [("source_clusters", &clouds.0, &cuts.0), ("target_clusters", &clouds.1, &cuts.1)]
        {
            let (expected, found) = (cloud.n_points(), cut.labels().len());
            if expected != found {
                let expected = format!("{expected} labels, one per point of the cloud");
                return Err(errors::invalid(py, name, &expected, &found.to_string()));
            }
        }
        if clouds.0.dim() != clouds.1.dim() {
            let expected = format!("features of dimension {}, as the source's", clouds.0.dim());
            let found = clouds.1.dim().to_string();
            return Err(errors::invalid(py, "target_cloud", &expected, &found));
        }
        let anchors = run(py, None, move |_| {
            let source = fmap::ClusteredCloud { cloud: &clouds.0, clusters: &cuts.0 };
            let target = fmap::ClusteredCloud { cloud: &clouds.1, clusters: &cuts.1 };
            Ok(fmap::Anchors::select(source, target, alpha))
        })?;
        Ok(Self { inner: Arc::new(anchors) })
    }

    /// (a, 2) uint32 array: cluster of the source and of the target of each pair.
    #[getter]
    fn pairs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let pairs = self.inner.pairs.iter().flat_map(|pair| [pair.source, pair.target]);
        arrays_out::owned_rows::<u32>(py, pairs.collect(), 2)
    }

    /// (a,) float64 array: cosine of the two mean features of each pair.
    #[getter]
    fn scores<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        arrays_out::owned(py, self.inner.pairs.iter().map(|pair| pair.cosine).collect())
    }

    /// (a,) float64 array: by how much each cosine exceeds its best rival; infinite without one.
    #[getter]
    fn margins<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        arrays_out::owned(py, self.inner.pairs.iter().map(|pair| pair.margin).collect())
    }

    /// (K_source, K_target) float64 array: all cosines, a read-only view.
    #[getter]
    fn cosines<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        arrays_out::matrix(slf, |anchors| anchors.inner.cosines.as_ref())
    }

    fn __len__(&self) -> usize {
        self.inner.pairs.len()
    }

    fn __repr__(&self) -> String {
        let pair =
            |pair: &fmap::Anchor| format!("{}–{} {:.2}", pair.source, pair.target, pair.cosine);
        let pairs: Vec<String> = self.inner.pairs.iter().map(pair).collect();
        format!("Anchors({})", pairs.join(", "))
    }

    fn __reduce__<'py>(
        slf: &Bound<'py, Self>,
    ) -> PyResult<(Bound<'py, PyAny>, (Vec<(u32, u32, f64, f64)>, Bound<'py, PyAny>))> {
        let restore = slf.py().import("semfm._semfm")?.getattr("_restore_anchors")?;
        let pairs = &slf.get().inner.pairs;
        let pairs = pairs.iter().map(|p| (p.source, p.target, p.cosine, p.margin)).collect();
        Ok((restore, (pairs, Self::cosines(slf)?)))
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }
}

/// Anchors out of a pickle.
#[pyfunction]
pub fn _restore_anchors(
    pairs: Vec<(u32, u32, f64, f64)>,
    cosines: &Bound<'_, PyAny>,
) -> PyResult<Anchors> {
    let cosines =
        arrays_in::matrix(cosines, "cosines", [Axis::Any("source"), Axis::Any("target")])?;
    let pairs = pairs.into_iter();
    let pairs = pairs
        .map(|(source, target, cosine, margin)| fmap::Anchor { source, target, cosine, margin })
        .collect();
    Ok(Anchors { inner: Arc::new(fmap::Anchors { pairs, cosines }) })
}
