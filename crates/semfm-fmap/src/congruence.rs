//! Where the target is the source once more: the same surface in another place, size, tessellation or as its mirror image.
//!
//! A map between two different objects is right about parts and wrong about outlines, so that its vote is smoothed and
//! spread. Where one surface lies on the other there is nothing to smooth: each point has its partner, and an outline
//! that is redrawn gets worse (an axe and a hammer onto their own copies: IoU .98 and .93 instead of 1). Whether it does is a matter of
//! geometry alone, and is decided so: similarities x ↦ s R x + t, R a rotation or a mirror image, are taken from the
//! principal axes of both surfaces and from the matches, the best are refined by distances to the surface's planes
//! (Chen & Medioni, "Object modelling by registration of multiple range images", 1992, with scale), and one counts
//! where nearly all of either surface then lies on the other. Among several that do (a symmetric object) the one
//! under which the features agree best is taken, and where others are as likely a region on which they differ is left as it is.

use faer::Mat;
use faer::linalg::solvers::Solve;
use rayon::prelude::*;
use semfm_geom::math::{DAffine3, DMat3, DVec3};
use semfm_geom::{SurfaceMoments, SurfacePoint};

use crate::methods::Pair;
use crate::{PointMap, PreparedObject, Result};

/// Extents along the principal axes, as shares of the size, differ by at most this share of the larger, and this much
/// more, in two surfaces that are the same.
const MOST_EXTENT_RATIO: f64 = 0.05;
const MOST_EXTENT_DIFFERENCE: f64 = 0.005;
/// Extents within this share of each other leave the axes between them open: turns about the third are tried.
const LIKE_EXTENTS: f64 = 0.25;
/// Turns within half a turn that are then tried; the flips of the axes give the other half.
const N_TURNS: usize = 6;
/// Sizes of both surfaces after the motion differ by at most this share: a map that sends everything to one place would
/// shrink the target into the source, where it lies well.
const MOST_GROWTH: f64 = 0.1;
/// Samples that a similarity is first judged by; how many of the best are refined, and the residual, in tolerances, beyond
/// which none is.
const N_FIRST: usize = 16;
const N_REFINED: usize = 6;
const MOST_ROUGH: f64 = 5.0;
/// Samples that a similarity is refined and judged by.
const N_SAMPLES: usize = 200;
/// Steps of refinement.
const N_STEPS: usize = 10;
/// Share of the samples, the nearest ones, that a step of refinement uses.
const NEAREST_SHARE: f64 = 0.85;
/// Weight of standing still in a step of refinement, beside the mean square of a sample's equation: directions in which
/// a surface of revolution slides on itself are not moved in.
const DAMPING: f64 = 1e-6;
/// Share of either surface's samples that must lie on the other: certain from the second on, not at all below the first.
const LYING: [f64; 2] = [0.85, 0.95];
/// Similarities whose residual exceeds the least by less than this share of the tolerance fit equally well at first
/// sight; so do those under which the share of either surface that lies on the other is less by at most the second.
const TIE: f64 = 0.2;
const SAME_SHARE: f64 = 0.015;
/// Features that disagree by this share more do not tell two similarities apart. Regions on which these differ are left
/// to the vote: a symmetric object lies on itself in several ways.
const SAME_FEATURES: f64 = 0.1;
/// Nor do those that disagree by this much more, beside features of mean square 1.
const LEAST_DISAGREEMENT: f64 = 0.005;
/// Points whose features are compared.
const N_COMPARED: usize = 200;
/// Rounds in which matches that disagree with most others lose their weight.
const N_ROUNDS: usize = 6;

/// How a target lies on the source.
#[derive(Debug)]
pub(crate) struct Congruence {
    /// For each vertex of the target as read (n_target) how certain its place is, in [0, 1].
    certainty: Vec<f64>,
    /// And the place: the source's vertices at the corners of the triangle, and their weights.
    places: Vec<Place>,
    /// The places under other similarities that are as likely.
    others: Vec<Vec<Place>>,
}

