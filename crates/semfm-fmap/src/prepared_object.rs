//! One object made ready to be matched: everything that does not depend on the partner.

use std::fmt;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use faer::{Mat, MatRef};
use rayon::prelude::*;
use semfm_geom::descriptors::{WksSettings, wks};
use semfm_geom::math::DVec3;
use semfm_geom::sampling::farthest_points;
use semfm_geom::{
    ConfidenceWeights, HeatStep, PointIndex, SemanticCloud, Shape, SurfaceIndex, SurfaceMoments,
    Task,
};

use crate::clusters::{ClusterSettings, Clusters, spectral_clusters};
use crate::features::CentredFeatures;
use crate::likeness::PlainFeatures;
use crate::neighbour_graph::NeighbourGraph;
use crate::{Error, Result};

/// Samples mixed into the features of a vertex.
const MIXED: usize = 6;
/// Added to the relative distance (d/√area) before it is inverted and squared: the reach below
/// which a nearer sample counts no more.
const MIX_REACH: f64 = 0.01;
/// Vertices matched while a sampled map grows. 300 cost .01 IoU, 1200 gain nothing.
const MAP_SAMPLES: usize = 600;
/// Points whose signatures stand in for features where there are none.
const SIGNATURE_POINTS: usize = 1200;
/// Neighbours of a cloud point in the graph that votes are spread on.
const GRAPH_NEIGHBOURS: usize = 10;
/// Least share of the mean mass that a sample gets when no vertex is nearest to it.
const LEAST_MASS: f64 = 1e-3;

/// An object ready to be matched with any other: its shape, the semantic cloud on its surface (in
/// the frame and units of its mesh as read), and what follows from the two, each made once.
///
/// n is the number of working vertices, M that of the cloud's points. A clone shares everything with
/// its original and costs nothing. The semantic clusters, the samples, the neighbour graph and the factor that
/// smooths votes are made when something first reads them.
///
/// ```
/// use std::sync::Arc;
/// use semfm_fmap::PreparedObject;
/// use semfm_geom::{SemanticCloud, Shape, ShapeSettings, Task, zoo};
///
/// let mesh = zoo::icosphere(3);
/// let points = mesh.vertices().to_vec();
/// let features = points.iter().flat_map(|p| [p.x as f32, p.y as f32]).collect();
/// let n = points.len();
/// let cloud = Arc::new(SemanticCloud::new(points, features, 2, vec![1; n])?);
/// let task = Task::default();
/// let shape = Arc::new(Shape::new(mesh, &ShapeSettings::default(), &task)?);
/// let object = PreparedObject::new(shape, cloud, &task)?;
/// assert!((object.masses().iter().sum::<f64>() - 1.0).abs() < 1e-12);
/// # Ok::<(), semfm_fmap::Error>(())
/// ```
#[derive(Clone)]
pub struct PreparedObject {
    derived: Arc<Derived>,
    clusters: ClusterSource,
    confidence_weights: ConfidenceWeights,
}

/// What follows from shape and cloud alone.
struct Derived {
    shape: Arc<Shape>,
    cloud: Arc<SemanticCloud>,
    has_features: bool,
    cloud_index: PointIndex,
    /// π: the cloud point nearest to each working vertex (n).
    point_of_vertex: Vec<u32>,
    /// The working vertex nearest to each cloud point (M).
    vertex_of_point: Vec<u32>,
    mix: VertexMix,
    masses: Vec<f64>,
    features: CentredFeatures,
    plain: OnceLock<PlainFeatures>,
    samples: OnceLock<Vec<u32>>,
    graph: OnceLock<NeighbourGraph>,
    heat_step: OnceLock<KeptHeatStep>,
    moments: OnceLock<SurfaceMoments>,
    surface: OnceLock<SurfaceIndex>,
    point_of_original_vertex: OnceLock<Vec<u32>>,
}

/// A step of heat diffusion and its time.
struct KeptHeatStep {
    time: f64,
    step: HeatStep,
}

