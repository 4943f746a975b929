//! `run`: from pictures of a hand on one object to grasps on another, through the binary.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use semfm::geom::io::{read_mesh, write_mesh};
use semfm::geom::math::{DAffine3, DQuat, DVec3, bounds};
use semfm::upright::upright;
use semfm::{Mesh, Task};
use semfm_synth::{
    Category, ObjectSettings, StandingObject, SynthObject, make_object,
    write_demonstration_pictures,
};
use semfm_tests::shell::{Answer, json, run, semfm_cli};
use serde_json::Value;

const STAGES: [&str; 5] = ["demonstration-pose", "region", "transfer", "target-pose", "grasp"];

/// Pictures of a hand on a mug and of a smaller one, with a recipe beside them.
struct Fixture {
    folder: tempfile::TempDir,
    mug: SynthObject,
}

impl Fixture {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let settings = ObjectSettings { n_vertices: 3000, ..Default::default() };
        // The target is another mug of the same make, smaller: what is tested here are the stages, not the encoder.
        let mug = make_object(Category::Containers, 0, &settings).unwrap();
        let (source, target) = (standing(&mug, 0.25), standing(&mug, 0.2));
        let made = write_demonstration_pictures(folder.path(), &source, &target, &Task::default());
        assert!(made.unwrap().is_some(), "no hold");
        write_mesh(folder.path().join("mug.obj"), &mug.mesh).unwrap();
        write_mesh(folder.path().join("other.obj"), &mug.mesh).unwrap();
        let fixture = Self { folder, mug };
        fixture.write_recipe("");
        fixture
    }

    fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn word(&self, name: &str) -> String {
        self.at(name).to_str().unwrap().to_owned()
    }

    /// The recipe, with more lines in its table of grasps.
    fn write_recipe(&self, of_grasp: &str) {
        std::fs::write(self.at("demo.toml"), recipe(of_grasp)).unwrap();
    }

    fn run(&self, out: &str, more: &[&str]) -> Answer {
        let words =
            ["run", &self.word("demo.toml"), "-o", &self.word(out), "--quiet", "--no-cache"];
        run(&[&words, more].concat())
    }

    /// What a sound run did with each stage.
    fn states(&self, out: &str) -> Vec<String> {
        let answer = self.run(out, &["--json"]);
        assert_eq!(answer.code, Some(0), "{}", answer.err);
        states_of(&serde_json::from_str(&answer.out).unwrap())
    }
}

fn states_of(run: &Value) -> Vec<String> {
    let stages = run["stages"].as_array().unwrap().iter();
    stages
        .map(|stage| {
            format!("{} {}", stage["stage"].as_str().unwrap(), stage["state"].as_str().unwrap())
        })
        .collect()
}

fn all(state: &str) -> Vec<String> {
    STAGES.iter().map(|stage| format!("{stage} {state}")).collect()
}

fn recipe(of_grasp: &str) -> String {
    format!(
        "[demonstration]\nmesh = 'mug.obj'\ngrow = true\n\n\
         [[demonstration.frames]]\ncolor = 'demonstration/color.png'\ndepth = 'demonstration/depth.png'\n\
         intrinsics = 'demonstration/K.json'\nmask = 'demonstration/object.png'\n\
         hand_mask = 'demonstration/hand.png'\nhand = 'demonstration/hand.obj'\n\n\
         [target]\nmesh = 'other.obj'\n\n\
         [target.frame]\ncolor = 'target/color.png'\ndepth = 'target/depth.png'\n\
         intrinsics = 'target/K.json'\nmask = 'target/object.png'\n\n\
         [grasp]\ngripper = 'franka'\nsamples = 200\n{of_grasp}"
    )
}

/// An object on its foot, at the origin.
fn standing(object: &SynthObject, scale: f64) -> StandingObject<'_> {
    let turn = DQuat::from_rotation_arc(upright(&object.mesh).unwrap().up, DVec3::Z);
    let points: Vec<DVec3> = object.mesh.vertices().iter().map(|&p| turn * p * scale).collect();
    let (low, _) = bounds(&points).unwrap();
    let world_from_object = DAffine3::from_rotation_translation(turn, DVec3::Z * -low.z);
    StandingObject { object, scale, world_from_object }
}

