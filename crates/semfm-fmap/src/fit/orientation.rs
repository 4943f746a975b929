//! Maps that keep left on the left: commutation with turned gradients.
//!
//! Ren, Poulenard, Wonka & Ovsjanikov, "Continuous and orientation-preserving correspondences via
//! functional maps", 2018, section 4.1. A descriptor f gives each shape the operator
//! φ ↦ ⟨∇f × ∇φ, n⟩, which changes its sign when the surface is mirrored, while descriptors made of
//! the spectrum do not change at all. A map that commutes with it keeps the side; one that commutes
//! with its negative on one shape swaps the sides.
//!
//! Where theirs averages over the faces around a vertex, ours is a form: its entries
//! ∫ φᵢ ⟨∇f × ∇φⱼ, n⟩ = ∫ φᵢ df ∧ dφⱼ are, on a closed surface, also ∫ f dφⱼ ∧ dφᵢ (Stokes; to the last
//! bit with linear elements), and that is how they are computed. It needs no lengths but only the
//! winding of the triangles, and stays antisymmetric on surfaces with a boundary.

use faer::{Mat, MatRef};
use semfm_geom::{Eigenbasis, Mesh};

use super::operators::{Operators, Parity, Terms};
use crate::{Error, Result};

/// Triangles that may be left out because their neighbours do not agree with them, as a share of all.
/// Where welding and cleaning keep one of two triangles that lie on each other, a single edge
/// disagrees (4 of 15 animals of SMAL_r); a Möbius strip or a piece that was turned over disagrees along a whole curve.
const MOST_LEFT_OUT: f64 = 1e-3;

/// Triangles with two sides: at every edge those that run through it one way and those
/// that run through it the other way differ by one at most.
///
/// That allows a boundary, and sheets that were welded to each other along an edge, but no Möbius
/// strip and no piece turned over. It does not say which side is out; pieces without a common
/// edge may be wound differently, and then a map that preserves orientation on one of them reverses
/// it on another.
#[derive(Clone, Debug)]
pub struct OrientedSurface {
    n_vertices: usize,
    faces: Vec<[u32; 3]>,
    left_out: usize,
    outward: Option<bool>,
}

impl OrientedSurface {
    /// Checks the winding. Triangles around an edge that disagree are left out where they are no
    /// more than one in a thousand.
    ///
    /// # Errors
    /// [`Error::NotOriented`] where more of them disagree.
    pub fn new(mesh: &Mesh) -> Result<Self> {
        let mut sides: Vec<(u64, u32)> = Vec::with_capacity(3 * mesh.n_faces());
        for (face, &[a, b, c]) in (0..).zip(mesh.faces()) {
            // A triangle that names a vertex twice covers nothing.
            if a != b && b != c && c != a {
                sides.extend([[a, b], [b, c], [c, a]].map(|ends| (directed_edge(ends), face)));
            }
        }
        sides.sort_unstable();
        let (mut closed, mut first, mut odd) = (true, None, Vec::new());
        for edge in sides.chunk_by(|a, b| a.0 >> 1 == b.0 >> 1) {
            let forward = edge.iter().filter(|side| side.0 & 1 == 1).count();
            let difference = forward.abs_diff(edge.len() - forward);
            closed &= difference == 0;
            if difference > 1 {
                first.get_or_insert([(edge[0].0 >> 33) as u32, (edge[0].0 >> 1) as u32]);
                odd.extend(edge.iter().map(|side| side.1));
            }
        }
        odd.sort_unstable();
        odd.dedup();
        if let Some(edge) =
            first.filter(|_| odd.len() as f64 > MOST_LEFT_OUT * mesh.n_faces() as f64)
        {
            return Err(Error::NotOriented { edge, found: odd.len(), n_faces: mesh.n_faces() });
        }
        let (low, _) = mesh.bounds();
        let volume: f64 = (0..mesh.n_faces())
            .map(|face| {
                // Far from the origin volumes cancel: they are taken from a corner of the box.
                let [a, b, c] = mesh.corners(face).map(|p| p - low);
                a.dot(b.cross(c))
            })
            .sum();
        let kept = (0..).zip(mesh.faces()).filter(|(face, _)| odd.binary_search(face).is_err());
        Ok(Self {
            n_vertices: mesh.n_vertices(),
            faces: kept.map(|(_, &ids)| ids).collect(),
            left_out: odd.len(),
            outward: (closed && volume != 0.0).then_some(volume > 0.0),
        })
    }

