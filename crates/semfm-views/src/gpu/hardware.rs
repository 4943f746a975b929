//! Whether there may be a graphics processor, told by files alone.
//!
//! Opening a driver to ask takes 50 to 100 ms, and where it turns out to be one that draws on the CPU
//! (Mesa's lavapipe), a thread of it may outlive `main`: one run in a hundred then died at exit. So we look
//! at the files that a processor has on Linux: its device node, and its driver's entry among those of
//! Vulkan.

use std::path::{Path, PathBuf};

/// Whether this machine may have a graphics processor, so that a driver is worth opening. Elsewhere than
/// on Linux the driver says so itself: systems there come with their own.
pub(crate) fn may_have_graphics_processor() -> bool {
    !cfg!(target_os = "linux")
        || may_have_processor_below(Path::new("/"), &|name| {
            std::env::var_os(name).map(PathBuf::from)
        })
}

/// Variables by which a user names the Vulkan drivers, in the loader's order: the first that is set
/// counts.
const DRIVER_VARIABLES: [&str; 2] = ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"];
/// Where Vulkan drivers are listed on Linux.
const DRIVER_FOLDERS: [&str; 4] = [
    "etc/vulkan/icd.d",
    "usr/share/vulkan/icd.d",
    "usr/local/share/vulkan/icd.d",
    "usr/local/etc/vulkan/icd.d",
];
/// Parts of the names of drivers that draw on the CPU.
const SOFTWARE_DRIVERS: [&str; 4] = ["lvp", "lavapipe", "llvmpipe", "swiftshader"];
/// Kernel modules with a render node and no processor behind it.
const VIRTUAL_MODULES: [&str; 2] = ["vgem", "vkms"];

fn may_have_processor_below(root: &Path, variable: &dyn Fn(&str) -> Option<PathBuf>) -> bool {
    if !has_device_node(root) {
        return false;
    }
    let drivers = vulkan_drivers(root, variable);
    // Without any entry the loader may still know a driver from elsewhere.
    drivers.is_empty() || drivers.iter().any(|driver| !is_software(driver))
}

/// A node through which programs reach a processor: a render node of the kernel's graphics drivers,
/// or NVIDIA's, WSL's, Adreno's and Mali's own.
fn has_device_node(root: &Path) -> bool {
    let has_render_node = names_in(&root.join("dev/dri")).iter().any(|name| {
        let driver = root.join("sys/class/drm").join(name).join("device/driver");
        let module = std::fs::read_link(driver).unwrap_or_default();
        let is_virtual = VIRTUAL_MODULES.iter().any(|virtual_one| module.ends_with(virtual_one));
        name.starts_with("renderD") && !is_virtual
    });
    has_render_node
        || names_in(&root.join("dev")).iter().any(|name| {
            let is_nvidia = name
                .strip_prefix("nvidia")
                .is_some_and(|rest| !rest.is_empty() && rest.bytes().all(|b| b.is_ascii_digit()));
            is_nvidia || matches!(name.as_str(), "dxg" | "kgsl-3d0" | "mali0")
        })
}

/// The files that list the Vulkan drivers.
fn vulkan_drivers(root: &Path, variable: &dyn Fn(&str) -> Option<PathBuf>) -> Vec<PathBuf> {
    if let Some(named) = DRIVER_VARIABLES.iter().find_map(|name| variable(name)) {
        return std::env::split_paths(&named).collect();
    }
    let folders = DRIVER_FOLDERS.iter().map(|folder| root.join(folder));
    let of_user = variable("HOME").map(|home| home.join(".local/share/vulkan/icd.d"));
    let entries = folders.chain(of_user).flat_map(|folder| {
        names_in(&folder).into_iter().map(move |name| folder.join(name)).collect::<Vec<_>>()
    });
    entries.filter(|path| path.extension().is_some_and(|kind| kind == "json")).collect()
}

fn is_software(driver: &Path) -> bool {
    let name = driver.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    let text = std::fs::read_to_string(driver).unwrap_or_default().to_lowercase();
    SOFTWARE_DRIVERS.iter().any(|software| {
        name.contains(software)
            || text.contains(&format!("libvulkan_{software}"))
            || text.contains(&format!("libvk_{software}"))
    })
}

/// The names of a folder's entries; none of a folder that cannot be read.
fn names_in(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect()
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    /// A machine with these (empty) files and these links.
    fn machine(files: &[&str], links: &[(&str, &str)]) -> tempfile::TempDir {
        let root = tempfile::tempdir().unwrap();
        for (path, link) in files
            .iter()
            .map(|file| (file, None))
            .chain(links.iter().map(|(path, to)| (path, Some(to))))
        {
            let path = root.path().join(path);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            match link {
                None => std::fs::write(&path, "{}").unwrap(),
                Some(to) => std::os::unix::fs::symlink(to, &path).unwrap(),
            }
        }
        root
    }

    fn is_possible(files: &[&str], links: &[(&str, &str)]) -> bool {
        let root = machine(files, links);
        may_have_processor_below(root.path(), &|_| None)
    }

    const LAVAPIPE: &str = "usr/share/vulkan/icd.d/lvp_icd.x86_64.json";
    const INTEL: &str = "usr/share/vulkan/icd.d/intel_icd.x86_64.json";

    #[test]
    fn a_machine_without_a_device_node_has_no_processor_whatever_drivers_are_installed() {
        assert!(!is_possible(&[], &[]));
        assert!(!is_possible(&[LAVAPIPE, INTEL], &[]));
        assert!(!is_possible(&["dev/dri/card0", "dev/nvidiactl", "dev/nvidia-uvm", INTEL], &[]));
        let virtual_node =
            ("sys/class/drm/renderD128/device/driver", "/sys/bus/platform/drivers/vgem");
        assert!(!is_possible(&["dev/dri/renderD128", INTEL], &[virtual_node]));
    }

    #[test]
    fn a_device_node_with_a_driver_is_asked() {
        assert!(is_possible(&["dev/dri/renderD128", INTEL, LAVAPIPE], &[]));
        let driver = ("sys/class/drm/renderD128/device/driver", "/sys/bus/pci/drivers/i915");
        assert!(is_possible(&["dev/dri/renderD128", INTEL], &[driver]));
        for node in ["dev/nvidia0", "dev/dxg", "dev/mali0", "dev/kgsl-3d0", "dev/dri/renderD129"] {
            assert!(is_possible(&[node], &[]), "{node}: a driver that no file lists may answer");
        }
    }

    #[test]
    fn a_processor_that_no_driver_serves_is_not_asked_for() {
        assert!(!is_possible(&["dev/nvidia0", LAVAPIPE], &[]));
    }

    #[test]
    fn drivers_that_the_user_names_are_the_only_ones() {
        let root = machine(&["dev/nvidia0", LAVAPIPE, INTEL], &[]);
        let named = root.path().join(LAVAPIPE);
        let variable = |name: &str| (name == "VK_DRIVER_FILES").then(|| named.clone());
        assert!(!may_have_processor_below(root.path(), &variable));
    }
}
