//! Where commands write: nothing that they read is replaced, nothing special is replaced, and an
//! answer that does not get through is a failure.
#![cfg(unix)]

use std::fs::{self, File};
use std::os::unix::fs::{FileTypeExt, symlink};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use semfm_tests::sample::{Sample, text};
use semfm_tests::shell::{Answer, answer, run, semfm_cli};
use tempfile::TempDir;

fn sample() -> (TempDir, Sample) {
    let folder = tempfile::tempdir().unwrap();
    let sample = Sample::write(&folder.path().join("in"));
    (folder, sample)
}

/// Contents of every file of a folder.
fn contents(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut files: Vec<PathBuf> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files.into_iter().filter(|p| p.is_file()).map(|p| (p.clone(), fs::read(&p).unwrap())).collect()
}

fn made_by(program: &str, arguments: &[&str]) -> bool {
    let made = Command::new(program).args(arguments).stderr(Stdio::null()).status();
    made.is_ok_and(|status| status.success())
}

#[test]
fn no_command_replaces_what_it_reads() {
    let (folder, sample) = sample();
    let at = |name: &str| folder.path().join("in").join(name);
    let gone = |words: &[&str]| {
        let answer = run(words);
        assert_eq!(answer.code, Some(0), "{words:?}: {answer:?}");
    };
    let (mesh, views, grasps) =
        (text(&sample.source), text(&at("v.views.mcap")), text(&at("g.json")));
    gone(&["views", &mesh, "-o", &views, "--count", "2", "--size", "64", "--renderer", "cpu"]);
    image::GrayImage::from_pixel(64, 64, image::Luma([255])).save(at("mask.png")).unwrap();
    fs::hard_link(&sample.source, at("hard.obj")).unwrap();
    symlink("source.obj", at("soft.obj")).unwrap();
    // What `transfer -o .` would write over.
    for (from, to) in [("source.obj", "source.ply"), ("target.obj", "target.ply")] {
        let mesh = semfm::geom::io::read_mesh(at(from)).unwrap().mesh;
        semfm::geom::io::write_mesh(at(to), &mesh).unwrap();
    }
    fs::copy(&sample.region, at("region.json")).unwrap();
    fs::write(at("K.json"), "[500,0,32,0,500,32,0,0,1]").unwrap();
    fs::copy(&sample.region, at("extra.glb")).unwrap();
    let before = contents(&sample.folder);

    let odd = text(&folder.path().join("in/../in/source.obj"));
    let (hard, soft, region) = (text(&at("hard.obj")), text(&at("soft.obj")), text(&sample.region));
    let (mask, ply) = (text(&at("mask.png")), text(&at("source.ply")));
    let target_ply = text(&at("target.ply"));
    let (marked, here) = (text(&at("region.json")), text(&sample.folder));
    let [features_a, features_b] =
        [&sample.source_features, &sample.target_features].map(|p| text(p));
    let view = format!("{views}#000");
    let near = ["--near", "0.04,0,0", "--radius", "0.03"];
    let mut cases: Vec<(Vec<&str>, &str)> = Vec::new();
    for output in [&mesh, &hard, &soft, &odd] {
        cases.push(([&["region", &mesh, "-o", output][..], &near].concat(), "source.obj"));
        cases.push((
            vec!["views", &mesh, "-o", output, "--count", "2", "--size", "32"],
            "source.obj",
        ));
        cases.push((vec!["show", &mesh, "-o", output], "source.obj"));
        cases.push((vec!["align", &mesh, "--cloud", &ply, "-o", output], "source.obj"));
        let grasp =
            ["grasp", &mesh, "--region", &region, "--gripper", "franka", "--metres", "-o", output];
        cases.push((grasp.to_vec(), "source.obj"));
    }
    cases.push((vec!["align", &mesh, "--cloud", &ply, "-o", &ply], "source.ply"));
    cases.push((vec!["region", &mesh, "--mask", &mask, "--view", &view, "-o", &mask], "mask.png"));
    cases.push((
        vec!["region", &mesh, "--mask", &mask, "--view", &view, "-o", &views],
        "v.views.mcap",
    ));
    cases.push((vec!["show", &mesh, &region, "-o", &region], "grip.json"));
    cases.push((vec!["show", &here, "-o", &mask], "mask.png"));
    let views_out = text(&folder.path().join("new.views.mcap"));
    cases.push((vec!["views", &mesh, "-o", &views_out, "--sheet", &mesh], "source.obj"));
    cases.push((vec!["views", &mesh, "-o", &views_out, "--sheet", &views_out], "new.views.mcap"));
    let grasp = ["grasp", &mesh, "--region", &region, "--gripper", "franka", "--metres"];
    cases.push(([&grasp[..], &["-o", &region]].concat(), "grip.json"));
    cases.push(([&grasp[..], &["-o", &grasps, "--picture", &hard]].concat(), "hard.obj"));
    cases.push(([&grasp[..], &["-o", &target_ply, "--scene", &target_ply]].concat(), "target.ply"));
    let transfer = ["transfer", &ply, &target_ply, "--region", &marked];
    let features = ["--source-features", &features_a, "--target-features", &features_b];
    let into = ["-o", here.as_str()];
    cases.push(([&transfer[..], &features, &into].concat(), "region.json"));
    for (words, name) in &cases {
        let answer = run(words);
        assert_eq!(answer.code, Some(2), "{words:?}: {answer:?}");
        assert!(answer.err.contains(name), "{words:?}: {name} is not named in: {}", answer.err);
        assert!(answer.err.contains("input") || answer.err.contains("twice"), "{}", answer.err);
        assert!(contents(&sample.folder) == before, "{words:?} changed an input");
    }
    assert!(!Path::new(&grasps).exists() && !Path::new(&views_out).exists());
}

