//! Observed points with the places of the model that they are matched to.
//!
//! Every observed point is matched to the model's nearest surface. Matching the other way round,
//! each piece of the model to the observation nearest to it, pulls what the camera could not see
//! onto what it saw, and the scale collapses.

use semfm_geom::math::DMat3;

use crate::extent::order_statistic;
use crate::model::{AlignModel, agreement};
use crate::observed_cloud::ObservedCloud;
use crate::sim3::{Sim3, Tangent};

/// Median distances of normal noise to their standard deviation: 1/Φ⁻¹(¾).
const STD_PER_MEDIAN: f64 = 1.4826;

/// Fewer residuals than this say nothing about the noise.
const FOR_NOISE: usize = 7;

/// How the model's nearest point is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NearestBy {
    /// From the table of samples, up to the width of a cell.
    Table,
    /// On the triangles.
    Triangles,
}

/// The poses of one model in one observation.
#[derive(Clone, Copy)]
pub(crate) struct Problem<'a> {
    pub model: &'a AlignModel,
    pub observed: &'a ObservedCloud,
    /// Least and greatest scale, metres for each radius of the object.
    pub scales: [f64; 2],
}

/// An observed point with its match.
#[derive(Clone, Copy)]
pub(crate) struct Correspondence {
    /// Signed distance to the plane of the match, metres.
    pub residual: f64,
    /// Derivative of the residual by turn, shift and growth of the model, in its inner frame.
    pub jacobian: Tangent,
    /// Distance to the match, squared, square metres.
    pub squared: f64,
    /// How well the normals agree, 0 to 1.
    pub agreement: f64,
}

impl Problem<'_> {
    /// Whether the sign of a normal says nothing: of the model's, where its triangles are wound
    /// anyhow; of the observed ones, where no viewpoint tells the inside of a vessel from its
    /// outside. Matched to the outer wall, points of the inner one would shrink the model.
    pub fn unsigned(&self) -> bool {
        self.model.both_sides || self.observed.all_around()
    }

    /// Calls `visit` with every point that has a match within three widths of the kernel.
    ///
    /// With the pose (k, R, t) and an observed point y: the query q = Rᵀ(y − t)/k in the model's
    /// inner frame, its match p there with the normal n, and
    ///
    /// > r = k · n·(q − p)
    ///
    /// A small motion of the model, turned by ω, moved by v, grown by exp(g), takes p to
    /// p + ω × p + v + g p, so that
    ///
    /// > ∂r/∂(ω, v, g) = −k (p × n, n, n·p)
    pub fn for_each_correspondence(
        &self,
        pose: &Sim3,
        ids: &[u32],
        width: f64,
        nearest_by: NearestBy,
        mut visit: impl FnMut(Correspondence),
    ) {
        let back = DMat3::from_quat(pose.rotation).transpose();
        let k = pose.scale;
        let reach = 3.0 * width / k;
        let unsigned = self.unsigned();
        for &id in ids {
            let query = back * (self.observed.points[id as usize] - pose.translation) / k;
            let facing = back * self.observed.normals[id as usize];
            let found = match nearest_by {
                NearestBy::Table => self.model.closest_sample(query, facing, unsigned),
                NearestBy::Triangles => self.model.closest(query, facing, reach, unsigned),
            };
            let Some(matched) = found else { continue };
            let (point, normal) = (matched.point, matched.normal);
            let offset = query - point;
            let plane = normal.dot(offset);
            let squared = match nearest_by {
                // How far along the surface a sample lies says little.
                NearestBy::Table => {
                    let along =
                        (offset - plane * normal).length() - self.model.nearest.cell_width();
                    plane * plane + along.max(0.0).powi(2)
                }
                NearestBy::Triangles => offset.length_squared(),
            };
            let agreement = agreement(normal, facing, unsigned).max(0.0);
            if squared > reach * reach || agreement <= 0.0 {
                continue;
            }
            let (turn, growth) = (point.cross(normal), normal.dot(point));
            let jacobian = -k
                * Tangent::from_column_slice(&[
                    turn.x, turn.y, turn.z, normal.x, normal.y, normal.z, growth,
                ]);
            let squared = k * k * squared;
            visit(Correspondence { residual: k * plane, jacobian, squared, agreement });
        }
    }
}

/// Standard deviation of the points that lie on the model: 1.4826 times the median distance to
/// their planes, among those matched within `width`. `None` for fewer than seven.
pub(crate) fn noise(correspondences: &[Correspondence], width: f64) -> Option<f64> {
    let near = correspondences.iter().filter(|c| c.squared < width * width);
    let mut residuals: Vec<f64> = near.map(|c| c.residual.abs()).collect();
    if residuals.len() < FOR_NOISE {
        return None;
    }
    let middle = residuals.len() / 2;
    Some(STD_PER_MEDIAN * order_statistic(&mut residuals, middle))
}
