//! What a recipe must say besides having the right keys.

use std::path::PathBuf;

use super::{DemonstrationFrame, Recipe, TargetFrame};

/// Something that is missing, or said twice.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Fault {
    pub key: String,
    pub expected: String,
    pub found: String,
}

impl Fault {
    fn new(key: impl Into<String>, expected: &str, found: &str) -> Self {
        Self { key: key.into(), expected: expected.into(), found: found.into() }
    }
}

impl Recipe {
    /// The first fault, in the order of the tables.
    pub(super) fn fault(&self) -> Option<Fault> {
        self.observed_fault()
            .or_else(|| self.region_fault())
            .or_else(|| self.frame_faults())
            .or_else(|| self.target_fault())
            .or_else(|| self.unseen_fault())
            .or_else(|| self.transfer_fault())
            .or_else(|| self.robot_fault())
    }

    /// An object without a mesh is seen in one frame, and its features come of that.
    fn observed_fault(&self) -> Option<Fault> {
        let Self { demonstration, target, transfer, .. } = self;
        const SEEN: &str = "`mesh`, or one frame with `depth`, `mask` and `intrinsics`, in which the object is what the \
                            camera saw";
        const ITS_OWN: &str =
            "none beside an object without `mesh`, which is in its camera's frame, in metres";
        if demonstration.mesh.is_none() {
            let [frame] = &demonstration.frames[..] else {
                let found = match demonstration.frames.len() {
                    0 => "none".to_owned(),
                    n => format!("{n} frames"),
                };
                return Some(Fault::new("demonstration.mesh", SEEN, &found));
            };
            if !shows_object([&frame.depth, &frame.mask, &frame.intrinsics]) {
                return Some(Fault::new("demonstration.mesh", SEEN, "neither"));
            }
            let poses = [("aligned", frame.aligned.is_some()), ("init", frame.init.is_some())];
            if let Some((key, _)) = poses.into_iter().find(|(_, is_given)| *is_given) {
                let key = format!("demonstration.frames[0].{key}");
                return Some(Fault::new(key, ITS_OWN, "one"));
            }
        }
        if target.mesh.is_none() {
            let shows = |f: &&TargetFrame| shows_object([&f.depth, &f.mask, &f.intrinsics]);
            let Some(frame) = target.frame.as_ref().filter(shows) else {
                return Some(Fault::new("target.mesh", SEEN, "neither"));
            };
            let poses = [
                ("target.scale", target.scale.is_some()),
                ("target.aligned", target.aligned.is_some()),
                ("target.frame.init", frame.init.is_some()),
            ];
            if let Some((key, _)) = poses.into_iter().find(|(_, is_given)| *is_given) {
                return Some(Fault::new(key, ITS_OWN, "one"));
            }
        }
        let given = [
            ("source_embeddings", &transfer.source_embeddings),
            ("source_features", &transfer.source_features),
        ];
        let given = given.into_iter().find(|(_, file)| file.is_some());
        match given {
            Some((key, _)) if demonstration.mesh.is_none() || target.mesh.is_none() => {
                let expected = "an encoder where an object has no `mesh`: its features come of what the camera saw";
                Some(Fault::new(format!("transfer.{key}"), expected, "a file"))
            }
            _ => None,
        }
    }

    /// One way to a region.
    fn region_fault(&self) -> Option<Fault> {
        const WAYS: &str = "one way to the region: `region`, `near` with `radius`, or frames with `hand`, `hand_mask` or \
                            `region_mask`";
        let demonstration = &self.demonstration;
        let frames = &demonstration.frames;
        let ways = [
            demonstration.region.is_some(),
            demonstration.near.is_some() || demonstration.radius.is_some(),
            frames.iter().any(DemonstrationFrame::has_hand),
            frames.iter().any(|frame| frame.region_mask.is_some()),
        ];
        let n = ways.into_iter().filter(|&way| way).count();
        if n != 1 {
            let found = if n == 0 { "none".to_owned() } else { format!("{n}") };
            return Some(Fault::new("demonstration", WAYS, &found));
        }
        if demonstration.near.is_some() != demonstration.radius.is_some() {
            let found =
                if demonstration.near.is_some() { "`near` alone" } else { "`radius` alone" };
            return Some(Fault::new("demonstration", "`near` and `radius`", found));
        }
        None
    }

