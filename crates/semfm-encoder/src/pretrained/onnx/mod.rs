//! Any ONNX network as an encoder, described by a small JSON file (`docs/encoders.md`), run by `rten`.

mod description;
mod external_files;
mod guarded;
#[cfg(feature = "onnx")]
mod network;
#[cfg(feature = "onnx")]
mod read;

/// What computes: part of the version of embeddings. As in the root `Cargo.toml`.
const RUNTIME: &str = "rten-0.24";

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    /// The version in the name of what computes is that of the workspace's table.
    #[test]
    fn the_runtime_is_the_one_that_is_linked() {
        let table = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../Cargo.toml");
        let Ok(table) = std::fs::read_to_string(table) else { return };
        let version = RUNTIME.strip_prefix("rten-").unwrap();
        assert!(table.contains(&format!("rten = {{ version = \"{version}\"")));
    }
}