/// The share of a region's surface that lies in the true grip.
fn share_in_grip(mesh: &Mesh, region: &Value, grip: &[bool]) -> f64 {
    let areas = mesh.vertex_areas();
    let vertices = region["vertices"].as_array().unwrap().iter();
    let vertices: Vec<usize> = vertices.map(|v| v.as_u64().unwrap() as usize).collect();
    let inside = vertices.iter().filter(|&&v| grip[v]).map(|&v| areas[v]).sum::<f64>();
    inside / vertices.iter().map(|&v| areas[v]).sum::<f64>()
}

#[test]
fn pictures_become_grasps_and_only_what_changed_is_done_again() {
    let fixture = Fixture::new();
    let planned = fixture.run("out", &["--dry-run"]);
    assert_eq!(
        (planned.code, planned.out.matches("do: ").count()),
        (Some(0), 5),
        "{}",
        planned.out
    );
    assert!(!fixture.at("out").exists());

    assert_eq!(fixture.states("out"), all("done"));
    for (stage, file) in [
        ("demonstration-pose", "aligned.json"),
        ("region", "region.json"),
        ("region", "contact.json"),
        ("region", "hand.ply"),
        ("transfer", "transfer.png"),
        ("target-pose", "aligned.json"),
        ("grasp", "grasps.json"),
    ] {
        assert!(fixture.at("out").join(stage).join(file).is_file(), "{stage}/{file}");
    }
    // The hand held the handle, and the answer is what the single commands read.
    let mug = read_mesh(fixture.at("mug.obj")).unwrap().mesh;
    let share =
        share_in_grip(&mug, &json(&fixture.at("out/region/region.json")), &fixture.mug.region);
    assert!(share > 0.6, "{share} of what was touched is the handle");
    let grasps = json(&fixture.at("out/grasp/grasps.json"));
    assert!(!grasps["grasps"].as_array().unwrap().is_empty());
    assert!(grasps["camera_from_object"].is_array(), "grasps are before the camera");
    let page = std::fs::read_to_string(fixture.at("out/index.html")).unwrap();
    for word in ["The demonstration", "What was touched", "What was carried over", "The target"] {
        assert!(page.contains(word), "the page has no `{word}`");
    }
    // Two pictures of the demonstration, the contact, the transfer, the target twice, the grasps.
    assert_eq!(page.matches("<img src=\"data:image/jpeg").count(), 7);

    let written = |name: &str| std::fs::metadata(fixture.at(name)).unwrap().modified().unwrap();
    let before = ["out/index.html", "out/transfer/region.json"].map(written);
    assert_eq!(fixture.states("out"), all("kept"));
    assert_eq!(["out/index.html", "out/transfer/region.json"].map(written), before);

    // A setting of the last stage, then an input of one in the middle.
    fixture.write_recipe("top = 2\n");
    let only_grasp: Vec<String> = [&all("kept")[..4], &["grasp done".to_owned()]].concat();
    assert_eq!(fixture.states("out"), only_grasp);
    assert!(json(&fixture.at("out/grasp/grasps.json"))["grasps"].as_array().unwrap().len() <= 2);
    let hand = read_mesh(fixture.at("demonstration/hand.obj")).unwrap().mesh;
    let moved = hand.vertices().iter().map(|&p| p + DVec3::new(0.002, 0.0, 0.0)).collect();
    let moved = Mesh::new(moved, hand.faces().to_vec()).unwrap();
    std::fs::remove_file(fixture.at("demonstration/hand.obj")).unwrap();
    write_mesh(fixture.at("demonstration/hand.obj"), &moved).unwrap();
    let planned = fixture.run("out", &["--dry-run"]);
    assert!(planned.out.contains("hand.obj has changed"), "{}", planned.out);
    assert!(planned.out.contains("region comes before it"), "{}", planned.out);
    let states = fixture.states("out");
    assert_eq!(states[0], "demonstration-pose kept");
    assert_eq!(states[1..3], ["region done", "transfer done"]);
    assert_eq!(states[3], "target-pose kept");

    // A file that is not as the stage left it, and a stage that was cut off.
    std::fs::write(fixture.at("out/target-pose/aligned.json"), "{}").unwrap();
    std::fs::remove_file(fixture.at("out/grasp/stage.json")).unwrap();
    let states = fixture.states("out");
    assert_eq!(states[3..], ["target-pose done", "grasp done"]);
    assert_eq!(fixture.states("out"), all("kept"));
}