    /// Each frame has what is read of it.
    fn frame_faults(&self) -> Option<Fault> {
        let has_hand = self.demonstration.frames.iter().any(DemonstrationFrame::has_hand);
        let has_mask = self.demonstration.frames.iter().any(|frame| frame.region_mask.is_some());
        let mut frames = self.demonstration.frames.iter().enumerate();
        frames.find_map(|(i, frame)| {
            let at = |key: &str| format!("demonstration.frames[{i}].{key}");
            if has_hand && !frame.has_hand() {
                return Some(Fault::new(
                    at("hand"),
                    "`hand` or `hand_mask`, as in other frames",
                    "neither",
                ));
            }
            if has_mask && frame.region_mask.is_none() {
                return Some(Fault::new(
                    at("region_mask"),
                    "`region_mask`, as in other frames",
                    "none",
                ));
            }
            if frame.needs_camera() && frame.intrinsics.is_none() {
                return Some(Fault::new(at("intrinsics"), "the camera of depth and masks", "none"));
            }
            if frame.hand_mask.is_some() && frame.hand.is_none() && frame.depth.is_none() {
                let expected = "`depth` beside `hand_mask`, or `hand`: a mask alone is flat";
                return Some(Fault::new(at("depth"), expected, "neither"));
            }
            let has_picture = frame.depth.is_some() || frame.color.is_some();
            if (frame.hand_mask.is_some() || frame.region_mask.is_some()) && !has_picture {
                let expected = "`depth` or `color`, the picture that the mask is of";
                return Some(Fault::new(at("depth"), expected, "neither"));
            }
            let needs_pose = frame.region_mask.is_some() || frame.hand_mask.is_some();
            if needs_pose && frame.aligned.is_none() && frame.depth.is_none() {
                let expected = "`aligned`, or `depth` in which the mesh is found";
                return Some(Fault::new(at("aligned"), expected, "neither"));
            }
            None
        })
    }

    /// The target has metres where grasps are wanted, told once.
    fn target_fault(&self) -> Option<Fault> {
        let target = &self.target;
        let frame = target.frame.as_ref();
        if let Some(frame) = frame
            && frame.intrinsics.is_none()
            && (frame.depth.is_some() || frame.color.is_some())
        {
            return Some(Fault::new(
                "target.frame.intrinsics",
                "the camera of the picture",
                "none",
            ));
        }
        let has_depth = frame.is_some_and(|frame| frame.depth.is_some());
        let ways = [target.scale.is_some(), target.aligned.is_some(), has_depth];
        let n = ways.into_iter().filter(|&way| way).count();
        if n > 1 && !(target.aligned.is_some() && has_depth && target.scale.is_none()) {
            let expected =
                "metres told once: `scale`, `aligned`, or `frame.depth` in which the mesh is found";
            return Some(Fault::new("target.scale", expected, &format!("{n}")));
        }
        if let Some(scale) = target.scale.filter(|&scale| !(scale > 0.0 && scale.is_finite())) {
            let expected = "a positive number of metres per unit of the mesh (1: it is in metres)";
            return Some(Fault::new("target.scale", expected, &scale.to_string()));
        }
        if n == 0 && self.grasp.is_some() {
            let expected =
                "`target.scale`, `target.aligned` or `target.frame.depth`: grasps need metres";
            return Some(Fault::new("target", expected, "none"));
        }
        None
    }

    /// What lies behind a surface is told from the camera in the origin of its frame, where a mesh with a pose is not.
    fn unseen_fault(&self) -> Option<Fault> {
        self.grasp.as_ref()?.unseen?;
        let expected =
            "none beside a mesh whose pose is known: what one camera saw is in its own frame";
        let found = match &self.target.aligned {
            Some(_) => "`target.aligned`",
            None if self.aligns_target() => "`target.frame.depth`, in which the mesh is found",
            None => return None,
        };
        Some(Fault::new("grasp.unseen", expected, found))
    }

