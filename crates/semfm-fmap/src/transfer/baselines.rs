//! What any claim must beat: the nearest features, transport alone, and geometry alone.

use faer::Mat;
use rayon::prelude::*;
use semfm_geom::descriptors::{WksSettings, wks};
use semfm_geom::{Eigenbasis, Shape};

use super::{Matched, Pair, Rule, Stages, Voter};
use crate::descriptors::normalised_coefficients;
use crate::fit::{Fit, FitSide, OrientedSurface, fit};
use crate::zoomout::{MapSide, point_map, zoomout};
use crate::{PointMap, Result};

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
    let (source, target) = (pair.source.shape(), pair.target.shape());
    let road = |source: &Shape, target: &Shape, stages: &mut Stages| -> Result<(Fit, PointMap)> {
        let k = pair.settings.zoomout.k_start;
        let start = std::time::Instant::now();
        let describe = |basis: &Eigenbasis| -> Result<Mat<f64>> {
            let signature = wks(basis, &WksSettings::default())?;
            Ok(normalised_coefficients(basis, signature.as_ref(), k))
        };
        let asked = pair.settings.fit.orientation > 0.0;
        let surface = |of: &Shape| asked.then(|| OrientedSurface::new(of.mesh())).transpose();
        let surfaces = (surface(source)?, surface(target)?);
        let a = FitSide { basis: source.basis(), surface: surfaces.0.as_ref() };
        let b = FitSide { basis: target.basis(), surface: surfaces.1.as_ref() };
        let (on_a, on_b) = (describe(a.basis)?, describe(b.basis)?);
        let on_both = (on_a.as_ref(), on_b.as_ref());
        let mut fit = fit(on_both, a, b, &pair.settings.fit, pair.task)?;
        stages.put("fit", start.elapsed());
        let (map, points) = stages.time("zoomout", || {
            let [a, b] = [source, target].map(|shape| MapSide {
                basis: shape.basis(),
                features: None,
                samples: &[],
            });
            let map = zoomout(fit.map.clone(), &a, &b, &pair.settings.zoomout, pair.task)?;
            let points = point_map(&map, &a, &b, pair.settings.zoomout.feature_weight);
            Ok((map, points))
        })?;
        fit.map = map;
        Ok((fit, points))
    };
    let (forth, points) = road(source, target, stages)?;
    let back = match pair.settings.rule {
        Rule::Image => Some(road(target, source, stages)?.1.source_of),
        Rule::Preimage => None,
    };
    Ok(Matched { point_map: points, reverse: back, map: Some(forth.map), fit: Some(forth.report) })
}
