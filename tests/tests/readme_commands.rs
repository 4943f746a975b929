//! Every command of the shell that the README shows, run as it stands there, in the folder that the
//! demo wrote.

use std::path::Path;

use semfm::geom::io::{read_mesh, write_json, write_mesh};
use semfm::geom::math::DVec3;
use semfm::views::{RenderSettings, RigSettings, SurfaceColor, View, render, rig};
use semfm::{Mesh, Task};
use semfm_tests::shell::{answer, json, run, semfm_cli};
use serde_json::json;

/// Commands that need what a machine with only Rust does not have: Python, a network.
const ELSEWHERE: [&str; 5] =
    ["pip install", "semfm-embed", "--encoder google/", "cargo xtask", "semfm-vlm"];
/// Data that only others have; `python/tests` and `tests/tests/eval.rs` run such a command.
const OTHERS_DATA: &str = "semfm-cli eval-maps SETS";
/// Minutes, with `SEMFM_README=1`; `tests/tests/eval.rs` runs it on fewer objects.
const LONG: &str = "eval --synthetic";

/// The commands of the README's blocks of shell, continued lines joined, comments removed.
fn commands() -> Vec<String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../README.md");
    let text = std::fs::read_to_string(path).unwrap();
    let mut commands = Vec::new();
    for block in text.split("```sh\n").skip(1) {
        let block = block.split("```").next().unwrap().replace("\\\n", " ");
        let lines = block.lines().map(|line| line.split(" # ").next().unwrap_or_default().trim());
        commands.extend(
            lines.filter(|line| !line.is_empty() && !line.starts_with('#')).map(str::to_owned),
        );
    }
    commands
}

/// The words that `semfm-cli` gets, of a command that calls it.
fn words(command: &str) -> Option<Vec<&str>> {
    let arguments = command
        .strip_prefix("semfm-cli ")
        .or_else(|| command.strip_prefix("cargo run --release -p semfm-cli -- "))?;
    Some(arguments.split_whitespace().collect())
}

/// One of the views of a rig.
fn shot(mesh: &Mesh, settings: &RigSettings, number: usize) -> View {
    let cameras = rig(mesh, settings).unwrap();
    let (light, task) = (RenderSettings::default(), Task::default());
    let views = render(mesh, &SurfaceColor::GREY, &cameras[number..=number], &light, &task);
    views.unwrap().remove(0)
}

/// White where the view shows such a triangle.
fn mask(view: &View, is_inside: impl Fn(usize) -> bool) -> image::GrayImage {
    let side = view.camera.width();
    image::GrayImage::from_fn(side, side, |x, y| {
        let triangle = view.triangles[(y * side + x) as usize];
        let inside = usize::try_from(triangle).is_ok_and(&is_inside);
        image::Luma([if inside { 255 } else { 0 }])
    })
}

