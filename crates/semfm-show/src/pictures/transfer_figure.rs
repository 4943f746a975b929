//! A finished transfer with everything that its pictures and scenes show of it.

use super::features::feature_colors;
use super::{SIDE, Sides, paired_viewpoints, position_colors};
use crate::Result;
use semfm::output::{AnchorRanks, ObjectAnchors, anchor_ranks};
use semfm::{Mesh, PreparedObject, Region, Task, Transfer};

/// A transfer, ready to be shown. Pairs are source and target.
pub struct TransferFigure<'a> {
    pub(crate) source: &'a PreparedObject,
    pub(crate) target: &'a PreparedObject,
    pub(crate) region: &'a Region,
    pub(crate) transfer: &'a Transfer,
    /// From where each object is looked at.
    pub(crate) sides: [Sides; 2],
    /// Colour of each vertex: the source's by position, the target's that of its match.
    pub(crate) places: [Vec<[f32; 3]>; 2],
    /// Colour of each cloud point: three principal components of the pair's features in one basis.
    pub(crate) feature_colors: [Vec<[f32; 3]>; 2],
    /// Where the anchors lie.
    pub(crate) anchors: [ObjectAnchors; 2],
}

impl<'a> TransferFigure<'a> {
    /// Chooses viewpoints and colours. The clusters are those that the objects keep.
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
        let feature_colors = feature_colors(&source.object, &target.object)?;
        let AnchorRanks { source: on_source_anchors, target: on_target_anchors } =
            anchor_ranks(source, target, transfer, task)?;
        let anchors = [on_source_anchors, on_target_anchors];
        let places = [on_source, on_target];
        Ok(Self { source, target, region, transfer, sides, places, feature_colors, anchors })
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
pub(crate) fn by_vertex<T: Copy>(object: &PreparedObject, of_point: &[T]) -> Vec<T> {
    object.object.point_of_original_vertex().iter().map(|&j| of_point[j as usize]).collect()
}