#[test]
fn the_buffers_of_a_gltf_are_inputs_too() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let mut buffer = Vec::new();
    for value in [0f32, 0., 0., 0.1, 0., 0., 0., 0.1, 0., 0., 0., 0.1] {
        buffer.extend(value.to_le_bytes());
    }
    for id in [0u16, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3] {
        buffer.extend(id.to_le_bytes());
    }
    fs::write(at("a.bin"), &buffer).unwrap();
    let json = serde_json::json!({
        "asset": { "version": "2.0" },
        "buffers": [{ "uri": "a.bin", "byteLength": buffer.len() }],
        "bufferViews": [
            { "buffer": 0, "byteOffset": 0, "byteLength": 48 },
            { "buffer": 0, "byteOffset": 48, "byteLength": 24 },
        ],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
              "min": [0, 0, 0], "max": [0.1, 0.1, 0.1] },
            { "bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR" },
        ],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1 }] }],
        "nodes": [{ "mesh": 0 }], "scenes": [{ "nodes": [0] }], "scene": 0,
    });
    fs::write(at("a.gltf"), json.to_string()).unwrap();
    let (mesh, bin) = (text(&at("a.gltf")), text(&at("a.bin")));
    let answer = run(&["region", &mesh, "--vertices", "0", "-o", &bin]);
    assert_eq!(answer.code, Some(2), "{answer:?}");
    assert!(answer.err.contains("a.bin") && answer.err.contains("input"), "{}", answer.err);
    assert_eq!(fs::read(at("a.bin")).unwrap(), buffer);
}

