//! `fused`, the default: transport starts the map, features steer it, geometry smooths it.
//!
//! The transport plan between the clouds says for each sample of either object which sample of
//! the other it resembles most, given that everything must go somewhere. Those matches, both ways,
//! start a bidirectional ZoomOut (10 → 30) whose search runs in the basis and the features at once;
//! the map carries the region, a little heat takes out the specks, and the vote is spread along the
//! target's own features ([`propagation`](crate::propagation)). Anchors are not needed.

use super::{Matched, Pair, Rule, Stages};
use crate::Result;
use crate::transport::Plan;
use crate::zoomout::{point_map, reverse_point_map, zoomout_bidirectional};

pub(super) fn match_pair(pair: &Pair<'_>, plan: &Plan, stages: &mut Stages) -> Result<Matched> {
    let settings = pair.settings;
    let start = std::time::Instant::now();
    let features = pair.vertex_features();
    let (source, target) = pair.sampled_sides(&features);
    // Vertex → its cloud point → the partner's cloud point → that point's vertex.
    let through =
        |samples: &[u32], point_of: &[u32], partner: &[u32], vertex_of: &[u32]| -> Vec<u32> {
            let carry = |&v: &u32| vertex_of[partner[point_of[v as usize] as usize] as usize];
            samples.iter().map(carry).collect()
        };
    let source_of = through(
        target.samples,
        pair.target.point_of_vertex(),
        &plan.source_of(),
        pair.source.vertex_of_point(),
    );
    let target_of = through(
        source.samples,
        pair.source.point_of_vertex(),
        &plan.target_of(),
        pair.target.vertex_of_point(),
    );
    stages.put("start", start.elapsed());
    let map = stages.time("zoomout", || {
        zoomout_bidirectional(source_of, target_of, &source, &target, &settings.zoomout, pair.task)
    })?;
    let weight = settings.zoomout.feature_weight;
    let start = std::time::Instant::now();
    let forth = point_map(&map, &source, &target, weight);
    let reverse =
        (settings.rule == Rule::Image).then(|| reverse_point_map(&map, &source, &target, weight));
    stages.put("point_map", start.elapsed());
    Ok(Matched { point_map: forth, reverse, map: Some(map), fit: None })
}
