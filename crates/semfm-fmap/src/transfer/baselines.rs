//! What any claim must beat: the nearest features, transport alone, and geometry alone.

use faer::Mat;
use rayon::prelude::*;
use semfm_geom::Eigenbasis;

use super::{Matched, Pair, Rule, Stages, Voter};
use crate::descriptors::normalised_coefficients;
use crate::fit::{Fit, fit};
use crate::zoomout::{MapSide, point_map, zoomout};
use crate::{PointMap, Result};

/// Energies of the wave kernel signature.
const N_ENERGIES: usize = 100;

/// The map of the transport plan: each vertex goes to the vertex of the source point that its own
/// nearest point gets most of its mass from.
pub(super) fn match_by_plan(pair: &Pair<'_>, plan: &crate::transport::Plan) -> Matched {
    Matched {
        point_map: through_points(pair, &plan.source_of()),
        reverse: None,
        map: None,
        fit: None,
    }
}

/// The nearest source points of each target point in the joint feature space, and the map to the
/// very nearest.
pub(super) fn match_by_neighbours(pair: &Pair<'_>, stages: &mut Stages) -> (Matched, Voter) {
    let start = std::time::Instant::now();
    let (source, target) = (&pair.joint.source, &pair.joint.target);
    let count = pair.settings.neighbours.min(source.nrows());
    let neighbours: Vec<Vec<u32>> = (0..target.nrows())
        .into_par_iter()
        .map(|j| {
            let mut squares = vec![0.0; source.nrows()];
            for c in 0..source.ncols() {
                let x = target[(j, c)];
                squares
                    .iter_mut()
                    .zip(source.col_as_slice(c))
                    .for_each(|(d, y)| *d += (x - y) * (x - y));
            }
            let mut hits: Vec<(f64, u32)> = squares.into_iter().zip(0..).collect();
            let order = |a: &(f64, u32), b: &(f64, u32)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
            hits.select_nth_unstable_by(count - 1, order);
            hits.truncate(count);
            hits.sort_unstable_by(order);
            hits.into_iter().map(|hit| hit.1).collect()
        })
        .collect();
    let nearest: Vec<u32> = neighbours.iter().map(|ids| ids[0]).collect();
    let point_map = through_points(pair, &nearest);
    stages.put("neighbours", start.elapsed());
    (Matched { point_map, reverse: None, map: None, fit: None }, Voter::Nearest(neighbours))
}

fn through_points(pair: &Pair<'_>, source_point_of: &[u32]) -> PointMap {
    let vertices = pair.source.vertex_of_point();
    let carry = |&j: &u32| vertices[source_point_of[j as usize] as usize];
    PointMap { source_of: pair.target.point_of_vertex().iter().map(carry).collect() }
}

/// The paper's baseline: wave kernel signatures, commutation with the Laplacian, plain ZoomOut.
pub(super) fn match_by_wks(pair: &Pair<'_>, stages: &mut Stages) -> Result<Matched> {
    let (source, target) = pair.plain_sides();
    let road = |a: &MapSide<'_>, b: &MapSide<'_>, stages: &mut Stages| -> Result<(Fit, PointMap)> {
        let k = pair.settings.zoomout.k_start;
        let start = std::time::Instant::now();
        let describe = |basis: &Eigenbasis| {
            normalised_coefficients(basis, wave_kernel_signature(basis).as_ref(), k)
        };
        let (on_a, on_b) = (describe(a.basis), describe(b.basis));
        let mut fit =
            fit((on_a.as_ref(), on_b.as_ref()), a.basis, b.basis, &pair.settings.fit, pair.task)?;
        stages.put("fit", start.elapsed());
        let (map, points) = stages.time("zoomout", || {
            let map = zoomout(fit.map.clone(), a, b, &pair.settings.zoomout, pair.task)?;
            let points = point_map(&map, a, b, pair.settings.zoomout.feature_weight);
            Ok((map, points))
        })?;
        fit.map = map;
        Ok((fit, points))
    };
    let (forth, points) = road(&source, &target, stages)?;
    let back = match pair.settings.rule {
        Rule::Image => Some(road(&target, &source, stages)?.1.source_of),
        Rule::Preimage => None,
    };
    Ok(Matched { point_map: points, reverse: back, map: Some(forth.map), fit: Some(forth.report) })
}

/// Wave kernel signature (n × 100; Aubry, Schlickewei & Cremers 2011): log-normal band passes over
/// the spectrum without its constant functions, each scaled by its total.
fn wave_kernel_signature(basis: &Eigenbasis) -> Mat<f64> {
    let largest = basis.values.last().copied().unwrap_or(0.0);
    let constants = basis.values.iter().take_while(|&&l| l <= 1e-8 * largest).count();
    let logs: Vec<f64> = basis.values[constants..].iter().map(|l| l.ln()).collect();
    let (Some(&low), Some(&high)) = (logs.first(), logs.last()) else {
        return Mat::zeros(basis.n_vertices(), N_ENERGIES);
    };
    let width = (7.0 * (high - low) / N_ENERGIES as f64).max(1e-6);
    let bands = Mat::from_fn(logs.len(), N_ENERGIES, |i, e| {
        let (first, last) = (low + 2.0 * width, high - 2.0 * width);
        let energy = first + (last - first) * e as f64 / (N_ENERGIES - 1) as f64;
        (-(energy - logs[i]).powi(2) / (2.0 * width * width)).exp()
    });
    let squares = Mat::from_fn(basis.n_vertices(), logs.len(), |v, i| {
        basis.functions[(v, constants + i)].powi(2)
    });
    let mut signature = squares * &bands;
    for e in 0..N_ENERGIES {
        let total: f64 = bands.col(e).iter().sum::<f64>().max(f64::MIN_POSITIVE);
        signature.col_mut(e).iter_mut().for_each(|x| *x /= total);
    }
    signature
}
