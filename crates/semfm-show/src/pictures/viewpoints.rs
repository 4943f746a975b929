//! From where results are looked at: upright, where the region shows, and both objects of a pair
//! from the same side.

use faer::{Mat, Side};
use semfm::Region;
use semfm::geom::math::{DMat3, DQuat, DVec3};
use semfm::geom::{Mesh, Pinhole, Task};
use semfm::views::rig::{camera_towards, fibonacci_directions};
use semfm::views::{Paint, RenderSettings, RigSettings, render};

use super::upright::{Upright, upright};
use crate::Result;

/// Side of the small pictures that the viewpoints are chosen by, and how many there are.
const SCOUT: u32 = 96;
const N_SCOUTS: usize = 36;
/// The second viewpoint looks from at least this far round (cosine): nearer shows the same again,
/// farther leaves too few to choose from.
const OTHER_SIDE: f64 = 0.3;
/// Correlation of matched points from which on a point map tells how the target is turned, where
/// nothing else does and where both objects stand. Maps between objects of one kind reached .45 to .87,
/// a mug's map to a bench .34.
const FAIR_TURN: f64 = 0.6;
const GOOD_TURN: f64 = 0.8;
/// The same where both objects stand and only the heading is asked for: one angle needs less.
const FAIR_HEADING: f64 = 0.5;
/// Distance of a region from an object's middle, as a share of the object's reach, from which on it
/// tells the heading: a handle, not a rim.
const OFF_CENTRE: f64 = 0.3;

/// An object's two best sides.
#[derive(Clone, Copy, Debug)]
pub struct Sides {
    /// From where the region shows best.
    pub best: Pinhole,
    /// The best view from another side.
    pub other: Pinhole,
    /// How the object stands: z up, x to the right and y away from the eye of the best side.
    pub upright_from_object: DMat3,
}

/// From where the region shows the most pixels, and the best view from another side; both for
/// pictures of `side` pixels. Sides from a little above are preferred.
///
/// # Errors
/// Whatever rendering reports.
pub fn viewpoints(mesh: &Mesh, weights: &[f64], side: u32, task: &Task) -> Result<Sides> {
    viewpoints_around(upright(mesh)?.up, mesh, weights, side, task)
}

/// The same with a given way up.
pub(super) fn viewpoints_around(
    up: DVec3,
    mesh: &Mesh,
    weights: &[f64],
    side: u32,
    task: &Task,
) -> Result<Sides> {
    let directions = directions_around(up);
    let shares = visible(mesh, weights, &directions, task)?;
    let scores: Vec<f64> = shares.iter().map(|share| share.region + 0.15 * share.object).collect();
    Sides::new(mesh, &directions, two_best(&directions, &scores), side)
}

/// The same for a pair whose target vertex `j` is matched to the source vertex `source_of[j]`: both
/// objects from the same two sides as far as the map tells how the target is turned, each from its own
/// two best sides where it does not.
///
/// # Errors
/// Whatever rendering reports.
pub fn paired_viewpoints(
    source: (&Mesh, &[f64]),
    target: (&Mesh, &[f64]),
    source_of: &[u32],
    side: u32,
    task: &Task,
) -> Result<[Sides; 2]> {
    let ups = [upright(source.0)?, upright(target.0)?];
    let Some(turn) = turn_of_pair(source, target, source_of, ups) else {
        return Ok([
            viewpoints_around(ups[0].up, source.0, source.1, side, task)?,
            viewpoints_around(ups[1].up, target.0, target.1, side, task)?,
        ]);
    };
    let on_source = directions_around(ups[0].up);
    let on_target: Vec<Direction> =
        on_source.iter().map(|direction| direction.turned(turn)).collect();
    let from_source = visible(source.0, source.1, &on_source, task)?;
    let from_target = visible(target.0, target.1, &on_target, task)?;
    let scores: Vec<f64> = from_source
        .iter()
        .zip(&from_target)
        .map(|(a, b)| (a.region * b.region).sqrt() + 0.08 * (a.object + b.object))
        .collect();
    let chosen = two_best(&on_source, &scores);
    Ok([
        Sides::new(source.0, &on_source, chosen, side)?,
        Sides::new(target.0, &on_target, chosen, side)?,
    ])
}

impl Sides {
    fn new(mesh: &Mesh, directions: &[Direction], chosen: [usize; 2], size: u32) -> Result<Self> {
        let [best, other] = chosen.map(|i| directions[i]);
        let right = best.up.cross(best.towards_eye);
        let right = right.try_normalize().unwrap_or_else(|| best.up.any_orthonormal_vector());
        let upright_from_object =
            DMat3::from_cols(right, best.up.cross(right), best.up).transpose();
        let (best, other) = (towards(mesh, &best, size)?, towards(mesh, &other, size)?);
        Ok(Self { best, other, upright_from_object })
    }
}

/// A side to look from.
#[derive(Clone, Copy)]
struct Direction {
    /// From the object to the eye.
    towards_eye: DVec3,
    up: DVec3,
}

impl Direction {
    fn turned(self, turn: DMat3) -> Self {
        Self { towards_eye: turn * self.towards_eye, up: turn * self.up }
    }

