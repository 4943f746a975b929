//! A pose to start from, for a given rotation.

use semfm_geom::math::{DQuat, DVec3};

use crate::extent::{Extent, ViewAxes};
use crate::model::AlignModel;
use crate::observed_cloud::ObservedCloud;
use crate::sim3::Sim3;

/// Surface that the line of sight meets at less than this cosine does not count as facing.
const FACING: f64 = 0.15;

/// The pose with the given rotation R (object to camera) under which the side that faces the camera
/// covers what was observed: as wide across the line of sight, and as far away. `None` where the
/// model shows nothing.
///
/// With the robust extents of the turned model (centre c, size s) and of the observation (c', s')
/// along the axes of the line of sight:
///
/// > scale = |s'| / |s|,  translation = c' − scale · c
pub(crate) fn fit_extent(
    model: &AlignModel,
    observed: &ObservedCloud,
    rotation: DQuat,
) -> Option<Sim3> {
    let axes = observed.axes();
    let all_sides = model.both_sides || observed.all_around();
    let turned: Vec<DVec3> = model
        .samples
        .iter()
        .step_by(3)
        .filter(|s| all_sides || faces_viewer(rotation * s.normal, axes))
        .map(|s| rotation * s.point)
        .collect();
    let (there, here) = (Extent::of(&turned, axes)?, observed.extent());
    // Along the line of sight, a single view shows less than is there.
    let scale = if observed.all_around() {
        here.diameter() / there.diameter()
    } else {
        here.width() / there.width()
    };
    let axes = axes.to_array();
    let offset: DVec3 = (0..3).map(|k| (here.centre[k] - scale * there.centre[k]) * axes[k]).sum();
    (scale.is_finite() && scale > 0.0).then_some(Sim3 { scale, rotation, translation: offset })
}

fn faces_viewer(normal: DVec3, axes: ViewAxes) -> bool {
    -normal.dot(axes.forward) > FACING
}
