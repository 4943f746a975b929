//! Small sound files of every format, and what happens when their bytes are damaged.

use std::fs;
use std::path::Path;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use semfm_geom::io::{VertexAttributes, read_mesh, read_points, write_mesh_with_attributes};
use semfm_geom::math::DVec3;
use semfm_geom::{Error, Mesh};

fn write_and_read(name: &str, bytes: &[u8]) -> Result<semfm_geom::io::MeshFile, Error> {
    thread_local!(static FOLDER: tempfile::TempDir = tempfile::tempdir().unwrap());
    let path = FOLDER.with(|folder| folder.path().join(name));
    fs::write(&path, bytes).unwrap();
    // A cloud may be read where a mesh may not; it must not panic either.
    let _ = read_points(&path);
    read_mesh(&path)
}

/// Sound files, each with all that its reader knows.
fn sound_files() -> Vec<(&'static str, Vec<u8>)> {
    let text = |text: &str| text.as_bytes().to_vec();
    let mut files = vec![
        (
            "a.obj",
            text(
                "# a\nv 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 1 1 0 0 0 1\nv 0 1 0 1 1 1 .5\nvt 0 0\nvt 1 1\n\
                        vn 0 0 1\nf 1/1/1 2/2/1 3/1 \\\n 4/2\nf -4 -3//1 -1\nl 1 2\nf 1 2\n",
            ),
        ),
        (
            "a.off",
            text(
                "STCNOFF # a\n4 2 0\n0 0 0  0 0 1  255 0 0 255  0 0\n1 0 0  0 0 1  0 255 0 255  1 0\n\
                        1 1 0  0 0 1  0 0 255 255  1 1\n0 1 0  0 0 1  9 9 9 255  0 1\n4 0 1 2 3 255 0 0\n3 0 1 3\n",
            ),
        ),
        (
            "a.stl",
            text(
                "solid a\n facet normal 0 0 1\n outer loop\n vertex 0 0 0\n vertex 1 0 0\n\
                        vertex 0 1 0\n endloop\n endfacet\nendsolid a\nsolid b\nendsolid\n",
            ),
        ),
        (
            "a.ply",
            text(
                "ply\nformat ascii 1.0\ncomment a\nelement vertex 4\nproperty float x\nproperty float y\n\
                        property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n\
                        element face 2\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\n\
                        element extra 1\nproperty list int double junk\nend_header\n0 0 0 1 2 3\n1 0 0 1 2 3\n\
                        1 1 0 1 2 3\n0 1 0 1 2 3\n4 0 1 2 3 8 0 0 1 0 1 1 0 1\n3 0 1 2 6 0 0 1 0 1 1\n2 1 2\n",
            ),
        ),
        (
            "strips.ply",
            text(
                "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\n\
                        property float z\nelement tristrips 1\nproperty list int int vertex_indices\nend_header\n\
                        0 0 0\n1 0 0\n0 1 0\n1 1 0\n2 2 2\n8 0 1 2 3 -1 2 3 4\n",
            ),
        ),
        ("a.gltf", text(GLTF)),
    ];
    let folder = tempfile::tempdir().unwrap();
    let vertices = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    let mesh = Mesh::new(vertices, vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]).unwrap();
    for name in ["b.ply", "b.glb"] {
        let path = folder.path().join(name);
        let attributes = VertexAttributes {
            colors: Some(&[[9, 99, 199, 255]; 4]),
            scalars: &[("weight", &[0.5; 4])],
        };
        write_mesh_with_attributes(&path, &mesh, &attributes).unwrap();
        files.push((name, fs::read(&path).unwrap()));
    }
    let path = folder.path().join("b.stl");
    semfm_geom::io::write_mesh(&path, &mesh).unwrap();
    files.push(("b.stl", fs::read(&path).unwrap()));
    files
}

/// A mirrored triangle with a sparse corner, a texture and a child that shows it again as a strip.
const GLTF: &str = include_str!("fixtures/mirrored_triangle.gltf");

#[test]
fn the_sound_files_are_sound() {
    for (name, bytes) in sound_files() {
        let file = write_and_read(name, &bytes).unwrap_or_else(|error| panic!("{error}"));
        let counts = (file.mesh.n_vertices(), file.n_faces, file.mesh.n_faces());
        let expected = match name {
            "a.obj" | "a.off" | "a.ply" => (4, 2, 3),
            "strips.ply" => (5, 3, 3),
            "a.stl" => (3, 1, 1),
            "a.gltf" => (6, 2, 2),
            _ => (4, 4, 4),
        };
        assert_eq!(counts, expected, "{name}");
        assert_eq!(
            file.appearance.vertex_colors.is_some(),
            !name.ends_with("stl") && name != "strips.ply",
            "{name}"
        );
        assert_eq!(
            file.appearance.corner_uvs.is_some(),
            ["a.obj", "a.off", "a.ply"].contains(&name),
            "{name}"
        );
    }
}

