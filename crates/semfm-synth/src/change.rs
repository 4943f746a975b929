//! Changed copies of an object: what the same thing looks like to another camera, program or scanner.
//!
//! A region of an object is known on each of its copies, so that a transfer onto a copy can be judged without labels.

use semfm_geom::math::{DMat3, DVec3};
use semfm_geom::{CleanSettings, Mesh, SimplifySettings, Task, WorkingMesh};

use crate::Result;
use crate::seed::{Draw, stream};

/// Share of the triangles that [`Change::FacesDropped`] takes away.
const DROPPED: f64 = 0.1;
/// Standard deviation of [`Change::Noisy`] along each axis, as a share of the diagonal.
const NOISE: f64 = 0.01;

/// How a copy differs from its object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// Not at all.
    Identity,
    /// Turned about all three axes and moved.
    Turned,
    /// In other units.
    Rescaled,
    /// Mirrored, with its triangles turned over so that they still face outwards.
    Mirrored,
    /// Half of the vertices.
    Decimated,
    /// As many vertices at other places of the same surface.
    Remeshed,
    /// A tenth of the triangles is missing.
    FacesDropped,
    /// Each vertex is off by 1 % of the diagonal.
    Noisy,
}

/// A changed copy of an object.
#[derive(Clone, Debug)]
pub struct ChangedCopy {
    /// Its mesh.
    pub mesh: Mesh,
    /// Whether each of its vertices (n) lies in the object's region; a vertex in the middle of an edge does where
    /// either end of the edge does.
    pub region: Vec<bool>,
}

impl Change {
    /// All changes.
    pub const ALL: [Self; 8] = [
        Self::Identity,
        Self::Turned,
        Self::Rescaled,
        Self::Mirrored,
        Self::Decimated,
        Self::Remeshed,
        Self::FacesDropped,
        Self::Noisy,
    ];

    /// The name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Identity => "identity",
            Self::Turned => "turned",
            Self::Rescaled => "rescaled",
            Self::Mirrored => "mirrored",
            Self::Decimated => "decimated",
            Self::Remeshed => "remeshed",
            Self::FacesDropped => "faces dropped",
            Self::Noisy => "noisy",
        }
    }

    /// A copy of `mesh` with this change; `region` says of each of its vertices (n) whether it lies in the region.
    ///
    /// The same seed gives the same copy.
    ///
    /// # Errors
    /// [`Error::Geom`](crate::Error::Geom) for a mesh without area.
    ///
    /// # Panics
    /// Where `region` is not of `mesh`.
    pub fn copy(self, mesh: &Mesh, region: &[bool], seed: u64) -> Result<ChangedCopy> {
        assert_eq!(region.len(), mesh.n_vertices(), "one value per vertex");
        let mut draw = stream(&["change", self.name(), &seed.to_string()]);
        let (vertices, faces) = (mesh.vertices().iter(), mesh.faces());
        let same = |vertices: Vec<DVec3>, faces: Vec<[u32; 3]>| -> Result<ChangedCopy> {
            Ok(ChangedCopy::new(Mesh::new(vertices, faces)?, region))
        };
        match self {
            Self::Identity => Ok(ChangedCopy::new(mesh.clone(), region)),
            Self::Turned => {
                let turn = DMat3::from_rotation_x(0.7)
                    * DMat3::from_rotation_y(-0.5)
                    * DMat3::from_rotation_z(1.1);
                let shift = DVec3::new(0.3, -0.2, 0.5) * mesh.diagonal();
                same(vertices.map(|&p| turn * p + shift).collect(), faces.to_vec())
            }
            Self::Rescaled => same(vertices.map(|&p| 3.7 * p).collect(), faces.to_vec()),
            Self::Mirrored => {
                let turned_over = faces.iter().map(|&[a, b, c]| [a, c, b]);
                same(vertices.map(|&p| p.with_x(-p.x)).collect(), turned_over.collect())
            }
            Self::Decimated => simplified(mesh, region, mesh.n_vertices() / 2),
            Self::Remeshed => {
                let finer = with_middles(mesh, region)?;
                simplified(&finer.mesh, &finer.region, mesh.n_vertices())
            }
            Self::FacesDropped => {
                let kept = faces.iter().copied().filter(|_| draw.between(0.0, 1.0) >= DROPPED);
                same(mesh.vertices().to_vec(), kept.collect())
            }
            Self::Noisy => {
                let sigma = NOISE * mesh.diagonal();
                same(vertices.map(|&p| p + sigma * off(&mut draw)).collect(), faces.to_vec())
            }
        }
    }
}

impl ChangedCopy {
    fn new(mesh: Mesh, region: &[bool]) -> Self {
        Self { mesh, region: region.to_vec() }
    }
}

/// Three standard normal numbers.
fn off(draw: &mut Draw) -> DVec3 {
    DVec3::new(draw.normal(), draw.normal(), draw.normal())
}

/// The mesh with some of its vertices.
fn simplified(mesh: &Mesh, region: &[bool], n_vertices: usize) -> Result<ChangedCopy> {
    let most = SimplifySettings { target_vertices: n_vertices, most_distance: f64::INFINITY };
    let working =
        WorkingMesh::prepare(mesh, &CleanSettings::default(), &most, &Task::default())?.working;
    let region = working.to_original.iter().map(|&v| region[v as usize]).collect();
    Ok(ChangedCopy { mesh: working.mesh, region })
}

/// The mesh with each triangle cut into four at the middles of its edges.
fn with_middles(mesh: &Mesh, region: &[bool]) -> Result<ChangedCopy> {
    let edges = semfm_geom::connectivity::edges(mesh); // sorted
    let mut vertices = mesh.vertices().to_vec();
    let mut inside = region.to_vec();
    for &[a, b] in &edges {
        let (a, b) = (a as usize, b as usize);
        vertices.push((mesh.vertices()[a] + mesh.vertices()[b]) / 2.0);
        inside.push(region[a] || region[b]);
    }
    let middle = |a: u32, b: u32| {
        let edge = [a.min(b), a.max(b)];
        let at = edges.binary_search(&edge).expect("a side of a triangle that has three");
        (mesh.n_vertices() + at) as u32
    };
    let triangles = mesh.faces().iter().filter(|[a, b, c]| a != b && b != c && c != a);
    let cut = triangles.flat_map(|&[a, b, c]| {
        let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
        [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
    });
    Ok(ChangedCopy { mesh: Mesh::new(vertices, cut.collect())?, region: inside })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Category, ObjectSettings, make_object};

    #[test]
    fn copies_keep_the_shape_and_share_of_the_region() {
        let object = make_object(Category::Containers, 0, &ObjectSettings::default()).unwrap();
        let share = |mesh: &Mesh, region: &[bool]| {
            let areas = mesh.vertex_areas();
            let inside = areas.iter().zip(region).filter(|(_, inside)| **inside);
            inside.map(|(area, _)| area).sum::<f64>() / areas.iter().sum::<f64>()
        };
        let before = share(&object.mesh, &object.region);
        for change in Change::ALL {
            let copy = change.copy(&object.mesh, &object.region, 0).unwrap();
            assert_eq!(copy.region.len(), copy.mesh.n_vertices(), "{}", change.name());
            let after = share(&copy.mesh, &copy.region);
            assert!((after / before - 1.0).abs() < 0.15, "{}: {before} {after}", change.name());
            let again = change.copy(&object.mesh, &object.region, 0).unwrap();
            assert_eq!(copy.mesh.hash(), again.mesh.hash(), "{}", change.name());
        }
    }
}
