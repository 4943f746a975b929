//! A gripper out of a robot description.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use parry3d_f64::math::Pose;
use semfm_geom::math::{DMat3, DQuat, DVec3};

use super::jaws::{Jaws, body_of};
use super::solids::{LinkShape, inertia_box};
use super::{DriveJoint, Gripper, GripperPart, Motion, Role};
use crate::urdf::{Description, JointKind, MeshPaths, Robot};
use crate::{Error, Result};

/// Samples of the drive between closed and open: see [`Motion`].
const N_STEPS: usize = 65;

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
    /// A built-in hand by name, or one from a URDF file by path.
    ///
    /// # Errors
    /// [`Error::UnknownGripper`] for neither; else as [`Gripper::from_urdf`].
    pub fn open(name_or_path: &str, settings: &GripperSettings) -> Result<Self> {
        let path = Path::new(name_or_path);
        let is_file = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("urdf"))
            || path.components().count() > 1 && path.exists();
        if is_file { Self::from_urdf(path, settings) } else { Self::builtin(name_or_path) }
    }

    /// The gripper of a robot: two fingers that stay parallel while one joint (with its mimics), or
    /// two equal ones, closes them. Its opening, its pads (the flat faces that look at each other)
    /// and its TCP come from the geometry of the fingers.
    ///
    /// The parts are the palm with what is fixed on it, and all that the drive moves; arms in
    /// front of it are not included. Meshes are reduced to convex hulls, several where one would
    /// fill a bay. A link whose mesh cannot be had (DAE, missing) takes, in this order: its other
    /// geometry (visual); the boxes of the built-in hand where the names say which hand it is; the
    /// box of its inertia. [`Gripper::notes`] names each. Where the pads themselves cannot be had,
    /// a known hand is replaced whole by the built-in one.
    ///
    /// # Errors
    /// As [`Description::read`] and [`Description::tree`]; [`Error::NoGripper`] where no such pair
    /// of fingers is found, or several; errors of mesh files.
    pub fn from_urdf(path: impl AsRef<Path>, settings: &GripperSettings) -> Result<Self> {
        let path = path.as_ref();
        let description = Description::read(path)?;
        let robot = description.tree()?;
        let mut paths = MeshPaths::new(path, &settings.packages);
        if let Some(root) = &settings.mesh_root {
            paths = paths.within(root);
        }
        let loader = Loader { path, robot: &robot, settings };
        let shapes = loader.shapes(&paths)?;
        match loader.jaws(&shapes) {
            Ok(jaws) => loader.gripper(&jaws, &shapes),
            Err(error) => loader.replaced_whole(&shapes, error),
        }
    }
}

struct Loader<'a> {
    path: &'a Path,
    robot: &'a Robot,
    settings: &'a GripperSettings,
}

