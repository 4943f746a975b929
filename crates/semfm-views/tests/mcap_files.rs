//! Views and embeddings there and back, and what their readers refuse.
#![cfg(feature = "mcap")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use foxglove::bytes::Bytes;
use foxglove::messages::{CameraCalibration, FrameTransform};
use prost::Message as _;
use semfm_geom::math::{DAffine3, DMat3, DVec3};
use semfm_geom::{Intrinsics, Mesh, Pinhole};
use semfm_views::mcap::{
    Dtype, EmbeddingsFile, EmbeddingsMetadata, MetadataRecord, ViewsFile, ViewsMetadata, inspect,
    read_bytes, read_messages, read_view, write_views,
};
use semfm_views::{EmbeddedView, Error, PatchEmbeddings, PatchGrid, View};

const SIZE: (u32, u32) = (12, 9);

fn mesh() -> Mesh {
    let vertices = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    Mesh::new(vertices, vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]).unwrap()
}

fn camera(view: usize) -> Pinhole {
    let turn = DMat3::from_rotation_y(0.9 * view as f64) * DMat3::from_rotation_x(0.4);
    let camera_from_object = DAffine3::from_mat3_translation(turn, DVec3::new(0.1, -0.2, 3.0));
    let (width, height) = SIZE;
    Pinhole::with_pixel_centres_at_half(
        Intrinsics { width, height, fx: 20.5, fy: 21.0, cx: 6.25, cy: 4.5 },
        camera_from_object,
    )
    .unwrap()
}

fn views_metadata() -> ViewsMetadata {
    let mut metadata = ViewsMetadata::of(&mesh(), SIZE.0, SIZE.1);
    metadata.rig = "turntable".to_owned();
    metadata.background = "white".to_owned();
    metadata.seed = u64::MAX;
    metadata.more.insert("renderer".to_owned(), "cpu".to_owned());
    metadata
}

fn views() -> Vec<View> {
    let n_pixels = (SIZE.0 * SIZE.1) as usize;
    let triangle = |p: usize| if p.is_multiple_of(3) { -1 } else { (p % 4) as i32 };
    let depth = |p: usize| if triangle(p) < 0 { f32::INFINITY } else { 2.5 + p as f32 * 0.01 };
    let view = |view| View {
        camera: camera(view),
        rgb: (0..3 * n_pixels).map(|i| (i * 31 + view) as u8).collect(),
        depth: (0..n_pixels).map(depth).collect(),
        triangles: (0..n_pixels).map(triangle).collect(),
    };
    (0..2).map(view).collect()
}

fn embeddings() -> EmbeddingsFile {
    let (rows, cols, dim) = (2, 3, 4);
    let view = |view: usize| EmbeddedView {
        camera: camera(view),
        patches: PatchEmbeddings::new(
            PatchGrid { rows, cols, rect: [0.0, 0.5, 12.0, 9.0] },
            dim,
            (0..rows * cols * dim).map(|i| ((i * 13 + view) % 29) as f32 / 29.0).collect(),
            vec![0, 1, 2, 253, 254, 255],
            vec![true, true, true, true, true, false],
        )
        .unwrap(),
    };
    let metadata = EmbeddingsMetadata {
        views: views_metadata(),
        encoder: "simulated".to_owned(),
        revision: "0".to_owned(),
        preprocessing: "none".to_owned(),
        rolls: 4,
        outliers: "norm".to_owned(),
        simulated: true,
    };
    EmbeddingsFile { path: PathBuf::new(), metadata, views: vec![view(0), view(1)] }
}

/// The same patches with other vectors.
fn with_data(patches: &PatchEmbeddings, dim: usize, data: Vec<f32>) -> PatchEmbeddings {
    let (coverage, valid) = (patches.coverage().to_vec(), patches.valid().to_vec());
    PatchEmbeddings::new(patches.grid(), dim, data, coverage, valid).unwrap()
}

/// A folder with an embeddings file in it, and the file.
fn written_embeddings() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.emb.mcap");
    embeddings().write(&path, Dtype::F32).unwrap();
    (folder, path)
}

