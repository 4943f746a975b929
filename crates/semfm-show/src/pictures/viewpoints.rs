//! From where results are looked at: upright, where the region shows, and both objects of a pair
//! from the same side.

use semfm::Region;
use semfm::geom::math::{DMat3, DVec3};
use semfm::geom::sampling::fibonacci_directions;
use semfm::geom::{Mesh, Pinhole, Task};
use semfm::upright::upright;
use semfm::views::{RigSettings, camera_towards, triangle_ids};

use super::pair_rotation::{Standing, WeightedMesh, pair_rotation};
use crate::Result;

/// Side of the small pictures that the viewpoints are chosen by, and how many there are.
const SMALL_SIDE: u32 = 96;
const N_DIRECTIONS: usize = 36;
/// The second viewpoint looks from at least this far round (cosine): nearer shows the same again,
/// farther leaves too few to choose from.
const OTHER_SIDE: f64 = 0.3;

/// An object's two best viewpoints.
#[derive(Clone, Copy, Debug)]
pub struct Viewpoints {
    /// From where the region shows best.
    pub best: Pinhole,
    /// The best view from another side.
    pub other: Pinhole,
    /// How the object stands: z up, x to the right and y away from the eye of the best viewpoint.
    pub upright_from_object: DMat3,
}

/// From where the region shows the most pixels, and the best view from another side; both for
/// pictures of `side` pixels. Views from a little above are preferred. `weights` has one weight per
/// vertex.
///
/// # Errors
/// [`Error::Semfm`](crate::Error::Semfm) for a mesh that cannot be rendered, and where the task was
/// cancelled.
pub fn viewpoints(mesh: &Mesh, weights: &[f64], side: u32, task: &Task) -> Result<Viewpoints> {
    viewpoints_around(upright(mesh)?.up, WeightedMesh { mesh, weights }, side, task)
}

/// The same with a given way up.
pub(crate) fn viewpoints_around(
    up: DVec3,
    object: WeightedMesh<'_>,
    side: u32,
    task: &Task,
) -> Result<Viewpoints> {
    let directions = directions_around(up);
    let shares = visible(object, &directions, task)?;
    let scores: Vec<f64> = shares.iter().map(|share| share.region + 0.15 * share.object).collect();
    Viewpoints::new(object.mesh, &directions, best_two(&directions, &scores), side)
}

/// The same for a pair.
pub(crate) struct PairedViewpoints {
    pub source: Viewpoints,
    pub target: Viewpoints,
}

/// An object that is looked at.
#[derive(Clone, Copy)]
pub(crate) struct Seen<'a> {
    pub object: WeightedMesh<'a>,
    /// What is counted in its place, where only shares of pixels matter: itself or a simpler mesh of it.
    pub counted: WeightedMesh<'a>,
}

impl<'a> From<WeightedMesh<'a>> for Seen<'a> {
    fn from(object: WeightedMesh<'a>) -> Self {
        Self { object, counted: object }
    }
}

/// Viewpoints of a pair whose target vertex `j` is matched to the source vertex `source_of[j]`: both
/// objects from the same two sides as far as the map tells how the target is turned, each from its own
/// two best sides where it does not.
///
/// # Errors
/// As [`viewpoints`].
pub(crate) fn paired_viewpoints(
    source_seen: Seen<'_>,
    target_seen: Seen<'_>,
    source_of: &[u32],
    side: u32,
    task: &Task,
) -> Result<PairedViewpoints> {
    let (source, target) = (source_seen.object, target_seen.object);
    let standing_source = Standing { object: source, upright: upright(source.mesh)? };
    let standing_target = Standing { object: target, upright: upright(target.mesh)? };
    let source_up = standing_source.upright.up;
    let Some(turn) = pair_rotation(standing_source, standing_target, source_of) else {
        return Ok(PairedViewpoints {
            source: viewpoints_around(source_up, source, side, task)?,
            target: viewpoints_around(standing_target.upright.up, target, side, task)?,
        });
    };
    let on_source = directions_around(source_up);
    let on_target: Vec<Direction> =
        on_source.iter().map(|direction| direction.turned(turn)).collect();
    let (from_source, from_target) = rayon::join(
        || visible(source_seen.counted, &on_source, task),
        || visible(target_seen.counted, &on_target, task),
    );
    let (from_source, from_target) = (from_source?, from_target?);
    let scores: Vec<f64> = from_source
        .iter()
        .zip(&from_target)
        .map(|(a, b)| (a.region * b.region).sqrt() + 0.08 * (a.object + b.object))
        .collect();
    let chosen = best_two(&on_source, &scores);
    Ok(PairedViewpoints {
        source: Viewpoints::new(source.mesh, &on_source, chosen, side)?,
        target: Viewpoints::new(target.mesh, &on_target, chosen, side)?,
    })
}