/// Clusters and the settings that they were cut by.
type KeptClusters = (ClusterSettings, Arc<Clusters>);

/// Where an object's clusters come from.
#[derive(Clone, Debug)]
enum ClusterSource {
    /// Cut from the cloud's features; one entry for each of the settings that were asked for.
    Spectral(Arc<Mutex<Vec<KeptClusters>>>),
    /// Labels that the caller gave.
    Given(Arc<Clusters>),
}

impl PreparedObject {
    /// Prepares an object: neighbours between vertices and cloud, masses, normalised features.
    ///
    /// # Errors
    /// [`Error::LinearAlgebra`] where the principal directions of the features are not found,
    /// [`Error::Geom`] on cancellation.
    pub fn new(shape: Arc<Shape>, cloud: Arc<SemanticCloud>, task: &Task) -> Result<Self> {
        Self::derive(shape, cloud, true, task)
    }

    /// Prepares an object from its shape alone, for methods that read no features (`wks`). Its cloud
    /// holds wave kernel signatures at farthest-point vertices.
    ///
    /// # Errors
    /// As [`PreparedObject::new`]; [`Error::Geom`] for a basis without an eigenvalue above zero.
    pub fn without_features(shape: Arc<Shape>, task: &Task) -> Result<Self> {
        let settings = WksSettings::default();
        let signatures = wks(shape.basis(), &settings)?; // (n × energies)
        let vertices = shape.mesh().vertices();
        let chosen = farthest_points(vertices, SIGNATURE_POINTS);
        let points = chosen.iter().map(|&v| vertices[v as usize]).collect();
        let rows = chosen.iter().flat_map(|&v| signatures.row(v as usize).iter());
        let (values, n_views) = (rows.map(|&x| x as f32).collect(), vec![0; chosen.len()]);
        let cloud = SemanticCloud::new(points, values, signatures.ncols(), n_views)?;
        Self::derive(shape, Arc::new(cloud), false, task)
    }

    fn derive(
        shape: Arc<Shape>,
        cloud: Arc<SemanticCloud>,
        has_features: bool,
        task: &Task,
    ) -> Result<Self> {
        task.check()?;
        let cloud_index = PointIndex::new(cloud.points())?;
        let mesh_index = PointIndex::new(shape.mesh().vertices())?;
        let mix = VertexMix::new(&shape, &cloud_index);
        let point_of_vertex: Vec<u32> = mix.points.iter().step_by(mix.count).copied().collect();
        let vertex_of_point =
            cloud.points().iter().map(|&p| mesh_index.nearest(p).0 as u32).collect();
        let masses = masses(&point_of_vertex, &shape.basis().mass, cloud.n_points());
        let features = CentredFeatures::new(&cloud)?;
        let derived = Derived {
            shape,
            cloud,
            has_features,
            cloud_index,
            point_of_vertex,
            vertex_of_point,
            mix,
            masses,
            features,
            plain: OnceLock::new(),
            samples: OnceLock::new(),
            graph: OnceLock::new(),
            heat_step: OnceLock::new(),
            moments: OnceLock::new(),
            surface: OnceLock::new(),
            point_of_original_vertex: OnceLock::new(),
        };
        Ok(Self {
            derived: Arc::new(derived),
            clusters: ClusterSource::Spectral(Arc::default()),
            confidence_weights: ConfidenceWeights::default(),
        })
    }

    /// The same object with clusters from elsewhere (true part labels, another method's): they are
    /// what [`clusters`](Self::clusters) gives, whatever the settings.
    ///
    /// # Errors
    /// [`Error::Length`] where there is not one label per cloud point.
    pub fn with_clusters(&self, clusters: Arc<Clusters>) -> Result<Self> {
        Error::length("cluster labels", self.cloud().n_points(), clusters.labels().len())?;
        Ok(Self { clusters: ClusterSource::Given(clusters), ..self.clone() })
    }

    /// The same object whose features have their own weights for confidence.
    pub fn with_confidence_weights(self, confidence_weights: ConfidenceWeights) -> Self {
        Self { confidence_weights, ..self }
    }

