//! STL, binary.

use std::io::{Result, Write};

use super::write_blocks;
use crate::Mesh;

pub(super) fn write(out: &mut dyn Write, mesh: &Mesh) -> Result<()> {
    // Anything but the word `solid`, which would look like an ascii file.
    let mut header = [b' '; 80];
    header[..15].copy_from_slice(b"binary STL mesh");
    out.write_all(&header)?;
    out.write_all(&(mesh.n_faces() as u32).to_le_bytes())?;
    write_blocks(out, 0..mesh.n_faces(), |block, face| {
        let normal = mesh.face_normal_scaled(face).normalize_or_zero();
        for p in std::iter::once(normal).chain(mesh.corners(face)) {
            block.extend(p.as_vec3().to_array().iter().flat_map(|x| x.to_le_bytes()));
        }
        block.extend([0, 0]);
    })
}
