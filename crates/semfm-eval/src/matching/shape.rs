//! A shape of a matching set: mesh, eigenbasis and true correspondences.

use std::path::Path;

use semfm::Task;
use semfm::geom::math::DVec3;
use semfm::geom::{Mesh, Shape, ShapeCache, ShapeSettings};

use super::npz::Archive;
use crate::{Error, Result};

/// Eigenpairs: the most that a method asks for.
pub(crate) const K: usize = 200;

/// A shape with its vertices at the samples of a template.
pub(crate) struct MatchingShape {
    pub shape: Shape,
    /// Vertex at each sample.
    pub truth: Vec<u32>,
    /// Vertex at the mirror image of each sample, where the set has it.
    pub mirrored: Option<Vec<u32>>,
}

impl MatchingShape {
    /// Reads and prepares a shape; no vertex is simplified away.
    pub fn read(path: &Path, cache: &ShapeCache, task: &Task) -> Result<Self> {
        let archive = Archive::read(path)?;
        let mesh = mesh(path, &archive)?;
        let n = mesh.n_vertices();
        let truth = ids(path, &archive, "gt", n)?
            .ok_or_else(|| Error::format(path, "gt", "a vertex for each sample", "nothing"))?;
        let mirrored = ids(path, &archive, "gt_sym", n)?;
        if let Some(other) = mirrored.as_ref().filter(|other| other.len() != truth.len()) {
            let expected = format!("{} ids, as in gt", truth.len());
            return Err(Error::format(path, "gt_sym", expected, other.len().to_string()));
        }
        let settings = ShapeSettings { k: K, working_vertices: 0, ..ShapeSettings::default() };
        Ok(Self { shape: cache.shape(mesh, &settings, task)?.shape, truth, mirrored })
    }

    /// Working vertex of an original one.
    pub fn working(&self, vertex: u32) -> u32 {
        self.shape.working().of_original[vertex as usize]
    }
}

fn mesh(path: &Path, archive: &Archive<'_>) -> Result<Mesh> {
    let rows = |name: &str| -> Result<Vec<[f64; 3]>> {
        let expected = "an array of three columns";
        match archive.array(name)? {
            Some((values, shape)) if shape.len() == 2 && shape[1] == 3 => {
                Ok(values.as_chunks::<3>().0.to_vec())
            }
            Some((_, shape)) => Err(Error::format(path, name, expected, format!("{shape:?}"))),
            None => Err(Error::format(path, name, expected, "nothing")),
        }
    };
    let vertices: Vec<DVec3> = rows("V")?.into_iter().map(DVec3::from_array).collect();
    let id = |x: f64| if x >= 0.0 && x <= f64::from(u32::MAX) { x as u32 } else { u32::MAX };
    let faces = rows("F")?.into_iter().map(|face| face.map(id)).collect();
    Mesh::new(vertices, faces)
        .map_err(|error| Error::format(path, "V and F", "a triangle mesh", error.to_string()))
}

fn ids(path: &Path, archive: &Archive<'_>, name: &str, n: usize) -> Result<Option<Vec<u32>>> {
    let Some((values, _)) = archive.array(name)? else { return Ok(None) };
    if let Some(at) = values.iter().position(|&x| !(x >= 0.0 && x < n as f64)) {
        let expected = format!("ids below {n}");
        return Err(Error::format(path, format!("{name}[{at}]"), expected, values[at].to_string()));
    }
    Ok(Some(values.into_iter().map(|x| x as u32).collect()))
}
