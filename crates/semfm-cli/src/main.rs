//! The binary: see the library for what it does.

use std::process::ExitCode;

fn main() -> ExitCode {
    quiet_drivers();
    semfm_cli::own_process();
    ExitCode::from(semfm_cli::run(std::env::args_os()))
}

/// Mesa's choice of a device asks the display server and, where there is none, complains on stderr
/// as if something had failed. We choose ourselves and need no display.
#[allow(unsafe_code)]
fn quiet_drivers() {
    if std::env::var_os("NODEVICE_SELECT").is_none() {
        // SAFETY: this is the first thing the program does, so no other thread reads the environment.
        unsafe { std::env::set_var("NODEVICE_SELECT", "1") }
    }
}
