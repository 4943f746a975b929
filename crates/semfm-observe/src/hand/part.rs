//! Fingers and palm.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::fmt;

use semfm_geom::math::DVec3;

use crate::{Error, Result};

/// A part of a hand.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum HandPart {
    /// The first finger.
    Thumb,
    /// The second.
    Index,
    /// The third.
    Middle,
    /// The fourth.
    Ring,
    /// The fifth.
    Little,
    /// Everything between fingers and wrist.
    Palm,
}

impl HandPart {
    /// All of them, fingers first.
    pub const ALL: [Self; 6] =
        [Self::Thumb, Self::Index, Self::Middle, Self::Ring, Self::Little, Self::Palm];

    /// Its name in files: `thumb`, `index`, `middle`, `ring`, `little`, `palm`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Thumb => "thumb",
            Self::Index => "index",
            Self::Middle => "middle",
            Self::Ring => "ring",
            Self::Little => "little",
            Self::Palm => "palm",
        }
    }
}

impl fmt::Display for HandPart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Vertices of MANO's topology (Romero, Tzionas & Black, *Embodied Hands*, 2017), which HaMeR and WiLoR give.
const MANO_VERTICES: usize = 778;
/// Its fingertips, from the thumb on, as the package `smplx` numbers them (`vertex_ids.py`).
const MANO_TIPS: [usize; 5] = [744, 320, 443, 554, 671];

/// A finger reaches from its tip over this share of the way to the farthest vertex: on MANO's mean shape that is the web
/// between the fingers; a thumb is shorter.
const FINGER_SHARE: f64 = 0.40;
const THUMB_SHARE: f64 = 0.33;

/// The parts of a hand in MANO's topology, by distances along its edges from the tips; `None` for another topology.
pub(super) fn of_mano(points: &[DVec3], faces: &[[u32; 3]]) -> Option<Vec<HandPart>> {
    if points.len() != MANO_VERTICES || faces.is_empty() {
        return None;
    }
    let from_tips: Vec<Vec<f64>> =
        MANO_TIPS.iter().map(|&tip| distances_along_edges(points, faces, tip)).collect();
    let reaches: Vec<f64> = from_tips
        .iter()
        .enumerate()
        .map(|(finger, distances)| {
            let farthest = distances.iter().copied().filter(|d| d.is_finite()).fold(0.0, f64::max);
            farthest * if finger == 0 { THUMB_SHARE } else { FINGER_SHARE }
        })
        .collect();
    let part = |v: usize| {
        let nearest = (0..5).min_by(|&a, &b| from_tips[a][v].total_cmp(&from_tips[b][v]));
        let finger = nearest.filter(|&finger| from_tips[finger][v] <= reaches[finger]);
        finger.map_or(HandPart::Palm, |finger| HandPart::ALL[finger])
    };
    Some((0..points.len()).map(part).collect())
}

/// The nearest bone of each point: a finger's three bones beyond its first joint, or the palm's.
pub(super) fn of_joints(points: &[DVec3], joints: &[DVec3]) -> Result<Vec<HandPart>> {
    if joints.len() != 21 {
        let expected = "21 joints: the wrist, and four of each finger from the thumb on, tips last";
        return Err(Error::invalid("hand joints", expected, joints.len()));
    }
    let mut bones = Vec::new();
    for finger in 0..5 {
        let joint = |i: usize| joints[1 + 4 * finger + i];
        bones.push((HandPart::Palm, joints[0], joint(0)));
        // The thumb's first bone lies in the ball of the thumb.
        let first = if finger == 0 { HandPart::Palm } else { HandPart::ALL[finger] };
        bones.push((first, joint(0), joint(1)));
        bones.push((HandPart::ALL[finger], joint(1), joint(2)));
        bones.push((HandPart::ALL[finger], joint(2), joint(3)));
    }
    let distance = |p: DVec3, a: DVec3, b: DVec3| {
        let along = b - a;
        let t = (p - a).dot(along) / along.length_squared().max(f64::MIN_POSITIVE);
        p.distance(a + t.clamp(0.0, 1.0) * along)
    };
    let part = |p: &DVec3| {
        let nearest = bones
            .iter()
            .min_by(|(_, a, b), (_, c, d)| distance(*p, *a, *b).total_cmp(&distance(*p, *c, *d)));
        nearest.map_or(HandPart::Palm, |bone| bone.0)
    };
    Ok(points.iter().map(part).collect())
}

/// Lengths of the shortest ways along edges from a vertex (Dijkstra 1959); infinite where there is none.
fn distances_along_edges(points: &[DVec3], faces: &[[u32; 3]], from: usize) -> Vec<f64> {
    let mut beside: Vec<Vec<u32>> = vec![Vec::new(); points.len()];
    for &[a, b, c] in faces {
        for (x, y) in [(a, b), (b, c), (c, a)] {
            beside[x as usize].push(y);
            beside[y as usize].push(x);
        }
    }
    let mut distances = vec![f64::INFINITY; points.len()];
    distances[from] = 0.0;
    // Lengths are positive, so that their bits order them.
    let mut waiting = BinaryHeap::from([Reverse((0u64, from as u32))]);
    while let Some(Reverse((bits, v))) = waiting.pop() {
        let distance = f64::from_bits(bits);
        if distance > distances[v as usize] {
            continue;
        }
        for &w in &beside[v as usize] {
            let longer = distance + points[v as usize].distance(points[w as usize]);
            if longer < distances[w as usize] {
                distances[w as usize] = longer;
                waiting.push(Reverse((longer.to_bits(), w)));
            }
        }
    }
    distances
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_belong_to_the_nearest_bone() {
        // Fingers along y, 2 cm apart, from a wrist at the origin.
        let mut joints = vec![DVec3::ZERO];
        for finger in 0..5 {
            let x = 0.02 * f64::from(finger) - 0.04;
            joints.extend((0..4).map(|i| DVec3::new(x, 0.08 + 0.025 * f64::from(i), 0.0)));
        }
        let points = [
            DVec3::new(0.0, 0.12, 0.008),
            DVec3::new(0.041, 0.15, 0.0),
            DVec3::new(0.0, 0.02, 0.01),
        ];
        let parts = of_joints(&points, &joints).unwrap();
        assert_eq!(parts, [HandPart::Middle, HandPart::Little, HandPart::Palm]);
        assert!(of_joints(&points, &joints[..16]).unwrap_err().to_string().contains("21"));
    }

    #[test]
    fn ways_run_along_edges() {
        let points = [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::new(9.0, 9.0, 9.0)];
        let distances = distances_along_edges(&points, &[[0, 1, 2]], 0);
        assert_eq!(distances[1], 1.0);
        assert!((distances[2] - 2.0f64.sqrt()).abs() < 1e-15 && distances[3].is_infinite());
        assert!(of_mano(&points, &[[0, 1, 2]]).is_none(), "another topology");
    }
}
