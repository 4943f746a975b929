//! One pose made better: point to plane, from the observed points to the model and never back,
//! under a kernel that narrows (Zhou, Park & Koltun, *Fast Global Registration*, 2016: graduated
//! non-convexity with the Geman–McClure kernel).

use nalgebra::SMatrix;
use semfm_geom::math::DVec3;

use crate::correspondence::{Correspondence, NearestBy, Problem};
use crate::kernel::geman_mcclure;
use crate::sim3::{Sim3, Tangent};

pub(crate) type Matrix7 = SMatrix<f64, 7, 7>;

/// One step may turn by this many radians, move by this many radii of the object and change the
/// scale by this logarithm: the matches are only good for so far.
const LONGEST: f64 = 0.35;

/// Damping in shares of the mean diagonal of the normal matrix. What the points do not determine
/// stays as it is; weak but real directions have far more curvature than this, and more damping
/// would slow them down.
const DAMPING: f64 = 1e-6;

/// Stiffness along a direction that is held, in shares of the trace of the normal matrix.
const HOLDING: f64 = 1e6;

/// A pose after one step.
pub(crate) struct Step {
    pub pose: Sim3,
    /// Of the step before it was shortened: the greatest of radians, radii and logarithm.
    pub length: f64,
}

impl Problem<'_> {
    /// The step from given matches; none is taken along the directions (unit) that are held. `None`
    /// where nothing matches.
    ///
    /// With residuals rᵢ, their derivatives Jᵢ and weights wᵢ = geman_mcclure(dᵢ²) · agreementᵢ, a
    /// damped Gauss–Newton step s (Levenberg 1944) with the held directions h solves
    ///
    /// > (A + λI + μ Σ h hᵀ) s = −g,  A = Σ wᵢ Jᵢ Jᵢᵀ,  g = Σ wᵢ rᵢ Jᵢ
    ///
    /// where λ = 10⁻⁶ tr A / 7 and μ = 10⁶ tr A.
    pub fn gauss_newton_step(
        &self,
        pose: &Sim3,
        correspondences: &[Correspondence],
        width: f64,
        held: &[Tangent],
    ) -> Option<Step> {
        // The upper triangle of A row by row, 28 numbers, and g.
        let (mut a, mut g, mut total) = ([0.0f64; 28], [0.0f64; 7], 0.0);
        for correspondence in correspondences {
            let Correspondence { residual, jacobian, squared, agreement } = correspondence;
            let weight = geman_mcclure(*squared, width) * agreement;
            total += weight;
            let mut slot = 0;
            for (i, g) in g.iter_mut().enumerate() {
                let scaled = weight * jacobian[i];
                *g += scaled * residual;
                for j in i..7 {
                    a[slot] += scaled * jacobian[j];
                    slot += 1;
                }
            }
        }
        if total <= 0.0 {
            return None;
        }
        let normal = symmetric(&a);
        let damping = DAMPING * normal.trace() / 7.0;
        let mut damped = normal + Matrix7::identity() * damping;
        for direction in held {
            damped += direction * direction.transpose() * (HOLDING * normal.trace());
        }
        let step = -damped.cholesky()?.solve(&Tangent::from_column_slice(&g));
        let turn = DVec3::new(step[0], step[1], step[2]);
        let shift = DVec3::new(step[3], step[4], step[5]);
        let length = turn.length().max(shift.length()).max(step[6].abs());
        let shorten = (LONGEST / length).min(1.0);
        let low = (self.scales[0] / pose.scale).ln();
        let high = (self.scales[1] / pose.scale).ln();
        let growth = (shorten * step[6]).clamp(low.min(high), high);
        let moved = pose.moved_within(shorten * turn, shorten * shift, growth);
        moved.translation.is_finite().then_some(Step { pose: moved, length })
    }

    /// Steps under a kernel that narrows geometrically from the first of `widths` to the second,
    /// metres, none of them along the directions (unit) that are held. `None` where nothing matches.
    ///
    /// > σᵢ = σ₀ (σₙ₋₁/σ₀)^(i/(n − 1))
    pub fn anneal(
        &self,
        start: Sim3,
        ids: &[u32],
        widths: [f64; 2],
        n_steps: usize,
        nearest_by: NearestBy,
        held: &[Tangent],
    ) -> Option<Sim3> {
        let [from, to] = widths;
        let mut pose = start;
        let mut correspondences = Vec::with_capacity(ids.len());
        for i in 0..n_steps {
            let width = from * (to / from).powf(i as f64 / (n_steps.max(2) - 1) as f64);
            correspondences.clear();
            self.for_each_correspondence(&pose, ids, width, nearest_by, |c| {
                correspondences.push(c);
            });
            pose = self.gauss_newton_step(&pose, &correspondences, width, held)?.pose;
        }
        Some(pose)
    }
}

/// The symmetric matrix whose upper triangle is given row by row.
fn symmetric(upper: &[f64; 28]) -> Matrix7 {
    let mut matrix = Matrix7::zeros();
    let mut slot = 0;
    for i in 0..7 {
        for j in i..7 {
            (matrix[(i, j)], matrix[(j, i)]) = (upper[slot], upper[slot]);
            slot += 1;
        }
    }
    matrix
}

#[cfg(test)]
mod tests {
    use semfm_geom::math::DQuat;
    use semfm_geom::{Task, zoo};

    use super::*;
    use crate::model::AlignModel;
    use crate::observed_cloud::ObservedCloud;

    /// An ellipsoid of half axes 8, 12 and 20 with all its sides observed.
    fn observed_from(pose: &Sim3) -> (AlignModel, ObservedCloud) {
        let mesh = zoo::icosphere(3);
        let stretched = mesh.vertices().iter().map(|&p| p * DVec3::new(8.0, 12.0, 20.0)).collect();
        let mesh = semfm_geom::Mesh::new(stretched, mesh.faces().to_vec()).unwrap();
        let points: Vec<DVec3> = mesh.vertices().iter().map(|&p| pose.apply(p)).collect();
        let model = AlignModel::new(&mesh, 0, &Task::default()).unwrap();
        (model, ObservedCloud::from_many_views(&points).unwrap())
    }

    #[test]
    fn a_small_motion_is_undone_and_a_held_direction_is_not_left() {
        let truth = Sim3 { scale: 0.01, ..Sim3::IDENTITY };
        let (model, observed) = observed_from(&truth);
        let problem = Problem { model: &model, observed: &observed, scales: [0.01, 1.0] };
        let unit = truth * model.object_from_unit;
        let off = Sim3 { rotation: DQuat::from_rotation_z(0.03), ..unit };
        let ids = observed.subset(600);
        let found = problem.anneal(off, &ids, [0.05, 0.02], 6, NearestBy::Triangles, &[]).unwrap();
        assert!(found.rotation.angle_between(unit.rotation) < 2e-3);
        let mut correspondences = Vec::new();
        problem.for_each_correspondence(&off, &ids, 0.05, NearestBy::Triangles, |c| {
            correspondences.push(c);
        });
        let mut about_z = Tangent::zeros();
        about_z[2] = 1.0;
        let held = problem.gauss_newton_step(&off, &correspondences, 0.05, &[about_z]).unwrap();
        assert!(held.pose.rotation.to_scaled_axis().z - 0.03 < 1e-5);
        assert!(problem.gauss_newton_step(&off, &[], 0.05, &[]).is_none());
    }
}
