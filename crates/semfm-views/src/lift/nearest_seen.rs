//! For samples that no view sees: the nearest seen sample, along the surface.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use semfm_geom::PointIndex;
use semfm_geom::math::DVec3;
use semfm_geom::sampling::SurfaceSample;

use crate::Result;

/// Neighbours of each sample in the graph that stands for the surface.
const NEIGHBOURS: usize = 10;

/// Samples on opposite sides of a thin wall are close in space and far along the surface. A step
/// between normals whose cosine is below the first number counts as so many times longer. Not
/// tuned: large enough that the way around a rim is shorter, finite so that meshes with careless
/// winding stay connected.
const OPPOSITE_COSINE: f64 = -0.5;
const OPPOSITE_FACTOR: f64 = 10.0;

/// For each sample, the id of the sample to take features from: itself where `n_views > 0`, else
/// the seen sample at the end of the shortest path through the graph of nearest neighbours, or the
/// nearest in space where no path leads to one.
///
/// At least one sample must be seen.
pub(super) fn nearest_seen(samples: &[SurfaceSample], n_views: &[u32]) -> Result<Vec<usize>> {
    let seen: Vec<usize> = (0..samples.len()).filter(|&j| n_views[j] > 0).collect();
    let mut source: Vec<Option<usize>> = vec![None; samples.len()];
    if seen.len() == samples.len() {
        return Ok(seen);
    }
    let edges = neighbour_graph(samples)?;
    // Dijkstra from all seen samples at once. Lengths are not negative, so their bit patterns
    // sort as they do; equal lengths go to the lower source.
    let mut heap: BinaryHeap<Reverse<(u64, usize, usize)>> =
        seen.iter().map(|&j| Reverse((0f64.to_bits(), j, j))).collect();
    while let Some(Reverse((length, from, j))) = heap.pop() {
        if source[j].is_some() {
            continue;
        }
        source[j] = Some(from);
        for &(next, step) in &edges[j] {
            if source[next].is_none() {
                heap.push(Reverse(((f64::from_bits(length) + step).to_bits(), from, next)));
            }
        }
    }
    let seen_points: Vec<DVec3> = seen.iter().map(|&j| samples[j].point).collect();
    let index = PointIndex::new(&seen_points)?;
    let sources = source.into_iter().zip(samples);
    Ok(sources
        .map(|(from, sample)| from.unwrap_or_else(|| seen[index.nearest(sample.point).0]))
        .collect())
}

/// Edges (neighbour, length) of each sample, in both directions.
fn neighbour_graph(samples: &[SurfaceSample]) -> Result<Vec<Vec<(usize, f64)>>> {
    let points: Vec<DVec3> = samples.iter().map(|sample| sample.point).collect();
    let index = PointIndex::new(&points)?;
    let mut edges = vec![Vec::new(); samples.len()];
    for (j, sample) in samples.iter().enumerate() {
        for (next, distance) in index.k_nearest(sample.point, NEIGHBOURS + 1) {
            if next == j {
                continue;
            }
            let opposite = sample.normal.dot(samples[next].normal) < OPPOSITE_COSINE;
            let length = if opposite { OPPOSITE_FACTOR * distance } else { distance };
            edges[j].push((next, length));
            edges[next].push((j, length));
        }
    }
    Ok(edges)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(x: f64, z: f64, normal: DVec3) -> SurfaceSample {
        SurfaceSample { face: 0, point: DVec3::new(x, 0.0, z), normal }
    }

    #[test]
    fn the_way_goes_around_the_rim_not_through_the_wall() {
        // A wall .05 thick and 1 high: outside (z = 0) unseen above x = .5 only on the inside.
        let outside = (0..40).map(|i| sample(f64::from(i) / 40.0, 0.0, -DVec3::Z));
        let inside = (0..40).map(|i| sample(f64::from(i) / 40.0, 0.05, DVec3::Z));
        let samples: Vec<SurfaceSample> = outside.chain(inside).collect();
        // All of the outside is seen, and the inside's half near the rim.
        let n_views: Vec<u32> = (0..80).map(|j| u32::from(j < 60)).collect();
        let source = nearest_seen(&samples, &n_views).unwrap();
        assert!((0..60).all(|j| source[j] == j));
        // The first unseen ones continue the inside instead of copying the outside.
        assert!((60..70).all(|j| source[j] == 59), "{source:?}");
    }

    #[test]
    fn islands_without_a_seen_sample_take_the_nearest_in_space() {
        let far = (0..20).map(|i| sample(f64::from(i) * 0.01, 0.0, DVec3::Z));
        let island = (0..20).map(|i| sample(100.0 + f64::from(i) * 0.01, 0.0, DVec3::Z));
        let samples: Vec<SurfaceSample> = far.chain(island).collect();
        let n_views: Vec<u32> = (0..40).map(|j| u32::from(j < 20)).collect();
        let source = nearest_seen(&samples, &n_views).unwrap();
        assert!(source[20..].iter().all(|&j| j == 19), "{source:?}");
    }
}
