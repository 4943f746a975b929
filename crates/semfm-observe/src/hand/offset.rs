//! How far a hand is off: a hand that holds something rests on its surface.

use semfm_geom::math::DVec3;

use super::signed_distance::HandDistance;

/// A hand that touches less than this share of the most that is found along the ray counts as touching so much.
const LEAST_TOUCH: f64 = 1e-3;
/// An area that is inside the hand by one reach more than soft tissue allows counts this many times against. With half of
/// it a hand that presses 5 mm into a ball stays there, and no row of `bench_contact` is better.
const WORTH_OF_PENETRATION: f64 = 6.0;
/// As deep as this share of the reach tissue gives way.
const SOFTNESS: f64 = 0.3;
/// Vertices that the search looks at.
const N_SEARCHED: usize = 300;
/// Steps along the ray on each side, and the share of a standard deviation between them.
const N_ALONG: i32 = 4;
const ALONG_STEP: f64 = 0.5;
/// Shortest step of the search, as a share of the standard deviation.
const LAST_STEP: f64 = 0.1;

/// How far off, and which way, a hand may be.
#[derive(Clone, Copy, Debug)]
pub(super) struct Doubt {
    /// Unit axes and the standard deviation along each.
    pub axes: [(DVec3, f64); 3],
    /// Whether the first axis is the ray, along which a hand may be far off.
    pub has_ray: bool,
}

impl Doubt {
    /// Along the ray from a viewpoint, and across it; without one alike in all directions.
    pub fn new(hand_middle: DVec3, viewpoint: Option<DVec3>, along: f64, across: f64) -> Self {
        let ray = viewpoint.and_then(|eye| (hand_middle - eye).try_normalize());
        let first = ray.unwrap_or(DVec3::X);
        let second = first.any_orthonormal_vector();
        let along = if ray.is_some() { along } else { across };
        let axes = [(first, along), (second, across), (first.cross(second), across)];
        Self { axes, has_ray: ray.is_some() }
    }
}

/// A vertex of the object near the hand, with the area that it stands for.
#[derive(Clone, Copy, Debug)]
pub(super) struct NearVertex {
    pub vertex: u32,
    pub point: DVec3,
    pub area: f64,
}

/// An offset of the hand and what speaks for it, as a logarithm.
#[derive(Clone, Copy, Debug)]
pub(super) struct Offset {
    pub shift: DVec3,
    pub log_weight: f64,
}

/// The likeliest offset and those around it, by one reach of the search's last steps, for what is not sure.
pub(super) fn find(
    distance: &HandDistance<'_>,
    near: &[NearVertex],
    reach: f64,
    doubt: &Doubt,
) -> Vec<Offset> {
    let stride = near.len().div_ceil(N_SEARCHED).max(1);
    let searched: Vec<NearVertex> = near.iter().step_by(stride).copied().collect();
    let along = |coordinates: [f64; 3]| {
        coordinates.iter().zip(&doubt.axes).map(|(c, (axis, _))| *c * *axis).sum::<DVec3>()
    };
    let touching = |coordinates: [f64; 3]| touch(distance, &searched, reach, along(coordinates));
    let mut starts = vec![[0.0; 3]];
    if doubt.has_ray {
        let steps = (-N_ALONG..=N_ALONG).filter(|&i| i != 0);
        starts.extend(steps.map(|i| [f64::from(i) * ALONG_STEP * doubt.axes[0].1, 0.0, 0.0]));
    }
    let touches: Vec<f64> = starts.iter().map(|&start| touching(start)).collect();
    let most = touches.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    // log p = log touch − ½ Σ (c/σ)²: a hand that touches hardly anything is moved far, one that touches much
    // stays. On six grasps of a hammer, a mug and a cup (`bench_contact`) a gain in proportion to the touch (4 · touch /
    // most) moved hands that were right: overlap .52 without an error in place of .69, .56 in place of .62 at 10 mm
    // along the ray; 1½ and 2 times the logarithm had .63 and .61 without an error, .66 and .61 at 10 mm.
    let least = LEAST_TOUCH * most;
    let score = |coordinates: [f64; 3], touch: f64| {
        let off: f64 = (0..3).map(|i| (coordinates[i] / doubt.axes[i].1).powi(2)).sum();
        touch.max(least).ln() - 0.5 * off
    };
    let scored = starts.iter().zip(&touches).map(|(&start, &touch)| (start, score(start, touch)));
    let mut best = scored.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or(([0.0; 3], 0.0));
    let mut step = 0.5;
    while step >= LAST_STEP {
        let mut moved = false;
        for axis in 0..3 {
            for sign in [1.0, -1.0] {
                let mut next = best.0;
                next[axis] += sign * step * doubt.axes[axis].1;
                let found = score(next, touching(next));
                if found > best.1 {
                    best = (next, found);
                    moved = true;
                }
            }
        }
        if !moved {
            step /= 2.0;
        }
    }
    let mut offsets = vec![Offset { shift: along(best.0), log_weight: 0.0 }];
    for axis in 0..3 {
        for sign in [1.0, -1.0] {
            let mut beside = best.0;
            beside[axis] += sign * 0.5 * doubt.axes[axis].1.min(doubt.axes[1].1);
            let log_weight = score(beside, touching(beside)) - best.1;
            offsets.push(Offset { shift: along(beside), log_weight });
        }
    }
    offsets
}

/// Area that the hand rests on once it is shifted, less what it would pass through.
fn touch(distance: &HandDistance<'_>, near: &[NearVertex], reach: f64, shift: DVec3) -> f64 {
    near.iter()
        .filter_map(|v| {
            let found = distance.at(v.point - shift, 3.0 * reach)?.distance;
            let rests = (-0.5 * (found / reach).powi(2)).exp();
            let inside = (-found / reach - SOFTNESS).max(0.0);
            Some(v.area * (rests - WORTH_OF_PENETRATION * inside))
        })
        .sum()
}
