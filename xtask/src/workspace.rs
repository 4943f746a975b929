//! Where things lie in this checkout.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

/// The checkout that this program was built from.
pub struct Workspace {
    /// The repository's root.
    pub root: PathBuf,
}

impl Workspace {
    /// The workspace around this crate.
    pub fn find() -> Result<Self> {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().context("xtask has no parent")?;
        Ok(Self { root: root.to_owned() })
    }

    /// A folder below cargo's target folder.
    pub fn built(&self, folder: &str) -> PathBuf {
        let target = std::env::var_os("CARGO_TARGET_DIR").unwrap_or_else(|| "target".into());
        self.root.join(target).join(folder)
    }

    /// The folder of shared test data, where there is one: `$SEMFM_SHARED`, or `shared` beside the
    /// repository.
    pub fn shared(&self) -> Option<PathBuf> {
        let beside = || self.root.join("../shared");
        let folder = std::env::var_os("SEMFM_SHARED").map_or_else(beside, PathBuf::from);
        folder.is_dir().then_some(folder)
    }

    /// Names of the example programs in `pattern`, a folder in which one part may be `*`, sorted.
    pub fn examples(&self, pattern: &str) -> Result<Vec<String>> {
        let folders = match pattern.split_once('*') {
            None => vec![self.root.join(pattern)],
            Some((above, below)) => {
                let inside = entries(&self.root.join(above))?;
                inside.into_iter().map(|crate_| crate_.join(below.trim_matches('/'))).collect()
            }
        };
        let mut names = Vec::new();
        for folder in folders.into_iter().filter(|folder| folder.is_dir()) {
            names.extend(
                entries(&folder)?
                    .iter()
                    .filter(|path| path.extension().is_some_and(|kind| kind == "rs"))
                    .filter_map(|path| Some(path.file_stem()?.to_str()?.to_owned())),
            );
        }
        names.sort();
        Ok(names)
    }
}

/// Whether an example program measures: it is called with arguments, and says which.
pub fn is_benchmark(name: &str) -> bool {
    name.starts_with("bench_")
}

/// What a folder holds.
pub fn entries(folder: &Path) -> Result<Vec<PathBuf>> {
    let read = || -> std::io::Result<Vec<PathBuf>> {
        folder.read_dir()?.map(|entry| Ok(entry?.path())).collect()
    };
    read().with_context(|| folder.display().to_string())
}
