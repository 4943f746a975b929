//! Sound files of every kind, made in code: what is damaged to try the readers.

use std::path::{Path, PathBuf};

use semfm::files::{GraspsFile, Provenance, TransferResult, write_region, write_transfer};
use semfm::geom::io::{VertexAttributes, write_mesh_with_attributes};
use semfm::geom::math::{DAffine3, DVec3};
use semfm::geom::{Intrinsics, Pinhole};
use semfm::grasp::GraspSettings;
use semfm::robot::Gripper;
use semfm::views::mcap::{Dtype, EmbeddingsFile, EmbeddingsMetadata, ViewsMetadata, write_views};
use semfm::views::{EmbeddedView, PatchEmbeddings, PatchGrid, View};
use semfm::{FeatureSource, GraspRequest, Mesh, PipelineSettings, Region, Task, prepare, transfer};

use crate::readers::{ROBOT_MESH, seed_mesh};
use crate::shell::shared;

/// Files in the shared corpus that are larger than this make poor seeds.
const MAX_SEED: u64 = 64 << 10;

/// Most files of the shared corpus for one reader.
const MAX_FROM_CORPUS: usize = 200;

/// An SRDF of the synthetic arm with every element that is read.
const SRDF: &str = r#"<?xml version="1.0"?><robot name="synth_arm">
  <group name="arm"><chain base_link="base" tip_link="flange"/></group>
  <group name="hand"><link name="hand"/><joint name="left_finger_joint"/><passive_joint name="right_finger_joint"/></group>
  <group name="all"><group name="arm"/><group name="hand"/></group>
  <group_state name="ready" group="arm"><joint name="joint1" value="0.5"/><joint name="joint2" value="-1e-1"/></group_state>
  <end_effector name="gripper" parent_link="flange" group="hand" parent_group="arm"/>
  <virtual_joint name="world" type="fixed" parent_frame="world" child_link="base"/>
  <passive_joint name="right_finger_joint"/>
  <disable_default_collisions link="left_finger"/><enable_collisions link1="base" link2="left_finger"/>
  <disable_collisions link1="base" link2="hand" reason="Never"/>
</robot>"#;

/// Limits as MoveIt and roboplan write them.
const JOINT_LIMITS: &str = "# limits\ndefault_velocity_scaling_factor: 0.1\njoint_limits:\n  joint1:\n    \
    has_velocity_limits: true\n    max_velocity: 2.175\n    has_acceleration_limits: true\n    \
    max_acceleration: 3.75\n    has_jerk_limits: false\n    max_jerk: 300.0\n  \
    joint2: {min_position: -1.5, max_position: 1e0, max_acceleration: [2.0]}\n";

/// The same table inside parameters of ROS 2.
const JOINT_LIMITS_OF_ROS: &str = "/**:\n  ros__parameters:\n    robot_description_planning:\n      \
    joint_limits:\n        \"joint1\": {max_velocity: 2}\n";

/// The seeds of a reader: files made here and, where it is at hand, those of the shared corpus.
///
/// # Panics
/// As [`own_seeds`].
pub fn seeds(reader: &str) -> Vec<Vec<u8>> {
    [own_seeds(reader), from_corpus(reader)].concat()
}

/// The files that are made here.
///
/// # Panics
/// For a name that is no reader's, and where a file cannot be made.
pub fn own_seeds(reader: &str) -> Vec<Vec<u8>> {
    let folder = tempfile::tempdir().expect("room for a folder");
    match reader {
        "obj" | "off" | "ply" | "stl" | "glb" => meshes(reader, folder.path()),
        "gltf" => vec![GLTF.into(), GLTF_SCENE.into()],
        "pcd" => pcds(),
        "views" => vec![views_file(folder.path())],
        "embeddings" => [Dtype::F16, Dtype::F32].map(|d| embeddings(folder.path(), d)).into(),
        "json" => jsons(folder.path()),
        "urdf" => robots(folder.path()),
        "srdf" => vec![SRDF.into()],
        "joint_limits" => vec![JOINT_LIMITS.into(), JOINT_LIMITS_OF_ROS.into()],
        "recipe" => vec![semfm_run::TEMPLATE.into()],
        "npy" => vec![
            npy("<f4", seed_mesh().n_vertices(), 2, 4),
            npy("<f8", seed_mesh().n_vertices(), 1, 8),
        ],
        "npz" => vec![npz()],
        "png" => pngs(),
        "exr" => exrs(),
        other => panic!("no reader `{other}`"),
    }
}

