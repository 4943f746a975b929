//! Mesh files, written whole or not at all.

use std::path::Path;

use super::gltf::write_node;
use super::vertex_attributes::refused;
use super::{GlbNode, MeshFormat, VertexAttributes, refuse_input, write_atomically};
use crate::{Mesh, Result};

/// Writes a mesh in the format that the extension names, one of [`MeshFormat::writable_names`].
///
/// OBJ, OFF and PLY keep coordinates exactly, so the file has the mesh's hash. GLB and STL have 32
/// bits a number, and STL keeps no vertices: they are joined again when it is read.
///
/// # Errors
/// [`Error::OutOfRange`](crate::Error::OutOfRange) for another extension or for coordinates that the format cannot hold;
/// [`Error::Format`](crate::Error::Format) for a file that was read as an input
/// ([`refuse_input`]); [`Error::Io`](crate::Error::Io).
pub fn write_mesh(path: impl AsRef<Path>, mesh: &Mesh) -> Result<()> {
    write_mesh_with_attributes(path, mesh, &VertexAttributes::default())
}

/// Writes a mesh with colours (OBJ, OFF, PLY, GLB) and numbers (PLY, GLB) at its vertices.
///
/// # Errors
/// As [`write_mesh`], and [`Error::Length`](crate::Error::Length) or [`Error::OutOfRange`](crate::Error::OutOfRange) for attributes that do not fit
/// the mesh or that the format cannot hold.
pub fn write_mesh_with_attributes(
    path: impl AsRef<Path>,
    mesh: &Mesh,
    attributes: &VertexAttributes<'_>,
) -> Result<()> {
    let path = path.as_ref();
    let format = MeshFormat::from_path(path);
    let Some((format, writer)) = format.and_then(|f| Some((f, f.row().writer.as_ref()?))) else {
        return Err(refused("mesh format", &MeshFormat::writable_names(), path.display()));
    };
    attributes.check(mesh)?;
    if (!attributes.scalars.is_empty() && !writer.holds_scalars)
        || (attributes.colors.is_some() && !writer.holds_colors)
    {
        return Err(refused("vertex attributes", "what the format can hold", format));
    }
    if writer.is_single_precision {
        check_single_precision(mesh)?;
    }
    refuse_input(path)?;
    write_atomically(path, |out| (writer.write)(out, mesh, attributes))
}

/// Writes a GLB whose mesh stands in a node of the scene: viewers show it turned, and its coordinates in
/// the file are those of the mesh.
///
/// # Errors
/// As [`write_mesh_with_attributes`].
pub fn write_mesh_in_node(
    path: impl AsRef<Path>,
    mesh: &Mesh,
    attributes: &VertexAttributes<'_>,
    node: &GlbNode<'_>,
) -> Result<()> {
    let path = path.as_ref();
    attributes.check(mesh)?;
    check_single_precision(mesh)?;
    refuse_input(path)?;
    write_atomically(path, |out| write_node(out, mesh, attributes, Some(node)))
}

/// Refuses coordinates beyond the largest number of 32 bits.
fn check_single_precision(mesh: &Mesh) -> Result<()> {
    let mut coordinates = mesh.vertices().iter().flat_map(|p| p.to_array());
    match coordinates.find(|x| x.abs() > f64::from(f32::MAX)) {
        Some(x) => Err(refused("coordinate", "at most 3.4e38 in this format", x)),
        None => Ok(()),
    }
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
            let attributes = VertexAttributes { colors: Some(&COLORS), ..Default::default() };
            write_mesh_with_attributes(&path, &pyramid(), &attributes).unwrap();
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
        let attributes =
            VertexAttributes { colors: Some(&COLORS), scalars: &[("weight", &weight)] };
        let glb = folder.path().join("a.glb");
        write_mesh_with_attributes(&glb, &pyramid(), &attributes).unwrap();
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
    fn a_node_turns_the_mesh_for_readers_of_scenes() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.glb");
        // z becomes y, y becomes −z.
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let node = GlbNode { name: "scene_from_mesh", rotation: [-half, 0.0, 0.0, half] };
        write_mesh_in_node(&path, &pyramid(), &VertexAttributes::default(), &node).unwrap();
        let found = read_mesh(&path).unwrap().mesh;
        assert_eq!(found.faces(), pyramid().faces());
        for (found, p) in found.vertices().iter().zip(pyramid().vertices()) {
            assert!((*found - DVec3::new(p.x, p.z, -p.y)).length() < 1e-3 * p.length().max(1.0));
        }
    }

    #[test]
    fn attributes_that_do_not_fit_are_refused_and_nothing_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let refused = |name: &str, attributes: &VertexAttributes<'_>| {
            let path = folder.path().join(name);
            write_mesh_with_attributes(&path, &pyramid(), attributes).is_err() && !path.exists()
        };
        assert!(refused(
            "a.ply",
            &VertexAttributes { colors: Some(&COLORS[1..]), ..Default::default() }
        ));
        assert!(refused(
            "a.stl",
            &VertexAttributes { colors: Some(&COLORS), ..Default::default() }
        ));
        assert!(refused(
            "a.obj",
            &VertexAttributes { scalars: &[("weight", &[0.0; 4])], ..Default::default() }
        ));
        assert!(refused(
            "a.ply",
            &VertexAttributes { scalars: &[("a b", &[0.0; 4])], ..Default::default() }
        ));
        assert!(refused("a.gltf", &VertexAttributes::default()));
        assert!(refused("none", &VertexAttributes::default()));
    }
}
