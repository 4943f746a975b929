//! Distances along the surface by the heat method
//! (Crane, Weischedel & Wardetzky 2013, "Geodesics in Heat").

use faer::sparse::SparseColMat;
use faer::{Mat, MatRef};

use crate::cholesky::SparseCholesky;
use crate::connectivity::Components;
use crate::laplacian::{
    LaplacianKind, PlanarTriangle, TuftedSettings, components, laplacian_and_triangles,
};
use crate::{Error, Mesh, Result, Welded, without_repeated_faces};

/// How geodesic distances are computed.
#[derive(Clone, Debug, PartialEq)]
pub struct HeatSettings {
    /// Which Laplacian, gradient and divergence: on the tufted cover, which holds on any mesh, or
    /// on the triangles as they are.
    pub kind: LaplacianKind,
    /// Diffusion time in squared mean edge lengths. 1 is the authors' choice; larger is smoother
    /// and less exact.
    pub time: f64,
}

impl Default for HeatSettings {
    fn default() -> Self {
        Self { kind: LaplacianKind::Tufted, time: 1.0 }
    }
}

/// Right-hand sides solved together. Measured gain per source: 1.05 (23 k vertices) to 1.2 (5 k); the
/// block mainly bounds the memory.
const BLOCK: usize = 16;

/// Geodesic distances on one mesh: two matrices are factorised once, then every set of sources
/// costs two triangular solves.
///
/// Distances are those of the surface: vertices at one place (a UV seam, flat shading, a soup) are one point of it
/// ([`Welded`]) and have one distance.
///
/// ```
/// use semfm_geom::{Mesh, geodesic::HeatGeodesics, math::DVec3};
/// let corners = vec![DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y];
/// let square = Mesh::new(corners, vec![[0, 1, 2], [0, 2, 3]])?;
/// let distances = HeatGeodesics::new(&square, &Default::default())?.distances(&[0])?;
/// assert_eq!(distances[0], 0.0);
/// assert!(distances[2] > distances[1]);
/// # Ok::<(), semfm_geom::Error>(())
/// ```
#[derive(Debug)]
pub struct HeatGeodesics {
    /// M + t S, of the heat flow.
    heat: SparseCholesky,
    /// S, grounded at one vertex of each component.
    poisson: SparseCholesky,
    triangles: Vec<PlanarTriangle>,
    /// For each vertex of the mesh (n), its place on the surface.
    place_of_vertex: Vec<u32>,
    /// Connected piece of each place (n_places).
    components: Vec<u32>,
}

impl HeatGeodesics {
    /// Builds and factorises the two systems.
    ///
    /// # Errors
    /// [`Error::NoArea`] as for the Laplacian, [`Error::OutOfRange`] for a time that is not
    /// positive, [`Error::NotPositiveDefinite`] where rounding spoils a plain cotangent Laplacian
    /// with extreme slivers.
    pub fn new(mesh: &Mesh, settings: &HeatSettings) -> Result<Self> {
        if !(settings.time > 0.0 && settings.time.is_finite()) {
            let (what, expected) =
                ("heat method time", "a positive number of squared mean edges".into());
            return Err(Error::OutOfRange { what, expected, found: settings.time.to_string() });
        }
        let Welded { mesh: welded, of_original: place_of_vertex, .. } = Welded::new(mesh);
        // Layers upon layers of one triangle change no distance.
        let surface = without_repeated_faces(&welded).unwrap_or(welded);
        let (laplacian, triangles) =
            laplacian_and_triangles(&surface, settings.kind, &TuftedSettings::default())?;
        let Components { of_vertex: components, count: n_components } =
            components(laplacian.n_vertices(), &laplacian.stiffness);
        let time = settings.time * mean_edge(&triangles).powi(2);

        let heat = combine(&laplacian.stiffness, time, |i, _| laplacian.mass[i]);
        // S is singular, one constant per component. Raising the diagonal at one vertex of each
        // leaves the answer as it is: a right-hand side that sums to zero over the component makes
        // the function zero there.
        let mut grounded = vec![false; n_components];
        let poisson = combine(&laplacian.stiffness, 1.0, |i, diagonal| {
            if std::mem::replace(&mut grounded[components[i] as usize], true) {
                0.0
            } else if diagonal > 0.0 {
                diagonal
            } else {
                1.0
            }
        });
        Ok(Self {
            heat: SparseCholesky::new(heat.as_ref())?,
            poisson: SparseCholesky::new(poisson.as_ref())?,
            triangles,
            place_of_vertex,
            components,
        })
    }

    /// Number of vertices n.
    pub fn n_vertices(&self) -> usize {
        self.place_of_vertex.len()
    }

