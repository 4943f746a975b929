//! One pose made better: point to plane, from the observed points to the model and never back,
//! under a kernel that narrows (Zhou, Park & Koltun, *Fast Global Registration*, 2016: graduated
//! non-convexity with the Geman–McClure kernel).
//!
//! Observed points ask for the model's nearest surface. Asking the other way round, for the
//! observation nearest to each piece of the model, pulls what the camera could not see onto what it
//! saw, and the scale collapses.

use nalgebra::{SMatrix, SVector};
use semfm_geom::math::{DMat3, DVec3};

use crate::model::AlignModel;
use crate::observation::Observation;
use crate::sim3::Sim3;

pub(crate) type Matrix7 = SMatrix<f64, 7, 7>;
pub(crate) type Vector7 = SVector<f64, 7>;

/// One step may turn by this many radians, move by this many radii of the object and change the
/// scale by this logarithm: the matches are only good for so far.
const LONGEST: f64 = 0.35;

/// How the model's nearest point is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Matching {
    /// By table, within a cell.
    Coarse,
    /// On the triangles.
    Exact,
}

/// The poses of one model in one observation.
#[derive(Clone, Copy)]
pub(crate) struct Problem<'a> {
    pub model: &'a AlignModel,
    pub observed: &'a Observation,
    /// Least and greatest scale, metres for each radius of the object.
    pub scales: [f64; 2],
}

/// An observed point with its match.
#[derive(Clone, Copy)]
pub(crate) struct Pull {
    /// Signed distance to the plane of the match, metres.
    pub residual: f64,
    /// Derivative of the residual by turn, shift and growth of the model, in its inner frame.
    pub jacobian: Vector7,
    /// Distance to the match, squared, and how well the normals agree (0 to 1).
    pub squared: f64,
    pub agreement: f64,
}

impl Problem<'_> {
    /// Calls `take` with every point that has a match within three widths of the kernel.
    pub fn pulls(
        &self,
        pose: &Sim3,
        ids: &[u32],
        width: f64,
        matching: Matching,
        mut take: impl FnMut(u32, Pull),
    ) {
        let back = DMat3::from_quat(pose.rotation).transpose();
        let k = pose.scale;
        let reach = 3.0 * width / k;
        for &id in ids {
            let query = back * (self.observed.points[id as usize] - pose.translation) / k;
            let facing = back * self.observed.normals[id as usize];
            let found = match matching {
                Matching::Coarse => self.model.field.nearest(query, facing).map(|id| {
                    let sample = self.model.samples[id];
                    (sample.point, sample.normal)
                }),
                Matching::Exact => self.model.closest(query, facing, reach),
            };
            let Some((point, normal)) = found else { continue };
            let offset = query - point;
            let plane = normal.dot(offset);
            let squared = match matching {
                // How far along the surface a sample lies says little.
                Matching::Coarse => {
                    let along = (offset - plane * normal).length() - self.model.field.cell_width();
                    plane * plane + along.max(0.0).powi(2)
                }
                Matching::Exact => offset.length_squared(),
            };
            let cosine = normal.dot(facing);
            let agreement = if self.model.both_sides { cosine.abs() } else { cosine.max(0.0) };
            if squared > reach * reach || agreement <= 0.0 {
                continue;
            }
            let (turn, growth) = (point.cross(normal), normal.dot(point));
            let jacobian = -k
                * Vector7::from_column_slice(&[
                    turn.x, turn.y, turn.z, normal.x, normal.y, normal.z, growth,
                ]);
            take(id, Pull { residual: k * plane, jacobian, squared: k * k * squared, agreement });
        }
    }

    /// One damped Gauss–Newton step. `None` where nothing matches; else the new pose and how long
    /// the step was, in radians, radii and logarithms.
    pub fn step(
        &self,
        pose: &Sim3,
        ids: &[u32],
        width: f64,
        matching: Matching,
    ) -> Option<(Sim3, f64)> {
        let mut pulls = Vec::with_capacity(ids.len());
        self.pulls(pose, ids, width, matching, |_, pull| pulls.push(pull));
        self.follow(pose, &pulls, width, &[])
    }

    /// The step that given matches ask for; there is none along the directions (unit) that are held.
    pub fn follow(
        &self,
        pose: &Sim3,
        pulls: &[Pull],
        width: f64,
        held: &[Vector7],
    ) -> Option<(Sim3, f64)> {
        let (mut a, mut g, mut total) = ([0.0f64; 28], [0.0f64; 7], 0.0);
        for pull in pulls {
            let weight = geman_mcclure(pull.squared, width) * pull.agreement;
            total += weight;
            let mut slot = 0;
            for (i, g) in g.iter_mut().enumerate() {
                let scaled = weight * pull.jacobian[i];
                *g += scaled * pull.residual;
                for j in i..7 {
                    a[slot] += scaled * pull.jacobian[j];
                    slot += 1;
                }
            }
        }
        if total <= 0.0 {
            return None;
        }
        let mut normal = Matrix7::zeros();
        let mut slot = 0;
        for i in 0..7 {
            for j in i..7 {
                (normal[(i, j)], normal[(j, i)]) = (a[slot], a[slot]);
                slot += 1;
            }
        }
        // What the points do not determine stays as it is (Levenberg 1944). The damping is far below
        // the curvature of weak but real directions, which more would slow down.
        let damping = 1e-6 * normal.trace() / 7.0;
        let mut damped = normal + Matrix7::identity() * damping;
        for direction in held {
            damped += direction * direction.transpose() * (1e6 * normal.trace());
        }
        let step = -damped.cholesky()?.solve(&Vector7::from_column_slice(&g));
        let (turn, shift) =
            (DVec3::new(step[0], step[1], step[2]), DVec3::new(step[3], step[4], step[5]));
        let longest = turn.length().max(shift.length()).max(step[6].abs());
        let shorten = (LONGEST / longest).min(1.0);
        let low = (self.scales[0] / pose.scale).ln();
        let high = (self.scales[1] / pose.scale).ln();
        let growth = (shorten * step[6]).clamp(low.min(high), high);
        let moved = pose.then_within(shorten * turn, shorten * shift, growth);
        moved.translation.is_finite().then_some((moved, longest))
    }

    /// Steps under a kernel that narrows from `from` to `to` metres.
    pub fn anneal(
        &self,
        mut pose: Sim3,
        ids: &[u32],
        [from, to]: [f64; 2],
        n_steps: usize,
        matching: Matching,
    ) -> Option<Sim3> {
        for i in 0..n_steps {
            let width = from * (to / from).powf(i as f64 / (n_steps.max(2) - 1) as f64);
            pose = self.step(&pose, ids, width, matching)?.0;
        }
        Some(pose)
    }
}

/// Weight of a squared residual under the kernel of Geman & McClure (1985).
pub(crate) fn geman_mcclure(squared: f64, width: f64) -> f64 {
    let x = 1.0 + squared / (width * width);
    1.0 / (x * x)
}
