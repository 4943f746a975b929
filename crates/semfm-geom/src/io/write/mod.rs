//! Mesh files, written whole or not at all.

mod glb;
mod ply;
mod stl;
mod text;

use std::io::Write;
use std::path::Path;

use super::{MeshFormat, write_atomically};
use crate::{Error, Mesh, Result};

/// What is written of a mesh besides its geometry.
#[derive(Clone, Copy, Debug, Default)]
pub struct Paint<'a> {
    /// RGBA in sRGB for each vertex (n).
    pub colors: Option<&'a [[u8; 4]]>,
    /// Named numbers for each vertex (n each), as `weight`: properties of a PLY, attributes `_WEIGHT`
    /// of a GLB, both in 32 bits. Names are ASCII letters, digits and underscores.
    pub scalars: &'a [(&'a str, &'a [f64])],
}

/// Writes a mesh in the format that the extension names: `obj`, `off`, `ply`, `stl` or `glb`.
///
/// OBJ, OFF and PLY keep coordinates exactly, so the file has the mesh's hash. GLB and STL have 32
/// bits a number, and STL keeps no vertices: they are joined again when it is read.
///
/// # Errors
/// [`Error::OutOfRange`] for another extension or for coordinates that the format cannot hold;
/// [`Error::Io`].
pub fn write_mesh(path: impl AsRef<Path>, mesh: &Mesh) -> Result<()> {
    write_painted_mesh(path, mesh, &Paint::default())
}

/// Writes a mesh with colours (OBJ, OFF, PLY, GLB) and numbers (PLY, GLB) at its vertices.
///
/// # Errors
/// As [`write_mesh`], and [`Error::Length`] or [`Error::OutOfRange`] for paint that does not fit the
/// mesh or that the format cannot hold.
pub fn write_painted_mesh(path: impl AsRef<Path>, mesh: &Mesh, paint: &Paint<'_>) -> Result<()> {
    let path = path.as_ref();
    let format = MeshFormat::from_path(path).filter(|&format| format != MeshFormat::Gltf);
    let Some(format) = format else {
        return Err(refused("mesh format", "obj, off, ply, stl or glb", path.display()));
    };
    check(mesh, paint, format)?;
    write_atomically(path, |out| match format {
        MeshFormat::Obj => text::write_obj(out, mesh, paint),
        MeshFormat::Off => text::write_off(out, mesh, paint),
        MeshFormat::Ply => ply::write(out, mesh, paint),
        MeshFormat::Stl => stl::write(out, mesh),
        MeshFormat::Glb | MeshFormat::Gltf => glb::write(out, mesh, paint),
    })
}

fn check(mesh: &Mesh, paint: &Paint<'_>, format: MeshFormat) -> Result<()> {
    let n = mesh.n_vertices();
    let length = |what, found| {
        if found == n { Ok(()) } else { Err(Error::Length { what, expected: n, found }) }
    };
    if let Some(colors) = paint.colors {
        length("vertex colours", colors.len())?;
    }
    for (name, values) in paint.scalars {
        length("vertex numbers", values.len())?;
        let plain = |b: u8| b.is_ascii_alphanumeric() || b == b'_';
        let taken = matches!(*name, "x" | "y" | "z" | "red" | "green" | "blue" | "alpha");
        if name.is_empty() || taken || !name.bytes().all(plain) {
            return Err(refused("name of vertex numbers", "letters, digits and underscores", name));
        }
    }
    let holds_scalars = matches!(format, MeshFormat::Ply | MeshFormat::Glb);
    if (!paint.scalars.is_empty() && !holds_scalars)
        || (paint.colors.is_some() && format == MeshFormat::Stl)
    {
        return Err(refused("paint", "what the format can hold", format!("{format:?}")));
    }
    let narrow = matches!(format, MeshFormat::Stl | MeshFormat::Glb);
    let too_large = |x: &f64| x.abs() > f64::from(f32::MAX);
    match mesh.vertices().iter().flat_map(|p| p.to_array()).find(too_large) {
        Some(x) if narrow => Err(refused("coordinate", "at most 3.4e38 in this format", x)),
        _ => Ok(()),
    }
}