    /// Features come in pairs and once.
    fn transfer_fault(&self) -> Option<Fault> {
        let transfer = &self.transfer;
        let pairs = [
            ("embeddings", [&transfer.source_embeddings, &transfer.target_embeddings]),
            ("features", [&transfer.source_features, &transfer.target_features]),
        ];
        for (name, [source, target]) in pairs {
            if source.is_some() != target.is_some() {
                let missing = if source.is_some() { "target" } else { "source" };
                let expected = format!("`source_{name}` and `target_{name}`");
                return Some(Fault::new(
                    format!("transfer.{missing}_{name}"),
                    &expected,
                    "one of them",
                ));
            }
        }
        let [embeddings, features] =
            [transfer.source_embeddings.is_some(), transfer.source_features.is_some()];
        let encoder = transfer.encoder.is_some() || transfer.rolls.is_some();
        let n = [embeddings, features, encoder].into_iter().filter(|&way| way).count();
        if n > 1 {
            let expected =
                "features from one place: `encoder`, embeddings, or features of the vertices";
            return Some(Fault::new("transfer", expected, &n.to_string()));
        }
        let rolls = transfer.rolls.filter(|rolls| ![1, 2, 4].contains(rolls));
        rolls.map(|rolls| Fault::new("transfer.rolls", "1, 2 or 4", &rolls.to_string()))
    }

    /// A robot has grasps to carry out and knows where the object stands.
    fn robot_fault(&self) -> Option<Fault> {
        let robot = self.robot.as_ref()?;
        if self.grasp.is_none() {
            return Some(Fault::new("robot", "a table [grasp] beside it", "none"));
        }
        if robot.tip.is_none() && robot.tip_from_tcp.is_none() {
            let expected = "`tip`, the link that the gripper's flange sits on, or `tip_from_tcp`";
            return Some(Fault::new("robot.tip", expected, "neither"));
        }
        match (&robot.base_from_camera, &robot.base_from_object) {
            (None, None) => {
                let expected = "`base_from_camera`, or `base_from_object`: where the object stands";
                Some(Fault::new("robot", expected, "neither"))
            }
            (Some(_), Some(_)) => {
                let expected = "one of `base_from_camera` and `base_from_object`";
                Some(Fault::new("robot.base_from_camera", expected, "both"))
            }
            (Some(_), None) if self.target.scale.is_some() => {
                let expected = "`base_from_object`, for `target.scale` tells of no camera";
                Some(Fault::new("robot.base_from_camera", expected, "`base_from_camera`"))
            }
            _ => None,
        }
    }
}

impl DemonstrationFrame {
    /// Whether a hand is in it.
    pub fn has_hand(&self) -> bool {
        self.hand.is_some() || self.hand_mask.is_some()
    }

    /// Whether a mesh is looked for in its depth: where something that is told in the camera's frame is to be marked on it.
    pub fn is_aligned_here(&self) -> bool {
        let is_marked = self.has_hand() || self.region_mask.is_some();
        is_marked && self.aligned.is_none() && self.depth.is_some()
    }

    fn needs_camera(&self) -> bool {
        self.depth.is_some() || self.hand_mask.is_some() || self.region_mask.is_some()
    }
}