    /// How the evidence in an answer found by this object's features becomes a probability.
    pub fn confidence_weights(&self) -> &ConfidenceWeights {
        &self.confidence_weights
    }

    /// Mesh, working mesh and eigenbasis.
    pub fn shape(&self) -> &Arc<Shape> {
        &self.derived.shape
    }

    /// Surface points with features.
    pub fn cloud(&self) -> &Arc<SemanticCloud> {
        &self.derived.cloud
    }

    /// Whether the cloud's features come from outside, and not from the shape itself.
    pub fn has_features(&self) -> bool {
        self.derived.has_features
    }

    /// The semantic clusters of the cloud's points: cut when first asked for, then kept for these
    /// settings.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for no clusters or no neighbours, [`Error::Geom`] where the eigensolver
    /// fails or on cancellation.
    pub fn clusters(&self, settings: &ClusterSettings, task: &Task) -> Result<Arc<Clusters>> {
        let kept = match &self.clusters {
            ClusterSource::Given(clusters) => return Ok(Arc::clone(clusters)),
            ClusterSource::Spectral(kept) => kept,
        };
        if let Some(clusters) = kept_for(kept, settings) {
            return Ok(clusters);
        }
        // Not under the lock: the work may be spread over threads that ask for the same.
        let clusters = Arc::new(spectral_clusters(self.cloud(), settings, task)?);
        let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
        kept.push((*settings, Arc::clone(&clusters)));
        Ok(clusters)
    }

    /// Cluster label of each working vertex (n): that of its nearest cloud point.
    pub fn vertex_labels(&self, clusters: &Clusters) -> Vec<u32> {
        self.point_of_vertex().iter().map(|&j| clusters.labels()[j as usize]).collect()
    }

    /// The cloud point nearest to each working vertex (n), the paper's π.
    pub fn point_of_vertex(&self) -> &[u32] {
        &self.derived.point_of_vertex
    }

    /// The working vertex nearest to each cloud point (M).
    pub fn vertex_of_point(&self) -> &[u32] {
        &self.derived.vertex_of_point
    }

    /// The cloud point nearest to each vertex of the mesh as read.
    pub fn point_of_original_vertex(&self) -> &[u32] {
        self.derived.point_of_original_vertex.get_or_init(|| {
            let vertices = self.shape().original().vertices();
            vertices.iter().map(|&p| self.derived.cloud_index.nearest(p).0 as u32).collect()
        })
    }

    /// Farthest-point vertices (at most 600) that a growing map is matched on.
    pub fn samples(&self) -> &[u32] {
        let vertices = self.shape().mesh().vertices();
        self.derived.samples.get_or_init(|| farthest_points(vertices, MAP_SAMPLES))
    }

    /// Share of the area that is nearest to each cloud point (M), summing to 1.
    pub fn masses(&self) -> &[f64] {
        &self.derived.masses
    }

    /// The features of evenly spread points of the cloud as they are, of unit length.
    pub fn plain_features(&self) -> &PlainFeatures {
        self.derived.plain.get_or_init(|| PlainFeatures::new(&self.derived.cloud))
    }

    /// The features of the cloud's points, normalised and centred.
    pub fn features(&self) -> &CentredFeatures {
        &self.derived.features
    }

    /// The cloud as a graph with how much the features of the ends of each edge differ.
    pub(crate) fn graph(&self) -> Result<&NeighbourGraph> {
        if let Some(graph) = self.derived.graph.get() {
            return Ok(graph);
        }
        let features = self.features();
        let graph = NeighbourGraph::new(self.cloud().points(), GRAPH_NEIGHBOURS, |i, j| {
            features.squared_distance(i, j)
        })?;
        Ok(self.derived.graph.get_or_init(|| graph))
    }

    /// Where the surface lies and how far it reaches.
    pub(crate) fn moments(&self) -> Result<&SurfaceMoments> {
        if let Some(moments) = self.derived.moments.get() {
            return Ok(moments);
        }
        let moments = SurfaceMoments::of(self.shape().mesh())?;
        Ok(self.derived.moments.get_or_init(|| moments))
    }

