//! Arrays for the page: zlib in base64. `viewer.js` reads them back.

use std::io::Write;

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use semfm::geom::Mesh;
use semfm::geom::math::{DVec3, bounds};
use serde_json::{Value, json};

/// Bytes as they are, in base64.
pub(super) fn base64(bytes: &[u8]) -> String {
    BASE64_STANDARD.encode(bytes)
}

/// Bytes, compressed.
pub(super) fn packed(bytes: &[u8]) -> String {
    let mut zlib = ZlibEncoder::new(Vec::new(), Compression::default());
    // A Vec takes everything.
    let done = zlib.write_all(bytes).and_then(|()| zlib.finish());
    base64(&done.unwrap_or_default())
}

/// Whole numbers: differences to the number before, signs folded into the last bit, in four planes of
/// bytes. Neighbours in a mesh are near each other, so three of the planes are all but empty.
pub(super) fn packed_numbers(numbers: impl IntoIterator<Item = u32>) -> String {
    let mut before = 0u32;
    let folded: Vec<u32> = numbers
        .into_iter()
        .map(|number| {
            let difference = number.wrapping_sub(before) as i32;
            before = number;
            ((difference << 1) ^ (difference >> 31)) as u32
        })
        .collect();
    let plane = |k: u32| folded.iter().map(move |number| (number >> (8 * k)) as u8);
    packed(&(0..4).flat_map(plane).collect::<Vec<u8>>())
}

/// Steps that the bounding box has along each axis; the viewer counts from the middle, 2¹⁹.
const STEPS: f64 = (1 << 20) as f64;

/// `n`, `step`, `positions` and `faces` of a mesh.
pub(super) fn packed_mesh(mesh: &Mesh) -> Value {
    let (low, high) = bounds(mesh.vertices()).unwrap_or_default();
    let step = ((high - low) / STEPS).max(DVec3::splat(f64::MIN_POSITIVE));
    let along =
        |k: usize| mesh.vertices().iter().map(move |p| ((p[k] - low[k]) / step[k]).round() as u32);
    json!({
        "n": mesh.n_vertices(),
        "step": step.to_array(),
        "positions": packed_numbers((0..3).flat_map(along)),
        "faces": packed_numbers(mesh.faces().as_flattened().iter().copied()),
    })
}
