//! The binary: see the library for what it does.

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(semfm_cli::run(std::env::args_os()))
}
