//! The vector types of the whole workspace: glam's, in the version that parry speaks.

pub use glam::{DAffine3, DMat3, DMat4, DQuat, DVec2, DVec3, DVec4};

/// Axis-aligned bounds of a set of points, `None` for an empty set.
pub fn bounds(points: &[DVec3]) -> Option<(DVec3, DVec3)> {
    let first = *points.first()?;
    Some(points.iter().fold((first, first), |(low, high), &p| (low.min(p), high.max(p))))
}