    /// How natural it is to look from there: people look down on things a little.
    fn ease(self) -> f64 {
        match self.towards_eye.dot(self.up).asin().to_degrees() {
            elevation if elevation > 55.0 => 0.75,
            elevation if elevation > 10.0 => 1.0,
            elevation if elevation > -5.0 => 0.9,
            elevation if elevation > -35.0 => 0.7,
            _ => 0.5,
        }
    }
}

fn directions_around(up: DVec3) -> Vec<Direction> {
    let x = up.any_orthonormal_vector();
    let object_from_upright = DMat3::from_cols(x, up.cross(x), up);
    fibonacci_directions(N_SCOUTS)
        .map(|direction| Direction { towards_eye: object_from_upright * direction, up })
        .collect()
}

fn towards(mesh: &Mesh, direction: &Direction, size: u32) -> Result<Pinhole> {
    let settings = RigSettings { size, ..Default::default() };
    Ok(camera_towards(mesh, direction.towards_eye, direction.up, &settings)?)
}

/// What a direction shows, as a share of what the best one shows, times its ease.
struct Visible {
    region: f64,
    object: f64,
}

fn visible(
    mesh: &Mesh,
    weights: &[f64],
    directions: &[Direction],
    task: &Task,
) -> Result<Vec<Visible>> {
    let cameras: Vec<Pinhole> =
        directions.iter().map(|d| towards(mesh, d, SCOUT)).collect::<Result<_>>()?;
    let views = render(mesh, &Paint::default(), &cameras, &RenderSettings::default(), task)?;
    let inside =
        |face: usize| mesh.faces()[face].iter().any(|&v| weights[v as usize] >= Region::COUNTS);
    let counts: Vec<[usize; 2]> = views
        .iter()
        .map(|view| {
            let faces = view.triangles.iter().filter_map(|&t| usize::try_from(t).ok());
            [faces.clone().filter(|&face| inside(face)).count(), faces.count()]
        })
        .collect();
    let most = [0, 1].map(|k| counts.iter().map(|count| count[k]).max().unwrap_or(0).max(1) as f64);
    Ok(counts
        .iter()
        .zip(directions)
        .map(|(count, direction)| {
            let [region, object] = [0, 1].map(|k| count[k] as f64 / most[k] * direction.ease());
            Visible { region, object }
        })
        .collect())
}

/// The best direction and the best of those far enough round; the first of equals.
fn two_best(directions: &[Direction], scores: &[f64]) -> [usize; 2] {
    let best_of = |candidates: &mut dyn Iterator<Item = usize>| {
        candidates.fold(None, |best: Option<usize>, i| match best {
            Some(b) if scores[b] >= scores[i] => Some(b),
            _ => Some(i),
        })
    };
    let best = best_of(&mut (0..scores.len())).unwrap_or(0);
    let eye = |i: usize| directions[i].towards_eye;
    let mut others = (0..scores.len()).filter(|&i| eye(i).dot(eye(best)) < OTHER_SIDE);
    [best, best_of(&mut others).unwrap_or(best)]
}

/// `target_from_source` of directions. A good map says all of it. Where both objects stand, up goes to
/// up, and a fair map says the heading; where it cannot, the side on which the region lies does. Where
/// one does not stand, a fair map must do.
fn turn_of_pair(
    source: (&Mesh, &[f64]),
    target: (&Mesh, &[f64]),
    source_of: &[u32],
    [on_source, on_target]: [Upright; 2],
) -> Option<DMat3> {
    let stand = on_source.is_sure && on_target.is_sure;
    let least = if stand { GOOD_TURN } else { FAIR_TURN };
    let by_map = target_from_source(source.0, target.0, source_of);
    let by_map = by_map.filter(|&(_, correlation)| correlation >= least);
    if by_map.is_some() || !stand {
        return by_map.map(|(turn, _)| turn);
    }
    let flat = |up: DVec3| {
        let x = up.any_orthonormal_vector();
        DMat3::from_cols(x, up.cross(x), up).transpose()
    };
    let (flat_source, flat_target) = (flat(on_source.up), flat(on_target.up));
    let with_heading =
        |angle: f64| flat_target.transpose() * DMat3::from_rotation_z(angle) * flat_source;
    // The least squares angle between matched points seen from above.
    let (p, q) = (matched(source.0, source_of), target.0.vertices());
    let (middle_p, middle_q) = (mean(&p), mean(q));
    let (mut along, mut across, mut spread) = (0.0, 0.0, [0.0; 2]);
    for (&p, &q) in p.iter().zip(q) {
        let (p, q) = (flat_source * (p - middle_p), flat_target * (q - middle_q));
        along += p.x * q.x + p.y * q.y;
        across += p.x * q.y - p.y * q.x;
        spread = [spread[0] + p.x * p.x + p.y * p.y, spread[1] + q.x * q.x + q.y * q.y];
    }
    if along.hypot(across) > FAIR_HEADING * (spread[0] * spread[1]).sqrt() {
        return Some(with_heading(across.atan2(along)));
    }
    let heading = |(mesh, weights): (&Mesh, &[f64]), flat: DMat3| {
        let inside = mesh.vertices().iter().zip(weights).filter(|(_, w)| **w >= Region::COUNTS);
        let inside: Vec<DVec3> = inside.map(|(&p, _)| p).collect();
        if inside.is_empty() {
            return None;
        }
        let middle = mean(mesh.vertices());
        let reach = mesh.vertices().iter().map(|&p| (flat * (p - middle)).truncate().length());
        let reach = reach.fold(0.0, f64::max);
        let towards = (flat * (mean(&inside) - middle)).truncate();
        (towards.length() > OFF_CENTRE * reach).then(|| towards.y.atan2(towards.x))
    };
    let (from, to) = (heading(source, flat_source)?, heading(target, flat_target)?);
    Some(with_heading(to - from))
}

