//! Meshes as people's programs write them, through the shell: seams, piles of triangles, hands of kilometres.

use std::path::Path;
use std::time::{Duration, Instant};

use semfm::Mesh;
use semfm::geom::Welded;
use semfm::geom::io::{read_mesh, write_mesh};
use semfm_synth::{Category, ObjectSettings, make_object};
use semfm_tests::shell::{json, run, shared};

/// A container, and the same with three vertices of its own for each triangle.
fn whole_and_cut() -> [Mesh; 2] {
    let settings = ObjectSettings { n_vertices: 800, ..Default::default() };
    let mesh = make_object(Category::Containers, 2, &settings).unwrap().mesh;
    let corners = mesh.faces().iter().flatten().map(|&v| mesh.vertices()[v as usize]).collect();
    let faces = (0..mesh.n_faces() as u32).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
    let cut = Mesh::new(corners, faces).unwrap();
    [mesh, cut]
}

/// The places of a region near a contact, by the shell.
fn places_near(mesh: &Path, contact: &str, radius: &str) -> Vec<[u64; 3]> {
    let region = mesh.with_extension("region.json");
    let text = |path: &Path| path.to_str().unwrap().to_owned();
    let answer = run(&[
        "region".into(),
        text(mesh),
        "-o".into(),
        text(&region),
        format!("--near={contact}"),
        format!("--radius={radius}"),
    ]);
    assert_eq!(answer.code, Some(0), "{}: {answer:?}", mesh.display());
    let read = read_mesh(mesh).unwrap().mesh;
    let mut places: Vec<[u64; 3]> = json(&region)["vertices"]
        .as_array()
        .unwrap()
        .iter()
        // In single precision: formats differ in digits.
        .map(|v| read.vertices()[v.as_u64().unwrap() as usize].to_array())
        .map(|p| p.map(|x| u64::from((x as f32).to_bits())))
        .collect();
    places.sort_unstable();
    places.dedup();
    places
}

#[test]
fn a_region_crosses_seams_in_every_format() {
    let folder = tempfile::tempdir().unwrap();
    let [whole, cut] = whole_and_cut();
    let p = whole.corners(100)[0];
    let contact = format!("{},{},{}", p.x, p.y, p.z);
    let radius = (0.15 * whole.diagonal()).to_string();
    let path = folder.path().join("whole.obj");
    write_mesh(&path, &whole).unwrap();
    let expected = places_near(&path, &contact, &radius);
    assert!(expected.len() > 10 && expected.len() < whole.n_vertices() / 2, "{}", expected.len());
    for name in ["cut.obj", "cut.ply", "cut.off", "cut.glb", "cut.stl"] {
        let path = folder.path().join(name);
        write_mesh(&path, &cut).unwrap();
        let found = places_near(&path, &contact, &radius);
        // GLB and STL hold single precision, which moves what lies on the rim.
        let missing = expected.iter().filter(|place| !found.contains(place)).count();
        let more = found.iter().filter(|place| !expected.contains(place)).count();
        assert!(missing + more <= expected.len() / 50, "{name}: {missing} missing, {more} more");
        let info = run(&["info", "--json", path.to_str().unwrap()]);
        let info: serde_json::Value = serde_json::from_str(&info.out).unwrap();
        assert_eq!(
            (&info["components"], &info["boundary_edges"]),
            (&1.into(), &0.into()),
            "{name}"
        );
    }
}

#[test]
fn the_seams_of_the_shared_cases_are_crossed() {
    let Some(cases) = shared("cases/region_seam") else { return };
    let folder = tempfile::tempdir().unwrap();
    let mut counts = Vec::new();
    for name in ["welded.glb", "uv_seam.obj", "uv_seam.glb", "flat_shaded.ply"] {
        let path = folder.path().join(name);
        std::fs::copy(cases.join(name), &path).unwrap();
        for contact in ["0.04,0,0.05", "0,0.04,0.05"] {
            counts.push(places_near(&path, contact, "0.02").len());
        }
    }
    // One wall seen from two contacts that its symmetry makes equal.
    assert!(counts.iter().all(|n| n.abs_diff(137) <= 3), "{counts:?}");
}

#[test]
fn a_pile_of_one_triangle_costs_no_time() {
    let folder = tempfile::tempdir().unwrap();
    let [whole, _] = whole_and_cut();
    let pile = vec![whole.faces()[7]; 20_000];
    let faces = whole.faces().iter().copied().chain(pile).collect();
    let piled = Mesh::new(whole.vertices().to_vec(), faces).unwrap();
    let path = folder.path().join("pile.ply");
    write_mesh(&path, &piled).unwrap();
    let [mesh, region] = [path.clone(), folder.path().join("r.json")];
    let [mesh, region] = [&mesh, &region].map(|path| path.to_str().unwrap().to_owned());
    let p = whole.corners(7)[0];
    let near = format!("--near={},{},{}", p.x, p.y, p.z);
    for arguments in
        [vec!["info", &mesh], vec!["region", &mesh, "-o", &region, &near, "--radius", "0.3"]]
    {
        let start = Instant::now();
        let answer = run(&arguments);
        assert!(matches!(answer.code, Some(0 | 1)), "{arguments:?}: {answer:?}");
        // A tenth of a second each; on a busy machine they have room.
        assert!(start.elapsed() < Duration::from_secs(8), "{arguments:?}: {:?}", start.elapsed());
    }
    assert!(!Welded::new(&piled).joined_any());
}

#[test]
fn a_hand_of_kilometres_is_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let [whole, _] = whole_and_cut();
    let at = |name: &str| folder.path().join(name);
    write_mesh(at("a.obj"), &whole).unwrap();
    std::fs::write(at("r.json"), r#"{"vertices": [1, 2, 3, 4]}"#).unwrap();
    for (limit, origin) in [("1e12", "0"), ("1e5", "0"), ("0.04", "1e6")] {
        let finger = |name: &str, joint: &str, axis: f64, origin: &str| {
            format!(
                r#"<link name="{name}"><collision><geometry><box size="0.02 0.01 0.05"/></geometry></collision></link>
                <joint name="{joint}" type="prismatic"><parent link="palm"/><child link="{name}"/>
                <origin xyz="0 {origin} 0.085"/><axis xyz="0 {axis} 0"/>
                <limit lower="0" upper="{limit}" effort="1" velocity="1"/></joint>"#
            )
        };
        let text = format!(
            r#"<robot name="hand"><link name="palm"><collision><geometry><box size="0.06 0.2 0.06"/></geometry>
            </collision></link>{}{}</robot>"#,
            finger("left", "jl", 1.0, origin),
            finger("right", "jr", -1.0, "-0.01"),
        );
        std::fs::write(at("h.urdf"), text).unwrap();
        let start = Instant::now();
        let [mesh, region, hand, out] = ["a.obj", "r.json", "h.urdf", "g.json"].map(at);
        let [mesh, region, hand, out] =
            [&mesh, &region, &hand, &out].map(|path| path.to_str().unwrap());
        let answer = run(&[
            "grasp",
            mesh,
            "--region",
            region,
            "--gripper",
            hand,
            "--scale",
            "0.1",
            "-o",
            out,
        ]);
        assert_eq!(answer.code, Some(2), "{answer:?}");
        assert!(
            answer.err.contains("millimetres?") && answer.err.contains("h.urdf"),
            "{}",
            answer.err
        );
        assert!(start.elapsed() < Duration::from_secs(3), "{:?}", start.elapsed());
    }
}