fn refused(what: &'static str, expected: &str, found: impl std::fmt::Display) -> Error {
    Error::OutOfRange { what, expected: expected.into(), found: found.to_string() }
}

/// Writes blocks of bytes made from items, a few thousand items at a time.
fn write_blocks<T>(
    out: &mut dyn Write,
    items: impl IntoIterator<Item = T>,
    mut bytes_of: impl FnMut(&mut Vec<u8>, T),
) -> std::io::Result<()> {
    const BLOCK: usize = 1 << 16;
    let mut block = Vec::with_capacity(BLOCK + 256);
    for item in items {
        bytes_of(&mut block, item);
        if block.len() >= BLOCK {
            out.write_all(&block)?;
            block.clear();
        }
    }
    out.write_all(&block)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::read_mesh;
    use crate::math::DVec3;

    fn pyramid() -> Mesh {
        let vertices = vec![
            DVec3::new(0.1, -0.2, 1e-9),
            DVec3::new(1.0 / 3.0, 0.0, 0.0),
            DVec3::new(0.0, 12_345.678_9, -0.0),
            DVec3::new(0.5, 0.5, 2.0),
        ];
        Mesh::new(vertices, vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]).unwrap()
    }

    const COLORS: [[u8; 4]; 4] =
        [[255, 0, 0, 255], [0, 128, 7, 255], [1, 2, 3, 255], [254, 9, 99, 255]];

    #[test]
    fn exact_formats_keep_the_hash_and_the_colours() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["a.obj", "a.off", "a.ply"] {
            let path = folder.path().join(name);
            let paint = Paint { colors: Some(&COLORS), ..Default::default() };
            write_painted_mesh(&path, &pyramid(), &paint).unwrap();
            let file = read_mesh(&path).unwrap();
            assert_eq!(file.mesh.hash(), pyramid().hash(), "{name}");
            assert_eq!(file.appearance.vertex_colors.as_deref(), Some(&COLORS[..]), "{name}");
            write_mesh(&path, &pyramid()).unwrap();
            assert!(read_mesh(&path).unwrap().appearance.is_plain(), "{name}");
        }
    }

    #[test]
    fn narrow_formats_keep_32_bits() {
        let folder = tempfile::tempdir().unwrap();
        let weight = [0.0, 0.25, 0.5, 1.0];
        let paint = Paint { colors: Some(&COLORS), scalars: &[("weight", &weight)] };
        let glb = folder.path().join("a.glb");
        write_painted_mesh(&glb, &pyramid(), &paint).unwrap();
        let file = read_mesh(&glb).unwrap();
        let narrow = |p: &DVec3| p.as_vec3().as_dvec3();
        let expected: Vec<_> = pyramid().vertices().iter().map(narrow).collect();
        assert_eq!(file.mesh.vertices(), expected);
        assert_eq!(file.mesh.faces(), pyramid().faces());
        assert_eq!(file.appearance.vertex_colors.as_deref(), Some(&COLORS[..]));
        let stl = folder.path().join("a.stl");
        write_mesh(&stl, &pyramid()).unwrap();
        let mesh = read_mesh(&stl).unwrap().mesh;
        assert_eq!((mesh.n_vertices(), mesh.n_faces()), (4, 4));
        assert!(
            (0..4).all(|face| mesh.corners(face) == pyramid().corners(face).map(|p| narrow(&p)))
        );
    }

    #[test]
    fn paint_that_does_not_fit_is_refused_and_nothing_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let refused = |name: &str, paint: &Paint<'_>| {
            let path = folder.path().join(name);
            write_painted_mesh(&path, &pyramid(), paint).is_err() && !path.exists()
        };
        assert!(refused("a.ply", &Paint { colors: Some(&COLORS[1..]), ..Default::default() }));
        assert!(refused("a.stl", &Paint { colors: Some(&COLORS), ..Default::default() }));
        assert!(refused(
            "a.obj",
            &Paint { scalars: &[("weight", &[0.0; 4])], ..Default::default() }
        ));
        assert!(refused("a.ply", &Paint { scalars: &[("a b", &[0.0; 4])], ..Default::default() }));
        assert!(refused("a.gltf", &Paint::default()));
        assert!(refused("none", &Paint::default()));
    }
}