    /// The surface, to look up its nearest point; triangles are those of the mesh as read.
    pub(crate) fn surface(&self) -> Result<&SurfaceIndex> {
        if let Some(surface) = self.derived.surface.get() {
            return Ok(surface);
        }
        let surface = SurfaceIndex::new(self.shape().surface())?;
        Ok(self.derived.surface.get_or_init(|| surface))
    }

    /// The cloud point nearest to a position.
    pub(crate) fn nearest_point(&self, position: DVec3) -> usize {
        self.derived.cloud_index.nearest(position).0
    }

    /// [`Shape::smooth`] for values on the working vertices (n); the factor of the first time asked for is kept.
    pub(crate) fn smooth(&self, values: &[f64], time: f64) -> Result<Vec<f64>> {
        let kept = match self.derived.heat_step.get() {
            Some(kept) => kept,
            None => {
                let step = self.shape().heat_step(time)?;
                self.derived.heat_step.get_or_init(|| KeptHeatStep { time, step })
            }
        };
        if kept.time == time {
            return Ok(kept.step.smooth(values)?);
        }
        Ok(self.shape().smooth(values, time)?)
    }

    /// Values on the cloud's points (M), mixed onto the working vertices (n).
    pub fn onto_vertices(&self, on_points: &[f64]) -> Vec<f64> {
        let values = MatRef::from_column_major_slice(on_points, on_points.len(), 1);
        self.rows_onto_vertices(values).col_as_slice(0).to_vec()
    }

    /// Rows on the cloud's points (M × c), mixed onto the working vertices (n × c).
    pub(crate) fn rows_onto_vertices(&self, on_points: MatRef<'_, f64>) -> Mat<f64> {
        let mix = &self.derived.mix;
        let mut out = Mat::zeros(self.point_of_vertex().len(), on_points.ncols());
        for (c, column) in on_points.col_iter().enumerate() {
            let column: Vec<f64> = column.iter().copied().collect();
            let mixed = mix.points.chunks_exact(mix.count).zip(mix.weights.chunks_exact(mix.count));
            for (x, (points, weights)) in out.col_as_slice_mut(c).iter_mut().zip(mixed) {
                *x = points.iter().zip(weights).map(|(&j, w)| w * column[j as usize]).sum();
            }
        }
        out
    }

    /// Whether each working vertex (n) is in a region of the original mesh: of doubled vertices at one place (a UV seam)
    /// any will do. A region so small that simplification left none of its vertices keeps the working vertices nearest
    /// to it.
    pub(crate) fn region_on_working(&self, inside: &[bool]) -> Vec<bool> {
        let (working, vertices) = (self.shape().working(), self.shape().original().vertices());
        let mut on_working: Vec<bool> =
            working.to_original.iter().map(|&v| inside[v as usize]).collect();
        for (v, &w) in working.of_original.iter().enumerate().filter(|&(v, _)| inside[v]) {
            let kept = working.to_original[w as usize] as usize;
            on_working[w as usize] |= vertices[v] == vertices[kept];
        }
        if !on_working.contains(&true) {
            for (&w, _) in working.of_original.iter().zip(inside).filter(|(_, inside)| **inside) {
                on_working[w as usize] = true;
            }
        }
        on_working
    }
}

impl fmt::Debug for PreparedObject {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("PreparedObject")
            .field("n_vertices", &self.shape().mesh().n_vertices())
            .field("n_points", &self.cloud().n_points())
            .field("dim", &self.cloud().dim())
            .finish_non_exhaustive()
    }
}

fn kept_for(
    kept: &Mutex<Vec<(ClusterSettings, Arc<Clusters>)>>,
    settings: &ClusterSettings,
) -> Option<Arc<Clusters>> {
    let kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
    kept.iter().find(|(of, _)| of == settings).map(|(_, clusters)| Arc::clone(clusters))
}

