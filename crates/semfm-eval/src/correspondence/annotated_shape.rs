//! A shape of a set: mesh, eigenbasis and true correspondences.

use std::path::Path;

use semfm::Task;
use semfm::geom::math::DVec3;
use semfm::geom::{Eigenbasis, Mesh, Shape, ShapeCache, ShapeSettings};
use semfm::observe::NumpyArchive;

use crate::{Error, Result};

/// Eigenpairs: the most that a method needs.
pub(super) const K: usize = 200;

/// A file of a set as it was read: a mesh with its vertices at the samples of a template.
#[derive(Clone, Debug)]
pub struct AnnotatedMesh {
    /// The mesh: `V` and `F`.
    pub mesh: Mesh,
    /// Vertex at each sample: `gt`.
    pub truth: Vec<u32>,
    /// Vertex at the mirror image of each sample, where the set has it: `gt_sym`.
    pub mirrored: Option<Vec<u32>>,
}

impl AnnotatedMesh {
    /// Reads `NAME.npz`.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] with the array at fault.
    pub fn read(path: &Path) -> Result<Self> {
        let archive = NumpyArchive::read(path)?;
        let mesh = mesh(path, &archive)?;
        let n = mesh.n_vertices();
        let truth = ids(path, &archive, "gt", n)?
            .ok_or_else(|| Error::format(path, "gt", "a vertex for each sample", "nothing"))?;
        let mirrored = ids(path, &archive, "gt_sym", n)?;
        if let Some(other) = mirrored.as_ref().filter(|other| other.len() != truth.len()) {
            let expected = format!("{} ids, as in gt", truth.len());
            return Err(Error::format(path, "gt_sym", expected, other.len().to_string()));
        }
        Ok(Self { mesh, truth, mirrored })
    }
}

/// A shape with its vertices at the samples of a template.
pub(super) struct AnnotatedShape {
    pub shape: Shape,
    /// Vertex at each sample.
    pub truth: Vec<u32>,
    /// Vertex at the mirror image of each sample, where the set has it.
    pub mirrored: Option<Vec<u32>>,
}

impl AnnotatedShape {
    /// Reads and prepares a shape; no vertex is simplified away.
    pub fn read(path: &Path, cache: &ShapeCache, task: &Task) -> Result<Self> {
        let AnnotatedMesh { mesh, truth, mirrored } = AnnotatedMesh::read(path)?;
        let settings = ShapeSettings { k: K, working_vertices: 0, ..ShapeSettings::default() };
        Ok(Self { shape: cache.shape(mesh, &settings, task)?.shape, truth, mirrored })
    }

    /// The eigenbasis of the working mesh.
    pub fn basis(&self) -> &Eigenbasis {
        self.shape.basis()
    }

    /// Working vertex of a vertex as read.
    pub fn working(&self, vertex: u32) -> u32 {
        self.shape.working().of_original[vertex as usize]
    }

    /// Where the samples are.
    pub fn sample_points(&self) -> Vec<DVec3> {
        let vertices = self.shape.original().vertices();
        self.truth.iter().map(|&vertex| vertices[vertex as usize]).collect()
    }
}

fn mesh(path: &Path, archive: &NumpyArchive<'_>) -> Result<Mesh> {
    let vertices = rows(path, archive, "V")?.into_iter().map(DVec3::from_array).collect();
    let faces = rows(path, archive, "F")?.into_iter().map(|face| face.map(vertex_id)).collect();
    Mesh::new(vertices, faces)
        .map_err(|error| Error::format(path, "V and F", "a triangle mesh", error.to_string()))
}

/// An array (n × 3).
fn rows(path: &Path, archive: &NumpyArchive<'_>, name: &str) -> Result<Vec<[f64; 3]>> {
    let expected = "an array of three columns";
    match archive.array(name)? {
        Some(array) if array.shape.len() == 2 && array.shape[1] == 3 => {
            Ok(array.into_f64().as_chunks::<3>().0.to_vec())
        }
        Some(array) => Err(Error::format(path, name, expected, format!("shape {:?}", array.shape))),
        None => Err(Error::format(path, name, expected, "nothing")),
    }
}

/// A number as a vertex; one that no mesh has where it cannot be one, so that the mesh refuses it.
fn vertex_id(x: f64) -> u32 {
    if x >= 0.0 && x <= f64::from(u32::MAX) { x as u32 } else { u32::MAX }
}

fn ids(path: &Path, archive: &NumpyArchive<'_>, name: &str, n: usize) -> Result<Option<Vec<u32>>> {
    let Some(array) = archive.array(name)? else { return Ok(None) };
    let values = array.into_f64();
    if let Some(at) = values.iter().position(|&x| !(x >= 0.0 && x < n as f64)) {
        let (expected, found) = (format!("ids below {n}"), values[at].to_string());
        return Err(Error::format(path, format!("{name}[{at}]"), expected, found));
    }
    Ok(Some(values.into_iter().map(|x| x as u32).collect()))
}
