//! The pad of a finger: its flat face towards the other finger.

use semfm_geom::math::DVec3;

/// Faces within this angle of the closing direction belong to a pad.
const COS_TILT: f64 = 0.966; // 15°
/// How deep a pad may be ribbed or rounded, metres.
const DEPTH: f64 = 1e-3;
/// A face that stands in front is the pad where it has this share of the largest slice. At a quarter
/// a fingertip on a long carriage is missed (the buried back of the tip counts with the carriage);
/// screw heads have some hundredths.
const MIN_SHARE: f64 = 0.15;

/// A triangle that is perpendicular to the closing direction, nearly.
struct FlatTriangle<'a> {
    /// Of its innermost corner, along the inward direction.
    height: f64,
    area: f64,
    corners: &'a [DVec3; 3],
}

/// The triangles whose innermost corners lie within [`DEPTH`] of one's.
struct Slice {
    area: f64,
    /// One past the last of them, in the order of heights.
    end: usize,
}

/// A pad: how far its face stands towards the other finger, and which points belong to it.
pub(super) struct PadFace {
    /// Along the inward direction, metres.
    pub height: f64,
    /// Corners of its triangles.
    pub points: Vec<DVec3>,
}

/// The innermost flat face of a finger's surface that is large enough; `inward` is a unit vector
/// towards the other finger. The winding of triangles is not trusted.
pub(super) fn innermost(triangles: &[[DVec3; 3]], inward: DVec3) -> Option<PadFace> {
    let mut flat: Vec<FlatTriangle<'_>> =
        triangles.iter().filter_map(|corners| FlatTriangle::new(corners, inward)).collect();
    flat.sort_by(|a, b| b.height.total_cmp(&a.height));
    // The slice that begins at each triangle, by two running ends.
    let (mut end, mut area) = (0, 0.0);
    let mut slices = Vec::with_capacity(flat.len());
    for start in 0..flat.len() {
        while end < flat.len() && flat[end].height >= flat[start].height - DEPTH {
            area += flat[end].area;
            end += 1;
        }
        slices.push(Slice { area, end });
        area -= flat[start].area;
    }
    let largest = slices.iter().map(|slice| slice.area).fold(0.0, f64::max);
    let start = slices.iter().position(|slice| slice.area >= MIN_SHARE * largest)?;
    let points = flat[start..slices[start].end].iter().flat_map(|triangle| *triangle.corners);
    Some(PadFace { height: flat[start].height, points: points.collect() })
}

impl<'a> FlatTriangle<'a> {
    /// `None` for a triangle that is degenerate or tilted.
    fn new(corners: &'a [DVec3; 3], inward: DVec3) -> Option<Self> {
        let [a, b, c] = *corners;
        let normal = (b - a).cross(c - a) / 2.0;
        let area = normal.length();
        let height = corners.map(|p| p.dot(inward)).into_iter().fold(f64::MIN, f64::max);
        let flat = area > 0.0 && normal.dot(inward).abs() >= COS_TILT * area;
        flat.then_some(Self { height, area, corners })
    }
}

#[cfg(test)]
mod tests {
    use parry3d_f64::shape::Cuboid;

    use super::*;

    fn block(middle: DVec3, size: DVec3) -> Vec<[DVec3; 3]> {
        let (points, faces) = Cuboid::new(size / 2.0).to_trimesh();
        faces.iter().map(|face| face.map(|i| points[i as usize] + middle)).collect()
    }

    #[test]
    fn the_pad_is_found_before_the_finger_and_behind_a_screw() {
        let mut finger = block(DVec3::ZERO, DVec3::new(0.02, 0.02, 0.06));
        finger.extend(block(DVec3::new(0.0, 0.012, 0.02), DVec3::new(0.018, 0.004, 0.018)));
        finger.extend(block(DVec3::new(0.0, 0.0165, -0.02), DVec3::splat(0.002)));
        let face = innermost(&finger, DVec3::Y).unwrap();
        assert!((face.height - 0.014).abs() < 1e-12, "{}", face.height);
        let (low, high) = semfm_geom::math::bounds(&face.points).unwrap();
        assert!((high.z - low.z - 0.018).abs() < 1e-12 && (high.x - low.x - 0.018).abs() < 1e-12);
    }

    #[test]
    fn a_finger_without_a_flat_side_has_no_pad() {
        let edge = [[DVec3::ZERO, DVec3::new(1.0, 1.0, 0.0), DVec3::Z]];
        assert!(innermost(&edge, DVec3::Y).is_none());
        assert!(innermost(&[], DVec3::Y).is_none());
    }
}