fn assert_same_camera(found: &Pinhole, expected: &Pinhole) {
    let off = |a: DAffine3, b: DAffine3| {
        let (a, b) = (a.to_cols_array(), b.to_cols_array());
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    // The pose goes through a quaternion and an inverse: rounding, no more.
    assert!(off(found.camera_from_world(), expected.camera_from_world()) < 1e-14);
    assert_eq!(found.intrinsics(), expected.intrinsics());
}

#[test]
fn single_precision_comes_back_bit_for_bit_and_half_to_its_rounding() {
    let (folder, path) = written_embeddings();
    let (original, single) = (embeddings(), EmbeddingsFile::read(&path).unwrap());
    assert_eq!(single.metadata, original.metadata);
    let half_path = folder.path().join("half.emb.mcap");
    original.write(&half_path, Dtype::F16).unwrap();
    let half = EmbeddingsFile::read(&half_path).unwrap();
    for view in 0..2 {
        let [original, single, half] = [&original, &single, &half].map(|file| &file.views[view]);
        assert_same_camera(&single.camera, &original.camera);
        assert_eq!(single.patches, original.patches);
        for (half, exact) in half.patches.data().iter().zip(original.patches.data()) {
            assert!((half - exact).abs() <= exact.abs() * f32::powi(0.5, 11), "{half} {exact}");
        }
    }
}

#[test]
fn views_come_back_whole_and_one_by_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.views.mcap");
    write_views(&path, &views(), &mesh(), Some(&[[9, 8, 7]; 4]), &views_metadata()).unwrap();
    let file = ViewsFile::read(&path).unwrap();
    assert_eq!(file.metadata, views_metadata());
    assert_eq!(file.views.len(), 2);
    for (view, (found, expected)) in file.views.iter().zip(views()).enumerate() {
        assert_same_camera(&found.camera, &expected.camera);
        assert_eq!(*found, View { camera: found.camera, ..expected });
        assert_eq!(read_view(&path, view).unwrap().view, *found);
    }
    let error = read_view(&path, 2).unwrap_err();
    assert!(error.to_string().starts_with("view: expected 000 to 001"), "{error}");
}

#[test]
fn topics_and_schemas_are_those_of_the_format() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.views.mcap");
    write_views(&path, &views(), &mesh(), None, &views_metadata()).unwrap();
    let report = inspect(&path).unwrap();
    let channels: BTreeMap<&str, (&str, u64)> = report
        .channels
        .iter()
        .map(|c| (c.topic.as_str(), (c.schema.as_deref().unwrap(), c.n_messages)))
        .collect();
    let mut expected = BTreeMap::from([
        ("/mesh", ("foxglove.SceneUpdate", 1)),
        ("/tf", ("foxglove.FrameTransform", 2)),
    ]);
    for view in ["000", "001"] {
        for (what, schema) in [
            ("image", "foxglove.CompressedImage"),
            ("camera", "foxglove.CameraCalibration"),
            ("depth", "foxglove.RawImage"),
            ("triangles", "foxglove.RawImage"),
        ] {
            let topic: &str = format!("/views/{view}/{what}").leak();
            expected.insert(topic, (schema, 1));
        }
    }
    assert_eq!(channels, expected);
    assert_eq!(report.n_messages, 11);
    assert_eq!(report.semfm.unwrap()["mesh_hash"], mesh().hash().to_string());
}

#[test]
fn embeddings_of_another_mesh_are_refused_by_name() {
    let (_folder, path) = written_embeddings();
    let file = EmbeddingsFile::read(&path).unwrap();
    file.check_mesh(&mesh()).unwrap();
    let other = Mesh::new(vec![DVec3::ZERO, DVec3::X, DVec3::Y], vec![[0, 1, 2]]).unwrap();
    let error = file.check_mesh(&other).unwrap_err();
    assert_eq!(error.code(), "other-mesh");
    let text = error.to_string();
    for part in [mesh().hash().to_string(), other.hash().to_string(), "(4 vertices".to_owned()] {
        assert!(text.contains(&part), "{text}");
    }
}