/// Small files of the shared corpus, where it is at hand.
pub fn from_corpus(reader: &str) -> Vec<Vec<u8>> {
    let (kind, extension) = match reader {
        "views" | "embeddings" => ("mcap", "mcap"),
        "urdf" | "srdf" => ("urdf", reader),
        "joint_limits" => ("urdf", "yaml"),
        other => ("mesh", other),
    };
    let Some(corpus) = shared("corpus") else { return Vec::new() };
    let mut files = Vec::new();
    gather(&corpus.join(kind), extension, &mut files);
    files.sort();
    files.truncate(MAX_FROM_CORPUS);
    files.iter().filter_map(|path| std::fs::read(path).ok()).collect()
}

fn gather(folder: &Path, extension: &str, files: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let (path, Ok(about)) = (entry.path(), entry.metadata()) else { continue };
        if about.is_dir() {
            gather(&path, extension, files);
        } else if path.extension().is_some_and(|e| e == extension) && about.len() <= MAX_SEED {
            files.push(path);
        }
    }
}

fn tetrahedron() -> Mesh {
    let vertices = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    Mesh::new(vertices, vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]).expect("a tetrahedron")
}

fn meshes(extension: &str, folder: &Path) -> Vec<Vec<u8>> {
    let path = folder.join("a").with_extension(extension);
    let mut seeds = vec![match extension {
        "obj" => &b"# a\nv 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 1 1 0 0 0 1\nv 0 1 0 1 1 1 .5\nv .4 .5 0\nv .6 .5 0\nv .5 .6 0\n\
            vt 0 0\nvt 1 1\nvn 0 0 1\nf 1/1/1 2/2/1 3/1 \\\n 4/2\nf -4 -3//1 -1\nf 1 2 3 4 1 5 7 6 5\nl 1 2\n"[..],
        "off" => b"STCNOFF # a\n4 2 0\n0 0 0  0 0 1  255 0 0 255  0 0\n1 0 0  0 0 1  0 255 0 255  1 0\n\
            1 1 0  0 0 1  0 0 255 255  1 1\n0 1 0  0 0 1  9 9 9 255  0 1\n4 0 1 2 3 255 0 0\n3 0 1 3\n",
        "stl" => b"solid a\n facet normal 0 0 1\n outer loop\n vertex 0 0 0\n vertex 1 0 0\n vertex 0 1 0\n\
            endloop\n endfacet\nendsolid a\nsolid b\nendsolid\n",
        "ply" => b"ply\nformat ascii 1.0\ncomment a\nelement vertex 4\nproperty float x\nproperty float y\n\
            property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nelement face 2\n\
            property list uchar int vertex_indices\nproperty list uchar float texcoord\nelement tristrips 1\n\
            property list int int vertex_indices\nend_header\n0 0 0 1 2 3\n1 0 0 1 2 3\n1 1 0 1 2 3\n0 1 0 1 2 3\n\
            4 0 1 2 3 8 0 0 1 0 1 1 0 1\n3 0 1 2 6 0 0 1 0 1 1\n5 0 1 2 -1 3\n",
        _ => b"",
    }
    .to_vec()];
    seeds.retain(|seed| !seed.is_empty());
    let holds_attributes = matches!(extension, "ply" | "glb");
    let colors = [[9, 99, 199, 255]; 4];
    let attributes = VertexAttributes {
        colors: (extension != "stl").then_some(&colors[..]),
        scalars: if holds_attributes { &[("weight", &[0.5; 4])] } else { &[] },
    };
    write_mesh_with_attributes(&path, &tetrahedron(), &attributes).expect("a mesh file");
    seeds.push(std::fs::read(&path).expect("the file just written"));
    seeds
}

