//! Where the meshes of a description may be: in the robot's own folder or in mapped packages.

use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

use super::fault::{Fault, quoted};

/// Folder names of ROS packages that hold descriptions; meshes stand beside them.
const DESCRIPTION_FOLDERS: [&str; 3] = ["urdf", "robots", "robot"];

/// Finds the meshes of one description, and only those in folders that are allowed.
#[derive(Clone, Debug)]
pub struct MeshPaths {
    /// Where relative names start.
    folder: PathBuf,
    /// What they must not leave.
    root: PathBuf,
    packages: BTreeMap<String, PathBuf>,
}

/// Whether a mesh is there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum MeshPlace {
    /// This file, its path resolved.
    Found(PathBuf),
    /// Nothing, and why.
    Missing(String),
}

impl MeshPaths {
    /// For the description at `path`. Relative names stay inside its folder; where that folder is
    /// called `urdf`, `robots` or `robot`, as in ROS packages, inside the folder above, since the
    /// meshes then stand in `../meshes`. `packages` maps the names of `package://NAME/…`.
    pub fn new(path: &Path, packages: &BTreeMap<String, PathBuf>) -> Self {
        let folder = match path.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder.to_owned(),
            _ => PathBuf::from("."),
        };
        let folder = folder.canonicalize().unwrap_or(folder);
        let above = folder.parent().filter(|_| {
            let name = folder.file_name().and_then(|name| name.to_str()).unwrap_or_default();
            DESCRIPTION_FOLDERS.contains(&name)
        });
        let root = above.unwrap_or(&folder).to_owned();
        Self { folder, root, packages: packages.clone() }
    }

    /// With another folder that relative names must not leave.
    #[must_use]
    pub fn within(mut self, root: &Path) -> Self {
        self.root = root.canonicalize().unwrap_or_else(|_| root.to_owned());
        self
    }

    /// Looks for a mesh by its name in the file; `place` is where the name stands.
    pub(crate) fn find(&self, name: &str, place: &str) -> Result<MeshPlace, Fault> {
        if name.trim().is_empty() || name.contains(['\0', '\\']) {
            return Err(Fault::new("filename", place, "the name of a mesh file", quoted(name)));
        }
        let outside = |expected| Fault::new("path-outside", place, expected, quoted(name));
        if let Some(rest) = name.strip_prefix("package://") {
            let (package, inside) = rest.split_once('/').unwrap_or((rest, ""));
            let inside = Path::new(inside);
            if package.is_empty() || package == ".." || !is_plain(inside) {
                return Err(outside("a file inside its package"));
            }
            let Some(folder) = self.packages.get(package) else {
                return Ok(MeshPlace::Missing(format!(
                    "package {} is not mapped",
                    quoted(package)
                )));
            };
            return match resolve(folder, folder, inside) {
                Some(place) => Ok(place),
                None => Err(outside("a file inside its package")),
            };
        }
        if name.contains(':') {
            let expected = "a relative path or package://";
            return Err(Fault::new("scheme", place, expected, quoted(name)));
        }
        if !self.stays_inside(Path::new(name)) {
            return Err(outside("a file inside the robot's folder"));
        }
        match resolve(&self.folder, &self.root, Path::new(name)) {
            Some(place) => Ok(place),
            None => Err(outside("a file inside the robot's folder")),
        }
    }

    /// Follows the name part by part, without asking the file system: no step may lead out.
    fn stays_inside(&self, name: &Path) -> bool {
        let mut at = self.folder.clone();
        name.components().all(|part| {
            match part {
                Component::Normal(part) => at.push(part),
                Component::CurDir => {}
                Component::ParentDir => drop(at.pop()),
                Component::RootDir | Component::Prefix(_) => return false,
            }
            at.starts_with(&self.root)
        })
    }
}

/// Names only: no root, no `..`.
fn is_plain(path: &Path) -> bool {
    path.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir))
}

/// Where the file really is; `None` where a link leads out of `root`.
fn resolve(folder: &Path, root: &Path, name: &Path) -> Option<MeshPlace> {
    let (Ok(root), Ok(file)) = (root.canonicalize(), folder.join(name).canonicalize()) else {
        return Some(MeshPlace::Missing("no such file".into()));
    };
    if !file.starts_with(root) {
        return None;
    }
    Some(match file.is_file() {
        true => MeshPlace::Found(file),
        false => MeshPlace::Missing("not a file".into()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A package with `urdf/`, `meshes/a.stl`, and a file outside.
    fn package() -> (tempfile::TempDir, MeshPaths) {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path().join("robot_x");
        std::fs::create_dir_all(root.join("urdf")).unwrap();
        std::fs::create_dir_all(root.join("meshes")).unwrap();
        std::fs::write(root.join("meshes/a.stl"), "solid").unwrap();
        std::fs::write(folder.path().join("secret.stl"), "solid").unwrap();
        let packages = [("robot_x".to_owned(), root.clone())].into();
        let paths = MeshPaths::new(&root.join("urdf/x.urdf"), &packages);
        (folder, paths)
    }

    #[test]
    fn meshes_are_found_beside_the_description_and_in_mapped_packages() {
        let (_folder, paths) = package();
        for name in ["../meshes/a.stl", "package://robot_x/meshes/a.stl", "./../meshes/./a.stl"] {
            assert!(matches!(paths.find(name, "x"), Ok(MeshPlace::Found(_))), "{name}");
        }
        for name in ["b.stl", "package://robot_x/b.stl", "package://other/a.stl", "../meshes"] {
            assert!(matches!(paths.find(name, "x"), Ok(MeshPlace::Missing(_))), "{name}");
        }
    }

    fn refusal(paths: &MeshPaths, name: &str) -> &'static str {
        paths.find(name, "x").unwrap_err().code
    }

    #[test]
    fn no_name_leads_out() {
        let (_folder, paths) = package();
        for name in [
            "../../secret.stl",
            "/etc/passwd",
            "../../robot_x/meshes/a.stl",
            "package://robot_x/../secret.stl",
            "package://../secret.stl",
            "package:///etc/passwd",
        ] {
            assert_eq!(refusal(&paths, name), "path-outside", "{name}");
        }
        assert_eq!(refusal(&paths, "http://169.254.169.254/a.stl"), "scheme");
        assert_eq!(refusal(&paths, "file:///etc/passwd"), "scheme");
        assert_eq!(refusal(&paths, " "), "filename");
        assert_eq!(refusal(&paths, "..\\a.stl"), "filename");
    }

    #[cfg(unix)]
    #[test]
    fn a_link_that_leads_out_is_refused() {
        let (folder, paths) = package();
        let link = folder.path().join("robot_x/meshes/link.stl");
        std::os::unix::fs::symlink(folder.path().join("secret.stl"), link).unwrap();
        for name in ["../meshes/link.stl", "package://robot_x/meshes/link.stl"] {
            assert_eq!(paths.find(name, "x").unwrap_err().code, "path-outside", "{name}");
        }
    }
}