#[test]
fn special_files_are_written_into_or_refused_and_links_stay() {
    let (folder, sample) = sample();
    let at = |name: &str| folder.path().join(name);
    let mesh = text(&sample.source);
    let region = |output: &Path| run(&["region", &mesh, "--vertices", "1,2", "-o", &text(output)]);

    symlink("real.json", at("link.json")).unwrap();
    for _ in 0..2 {
        assert_eq!(region(&at("link.json")).code, Some(0));
        assert!(at("link.json").is_symlink() && at("real.json").is_file());
    }
    fs::remove_file(at("real.json")).unwrap();
    let listener = std::os::unix::net::UnixListener::bind(at("socket")).unwrap();
    for (name, word) in [("socket", "a socket"), ("in", "a folder")] {
        let answer = region(&at(name));
        assert_eq!(answer.code, Some(2), "{answer:?}");
        assert!(answer.err.contains(name) && answer.err.contains(word), "{}", answer.err);
    }
    drop(listener);

    if made_by("mkfifo", &[&text(&at("pipe"))]) {
        let alone = region(&at("pipe"));
        assert_eq!(alone.code, Some(2), "{alone:?}");
        assert!(alone.err.contains("nobody reads"), "{}", alone.err);
        let pipe = at("pipe");
        let reader = std::thread::spawn(move || fs::read(pipe).unwrap());
        assert_eq!(region(&at("pipe")).code, Some(0));
        assert!(reader.join().unwrap().starts_with(b"{"));
        assert!(fs::metadata(at("pipe")).unwrap().file_type().is_fifo());
    }
    // A private twin of /dev/null: the real one is never touched.
    if made_by("mknod", &[&text(&at("null")), "c", "1", "3"]) {
        let answer = region(&at("null"));
        let is_device = || fs::symlink_metadata(at("null")).unwrap().file_type().is_char_device();
        // A file system may forbid devices (nodev): then it is refused, but stays all the same.
        assert!(matches!(answer.code, Some(0 | 2)) && is_device(), "{answer:?}");
        let out = at("out");
        fs::create_dir(&out).unwrap();
        assert!(made_by("mknod", &[&text(&out.join("region.json")), "c", "1", "3"]));
        let answer = run(&sample.transfer(&out, &[]));
        assert!(matches!(answer.code, Some(0..=2)), "{answer:?}");
        let about = fs::symlink_metadata(out.join("region.json")).unwrap();
        assert!(about.file_type().is_char_device());
    }
}

#[test]
fn devices_and_pipes_are_no_inputs_for_any_reader() {
    let (folder, sample) = sample();
    let at = |name: &str| folder.path().join(name);
    let mut specials = vec![PathBuf::from("/dev/zero"), folder.path().to_owned()];
    if made_by("mkfifo", &[&text(&at("pipe"))]) {
        specials.push(at("pipe"));
    }
    let (mesh, target, grip) = (text(&sample.source), text(&sample.target), text(&sample.region));
    let npy = text(&sample.source_features);
    let out = text(&at("never"));
    for special in &specials {
        let special = text(special);
        let view = format!("{special}#0");
        let commands = [
            format!("info {special}"),
            format!("region {special} --vertices 1 -o {out}"),
            format!("region {mesh} --mask {special} --view x.mcap#0 -o {out}"),
            format!("region {mesh} --mask {grip} --view {view} -o {out}"),
            format!("views {special} -o {out}"),
            format!("align {special} --cloud {mesh} -o {out}"),
            format!("align {mesh} --cloud {special} -o {out}"),
            format!("align {mesh} --depth {special} --intrinsics {grip} -o {out}"),
            format!("align {mesh} --cloud {target} --init {special} -o {out}"),
            format!("grasp {mesh} --region {special} --gripper franka --metres -o {out}"),
            format!("grasp {mesh} --region {grip} --gripper {special} --metres -o {out}"),
            format!("grasp {mesh} --region {grip} --gripper franka --aligned {special} -o {out}"),
            format!(
                "grasp {mesh} --region {grip} --gripper franka --metres --scene {special} -o {out}"
            ),
            format!(
                "transfer {special} {target} --region {grip} --source-features {npy} --target-features {npy} -o {out}"
            ),
            format!(
                "transfer {mesh} {target} --region {special} --source-features {npy} --target-features {npy} -o {out}"
            ),
            format!(
                "transfer {mesh} {target} --region {grip} --source-features {special} --target-features {special} -o {out}"
            ),
            format!(
                "transfer {mesh} {target} --region {grip} --source-embeddings {special} --target-embeddings {special} -o {out}"
            ),
            format!("show {mesh} {special} -o {out}"),
            format!("eval --synthetic --compare {special} -o {out}"),
            format!("eval --synthetic --seeds 0 --objects 2 --vlm {special} -o {out}"),
        ];
        for command in commands {
            // No path of a temporary folder has a space in it.
            let words: Vec<&str> = command.split(' ').collect();
            let start = std::time::Instant::now();
            let answer = run(&words);
            assert_eq!(answer.code, Some(2), "{words:?}: {answer:?}");
            assert!(start.elapsed().as_secs() < 20, "{words:?} took {:?}", start.elapsed());
            assert!(!at("never").is_file() && !answer.err.contains("panicked"), "{words:?}");
        }
    }
}