/// A mirrored triangle with a sparse corner, a texture and a child that shows it again as a strip.
const GLTF: &str = include_str!("../../crates/semfm-geom/tests/fixtures/mirrored_triangle.gltf");

/// A skin, morph targets, instances and a hidden node, all of numbers that take no bytes.
const GLTF_SCENE: &str = r#"{"asset": {"version": "2.0"}, "scenes": [{"nodes": [0, 1, 2, 3]}],
"nodes": [{"mesh": 0, "skin": 0}, {"mesh": 0, "weights": [0.5], "translation": [0, 0, 2]},
 {"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 1, "SCALE": 1}}}},
 {"mesh": 0, "extensions": {"KHR_node_visibility": {"visible": false}}}],
"skins": [{"joints": [0, 1], "inverseBindMatrices": 3}],
"meshes": [{"weights": [1], "primitives": [{"attributes": {"POSITION": 0, "JOINTS_0": 4, "WEIGHTS_0": 2}, "targets": [{"POSITION": 0}]}]}],
"buffers": [{"uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAABAAIAAAA=", "byteLength": 44}],
"bufferViews": [{"buffer": 0, "byteLength": 44}],
"accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
 {"bufferView": 0, "componentType": 5126, "count": 2, "type": "VEC3"},
 {"bufferView": 0, "componentType": 5121, "normalized": true, "count": 3, "type": "VEC4"},
 {"componentType": 5126, "count": 2, "type": "MAT4"},
 {"componentType": 5121, "count": 3, "type": "VEC4"}]}"#;

fn pcds() -> Vec<Vec<u8>> {
    let head = |data: &str| {
        format!(
            "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\nWIDTH 3\n\
             HEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 3\nDATA {data}\n"
        )
        .into_bytes()
    };
    let rows: Vec<u8> = (0..12u32).flat_map(|i| (i as f32 * 0.25).to_le_bytes()).collect();
    // LZF with literal runs only: a byte for the length less one, then the bytes.
    let packed: Vec<u8> =
        rows.chunks(32).flat_map(|run| [&[run.len() as u8 - 1], run].concat()).collect();
    let sizes = [packed.len() as u32, rows.len() as u32].map(u32::to_le_bytes).concat();
    vec![
        [&head("ascii")[..], b"0 0 0 1\nnan nan nan 2\n1 2 3 4\n"].concat(),
        [&head("binary")[..], &rows].concat(),
        [&head("binary_compressed")[..], &sizes, &packed].concat(),
    ]
}

fn camera(index: usize) -> Pinhole {
    let inside = Intrinsics { width: 16, height: 12, fx: 20.0, fy: 21.0, cx: 8.0, cy: 6.0 };
    let turn = DAffine3::from_rotation_y(0.5 * index as f64);
    let away = DAffine3::from_translation(DVec3::new(0.0, 0.0, 4.0));
    Pinhole::with_pixel_centres_at_half(inside, away * turn).expect("a camera")
}

fn views_file(folder: &Path) -> Vec<u8> {
    let mesh = tetrahedron();
    let views: Vec<View> = (0..2)
        .map(|index| View {
            camera: camera(index),
            rgb: (0..3 * 16 * 12).map(|byte| (byte * 7 + index) as u8).collect(),
            depth: (0..16 * 12).map(|p| 1.0 + p as f32 / 256.0).collect(),
            triangles: (0..16 * 12).map(|p| p % 4).collect(),
        })
        .collect();
    let path = folder.join("a.views.mcap");
    let metadata = ViewsMetadata::of(&mesh, 16, 12);
    write_views(&path, &views, &mesh, None, &metadata).expect("a views file");
    std::fs::read(&path).expect("the file just written")
}