/// A point of the source's surface.
#[derive(Clone, Copy, Debug)]
struct Place {
    corners: [u32; 3],
    weights: [f64; 3],
}

/// A similarity and how well the surfaces then fit.
#[derive(Clone, Copy)]
struct Candidate {
    source_from_target: DAffine3,
    /// Mean distance of the samples, the farthest left out.
    residual: f64,
}

impl Congruence {
    /// Looks whether the target of a pair lies on the source, within `tolerance` times the source's diagonal.
    ///
    /// # Errors
    /// [`Error::Geom`](crate::Error::Geom) for a mesh without area.
    pub fn of(pair: &Pair, points: &PointMap, tolerance: f64) -> Result<Option<Self>> {
        if tolerance == 0.0 {
            return Ok(None);
        }
        let (source, target) = (&pair.source, &pair.target);
        let (on_source, on_target) = (source.moments()?, target.moments()?);
        if !are_alike(on_source, on_target) {
            return Ok(None);
        }
        let tolerance = tolerance * source.shape().surface().diagonal();
        let surface = source.surface()?;
        let samples = positions(target);
        let by_matches = from_matches(pair, points);
        let mut found: Vec<Candidate> = (by_axes(on_source, on_target).into_iter())
            .chain(by_matches)
            .map(|motion| judged(surface, motion, &samples[..N_FIRST.min(samples.len())]))
            .collect();
        let growth = on_target.size() / on_source.size();
        let keeps_size = |c: &Candidate| (c.scale() * growth - 1.0).abs() <= MOST_GROWTH;
        found.retain(|rough| rough.residual <= MOST_ROUGH * tolerance && keeps_size(rough));
        found.sort_by(|a, b| a.residual.total_cmp(&b.residual)); // stable
        // Those that fit equally well in the order in which their features agree.
        let least = found.first().map_or(0.0, |best| best.residual);
        let n_ties = found.iter().take_while(|c| c.residual <= least + TIE * tolerance).count();
        sort_by_features(pair, &mut found[..n_ties]);
        found.truncate(N_REFINED);
        let refined = found.into_iter().map(|rough| {
            let motion = refined(source, surface, rough.source_from_target, &samples);
            judged(surface, motion, &samples)
        });
        let mut lying: Vec<(f64, Candidate)> = Vec::new();
        for fitting in refined.filter(|c| c.residual <= tolerance && keeps_size(c)) {
            lying.push((share_lying(pair, &fitting, tolerance)?, fitting));
        }
        let most = lying.iter().map(|(share, _)| *share).fold(0.0, f64::max);
        let certainty = ((most - LYING[0]) / (LYING[1] - LYING[0])).clamp(0.0, 1.0);
        if certainty == 0.0 {
            return Ok(None);
        }
        lying.retain(|(share, _)| *share >= most - SAME_SHARE);
        let mut likely: Vec<Candidate> = lying.into_iter().map(|(_, fitting)| fitting).collect();
        let disagreements = sort_by_features(pair, &mut likely);
        let least = disagreements.first().copied().unwrap_or(0.0);
        let limit = (least * (1.0 + SAME_FEATURES)).max(least + LEAST_DISAGREEMENT);
        likely.truncate(disagreements.iter().take_while(|&&d| d <= limit).count().max(1));
        let best = likely.first().copied();
        likely.retain(|other| best.is_none_or(|best| !best.is_like(other, &samples, tolerance)));
        likely.splice(0..0, best);
        let mut laid = likely.into_iter().filter_map(|motion| Laid::new(pair, &motion, tolerance));
        let Some(Laid { certainties, places }) = laid.next() else {
            return Ok(None); // coordinates whose squares overflow
        };
        let certainty = certainties.into_iter().map(|c| certainty * c).collect();
        Ok(Some(Self { certainty, places, others: laid.map(|other| other.places).collect() }))
    }

    /// The share of the target's vertices that lie on the source, each by how certain that is.
    pub fn share(&self) -> f64 {
        self.certainty.iter().sum::<f64>() / self.certainty.len().max(1) as f64
    }

