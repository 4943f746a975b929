//! Scenes for Foxglove: what a file holds, and what is refused.
#![cfg(feature = "mcap")]

use std::collections::BTreeMap;

use foxglove::messages::FrameTransform;
use semfm::geom::math::{DAffine3, DVec3};
use semfm::geom::{Intrinsics, Mesh, Pinhole};
use semfm::views::View;
use semfm::views::mcap::{METADATA_NAME, decode, read_messages};
use semfm_show::foxglove::{
    ColoredPoints, FoxgloveScene, NamedNumbers, SceneLabel, SceneLink, SceneMesh, SceneNumbers,
    ScenePicture, ScenePoint, ScenePoints, read_cloud,
};

fn mesh() -> Mesh {
    let vertices = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    Mesh::new(vertices, vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]).unwrap()
}

fn view() -> View {
    let (width, height) = (12, 9);
    let n_pixels = (width * height) as usize;
    let camera = Pinhole::with_pixel_centres_at_half(
        Intrinsics { width, height, fx: 20.5, fy: 21.0, cx: 6.25, cy: 4.5 },
        DAffine3::from_translation(DVec3::new(0.1, -0.2, 3.0)),
    )
    .unwrap();
    let rgb = (0..3 * n_pixels).map(|i| (i * 31) as u8).collect();
    View { camera, rgb, depth: vec![2.5; n_pixels], triangles: vec![0; n_pixels] }
}

fn mesh_in<'a>(
    topic: &'a str,
    frame_id: &'a str,
    mesh: &'a Mesh,
    colors: &'a [[u8; 3]],
) -> SceneMesh<'a> {
    let (vertices, faces) = (mesh.vertices(), mesh.faces());
    SceneMesh { topic, frame_id, name: "mesh", vertices, faces, colors: Some(colors) }
}

#[test]
fn a_scene_holds_its_meshes_clouds_and_frames() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("transfer.mcap");
    let (mesh, colors, view) = (mesh(), [[1, 2, 3]; 4], view());
    let numbers = [NamedNumbers { name: "weight", numbers: SceneNumbers::F32(&[0.5; 4]) }];
    let cloud = ScenePoints {
        topic: "/target/cloud",
        frame_id: "target",
        points: mesh.vertices(),
        colors: &colors,
        numbers: &numbers,
    };
    let scene = FoxgloveScene {
        meshes: vec![
            mesh_in("/source/mesh", "source", &mesh, &colors),
            mesh_in("/target/mesh", "target", &mesh, &colors),
        ],
        clouds: vec![cloud],
        labels: vec![SceneLabel {
            topic: "/labels",
            frame_id: "target",
            at: None,
            text: "target".to_owned(),
            color: [0; 3],
        }],
        links: vec![SceneLink {
            topic: "/matches",
            from: ScenePoint { frame_id: "source", position: DVec3::ZERO },
            to: ScenePoint { frame_id: "target", position: DVec3::X },
            color: [9; 3],
        }],
        pictures: vec![ScenePicture { frame_id: "source", name: "view", view: &view }],
        ..Default::default()
    };
    let about = serde_json::json!({"verdict": "accept"});
    scene.write(&path, "semfm.transfer/1", &about).unwrap();
    let mut shifts = BTreeMap::new();
    let contents = read_messages(&path, |message| {
        if message.channel.topic == "/tf" {
            let transform: FrameTransform = decode(&path, &message, "foxglove.FrameTransform")?;
            shifts.insert(transform.child_frame_id, transform.translation.unwrap().x);
        }
        Ok(())
    })
    .unwrap();
    // Two meshes, a cloud, a label, links, a camera, a picture, three frames.
    assert_eq!(contents.n_messages(), 10);
    let record = &contents.metadata[0];
    assert_eq!(
        (record.name.as_str(), record.entries["json"].as_str()),
        (METADATA_NAME, r#"{"verdict":"accept"}"#)
    );
    // One wide each, a quarter apart.
    assert_eq!((shifts["source"], shifts["target"]), (0.0, 1.25));
    let found = read_cloud(&path, "/target/cloud").unwrap().unwrap();
    let written = ColoredPoints { points: mesh.vertices().to_vec(), colors: colors.to_vec() };
    assert_eq!(found, written);
    assert_eq!(read_cloud(&path, "/source/cloud").unwrap(), None);

    let spoil: [fn(&mut FoxgloveScene<'_>); 4] = [
        |scene| scene.meshes[0].colors = Some(&[[0; 3]; 3]),
        |scene| scene.meshes[0].faces = &[[0, 1, 4]],
        |scene| scene.labels[0].frame_id = "elsewhere",
        |scene| scene.links[0].to.frame_id = "elsewhere",
    ];
    for spoil in spoil {
        let mut bad = scene.clone();
        spoil(&mut bad);
        assert!(bad.write(&path, "semfm.transfer/1", &about).is_err());
    }
    let mut dark = view.clone();
    dark.rgb.clear();
    let pictures = vec![ScenePicture { view: &dark, ..scene.pictures[0] }];
    let bad = FoxgloveScene { pictures, ..scene.clone() };
    assert!(bad.write(&path, "semfm.transfer/1", &about).is_err());
    let short = [NamedNumbers { name: "weight", numbers: SceneNumbers::F32(&[0.5; 3]) }];
    let clouds = vec![ScenePoints { numbers: &short, ..cloud }];
    let bad = FoxgloveScene { clouds, ..scene.clone() };
    assert!(bad.write(&path, "semfm.transfer/1", &about).is_err());
}
