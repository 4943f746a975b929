//! Similarity transforms: a rotation, a translation and one scale.

use std::ops::Mul;

use nalgebra::SVector;
use parry3d_f64::math::Pose;
use semfm_geom::math::{DMat3, DQuat, DVec3};

use crate::{Error, Result};

/// A small similarity as seven numbers: rotation vector (radians), shift, logarithm of the scale.
pub(crate) type Tangent = SVector<f64, 7>;

/// How far the rotation part of a given matrix may be from a multiple of a rotation, relative to
/// its scale: matrices printed with six digits pass.
const SIMILARITY_TOLERANCE: f64 = 1e-4;

/// `a_from_b`: takes a point `x` of frame b to `scale · rotation · x + translation` in frame a.
///
/// Products chain by eye: `camera_from_object * object_from_part`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sim3 {
    /// Positive; metres per unit of the mesh, where b is an object and a a camera.
    pub scale: f64,
    /// Unit quaternion.
    pub rotation: DQuat,
    /// In the units of frame a.
    pub translation: DVec3,
}

impl Sim3 {
    /// Nothing moves.
    pub const IDENTITY: Self =
        Self { scale: 1.0, rotation: DQuat::IDENTITY, translation: DVec3::ZERO };

    /// From a 4 × 4 matrix, rows first, points as columns, the scale included.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for numbers that are not finite, a last row other than 0 0 0 1, a
    /// mirror image, or a linear part that is no multiple of a rotation.
    pub fn from_rows(rows: [[f64; 4]; 4]) -> Result<Self> {
        if let Some(x) = rows.iter().flatten().find(|x| !x.is_finite()) {
            return Err(not_a_similarity("finite numbers", x.to_string()));
        }
        if rows[3] != [0.0, 0.0, 0.0, 1.0] {
            let [a, b, c, d] = rows[3];
            return Err(not_a_similarity("a last row of 0 0 0 1", format!("{a} {b} {c} {d}")));
        }
        let [x, y, z] = [0, 1, 2].map(|k| DVec3::new(rows[k][0], rows[k][1], rows[k][2]));
        let linear = DMat3::from_cols(x, y, z).transpose();
        let volume = linear.determinant();
        if volume <= 0.0 {
            let linear = rows[..3].iter().map(|[a, b, c, _]| [a, b, c]).collect::<Vec<_>>();
            let found = format!("determinant {volume} of the rows {linear:?}");
            return Err(not_a_similarity("a rotation times a positive scale", found));
        }
        let scale = volume.cbrt();
        let turn = linear * (1.0 / scale);
        let defect = (turn * turn.transpose() - DMat3::IDENTITY).to_cols_array();
        let worst = defect.iter().fold(0.0f64, |worst, x| worst.max(x.abs()));
        if worst > SIMILARITY_TOLERANCE {
            let linear = rows[..3].iter().map(|[a, b, c, _]| [a, b, c]).collect::<Vec<_>>();
            let found = format!("the rows {linear:?}, {worst:.1e} away from one");
            return Err(not_a_similarity("a rotation times one scale", found));
        }
        let rotation = DQuat::from_mat3(&turn).normalize();
        Ok(Self { scale, rotation, translation: DVec3::new(rows[0][3], rows[1][3], rows[2][3]) })
    }

    /// As a 4 × 4 matrix, rows first, points as columns, the scale included.
    pub fn to_rows(&self) -> [[f64; 4]; 4] {
        let linear = (DMat3::from_quat(self.rotation) * self.scale).transpose();
        let [x, y, z] = [linear.x_axis, linear.y_axis, linear.z_axis];
        let t = self.translation;
        [[x.x, x.y, x.z, t.x], [y.x, y.y, y.z, t.y], [z.x, z.y, z.z, t.z], [0.0, 0.0, 0.0, 1.0]]
    }

    /// Where a point goes.
    pub fn apply(&self, point: DVec3) -> DVec3 {
        self.scale * (self.rotation * point) + self.translation
    }

    /// `b_from_a`.
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.conjugate();
        let scale = 1.0 / self.scale;
        Self { scale, rotation, translation: -scale * (rotation * self.translation) }
    }

    /// The rigid motion that remains once the object is measured in metres: with an
    /// `object_from_tcp` in metres of the scaled object,
    /// `camera_from_tcp = camera_from_object.rigid() * object_from_tcp`.
    pub fn rigid(&self) -> Pose {
        Pose::from_parts(self.translation, self.rotation)
    }

    /// This transform moved a little within its right-hand frame: turned by the rotation vector
    /// `turn`, moved by `shift`, grown by the factor exp(`growth`).
    pub(crate) fn moved_within(&self, turn: DVec3, shift: DVec3, growth: f64) -> Self {
        let small = Self {
            scale: growth.exp(),
            rotation: DQuat::from_scaled_axis(turn),
            translation: shift,
        };
        let moved = *self * small;
        Self { rotation: moved.rotation.normalize(), ..moved }
    }
}