/// Whether all that a surface is made of is given: depth, mask and intrinsics.
fn shows_object(files: [&Option<PathBuf>; 3]) -> bool {
    files.iter().all(|file| file.is_some())
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    /// The fault of a text.
    fn fault(text: &str) -> Option<Fault> {
        Recipe::parse(Path::new("demo.toml"), text).unwrap().fault()
    }

    #[test]
    fn an_object_without_a_mesh_is_seen_in_one_frame() {
        let frame = "depth = 'd'\nmask = 'm'\nintrinsics = 'K'\n";
        let target = format!("[target.frame]\n{frame}");
        let observed = format!("[demonstration]\nregion = 'r'\n[[demonstration.frames]]\n{frame}");
        assert_eq!(fault(&format!("{MUG}region = 'r'\n[target]\n{target}")), None);
        assert_eq!(fault(&format!("{observed}{KETTLE}")), None);
        for (text, key, word) in [
            (format!("{MUG}region = 'r'\n[target]\n"), "target.mesh", "one frame"),
            (format!("{MUG}region = 'r'\n[target]\nscale = 1\n{target}"), "target.scale", "metres"),
            (format!("[demonstration]\nregion = 'r'\n{KETTLE}"), "demonstration.mesh", "one frame"),
            (
                format!("{observed}aligned = 'a'\n{KETTLE}"),
                "demonstration.frames[0].aligned",
                "frame",
            ),
            (
                format!(
                    "{observed}{KETTLE}[transfer]\nsource_features = 'a'\ntarget_features = 'b'\n"
                ),
                "transfer.source_features",
                "encoder",
            ),
        ] {
            let found = fault(&text).unwrap_or_else(|| panic!("no fault in {text}"));
            assert!(found.key == key && found.expected.contains(word), "{found:?} of {text}");
        }
    }

    const MUG: &str = "[demonstration]\nmesh = 'mug.obj'\n";
    const KETTLE: &str = "[target]\nmesh = 'kettle.obj'\n";
    const UNSEEN: &str = "[grasp]\ngripper = 'x'\nunseen = 0.05\n";

    #[test]
    fn what_is_missing_or_said_twice_is_named() {
        let sound = format!(
            "{MUG}region = 'grip.json'\n{KETTLE}scale = 0.2\n[grasp]\ngripper = 'franka'\n"
        );
        assert_eq!(fault(&sound), None);
        for (text, key, word) in [
            (format!("{MUG}{KETTLE}"), "demonstration", "one way"),
            (format!("{MUG}near = [0, 0, 0]\n{KETTLE}"), "demonstration", "radius"),
            (
                format!("{MUG}near = [0, 0, 0]\nradius = 1\nregion = 'r'\n{KETTLE}"),
                "demonstration",
                "one way",
            ),
            (
                format!("{MUG}[[demonstration.frames]]\nhand_mask = 'h.png'\n{KETTLE}"),
                "demonstration.frames[0].intrinsics",
                "camera",
            ),
            (
                format!(
                    "{MUG}[[demonstration.frames]]\nhand_mask = 'h.png'\nintrinsics = 'K'\n{KETTLE}"
                ),
                "demonstration.frames[0].depth",
                "flat",
            ),
            (
                format!(
                    "{MUG}[[demonstration.frames]]\nregion_mask = 'h.png'\nintrinsics = 'K'\ncolor = 'c'\n{KETTLE}"
                ),
                "demonstration.frames[0].aligned",
                "depth",
            ),
            (format!("{MUG}region = 'r'\n{KETTLE}[grasp]\ngripper = 'x'\n"), "target", "metres"),
            (format!("{MUG}region = 'r'\n{KETTLE}scale = -1\n"), "target.scale", "positive"),
            (
                format!("{MUG}region = 'r'\n{KETTLE}scale = 1\naligned = 'a'\n"),
                "target.scale",
                "once",
            ),
            (format!("{MUG}region = 'r'\n{KETTLE}[transfer]\nrolls = 3\n"), "transfer.rolls", "4"),
            (
                format!("{MUG}region = 'r'\n{KETTLE}[transfer]\nsource_features = 'a'\n"),
                "transfer.target_features",
                "source_features",
            ),
            (
                format!("{MUG}region = 'r'\n{KETTLE}aligned = 'a'\n{UNSEEN}"),
                "grasp.unseen",
                "own frame",
            ),
            (
                format!(
                    "{MUG}region = 'r'\n{KETTLE}[target.frame]\ndepth = 'd'\nintrinsics = 'K'\n{UNSEEN}"
                ),
                "grasp.unseen",
                "own frame",
            ),
            (format!("{sound}[robot]\nurdf = 'u'\n"), "robot.tip", "flange"),
            (format!("{sound}[robot]\nurdf = 'u'\ntip = 't'\n"), "robot", "base_from_camera"),
            (
                format!("{sound}[robot]\nurdf = 'u'\ntip = 't'\nbase_from_camera = 'b'\n"),
                "robot.base_from_camera",
                "no camera",
            ),
            (
                format!(
                    "{MUG}region = 'r'\n{KETTLE}[robot]\nurdf = 'u'\ntip = 't'\nbase_from_object = [0, 0, 0]\n"
                ),
                "robot",
                "[grasp]",
            ),
        ] {
            let found = fault(&text).unwrap_or_else(|| panic!("no fault in {text}"));
            assert!(found.key == key && found.expected.contains(word), "{found:?} of {text}");
        }
    }
}
