//! Bad input: exit code 2, a message that names what is wrong, and nothing written.

use std::path::{Path, PathBuf};

use semfm_tests::shell::{Answer, run};
use tempfile::TempDir;

struct Files {
    folder: TempDir,
    source: PathBuf,
    target: PathBuf,
    region: PathBuf,
    source_embeddings: PathBuf,
    target_embeddings: PathBuf,
}

fn files() -> Files {
    let folder = tempfile::tempdir().unwrap();
    let answer = run(&["demo", "--quiet", "-o", folder.path().to_str().unwrap()]);
    assert_eq!(answer.code, Some(0), "{answer:?}");
    let at = |name: &str| folder.path().join(name);
    Files {
        source: at("containers_0_s0.obj"),
        target: at("containers_1_s0.obj"),
        region: at("containers_0_s0.json"),
        source_embeddings: at("containers_0_s0.emb.mcap"),
        target_embeddings: at("containers_1_s0.emb.mcap"),
        folder,
    }
}

impl Files {
    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    }

    fn transfer(&self, more: &[&str]) -> Answer {
        let text = |path: &Path| path.to_str().unwrap().to_owned();
        let mut arguments: Vec<String> =
            vec!["transfer".into(), text(&self.source), text(&self.target)];
        arguments.extend(["--region".into(), text(&self.region)]);
        arguments.extend(["--source-embeddings".into(), text(&self.source_embeddings)]);
        arguments.extend(["--target-embeddings".into(), text(&self.target_embeddings)]);
        arguments.extend([
            "-o".into(),
            text(&self.folder.path().join("refused")),
            "--quiet".into(),
        ]);
        arguments.extend(more.iter().map(|&word| word.to_owned()));
        run(&arguments)
    }

    /// The transfer must be refused with all of `words` in the message, and leave nothing behind.
    fn refuses(&self, what: &str, more: &[&str], words: &[&str]) {
        let answer = self.transfer(more);
        assert_eq!(answer.code, Some(2), "{what}: {answer:?}");
        for word in words {
            assert!(answer.err.contains(word), "{what}: `{word}` is missing in: {}", answer.err);
        }
        assert!(!answer.err.contains("panicked"), "{what}: {}", answer.err);
        assert!(!self.folder.path().join("refused").exists(), "{what}: something was written");
    }
}