fn embeddings(folder: &Path, dtype: Dtype) -> Vec<u8> {
    let (rows, cols, dim) = (3, 4, 5);
    let grid = PatchGrid { rows, cols, rect: [0.0, 0.0, 16.0, 12.0] };
    let views = (0..2)
        .map(|index| {
            let data = (0..rows * cols * dim).map(|i| (i % 7) as f32 / 8.0).collect();
            let patches = PatchEmbeddings::new(grid, dim, data, vec![255; 12], vec![true; 12]);
            EmbeddedView { camera: camera(index), patches: patches.expect("arrays that fit") }
        })
        .collect();
    let metadata = EmbeddingsMetadata {
        views: ViewsMetadata::of(seed_mesh(), 16, 12),
        encoder: "sample".to_owned(),
        revision: "1".to_owned(),
        preprocessing: "none".to_owned(),
        rolls: 1,
        outliers: "kept".to_owned(),
        simulated: true,
    };
    let path = folder.join("a.emb.mcap");
    let file = EmbeddingsFile { path: PathBuf::new(), metadata, views };
    file.write(&path, dtype).expect("an embeddings file");
    std::fs::read(&path).expect("the file just written")
}

/// All files of a transfer and of its grasps, and those of other programs.
fn jsons(folder: &Path) -> Vec<Vec<u8>> {
    let mesh = seed_mesh();
    let task = Task::default();
    let features: Vec<f32> =
        mesh.vertices().iter().flat_map(|p| [p.x as f32, p.z as f32]).collect();
    let settings = PipelineSettings::default();
    let object = prepare(mesh.clone(), FeatureSource::PerVertex(&features), &settings, &task)
        .expect("an object");
    let region = Region::from_vertices(mesh.n_vertices(), &[3, 4, 5, 6]).expect("a region");
    write_region(&folder.join("grip.json"), &region, mesh).expect("a region file");
    let found = transfer(&object.object, &object.object, &region, &settings.transfer, &task)
        .expect("a transfer");
    let provenance = Provenance::default();
    let result = TransferResult {
        source: &object,
        target: &object,
        region: &region,
        transfer: &found,
        provenance: &provenance,
    };
    write_transfer(folder, &result, &task).expect("the files of a transfer");

    let gripper = Gripper::builtin("franka").expect("a built-in gripper");
    let settings = GraspSettings { n_samples: 20, neighbour_rounds: 0, ..Default::default() };
    let request = GraspRequest { settings, ..GraspRequest::new(0.05) };
    let problem = request.prepare(mesh.clone().into(), gripper).expect("a request");
    let grasps = problem.find(&vec![1.0; mesh.n_vertices()], &task).expect("an answer");
    GraspsFile::new(&problem.result(&grasps)).write(&folder.join("grasps.json")).expect("a file");

    let mut seeds: Vec<Vec<u8>> = ["grip", "region", "report", "point_map", "grasps"]
        .map(|name| std::fs::read(folder.join(name).with_extension("json")).expect("a file"))
        .into();
    let hash = mesh.hash();
    seeds.push(
        format!(
            r#"{{"camera_from_object": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0.5], [0, 0, 0, 1]], "scale": 0.05,
            "format": "semfm.aligned/1", "verdict": "accept", "mesh": {{"hash": "{hash}"}}}}"#
        )
        .into_bytes(),
    );
    for text in [
        r#"{"format": "semfm.scene/1", "tables": [{"name": "t", "point": [0, 0, 0], "normal": [0, 0, 1]}],
            "boxes": [{"name": "b", "size": [1, 1, 0.1], "position": [0, 0, 1], "quaternion_xyzw": [0, 0, 0, 1]}],
            "cylinders": [{"name": "c", "radius": 0.1, "length": 0.2, "position": [0, 0, 1]}],
            "meshes": [{"name": "m", "file": "none.ply", "scale": 0.001, "position": [0, 0, 0]}]}"#,
        r#"{"format": "semfm.trajectory/1", "joint_names": ["a"], "grasp": null, "object": null,
            "robot": {"name": "r", "file": "none.urdf", "base": "b", "tip": "t",
              "hash": "blake3:af1349b9f5f9a1a6a0404dea36dcc9499bcb25c9adc112b7cc9a93cae41f3262"},
            "hand": {"name": "h", "parts": [], "openings": [0.08], "tip_from_part": [[]]},
            "obstacles": [{"name": "o", "shape": {"type": "box", "size": [1, 1, 1]},
              "base_from_obstacle": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0.5], [0, 0, 0, 1]]}],
            "segments": [{"kind": "to_pre_grasp", "points": [
              {"time": 0, "positions": [0], "velocities": [0], "accelerations": [0], "opening": 0.08},
              {"time": 1, "positions": [1], "velocities": [0], "accelerations": [0], "opening": 0.08}]}]}"#,
        r#"{"fx": 500.0, "fy": 500.0, "cx": 2.0, "cy": 1.5, "width": 4, "height": 3}"#,
        r#"{"K": [500, 0, 2, 0, 500, 1.5, 0, 0, 1], "width": 4, "height": 3, "D": [0, 0, 0, 0, 0]}"#,
        "[[500, 0, 2], [0, 500, 1.5], [0, 0, 1]]",
        r#"{"format": "semfm.eval-maps/1", "path": "a", "dataset": "blake3:1", "n_samples": 0, "rows": [], "summaries": []}"#,
    ] {
        seeds.push(text.into());
    }
    seeds
}