#[test]
fn a_broken_image_leaves_the_geometry_and_a_reason() {
    let file = write_and_read("a.gltf", GLTF.as_bytes()).unwrap();
    assert!(file.appearance.notes.iter().any(|note| note.contains("image of material 0")));
    // The sparse corner moved to (1, 0, 0), the mirror turned x and the winding around.
    assert_eq!(file.mesh.corners(0), [DVec3::ZERO, -DVec3::X, -DVec3::X]);
    assert_eq!(file.mesh.faces()[0], [0, 2, 1]);
}

#[test]
fn points_that_are_no_return_are_left_out_in_every_format() {
    let folder = tempfile::tempdir().unwrap();
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
               property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n\
               nan nan nan 1 2 3\n1 2 3 4 5 6\n0 nan 0 7 8 9\n";
    let pcd = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 3\nHEIGHT 1\nPOINTS 3\n\
               DATA ascii\nnan nan nan\n1 2 3\n0 nan 0\n";
    for (name, text) in [("a.ply", ply), ("a.pcd", pcd), ("a.obj", "v nan 0 0\nv 1 2 3\n")] {
        let path = folder.path().join(name);
        fs::write(&path, text).unwrap();
        let cloud = read_points(&path).unwrap();
        assert_eq!(cloud.points, [DVec3::new(1.0, 2.0, 3.0)], "{name}");
        let colors = cloud.colors.unwrap_or(vec![[4, 5, 6, 255]]);
        assert_eq!(colors, [[4, 5, 6, 255]], "{name}");
        fs::write(&path, text.replace("1 2 3", "1 inf 3")).unwrap();
        assert_eq!(read_points(&path).unwrap_err().code(), "non-finite", "{name}");
    }
}

#[test]
fn damaged_bytes_never_panic() {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let interesting =
        [0u8, 0xff, 0x7f, 0x80, b'-', b'9', b'e', b' ', b'\n', b'/', b'.', b'{', b'"', b'#'];
    for (name, sound) in sound_files() {
        for round in 0..400 {
            let mut bytes = sound.clone();
            match round % 4 {
                // Cut short.
                0 => bytes.truncate(rng.next_u32() as usize % sound.len()),
                // A piece taken out, or doubled.
                1 => {
                    let start = rng.next_u32() as usize % sound.len();
                    let end = (start + 1 + rng.next_u32() as usize % 16).min(sound.len());
                    let piece = sound[start..end].to_vec();
                    let again = if rng.next_u32() % 2 == 0 { piece.repeat(2) } else { Vec::new() };
                    bytes.splice(start..end, again);
                }
                // A few bytes changed, to anything or to something telling.
                kind => {
                    for _ in 0..1 + rng.next_u32() % 4 {
                        let at = rng.next_u32() as usize % bytes.len();
                        let any = rng.next_u32();
                        bytes[at] = if kind == 2 {
                            any as u8
                        } else {
                            interesting[any as usize % interesting.len()]
                        };
                    }
                }
            }
            let _ = write_and_read(name, &bytes);
        }
    }
}

#[test]
fn errors_say_where_and_what() {
    let place = |name: &str, text: &str| {
        let error = write_and_read(name, text.as_bytes()).unwrap_err();
        (error.code(), error.place().unwrap_or_default(), error.to_string())
    };
    let (code, at, message) = place("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1\n");
    assert_eq!((code, at.as_str()), ("format", "line 3"));
    assert!(message.ends_with("a.obj: line 3: expected 3 coordinates, found 2"), "{message}");
    assert_eq!(place("a.obj", "v 0 0 0\nf 1 2 1\n").1, "line 2");
    assert_eq!(place("a.obj", "v 0 0 0\nl 1 1\n").0, "no-faces");
    assert_eq!(place("a.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3").0, "non-finite");
    assert_eq!(place("a.obj", "v 0 0 1e300\nv 1 0 0\nv 0 1 0\nf 1 2 3").0, "too-large");
    assert_eq!(place("a.off", "OFF\n1 1 0\n0 0 0\n3 0 0 1\n").1, "line 4");
    let ply = "ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\n\
               property float y\nproperty float z\nend_header\n";
    assert!(place("a.ply", ply).2.contains("expected 4000000000 rows of element vertex"));
    assert_eq!(read_mesh(Path::new("/nowhere/a.obj")).unwrap_err().code(), "io");
}
