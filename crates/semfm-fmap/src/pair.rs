//! Who is who: the source, the target, and what is prepared once for each.

use std::borrow::Cow;

use faer::{Mat, MatRef};
use rayon::prelude::*;
use semfm_geom::sampling::farthest_points;
use semfm_geom::{PointIndex, SemanticCloud, Shape, Task};

use crate::clusters::{ClusterSettings, Clusters, spectral_clusters};
use crate::features::CentredFeatures;
use crate::neighbour_graph::NeighbourGraph;
use crate::{Error, Result};

/// Samples mixed into the features of a vertex.
const MIXED: usize = 6;
/// Added to the relative distance (d/√area) before it is inverted and squared: the reach below
/// which a nearer sample counts no more.
const MIX_REACH: f64 = 0.01;
/// Vertices matched while a sampled map grows. 300 cost .01 IoU, 1200 gain nothing.
const MAP_SAMPLES: usize = 600;
/// Neighbours of a cloud point in the graph that votes are spread on.
const GRAPH_NEIGHBOURS: usize = 10;
/// Least share of the mean mass that a sample gets when no vertex is nearest to it.
const LEAST_MASS: f64 = 1e-3;

/// A shape and the semantic cloud on its surface (in the frame and units of its mesh as read).
#[derive(Clone, Copy, Debug)]
pub struct SemanticShape<'a> {
    /// Mesh, working mesh and eigenbasis.
    pub shape: &'a Shape,
    /// Surface points with features.
    pub cloud: &'a SemanticCloud,
}

/// The demonstrated object and the one that is looked at.
#[derive(Clone, Copy, Debug)]
pub struct ShapePair<'a> {
    /// Carries the region.
    pub source: SemanticShape<'a>,
    /// Receives it.
    pub target: SemanticShape<'a>,
}

/// One object made ready to be matched with any other: everything that does not depend on the
/// partner. n is the number of working vertices, M that of the cloud's points.
#[derive(Clone, Debug)]
pub struct PreparedShape<'a> {
    semantic: SemanticShape<'a>,
    /// π: the cloud point nearest to each vertex (n).
    point_of_vertex: Vec<u32>,
    /// The vertex nearest to each cloud point (M).
    vertex_of_point: Vec<u32>,
    mix: VertexMix,
    masses: Vec<f64>,
    samples: Vec<u32>,
    features: CentredFeatures,
    graph: NeighbourGraph,
    clusters: Cow<'a, Clusters>,
}

impl<'a> PreparedShape<'a> {
    /// Prepares an object: neighbours between vertices and cloud, farthest-point vertices, masses,
    /// normalised features and semantic clusters.
    ///
    /// # Errors
    /// Whatever clustering reports; cancellation.
    pub fn new(
        semantic: SemanticShape<'a>,
        settings: &ClusterSettings,
        task: &Task,
    ) -> Result<Self> {
        let clusters = spectral_clusters(semantic.cloud, settings, task)?;
        Self::with_clusters(semantic, Cow::Owned(clusters), task)
    }

    /// The same with clusters from elsewhere (true part labels, another method's).
    ///
    /// # Errors
    /// [`Error::Length`] where there is not one label per cloud point; cancellation.
    pub fn with_clusters(
        semantic: SemanticShape<'a>,
        clusters: Cow<'a, Clusters>,
        task: &Task,
    ) -> Result<Self> {
        task.check()?;
        let SemanticShape { shape, cloud } = semantic;
        Error::length("cluster labels", cloud.n_points(), clusters.labels().len())?;
        let vertices = shape.mesh().vertices();
        let of_cloud = PointIndex::new(cloud.points())?;
        let of_mesh = PointIndex::new(vertices)?;
        let mix = VertexMix::new(shape, &of_cloud);
        let point_of_vertex: Vec<u32> = mix.points.iter().step_by(mix.count).copied().collect();
        let vertex_of_point = cloud.points().iter().map(|&p| of_mesh.nearest(p).0 as u32).collect();
        let mut masses = vec![0.0; cloud.n_points()];
        for (&j, area) in point_of_vertex.iter().zip(&shape.basis().mass) {
            masses[j as usize] += area;
        }
        let least = LEAST_MASS * masses.iter().sum::<f64>() / masses.len() as f64;
        masses.iter_mut().for_each(|m| *m = m.max(least));
        let total: f64 = masses.iter().sum();
        masses.iter_mut().for_each(|m| *m /= total);
        let samples = farthest_points(vertices, MAP_SAMPLES);
        let features = CentredFeatures::new(cloud)?;
        let square = |i, j| features.squared_distance(i, j);
        let graph = NeighbourGraph::new(cloud.points(), GRAPH_NEIGHBOURS, square)?;
        Ok(Self {
            semantic,
            point_of_vertex,
            vertex_of_point,
            mix,
            masses,
            samples,
            features,
            graph,
            clusters,
        })
    }