fn robots(folder: &Path) -> Vec<Vec<u8>> {
    let text = r#"<?xml version="1.0"?>
<robot name="hand">
  <link name="palm"><collision><origin xyz="0 0 0.03"/><geometry><box size="0.06 0.2 0.06"/></geometry></collision></link>
  <link name="left"><inertial><mass value="0.1"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4"/></inertial>
    <collision><geometry><box size="0.02 0.01 0.05"/></geometry></collision></link>
  <link name="right"><collision><geometry><mesh filename="finger.stl" scale="0.02 0.01 0.05"/></geometry></collision></link>
  <joint name="jl" type="prismatic"><parent link="palm"/><child link="left"/><origin xyz="0 0.005 0.085" rpy="0 0 0"/>
    <axis xyz="0 1 0"/><limit lower="0" upper="0.04" effort="1" velocity="1"/></joint>
  <joint name="jr" type="prismatic"><parent link="palm"/><child link="right"/><origin xyz="0 -0.015 0.06"/>
    <axis xyz="0 -1 0"/><limit lower="0" upper="0.04" effort="1" velocity="1"/><mimic joint="jl" multiplier="1" offset="0"/></joint>
</robot>"#;
    // A cube of edge 1 from the origin.
    let corner = |i: usize| DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2) as f64);
    let quads =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let faces = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let cube = Mesh::new((0..8).map(corner).collect(), faces).expect("a cube");
    let path = folder.join("finger.stl");
    semfm::geom::io::write_mesh(&path, &cube).expect("a mesh file");
    let stl = std::fs::read(&path).expect("the file just written");
    let boxes = text.replace(
        r#"<mesh filename="finger.stl" scale="0.02 0.01 0.05"/>"#,
        r#"<box size="0.02 0.01 0.05"/>"#,
    );
    vec![[text.as_bytes(), ROBOT_MESH, &stl].concat(), boxes.into_bytes()]
}