    /// Weights on the target's vertices as read (n_target) where they are certain replaced by those of the source's
    /// region (`inside`, n_source vertices as read).
    pub fn mixed_into(&self, weights: &mut [f64], inside: &[bool]) {
        for (v, weight) in weights.iter_mut().enumerate() {
            *weight = self.mixed(v, *weight, inside);
        }
    }

    /// The same for working vertices, which are these vertices of the mesh as read.
    pub fn mixed_into_working(&self, weights: &mut [f64], to_original: &[u32], inside: &[bool]) {
        for (&v, weight) in to_original.iter().zip(weights) {
            *weight = self.mixed(v as usize, *weight, inside);
        }
    }

    /// Partners on the source's working mesh in place of those of a point map, where they are certain.
    pub fn correct(&self, points: &mut PointMap, source: &PreparedObject, target: &PreparedObject) {
        if !self.others.is_empty() {
            return; // the map's own choice among them stands
        }
        let of_original = &source.shape().working().of_original;
        let vertices = target.shape().working().to_original.iter().zip(&mut points.source_of);
        for (&v, partner) in vertices.filter(|(v, _)| self.certainty[**v as usize] >= 0.5) {
            *partner = of_original[self.places[v as usize].nearest_corner() as usize];
        }
    }

    fn mixed(&self, v: usize, weight: f64, inside: &[bool]) -> f64 {
        let (certainty, share) = (self.certainty[v], self.places[v].share(inside));
        if self.others.iter().any(|places| (places[v].share(inside) - share).abs() > 0.5) {
            return weight;
        }
        (1.0 - certainty) * weight + certainty * share
    }
}

impl Candidate {
    fn scale(&self) -> f64 {
        self.source_from_target.matrix3.determinant().abs().cbrt()
    }

    /// Whether both lay all samples to about the same places: refinement brings several starts to one end.
    fn is_like(&self, other: &Self, samples: &[DVec3], tolerance: f64) -> bool {
        let places = |p: DVec3| [self, other].map(|c| c.source_from_target.transform_point3(p));
        samples.iter().all(|&p| {
            let [one, another] = places(p);
            one.distance(another) <= 4.0 * tolerance
        })
    }
}

/// Where the target's vertices as read (n_target) lie on the source.
struct Laid {
    /// Certain within the tolerance, not at all from twice that.
    certainties: Vec<f64>,
    places: Vec<Place>,
}

impl Laid {
    /// `None` for coordinates whose squares overflow.
    fn new(pair: &Pair, motion: &Candidate, tolerance: f64) -> Option<Self> {
        let on_source = pair.source.surface().ok()?;
        let faces = pair.source.shape().surface().faces();
        let vertices = pair.target.shape().surface().vertices();
        let laid = vertices.par_iter().map(|&p| {
            let hit = on_source.closest(motion.source_from_target.transform_point3(p))?;
            let certainty = (2.0 - hit.distance / tolerance).clamp(0.0, 1.0);
            Some((certainty, Place { corners: faces[hit.face as usize], weights: hit.barycentric }))
        });
        let (certainties, places) = laid.collect::<Option<Vec<_>>>()?.into_iter().unzip();
        Some(Self { certainties, places })
    }
}

/// The share of the samples of either surface, the lesser one, that lies on the other.
fn share_lying(pair: &Pair, motion: &Candidate, tolerance: f64) -> Result<f64> {
    let (source, target) = (&pair.source, &pair.target);
    let (on_source, on_target) = (source.surface()?, target.surface()?);
    let (there, scale) = (motion.source_from_target, motion.scale());
    let back = there.inverse();
    let of_target = share_within(tolerance, &positions(target), |p| {
        distance(on_source, there.transform_point3(p))
    });
    let of_source = share_within(tolerance, &positions(source), |p| {
        scale * distance(on_target, back.transform_point3(p))
    });
    Ok(of_target.min(of_source))
}

/// The share of points whose distance is at most the tolerance.
fn share_within(tolerance: f64, points: &[DVec3], distance: impl Fn(DVec3) -> f64) -> f64 {
    let n_within = points.iter().filter(|&&p| distance(p) <= tolerance).count();
    n_within as f64 / points.len().max(1) as f64
}