#[test]
fn an_answer_that_cannot_be_printed_is_a_failure_and_a_closed_pipe_is_none() {
    if !Path::new("/dev/full").exists() {
        return;
    }
    let (folder, sample) = sample();
    let at = |name: &str| text(&folder.path().join(name));
    let (mesh, grip, out) = (text(&sample.source), text(&sample.region), at("r.json"));
    let (page, grasps) = (at("p.html"), at("g.json"));
    let transfer = sample.transfer(&folder.path().join("out"), &[]);
    let transfer: Vec<&str> = transfer.iter().map(String::as_str).collect();
    let commands: Vec<Vec<&str>> = vec![
        vec!["info", &mesh],
        vec!["info", "--json", &mesh],
        vec!["completions", "bash"],
        vec!["--help"],
        vec!["--version"],
        vec!["region", &mesh, "--vertices", "1", "-o", &out],
        vec!["region", &mesh, "--vertices", "1", "-o", "-"],
        vec!["show", &mesh, "-o", &page],
        vec!["grasp", &mesh, "--region", &grip, "--gripper", "franka", "--metres", "-o", &grasps],
        transfer,
    ];
    for words in commands {
        let full = File::options().write(true).open("/dev/full").unwrap();
        let told = semfm_cli().args(&words).stdout(full).stderr(Stdio::piped()).output().unwrap();
        let Answer { code, err, .. } = answer(told);
        assert_eq!(code, Some(2), "{words:?}: {err}");
        assert!(err.contains("stdout") && err.contains("No space"), "{words:?}: {err}");

        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let told = semfm_cli().args(&words).stdout(writer).stderr(Stdio::piped()).output().unwrap();
        let Answer { code, err, .. } = answer(told);
        assert!(matches!(code, Some(0 | 1)), "{words:?}: {code:?} {err}");
        assert!(!err.contains("pipe") && !err.contains("panicked"), "{words:?}: {err}");
    }
}

#[test]
fn a_dash_is_stdout_and_missing_folders_are_made() {
    let (folder, sample) = sample();
    let mesh = text(&sample.source);
    let deep = folder.path().join("not/there/r.json");
    let told = run(&["region", &mesh, "--vertices", "1,2", "-o", &text(&deep)]);
    assert_eq!(told.code, Some(0), "{told:?}");
    let told = run(&["region", &mesh, "--vertices", "1,2", "-o", "-"]);
    assert_eq!(told.code, Some(0), "{told:?}");
    assert_eq!(told.out, fs::read_to_string(&deep).unwrap());
    let told = run(&["show", &mesh, "-o", "-"]);
    assert!(
        told.out.starts_with("<!doctype html>") && told.out.ends_with("</html>\n"),
        "{}",
        told.code.unwrap()
    );
    let told = run(&["region", &mesh, "--vertices", "1", "-o", "-", "--json"]);
    assert_eq!(told.code, Some(2), "{told:?}");
    let told = run(&sample.transfer(Path::new("-"), &[]));
    assert!(told.code == Some(2) && told.err.contains("folder"), "{told:?}");
    // A file where a folder should be.
    let below = folder.path().join("in/grip.json/out.json");
    let told = run(&["region", &mesh, "--vertices", "1", "-o", &text(&below)]);
    assert_eq!(told.code, Some(2), "{told:?}");
    assert!(told.err.contains("out.json") && !told.err.contains(".semfm-"), "{}", told.err);
}