    /// Distance of every vertex (n) from the nearest of `sources`, in the units of the mesh;
    /// +∞ on components without a source.
    ///
    /// One source is good to about an edge length. Several far apart share one function, whose
    /// values at the sources differ by a few per cent of the distance between them; where that
    /// matters, take the minimum over [`distances_from_each`](Self::distances_from_each).
    ///
    /// # Errors
    /// [`Error::Length`] for no sources, [`Error::OutOfRange`] for an id beyond the vertices.
    pub fn distances(&self, sources: &[u32]) -> Result<Vec<f64>> {
        let distances = self.solve(&[sources])?;
        Ok(self.place_of_vertex.iter().map(|&place| distances[(place as usize, 0)]).collect())
    }

    /// Distances (n × s) from each of s sources alone, one column each: a little faster
    /// than asking one by one.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for an id beyond the vertices.
    pub fn distances_from_each(&self, sources: &[u32]) -> Result<Mat<f64>> {
        let mut all = Mat::zeros(self.n_vertices(), sources.len());
        for (block, ids) in sources.chunks(BLOCK).enumerate() {
            let sets: Vec<&[u32]> = ids.chunks(1).collect();
            let columns = self.solve(&sets)?;
            let mut block = all.as_mut().subcols_mut(block * BLOCK, ids.len());
            for (i, &place) in self.place_of_vertex.iter().enumerate() {
                block.as_mut().row_mut(i).copy_from(columns.row(place as usize));
            }
        }
        Ok(all)
    }

    /// Distances (n_places × number of sets) from each set of sources.
    fn solve(&self, sets: &[&[u32]]) -> Result<Mat<f64>> {
        let n = self.n_vertices();
        for (what, id) in sets.iter().flat_map(|set| set.iter().map(|&id| ("source vertex", id))) {
            if id as usize >= n {
                let expected = format!("an id below {n}");
                return Err(Error::OutOfRange { what, expected, found: id.to_string() });
            }
        }
        if sets.iter().any(|set| set.is_empty()) {
            return Err(Error::Length { what: "source vertices", expected: 1, found: 0 });
        }
        // Doubled vertices among the sources are one source.
        let places: Vec<Vec<u32>> = sets.iter().map(|set| self.places(set)).collect();
        // (M + t S) u = δ: heat after a short time.
        let mut u = Mat::zeros(self.components.len(), sets.len());
        for (j, set) in places.iter().enumerate() {
            set.iter().for_each(|&id| u[(id as usize, j)] = 1.0);
        }
        self.heat.solve_in_place(u.as_mut());
        // S φ = −∇ · X with X = −∇u / |∇u|: the function whose gradient runs away from the heat.
        let mut phi = self.negative_divergence(u.as_ref());
        self.poisson.solve_in_place(phi.as_mut());
        for (j, set) in places.iter().enumerate() {
            self.anchor(phi.col_as_slice_mut(j), set);
        }
        Ok(phi)
    }

    /// The places of some vertices, ascending, each once.
    fn places(&self, vertices: &[u32]) -> Vec<u32> {
        let mut places: Vec<u32> =
            vertices.iter().map(|&id| self.place_of_vertex[id as usize]).collect();
        places.sort_unstable();
        places.dedup();
        places
    }

    /// Integrated −∇ · X around each vertex (Crane et al. 2013), X = −∇u / |∇u|.
    fn negative_divergence(&self, u: MatRef<'_, f64>) -> Mat<f64> {
        let mut sum = Mat::zeros(u.nrows(), u.ncols());
        for j in 0..u.ncols() {
            for triangle in &self.triangles {
                let ids = triangle.ids.map(|id| id as usize);
                let flux = triangle.unit_descent_flux(ids.map(|i| u[(i, j)]));
                ids.iter().zip(flux).for_each(|(&i, f)| sum[(i, j)] += f);
            }
        }
        sum
    }

    /// Shifts each component so that its sources have mean zero; +∞ where there is none.
    fn anchor(&self, phi: &mut [f64], sources: &[u32]) {
        let n_components = self.components.iter().max().map_or(0, |&c| c as usize + 1);
        let mut at_sources = vec![(0.0, 0.0); n_components];
        for &id in sources {
            let (sum, count) = &mut at_sources[self.components[id as usize] as usize];
            *sum += phi[id as usize];
            *count += 1.0;
        }
        for (value, &component) in phi.iter_mut().zip(&self.components) {
            let (sum, count) = at_sources[component as usize];
            *value = if count > 0.0 { (*value - sum / count).max(0.0) } else { f64::INFINITY };
        }
        sources.iter().for_each(|&id| phi[id as usize] = 0.0);
    }
}

/// `factor` · S plus a diagonal, given by vertex and old diagonal entry.
fn combine(
    stiffness: &SparseColMat<usize, f64>,
    factor: f64,
    mut diagonal: impl FnMut(usize, f64) -> f64,
) -> SparseColMat<usize, f64> {
    let mut sum = stiffness.clone();
    for column in 0..sum.ncols() {
        let range = sum.symbolic().col_range(column);
        for at in range {
            let row = sum.symbolic().row_idx()[at];
            let value = &mut sum.val_mut()[at];
            *value = factor * *value + if row == column { diagonal(column, *value) } else { 0.0 };
        }
    }
    sum
}