/// A NumPy array of zeros.
fn npy(dtype: &str, rows: usize, columns: usize, width: usize) -> Vec<u8> {
    let mut head =
        format!("{{'descr': '{dtype}', 'fortran_order': False, 'shape': ({rows}, {columns}), }}");
    while (10 + head.len() + 1) % 64 != 0 {
        head.push(' ');
    }
    head.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((head.len() as u16).to_le_bytes());
    bytes.extend(head.into_bytes());
    bytes.resize(bytes.len() + rows * columns * width, 0);
    bytes
}

/// An archive of stored arrays without checksums that fit: the damage is in the directory.
fn npz() -> Vec<u8> {
    let arrays = [
        ("V.npy", npy("<f8", 4, 3, 8)),
        ("F.npy", npy("<i4", 2, 3, 4)),
        ("gt.npy", npy("<i8", 2, 1, 8)),
    ];
    let (mut bytes, mut directory) = (Vec::new(), Vec::new());
    for (name, array) in &arrays {
        let at = bytes.len() as u32;
        let sizes =
            [crc32(array), array.len() as u32, array.len() as u32].map(u32::to_le_bytes).concat();
        let lengths = [name.len() as u16, 0].map(u16::to_le_bytes).concat();
        bytes.extend(
            [
                b"PK\x03\x04\x14\0\0\0\0\0\0\0\0\0".as_slice(),
                &sizes,
                &lengths,
                name.as_bytes(),
                array,
            ]
            .concat(),
        );
        directory.extend(
            [
                b"PK\x01\x02\x14\0\x14\0\0\0\0\0\0\0\0\0".as_slice(),
                &sizes,
                &lengths,
                &[0; 10],
                &at.to_le_bytes(),
                name.as_bytes(),
            ]
            .concat(),
        );
    }
    let (start, length) = (bytes.len() as u32, directory.len() as u32);
    bytes.extend(directory);
    bytes.extend(b"PK\x05\x06\0\0\0\0\x03\0\x03\0");
    bytes.extend([length, start].map(u32::to_le_bytes).concat());
    bytes.extend([0, 0]);
    bytes
}

/// The checksum of ZIP, a bit at a time.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| {
            (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg())
        })
    })
}

/// Depth and colours in EXR, by each way to pack them.
fn exrs() -> Vec<Vec<u8>> {
    use exr::prelude::*;
    let channel = |name: &str| {
        let values = (0..192).map(|i| 0.5 + 0.01 * i as f32).collect();
        AnyChannel::new(name, FlatSamples::F32(values))
    };
    let encoded = |names: &[&str], compression: Compression| {
        let channels = AnyChannels::sort(names.iter().map(|name| channel(name)).collect());
        let encoding = Encoding { compression, ..Encoding::FAST_LOSSLESS };
        let layer = Layer::new((16, 12), LayerAttributes::default(), encoding, channels);
        let mut bytes = std::io::Cursor::new(Vec::new());
        let image = Image::from_layer(layer);
        image.write().non_parallel().to_buffered(&mut bytes).expect("an EXR");
        bytes.into_inner()
    };
    let all = [Compression::Uncompressed, Compression::RLE, Compression::ZIP1, Compression::ZIP16];
    let all = all.into_iter().chain([Compression::PIZ, Compression::PXR24, Compression::B44]);
    all.flat_map(|packed| [encoded(&["Z"], packed), encoded(&["R", "G", "B"], packed)]).collect()
}

fn pngs() -> Vec<Vec<u8>> {
    let encoded = |picture: image::DynamicImage| {
        let mut bytes = std::io::Cursor::new(Vec::new());
        picture.write_to(&mut bytes, image::ImageFormat::Png).expect("a picture");
        bytes.into_inner()
    };
    let depth = image::ImageBuffer::from_fn(16, 12, |x, y| image::Luma([(500 + x * y) as u16]));
    let mask =
        image::RgbaImage::from_fn(16, 12, |x, _| image::Rgba([255, 255, 255, (x * 16) as u8]));
    vec![encoded(depth.into()), encoded(mask.into())]
}