/// Sorts similarities by how much features disagree, and returns by how much.
fn sort_by_features(pair: &Pair, candidates: &mut [Candidate]) -> Vec<f64> {
    let mut keyed: Vec<(f64, Candidate)> =
        candidates.iter().map(|c| (disagreement(pair, c.source_from_target), *c)).collect();
    keyed.sort_by(|a, b| a.0.total_cmp(&b.0)); // stable
    candidates.iter_mut().zip(&keyed).for_each(|(to, (_, from))| *to = *from);
    keyed.into_iter().map(|(disagreement, _)| disagreement).collect()
}

impl Place {
    /// The mix of what the corners have.
    fn share(&self, inside: &[bool]) -> f64 {
        let corners = self.corners.iter().zip(self.weights);
        corners.filter(|(v, _)| inside[**v as usize]).map(|(_, weight)| weight).sum()
    }

    fn nearest_corner(&self) -> u32 {
        let [a, b, c] = self.weights;
        self.corners[if a >= b && a >= c { 0 } else { 1 + usize::from(c > b) }]
    }
}

/// Whether two surfaces reach equally far along their axes, in units of their sizes.
fn are_alike(a: &SurfaceMoments, b: &SurfaceMoments) -> bool {
    let shares = |moments: &SurfaceMoments| moments.deviations.map(|d| d / moments.size());
    let pairs = shares(a).into_iter().zip(shares(b));
    pairs
        .into_iter()
        .all(|(a, b)| (a - b).abs() <= MOST_EXTENT_RATIO * a.max(b) + MOST_EXTENT_DIFFERENCE)
}

/// Positions of an object's samples.
fn positions(object: &PreparedObject) -> Vec<DVec3> {
    let vertices = object.shape().mesh().vertices();
    object.samples().iter().take(N_SAMPLES).map(|&v| vertices[v as usize]).collect()
}

/// Similarities that lay the axes of the target onto those of the source, in every way.
fn by_axes(source: &SurfaceMoments, target: &SurfaceMoments) -> Vec<DAffine3> {
    let scale = source.size() / target.size();
    let [to_source, to_target] =
        [source, target].map(|m| DMat3::from_cols(m.axes[0], m.axes[1], m.axes[2]));
    let mut turns = vec![DMat3::IDENTITY];
    let step = std::f64::consts::PI / N_TURNS as f64;
    let [x, y, z] = source.deviations; // ascending
    if y - x < LIKE_EXTENTS * y {
        turns.extend((1..N_TURNS).map(|i| DMat3::from_rotation_z(step * i as f64)));
    }
    if z - y < LIKE_EXTENTS * z {
        turns.extend((1..N_TURNS).map(|i| DMat3::from_rotation_x(step * i as f64)));
    }
    let mut motions = Vec::new();
    for turn in turns {
        for signs in 0..8 {
            let sign = |bit: i32| if signs & bit == 0 { 1.0 } else { -1.0 };
            let flip = DMat3::from_diagonal(DVec3::new(sign(1), sign(2), sign(4)));
            let linear = to_source * turn * flip * to_target.transpose() * scale;
            motions.push(about(linear, source.centroid, target.centroid));
        }
    }
    motions
}

/// The motion with this linear part that takes one point to the other.
fn about(linear: DMat3, to: DVec3, from: DVec3) -> DAffine3 {
    DAffine3::from_mat3_translation(linear, to - linear * from)
}