/// Mean edge length, each edge counted once per triangle.
fn mean_edge(triangles: &[PlanarTriangle]) -> f64 {
    let total: f64 = triangles.iter().map(PlanarTriangle::perimeter).sum();
    total / (3 * triangles.len()) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::DVec3;
    use crate::zoo;

    #[test]
    fn on_a_sphere_distance_is_the_angle() {
        let sphere = zoo::icosphere(4);
        for kind in [LaplacianKind::Tufted, LaplacianKind::Cotan] {
            let settings = HeatSettings { kind, ..Default::default() };
            let distances =
                HeatGeodesics::new(&sphere, &settings).unwrap().distances(&[7]).unwrap();
            let from = sphere.vertices()[7];
            let worst = sphere
                .vertices()
                .iter()
                .zip(&distances)
                .map(|(p, d)| (p.dot(from).clamp(-1.0, 1.0).acos() - d).abs());
            // An edge is 0.07 long; the heat method rounds off the far pole.
            let worst = worst.fold(0.0, f64::max);
            assert!(worst < 0.07, "{kind:?}: off by {worst}");
        }
    }

    #[test]
    fn every_animal_has_finite_distances_where_a_path_exists_and_none_elsewhere() {
        for (name, mesh) in zoo::all() {
            let geodesics = HeatGeodesics::new(&mesh, &HeatSettings::default()).unwrap();
            let source = mesh.faces()[0][0];
            let distances = geodesics.distances(&[source]).unwrap();
            assert_eq!(distances[source as usize], 0.0, "{name}");
            for (i, d) in distances.iter().enumerate() {
                let [here, there] = [i, source as usize]
                    .map(|v| geodesics.components[geodesics.place_of_vertex[v] as usize]);
                let joined = here == there;
                assert_eq!(d.is_finite(), joined, "{name}: vertex {i} at {d}");
                assert!(
                    *d >= 0.0 && (!joined || *d < 4.0 * mesh.diagonal()),
                    "{name}: vertex {i} at {d}"
                );
            }
        }
    }

    #[test]
    fn many_sources_are_the_nearest_of_each_and_blocks_change_nothing() {
        let torus = zoo::torus(40, 20);
        let geodesics = HeatGeodesics::new(&torus, &HeatSettings::default()).unwrap();
        let sources: Vec<u32> = (0..20).map(|i| 37 * i).collect();
        let each = geodesics.distances_from_each(&sources).unwrap();
        for (j, &source) in sources.iter().enumerate() {
            let alone = geodesics.distances(&[source]).unwrap();
            let worst = (0..torus.n_vertices())
                .map(|i| (alone[i] - each[(i, j)]).abs())
                .fold(0.0, f64::max);
            assert!(worst < 1e-10, "source {source}: {worst:.1e}");
        }
        let together = geodesics.distances(&[sources[0], sources[11]]).unwrap();
        for (i, d) in together.iter().enumerate() {
            let nearest = each[(i, 0)].min(each[(i, 11)]);
            // The longest edge here is 0.25; one function for both sources is good to about that.
            assert!((d - nearest).abs() < 0.25, "vertex {i}: {d} together, {nearest} apart");
        }
    }

    #[test]
    fn a_soup_has_the_distances_of_the_mesh_it_was_cut_from() {
        for mesh in [zoo::icosphere(3), zoo::open_grid(12, 9)] {
            let soup = zoo::as_soup(&mesh);
            let whole = HeatGeodesics::new(&mesh, &Default::default()).unwrap();
            let cut = HeatGeodesics::new(&soup, &Default::default()).unwrap();
            // Corners 0 and 1 of triangle 17, which also belong to its neighbours.
            let there = [mesh.faces()[17][0], mesh.faces()[17][1]];
            let (a, b) = (whole.distances(&there).unwrap(), cut.distances(&[51, 52]).unwrap());
            let each = cut.distances_from_each(&[51]).unwrap();
            let alone = whole.distances(&there[..1]).unwrap();
            for (corner, &id) in mesh.faces().as_flattened().iter().enumerate() {
                // The systems are the same up to the order of unknowns.
                assert!((a[id as usize] - b[corner]).abs() < 1e-9, "corner {corner}");
                assert!((alone[id as usize] - each[(corner, 0)]).abs() < 1e-9, "corner {corner}");
            }
            assert_eq!(cut.n_vertices(), soup.n_vertices());
        }
    }

    #[test]
    fn bad_sources_are_named() {
        let geodesics = HeatGeodesics::new(&zoo::tetrahedron(), &HeatSettings::default()).unwrap();
        assert!(matches!(geodesics.distances(&[]), Err(Error::Length { found: 0, .. })));
        assert!(matches!(geodesics.distances(&[4]), Err(Error::OutOfRange { .. })));
        let spot = Mesh::new(vec![DVec3::ONE; 3], vec![[0, 1, 2]]).unwrap();
        assert!(matches!(
            HeatGeodesics::new(&spot, &HeatSettings::default()),
            Err(Error::NoArea { .. })
        ));
    }
}
