//! The table of built-in grippers and the text that lists them.

use semfm_robot::BUILTIN_GRIPPERS;

#[test]
fn the_readme_lists_every_built_in_gripper() {
    let readme = concat!(env!("CARGO_MANIFEST_DIR"), "/../../README.md");
    let text = std::fs::read_to_string(readme).unwrap();
    for gripper in BUILTIN_GRIPPERS {
        assert!(text.contains(&format!("`{}`", gripper.name)), "README.md lacks {}", gripper.name);
    }
}