    /// The shape.
    pub fn shape(&self) -> &'a Shape {
        self.semantic.shape
    }

    /// The cloud.
    pub fn cloud(&self) -> &'a SemanticCloud {
        self.semantic.cloud
    }

    /// The semantic clusters of the cloud's points.
    pub fn clusters(&self) -> &Clusters {
        &self.clusters
    }

    /// Cluster label of each working vertex (n): that of its nearest cloud point.
    pub fn vertex_labels(&self) -> Vec<u32> {
        self.point_of_vertex.iter().map(|&j| self.clusters.labels()[j as usize]).collect()
    }

    /// The cloud point nearest to each working vertex (n), the paper's π.
    pub fn point_of_vertex(&self) -> &[u32] {
        &self.point_of_vertex
    }

    /// The working vertex nearest to each cloud point (M).
    pub fn vertex_of_point(&self) -> &[u32] {
        &self.vertex_of_point
    }

    /// Farthest-point vertices (at most 600) that a growing map is matched on.
    pub fn samples(&self) -> &[u32] {
        &self.samples
    }

    /// Share of the area that is nearest to each cloud point (M), summing to 1.
    pub fn masses(&self) -> &[f64] {
        &self.masses
    }

    pub(crate) fn features(&self) -> &CentredFeatures {
        &self.features
    }

    /// The cloud as a graph whose edges know how much the features of their ends differ.
    pub(crate) fn graph(&self) -> &NeighbourGraph {
        &self.graph
    }

    /// Values on the cloud's points (M), mixed onto the working vertices (n).
    pub fn onto_vertices(&self, on_points: &[f64]) -> Vec<f64> {
        let values = MatRef::from_column_major_slice(on_points, on_points.len(), 1);
        self.rows_onto_vertices(values).col_as_slice(0).to_vec()
    }

    /// Rows on the cloud's points (M × c), mixed onto the working vertices (n × c).
    pub(crate) fn rows_onto_vertices(&self, on_points: MatRef<'_, f64>) -> Mat<f64> {
        let mut out = Mat::zeros(self.point_of_vertex.len(), on_points.ncols());
        for c in 0..on_points.ncols() {
            let column = on_points.col(c);
            let mixed =
                self.mix.points.chunks(self.mix.count).zip(self.mix.weights.chunks(self.mix.count));
            for (x, (points, weights)) in out.col_mut(c).iter_mut().zip(mixed) {
                *x = points.iter().zip(weights).map(|(&j, w)| w * column[j as usize]).sum();
            }
        }
        out
    }

    /// Whether each working vertex (n) is in a region of the original mesh. A region so small that
    /// simplification left none of its vertices keeps the working vertices nearest to it.
    pub(crate) fn region_on_working(&self, inside: &[bool]) -> Vec<bool> {
        let working = self.shape().working();
        let mut on_working: Vec<bool> =
            working.to_original.iter().map(|&v| inside[v as usize]).collect();
        if !on_working.contains(&true) {
            for (&w, _) in working.of_original.iter().zip(inside).filter(|(_, inside)| **inside) {
                on_working[w as usize] = true;
            }
        }
        on_working
    }
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
    fn new(shape: &Shape, of_cloud: &PointIndex) -> Self {
        let unit = shape.unit();
        let rows: Vec<Vec<(usize, f64)>> =
            shape.mesh().vertices().par_iter().map(|&p| of_cloud.k_nearest(p, MIXED)).collect();
        let count = rows[0].len(); // a mesh has a vertex and a cloud a point
        let mut mix = Self { count, points: Vec::new(), weights: Vec::new() };
        for row in rows {
            let weight = |d: f64| (d / unit + MIX_REACH).powi(-2);
            let total: f64 = row.iter().map(|hit| weight(hit.1)).sum();
            mix.points.extend(row.iter().map(|hit| hit.0 as u32));
            mix.weights.extend(row.iter().map(|hit| weight(hit.1) / total));
        }
        mix
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use semfm_geom::math::DVec3;
    use semfm_geom::{Mesh, ShapeSettings};

    /// A lumpy, elongated closed surface (258 vertices) without any symmetry: an octahedron cut three
    /// times, put on a sphere and pulled about. `stretch` lengthens it along x.
    pub(crate) fn blob(stretch: f64) -> Mesh {
        let mut vertices = vec![DVec3::X, -DVec3::X, DVec3::Y, -DVec3::Y, DVec3::Z, -DVec3::Z];
        let mut faces: Vec<[u32; 3]> = vec![
            [0, 2, 4],
            [2, 1, 4],
            [1, 3, 4],
            [3, 0, 4],
            [2, 0, 5],
            [1, 2, 5],
            [3, 1, 5],
            [0, 3, 5],
        ];
        for _ in 0..3 {
            let mut middles = std::collections::BTreeMap::new();
            let mut middle = |a: u32, b: u32| {
                *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    vertices.push((vertices[a as usize] + vertices[b as usize]).normalize());
                    vertices.len() as u32 - 1
                })
            };
            let cut = faces.iter().flat_map(|&[a, b, c]| {
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            });
            faces = cut.collect();
        }
        for p in &mut vertices {
            let swell = 1.0
                + 0.25 * (2.0 * p.x + 1.0).sin()
                + 0.2 * (3.0 * p.y - p.z).cos()
                + 0.15 * p.z * p.x;
            *p = DVec3::new(p.x * 1.8 * stretch, p.y, p.z * 0.8) * swell;
        }
        Mesh::new(vertices, faces).unwrap()
    }

    pub(crate) fn shape(mesh: &Mesh, k: usize) -> Shape {
        Shape::new(mesh.clone(), &ShapeSettings { k, ..ShapeSettings::default() }, &Task::default())
            .unwrap()
    }

    /// A cloud of every third vertex. Its features say where along x the point is (three soft
    /// parts) plus an offset that the whole object shares and a little noise.
    pub(crate) fn cloud(mesh: &Mesh, stretch: f64, offset: f32) -> SemanticCloud {
        let points: Vec<DVec3> = mesh.vertices().iter().step_by(3).copied().collect();
        let part = |x: f64, centre: f64| (-((x / stretch - centre) / 0.8).powi(2)).exp() as f32;
        let features = points.iter().enumerate().flat_map(|(i, p)| {
            let noise = |c: usize| 0.03 * ((i * 31 + c * 17) as f32).sin();
            [
                part(p.x, -1.5) + noise(0),
                part(p.x, 0.0) + noise(1),
                part(p.x, 1.5) + noise(2),
                offset,
                noise(3),
            ]
        });
        let n = points.len();
        SemanticCloud::new(points.clone(), features.collect(), 5, vec![1; n]).unwrap()
    }

    #[test]
    fn masses_are_shares_and_mixing_reproduces_constants() {
        let mesh = blob(1.0);
        let (shape, cloud) = (shape(&mesh, 10), cloud(&mesh, 1.0, 0.5));
        let semantic = SemanticShape { shape: &shape, cloud: &cloud };
        let prepared =
            PreparedShape::new(semantic, &ClusterSettings::default(), &Task::default()).unwrap();
        assert!((prepared.masses().iter().sum::<f64>() - 1.0).abs() < 1e-12);
        let ones = prepared.onto_vertices(&vec![1.0; cloud.n_points()]);
        assert!(ones.iter().all(|x| (x - 1.0).abs() < 1e-12));
        // Cloud points are vertices, so each is its vertex's nearest and the other way round.
        for (j, &v) in prepared.vertex_of_point().iter().enumerate() {
            assert_eq!(prepared.point_of_vertex()[v as usize], j as u32);
        }
    }
}
