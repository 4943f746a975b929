//! glTF scenes as viewers show them: skins, morph targets, hidden nodes, instances, compression.

use semfm_geom::io::{MeshFile, read_mesh};
use semfm_geom::math::DVec3;
use semfm_geom::{Error, Mesh};

/// A GLB of that JSON, in which `BYTES` stands for the number of bytes in the binary chunk.
fn glb(json: &str, chunk: &[u8]) -> Result<MeshFile, Error> {
    let mut json = json.replace("BYTES", &chunk.len().to_string()).into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut chunk = chunk.to_vec();
    chunk.resize(chunk.len().next_multiple_of(4), 0);
    let mut file = b"glTF\x02\0\0\0".to_vec();
    file.extend((28 + json.len() as u32 + chunk.len() as u32).to_le_bytes());
    for (kind, bytes) in [(b"JSON", &json), (b"BIN\0", &chunk)] {
        file.extend((bytes.len() as u32).to_le_bytes());
        file.extend(kind);
        file.extend(bytes);
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.glb");
    std::fs::write(&path, file).unwrap();
    read_mesh(&path)
}

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|x| x.to_le_bytes()).collect()
}

/// A triangle's corners (36 bytes), which every scene here shows.
const TRIANGLE: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];

fn close(mesh: &Mesh, expected: &[[f64; 3]]) {
    assert_eq!(mesh.n_vertices(), expected.len());
    for (p, &q) in mesh.vertices().iter().zip(expected) {
        assert!(p.distance(DVec3::from_array(q)) < 1e-6, "{p} is not {q:?}");
    }
}

#[test]
fn a_skinned_mesh_stands_where_its_joints_carry_it() {
    // Two joints under an armature at a hundredth of the size; corner 2 belongs half to each. The mesh's own node is
    // far away, which does not count.
    let mut chunk = floats(&TRIANGLE);
    chunk.extend([[0u8, 0, 0, 0], [0, 1, 0, 0], [0, 1, 0, 0]].concat());
    chunk.extend(floats(&[1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.5, 0.5, 0.0, 0.0]));
    // Inverse bind matrices: the identity, and a move by −10 along x.
    for x in [0.0, -10.0] {
        chunk.extend(floats(&[1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., x, 0., 0., 1.]));
    }
    let json = r#"{"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}],
        "nodes": [{"children": [1, 2], "scale": [0.01, 0.01, 0.01]},
            {"mesh": 0, "skin": 0, "translation": [500, 0, 0]},
            {"children": [3]}, {"translation": [0, 0, 100]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "JOINTS_0": 1, "WEIGHTS_0": 2}}]}],
        "skins": [{"joints": [2, 3], "inverseBindMatrices": 3}],
        "buffers": [{"byteLength": BYTES}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 12},
            {"buffer": 0, "byteOffset": 48, "byteLength": 48}, {"buffer": 0, "byteOffset": 96, "byteLength": 128}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5121, "count": 3, "type": "VEC4"},
            {"bufferView": 2, "componentType": 5126, "count": 3, "type": "VEC4"},
            {"bufferView": 3, "componentType": 5126, "count": 2, "type": "MAT4"}]}"#;
    let file = glb(json, &chunk).unwrap();
    // Weights are divided by their sum; the second joint carries p to (p − 10 x + 100 z) / 100.
    close(&file.mesh, &[[0.0, 0.0, 0.0], [0.01, 0.0, 0.0], [-0.05, 0.01, 0.5]]);
    let without = json.replace(r#", "JOINTS_0": 1, "WEIGHTS_0": 2"#, "");
    close(
        &glb(&without, &chunk).unwrap().mesh,
        &[[5.0, 0.0, 0.0], [5.01, 0.0, 0.0], [5.0, 0.01, 0.0]],
    );
    for (from, to, place) in [
        ("\"skin\": 0", "\"skin\": 4", "skin 4"),
        ("[2, 3]", "[2, 9]", "skin 0"),
        ("[2, 3]", "[2]", "mesh 0, primitive 0"),
        ("\"JOINTS_0\": 1", "\"JOINTS_0\": 3", "mesh 0, primitive 0"),
    ] {
        let error = glb(&json.replace(from, to), &chunk).unwrap_err();
        assert_eq!(error.place().as_deref(), Some(place), "{error}");
    }
}

#[test]
fn morph_targets_count_with_the_weights_of_the_node_or_the_mesh() {
    let mut chunk = floats(&TRIANGLE);
    chunk.extend(floats(&[0.0, 0.0, 2.0, 0.0, 0.0, 2.0, 0.0, 0.0, 2.0]));
    let json = |node: &str, mesh: &str| {
        format!(
            r#"{{"asset": {{"version": "2.0"}}, "scenes": [{{"nodes": [0]}}], "nodes": [{{"mesh": 0{node}}}],
            "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}, "targets": [{{"POSITION": 1}}, {{"NORMAL": 1}}]}}]{mesh}}}],
            "buffers": [{{"byteLength": BYTES}}],
            "bufferViews": [{{"buffer": 0, "byteLength": 36}}, {{"buffer": 0, "byteOffset": 36, "byteLength": 36}}],
            "accessors": [{{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}},
                {{"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC3"}}]}}"#
        )
    };
    for (node, mesh, z) in [
        ("", "", 0.0),
        ("", ", \"weights\": [0.5, 1]", 1.0),
        (", \"weights\": [2, 0]", ", \"weights\": [0.5, 1]", 4.0),
    ] {
        let file = glb(&json(node, mesh), &chunk).unwrap();
        close(&file.mesh, &[[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]]);
    }
}