#[test]
fn what_cannot_be_read_is_not_written_and_leaves_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.emb.mcap");
    let mut dim = embeddings();
    let data = dim.views[1].patches.data()[..2 * 3 * 2].to_vec();
    dim.views[1].patches = with_data(&dim.views[1].patches, 2, data);
    let mut scaled = embeddings();
    // Near enough to a rotation for a camera, but not for the quaternion of a file.
    let mut pose = scaled.views[0].camera.camera_from_world();
    pose.matrix3 *= 1.000_001;
    scaled.views[0].camera = scaled.views[0].camera.posed(pose).unwrap();
    let mut huge = embeddings();
    let mut data = huge.views[0].patches.data().to_vec();
    data[3] = 70_000.0;
    huge.views[0].patches = with_data(&huge.views[0].patches, 4, data);
    let empty = EmbeddingsFile { views: Vec::new(), ..embeddings() };
    for file in [dim, scaled, huge, empty] {
        let error = file.write(&path, Dtype::F16).unwrap_err();
        assert!(matches!(error, Error::Invalid { .. }), "{error}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "{error}");
    }
    // A NaN is welcome where the patch says that it is not valid.
    let mut invalid = embeddings();
    let mut data = invalid.views[0].patches.data().to_vec();
    *data.last_mut().unwrap() = f32::NAN;
    invalid.views[0].patches = with_data(&invalid.views[0].patches, 4, data);
    invalid.write(&path, Dtype::F16).unwrap();
    EmbeddingsFile::read(&path).unwrap();
}

/// `semfm.PatchEmbeddings`, written down a second time from its published definition.
#[derive(Clone, PartialEq, prost::Message)]
struct Grid {
    #[prost(string, tag = "2")]
    frame_id: String,
    #[prost(uint32, tag = "3")]
    rows: u32,
    #[prost(uint32, tag = "5")]
    dim: u32,
    #[prost(string, tag = "6")]
    dtype: String,
    #[prost(bytes = "bytes", tag = "7")]
    data: Bytes,
    #[prost(uint32, tag = "4")]
    cols: u32,
    #[prost(float, tag = "10")]
    x1: f32,
    #[prost(float, tag = "11")]
    y1: f32,
    #[prost(bytes = "bytes", tag = "12")]
    coverage: Bytes,
    #[prost(bytes = "bytes", tag = "13")]
    valid: Bytes,
}

/// Copies a file message by message; `edit` may change a message, or drop it by `None`.
fn rewrite(
    from: &Path,
    to: &Path,
    edit: impl Fn(&str, u64, Vec<u8>) -> Option<Vec<u8>>,
    edit_metadata: impl Fn(&mut BTreeMap<String, String>),
) {
    let mut writer = mcap::Writer::new(std::fs::File::create(to).unwrap()).unwrap();
    let mut messages = Vec::new();
    let contents = read_messages(from, |message| {
        messages.push((message.channel.clone(), message.index, message.data.to_vec()));
        Ok(())
    })
    .unwrap();
    for MetadataRecord { name, entries: mut metadata } in contents.metadata {
        edit_metadata(&mut metadata);
        writer.write_metadata(&mcap::records::Metadata { name, metadata }).unwrap();
    }
    for (channel, index, data) in messages {
        let Some(data) = edit(&channel.topic, index, data) else { continue };
        let schema = channel.schema.unwrap();
        let schema = writer.add_schema(&schema.name, &schema.encoding, &schema.data).unwrap();
        let channel = writer
            .add_channel(schema, &channel.topic, &channel.message_encoding, &BTreeMap::new())
            .unwrap();
        let header = mcap::records::MessageHeader {
            channel_id: channel,
            sequence: 0,
            log_time: 0,
            publish_time: 0,
        };
        writer.write_to_known_channel(&header, &data).unwrap();
    }
    writer.finish().unwrap();
}

/// The refusal of an embeddings file in which messages were changed.
fn refusal(edit: impl Fn(&str, u64, Vec<u8>) -> Option<Vec<u8>>) -> Error {
    let (folder, path) = written_embeddings();
    let changed = folder.path().join("changed.emb.mcap");
    rewrite(&path, &changed, edit, |_| {});
    EmbeddingsFile::read(&changed).expect_err("the changed file was accepted")
}