#[test]
fn a_killed_run_goes_on_where_it_was() {
    let fixture = Fixture::new();
    let words =
        ["run", &fixture.word("demo.toml"), "-o", &fixture.word("out"), "--quiet", "--no-cache"];
    let mut child = semfm_cli().args(words).spawn().unwrap();
    let start = Instant::now();
    while !fixture.at("out/demonstration-pose/stage.json").exists() {
        assert!(start.elapsed() < Duration::from_secs(300), "the first stage does not end");
        std::thread::sleep(Duration::from_millis(5));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let is_whole = |stage: &&&str| fixture.at("out").join(stage).join("stage.json").exists();
    let n_whole = STAGES.iter().filter(is_whole).count();
    // As where it is killed between the record and the end of the stage.
    std::fs::create_dir_all(fixture.at("out/demonstration-pose/.semfm-x.1-0-0.tmp")).unwrap();
    let states = fixture.states("out");
    let expected = [&all("kept")[..n_whole], &all("done")[n_whole..]].concat();
    assert_eq!(states, expected);
    let left: Vec<String> = walk(&fixture.at("out"));
    assert!(left.iter().all(|name| !name.contains(".semfm-")), "{left:?}");
}

/// Every path below a folder.
fn walk(folder: &Path) -> Vec<String> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap().flatten() {
        found.push(entry.path().display().to_string());
        if entry.path().is_dir() {
            found.extend(walk(&entry.path()));
        }
    }
    found
}

#[test]
fn a_run_without_an_answer_says_where_it_ended_and_what_to_do() {
    let fixture = Fixture::new();
    // No part of a mug is that thin.
    fixture.write_recipe("width_range = [0.0001, 0.0002]\n");
    for state in ["done", "kept"] {
        let answer = fixture.run("out", &["--json"]);
        assert_eq!(answer.code, Some(1), "{}", answer.err);
        let told: Value = serde_json::from_str(&answer.out).unwrap();
        assert_eq!(states_of(&told)[4], format!("grasp {state}"));
        assert!(told["no_answer"]["reason"].as_str().unwrap().contains("none of"), "{told}");
        assert!(answer.err.contains("next: "), "{}", answer.err);
        let page = std::fs::read_to_string(fixture.at("out/index.html")).unwrap();
        assert!(page.contains("without an answer, at the stage grasp") && page.contains("Next: "));
    }
    // The way out is a change of the recipe.
    fixture.write_recipe("");
    assert_eq!(fixture.states("out")[4], "grasp done");
}

