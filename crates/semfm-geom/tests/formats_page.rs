//! The page about file formats names every format of the table.

use std::path::Path;

use semfm_geom::io::MeshFormat;

#[test]
fn every_mesh_format_is_on_the_page() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/formats.md");
    // The page is not part of the published crate.
    let Ok(page) = std::fs::read_to_string(path) else { return };
    let page = page.to_lowercase();
    for format in MeshFormat::ALL {
        assert!(page.contains(format.name()), "{format} ({})", format.summary());
    }
}
