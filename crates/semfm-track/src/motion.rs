//! Rigid motions of the inner frame, as similarities of scale 1.

use nalgebra::{SMatrix, SVector};
use semfm_align::Sim3;
use semfm_geom::math::{DAffine3, DMat3, DQuat, DVec3};

/// A small motion: shift (metres), then rotation vector (radians), both along the camera's axes, about the object's middle.
pub(crate) type Twist = SVector<f64, 6>;

/// Of twists.
pub(crate) type Matrix6 = SMatrix<f64, 6, 6>;

/// A pose moved by a twist: its middle is shifted, the object turns about it.
pub(crate) fn moved(pose: &Sim3, twist: &Twist) -> Sim3 {
    let shift = DVec3::new(twist[0], twist[1], twist[2]);
    let turn = DQuat::from_scaled_axis(DVec3::new(twist[3], twist[4], twist[5]));
    Sim3 {
        rotation: (turn * pose.rotation).normalize(),
        translation: pose.translation + shift,
        ..*pose
    }
}

/// The twist that leads from one pose to another.
pub(crate) fn twist_between(from: &Sim3, to: &Sim3) -> Twist {
    let shift = to.translation - from.translation;
    let mut turn = (to.rotation * from.rotation.conjugate()).normalize();
    if turn.w < 0.0 {
        turn = -turn;
    }
    let turn = turn.to_scaled_axis();
    Twist::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z)
}

/// A rotation and a shift as a similarity of scale 1.
pub(crate) fn rigid(motion: &DAffine3) -> Sim3 {
    let rotation = DQuat::from_mat3(&motion.matrix3).normalize();
    Sim3 { scale: 1.0, rotation, translation: motion.translation }
}

/// The same pose of the mesh's frame: `camera_from_object` with the scale, from that of the inner frame.
pub(crate) fn of_mesh(camera_from_inner: &Sim3, scale: f64, centre: DVec3) -> Sim3 {
    let Sim3 { rotation, translation, .. } = *camera_from_inner;
    Sim3 { scale, rotation, translation: translation - scale * (rotation * centre) }
}

/// Undoes [`of_mesh`].
pub(crate) fn of_inner(camera_from_object: &Sim3, centre: DVec3) -> Sim3 {
    let translation = camera_from_object.apply(centre);
    Sim3 { scale: 1.0, translation, ..*camera_from_object }
}

/// The covariance of a motion about the mesh's own origin, from that about the object's middle. With o the origin as seen
/// from the middle, in the camera's axes, the origin moves by v + ω × o:
///
/// > C' = T C Tᵀ,  T = [[I, −[o]×], [0, I]]
pub(crate) fn covariance_about_origin(covariance: &Matrix6, origin: DVec3) -> Matrix6 {
    let DVec3 { x, y, z } = origin;
    let mut t = Matrix6::identity();
    let cross = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]];
    for (i, row) in cross.iter().enumerate() {
        for (j, value) in row.iter().enumerate() {
            t[(i, 3 + j)] = -value;
        }
    }
    t * covariance * t.transpose()
}

/// A rotation as a matrix, for loops.
pub(crate) fn matrix(pose: &Sim3) -> DMat3 {
    DMat3::from_quat(pose.rotation)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose() -> Sim3 {
        Sim3 {
            scale: 1.0,
            rotation: DQuat::from_axis_angle(DVec3::new(0.3, -1.0, 0.2).normalize(), 0.8),
            translation: DVec3::new(0.1, -0.2, 0.7),
        }
    }

    #[test]
    fn a_twist_is_found_again_and_the_meshes_frame_comes_back() {
        let twist = Twist::new(0.01, -0.02, 0.03, 0.2, 0.1, -0.4);
        assert!((twist_between(&pose(), &moved(&pose(), &twist)) - twist).norm() < 1e-12);
        let centre = DVec3::new(5.0, -1.0, 2.0);
        let object = of_mesh(&pose(), 0.02, centre);
        assert!(object.apply(centre).distance(pose().translation) < 1e-12);
        assert!((twist_between(&of_inner(&object, centre), &pose())).norm() < 1e-12);
    }

    #[test]
    fn an_uncertain_turn_moves_the_origin_across_the_lever() {
        let mut covariance = Matrix6::zeros();
        covariance[(5, 5)] = 0.04; // 0.2 rad about z
        let found = covariance_about_origin(&covariance, DVec3::new(0.5, 0.0, 0.0));
        // The origin moves along y by 0.5 · 0.2.
        assert!((found[(1, 1)] - 0.01).abs() < 1e-12 && found[(0, 0)].abs() < 1e-12);
        assert!((found[(1, 5)] - 0.02).abs() < 1e-12);
    }
}
