//! A point on a surface.

use semfm_geom::math::DVec3;

/// A point of a surface and the unit normal there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OrientedPoint {
    pub point: DVec3,
    pub normal: DVec3,
}
