//! PLY, binary little-endian, coordinates in 64 bits.

use std::io::{Result, Write};

use crate::Mesh;
use crate::io::VertexAttributes;
use crate::io::blocks::write_blocks;

pub(super) fn write(
    out: &mut dyn Write,
    mesh: &Mesh,
    attributes: &VertexAttributes<'_>,
) -> Result<()> {
    writeln!(out, "ply\nformat binary_little_endian 1.0\nelement vertex {}", mesh.n_vertices())?;
    writeln!(out, "property double x\nproperty double y\nproperty double z")?;
    if attributes.colors.is_some() {
        for channel in ["red", "green", "blue", "alpha"] {
            writeln!(out, "property uchar {channel}")?;
        }
    }
    for (name, _) in attributes.scalars {
        writeln!(out, "property float {name}")?;
    }
    writeln!(
        out,
        "element face {}\nproperty list uchar int vertex_indices\nend_header",
        mesh.n_faces()
    )?;
    write_blocks(out, mesh.vertices().iter().enumerate(), |block, (i, p)| {
        block.extend(p.to_array().iter().flat_map(|x| x.to_le_bytes()));
        if let Some(colors) = attributes.colors {
            block.extend(colors[i]);
        }
        for (_, values) in attributes.scalars {
            block.extend((values[i] as f32).to_le_bytes());
        }
    })?;
    write_blocks(out, mesh.faces(), |block, face| {
        block.push(3);
        block.extend(face.iter().flat_map(|id| id.to_le_bytes()));
    })
}