#[test]
fn a_target_without_a_mesh_is_what_the_camera_saw() {
    let fixture = Fixture::new();
    let text = recipe("unseen = 0.05\n").replace("mesh = 'other.obj'\n", "");
    std::fs::write(fixture.at("demo.toml"), text).unwrap();
    let stages = ["demonstration-pose", "region", "target-surface", "transfer"];
    for state in ["done", "kept"] {
        let answer = fixture.run("out", &["--json"]);
        // One camera sees one side: the region may be refused, and there may be no grasp.
        assert!(matches!(answer.code, Some(0 | 1)), "{}", answer.err);
        let told: Value = serde_json::from_str(&answer.out).unwrap();
        let expected = stages.map(|stage| format!("{stage} {state}"));
        assert_eq!(states_of(&told)[..4], expected, "{}", answer.err);
    }
    let seen = read_mesh(fixture.at("out/target-surface/surface.ply")).unwrap().mesh;
    assert!(seen.vertices().iter().all(|p| p.z > 0.1), "before the camera");
    for file in ["target-surface/surface.emb.mcap", "transfer/source.emb.mcap"] {
        assert!(fixture.at("out").join(file).is_file(), "{file}");
    }
    let page = std::fs::read_to_string(fixture.at("out/index.html")).unwrap();
    assert!(page.contains("what the camera saw:") && page.contains("target-surface"));
    // A mask that shows less makes the surface anew, and what comes after it.
    let mask = image::open(fixture.at("target/object.png")).unwrap().into_luma8();
    let middle = mask.height() / 2;
    let less = image::GrayImage::from_fn(mask.width(), mask.height(), |x, y| {
        if y == middle { image::Luma([0]) } else { *mask.get_pixel(x, y) }
    });
    less.save(fixture.at("target/object.png")).unwrap();
    let planned = fixture.run("out", &["--dry-run"]);
    assert!(planned.out.contains("object.png has changed"), "{}", planned.out);
    assert!(planned.out.contains("target-surface comes before it"), "{}", planned.out);
}

#[test]
fn neither_object_needs_a_mesh() {
    let fixture = Fixture::new();
    let frame =
        "depth = 'target/depth.png'\nintrinsics = 'target/K.json'\nmask = 'target/object.png'\n";
    let write = |near: DVec3| {
        let text = format!(
            "[demonstration]\nnear = [{}, {}, {}]\nradius = 0.03\n[[demonstration.frames]]\n{frame}\
             [target]\n[target.frame]\n{frame}[grasp]\ngripper = 'franka'\nsamples = 100\nunseen = 0.05\n",
            near.x, near.y, near.z
        );
        std::fs::write(fixture.at("demo.toml"), text).unwrap();
    };
    // A contact far from the object is refused, once the surface is there.
    write(DVec3::ZERO);
    let refused = fixture.run("out", &[]);
    assert!(refused.code == Some(2) && refused.err.contains("stage region"), "{}", refused.err);
    let seen = read_mesh(fixture.at("out/demonstration-surface/surface.ply")).unwrap().mesh;
    write(seen.vertices()[seen.n_vertices() / 2]);
    let answer = fixture.run("out", &["--json"]);
    assert!(matches!(answer.code, Some(0 | 1)), "{}", answer.err);
    let told: Value = serde_json::from_str(&answer.out).unwrap();
    let expected = [
        "demonstration-surface kept",
        "region done",
        "target-surface done",
        "transfer done",
        "grasp done",
    ];
    assert_eq!(states_of(&told), expected, "{}", answer.err);
    let grasps = json(&fixture.at("out/grasp/grasps.json"));
    assert!(grasps["camera_from_object"].is_array(), "grasps are before the camera");
}

#[test]
fn a_pose_that_is_refused_ends_the_run_unless_the_recipe_goes_on() {
    let fixture = Fixture::new();
    // The mask shows what is around the object in its place.
    let open = |name: &str| image::open(fixture.at(name)).unwrap();
    let (mask, depth) =
        (open("target/object.png").into_luma8(), open("target/depth.png").into_luma16());
    let around = image::GrayImage::from_fn(mask.width(), mask.height(), |x, y| {
        let is_around = mask.get_pixel(x, y).0[0] == 0 && depth.get_pixel(x, y).0[0] > 0;
        image::Luma([if is_around { 255 } else { 0 }])
    });
    around.save(fixture.at("target/object.png")).unwrap();
    // Of any size it might lie in the table somewhere.
    let with = |more: &str| {
        let text = recipe("").replace(
            "mesh = 'other.obj'\n",
            &format!("mesh = 'other.obj'\n{more}[target.align]\nscale_range = [0.19, 0.21]\n"),
        );
        std::fs::write(fixture.at("demo.toml"), text).unwrap();
    };
    with("");
    for state in ["done", "kept"] {
        let answer = fixture.run("out", &["--json"]);
        assert_eq!(answer.code, Some(1), "{}", answer.err);
        let told: Value = serde_json::from_str(&answer.out).unwrap();
        assert_eq!(states_of(&told).last().unwrap(), &format!("target-pose {state}"));
        let (reason, next) = (&told["no_answer"]["reason"], &told["no_answer"]["next"]);
        assert!(reason.as_str().unwrap().contains("not found in the depth image"), "{told}");
        assert!(next.as_str().unwrap().contains("target.use_refused = true"), "{told}");
        let page = std::fs::read_to_string(fixture.at("out/index.html")).unwrap();
        assert!(page.contains("without an answer, at the stage target-pose"));
        assert!(!fixture.at("out/grasp/stage.json").exists());
    }
    with("use_refused = true\n");
    let answer = fixture.run("out", &["--json"]);
    let told: Value = serde_json::from_str(&answer.out).unwrap();
    assert_eq!(states_of(&told).last().unwrap(), "grasp done", "{}", answer.err);
}

