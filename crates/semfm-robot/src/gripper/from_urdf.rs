//! A gripper out of a robot description.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use parry3d_f64::math::Pose;
use semfm_geom::math::{DMat3, DQuat, DVec3};

use super::builtin::BuiltinGripper;
use super::finger_pair::{FingerPair, PadGap};
use super::{DriveJoint, Gripper, GripperPart, MAX_SPAN, Motion, Role};
use crate::link_shape::{ConvexPiece, LinkShape, inertia_box};
use crate::robot::Robot;
use crate::urdf::{MeshPaths, RobotDescription};
use crate::{Error, JointKind, Result};

/// Samples of the drive between closed and open: see [`Motion`].
const N_STEPS: usize = 65;

/// Halvings that reach the last bit of a share of the drive's way.
const N_HALVINGS: usize = 60;

/// Pads that are closer than this touch, metres.
const TOUCH: f64 = 1e-9;

/// A known hand's opening that differs by more is another, metres.
const OTHER_OPENING: f64 = 2e-3;

/// Pads whose sides differ by less than this share are the same.
const SAME_PAD: f64 = 0.02;

/// Shapes for collisions of a known hand's pads are larger than the pads by at most this share.
const LARGER_PAD: f64 = 0.25;

/// Cosine of 5°, by which a given TCP's y axis may leave the closing direction.
const COS_TCP: f64 = 0.996;

/// What a description does not say, or says wrongly. The default finds everything by itself.
#[derive(Clone, Debug, Default)]
pub struct GripperSettings {
    /// Names of the two links that bear the pads; by default the pair with the largest pads.
    pub fingers: Option<[String; 2]>,
    /// The link whose frame is the flange: one that is fixed to the palm. By default the palm's
    /// parent where that is fixed to it and has no body (a frame such as `panda_link8`), else the
    /// palm, which is the link that the fingers' joints sit on.
    pub flange: Option<String>,
    /// The TCP in the palm's frame when the pads are as close as they get; by default the middle
    /// between the pads.
    pub palm_from_tcp: Option<Pose>,
    /// The pads' sides along x and z, metres; by default what is found.
    pub pad: Option<[f64; 2]>,
    /// Folders of the packages in `package://NAME/…`.
    pub packages: BTreeMap<String, PathBuf>,
    /// The folder that relative mesh names must not leave, see [`MeshPaths`].
    pub mesh_root: Option<PathBuf>,
}

impl Gripper {
    /// A built-in gripper by name, or one from a URDF file by path.
    ///
    /// # Errors
    /// [`Error::UnknownGripper`] for neither; else those of [`Gripper::from_urdf`]: [`Error::Io`],
    /// [`Error::Urdf`], [`Error::NoGripper`], [`Error::Geom`].
    pub fn open(name_or_path: &str, settings: &GripperSettings) -> Result<Self> {
        let path = Path::new(name_or_path);
        let is_file = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("urdf"))
            || path.components().count() > 1 && path.exists();
        if is_file { Self::from_urdf(path, settings) } else { Self::builtin(name_or_path) }
    }

    /// The gripper of a robot: two fingers that stay parallel while one joint (with its mimics), or
    /// two equal ones, closes them. Its opening, its pads (the flat faces towards each other)
    /// and its TCP come from the geometry of the fingers.
    ///
    /// The parts are the palm with what is fixed on it, and all that the drive moves; arms in
    /// front of it are not included. Meshes are reduced to convex hulls, several where one would
    /// fill a bay. A link whose mesh cannot be read (DAE, missing) takes, in this order: its other
    /// geometry (visual); the boxes of the built-in gripper where the names tell which one it is;
    /// the box of its inertia. [`Gripper::notes`] names each. Where the pads themselves cannot be
    /// read, a known gripper is replaced whole by the built-in one.
    ///
    /// # Errors
    /// [`Error::Io`] and [`Error::Urdf`] for a file that is no sound description or no tree, see
    /// [`RobotDescription::read`]; [`Error::NoGripper`] where no such pair of fingers is found, or
    /// several, or a third finger beside it; [`Error::Geom`] for a mesh file that is broken.
    pub fn from_urdf(path: impl AsRef<Path>, settings: &GripperSettings) -> Result<Self> {
        let path = path.as_ref();
        let description = RobotDescription::read(path)?;
        let robot = description.tree()?;
        let mut paths = MeshPaths::new(path, &settings.packages);
        if let Some(root) = &settings.mesh_root {
            paths = paths.within(root);
        }
        let loader = Loader { path, robot: &robot, settings };
        let shapes = loader.shapes(&paths)?;
        match loader.finger_pair(&shapes) {
            Ok(fingers) => loader.gripper(&fingers, &shapes),
            Err(error) => loader.replaced_whole(&shapes, error),
        }
    }
}

