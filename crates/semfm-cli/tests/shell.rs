//! Help, versions and exit codes. What the commands do is tested in `tests/`.

use std::process::Command;

fn run(arguments: &[&str]) -> (Option<i32>, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_semfm-cli")).args(arguments).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code(), text(output.stdout), text(output.stderr))
}

#[test]
fn help_is_data_and_a_wrong_word_is_a_message() {
    for command in ["demo", "views", "region", "transfer", "info", "completions"] {
        let (code, out, err) = run(&[command, "--help"]);
        assert_eq!((code, err.as_str()), (Some(0), ""));
        assert!(out.contains("Example"), "{command} has no example");
    }
    let (code, out, err) = run(&["transfre"]);
    assert_eq!((code, out.as_str()), (Some(2), ""));
    assert!(err.contains("transfer"), "no hint in: {err}");
}

#[test]
fn completions_are_made_for_every_shell() {
    for shell in ["bash", "zsh", "fish"] {
        let (code, out, _) = run(&["completions", shell]);
        assert!(code == Some(0) && out.contains("semfm-cli"), "{shell}");
    }
}