impl Viewpoints {
    fn new(mesh: &Mesh, directions: &[Direction], chosen: [usize; 2], size: u32) -> Result<Self> {
        let [best, other] = chosen.map(|i| directions[i]);
        let right = best.up.cross(best.towards_eye);
        let right = right.try_normalize().unwrap_or_else(|| best.up.any_orthonormal_vector());
        let upright_from_object =
            DMat3::from_cols(right, best.up.cross(right), best.up).transpose();
        let (best, other) = (best.camera(mesh, size)?, other.camera(mesh, size)?);
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
    fn preference(self) -> f64 {
        match self.towards_eye.dot(self.up).asin().to_degrees() {
            elevation if elevation > 55.0 => 0.75,
            elevation if elevation > 10.0 => 1.0,
            elevation if elevation > -5.0 => 0.9,
            elevation if elevation > -35.0 => 0.7,
            _ => 0.5,
        }
    }

    fn camera(&self, mesh: &Mesh, size: u32) -> Result<Pinhole> {
        let settings = RigSettings { size, ..Default::default() };
        Ok(camera_towards(mesh, self.towards_eye, self.up, &settings)?)
    }
}

fn directions_around(up: DVec3) -> Vec<Direction> {
    let x = up.any_orthonormal_vector();
    let object_from_upright = DMat3::from_cols(x, up.cross(x), up);
    fibonacci_directions(N_DIRECTIONS)
        .map(|direction| Direction { towards_eye: object_from_upright * direction, up })
        .collect()
}

/// What a direction shows, as a share of what the best one shows, times its preference.
struct Visible {
    region: f64,
    object: f64,
}

/// Pixels of the region and of the whole object.
struct PixelCounts {
    region: usize,
    object: usize,
}

impl PixelCounts {
    /// A face belongs to the region where one of its vertices does.
    fn of(triangles: &[i32], WeightedMesh { mesh, weights }: WeightedMesh<'_>) -> Self {
        let faces = triangles.iter().filter_map(|&t| usize::try_from(t).ok());
        let is_inside = |face: &usize| {
            mesh.faces()[*face].iter().any(|&v| weights[v as usize] >= Region::COUNTS)
        };
        Self { region: faces.clone().filter(is_inside).count(), object: faces.count() }
    }
}

fn visible(
    object: WeightedMesh<'_>,
    directions: &[Direction],
    task: &Task,
) -> Result<Vec<Visible>> {
    let cameras: Vec<Pinhole> =
        directions.iter().map(|d| d.camera(object.mesh, SMALL_SIDE)).collect::<Result<_>>()?;
    let views = triangle_ids(object.mesh, &cameras, task)?;
    let counts: Vec<PixelCounts> = views.iter().map(|ids| PixelCounts::of(ids, object)).collect();
    let most_region = counts.iter().map(|count| count.region).max().unwrap_or(0).max(1) as f64;
    let most_object = counts.iter().map(|count| count.object).max().unwrap_or(0).max(1) as f64;
    Ok(counts
        .iter()
        .zip(directions)
        .map(|(count, direction)| Visible {
            region: count.region as f64 / most_region * direction.preference(),
            object: count.object as f64 / most_object * direction.preference(),
        })
        .collect())
}

/// The best direction and the best of those far enough round; the first of equals.
fn best_two(directions: &[Direction], scores: &[f64]) -> [usize; 2] {
    let best = best_of(0..scores.len(), scores).unwrap_or(0);
    let eye = directions[best].towards_eye;
    let others = (0..scores.len()).filter(|&i| directions[i].towards_eye.dot(eye) < OTHER_SIDE);
    [best, best_of(others, scores).unwrap_or(best)]
}

fn best_of(candidates: impl Iterator<Item = usize>, scores: &[f64]) -> Option<usize> {
    candidates.fold(None, |best, i| match best {
        Some(b) if scores[b] >= scores[i] => Some(b),
        _ => Some(i),
    })
}

#[cfg(test)]
mod tests {
    use semfm_geom::zoo;

    use super::super::pair_rotation::tests::turned;
    use super::*;

    #[test]
    fn a_turned_copy_is_seen_from_the_same_sides() {
        let mesh = zoo::torus(24, 12);
        let turn = DMat3::from_rotation_x(1.1) * DMat3::from_rotation_z(0.4);
        let copy = turned(&mesh, turn);
        let weights: Vec<f64> =
            mesh.vertices().iter().map(|p| if p.x > 1.0 { 1.0 } else { 0.0 }).collect();
        let identity: Vec<u32> = (0..mesh.n_vertices() as u32).collect();
        let (original, copy) = (
            WeightedMesh { mesh: &mesh, weights: &weights },
            WeightedMesh { mesh: &copy, weights: &weights },
        );
        let PairedViewpoints { source, target } =
            paired_viewpoints(original.into(), copy.into(), &identity, 64, &Task::default())
                .unwrap();
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
}