struct Loader<'a> {
    path: &'a Path,
    robot: &'a Robot,
    settings: &'a GripperSettings,
}

/// The gripper at one width.
struct DriveSample {
    width: f64,
    /// Of the drive's way.
    share: f64,
    palm_from_tcp: Pose,
    palm_from_link: Vec<Pose>,
}

/// What became of the links' shapes.
#[derive(Default)]
struct Parts {
    parts: Vec<GripperPart>,
    notes: Vec<String>,
    /// Roles that lost a link, whose built-in boxes take its place.
    replaced: Vec<Role>,
}

impl Loader<'_> {
    fn no_gripper(&self, expected: impl Into<String>, found: impl Into<String>) -> Error {
        let (expected, found) = (expected.into(), found.into());
        Error::NoGripper { path: self.path.to_owned(), expected, found }
    }

    fn link(&self, name: &str) -> Result<usize> {
        self.robot.link(name).ok_or_else(|| {
            let found = format!("{} others", self.robot.links.len());
            self.no_gripper(format!("a link `{name}`"), found)
        })
    }

    fn name_of(&self, link: usize) -> &str {
        &self.robot.links[link].name
    }

    /// Shapes of the links that a small joint group may move or carry: arms are read too, since
    /// which links are fingers is known only afterwards.
    fn shapes(&self, paths: &MeshPaths) -> Result<Vec<LinkShape>> {
        let mut shapes = Vec::new();
        for (link, near) in self.robot.links.iter().zip(self.near_fingers()) {
            let shape = if near { LinkShape::new(link, paths) } else { Ok(LinkShape::default()) };
            // A path that is refused was reported under the mesh's name; the description names it.
            shapes.push(shape.map_err(|error| match error {
                Error::Urdf { code, place, expected, found, .. } => {
                    Error::Urdf { path: self.path.to_owned(), code, place, expected, found }
                }
                other => other,
            })?);
        }
        Ok(shapes)
    }

    /// Links on bodies with two or more moving joints on them, and all behind those joints.
    fn near_fingers(&self) -> Vec<bool> {
        let robot = self.robot;
        let bodies = robot.bodies();
        let mut n_joints = vec![0; robot.links.len()];
        for joint in robot.joints.iter().filter(|joint| joint.kind.has_position()) {
            n_joints[bodies[joint.parent]] += 1;
        }
        let mut near: Vec<bool> = bodies.iter().map(|&body| n_joints[body] >= 2).collect();
        for joint in &robot.joints {
            near[joint.child] |= near[joint.parent];
        }
        near
    }

    fn finger_pair(&self, shapes: &[LinkShape]) -> Result<FingerPair> {
        let only = match &self.settings.fingers {
            Some([a, b]) => Some([self.link(a)?, self.link(b)?]),
            None => None,
        };
        let Some(found) = FingerPair::find(self.robot, shapes, only) else {
            let (links, joints) = (self.robot.links.len(), self.robot.joints.len());
            let expected =
                "a robot in which each pair of joints can be tried, or the fingers' names";
            return Err(self.no_gripper(expected, format!("{links} links and {joints} joints")));
        };
        let Some(best) = found.first() else {
            let expected = "two fingers with flat pads that stay parallel and close on each other (suction cups \
                            and hands of three or more fingers are not covered)";
            let found = format!("no such pair{}", self.joints_without_range());
            return Err(self.no_gripper(expected, found));
        };
        let bodies = self.robot.bodies();
        if let Some(other) = found.iter().find(|pair| bodies[pair.palm] != bodies[best.palm]) {
            let [a, b] = best.fingers.map(|link| self.name_of(link));
            let [c, d] = other.fingers.map(|link| self.name_of(link));
            let found = format!("`{a}` and `{b}`; `{c}` and `{d}`");
            return Err(self.no_gripper("one pair of fingers, or to be told which", found));
        }
        let third = best.third_finger(self.robot, shapes).filter(|_| only.is_none());
        if let Some(third) = third.map(|link| self.name_of(link)) {
            let [a, b] = best.fingers.map(|link| self.name_of(link));
            let expected =
                "two fingers (hands of three or more are not covered), or to be told which two";
            let found = format!("`{a}` and `{b}`, and beside them `{third}`");
            return Err(self.no_gripper(expected, found));
        }
        Ok(best.clone())
    }

    /// The joints that could drive fingers and lack limits, or have equal ones, in words; empty
    /// without any.
    fn joints_without_range(&self) -> String {
        let names: Vec<String> = self
            .robot
            .joints
            .iter()
            .filter(|joint| {
                let may_drive = matches!(joint.kind, JointKind::Prismatic | JointKind::Revolute);
                let has_range = joint.limits.position.is_some_and(|[low, high]| low < high);
                may_drive && joint.mimic.is_none() && !has_range
            })
            .map(|joint| format!("`{}`", joint.name))
            .take(4)
            .collect();
        if names.is_empty() {
            return String::new();
        }
        let names = names.join(", ");
        format!("; {names}: no range of motion (`<limit lower=… upper=…>`), which a drive needs")
    }

    /// Refuses fingers farther apart than any hand opens, before anything is made for them.
    fn check_span(&self, fingers: &FingerPair) -> Result<()> {
        let widest = self.gap(fingers, 0.0).max(self.gap(fingers, 1.0));
        if widest <= MAX_SPAN {
            return Ok(());
        }
        let drive: Vec<String> = fingers
            .drive
            .joints
            .iter()
            .map(|driven| {
                let name = &self.robot.joints[driven.joint].name;
                format!("`{name}` from {} to {}", driven.from, driven.to)
            })
            .collect();
        let expected = format!(
            "fingers that open at most {MAX_SPAN} m (lengths are metres; are the limits, the \
             origins or the meshes in millimetres?)"
        );
        Err(self.no_gripper(expected, format!("{widest:.3e} m with joint {}", drive.join(", "))))
    }

    fn gripper(&self, fingers: &FingerPair, shapes: &[LinkShape]) -> Result<Gripper> {
        self.check_span(fingers)?;
        let samples = self.drive_samples(fingers)?;
        let flange = self.flange(fingers)?;
        let flange_link = self.name_of(flange).to_owned();
        let palm_poses = fingers.drive.poses(self.robot, fingers.palm, 0.0);
        let flange_from_palm = palm_poses[flange].inverse();
        let Parts { mut parts, mut notes, replaced } = self.parts(fingers, shapes, &samples)?;
        parts.extend(self.builtin_parts(&replaced)?);
        let opening = match (samples.first(), samples.last()) {
            (Some(closed), Some(open)) => closed.width..=open.width,
            _ => 0.0..=0.0,
        };
        let flange = by_width(&samples, |sample| flange_from_palm * sample.palm_from_tcp);
        let pad = self.pad(fingers, &opening, &mut notes)?;
        let gripper = Gripper::new(&self.robot.name, opening, pad, flange, parts).map_err(
            |error| match error {
                Error::OutOfRange { what, expected, found } => {
                    self.no_gripper(format!("{what}: {expected}"), found)
                }
                other => other,
            },
        )?;
        let joints = fingers
            .drive
            .joints
            .iter()
            .filter_map(|driven| {
                let name = &self.robot.joints[driven.joint].name;
                DriveJoint::new(name, samples.iter().map(|s| (s.width, driven.at(s.share))))
            })
            .collect();
        Ok(Gripper { notes, joints, flange_link, ..gripper })
    }

    /// The pads' sides: as told, else as found. Where the names tell a known hand and what was found holds its pads
    /// (boxes for collisions are often larger), they are the known ones; where its opening differs, that is noted.
    fn pad(
        &self,
        fingers: &FingerPair,
        opening: &RangeInclusive<f64>,
        notes: &mut Vec<String>,
    ) -> Result<[f64; 2]> {
        let found = fingers.pad;
        if let Some(pad) = self.settings.pad {
            return Ok(pad);
        }
        let Some(row) = self.known_gripper() else { return Ok(found) };
        let known = row.gripper()?;
        let millimetres = |[x, z]: [f64; 2]| format!("{:.1} × {:.1} mm", 1e3 * x, 1e3 * z);
        let (here, there) = (opening.end(), known.opening.end());
        if (here - there).abs() > OTHER_OPENING {
            notes.push(format!(
                "opens to {:.1} mm as described; `{}` opens to {:.1} mm ({})",
                1e3 * here,
                row.name,
                1e3 * there,
                row.source
            ));
        }
        let excess = [0, 1].map(|i| found[i] / known.pad[i] - 1.0);
        let holds = excess.iter().all(|share| (-SAME_PAD..=LARGER_PAD).contains(share));
        if !holds || excess.iter().all(|share| share.abs() <= SAME_PAD) {
            return Ok(found);
        }
        notes.push(format!(
            "pads of {} as in `{}`, not the {} of its shapes for collisions",
            millimetres(known.pad),
            row.name,
            millimetres(found)
        ));
        Ok(known.pad)
    }

    /// The convex pieces of the gripper's links, and what stands in for those that cannot be read.
    fn parts(
        &self,
        fingers: &FingerPair,
        shapes: &[LinkShape],
        samples: &[DriveSample],
    ) -> Result<Parts> {
        let mut found = Parts::default();
        for link in self.gripper_links(fingers, shapes) {
            let (shape, body) = (&shapes[link], &self.robot.links[link]);
            let role = self.role(link, shape, fingers, samples);
            let mut pieces = shape.pieces.clone();
            if shape.from_visuals && !shape.pieces.is_empty() {
                let note = format!("link `{}`: its visuals stand in for collisions", body.name);
                found.notes.push(note);
            }
            if !shape.missing.is_empty() {
                let missing = shape.missing.join(", ");
                if let Some(known) = self.known_gripper() {
                    let (link, known) = (&body.name, known.name);
                    found
                        .notes
                        .push(format!("link `{link}`: {missing}; boxes of `{known}` instead"));
                    found.replaced.push(role);
                    continue;
                }
                let Some(piece) = inertia_box(&body.inertial) else {
                    let expected =
                        format!("a mesh, a visual or an inertia of link `{}`", body.name);
                    return Err(self.no_gripper(expected, missing));
                };
                let note = format!("link `{}`: {missing}; box of its inertia instead", body.name);
                found.notes.push(note);
                pieces.push(piece);
            }
            for ConvexPiece { link_from_piece, shape } in pieces {
                let motion = by_width(samples, |sample| {
                    sample.palm_from_tcp.inverse() * sample.palm_from_link[link] * link_from_piece
                });
                found.parts.push(GripperPart::new(&body.name, role, shape, motion));
            }
        }
        Ok(found)
    }

    /// The drive sampled from closed to open, with the TCP between the pads.
    fn drive_samples(&self, fingers: &FingerPair) -> Result<Vec<DriveSample>> {
        let (mut closed, open) = match self.gap(fingers, 0.0) < self.gap(fingers, 1.0) {
            true => (0.0, 1.0),
            false => (1.0, 0.0),
        };
        if self.gap(fingers, open) <= 0.0 {
            return Err(self.no_gripper("fingers that open", "pads that overlap all the way"));
        }
        if self.gap(fingers, closed) < 0.0 {
            let (mut inside, mut outside) = (closed, open);
            for _ in 0..N_HALVINGS {
                let middle = (inside + outside) / 2.0;
                if self.gap(fingers, middle) < 0.0 {
                    inside = middle;
                } else {
                    outside = middle;
                }
            }
            closed = outside;
        }
        let mut samples: Vec<DriveSample> = Vec::with_capacity(N_STEPS);
        let mut first_middle = None;
        for step in 0..N_STEPS {
            let share = closed + (open - closed) * step as f64 / (N_STEPS - 1) as f64;
            let palm_from_link = fingers.drive.poses(self.robot, fingers.palm, share);
            let PadGap { width, middle } = fingers.pads_at(self.robot, &palm_from_link);
            let width = if step == 0 && width < TOUCH { 0.0 } else { width };
            if samples.last().is_some_and(|last| width <= last.width) {
                let expected = "fingers that only open on their way";
                return Err(self.no_gripper(expected, "some that turn back"));
            }
            let first = *first_middle.get_or_insert(middle);
            let palm_from_tcp = match self.settings.palm_from_tcp {
                Some(given) => {
                    self.check_tcp(given, fingers)?;
                    Pose::from_translation(middle - first) * given
                }
                None => Pose::from_parts(middle, axes(fingers.closing, fingers.approach)),
            };
            samples.push(DriveSample { width, share, palm_from_tcp, palm_from_link });
        }
        Ok(samples)
    }

    /// Distance between the pads at a share of the drive's way.
    fn gap(&self, fingers: &FingerPair, share: f64) -> f64 {
        let poses = fingers.drive.poses(self.robot, fingers.palm, share);
        fingers.pads_at(self.robot, &poses).width
    }

    /// A TCP from the caller must close along y as the fingers do.
    fn check_tcp(&self, given: Pose, fingers: &FingerPair) -> Result<()> {
        let along = (given.rotation * DVec3::Y).dot(fingers.closing).abs();
        if along < COS_TCP {
            let expected = "a TCP whose y axis is the closing direction within 5°";
            let found = format!("{:.1}°", along.min(1.0).acos().to_degrees());
            return Err(self.no_gripper(expected, found));
        }
        Ok(())
    }

    /// The palm's frame, or the one in the settings, which must be fixed to the palm.
    fn flange(&self, fingers: &FingerPair) -> Result<usize> {
        if let Some(name) = &self.settings.flange {
            let link = self.link(name)?;
            let bodies = self.robot.bodies();
            if bodies[link] != bodies[fingers.palm] {
                let palm = self.name_of(fingers.palm);
                let expected = format!("a flange that is fixed to the palm `{palm}`");
                return Err(self.no_gripper(expected, format!("`{name}`")));
            }
            return Ok(link);
        }
        let above = self.robot.joint_to(fingers.palm).map(|joint| &self.robot.joints[joint]);
        Ok(match above {
            Some(joint) if !joint.kind.has_position() && self.is_bare(joint.parent) => joint.parent,
            _ => fingers.palm,
        })
    }

    fn is_bare(&self, link: usize) -> bool {
        let link = &self.robot.links[link];
        link.collisions.is_empty() && link.visuals.is_empty()
    }

    /// The palm with what is fixed on it, and the fingers. Where the palm is a bare frame, the
    /// bodies that it is fixed to come in its place.
    fn gripper_links(&self, fingers: &FingerPair, shapes: &[LinkShape]) -> Vec<usize> {
        let robot = self.robot;
        let mut top = fingers.palm;
        while !self.fixed_on(top, fingers).iter().any(|&link| shapes[link].has_any()) {
            match robot.joint_to(top) {
                Some(joint) if !robot.joints[joint].kind.has_position() => {
                    top = robot.joints[joint].parent;
                }
                _ => break,
            }
        }
        let palm = self.fixed_on(top, fingers);
        let fingers = (0..robot.links.len()).filter(|&i| fingers.branches[i].is_some());
        palm.into_iter().chain(fingers).filter(|&link| shapes[link].has_any()).collect()
    }

    /// A link and all that is fixed on it, fingers left out.
    fn fixed_on(&self, top: usize, fingers: &FingerPair) -> Vec<usize> {
        let mut on = vec![false; self.robot.links.len()];
        on[top] = true;
        for joint in self.robot.joints.iter().filter(|joint| !joint.kind.has_position()) {
            on[joint.child] |= on[joint.parent];
        }
        (0..on.len()).filter(|&i| on[i] && fingers.branches[i].is_none()).collect()
    }

    /// By the finger that a link belongs to, or, for further branches of a linkage, by the side
    /// that it is on when open.
    fn role(
        &self,
        link: usize,
        shape: &LinkShape,
        fingers: &FingerPair,
        samples: &[DriveSample],
    ) -> Role {
        let Some(branch) = fingers.branches[link] else { return Role::Palm };
        let Some(open) = samples.last() else { return Role::Palm };
        let y_axis = open.palm_from_tcp.rotation * DVec3::Y;
        let [first, second] =
            fingers.fingers.map(|finger| fingers.branches[finger] == Some(branch));
        // The first finger lies at negative y, unless a given TCP points the other way.
        let (left, right) =
            if y_axis.dot(fingers.closing) > 0.0 { (first, second) } else { (second, first) };
        let tcp_from_link = open.palm_from_tcp.inverse() * open.palm_from_link[link];
        let side: f64 =
            shape.triangles.iter().map(|corners| tcp_from_link.transform_point(corners[0]).y).sum();
        if left || !right && side < 0.0 { Role::Left } else { Role::Right }
    }

    /// The built-in gripper that the names tell.
    fn known_gripper(&self) -> Option<&'static BuiltinGripper> {
        let links = self.robot.links.iter().map(|link| link.name.as_str());
        BuiltinGripper::named_in(links.chain([self.robot.name.as_str()]))
    }

    /// All boxes of the known gripper for the roles that lost a link.
    fn builtin_parts(&self, roles: &[Role]) -> Result<Vec<GripperPart>> {
        match self.known_gripper() {
            Some(known) if !roles.is_empty() => {
                let parts = known.gripper()?.parts.into_iter();
                Ok(parts.filter(|part| roles.contains(&part.role)).collect())
            }
            _ => Ok(Vec::new()),
        }
    }

    /// The built-in gripper, where the pads of a known one cannot be read; else the error.
    fn replaced_whole(&self, shapes: &[LinkShape], error: Error) -> Result<Gripper> {
        let missing: Vec<&str> =
            shapes.iter().flat_map(|shape| &shape.missing).map(String::as_str).collect();
        let Some(known) = self.known_gripper().filter(|_| !missing.is_empty()) else {
            return match (error, missing.first()) {
                (Error::NoGripper { path, expected, found }, Some(first)) => {
                    let n = missing.len();
                    let found = format!("{found}; {n} meshes cannot be read ({first})");
                    Err(Error::NoGripper { path, expected, found })
                }
                (error, _) => Err(error),
            };
        };
        let gripper = known.gripper()?;
        let name = known.name;
        let notes = vec![format!("`{name}` instead of the description: {}", missing.join(", "))];
        Ok(Gripper { notes, ..gripper })
    }
}

/// A pose at each sample's width.
fn by_width(samples: &[DriveSample], pose: impl Fn(&DriveSample) -> Pose) -> Motion {
    Motion::new(samples.iter().map(|sample| (sample.width, pose(sample))))
}

/// The rotation whose y and z are these.
fn axes(closing: DVec3, approach: DVec3) -> DQuat {
    DQuat::from_mat3(&DMat3::from_cols(closing.cross(approach), closing, approach))
}
