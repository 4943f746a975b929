//! Whether the gripper gets to a grasp and can close there: at rest, on the way in, while closing.

use parry3d_f64::math::Pose;
use semfm_geom::math::DVec3;

use crate::contact::{Closing, TOUCH_GAP};
use crate::gripper_geometry::{GripperGeometry, PosedGripper};
use crate::object::GraspObject;
use crate::rejection::{Reason, Refusal};
use crate::scene::Scene;
use crate::settings::GraspSettings;
use crate::solid::{Convex, Solid};
use semfm_robot::Role;

/// The gripper keeps at least this away from everything but at its pads, metres.
const MARGIN: f64 = TOUCH_GAP / 2.0;

/// Where a fully open gripper hits something, each pad stays this far from the object on the way in,
/// metres: twice what a calibrated arm misses a pose by.
const SLACK: f64 = 5e-3;

/// Fingers on a curved path are swept in steps of at most this change of width, metres.
const CLOSING_STEP: f64 = 4e-3;

/// Parts of the compliance by which a gripper may stay wider where a finger meets the object beside
/// its pad: the pad still touches then, more softly.
const WIDER: [f64; 3] = [0.0, 0.25, 0.5];

/// The same on a noisy surface, in standard deviations of the noise: the mesh has spikes beside the pad, too.
const NOISE_WIDER: [f64; 3] = [1.0, 2.0, 3.0];

/// Distances beyond this are as good as any, metres.
pub(crate) const FAR: f64 = 0.01;

/// Steps and reach of the search for a free pose behind a colliding one, metres.
const BACK_OFF: (f64, usize) = (2e-3, 40);

/// A gripper that fits: how wide when closed and on the way in, and how far from everything.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fit {
    pub(crate) width: f64,
    pub(crate) opening: f64,
    pub(crate) clearance: f64,
}

/// The checks of one gripper against one object in one scene.
pub(crate) struct Collision<'a> {
    object: &'a GraspObject,
    scene: &'a Scene,
    gripper: &'a GripperGeometry,
    settings: &'a GraspSettings,
}

impl<'a> Collision<'a> {
    pub(crate) fn new(
        object: &'a GraspObject,
        scene: &'a Scene,
        gripper: &'a GripperGeometry,
        settings: &'a GraspSettings,
    ) -> Self {
        Self { object, scene, gripper, settings }
    }

    /// The cheap half: whether the gripper, for one of its openings, stays clear of the table.
    pub(crate) fn above_table(&self, closing: &Closing) -> Result<(), Refusal> {
        if self.scene.table().is_none() {
            return Ok(());
        }
        let closed = self.gripper.at(closing.width + 2.0 * TOUCH_GAP);
        let missing = self
            .openings(closing.width)
            .map(|opening| self.below_table(&self.open(opening, &closed), &closing.tcp))
            .fold(f64::INFINITY, f64::min)
            .max(self.below_table(&closed, &closing.tcp));
        Refusal::where_positive(Reason::Table, missing)
    }

    /// Every check against surfaces, for the widest opening that passes them.
    pub(crate) fn fit(&self, closing: &Closing) -> Result<Fit, Refusal> {
        let closed = self.gripper.at(closing.width + 2.0 * TOUCH_GAP);
        let mut failure = Refusal::from(Reason::NoContact);
        for opening in self.openings(closing.width) {
            let open = self.open(opening, &closed);
            match self.fit_open(closing, &open, opening) {
                Ok(fit) => return Ok(fit),
                // What came farthest tells most.
                Err(refused) if refused.reason > failure.reason => failure = refused,
                Err(_) => {}
            }
        }
        Err(failure)
    }

    /// The checks for one opening.
    fn fit_open(
        &self,
        closing: &Closing,
        open: &PosedGripper<'a>,
        opening: f64,
    ) -> Result<Fit, Refusal> {
        let tcp = &closing.tcp;
        Refusal::where_positive(Reason::Table, self.below_table(open, tcp))?;
        self.approach_path(open, tcp)?;
        let width = self.close_fingers(closing, opening)?;
        if self.inside(open, tcp) {
            return Err(Reason::Inside.into());
        }
        let clearance = self.clearance(open, tcp);
        Refusal::where_positive(Reason::Clearance, self.least_clearance() - clearance)?;
        Ok(Fit { width, opening, clearance })
    }