/// A scene of one triangle under some nodes.
fn nodes(nodes: &str, extras: &str) -> String {
    format!(
        r#"{{"asset": {{"version": "2.0"}}, "scenes": [{{"nodes": [0]}}], "nodes": [{nodes}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}}}]}}], "buffers": [{{"byteLength": BYTES}}],
        "bufferViews": [{{"buffer": 0, "byteLength": 36}}, {{"buffer": 0, "byteOffset": 36, "byteLength": 48}}],
        "accessors": [{{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}},
            {{"bufferView": 1, "componentType": 5126, "count": 2, "type": "VEC3"}},
            {{"bufferView": 1, "byteOffset": 12, "componentType": 5126, "count": 2, "type": "VEC4"}}]{extras}}}"#
    )
}

#[test]
fn hidden_nodes_hide_all_below_them() {
    let hidden = r#""extensions": {"KHR_node_visibility": {"visible": false}}"#;
    let shown = r#""extensions": {"KHR_node_visibility": {"visible": true}}"#;
    let tree = format!(
        r#"{{"mesh": 0, "children": [1, 2]}}, {{"mesh": 0, {hidden}, "children": [3]}},
        {{"mesh": 0, "translation": [0, 0, 1], {shown}}}, {{"mesh": 0, {shown}}}"#
    );
    let file = glb(&nodes(&tree, ""), &floats(&TRIANGLE)).unwrap();
    assert_eq!(file.mesh.n_vertices(), 6);
    let notes = &file.appearance.notes;
    assert!(notes.iter().any(|note| note.starts_with("2 nodes are hidden")), "{notes:?}");
}

#[test]
fn instances_of_a_node_are_copies() {
    let mut chunk = floats(&TRIANGLE);
    // Two translations; as rotations from the fourth number on: (0, 0, 1, 0), half a turn about z, twice.
    chunk.extend(floats(&[9.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0]));
    let json = |attributes: &str| {
        let instancing = format!(
            r#""extensions": {{"EXT_mesh_gpu_instancing": {{"attributes": {{{attributes}}}}}}}"#
        );
        nodes(
            &format!(r#"{{"mesh": 0, "scale": [2, 2, 2], {instancing}}}"#),
            r#", "extensionsRequired": ["EXT_mesh_gpu_instancing"]"#,
        )
    };
    let file = glb(&json("\"TRANSLATION\": 1"), &chunk).unwrap();
    let [x, z] = [18.0, 2.0];
    let first = [[x, 0.0, 0.0], [x + 2.0, 0.0, 0.0], [x, 2.0, 0.0]];
    let second = [[0.0, 0.0, z], [2.0, 0.0, z], [0.0, 2.0, z]];
    close(&file.mesh, &[first, second].concat());
    let turned = glb(&json("\"ROTATION\": 2"), &chunk).unwrap();
    close(&turned.mesh, &[[[0.0; 3], [-2.0, 0.0, 0.0], [0.0, -2.0, 0.0]]; 2].concat());
}

#[test]
fn many_instances_are_read_and_endless_ones_refused() {
    let many = |n: usize| {
        let children: Vec<String> = (1..=n).map(|i| i.to_string()).collect();
        let root = format!(r#"{{"children": [{}]}}"#, children.join(","));
        let copies = vec![r#"{"mesh": 0}"#; n].join(",");
        let json = nodes(&format!("{root},{copies}"), "");
        // A mesh of 10,000 corners whose positions take no bytes.
        json.replace(
            r#"{"bufferView": 0, "componentType": 5126, "count": 3,"#,
            r#"{"componentType": 5126, "count": 9999,"#,
        )
    };
    assert_eq!(glb(&many(199), &[0; 84]).unwrap().mesh.n_vertices(), 199 * 9999);
    let refused = glb(&many(250), &[0; 84]).unwrap_err().to_string();
    assert!(refused.contains("vertices and") && refused.contains("fewer instances"), "{refused}");
}

#[test]
fn compressed_files_say_what_to_do() {
    for name in ["EXT_meshopt_compression", "KHR_meshopt_compression", "KHR_draco_mesh_compression"]
    {
        let json = nodes(r#"{"mesh": 0}"#, &format!(r#", "extensionsRequired": ["{name}"]"#));
        let refused = glb(&json, &floats(&TRIANGLE)).unwrap_err().to_string();
        assert!(
            refused.contains("export without compression") && refused.contains(name),
            "{refused}"
        );
    }
}