#[test]
fn a_transfer_of_the_wrong_things_is_refused_before_anything_is_written() {
    let mut good = files();
    good.refuses("k beyond the mesh", &["-k", "100000"], &["100000"]);
    good.refuses("k of nothing", &["-k", "0"], &["0"]);
    good.refuses("unknown method", &["--method", "magic"], &["magic", "fused"]);
    good.refuses("unknown rule", &["--rule", "magic"], &["magic", "preimage"]);

    let region = std::mem::take(&mut good.region);
    for (name, text, words) in [
        ("empty.json", r#"{"vertices": []}"#, &["empty.json", "vertices", "empty region"][..]),
        ("beyond.json", r#"{"vertices": [1, 99999]}"#, &["beyond.json", "vertices[1]", "99999"]),
        (
            "other.json",
            r#"{"mesh": {"n_vertices": 7}, "vertices": [1]}"#,
            &["other.json", "n_vertices", "7"],
        ),
        (
            "weights.json",
            r#"{"vertices": [1], "weights": [-1]}"#,
            &["weights.json", "weights[0]", "-1"],
        ),
        ("broken.json", r#"{"vertices": [1"#, &["broken.json", "line 1"]),
    ] {
        good.region = good.write(name, text);
        good.refuses(name, &[], words);
    }
    good.region = region;

    std::mem::swap(&mut good.source_embeddings, &mut good.target_embeddings);
    good.refuses("embeddings of another mesh", &[], &["emb.mcap", "swapped"]);
    std::mem::swap(&mut good.source_embeddings, &mut good.target_embeddings);

    let bytes = std::fs::read(&good.source_embeddings).unwrap();
    let whole = std::mem::take(&mut good.source_embeddings);
    good.source_embeddings = good.write("short.emb.mcap", &bytes[..bytes.len() / 2]);
    good.refuses("truncated embeddings", &[], &["short.emb.mcap"]);
    let mut flipped = bytes.clone();
    flipped[bytes.len() / 2] ^= 1;
    good.source_embeddings = good.write("flipped.emb.mcap", flipped);
    good.refuses("a flipped bit", &[], &["flipped.emb.mcap"]);
    good.source_embeddings = good.folder.path().join("missing.emb.mcap");
    good.refuses("no such file", &[], &["missing.emb.mcap"]);
    good.source_embeddings = whole;

    let target = std::mem::take(&mut good.target);
    good.target = good.write("nan.obj", "v 0 0 0\nv 1 0 nan\nv 0 1 0\nf 1 2 3\n");
    good.refuses("a coordinate that is no number", &[], &["nan.obj"]);
    good.target = good.write("wrong.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n");
    good.refuses("an id that is not there", &[], &["wrong.obj", "9"]);
    good.target = good.write("flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n");
    good.refuses("another mesh altogether", &[], &["emb.mcap"]);
    good.target = target;
    assert_eq!(good.transfer(&[]).code, Some(0), "the transfer itself works");
}

#[test]
fn every_command_says_what_it_was_given_and_what_it_wanted() {
    let good = files();
    let source = good.source.to_str().unwrap();
    let out = good.folder.path().join("never");
    let never = out.to_str().unwrap();
    for (arguments, words) in [
        (vec!["info", "/no/such/file.obj"], vec!["/no/such/file.obj"]),
        (vec!["views", source, "-o", never, "--renderer", "paper"], vec!["renderer", "auto"]),
        (vec!["views", source, "-o", never, "--size", "0"], vec!["size"]),
        (vec!["views", source, "-o", never, "--count", "0"], vec!["views"]),
        (vec!["views", source, "-o", never, "--close-ups", "99"], vec!["close-ups", "99"]),
        (vec!["views", source, "-o", never, "--fov", "360"], vec!["fov", "150"]),
        (vec!["views", source, "-o", never, "--occlusion", "2"], vec!["occlusion", "0 to 1"]),
        (vec!["views", source, "-o", never, "--background", "0,1"], vec!["background", "2"]),
        (vec!["views", source, "-o", never, "--normals", "--grey"], vec!["normals", "grey"]),
        (vec!["region", source, "-o", never, "--vertices", "99999"], vec!["99999"]),
        (vec!["region", source, "-o", never, "--near", "0,0", "--radius", "1"], vec!["near"]),
        (vec!["region", source, "-o", never, "--near", "0,0,0", "--radius", "-1"], vec!["radius"]),
        (vec!["region", source, "-o", never, "--ply-color"], vec!["colours"]),
        (vec!["region", source, "-o", never], vec!["required"]),
        (vec!["demo", "--category", "cars"], vec!["cars", "tools"]),
        (vec!["demo", "--level", "insane"], vec!["insane", "easy"]),
        (vec!["transfer", source], vec!["required"]),
        (vec!["fly"], vec!["fly"]),
    ] {
        let answer = run(&arguments);
        assert_eq!(answer.code, Some(2), "{arguments:?}: {answer:?}");
        for word in words {
            assert!(
                answer.err.contains(word),
                "{arguments:?}: `{word}` is missing in: {}",
                answer.err
            );
        }
        assert!(!answer.err.contains("panicked"), "{arguments:?}: {}", answer.err);
        assert!(!out.exists(), "{arguments:?} wrote something");
    }
}

#[test]
fn feature_arrays_are_checked_against_the_mesh() {
    let good = files();
    let npy = |descr: &str, shape: &str, data: &[u8]| {
        let header = format!(
            "{:<117}\n",
            format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}")
        );
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.bytes());
        bytes.extend(data);
        bytes
    };
    for (name, bytes, words) in [
        ("rows.npy", npy("<f4", "(2, 2)", &[0; 16]), vec!["rows.npy", "shape", "(2, 2)"]),
        ("huge.npy", npy("<f4", "(3000, 4000000000000)", &[0; 16]), vec!["huge.npy", "shape"]),
        ("int.npy", npy("<i4", "(3000, 1)", &[0; 12000]), vec!["int.npy", "dtype"]),
        ("short.npy", npy("<f4", "(3000, 2)", &[0; 6000]), vec!["short.npy"]),
        ("nan.npy", npy("<f4", "(3000, 1)", &[255; 12000]), vec!["nan.npy", "row 0"]),
        ("text.npy", b"hello".to_vec(), vec!["text.npy"]),
    ] {
        let path = good.write(name, bytes);
        let path = path.to_str().unwrap();
        let (source, target) = (good.source.to_str().unwrap(), good.target.to_str().unwrap());
        let out = good.folder.path().join("refused");
        let answer = run(&[
            "transfer",
            source,
            target,
            "--region",
            good.region.to_str().unwrap(),
            "-o",
            out.to_str().unwrap(),
            "--source-features",
            path,
            "--target-features",
            path,
        ]);
        assert_eq!(answer.code, Some(2), "{name}: {answer:?}");
        for word in words {
            assert!(answer.err.contains(word), "{name}: `{word}` is missing in: {}", answer.err);
        }
        assert!(!out.exists(), "{name}: something was written");
    }
}