#[test]
fn what_is_wrong_with_a_recipe_is_named_with_its_line() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let ball = semfm::geom::zoo::icosphere(2);
    write_mesh(at("mug.obj"), &ball).unwrap();
    std::fs::write(at("grip.json"), r#"{"vertices": [0, 1]}"#).unwrap();
    let sound =
        "[demonstration]\nmesh = 'mug.obj'\nregion = 'grip.json'\n[target]\nmesh = 'mug.obj'\n";
    let out = at("out").to_str().unwrap().to_owned();
    let toml = at("demo.toml").to_str().unwrap().to_owned();
    for (text, words) in [
        (
            format!("{sound}colour = 'x'\n"),
            ["line 6, target.colour", "unknown field `colour`", "scale"],
        ),
        (format!("{sound}scale = 'big'\n"), ["line 6, target.scale", "string", "a number"]),
        (
            sound.replace("'grip.json'", "'grap.json'"),
            ["line 3, demonstration.region", "grap.json", "no such file"],
        ),
        (sound.replace("mesh = 'mug.obj'\nregion", "region"), ["line 1", "mesh", "none"]),
        (
            format!("{sound}[grasp]\ngripper = 'franka'\n"),
            ["line 4, target", "metres", "target.scale"],
        ),
        (
            format!("{sound}[transfer]\nmethod = 'fusd'\n"),
            ["line 7, transfer.method", "fusd", "fused"],
        ),
        (format!("{sound}[robot]\nurdf = 3\n"), ["line 7, robot.urdf", "integer", "path"]),
        (format!("{sound}x = = 3\n"), ["line 6", "demo.toml", "expected"]),
        (format!("{sound}mesh = 'twice.obj'\n"), ["line 6", "mesh", "duplicate"]),
    ] {
        std::fs::write(&toml, &text).unwrap();
        let refused = run(&["run", &toml, "-o", &out]);
        assert_eq!(refused.code, Some(2), "{text}");
        for word in words {
            assert!(refused.err.contains(word), "{word}: {} of {text}", refused.err);
        }
        assert!(!at("out").exists(), "{text}");
    }
    let template = run(&["run", "--template"]);
    assert_eq!(template.code, Some(0));
    std::fs::write(&toml, &template.out).unwrap();
    let refused = run(&["run", &toml, "-o", &out]);
    assert!(refused.code == Some(2) && refused.err.contains("color.png"), "{}", refused.err);
    // A stage that fails is named, and those before it are kept.
    let text = format!(
        "{sound}[transfer]\nsource_features = 'grip.json'\ntarget_features = 'grip.json'\n"
    );
    std::fs::write(&toml, text).unwrap();
    let failed = run(&["run", &toml, "-o", &out, "--no-cache"]);
    assert_eq!(failed.code, Some(2));
    assert!(
        failed.err.contains("stage transfer") && failed.err.contains("grip.json"),
        "{}",
        failed.err
    );
    assert!(at("out/region/stage.json").is_file() && !at("out/index.html").exists());
    for words in [vec!["run"], vec!["run", &toml], vec!["run", &toml, "-o", "-"]] {
        assert_eq!(run(&words).code, Some(2), "{words:?}");
    }
}
