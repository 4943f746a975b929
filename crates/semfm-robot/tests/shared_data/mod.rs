//! Data that only some machines have.

use std::path::{Path, PathBuf};

/// A file or folder of the shared data; where it is absent, says that the test is skipped.
#[allow(clippy::print_stderr)]
pub fn shared(what: &str) -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    let folder = std::env::var_os("SEMFM_SHARED").map_or(beside, PathBuf::from).join(what);
    if folder.exists() {
        return Some(folder);
    }
    eprintln!("SKIPPED: no shared data at {}; set SEMFM_SHARED", folder.display());
    None
}