/// What the README supposes the reader to have: a mask of the handle in a view, what a depth camera
/// sees of the kettle, a gripper, a table, labelled objects.
fn own_files(folder: &Path) {
    let mug = read_mesh(folder.join("containers_0_s0.obj")).unwrap().mesh;
    let truth = json(&folder.join("containers_0_s0.json"));
    let handle: Vec<u32> = serde_json::from_value(truth["region"]["vertices"].clone()).unwrap();
    let view = shot(&mug, &RigSettings::default(), 3);
    mask(&view, |face| mug.faces()[face].iter().all(|v| handle.contains(v)))
        .save(folder.join("grip.png"))
        .unwrap();

    let kettle = read_mesh(folder.join("containers_1_s0.obj")).unwrap().mesh;
    let settings = RigSettings { size: 320, ..RigSettings::default() };
    let view = shot(&kettle, &settings, 5);
    let camera = view.camera;
    let side = camera.width();
    let metres_per_unit = 0.24;
    let depth = image::ImageBuffer::from_fn(side, side, |x, y| {
        let depth = f64::from(view.depth[(y * side + x) as usize]);
        let millimetres = if depth.is_finite() { 1e3 * metres_per_unit * depth } else { 0.0 };
        image::Luma([millimetres.round() as u16])
    });
    depth.save(folder.join("depth.png")).unwrap();
    mask(&view, |_| true).save(folder.join("kettle.png")).unwrap();
    let (cx, cy) = (camera.cx() - 0.5, camera.cy() - 0.5); // in K.json the first pixel's centre is 0
    let intrinsics = json!({ "fx": camera.fx(), "fy": camera.fy(), "cx": cx, "cy": cy });
    write_json(folder.join("K.json"), &intrinsics).unwrap();

    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let corners = corners.map(|[x, y]| DVec3::new(x, y, 5.0)).to_vec(); // far behind the kettle
    let table = Mesh::new(corners, vec![[0, 1, 2], [0, 2, 3]]).unwrap();
    write_mesh(folder.join("table.ply"), &table).unwrap();
    std::fs::write(folder.join("hand.urdf"), two_fingers()).unwrap();

    let objects = folder.join("OBJECTS/containers");
    std::fs::create_dir_all(&objects).unwrap();
    for name in ["containers_0_s0", "containers_1_s0"] {
        for extension in ["obj", "json"] {
            let name = format!("{name}.{extension}");
            std::fs::copy(folder.join(&name), objects.join(&name)).unwrap();
        }
    }
}

/// A parallel gripper that opens 80 mm.
fn two_fingers() -> String {
    let finger = |name: &str, side: f64| {
        format!(
            "<link name=\"{name}\"><collision><origin xyz=\"0 {} 0.025\"/><geometry>\
             <box size=\"0.02 0.01 0.05\"/></geometry></collision></link>\
             <joint name=\"j{name}\" type=\"prismatic\"><parent link=\"palm\"/><child link=\"{name}\"/>\
             <origin xyz=\"0 0 0.06\"/><axis xyz=\"0 {side} 0\"/>\
             <limit lower=\"0\" upper=\"0.04\" effort=\"1\" velocity=\"1\"/></joint>",
            side * 0.005
        )
    };
    format!(
        "<robot name=\"hand\"><link name=\"palm\"><collision><origin xyz=\"0 0 0.03\"/><geometry>\
         <box size=\"0.06 0.2 0.06\"/></geometry></collision></link>{}{}</robot>",
        finger("left", -1.0),
        finger("right", 1.0)
    )
}

#[test]
fn the_readme_s_commands_run_as_they_stand() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let demo = run(&["demo", "--quiet", "-o", at.to_str().unwrap()]);
    assert_eq!(demo.code, Some(0), "{demo:?}");
    own_files(at);
    let (mut ran, mut transferred) = (Vec::new(), 0);
    for command in commands() {
        if ELSEWHERE.iter().any(|needs| command.contains(needs)) || command.starts_with(OTHERS_DATA)
        {
            continue;
        }
        if command.contains(LONG) && std::env::var_os("SEMFM_README").is_none() {
            continue;
        }
        let words = words(&command).unwrap_or_else(|| panic!("who runs `{command}`?"));
        let answer = answer(semfm_cli().args(&words).current_dir(at).output().unwrap());
        assert_eq!(answer.code, Some(0), "{command}: {answer:?}");
        if words[0] == "transfer" {
            assert_eq!(json(&at.join("out/region.json"))["format"], "semfm.region/1", "{command}");
            transferred += 1;
        }
        ran.push(words[0].to_owned());
    }
    for command in ["demo", "region", "transfer", "views", "embed", "grasp", "align", "eval"] {
        assert!(ran.iter().any(|name| name == command), "the README shows no `{command}`");
    }
    assert!(transferred >= 2, "{transferred}");
    assert!(at.join("grasps.json").is_file() && at.join("report/index.html").is_file());
}