fn matched(source: &Mesh, source_of: &[u32]) -> Vec<DVec3> {
    source_of.iter().map(|&v| source.vertices()[v as usize]).collect()
}

fn mean(points: &[DVec3]) -> DVec3 {
    points.iter().sum::<DVec3>() / points.len().max(1) as f64
}

/// The rotation that brings the source's matched points nearest to the target's (Horn 1987, unit
/// quaternions), and how well they correlate then.
fn target_from_source(source: &Mesh, target: &Mesh, source_of: &[u32]) -> Option<(DMat3, f64)> {
    let (matched, found) = (matched(source, source_of), target.vertices());
    let (mean_source, mean_target) = (mean(&matched), mean(found));
    let mut s = [[0.0; 3]; 3];
    let (mut spread_source, mut spread_target) = (0.0, 0.0);
    for (&p, &q) in matched.iter().zip(found) {
        let (p, q) = (p - mean_source, q - mean_target);
        spread_source += p.length_squared();
        spread_target += q.length_squared();
        for (row, a) in s.iter_mut().zip(p.to_array()) {
            row.iter_mut().zip(q.to_array()).for_each(|(cell, b)| *cell += a * b);
        }
    }
    let scale = (spread_source * spread_target).sqrt();
    if !(scale > 0.0 && scale.is_finite()) {
        return None;
    }
    let [[xx, xy, xz], [yx, yy, yz], [zx, zy, zz]] = s.map(|row| row.map(|x| x / scale));
    let lower = [
        [xx + yy + zz, 0.0, 0.0, 0.0],
        [yz - zy, xx - yy - zz, 0.0, 0.0],
        [zx - xz, xy + yx, yy - xx - zz, 0.0],
        [xy - yx, zx + xz, yz + zy, zz - xx - yy],
    ];
    let eigen = Mat::from_fn(4, 4, |i, j| lower[i][j]).self_adjoint_eigen(Side::Lower).ok()?;
    // Ascending: the last is the largest, and equals the correlation after the turn.
    let correlation = eigen.S().column_vector()[3];
    let [w, x, y, z] = [0, 1, 2, 3].map(|i| eigen.U()[(i, 3)]);
    Some((DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize()), correlation))
}

#[cfg(test)]
mod tests {
    use semfm::geom::zoo;

    use super::super::upright::tests::turned;
    use super::*;

    #[test]
    fn a_turned_copy_is_seen_from_the_same_sides() {
        let mesh = zoo::torus(24, 12);
        let turn = DMat3::from_rotation_x(1.1) * DMat3::from_rotation_z(0.4);
        let copy = turned(&mesh, turn);
        let weights: Vec<f64> =
            mesh.vertices().iter().map(|p| if p.x > 1.0 { 1.0 } else { 0.0 }).collect();
        let identity: Vec<u32> = (0..mesh.n_vertices() as u32).collect();
        let (found, correlation) = target_from_source(&mesh, &copy, &identity).unwrap();
        assert!(
            (correlation - 1.0).abs() < 1e-12
                && (found - turn).to_cols_array().iter().all(|x| x.abs() < 1e-9)
        );
        let task = Task::default();
        let [source, target] =
            paired_viewpoints((&mesh, &weights), (&copy, &weights), &identity, 64, &task).unwrap();
        for (a, b) in [
            (source.best.camera_from_world().matrix3, target.best.camera_from_world().matrix3),
            (source.other.camera_from_world().matrix3, target.other.camera_from_world().matrix3),
            (source.upright_from_object, target.upright_from_object),
        ] {
            assert!((b * turn - a).to_cols_array().iter().all(|x| x.abs() < 1e-9));
        }
        // The eye of the best side looks along +y, and x is to the right of its picture.
        let upright_from_camera =
            source.upright_from_object * source.best.camera_from_world().matrix3.transpose();
        assert!(upright_from_camera.z_axis.y > 0.0 && upright_from_camera.x_axis.x > 0.999);
    }

    #[test]
    fn a_map_of_nonsense_turns_nothing() {
        let mesh = zoo::torus(24, 12);
        let n = mesh.n_vertices() as u32;
        let nonsense: Vec<u32> = (0..n).map(|v| v * 7919 % n).collect();
        assert!(target_from_source(&mesh, &mesh, &nonsense).unwrap().1 < FAIR_TURN);
    }
}