impl Loader<'_> {
    fn none(&self, expected: impl Into<String>, found: impl Into<String>) -> Error {
        let (expected, found) = (expected.into(), found.into());
        Error::NoGripper { path: self.path.to_owned(), expected, found }
    }

    fn link(&self, name: &str) -> Result<usize> {
        self.robot.link(name).ok_or_else(|| {
            self.none(format!("a link `{name}`"), format!("{} others", self.robot.links.len()))
        })
    }

    /// Shapes of the links that a small joint group may move or carry: arms are read too, since
    /// which links are fingers is known only afterwards.
    fn shapes(&self, paths: &MeshPaths) -> Result<Vec<LinkShape>> {
        let wanted = self.near_fingers();
        let shape = |(i, link)| {
            if wanted[i] { LinkShape::new(link, paths) } else { Ok(LinkShape::default()) }
        };
        let shapes: Result<Vec<LinkShape>> =
            self.robot.links.iter().enumerate().map(shape).collect();
        // A path that is refused was reported under the mesh's name; the description names it.
        shapes.map_err(|error| match error {
            Error::Urdf { code, place, expected, found, .. } => {
                Error::Urdf { path: self.path.to_owned(), code, place, expected, found }
            }
            other => other,
        })
    }

    /// Links on bodies with two or more moving joints on them, and all behind those joints.
    fn near_fingers(&self) -> Vec<bool> {
        let robot = self.robot;
        let bodies: Vec<usize> = (0..robot.links.len()).map(|i| body_of(robot, i)).collect();
        let mut n_joints = vec![0; robot.links.len()];
        for joint in robot.joints.iter().filter(|joint| joint.kind != JointKind::Held) {
            n_joints[bodies[joint.parent]] += 1;
        }
        let mut near: Vec<bool> = bodies.iter().map(|&body| n_joints[body] >= 2).collect();
        for joint in &robot.joints {
            near[joint.child] |= near[joint.parent];
        }
        near
    }

    fn jaws(&self, shapes: &[LinkShape]) -> Result<Jaws> {
        let only = match &self.settings.fingers {
            Some([a, b]) => Some([self.link(a)?, self.link(b)?]),
            None => None,
        };
        let found = Jaws::find(self.robot, shapes, only);
        let name = |link: usize| self.robot.links[link].name.as_str();
        let Some(best) = found.first() else {
            let expected = "two fingers with flat pads that stay parallel and close on each other";
            return Err(self.none(expected, "no such pair"));
        };
        let other = found
            .iter()
            .find(|jaws| body_of(self.robot, jaws.palm) != body_of(self.robot, best.palm));
        if let Some(other) = other {
            let pair = |jaws: &Jaws| {
                format!("`{}` and `{}`", name(jaws.fingers[0]), name(jaws.fingers[1]))
            };
            let found = format!("{}; {}", pair(best), pair(other));
            return Err(self.none("one pair of fingers, or to be told which", found));
        }
        Ok(best.clone())
    }

    fn gripper(&self, jaws: &Jaws, shapes: &[LinkShape]) -> Result<Gripper> {
        let frames = self.frames(jaws)?;
        let flange = self.flange(jaws)?;
        let palm_poses = jaws.drive.poses(self.robot, jaws.palm, 0.0);
        let flange_from_palm = palm_poses[flange].inverse();
        let by_width = |pose: &dyn Fn(&Frame) -> Pose| {
            Motion::new(frames.iter().map(|frame| (frame.width, pose(frame))))
        };
        let mut parts = Vec::new();
        let mut notes = Vec::new();
        let mut replaced = Vec::new();
        for link in self.hand_links(jaws, shapes) {
            let (shape, body) = (&shapes[link], &self.robot.links[link]);
            let role = self.role(link, shape, jaws, &frames);
            let mut solids = shape.parts.clone();
            if shape.from_visuals && !shape.parts.is_empty() {
                notes.push(format!("link `{}`: its visuals stand in for collisions", body.name));
            }
            if !shape.missing.is_empty() {
                let missing = shape.missing.join(", ");
                if let Some(hand) = self.known_hand() {
                    notes.push(format!(
                        "link `{}`: {missing}; boxes of `{hand}` instead",
                        body.name
                    ));
                    replaced.push(role);
                    continue;
                }
                let Some(solid) = inertia_box(body) else {
                    let expected =
                        format!("a mesh, a visual or an inertia of link `{}`", body.name);
                    return Err(self.none(expected, missing));
                };
                notes.push(format!("link `{}`: {missing}; box of its inertia instead", body.name));
                solids.push(solid);
            }
            for (place, shape) in solids {
                let motion = by_width(&|frame| {
                    frame.palm_from_tcp.inverse() * frame.palm_from_link[link] * place
                });
                parts.push(GripperPart::new(&body.name, role, shape, motion));
            }
        }
        parts.extend(self.builtin_parts(&replaced)?);
        let opening = match (frames.first(), frames.last()) {
            (Some(closed), Some(open)) => closed.width..=open.width,
            _ => 0.0..=0.0,
        };
        let flange = by_width(&|frame| flange_from_palm * frame.palm_from_tcp);
        let pad = self.settings.pad.unwrap_or(jaws.pad);
        let gripper = Gripper::new(&self.robot.name, opening, pad, flange, parts)?;
        let joint = |&(joint, from, to): &(usize, f64, f64)| {
            let positions =
                frames.iter().map(|frame| (frame.width, from + (to - from) * frame.share));
            DriveJoint::new(&self.robot.joints[joint].name, positions)
        };
        let joints = jaws.drive.leaders.iter().filter_map(joint).collect();
        Ok(Gripper { notes, joints, ..gripper })
    }

    /// The drive sampled from closed to open, with the TCP between the pads.
    fn frames(&self, jaws: &Jaws) -> Result<Vec<Frame>> {
        let gap =
            |share: f64| jaws.at(self.robot, &jaws.drive.poses(self.robot, jaws.palm, share)).0;
        let (mut closed, open) = if gap(0.0) < gap(1.0) { (0.0, 1.0) } else { (1.0, 0.0) };
        if gap(open) <= 0.0 {
            return Err(self.none("fingers that open", "pads that overlap all the way"));
        }
        if gap(closed) < 0.0 {
            // Halving 60 times reaches the last bit of a share.
            let (mut inside, mut outside) = (closed, open);
            for _ in 0..60 {
                let middle = (inside + outside) / 2.0;
                *(if gap(middle) < 0.0 { &mut inside } else { &mut outside }) = middle;
            }
            closed = outside;
        }
        let mut frames: Vec<Frame> = Vec::with_capacity(N_STEPS);
        let mut shift = None;
        for step in 0..N_STEPS {
            let share = closed + (open - closed) * step as f64 / (N_STEPS - 1) as f64;
            let palm_from_link = jaws.drive.poses(self.robot, jaws.palm, share);
            let (width, middle) = jaws.at(self.robot, &palm_from_link);
            let width = if step == 0 && width < 1e-9 { 0.0 } else { width };
            if frames.last().is_some_and(|last| width <= last.width) {
                return Err(self.none("fingers that only open on their way", "some that turn back"));
            }
            let found = Pose::from_parts(middle, axes(jaws.closing, jaws.approach));
            let first = *shift.get_or_insert(middle);
            let palm_from_tcp = match self.settings.palm_from_tcp {
                Some(given) => {
                    let given = self.given_tcp(given, jaws)?;
                    Pose::from_translation(middle - first) * given
                }
                None => found,
            };
            frames.push(Frame { width, share, palm_from_tcp, palm_from_link });
        }
        Ok(frames)
    }

    /// A TCP from the caller must close along y as the fingers do.
    fn given_tcp(&self, given: Pose, jaws: &Jaws) -> Result<Pose> {
        let along = (given.rotation * DVec3::Y).dot(jaws.closing);
        if along.abs() < 0.996 {
            let expected = "a TCP whose y axis is the closing direction within 5°";
            return Err(
                self.none(expected, format!("{:.1}°", along.abs().min(1.0).acos().to_degrees()))
            );
        }
        Ok(given)
    }

    /// The palm's frame or what was asked for, fixed to the palm.
    fn flange(&self, jaws: &Jaws) -> Result<usize> {
        if let Some(name) = &self.settings.flange {
            let link = self.link(name)?;
            if body_of(self.robot, link) != body_of(self.robot, jaws.palm) {
                let palm = &self.robot.links[jaws.palm].name;
                let expected = format!("a flange that is fixed to the palm `{palm}`");
                return Err(self.none(expected, format!("`{name}`")));
            }
            return Ok(link);
        }
        let above = self.robot.joint_to(jaws.palm).map(|joint| &self.robot.joints[joint]);
        Ok(match above {
            Some(joint) if joint.kind == JointKind::Held && self.is_bare(joint.parent) => {
                joint.parent
            }
            _ => jaws.palm,
        })
    }

    fn is_bare(&self, link: usize) -> bool {
        let link = &self.robot.links[link];
        link.collisions.is_empty() && link.visuals.is_empty()
    }

    /// The palm with what is fixed on it, and the fingers. Where the palm is a bare frame, the
    /// bodies that it is fixed to come in its place.
    fn hand_links(&self, jaws: &Jaws, shapes: &[LinkShape]) -> Vec<usize> {
        let robot = self.robot;
        let has_shape = |i: usize| !shapes[i].parts.is_empty() || !shapes[i].missing.is_empty();
        let mut top = jaws.palm;
        let fixed_on = |top: usize| -> Vec<usize> {
            let mut on = vec![false; robot.links.len()];
            on[top] = true;
            for joint in robot.joints.iter().filter(|joint| joint.kind == JointKind::Held) {
                on[joint.child] |= on[joint.parent];
            }
            (0..robot.links.len()).filter(|&i| on[i] && jaws.branches[i].is_none()).collect()
        };
        while !fixed_on(top).into_iter().any(has_shape) {
            match robot.joint_to(top) {
                Some(joint) if robot.joints[joint].kind == JointKind::Held => {
                    top = robot.joints[joint].parent;
                }
                _ => break,
            }
        }
        let palm = fixed_on(top);
        let fingers = (0..robot.links.len()).filter(|&i| jaws.branches[i].is_some());
        palm.into_iter().chain(fingers).filter(|&i| has_shape(i)).collect()
    }

    /// By the finger that a link belongs to, or, for further branches of a linkage, by the side
    /// that it is on when open.
    fn role(&self, link: usize, shape: &LinkShape, jaws: &Jaws, frames: &[Frame]) -> Role {
        let Some(branch) = jaws.branches[link] else { return Role::Palm };
        let Some(open) = frames.last() else { return Role::Palm };
        let y_axis = open.palm_from_tcp.rotation * DVec3::Y;
        let [first, second] = jaws.fingers.map(|finger| jaws.branches[finger] == Some(branch));
        // The first finger lies at negative y, unless a given TCP looks the other way.
        let (left, right) =
            if y_axis.dot(jaws.closing) > 0.0 { (first, second) } else { (second, first) };
        let tcp_from_link = open.palm_from_tcp.inverse() * open.palm_from_link[link];
        let side: f64 =
            shape.triangles.iter().map(|corners| tcp_from_link.transform_point(corners[0]).y).sum();
        if left || !right && side < 0.0 { Role::Left } else { Role::Right }
    }

    /// The built-in hand that the names speak of.
    fn known_hand(&self) -> Option<&'static str> {
        let names = self.robot.links.iter().map(|link| link.name.as_str());
        let plain: String = names
            .chain([self.robot.name.as_str()])
            .flat_map(|name| name.chars().chain([' ']))
            .filter(|c| !matches!(c, '_' | '-'))
            .map(|c| c.to_ascii_lowercase())
            .collect();
        let known = [
            ("2f85", "robotiq-2f85"),
            ("2f140", "robotiq-2f140"),
            ("pandahand", "franka"),
            ("fr3hand", "franka"),
            ("ferhand", "franka"),
            ("frankahand", "franka"),
        ];
        known.iter().find(|(word, _)| plain.contains(word)).map(|&(_, hand)| hand)
    }

    /// All boxes of the known hand for the roles that lost a link.
    fn builtin_parts(&self, roles: &[Role]) -> Result<Vec<GripperPart>> {
        match self.known_hand() {
            Some(hand) if !roles.is_empty() => {
                let parts = Gripper::builtin(hand)?.parts.into_iter();
                Ok(parts.filter(|part| roles.contains(&part.role)).collect())
            }
            _ => Ok(Vec::new()),
        }
    }

    /// The built-in hand, where the pads of a known one could not be had; else the error.
    fn replaced_whole(&self, shapes: &[LinkShape], error: Error) -> Result<Gripper> {
        let missing: Vec<&str> =
            shapes.iter().flat_map(|shape| &shape.missing).map(String::as_str).collect();
        let Some(hand) = self.known_hand().filter(|_| !missing.is_empty()) else {
            return match (error, missing.first()) {
                (Error::NoGripper { path, expected, found }, Some(first)) => {
                    let found =
                        format!("{found}; {} meshes are not to be had ({first})", missing.len());
                    Err(Error::NoGripper { path, expected, found })
                }
                (error, _) => Err(error),
            };
        };
        let gripper = Gripper::builtin(hand)?;
        let notes = vec![format!("`{hand}` instead of the description: {}", missing.join(", "))];
        Ok(Gripper { notes, ..gripper })
    }
}

/// The hand at one width.
struct Frame {
    width: f64,
    /// Of the drive's way.
    share: f64,
    palm_from_tcp: Pose,
    palm_from_link: Vec<Pose>,
}

/// The rotation whose y and z are these.
fn axes(closing: DVec3, approach: DVec3) -> DQuat {
    DQuat::from_mat3(&DMat3::from_cols(closing.cross(approach), closing, approach))
}