/// The refusal of a file in which the grid of view 001 was changed.
fn grid_refusal(change: impl Fn(&mut Grid)) -> String {
    let error = refusal(|topic, _, data| {
        if topic != "/views/001/embeddings" {
            return Some(data);
        }
        let mut grid = Grid::decode(&data[..]).unwrap();
        change(&mut grid);
        Some(grid.encode_to_vec())
    });
    assert_eq!(error.code(), "format");
    assert_eq!(error.place().unwrap(), "topic /views/001/embeddings, message 0");
    error.to_string()
}

#[test]
fn a_file_rewritten_without_change_is_accepted() {
    let (folder, path) = written_embeddings();
    let copy = folder.path().join("copy.emb.mcap");
    rewrite(&path, &copy, |_, _, data| Some(data), |_| {});
    let (original, copy) = (EmbeddingsFile::read(&path), EmbeddingsFile::read(&copy));
    assert_eq!(original.unwrap().views, copy.unwrap().views);
}

#[test]
fn grids_that_contradict_themselves_are_refused_with_their_message() {
    let dims = grid_refusal(|grid| {
        (grid.dim, grid.cols) = (6, 2);
        grid.coverage.truncate(4);
        grid.valid.truncate(4);
    });
    assert!(dims.contains("dimension 4, as in the views before, found 6"), "{dims}");
    let short = grid_refusal(|grid| grid.data.truncate(95));
    assert!(short.contains("2 × 3 × 4 numbers of 4 bytes, found 95 bytes"), "{short}");
    let dtype = grid_refusal(|grid| grid.dtype = "bf16".to_owned());
    assert!(dtype.contains("found `bf16`"), "{dtype}");
    let overflow = grid_refusal(|grid| (grid.rows, grid.cols, grid.dim) = (!0, !0, !0));
    assert!(overflow.contains("found 96 bytes of data"), "{overflow}");
    let frame = grid_refusal(|grid| grid.frame_id = "view_000".to_owned());
    assert!(frame.contains("expected the frame `view_001`"), "{frame}");
    let nan = grid_refusal(|grid| {
        let mut data = grid.data.to_vec();
        data[16..20].copy_from_slice(&f32::NAN.to_le_bytes());
        grid.data = data.into();
    });
    assert!(nan.contains("NaN or infinity at row 0, column 1"), "{nan}");
    let valid = grid_refusal(|grid| grid.valid = vec![1, 1, 1, 2, 1, 0].into());
    assert!(valid.contains("expected 0 or 1"), "{valid}");
    let coverage = grid_refusal(|grid| grid.coverage.truncate(5));
    assert!(coverage.contains("coverages: 6, found 5"), "{coverage}");
    let rect = grid_refusal(|grid| grid.x1 = 0.0);
    assert!(rect.contains("left < right"), "{rect}");
}

#[test]
fn missing_and_bent_cameras_are_refused() {
    let missing = refusal(|topic, _, data| (topic != "/views/001/camera").then_some(data));
    assert!(missing.to_string().contains("topic /views/NNN/camera: expected 2 views"), "{missing}");
    let no_pose = refusal(|topic, index, data| ((topic, index) != ("/tf", 0)).then_some(data));
    assert!(no_pose.to_string().contains("topic /tf: expected 2 views"), "{no_pose}");
    let no_grid = refusal(|topic, _, data| (topic != "/views/000/embeddings").then_some(data));
    assert!(no_grid.to_string().contains("expected 2 views"), "{no_grid}");
    let twice = refusal(|topic, index, data| {
        if (topic, index) != ("/tf", 1) {
            return Some(data);
        }
        let mut transform = FrameTransform::decode(&data[..]).unwrap();
        transform.child_frame_id = "view_000".to_owned();
        Some(transform.encode_to_vec())
    });
    assert!(twice.to_string().contains("topic /tf, message 1: expected one message"), "{twice}");
    let scaled = refusal(|topic, index, data| {
        if (topic, index) != ("/tf", 1) {
            return Some(data);
        }
        let mut transform = FrameTransform::decode(&data[..]).unwrap();
        transform.rotation.as_mut().unwrap().w *= 1.1;
        Some(transform.encode_to_vec())
    });
    assert!(scaled.to_string().contains("topic /tf, message 1: expected a rigid"), "{scaled}");
    let bent = refusal(|topic, _, data| {
        if topic != "/views/000/camera" {
            return Some(data);
        }
        let mut camera = CameraCalibration::decode(&data[..]).unwrap();
        camera.d = vec![0.1, 0.0, 0.0, 0.0, 0.0];
        Some(camera.encode_to_vec())
    });
    assert!(bent.to_string().contains("expected no distortion"), "{bent}");
}