/// The similarity that most matches of the samples agree on (Umeyama 1991, mirror images allowed), matches far from it
/// losing their weight round by round; none where it does not exist.
fn from_matches(pair: &Pair, points: &PointMap) -> Option<DAffine3> {
    let source = pair.source.shape().mesh().vertices();
    let target = pair.target.shape().mesh().vertices();
    let chosen = pair.target.samples();
    let from: Vec<DVec3> = chosen.iter().map(|&v| target[v as usize]).collect();
    let to: Vec<DVec3> =
        chosen.iter().map(|&v| source[points.source_of[v as usize] as usize]).collect();
    let mut weights = vec![1.0; from.len()];
    let mut motion = None;
    for _ in 0..N_ROUNDS {
        let found = similarity(&from, &to, &weights)?;
        let residuals: Vec<f64> =
            from.iter().zip(&to).map(|(&p, q)| found.transform_point3(p).distance(*q)).collect();
        let mut sorted = residuals.clone();
        sorted.sort_by(f64::total_cmp);
        let typical = sorted[sorted.len() / 2].max(f64::MIN_POSITIVE);
        // Weights of Geman & McClure 1985.
        weights = residuals.iter().map(|r| (1.0 + (r / typical).powi(2)).powi(-2)).collect();
        motion = Some(found);
    }
    motion.filter(|motion| motion.is_finite())
}

/// s R x + t of least Σ w ‖s R xᵢ + t − yᵢ‖²; R may mirror.
fn similarity(from: &[DVec3], to: &[DVec3], weights: &[f64]) -> Option<DAffine3> {
    let total: f64 = weights.iter().sum();
    let mean =
        |points: &[DVec3]| points.iter().zip(weights).map(|(&p, &w)| w * p).sum::<DVec3>() / total;
    let (x, y) = (mean(from), mean(to));
    let (mut covariance, mut variance) = (Mat::<f64>::zeros(3, 3), 0.0);
    for ((&p, &q), &w) in from.iter().zip(to).zip(weights) {
        let (p, q) = (p - x, q - y);
        variance += w * p.length_squared();
        for i in 0..3 {
            for j in 0..3 {
                covariance[(i, j)] += w * q[i] * p[j];
            }
        }
    }
    let svd = covariance.svd().ok()?;
    let turn = svd.U() * svd.V().transpose();
    let strength: f64 = svd.S().column_vector().iter().sum();
    if !(variance > 0.0 && strength > 0.0) {
        return None;
    }
    let column = |j: usize| DVec3::new(turn[(0, j)], turn[(1, j)], turn[(2, j)]);
    let linear = DMat3::from_cols(column(0), column(1), column(2)) * (strength / variance);
    Some(about(linear, y, x))
}

/// Makes a motion better by steps towards the planes of the nearest triangles:
///
/// min Σ (n · (y + ω × y + σ y + t − q))²,   y = the moved sample, q the nearest point of the source, n its normal,
///
/// with y measured from the middle of the samples.
fn refined(
    source: &PreparedObject,
    surface: &semfm_geom::SurfaceIndex,
    motion: DAffine3,
    samples: &[DVec3],
) -> DAffine3 {
    let mesh = source.shape().surface();
    let mut motion = motion;
    for _ in 0..N_STEPS {
        let moved: Vec<DVec3> = samples.iter().map(|&p| motion.transform_point3(p)).collect();
        let middle = moved.iter().sum::<DVec3>() / moved.len() as f64;
        let size = (moved.iter().map(|p| p.distance_squared(middle)).sum::<f64>()
            / moved.len() as f64)
            .sqrt();
        let mut hits: Vec<(DVec3, SurfacePoint)> =
            moved.iter().filter_map(|&p| surface.closest(p).map(|hit| (p, hit))).collect();
        hits.sort_by(|a, b| a.1.distance.total_cmp(&b.1.distance));
        hits.truncate((NEAREST_SHARE * samples.len() as f64).ceil() as usize);
        let mut normal = Mat::<f64>::zeros(7, 7);
        let mut right = Mat::<f64>::zeros(7, 1);
        for (p, hit) in &hits {
            let n = mesh.face_normal_scaled(hit.face as usize).normalize_or_zero();
            let y = (*p - middle) / size;
            let (turn, grow) = (y.cross(n), y.dot(n));
            let row = [turn.x, turn.y, turn.z, n.x, n.y, n.z, grow];
            let off = n.dot(hit.point - *p) / size;
            for (i, a) in row.iter().enumerate() {
                right[(i, 0)] += a * off;
                row.iter().enumerate().for_each(|(j, b)| normal[(i, j)] += a * b);
            }
        }
        (0..7).for_each(|i| normal[(i, i)] += DAMPING * hits.len() as f64);
        let Ok(factor) = normal.llt(faer::Side::Lower) else { return motion };
        let step = factor.solve(&right);
        let entry = |i: usize| step[(i, 0)];
        let turn = DVec3::new(entry(0), entry(1), entry(2));
        let shift = size * DVec3::new(entry(3), entry(4), entry(5));
        let linear = DMat3::from_axis_angle(turn.normalize_or(DVec3::X), turn.length())
            * entry(6).clamp(-0.5, 0.5).exp();
        motion = about(linear, middle + shift, middle) * motion;
    }
    motion
}

