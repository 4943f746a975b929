//! A finished transfer with everything that its pictures and scenes show of it.

use super::meaning::meaning_colors;
use super::{SIDE, Sides, paired_viewpoints, position_colors};
use crate::{PreparedObject, Region, Result, Transfer};
use semfm_fmap::Anchor;
use semfm_fmap::clusters::spectral_clusters;
use semfm_geom::{Mesh, PointIndex, Task};

/// A transfer, ready to be shown. Pairs are source and target.
pub struct Exhibit<'a> {
    pub(crate) source: &'a PreparedObject,
    pub(crate) target: &'a PreparedObject,
    pub(crate) region: &'a Region,
    pub(crate) transfer: &'a Transfer,
    /// From where each object is looked at.
    pub(crate) sides: [Sides; 2],
    /// Colour of each vertex: the source's by position, the target's that of its match.
    pub(crate) places: [Vec<[f32; 3]>; 2],
    /// Colour of each cloud point: three principal components of the pair's features in one basis.
    pub(crate) meaning: [Vec<[f32; 3]>; 2],
    /// Cluster of each cloud point, and the rank of the anchor that it is.
    pub(crate) clusters: [Vec<ClusterOfPoint>; 2],
    /// Rank of the anchor at each vertex, −1 outside of all.
    pub(crate) anchors: [Vec<i64>; 2],
}

/// The cluster that a cloud point belongs to, and the rank of the anchor that it is.
pub(crate) type ClusterOfPoint = (u32, Option<usize>);

impl<'a> Exhibit<'a> {
    /// Chooses viewpoints and colours. The clusters are made anew: they are a picture's matter, and
    /// cost some ten milliseconds.
    ///
    /// # Errors
    /// Whatever clustering or rendering reports.
    pub fn new(
        source: &'a PreparedObject,
        target: &'a PreparedObject,
        region: &'a Region,
        transfer: &'a Transfer,
        task: &Task,
    ) -> Result<Self> {
        let source_of = &transfer.point_map.source_of;
        let (source_mesh, target_mesh) = (source.shape.original(), target.shape.original());
        let sides = paired_viewpoints(
            (source_mesh, region.weights()),
            (target_mesh, transfer.weights()),
            source_of,
            SIDE,
            task,
        )?;
        let on_source = position_colors(source_mesh.vertices());
        let on_target = source_of.iter().map(|&v| on_source[v as usize]).collect();
        let meaning = meaning_colors(&source.cloud, &target.cloud)?;
        let clusters = |object: &PreparedObject, side: fn(&Anchor) -> u32| {
            let settings = &transfer.report.settings.clusters;
            let clusters = spectral_clusters(&object.cloud, settings, task)?;
            let anchors = &transfer.report.anchors;
            let rank = |label: u32| anchors.iter().position(|a| side(&a.anchor) == label);
            Result::Ok(clusters.labels().iter().map(|&label| (label, rank(label))).collect())
        };
        let clusters: [Vec<ClusterOfPoint>; 2] =
            [clusters(source, |a| a.source)?, clusters(target, |a| a.target)?];
        let anchors = |object, clusters: &[ClusterOfPoint]| {
            let rank = |cluster: &ClusterOfPoint| cluster.1.map_or(-1, |rank| rank as i64);
            by_vertex(object, &clusters.iter().map(rank).collect::<Vec<i64>>())
        };
        let anchors = [anchors(source, &clusters[0])?, anchors(target, &clusters[1])?];
        let places = [on_source, on_target];
        Ok(Self { source, target, region, transfer, sides, places, meaning, clusters, anchors })
    }

    pub(crate) fn meshes(&self) -> [&'a Mesh; 2] {
        [self.source.shape.original(), self.target.shape.original()]
    }

    pub(crate) fn objects(&self) -> [&'a PreparedObject; 2] {
        [self.source, self.target]
    }

    /// Weight of each vertex.
    pub(crate) fn weights(&self) -> [&'a [f64]; 2] {
        [self.region.weights(), self.transfer.weights()]
    }

    /// The verdict in a line: "accept, confidence 0.93".
    pub(crate) fn answer(&self) -> String {
        let verdict = serde_json::json!(self.transfer.verdict);
        let verdict = verdict.as_str().unwrap_or_default();
        format!("{verdict}, confidence {:.2}", self.transfer.confidence)
    }
}

/// What belongs to the cloud point nearest to each vertex of the mesh as read.
pub(crate) fn by_vertex<T: Copy>(object: &PreparedObject, of_point: &[T]) -> Result<Vec<T>> {
    let index = PointIndex::new(object.cloud.points())?;
    let vertices = object.shape.original().vertices();
    Ok(vertices.iter().map(|&p| of_point[index.nearest(p).0]).collect())
}