impl Sim3 {
    /// This transform moved along a direction of its right-hand frame, as a screw with growth, so
    /// that a point that stays at first stays for good:
    ///
    /// > a_from_b · exp(distance · direction),  exp(x) = exp(x/64)⁶⁴
    ///
    /// where exp(x/64) is taken to first order in the shift, exactly in rotation and scale.
    pub(crate) fn moved_along(&self, direction: &Tangent, distance: f64) -> Self {
        let [rx, ry, rz, tx, ty, tz] = [0, 1, 2, 3, 4, 5].map(|k| direction[k] * distance / 64.0);
        let (turn, shift) = (DVec3::new(rx, ry, rz), DVec3::new(tx, ty, tz));
        let mut small = Self::IDENTITY.moved_within(turn, shift, direction[6] * distance / 64.0);
        for _ in 0..6 {
            small = small * small;
        }
        let moved = *self * small;
        Self { rotation: moved.rotation.normalize(), ..moved }
    }
}

fn not_a_similarity(expected: &str, found: String) -> Error {
    Error::OutOfRange { what: "4 × 4 matrix", expected: expected.into(), found }
}

impl Mul for Sim3 {
    type Output = Self;

    fn mul(self, right: Self) -> Self {
        Self {
            scale: self.scale * right.scale,
            rotation: self.rotation * right.rotation,
            translation: self.apply(right.translation),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn some() -> Sim3 {
        let rotation = DQuat::from_axis_angle(DVec3::new(1.0, -2.0, 0.5).normalize(), 1.9);
        Sim3 { scale: 0.23, rotation, translation: DVec3::new(0.1, -0.4, 0.9) }
    }

    #[test]
    fn rows_inverse_and_product_agree_on_points() {
        let (a, p) = (some(), DVec3::new(0.3, 0.7, -1.1));
        let back = Sim3::from_rows(a.to_rows()).unwrap();
        assert!(back.apply(p).distance(a.apply(p)) < 1e-15);
        assert!(a.inverse().apply(a.apply(p)).distance(p) < 1e-14);
        let b = a.moved_within(DVec3::new(0.1, 0.2, -0.3), DVec3::X, 0.4);
        assert!((a * b).apply(p).distance(a.apply(b.apply(p))) < 1e-14);
        assert!(Sim3::IDENTITY.moved_within(DVec3::ZERO, DVec3::ZERO, 0.0).apply(p) == p);
    }

    #[test]
    fn the_chain_to_the_gripper_is_one_multiplication() {
        // A grasp is given in metres of the scaled object.
        let camera_from_object = some();
        let object_from_tcp = Pose::from_parts(
            camera_from_object.scale * DVec3::new(0.5, 0.2, 0.1),
            DQuat::from_rotation_x(0.3),
        );
        let camera_from_tcp = camera_from_object.rigid() * object_from_tcp;
        let by_hand = camera_from_object.apply(DVec3::new(0.5, 0.2, 0.1));
        assert!(camera_from_tcp.translation.distance(by_hand) < 1e-15);
    }

    #[test]
    fn growing_out_of_a_corner_leaves_the_corner() {
        let corner = DVec3::new(0.3, -0.4, 0.5);
        let direction =
            Tangent::from_column_slice(&[0.0, 0.0, 0.0, -corner.x, -corner.y, -corner.z, 1.0]);
        let grown = Sim3::IDENTITY.moved_along(&direction, 0.2);
        assert!((grown.scale - 0.2f64.exp()).abs() < 1e-12);
        assert!(grown.apply(corner).distance(corner) < 1e-3);
    }

    #[test]
    fn matrices_that_are_no_similarity_are_refused() {
        let mut mirrored = some().to_rows();
        mirrored[0].iter_mut().take(3).for_each(|x| *x = -*x);
        let mut sheared = some().to_rows();
        sheared[0][1] += 0.1;
        let mut projective = some().to_rows();
        projective[3][0] = 0.1;
        let mut unknown = some().to_rows();
        unknown[1][3] = f64::NAN;
        for (rows, word) in [
            (mirrored, "determinant"),
            (sheared, "away"),
            (projective, "last row"),
            (unknown, "finite"),
        ] {
            let error = Sim3::from_rows(rows).unwrap_err().to_string();
            assert!(error.contains(word), "{error}");
        }
    }
}