    /// The open gripper from `retreat` behind the grasp up to it.
    fn approach_path(&self, open: &PosedGripper<'_>, tcp: &Pose) -> Result<(), Reason> {
        let behind = *tcp * Pose::from_translation(-DVec3::Z * self.settings.retreat);
        for (_, shape, pose) in open.pieces() {
            let at = *tcp * *pose;
            let path = shape.swept(&(behind * *pose), &at);
            if self.object.obstacle().meets(&path, MARGIN) {
                let there = self.object.obstacle().meets(&shape.at(&at), MARGIN);
                return Err(if there { Reason::Collision } else { Reason::ApproachPath });
            }
            if self.meets_scene(&path) {
                let there = self.meets_scene(&shape.at(&at));
                return Err(if there { Reason::Scene } else { Reason::ApproachPath });
            }
        }
        Ok(())
    }

    /// The fingers from `opening` to contact; returns the width where they stop.
    fn close_fingers(&self, closing: &Closing, opening: f64) -> Result<f64, Reason> {
        let noise = self.object.surface_report().noise;
        let of_noise = NOISE_WIDER.map(|wider| wider * noise);
        let of_pads = WIDER.map(|wider| wider * self.settings.compliance);
        let extras = of_pads.into_iter().chain(of_noise.into_iter().filter(|_| noise > 0.0));
        for extra in extras {
            let width = closing.width + 2.0 * (TOUCH_GAP + extra);
            if width <= opening && self.closes_freely(&closing.tcp, opening, width) {
                return Ok(width);
            }
        }
        Err(Reason::Closing)
    }

    fn closes_freely(&self, tcp: &Pose, opening: f64, width: f64) -> bool {
        let closed = self.gripper.at(width);
        let open = self.open(opening, &closed);
        let middle = self.open((opening + width) / 2.0, &closed);
        let steps = if moves_straight(&open, &middle, &closed) {
            1
        } else {
            ((opening - width) / CLOSING_STEP).ceil().max(1.0) as usize
        };
        if steps == 1 {
            return open.pieces().zip(closed.pieces()).all(|((role, shape, from), (_, _, to))| {
                role == Role::Palm || self.is_free(&shape.swept(&(*tcp * *from), &(*tcp * *to)))
            });
        }
        let places: Vec<PosedGripper<'_>> = (0..=steps)
            .map(|step| opening + step as f64 / steps as f64 * (width - opening))
            .map(|width| self.open(width, &closed))
            .collect();
        open.pieces().enumerate().all(|(piece, (role, shape, _))| {
            let way = || places.iter().map(|place| *tcp * *place.pose(piece));
            role == Role::Palm || self.is_way_free(shape, &way().collect::<Vec<_>>())
        })
    }

    /// Whether nothing stands in the way of a shape from each pose to the next.
    fn is_way_free(&self, shape: &Convex, way: &[Pose]) -> bool {
        let around = shape.around(way);
        let obstacle = self.object.obstacle();
        let near: Vec<u32> = obstacle.near(&around, MARGIN).collect();
        let is_scene_near = self.meets_scene(&around);
        // From the closed end: most of what is in the way is beside the pads.
        let mut steps = way.windows(2).rev().map(|ends| shape.swept(&ends[0], &ends[1]));
        let is_met = |step: &Solid| {
            obstacle.meets_any(near.iter().copied(), step, MARGIN)
                || is_scene_near && self.meets_scene(step)
        };
        near.is_empty() && !is_scene_near || !steps.any(|step| is_met(&step))
    }

    /// Whether a body touches neither object nor scene.
    fn is_free(&self, body: &Solid) -> bool {
        !self.object.obstacle().meets(body, MARGIN) && !self.meets_scene(body)
    }

    /// Nothing was touched, so each piece is wholly inside or wholly outside of anything closed.
    fn inside(&self, open: &PosedGripper<'_>, tcp: &Pose) -> bool {
        open.pieces().any(|(_, shape, pose)| {
            let centre = shape.at(&(*tcp * *pose)).centre();
            self.object.obstacle().encloses(centre)
                || self.scene.obstacles().iter().any(|obstacle| obstacle.encloses(centre))
        })
    }

