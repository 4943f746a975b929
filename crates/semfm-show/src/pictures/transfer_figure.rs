//! A finished transfer with everything that its pictures and scenes show of it.

use std::path::Path;

use semfm::files::{ObjectAnchors, TransferResult};
use semfm::{Mesh, PreparedObject, Task, Transfer};

use super::feature_colors::FeatureColors;
use super::row_pictures::{RowColors, row_pictures};
use super::sheet::PICTURE_SIDE;
use super::{PairedViewpoints, Seen, Viewpoints, WeightedMesh, paired_viewpoints};
use crate::Result;
use crate::colors::position_colors;

/// A transfer, ready to be drawn.
pub struct TransferFigure<'a> {
    pub(crate) transfer: &'a Transfer,
    pub(crate) source: ObjectFigure<'a>,
    pub(crate) target: ObjectFigure<'a>,
}

/// One object of a transfer, ready to be drawn.
pub(crate) struct ObjectFigure<'a> {
    pub object: &'a PreparedObject,
    /// Weight of each vertex.
    pub weights: &'a [f64],
    /// From where the object is looked at.
    pub viewpoints: Viewpoints,
    /// Colour of each vertex: the source's by position, the target's that of its match.
    pub match_colors: Vec<[f32; 3]>,
    /// Colour of each cloud point by its features.
    pub feature_colors: Vec<[f32; 3]>,
    /// Where the anchors lie.
    pub anchors: ObjectAnchors,
}

impl<'a> TransferFigure<'a> {
    /// Chooses viewpoints and colours. The clusters are those that the objects keep.
    ///
    /// # Errors
    /// [`Error::Semfm`](crate::Error::Semfm) where clustering or rendering fails, and where the task was
    /// cancelled.
    pub fn new(result: &TransferResult<'a>, task: &Task) -> Result<Self> {
        let TransferResult { source, target, region, transfer, .. } = *result;
        let source_of = &transfer.point_map.source_of;
        let (source_mesh, target_mesh) = (result.source_mesh(), result.target_mesh());
        let (source_shape, target_shape) = (source.object.shape(), target.object.shape());
        let on_working = [
            source_shape.onto_working(region.weights()),
            target_shape.onto_working(transfer.weights()),
        ];
        let viewpoints: PairedViewpoints = paired_viewpoints(
            Seen {
                object: WeightedMesh { mesh: source_mesh, weights: region.weights() },
                counted: WeightedMesh { mesh: source_shape.mesh(), weights: &on_working[0] },
            },
            Seen {
                object: WeightedMesh { mesh: target_mesh, weights: transfer.weights() },
                counted: WeightedMesh { mesh: target_shape.mesh(), weights: &on_working[1] },
            },
            source_of,
            PICTURE_SIDE,
            task,
        )?;
        let on_source = position_colors(source_mesh.vertices());
        let on_target = source_of.iter().map(|&v| on_source[v as usize]).collect();
        let features = FeatureColors::new(&source.object, &target.object)?;
        let anchors = result.anchor_ranks(task)?;
        Ok(Self {
            transfer,
            source: ObjectFigure {
                object: &source.object,
                weights: region.weights(),
                viewpoints: viewpoints.source,
                match_colors: on_source,
                feature_colors: features.source,
                anchors: anchors.source,
            },
            target: ObjectFigure {
                object: &target.object,
                weights: transfer.weights(),
                viewpoints: viewpoints.target,
                match_colors: on_target,
                feature_colors: features.target,
                anchors: anchors.target,
            },
        })
    }

    /// Writes `transfer.png` and `features.png` to these paths.
    ///
    /// # Errors
    /// [`Error::Semfm`](crate::Error::Semfm) where rendering or writing fails, and where the task was
    /// cancelled.
    pub fn write_pictures(&self, transfer: &Path, features: &Path, task: &Task) -> Result<()> {
        let rows = |figure| {
            let colors = [RowColors::of_transfer(figure), RowColors::of_features(figure)];
            row_pictures(figure, &colors, task)
        };
        let (source, target) = rayon::join(|| rows(&self.source), || rows(&self.target));
        let (source, target) = (source?, target?);
        let (transfer, features) = rayon::join(
            || self.write_transfer_sheet(transfer, &source[0], &target[0]),
            || self.write_features_sheet(features, &source[1], &target[1]),
        );
        transfer.and(features)
    }

    /// The verdict in a line: "accept, confidence 0.93".
    pub(crate) fn verdict_line(&self) -> String {
        format!("{}, confidence {:.2}", self.transfer.verdict, self.transfer.confidence)
    }
}

impl<'a> ObjectFigure<'a> {
    pub(crate) fn mesh(&self) -> &'a Mesh {
        self.object.shape().original()
    }

    /// What belongs to the cloud point nearest to each vertex of the mesh as read.
    pub(crate) fn onto_vertices<T: Copy>(&self, of_point: &[T]) -> Vec<T> {
        let points = self.object.point_of_original_vertex();
        points.iter().map(|&point| of_point[point as usize]).collect()
    }
}