#[test]
fn metadata_that_miss_or_contradict_are_refused() {
    let (folder, path) = written_embeddings();
    let changed = folder.path().join("changed.emb.mcap");
    for (key, value, expected) in [
        ("mesh_hash", Some("blake3:00"), "64 hexadecimal digits"),
        ("mesh_hash", None, "a value, found nothing"),
        ("n_views", Some("3"), "expected 3 views"),
        ("n_views", Some("99999999999"), "1 to 100000 views"),
        ("format", Some("semfm.embeddings/2"), "expected semfm.embeddings/1"),
        ("width", Some("wide"), "a whole number"),
        ("width", Some("13"), "13 × 9 pixels, as the metadata say, found 12 × 9"),
    ] {
        rewrite(
            &path,
            &changed,
            |_, _, data| Some(data),
            |entries| {
                match value {
                    Some(value) => entries.insert(key.to_owned(), value.to_owned()),
                    None => entries.remove(key),
                };
            },
        );
        let error = EmbeddingsFile::read(&changed).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
}

/// One file of each kind, as bytes.
fn small_files() -> Vec<Vec<u8>> {
    let folder = tempfile::tempdir().unwrap();
    let views_path = folder.path().join("a.views.mcap");
    write_views(&views_path, &views(), &mesh(), None, &views_metadata()).unwrap();
    let embeddings_path = folder.path().join("a.emb.mcap");
    embeddings().write(&embeddings_path, Dtype::F16).unwrap();
    [views_path, embeddings_path].map(|path| std::fs::read(path).unwrap()).into()
}

fn is_sound(bytes: &[u8]) -> bool {
    read_bytes(Path::new("fuzzed.mcap"), bytes, |_| Ok(())).is_ok()
}

#[test]
fn every_cut_and_every_flipped_bit_is_noticed() {
    for mut bytes in small_files() {
        assert!(is_sound(&bytes));
        for length in 0..bytes.len() {
            assert!(!is_sound(&bytes[..length]), "cut to {length} of {} bytes", bytes.len());
        }
        // All of our sections have checksums, so nothing may pass: one bit of every byte.
        for at in 0..bytes.len() {
            let bit = 1 << (at * 5 % 8);
            bytes[at] ^= bit;
            assert!(!is_sound(&bytes), "bit {bit:#x} of byte {at} flipped");
            bytes[at] ^= bit;
        }
    }
}

#[test]
fn random_damage_never_panics_nor_hands_out_a_whole_file() {
    let mut state = 0x9E37_79B9_7F4A_7C15u64;
    let mut random = |below: usize| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state % below as u64) as usize
    };
    for bytes in small_files() {
        for _ in 0..4000 {
            let mut damaged = bytes.clone();
            for _ in 0..=random(4) {
                let at = random(damaged.len());
                match random(4) {
                    // Lengths and counts are the dangerous ones: extreme bytes, and runs of them.
                    0 => damaged[at] = 0xFF,
                    1 => damaged[at..].iter_mut().take(8).for_each(|byte| *byte = 0xFF),
                    2 => damaged[at] = random(256) as u8,
                    _ => {
                        let end = (at + random(64)).min(damaged.len());
                        damaged.drain(at..end);
                    }
                }
            }
            assert!(damaged == bytes || !is_sound(&damaged));
        }
    }
}
