//! Writes a small scene into a folder: `sample.transfer.mcap`, for a reader in another language to check
//! (`crates/semfm-views/tests/check_mcap.py` does).
//!
//! `cargo run -p semfm-show --example write_sample_scene -- FOLDER`

use std::path::Path;

use semfm::Mesh;
use semfm::geom::math::DVec3;
use semfm_show::foxglove::{FoxgloveScene, SceneMesh, ScenePoints};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args().nth(1).ok_or("usage: write_sample_scene FOLDER")?;
    let folder = Path::new(&folder);
    std::fs::create_dir_all(folder)?;
    let vertices = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    let mesh = Mesh::new(vertices, vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])?;
    let colors = [[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 255]];
    let source = SceneMesh {
        topic: "/source/mesh",
        frame_id: "source",
        name: "mesh",
        vertices: mesh.vertices(),
        faces: mesh.faces(),
        colors: Some(&colors),
    };
    let target = SceneMesh { topic: "/target/mesh", frame_id: "target", ..source };
    let cloud = ScenePoints {
        topic: "/source/cloud",
        frame_id: "source",
        points: mesh.vertices(),
        colors: &colors,
        numbers: &[],
    };
    let about = serde_json::json!({"method": "sample"});
    let meshes = vec![source, target];
    let scene = FoxgloveScene { meshes, clouds: vec![cloud], ..Default::default() };
    scene.write(&folder.join("sample.transfer.mcap"), "semfm.transfer/1", &about)?;
    Ok(())
}