#[test]
fn what_others_wrote_does_not_reach_the_terminal_as_commands() {
    let (folder, sample) = sample();
    let at = |name: &str| folder.path().join(name);
    let evil = "\u{1b}]0;owned\u{7}\u{9b}31m\u{202e}";
    let mesh = text(&sample.source);
    let file = serde_json::json!({ "mesh": { "hash": evil }, "vertices": [1] });
    fs::write(at("r.json"), file.to_string()).unwrap();
    let named = at(&format!("a{evil}.obj"));
    fs::copy(&sample.source, &named).unwrap();
    let broken = at(&format!("b{evil}.obj"));
    fs::write(&broken, "v 1 2\n").unwrap();
    let (r, page) = (text(&at("r.json")), text(&at("p.html")));
    for words in [
        vec!["grasp", &mesh, "--region", &r, "--gripper", "franka", "--metres", "-o", &page],
        vec!["info", &text(&named)],
        vec!["info", "--json", &text(&named)],
        vec!["info", &text(&broken)],
        vec!["show", &text(&named), "-o", &text(&at(&format!("p{evil}.html")))],
        vec!["fly", evil],
        vec!["grasp", &mesh, "--region", &r, "--gripper", evil, "--metres", "-o", &page],
    ] {
        let told = run(&words);
        let all = told.out + &told.err;
        let obeyed =
            all.chars().find(|c| (c.is_control() && *c != '\n' && *c != '\t') || *c == '\u{202e}');
        assert_eq!(obeyed, None, "{words:?}: {all:?}");
        let said = all.contains("\\u001b") || told.code == Some(0) || words[0] == "fly";
        assert!(said, "{words:?}: {all}");
    }
}

#[test]
fn names_that_are_nearly_right_are_answered_by_the_right_ones() {
    let (folder, sample) = sample();
    let (mesh, grip) = (text(&sample.source), text(&sample.region));
    let out = text(&folder.path().join("g.json"));
    for (gripper, meant) in
        [("panda", "franka"), ("2f85", "robotiq-2f85"), ("Robotiq-2F140", "robotiq-2f140")]
    {
        let told =
            run(&["grasp", &mesh, "--region", &grip, "--gripper", gripper, "--metres", "-o", &out]);
        assert_eq!(told.code, Some(2), "{told:?}");
        assert!(told.err.contains(&format!("did you mean `{meant}`")), "{}", told.err);
    }
    let told = run(&sample.transfer(&folder.path().join("t"), &["--method", "fuse"]));
    assert!(told.err.contains("did you mean `fused`"), "{}", told.err);
}

#[test]
fn a_region_that_is_too_small_for_a_pad_is_told_so() {
    let (folder, sample) = sample();
    let (mesh, out) = (text(&sample.source), text(&folder.path().join("g.json")));
    let one = folder.path().join("one.json");
    fs::write(&one, r#"{"vertices": [60]}"#).unwrap();
    let words = ["grasp", &mesh, "--gripper", "franka", "--metres", "-o", &out, "--region"];
    let told = run(&[&words[..], &[&text(&one)]].concat());
    assert_eq!(told.code, Some(1), "{told:?}");
    assert!(told.err.contains("region of 1 vertices covers"), "{}", told.err);
}

#[test]
fn a_size_that_cannot_be_is_asked_about() {
    let (folder, sample) = sample();
    let at = |name: &str| folder.path().join(name);
    let mesh = semfm::geom::io::read_mesh(&sample.source).unwrap().mesh;
    let grip = text(&sample.region);
    for (name, factor, metric, code, words) in [
        ("mm.obj", 1000.0, "--metres", Some(2), &["millimetres", "0.001"][..]),
        ("kettle.obj", 22.0, "--metres", None, &["1.", " m long"]),
        ("fine.obj", 1.0, "--metres", None, &["object", " mm"]),
    ] {
        let vertices = mesh.vertices().iter().map(|&p| p * factor).collect();
        let larger = semfm::Mesh::new(vertices, mesh.faces().to_vec()).unwrap();
        semfm::geom::io::write_mesh(at(name), &larger).unwrap();
        let out = text(&at("g.json"));
        let words_in = [
            "grasp",
            &text(&at(name)),
            "--region",
            &grip,
            "--gripper",
            "franka",
            metric,
            "-o",
            &out,
        ];
        let told = run(&words_in);
        assert!(code.is_none() || told.code == code, "{name}: {told:?}");
        assert!(words.iter().all(|word| told.err.contains(word)), "{name}: {}", told.err);
        let asks =
            told.err.contains("is that its true size") || told.err.contains("is the mesh in");
        assert_eq!(asks, name != "fine.obj", "{name}: {}", told.err);
    }
}
