//! Where else a grasp may be as good, if the object is round or symmetric: its images under turns about an axis of
//! revolution, and under half-turns about the principal axes and reflections across them.

use std::f64::consts::{PI, TAU};

use parry3d_f64::glamx::DSymmetricEigen3;
use parry3d_f64::math::Pose;
use semfm_geom::math::{DMat3, DQuat, DVec3};

use crate::candidate::{Candidate, rotation};
use crate::object::{GraspObject, Samples};

/// Turns about the axis of revolution, over a full turn: on the rim of a mug they are 7 mm apart.
const TURNS: usize = 36;

/// Rounds in which points that do not slide are given less weight, for the handle of a mug moves the axis else; and how
/// far off its surface a point moves by a turn of one radian where its weight is halved, metres.
const REWEIGHTED: (usize, f64) = (10, 2e-3);

/// An axis in space: a point and a unit vector, in the object's frame.
#[derive(Clone, Copy, Debug)]
struct Axis {
    point: DVec3,
    direction: DVec3,
}

/// The motions under which an object may be its own image.
///
/// Whether it is, is not asked: an image that is no grasp fails the checks as any other candidate does.
pub(crate) struct LikelySymmetry {
    revolution: Axis,
    /// Through the centre of mass.
    principal: [Axis; 3],
}

impl LikelySymmetry {
    pub(crate) fn of(object: &GraspObject) -> Self {
        let (centre, samples) = (object.centre_of_mass(), object.samples());
        let spread =
            samples.points.iter().fold(DMat3::ZERO, |sum, &p| sum + outer(p - centre, p - centre));
        let principal = eigenvectors(spread).map(|direction| Axis { point: centre, direction });
        Self { revolution: axis_of_revolution(samples, centre), principal }
    }

    /// The images of a candidate under turns about the axis of revolution, over a full turn.
    pub(crate) fn around(&self, candidate: &Candidate, n_turns: usize) -> Vec<Candidate> {
        let turns = (1..n_turns).map(|k| TAU * k as f64 / n_turns as f64);
        let turned = turns.map(|angle| self.revolution.turned(&candidate.tcp, angle));
        turned.map(|tcp| Candidate { tcp, ..*candidate }).collect()
    }

    /// The images of a candidate, itself left out.
    pub(crate) fn images(&self, candidate: &Candidate) -> Vec<Candidate> {
        let tcp = candidate.tcp;
        let around = self.around(candidate, TURNS).into_iter().map(|image| image.tcp);
        let others =
            self.principal.iter().flat_map(|axis| [axis.turned(&tcp, PI), axis.reflected(&tcp)]);
        around.chain(others).map(|tcp| Candidate { tcp, ..*candidate }).collect()
    }
}

impl Axis {
    fn turned(&self, tcp: &Pose, angle: f64) -> Pose {
        let turn = DQuat::from_axis_angle(self.direction, angle);
        let place = self.point + turn * (tcp.translation - self.point);
        Pose::from_parts(place, turn * tcp.rotation)
    }

    /// Across the plane through the point that the axis is normal to; a hand is its own mirror image.
    fn reflected(&self, tcp: &Pose) -> Pose {
        let reflect = |v: DVec3| v - 2.0 * v.dot(self.direction) * self.direction;
        let [closing, approach] = [DVec3::Y, DVec3::Z].map(|v| reflect(tcp.rotation * v));
        let place = self.point + reflect(tcp.translation - self.point);
        Pose::from_parts(place, rotation(closing, approach))
    }
}

/// The axis about which a surface slides along itself as well as can be.
///
/// Under the motion v(p) = a × p + b a point p with the normal n leaves the surface by n · v = a · (p × n) + b · n. The
/// sum of its squares is least, over unit vectors a, for an eigenvector of A − C N⁻¹ Cᵀ with A = Σ (p×n)(p×n)ᵀ,
/// C = Σ (p×n) nᵀ, N = Σ n nᵀ and b = −N⁻¹ Cᵀ a (slippage analysis: Gelfand & Guibas, Shape Segmentation Using Local
/// Slippage Analysis, 2004). The axis passes through a × b.
fn axis_of_revolution(samples: &Samples, centre: DVec3) -> Axis {
    let (rounds, halved) = REWEIGHTED;
    let mut best = (DVec3::Z, DVec3::ZERO);
    let mut is_first = true;
    for _ in 0..rounds {
        let (mut aa, mut an, mut nn) = (DMat3::ZERO, DMat3::ZERO, DMat3::ZERO);
        for (p, &n) in samples.points.iter().zip(&samples.normals) {
            let moment = (*p - centre).cross(n);
            let off = if is_first { 0.0 } else { best.0.dot(moment) + best.1.dot(n) };
            let weight = 1.0 / (1.0 + (off / halved).powi(2));
            aa += outer(moment, moment) * weight;
            an += outer(moment, n) * weight;
            nn += outer(n, n) * weight;
        }
        // A plane has no normals but one: a little of every direction makes N invertible and moves nothing.
        let trace = (nn.x_axis.x + nn.y_axis.y + nn.z_axis.z).max(f64::MIN_POSITIVE);
        let inverse = (nn + DMat3::IDENTITY * (1e-6 * trace)).inverse();
        let direction = eigenvectors(aa - an * inverse * an.transpose())[0];
        best = (direction, -(inverse * (an.transpose() * direction)));
        is_first = false;
    }
    let (direction, shift) = best;
    let point = centre + direction.cross(shift);
    if point.is_finite() { Axis { point, direction } } else { Axis { point: centre, direction } }
}

