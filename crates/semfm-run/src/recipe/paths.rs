//! The files that a recipe names: what they are relative to, and which of them are missing.

use std::path::{Path, PathBuf};

use semfm::encoder::BuiltinEncoder;
use semfm::observe::MaskFile;
use semfm::robot::BUILTIN_GRIPPERS;

use super::{Demonstration, DemonstrationFrame, GraspTable, PoseValue, Recipe, RobotTable};
use super::{Target, TargetFrame, TransferTable};

/// A file with the key that names it.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedPath {
    /// `demonstration.frames[0].depth`.
    pub key: String,
    /// The file or folder.
    pub path: PathBuf,
}

/// A path of a recipe on the way to be read or changed, with its key.
type Each<'a> = dyn FnMut(String, &mut PathBuf) + 'a;

impl Recipe {
    /// Makes every path one from `folder`. A gripper is a path where such a file is there, an encoder where such a file or
    /// folder is; names of what is built in are no paths, whatever stands beside the recipe.
    pub(super) fn resolve(&mut self, folder: &Path) {
        self.each_path(&mut |_, path| *path = folder.join(&*path));
        let gripper = self.grasp.iter_mut().map(|grasp| &mut grasp.gripper);
        for name in gripper.filter(|name| BUILTIN_GRIPPERS.iter().all(|g| g.name != **name)) {
            resolve_name(name, folder, Path::is_file);
        }
        let encoder = self.transfer.encoder.iter_mut();
        for name in encoder.filter(|name| BuiltinEncoder::named(name).is_none()) {
            resolve_name(name, folder, Path::exists);
        }
    }

    /// Every file that the recipe names. A mask is named without its label.
    pub fn paths(&self) -> Vec<NamedPath> {
        let mut paths = Vec::new();
        let mut copy = self.clone();
        copy.each_path(&mut |key, path| {
            let path = match key.ends_with("mask") {
                true => MaskFile::parse(&path.to_string_lossy()).path,
                false => path.clone(),
            };
            paths.push(NamedPath { key, path });
        });
        paths
    }

    fn each_path(&mut self, each: &mut Each<'_>) {
        let Self { demonstration, target, transfer, grasp, robot, .. } = self;
        demonstration.each_path(each);
        target.each_path(each);
        transfer.each_path(each);
        grasp.iter_mut().for_each(|grasp| grasp.each_path(each));
        robot.iter_mut().for_each(|robot| robot.each_path(each));
    }
}

/// Makes a name a path from `folder`, where there is such a file.
fn resolve_name(name: &mut String, folder: &Path, is_there: fn(&Path) -> bool) {
    let path = folder.join(&*name);
    if let Some(text) = path.to_str().filter(|_| is_there(&path)) {
        *name = text.to_owned();
    }
}

/// Hands the paths that are there to `each`, under the keys of a table.
fn optional<'a>(
    table: &str,
    paths: impl IntoIterator<Item = (&'static str, &'a mut Option<PathBuf>)>,
    each: &mut Each<'_>,
) {
    for (key, path) in paths {
        path.iter_mut().for_each(|path| each(format!("{table}.{key}"), path));
    }
}

impl Demonstration {
    fn each_path(&mut self, each: &mut Each<'_>) {
        optional("demonstration", [("mesh", &mut self.mesh), ("region", &mut self.region)], each);
        for (i, frame) in self.frames.iter_mut().enumerate() {
            frame.each_path(&format!("demonstration.frames[{i}]"), each);
        }
    }
}

impl DemonstrationFrame {
    fn each_path(&mut self, table: &str, each: &mut Each<'_>) {
        let paths = [
            ("color", &mut self.color),
            ("depth", &mut self.depth),
            ("intrinsics", &mut self.intrinsics),
            ("mask", &mut self.mask),
            ("aligned", &mut self.aligned),
            ("init", &mut self.init),
            ("hand_mask", &mut self.hand_mask),
            ("hand", &mut self.hand),
            ("hand_vertices", &mut self.hand_vertices),
            ("region_mask", &mut self.region_mask),
        ];
        optional(table, paths, each);
    }
}

impl Target {
    fn each_path(&mut self, each: &mut Each<'_>) {
        optional("target", [("mesh", &mut self.mesh), ("aligned", &mut self.aligned)], each);
        let Some(TargetFrame { color, depth, intrinsics, mask, init, .. }) = &mut self.frame else {
            return;
        };
        let paths = [
            ("color", color),
            ("depth", depth),
            ("intrinsics", intrinsics),
            ("mask", mask),
            ("init", init),
        ];
        optional("target.frame", paths, each);
    }
}

impl TransferTable {
    fn each_path(&mut self, each: &mut Each<'_>) {
        let paths = [
            ("source_embeddings", &mut self.source_embeddings),
            ("target_embeddings", &mut self.target_embeddings),
            ("source_features", &mut self.source_features),
            ("target_features", &mut self.target_features),
        ];
        optional("transfer", paths, each);
    }
}

impl GraspTable {
    fn each_path(&mut self, each: &mut Each<'_>) {
        self.packages
            .iter_mut()
            .for_each(|(name, path)| each(format!("grasp.packages.{name}"), path));
        self.scene.iter_mut().for_each(|path| each("grasp.scene".into(), path));
    }
}

impl RobotTable {
    fn each_path(&mut self, each: &mut Each<'_>) {
        each("robot.urdf".into(), &mut self.urdf);
        optional("robot", [("srdf", &mut self.srdf), ("limits", &mut self.limits)], each);
        self.packages
            .iter_mut()
            .for_each(|(name, path)| each(format!("robot.packages.{name}"), path));
        self.scene.iter_mut().for_each(|path| each("robot.scene".into(), path));
        let poses = [
            ("tip_from_tcp", &mut self.tip_from_tcp),
            ("base_from_camera", &mut self.base_from_camera),
            ("base_from_object", &mut self.base_from_object),
        ];
        for (key, pose) in poses {
            if let Some(PoseValue::File(path)) = pose {
                each(format!("robot.{key}"), path);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_what_is_built_in_are_no_paths() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["franka", "builtin", "siglip", "hand"] {
            std::fs::create_dir(folder.path().join(name)).unwrap();
        }
        std::fs::write(folder.path().join("hand.urdf"), "").unwrap();
        let resolved = |gripper: &str, encoder: &str| {
            let text = format!(
                "[demonstration]\nmesh = 'a'\n[target]\nmesh = 'b'\n[grasp]\ngripper = '{gripper}'\n\
                 [transfer]\nencoder = '{encoder}'\n"
            );
            let mut recipe = Recipe::parse(Path::new("demo.toml"), &text).unwrap();
            recipe.resolve(folder.path());
            (recipe.grasp.unwrap().gripper, recipe.transfer.encoder.unwrap())
        };
        assert_eq!(resolved("franka", "builtin"), ("franka".into(), "builtin".into()));
        let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
        assert_eq!(resolved("hand.urdf", "siglip"), (at("hand.urdf"), at("siglip")));
        assert_eq!(resolved("hand", "Org/model"), ("hand".into(), "Org/model".into()));
    }
}