    /// Number of vertices.
    pub fn n_vertices(&self) -> usize {
        self.n_vertices
    }

    /// Triangles that were left out because their neighbours do not agree with them.
    pub fn left_out(&self) -> usize {
        self.left_out
    }

    /// Whether the triangles of a closed surface run counterclockwise as seen from outside, by the
    /// sign of its volume; nothing for one with a boundary.
    pub fn outward(&self) -> Option<bool> {
        self.outward
    }

    /// Refuses a target's surface that is wound the other way.
    pub(super) fn check_winding(&self, target: &Self) -> Result<()> {
        match (self.outward, target.outward) {
            (Some(source), Some(target)) if source != target => Error::out_of_range(
                "winding of the two surfaces",
                "counterclockwise as seen from outside, or clockwise on both",
                "one of each",
            ),
            _ => Ok(()),
        }
    }
}

/// An edge as a number: both ends, the lower first, and the direction in the last bit.
fn directed_edge([from, to]: [u32; 2]) -> u64 {
    (u64::from(from.min(to)) << 33) | (u64::from(from.max(to)) << 1) | u64::from(from < to)
}

/// ∫ f dφⱼ ∧ dφᵢ (k × k) for the functions f with these coefficients (k × r).
pub(super) fn turns(
    coefficients: MatRef<'_, f64>,
    basis: &Eigenbasis,
    surface: &OrientedSurface,
) -> Operators {
    let k = coefficients.nrows();
    let phi = basis.first(k);
    let faces = &surface.faces;
    Operators::new(Parity::Antisymmetric, faces.len(), coefficients, |first, products, f| {
        let places = f.nrows();
        // Of every function, the differences along two sides of each face.
        let (mut u, mut w) = (Mat::<f64>::zeros(places, k), Mat::<f64>::zeros(places, k));
        for j in 0..k {
            let phi = phi.col(j).try_as_col_major().expect("columns of an eigenbasis").as_slice();
            let out = u.col_as_slice_mut(j).iter_mut().zip(w.col_as_slice_mut(j));
            let out = out.zip(f.col_as_slice_mut(j));
            for (corners, ((u, w), f)) in faces[first..first + places].iter().zip(out) {
                let [a, b, c] = corners.map(|v| phi[v as usize]);
                (*u, *w, *f) = (0.5 * (b - a), c - a, (a + b + c) / 3.0);
            }
        }
        let mut columns = products.col_iter_mut();
        for j in 0..k {
            for (i, out) in (0..j).zip(&mut columns) {
                let first = (u.col_as_slice(j), w.col_as_slice(i));
                Terms::difference(out, first, (w.col_as_slice(j), u.col_as_slice(i))).write();
            }
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::descriptors::normalised_coefficients;
    use crate::fit::{FitSettings, FitSide, fit};
    use crate::test_objects::{blob, shape};
    use crate::{FunctionalMap, PointMap};
    use faer::ColRef;
    use semfm_geom::descriptors::{WksSettings, wks};
    use semfm_geom::math::DVec3;
    use semfm_geom::{PointIndex, Task, zoo};

    #[test]
    fn the_form_is_that_of_the_paper_on_a_closed_surface() {
        let shape = shape(&blob(1.0), 7);
        let (mesh, basis) = (shape.mesh(), shape.basis());
        let a = Mat::from_fn(7, 2, |i, d| ((i + 3 * d) as f64).sin());
        let surface = OrientedSurface::new(mesh).unwrap();
        assert_eq!(surface.outward(), Some(true));
        let ours = turns(a.as_ref(), basis, &surface);
        let f = basis.reconstruct_all(a.as_ref());
        for d in 0..2 {
            for i in 0..7 {
                for j in 0..7 {
                    let mut entry = 0.0;
                    let phi = &basis.functions;
                    for (face, ids) in mesh.faces().iter().enumerate() {
                        let n = mesh.face_normal_scaled(face).normalize();
                        let (along_f, along_phi) =
                            (gradient(mesh, face, f.col(d)), gradient(mesh, face, phi.col(j)));
                        let mean = ids.iter().map(|&v| phi[(v as usize, i)]).sum::<f64>() / 3.0;
                        entry += mesh.face_area(face) * mean * along_f.cross(along_phi).dot(n);
                    }
                    let found = ours.of(d)[(i, j)];
                    assert!((found - entry).abs() < 1e-10, "{d} {i} {j}: {found} for {entry}");
                }
            }
        }
    }

    /// ∇g on a face, for a function given on the vertices: Σ_c g_c n × (opposite side) / (2 area).
    fn gradient(mesh: &Mesh, face: usize, function: ColRef<'_, f64>) -> DVec3 {
        let (corners, ids) = (mesh.corners(face), mesh.faces()[face]);
        let n = mesh.face_normal_scaled(face).normalize();
        let terms = (0..3).map(|c| {
            let opposite = corners[(c + 2) % 3] - corners[(c + 1) % 3];
            n.cross(opposite) * function[ids[c] as usize] / (2.0 * mesh.face_area(face))
        });
        terms.sum()
    }

    #[test]
    fn a_mirror_changes_the_sign_and_nothing_else() {
        let mesh = zoo::open_grid(9, 7);
        let faces = mesh.faces().iter().map(|&[a, b, c]| [a, c, b]).collect();
        let mirrored = Mesh::new(mesh.vertices().to_vec(), faces).unwrap();
        let basis = shape(&mesh, 8).basis().clone();
        let a = Mat::<f64>::identity(8, 8);
        let [here, there] = [&mesh, &mirrored]
            .map(|mesh| turns(a.as_ref(), &basis, &OrientedSurface::new(mesh).unwrap()));
        assert!(here.square() > 1.0);
        for (o, p) in here.iter().zip(there.iter()) {
            assert!((o + p).norm_max() < 1e-12 && (o + o.transpose()).norm_max() == 0.0);
        }
    }

    #[test]
    fn surfaces_without_two_sides_are_refused_and_named() {
        for (name, mesh) in zoo::all() {
            let report = semfm_geom::connectivity::MeshReport::new(&mesh);
            let found = OrientedSurface::new(&mesh);
            assert!(found.is_ok() || !report.oriented, "{name}");
        }
        let error = OrientedSurface::new(&zoo::moebius(12, 2)).unwrap_err().to_string();
        assert!(error.contains("wound consistently"), "{error}");
        // Two tetrahedra that share an edge: welded, and still of two sides. One face turned: not.
        let points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, -1, 0], [0, 0, -1]];
        let points = points.map(|p| DVec3::from_array(p.map(f64::from)));
        let solids = [[0, 1, 2, 3], [0, 1, 4, 5]]
            .map(|[a, b, c, d]| [[a, c, b], [a, b, d], [b, c, d], [c, a, d]]);
        let mut faces: Vec<[u32; 3]> = solids.concat();
        let welded = Mesh::new(points.to_vec(), faces.clone()).unwrap();
        assert_eq!(OrientedSurface::new(&welded).unwrap().outward(), Some(true));
        let far = points.map(|p| p + DVec3::splat(1e7)).to_vec();
        let far = Mesh::new(far, faces.clone()).unwrap();
        assert_eq!(OrientedSurface::new(&far).unwrap().outward(), Some(true));
        faces[2].swap(0, 1);
        let turned = Mesh::new(points.to_vec(), faces).unwrap();
        assert!(matches!(OrientedSurface::new(&turned), Err(Error::NotOriented { .. })));
        // One turned triangle among many is left out, with its three neighbours.
        let ball = zoo::icosphere(5);
        let mut faces = ball.faces().to_vec();
        faces[77].swap(0, 1);
        let spoiled = Mesh::new(ball.vertices().to_vec(), faces).unwrap();
        assert_eq!(OrientedSurface::new(&spoiled).unwrap().left_out(), 4);
        let ball = zoo::icosphere(1);
        let faces = ball.faces().iter().map(|&[a, b, c]| [a, c, b]).collect();
        let inside_out = Mesh::new(ball.vertices().to_vec(), faces).unwrap();
        let (out, inside) = (OrientedSurface::new(&ball), OrientedSurface::new(&inside_out));
        assert!(out.unwrap().check_winding(&inside.unwrap()).is_err());
    }

    /// A lumpy closed surface that the mirror y → −y maps onto itself, and where each vertex goes.
    fn mirror_symmetric() -> (Mesh, Vec<u32>) {
        let ball = zoo::icosphere(3);
        let vertices: Vec<DVec3> = ball
            .vertices()
            .iter()
            .map(|&p| {
                let lumps = 1.0
                    + 0.25 * (2.0 * p.x + 1.0).sin()
                    + 0.2 * (3.0 * p.y * p.y - p.z).cos()
                    + 0.15 * p.z * p.x;
                DVec3::new(p.x * 1.8, p.y, p.z * 0.8) * lumps
            })
            .collect();
        let index = PointIndex::new(&vertices).unwrap();
        let mut partner = Vec::new();
        for p in &vertices {
            let (v, distance) = index.nearest(p.with_y(-p.y));
            assert!(distance < 1e-9);
            partner.push(v as u32);
        }
        (Mesh::new(vertices.clone(), ball.faces().to_vec()).unwrap(), partner)
    }

    fn signature(basis: &Eigenbasis) -> Mat<f64> {
        let signature = wks(basis, &WksSettings::default()).unwrap();
        normalised_coefficients(basis, signature.as_ref(), basis.k())
    }

    /// A shape with its triangles; its descriptors come later.
    struct Oriented<'a> {
        basis: &'a Eigenbasis,
        surface: &'a OrientedSurface,
    }

    fn by_signatures(
        source: &Oriented<'_>,
        target: &Oriented<'_>,
        reversing: bool,
    ) -> FunctionalMap {
        let (a, b) = (signature(source.basis), signature(target.basis));
        let settings =
            FitSettings { laplacian: 0.01, descriptors: 1.0, orientation: 1.0, reversing };
        let source =
            FitSide { surface: Some(source.surface), ..FitSide::new(source.basis, a.as_ref()) };
        let target =
            FitSide { surface: Some(target.surface), ..FitSide::new(target.basis, b.as_ref()) };
        fit(source, target, &settings, &Task::default()).unwrap().map
    }

    /// ‖C − truth‖ / ‖truth‖ for the map of a vertex permutation.
    fn off(
        map: &FunctionalMap,
        permutation: &[u32],
        source: &Eigenbasis,
        target: &Eigenbasis,
    ) -> f64 {
        let points = PointMap { source_of: permutation.to_vec() };
        let truth = FunctionalMap::from_point_map(&points, source, target, map.k_source()).unwrap();
        (map.matrix() - truth.matrix()).norm_l2() / truth.matrix().norm_l2()
    }

    #[test]
    fn signatures_cannot_tell_left_from_right_but_the_orientation_can() {
        let (mesh, partner) = mirror_symmetric();
        let shape = shape(&mesh, 20);
        let surface = OrientedSurface::new(shape.mesh()).unwrap();
        let side = Oriented { basis: shape.basis(), surface: &surface };
        let identity: Vec<u32> = (0..mesh.n_vertices() as u32).collect();
        let kept = by_signatures(&side, &side, false);
        let swapped = by_signatures(&side, &side, true);
        let found =
            [(&kept, &identity), (&kept, &partner), (&swapped, &partner), (&swapped, &identity)]
                .map(|(map, to)| off(map, to, shape.basis(), shape.basis()));
        assert!(found[0] < 0.3 && found[1] > 0.8, "preserving: {found:?}");
        assert!(found[2] < 0.3 && found[3] > 0.8, "reversing: {found:?}");
    }

    #[test]
    fn a_mirrored_copy_is_reached_by_reversing_alone() {
        let mesh = blob(1.0);
        let mirrored = Mesh::new(
            mesh.vertices().iter().map(|p| DVec3::new(p.x, -p.y, p.z)).collect(),
            mesh.faces().iter().map(|&[a, b, c]| [a, c, b]).collect(),
        )
        .unwrap();
        let (one, other) = (shape(&mesh, 15), shape(&mirrored, 15));
        let surfaces = [&one, &other].map(|shape| OrientedSurface::new(shape.mesh()).unwrap());
        let source = Oriented { basis: one.basis(), surface: &surfaces[0] };
        let target = Oriented { basis: other.basis(), surface: &surfaces[1] };
        let identity: Vec<u32> = (0..mesh.n_vertices() as u32).collect();
        let found = [true, false].map(|reversing| {
            let map = by_signatures(&source, &target, reversing);
            off(&map, &identity, source.basis, target.basis)
        });
        assert!(found[0] < 0.1 && found[1] > 0.4, "{found:?}");
    }
}