fn judged(
    surface: &semfm_geom::SurfaceIndex,
    source_from_target: DAffine3,
    samples: &[DVec3],
) -> Candidate {
    let moved = samples.iter().map(|&p| source_from_target.transform_point3(p));
    let mut distances: Vec<f64> = moved.map(|p| distance(surface, p)).collect();
    distances.sort_by(f64::total_cmp);
    distances.truncate((NEAREST_SHARE * samples.len() as f64).ceil() as usize);
    let residual = distances.iter().sum::<f64>() / distances.len() as f64;
    Candidate { source_from_target, residual }
}

fn distance(surface: &semfm_geom::SurfaceIndex, p: DVec3) -> f64 {
    surface.closest(p).map_or(f64::INFINITY, |hit| hit.distance)
}

/// Mean squared distance between the features of the target's points and those of the source's points where they come
/// to lie, in the joint space.
fn disagreement(pair: &Pair, source_from_target: DAffine3) -> f64 {
    let (on_source, on_target) = (&pair.joint.source, &pair.joint.target);
    let points = pair.target.cloud().points();
    let mut sum = 0.0;
    let step = points.len().div_ceil(N_COMPARED).max(1);
    let compared = points.iter().enumerate().step_by(step);
    let n = compared.len();
    for (j, &p) in compared {
        let i = pair.source.nearest_point(source_from_target.transform_point3(p));
        let both = on_source.row(i).iter().zip(on_target.row(j).iter());
        sum += both.map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
    }
    sum / n as f64
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use semfm_geom::{Mesh, SemanticCloud, Task};

    use super::*;
    use crate::TransferSettings;
    use crate::stages::Stages;
    use crate::test_objects::{blob, cloud, shape};

    const TOLERANCE: f64 = 0.004;

    /// The mesh with the features that a mesh of the same vertices has.
    fn prepared(mesh: &Mesh, like: &Mesh) -> PreparedObject {
        let features = cloud(like, 1.0, 0.5).features().to_vec();
        let points: Vec<DVec3> = mesh.vertices().iter().step_by(3).copied().collect();
        let n = points.len();
        let cloud = SemanticCloud::new(points, features, 5, vec![1; n]).unwrap();
        let (shape, cloud) = (Arc::new(shape(mesh, 10)), Arc::new(cloud));
        PreparedObject::new(shape, cloud, &Task::default()).unwrap()
    }

    fn moved(mesh: &Mesh, motion: DAffine3) -> Mesh {
        let vertices = mesh.vertices().iter().map(|&p| motion.transform_point3(p));
        let turned_over = |[a, b, c]: [u32; 3]| [a, c, b];
        let mirrored = motion.matrix3.determinant() < 0.0;
        let faces = mesh.faces().iter().map(|&f| if mirrored { turned_over(f) } else { f });
        Mesh::new(vertices.collect(), faces.collect()).unwrap()
    }

    fn congruence(source: &Mesh, target: &Mesh, source_of: Vec<u32>) -> Option<Congruence> {
        let (a, b) = (prepared(source, source), prepared(target, source));
        let settings = TransferSettings::default();
        let pair = Pair::new(&a, &b, &settings, &mut Stages::default()).unwrap();
        Congruence::of(&pair, &PointMap { source_of }, TOLERANCE).unwrap()
    }

    #[test]
    fn a_moved_a_scaled_and_a_mirrored_copy_get_the_region_vertex_by_vertex() {
        let mesh = blob(1.0);
        let n = mesh.n_vertices() as u32;
        let turn = DMat3::from_rotation_x(0.4) * DMat3::from_rotation_z(2.0);
        let mirror = DMat3::from_diagonal(DVec3::new(1.0, -1.0, 1.0));
        for linear in [DMat3::IDENTITY, turn, turn * 5.0, turn * mirror * 0.2] {
            let copy = moved(&mesh, DAffine3::from_mat3_translation(linear, DVec3::splat(3.0)));
            // With matches that are right and with matches that say nothing.
            for source_of in [(0..n).collect::<Vec<u32>>(), vec![0; n as usize]] {
                let found = congruence(&mesh, &copy, source_of).unwrap();
                let inside: Vec<bool> = mesh.vertices().iter().map(|p| p.x > 0.3).collect();
                let mut weights = vec![0.5; inside.len()];
                found.mixed_into(&mut weights, &inside);
                for (weight, inside) in weights.iter().zip(inside) {
                    assert!((weight - f64::from(u8::from(inside))).abs() < 1e-3, "{weight}");
                }
                let (a, b) = (prepared(&mesh, &mesh), prepared(&copy, &mesh));
                let mut points = PointMap { source_of: vec![0; n as usize] };
                found.correct(&mut points, &a, &b);
                assert!(points.source_of.iter().enumerate().all(|(v, &u)| v == u as usize));
            }
        }
    }

    #[test]
    fn another_shape_is_not_the_same_though_it_is_as_long() {
        let mesh = blob(1.0);
        let identity: Vec<u32> = (0..mesh.n_vertices() as u32).collect();
        assert!(congruence(&mesh, &blob(1.5), identity.clone()).is_none());
        // Long waves, no noise.
        let wavy = mesh.vertices().iter().map(|&p| p * (1.0 + 0.05 * (2.0 * p.x + p.z).sin()));
        let wavy = Mesh::new(wavy.collect(), mesh.faces().to_vec()).unwrap();
        assert!(congruence(&mesh, &wavy, identity).is_none());
    }

    #[test]
    fn where_a_symmetric_object_leaves_several_places_the_vote_stays() {
        // An ellipsoid lies on itself in eight ways, and features that are symmetric, too, tell none of them apart.
        let ball = semfm_geom::zoo::icosphere(3);
        let vertices = ball.vertices().iter().map(|&p| p * DVec3::new(1.0, 0.7, 0.4));
        let mesh = Mesh::new(vertices.collect(), ball.faces().to_vec()).unwrap();
        let plain = || {
            let points = mesh.vertices().to_vec();
            let n = points.len();
            let features = points.iter().flat_map(|p| p.abs().as_vec3().to_array()).collect();
            let cloud = SemanticCloud::new(points, features, 3, vec![1; n]).unwrap();
            let shape = Arc::new(shape(&mesh, 10));
            PreparedObject::new(shape, Arc::new(cloud), &Task::default()).unwrap()
        };
        let settings = TransferSettings::default();
        let (a, b) = (plain(), plain());
        let pair = Pair::new(&a, &b, &settings, &mut Stages::default()).unwrap();
        let n = mesh.n_vertices() as u32;
        let points = PointMap { source_of: (0..n).collect() };
        let found = Congruence::of(&pair, &points, TOLERANCE).unwrap().unwrap();
        let mixed = |inside: &dyn Fn(DVec3) -> bool| {
            let inside: Vec<bool> = mesh.vertices().iter().map(|&p| inside(p)).collect();
            let mut weights = vec![0.3; inside.len()];
            found.mixed_into(&mut weights, &inside);
            weights
        };
        let one_end = mixed(&|p| p.x > 0.4);
        let both_ends = mixed(&|p| p.x.abs() > 0.4);
        for (v, p) in mesh.vertices().iter().enumerate() {
            if p.x.abs() > 0.5 {
                assert_eq!(one_end[v], 0.3, "{p}: either end may be the one");
                assert!(both_ends[v] > 0.99, "{p}: {}", both_ends[v]);
            }
        }
    }
}