    /// Distance of the open gripper at the grasp to object, scene and table, at most [`FAR`] or the
    /// asked clearance.
    fn clearance(&self, open: &PosedGripper<'_>, tcp: &Pose) -> f64 {
        let mut least = FAR.max(self.least_clearance());
        for (_, shape, pose) in open.pieces() {
            let solid = shape.at(&(*tcp * *pose));
            least = self.object.obstacle().distance(&solid, least);
            for obstacle in self.scene.obstacles() {
                least = obstacle.distance(&solid, least);
            }
        }
        if let Some(table) = self.scene.table() {
            for (_, shape, pose) in open.pieces() {
                let lowest = shape.lowest(&(*tcp * *pose), table.normal);
                least = least.min(lowest - table.point.dot(table.normal));
            }
        }
        least.max(0.0)
    }

    /// What is asked, and what an uncertain pose asks.
    fn least_clearance(&self) -> f64 {
        self.settings.limits.clearance.max(self.settings.pose_margin)
    }

    /// How far back along the approach the open gripper is free, metres: how much a colliding grasp is
    /// off. The end of the search where it is free nowhere.
    pub(crate) fn back_off(&self, closing: &Closing) -> f64 {
        let closed = self.gripper.at(closing.width + 2.0 * TOUCH_GAP);
        let (step, most) = BACK_OFF;
        let first_free = (1..most).find(|&k| {
            let tcp = closing.tcp * Pose::from_translation(-DVec3::Z * step * k as f64);
            self.openings(closing.width)
                .any(|opening| self.is_free_at(&self.open(opening, &closed), &tcp))
        });
        step * first_free.unwrap_or(most) as f64
    }

    /// Whether the gripper at rest touches neither object nor scene.
    fn is_free_at(&self, gripper: &PosedGripper<'_>, tcp: &Pose) -> bool {
        gripper.pieces().all(|(_, shape, pose)| self.is_free(&shape.at(&(*tcp * *pose))))
    }

    /// Distances between the pads on the way in: fully open, and as little as is safe.
    fn openings(&self, width: f64) -> impl Iterator<Item = f64> {
        let widest = *self.gripper.opening().end();
        let fitted = width + 2.0 * (TOUCH_GAP + SLACK.max(1.2 * self.settings.pose_margin));
        [Some(widest), (fitted < widest - SLACK).then_some(fitted)].into_iter().flatten()
    }

