//! Arrays for the page: zlib in base64. `viewer/decode.js` reads them back.

use std::io::Write;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use semfm::Mesh;
use semfm::geom::math::{DVec3, bounds};
use serde::Serialize;

use crate::html::base64;

/// Bytes, compressed.
pub(super) fn encode_bytes(bytes: &[u8]) -> String {
    let mut zlib = ZlibEncoder::new(Vec::new(), Compression::default());
    // A Vec takes everything.
    let done = zlib.write_all(bytes).and_then(|()| zlib.finish());
    base64(&done.unwrap_or_default())
}

/// Whole numbers: differences to the number before, signs folded into the last bit, in four planes of
/// bytes. Neighbours in a mesh are near each other, so three of the planes are all but empty.
pub(super) fn encode_numbers(numbers: impl IntoIterator<Item = u32>) -> String {
    let mut before = 0u32;
    let folded: Vec<u32> = numbers
        .into_iter()
        .map(|number| {
            let difference = number.wrapping_sub(before) as i32;
            before = number;
            ((difference << 1) ^ (difference >> 31)) as u32
        })
        .collect();
    let mut planes = Vec::with_capacity(4 * folded.len());
    for k in 0..4 {
        planes.extend(folded.iter().map(|number| (number >> (8 * k)) as u8));
    }
    encode_bytes(&planes)
}

/// Steps that the bounding box has along each axis; the viewer counts from the middle, 2¹⁹.
const STEPS: f64 = (1 << 20) as f64;

/// A mesh whose coordinates are whole numbers of steps.
#[derive(Clone, Debug, Serialize)]
pub(super) struct EncodedMesh {
    n: usize,
    /// Size of a step along each axis.
    step: [f64; 3],
    /// Steps from the lower corner of the box: all x, then all y, then all z.
    positions: String,
    faces: String,
}

impl EncodedMesh {
    pub(super) fn new(mesh: &Mesh) -> Self {
        Self::of(mesh.vertices(), mesh.faces())
    }

    /// A surface by its corners and triangles.
    pub(super) fn of(vertices: &[DVec3], faces: &[[u32; 3]]) -> Self {
        let (low, high) = bounds(vertices).unwrap_or_default();
        let step = ((high - low) / STEPS).max(DVec3::splat(f64::MIN_POSITIVE));
        let mut steps = Vec::with_capacity(3 * vertices.len());
        for k in 0..3 {
            let along = vertices.iter();
            steps.extend(along.map(|p| ((p[k] - low[k]) / step[k]).round() as u32));
        }
        Self {
            n: vertices.len(),
            step: step.to_array(),
            positions: encode_numbers(steps),
            faces: encode_numbers(faces.as_flattened().iter().copied()),
        }
    }
}