/// x yᵀ
fn outer(x: DVec3, y: DVec3) -> DMat3 {
    DMat3::from_cols(x * y.x, x * y.y, x * y.z)
}

/// Unit eigenvectors of a symmetric matrix, that of the least eigenvalue first.
fn eigenvectors(matrix: DMat3) -> [DVec3; 3] {
    let largest = [matrix.x_axis, matrix.y_axis, matrix.z_axis]
        .map(|column| column.abs().max_element())
        .into_iter()
        .fold(f64::MIN_POSITIVE, f64::max);
    let frame = DSymmetricEigen3::new(matrix * (1.0 / largest)).eigenvectors;
    let given = [DVec3::X, DVec3::Y, DVec3::Z];
    let found = [frame.x_axis, frame.y_axis, frame.z_axis];
    std::array::from_fn(|k| found[k].try_normalize().unwrap_or(given[k]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_meshes::{cuboid, cylinder, joined, moved};

    fn images_of(object: &GraspObject, tcp: Pose) -> Vec<Pose> {
        let candidate = Candidate { tcp, seed: [-0.01, 0.01] };
        LikelySymmetry::of(object).images(&candidate).iter().map(|image| image.tcp).collect()
    }

    #[test]
    fn images_go_around_a_cylinder() {
        let object = GraspObject::from_mesh(&cylinder(0.03, 0.2, 64), 1.0).unwrap();
        // A pad on the rim of an end, closing along the radius.
        let tcp = Pose::from_parts(DVec3::new(0.03, 0.0, 0.1), rotation(DVec3::X, DVec3::NEG_Z));
        let images = images_of(&object, tcp);
        for k in 0..12 {
            let angle = TAU * (f64::from(k) + 0.5) / 12.0;
            let place = DVec3::new(0.03 * angle.cos(), 0.03 * angle.sin(), 0.1);
            let near = images.iter().filter(|image| image.translation.distance(place) < 4e-3);
            let radial = place.with_z(0.0).normalize();
            assert!(
                near.into_iter().any(|i| (i.rotation * DVec3::Y).dot(radial).abs() > 0.98),
                "{k}"
            );
        }
    }

    #[test]
    fn the_axis_of_a_can_is_found_beside_its_centre_and_in_spite_of_a_handle() {
        let can = moved(&cylinder(0.04, 0.08, 96), |p| p + DVec3::new(0.1, -0.05, 0.02));
        let handle =
            moved(&cuboid(DVec3::new(0.03, 0.01, 0.05)), |p| p + DVec3::new(0.16, -0.05, 0.06));
        let object = GraspObject::from_mesh(&joined(&can, &handle), 1.0).unwrap();
        let Axis { point, direction } = LikelySymmetry::of(&object).revolution;
        assert!(direction.z.abs() > 0.999, "{direction}");
        let on_axis = DVec3::new(0.1, -0.05, point.z);
        assert!((point - on_axis).reject_from_normalized(direction).length() < 1e-3, "{point}");
    }

    #[test]
    fn images_in_the_mirror_are_hands_again() {
        let object = GraspObject::from_mesh(&cuboid(DVec3::new(0.2, 0.1, 0.05)), 1.0).unwrap();
        let tcp = Pose::new(DVec3::new(0.07, 0.01, 0.02), DVec3::new(0.3, -0.2, 0.9));
        let approach = tcp.rotation * DVec3::Z;
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            let place = tcp.translation - 2.0 * tcp.translation.dot(axis) * axis;
            let way = approach - 2.0 * approach.dot(axis) * axis;
            let is_image = |image: &Pose| {
                image.translation.distance(place) < 1e-3
                    && (image.rotation * DVec3::Z).dot(way) > 0.999
            };
            assert!(images_of(&object, tcp).iter().any(is_image), "across {axis}");
        }
    }
}