/// Share of the vertices' areas (n) that is nearest to each of M cloud points, summing to 1.
fn masses(point_of_vertex: &[u32], areas: &[f64], n_points: usize) -> Vec<f64> {
    let mut masses = vec![0.0; n_points];
    for (&j, area) in point_of_vertex.iter().zip(areas) {
        masses[j as usize] += area;
    }
    let least = LEAST_MASS * masses.iter().sum::<f64>() / masses.len() as f64;
    masses.iter_mut().for_each(|m| *m = m.max(least));
    let total: f64 = masses.iter().sum();
    masses.iter_mut().for_each(|m| *m /= total);
    masses
}

/// The nearest cloud points of each vertex and their weights, (d/√area + reach)⁻² scaled to sum 1.
#[derive(Clone, Debug)]
struct VertexMix {
    /// Points per vertex.
    count: usize,
    /// Point ids (n × count, row-major), nearest first.
    points: Vec<u32>,
    weights: Vec<f64>,
}

impl VertexMix {
    fn new(shape: &Shape, cloud_index: &PointIndex) -> Self {
        let unit = shape.unit();
        let rows: Vec<Vec<(usize, f64)>> =
            shape.mesh().vertices().par_iter().map(|&p| cloud_index.k_nearest(p, MIXED)).collect();
        let count = rows[0].len(); // a mesh has a vertex and a cloud a point
        let mut mix = Self { count, points: Vec::new(), weights: Vec::new() };
        for row in rows {
            let weights: Vec<f64> =
                row.iter().map(|hit| (hit.1 / unit + MIX_REACH).powi(-2)).collect();
            let total: f64 = weights.iter().sum();
            mix.points.extend(row.iter().map(|hit| hit.0 as u32));
            mix.weights.extend(weights.iter().map(|weight| weight / total));
        }
        mix
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_objects::{blob, cloud, shape};

    fn object() -> PreparedObject {
        let mesh = blob(1.0);
        let (shape, cloud) = (shape(&mesh, 10), cloud(&mesh, 1.0, 0.5));
        PreparedObject::new(Arc::new(shape), Arc::new(cloud), &Task::default()).unwrap()
    }

    #[test]
    fn masses_are_shares_and_mixing_reproduces_constants() {
        let object = object();
        assert!((object.masses().iter().sum::<f64>() - 1.0).abs() < 1e-12);
        let ones = object.onto_vertices(&vec![1.0; object.cloud().n_points()]);
        assert!(ones.iter().all(|x| (x - 1.0).abs() < 1e-12));
        // Cloud points are vertices, so each is its vertex's nearest and the other way round.
        for (j, &v) in object.vertex_of_point().iter().enumerate() {
            assert_eq!(object.point_of_vertex()[v as usize], j as u32);
        }
    }

    #[test]
    fn clusters_are_cut_once_for_each_setting_and_labels_from_elsewhere_win() {
        let (object, task) = (object(), Task::default());
        let settings = ClusterSettings::default();
        let first = object.clusters(&settings, &task).unwrap();
        assert_eq!(*first, spectral_clusters(object.cloud(), &settings, &task).unwrap());
        let again = object.clone().clusters(&settings, &task).unwrap();
        assert!(Arc::ptr_eq(&first, &again), "a clone shares what was made");
        let other = ClusterSettings { n_clusters: 2, ..settings };
        assert_eq!(object.clusters(&other, &task).unwrap().n_clusters(), 2);
        assert!(Arc::ptr_eq(&first, &object.clusters(&settings, &task).unwrap()));
        let given = Arc::new(Clusters::from_labels(&vec![7; object.cloud().n_points()]));
        let labelled = object.with_clusters(Arc::clone(&given)).unwrap();
        assert!(Arc::ptr_eq(&given, &labelled.clusters(&settings, &task).unwrap()));
        let short = Arc::new(Clusters::from_labels(&[0, 1]));
        assert!(matches!(object.with_clusters(short), Err(Error::Length { found: 2, .. })));
    }
}