    fn open(&self, opening: f64, closed: &PosedGripper<'a>) -> PosedGripper<'a> {
        self.gripper.at(opening).with_palm_of(closed)
    }

    /// How much deeper than allowed the gripper is in the table, at the grasp or behind it.
    fn below_table(&self, gripper: &PosedGripper<'_>, tcp: &Pose) -> f64 {
        let Some(table) = self.scene.table() else { return f64::NEG_INFINITY };
        let lowest = gripper
            .pieces()
            .map(|(_, shape, pose)| shape.lowest(&(*tcp * *pose), table.normal))
            .fold(f64::INFINITY, f64::min);
        let back = -self.settings.retreat * (tcp.rotation * DVec3::Z).dot(table.normal);
        let height = lowest + back.min(0.0) - table.point.dot(table.normal);
        self.settings.limits.table_clearance.max(self.settings.pose_margin).max(MARGIN) - height
    }

    fn meets_scene(&self, solid: &Solid) -> bool {
        self.scene.obstacles().iter().any(|obstacle| obstacle.meets(solid, MARGIN))
    }
}

/// Whether each piece is half-way between its ends, unturned, when the gripper is half open.
fn moves_straight(
    open: &PosedGripper<'_>,
    middle: &PosedGripper<'_>,
    closed: &PosedGripper<'_>,
) -> bool {
    let ends = open.pieces().zip(closed.pieces());
    middle.pieces().zip(ends).all(|((_, _, m), ((_, _, a), (_, _, b)))| {
        let halfway = a.translation.midpoint(b.translation).distance(m.translation) < 1e-9;
        halfway && a.inv_mul(b).rotation.is_near_identity()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gripper_geometry::BoxGripper;
    use crate::object::Region;
    use crate::test_meshes::{cuboid, joined, moved};
    use semfm_geom::Mesh;

    fn fit(mesh: &Mesh, scene: &Scene, tcp: &Pose) -> Result<Fit, Reason> {
        let settings = GraspSettings::default();
        let object = GraspObject::from_mesh(mesh, 1.0).unwrap();
        let region = Region::new(&object, &vec![1.0; object.n_weights()]).unwrap();
        let gripper = GripperGeometry::from_boxes(&BoxGripper::default()).unwrap();
        let closing =
            crate::contact::close(&object, &region, &gripper, tcp, [-0.015, 0.015], 1.5e-3)
                .unwrap();
        let collision = Collision::new(&object, scene, &gripper, &settings);
        collision.above_table(&closing).map_err(|refusal| refusal.reason)?;
        collision.fit(&closing).map_err(|refusal| refusal.reason)
    }

    /// A bar along x, and the gripper around it, coming from above.
    fn bar() -> (Mesh, Pose) {
        (
            cuboid(DVec3::new(0.2, 0.03, 0.03)),
            Pose::new(DVec3::ZERO, DVec3::X * std::f64::consts::PI),
        )
    }

    fn box_at(size: DVec3, at: DVec3) -> Mesh {
        moved(&cuboid(size), |p| p + at)
    }

    fn table(z: f64) -> Scene {
        Scene::new().with_table(DVec3::Z * z, DVec3::Z).unwrap()
    }

    #[test]
    fn a_bar_is_held_a_touch_wider_than_it_is() {
        let (bar, from_above) = bar();
        let fit = fit(&bar, &Scene::new(), &from_above).unwrap();
        assert!((fit.width - 0.03 - 2.0 * TOUCH_GAP).abs() < 1e-12);
        assert_eq!(fit.opening, 0.08);
        // Palm 45 mm above the middle, bar 15 mm; fingers 25 mm beside it.
        assert!(fit.clearance >= FAR);
    }

    #[test]
    fn what_is_in_the_way_is_named() {
        let (bar, from_above) = bar();
        let knob = DVec3::splat(0.01);
        // A knob where the open finger would be: the gripper comes in less open.
        let beside = joined(&bar, &box_at(knob, DVec3::new(0.0, 0.05, 0.0)));
        let narrow = fit(&beside, &Scene::new(), &from_above).unwrap();
        assert!(narrow.opening < 0.06);
        // Nearer still, and no opening helps.
        let close_by = joined(&bar, &box_at(knob, DVec3::new(0.0, 0.033, 0.02)));
        let refused = fit(&close_by, &Scene::new(), &from_above).unwrap_err();
        assert!(matches!(refused, Reason::Collision | Reason::Closing), "{refused:?}");
        // Above the palm: on the way in.
        let above = joined(&bar, &box_at(knob, DVec3::new(0.0, 0.0, 0.15)));
        assert_eq!(fit(&above, &Scene::new(), &from_above).unwrap_err(), Reason::ApproachPath);
        // A small thing wholly inside of the palm.
        let swallowed = joined(&bar, &box_at(knob / 4.0, DVec3::new(0.0, 0.0, 0.08)));
        assert_eq!(fit(&swallowed, &Scene::new(), &from_above).unwrap_err(), Reason::Collision);
        // The same knobs in the scene.
        let scene = Scene::new().with_mesh(&box_at(knob, DVec3::new(0.0, 0.0, 0.08)));
        assert_eq!(fit(&bar, &scene, &from_above).unwrap_err(), Reason::Scene);
        let cloud = [DVec3::new(0.0, 0.0, 0.05)];
        let fitted =
            fit(&bar, &Scene::new().with_cloud(&[DVec3::Z * 0.03], 0.002).unwrap(), &from_above);
        assert!(fitted.is_ok(), "between bar and palm there is room for a point");
        let scene = Scene::new().with_cloud(&cloud, 0.02).unwrap();
        assert_eq!(fit(&bar, &scene, &from_above).unwrap_err(), Reason::Scene);
        let hall = Scene::new().with_mesh(&cuboid(DVec3::splat(2.0)));
        assert_eq!(fit(&bar, &hall, &from_above).unwrap_err(), Reason::Inside);
    }

    #[test]
    fn a_table_is_kept_clear_of() {
        let (bar, from_above) = bar();
        // Fingertips are 9 mm below the middle of the bar.
        assert!(fit(&bar, &table(-0.015), &from_above).is_ok());
        assert_eq!(fit(&bar, &table(-0.0085), &from_above).unwrap_err(), Reason::Table);
        let from_below = Pose::IDENTITY;
        assert_eq!(fit(&bar, &table(-0.015), &from_below).unwrap_err(), Reason::Table);
    }
}
