//! OBJ and OFF. Rust prints the shortest digits that read back as the same number.

use std::io::{Result, Write};

use super::{Paint, write_blocks};
use crate::Mesh;

/// `v x y z [r g b]` and `f` lines.
pub(super) fn write_obj(out: &mut dyn Write, mesh: &Mesh, paint: &Paint<'_>) -> Result<()> {
    write_blocks(out, mesh.vertices().iter().enumerate(), |block, (i, p)| {
        push(block, format_args!("v {:?} {:?} {:?}", p.x, p.y, p.z));
        if let Some(colors) = paint.colors {
            let [r, g, b, _] = colors[i].map(|c| f32::from(c) / 255.0);
            push(block, format_args!(" {r} {g} {b}"));
        }
        block.push(b'\n');
    })?;
    write_blocks(out, mesh.faces(), |block, face| {
        let [a, b, c] = face.map(|id| u64::from(id) + 1);
        push(block, format_args!("f {a} {b} {c}\n"));
    })
}

/// OFF, or COFF with colours in 0..255, which is what other readers understand.
pub(super) fn write_off(out: &mut dyn Write, mesh: &Mesh, paint: &Paint<'_>) -> Result<()> {
    let keyword = if paint.colors.is_some() { "COFF" } else { "OFF" };
    writeln!(out, "{keyword}\n{} {} 0", mesh.n_vertices(), mesh.n_faces())?;
    write_blocks(out, mesh.vertices().iter().enumerate(), |block, (i, p)| {
        push(block, format_args!("{:?} {:?} {:?}", p.x, p.y, p.z));
        if let Some(colors) = paint.colors {
            let [r, g, b, a] = colors[i];
            push(block, format_args!(" {r} {g} {b} {a}"));
        }
        block.push(b'\n');
    })?;
    write_blocks(out, mesh.faces(), |block, [a, b, c]| {
        push(block, format_args!("3 {a} {b} {c}\n"));
    })
}

fn push(block: &mut Vec<u8>, text: std::fmt::Arguments<'_>) {
    block.write_fmt(text).expect("a vector takes all bytes");
}
