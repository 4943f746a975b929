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

use super::operators::{Operators, Parity};
use crate::{Error, Result};

/// A triangle mesh that knows its two sides: no two triangles run through an edge the same way.
///
/// That leaves no edge with three triangles, and no Möbius strip. It does not say which side is out;
/// pieces that hang together by nothing may be wound differently, and then a map that preserves
/// orientation on one of them reverses it on another.
#[derive(Clone, Copy, Debug)]
pub struct OrientedSurface<'a> {
    mesh: &'a Mesh,
    /// Sign of the volume of a closed surface: whether its triangles run counterclockwise as seen
    /// from outside.
    outward: Option<bool>,
}

impl<'a> OrientedSurface<'a> {
    /// Checks the winding.
    ///
    /// # Errors
    /// [`Error::NotOriented`] with the first edge that two triangles run through the same way.
    pub fn new(mesh: &'a Mesh) -> Result<Self> {
        let sides = |&[a, b, c]: &[u32; 3]| [[a, b], [b, c], [c, a]];
        let mut directed: Vec<[u32; 2]> = mesh.faces().iter().flat_map(sides).collect();
        directed.sort_unstable();
        if let Some(pair) = directed.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(Error::NotOriented { edge: pair[0] });
        }
        let closed = directed.iter().all(|&[a, b]| directed.binary_search(&[b, a]).is_ok());
        let volume: f64 = (0..mesh.n_faces())
            .map(|face| {
                let [a, b, c] = mesh.corners(face);
                a.dot(b.cross(c))
            })
            .sum();
        Ok(Self { mesh, outward: (closed && volume != 0.0).then_some(volume > 0.0) })
    }

    /// Number of vertices.
    pub fn n_vertices(&self) -> usize {
        self.mesh.n_vertices()
    }

    /// Whether the triangles of a closed surface run counterclockwise as seen from outside; nothing
    /// for one with a boundary.
    pub fn outward(&self) -> Option<bool> {
        self.outward
    }
}

/// ∫ f dφⱼ ∧ dφᵢ (k × k) for the functions f with these coefficients (k × r).
pub(super) fn turns(
    coefficients: MatRef<'_, f64>,
    basis: &Eigenbasis,
    surface: &OrientedSurface<'_>,
) -> Operators {
    let k = coefficients.nrows();
    let phi = basis.first(k);
    let faces = surface.mesh.faces();
    Operators::new(Parity::Antisymmetric, faces.len(), coefficients, |first, products, f| {
        let places = f.nrows();
        // Of every function, the differences along two sides of each face.
        let (mut u, mut w) = (Mat::<f64>::zeros(places, k), Mat::<f64>::zeros(places, k));
        for j in 0..k {
            let phi = phi.col(j).try_as_col_major().expect("columns of an eigenbasis").as_slice();
            for (x, corners) in faces[first..first + places].iter().enumerate() {
                let [a, b, c] = corners.map(|v| phi[v as usize]);
                (u[(x, j)], w[(x, j)], f[(x, j)]) = (b - a, c - a, (a + b + c) / 3.0);
            }
        }
        for ((i, j), column) in Parity::Antisymmetric.pairs(k).zip(products.col_iter_mut()) {
            let of_i = u.col_as_slice(i).iter().zip(w.col_as_slice(i));
            let of_j = u.col_as_slice(j).iter().zip(w.col_as_slice(j));
            for (x, ((ui, wi), (uj, wj))) in column.iter_mut().zip(of_i.zip(of_j)) {
                *x = 0.5 * (uj * wi - wj * ui);
            }
        }
    })
}

/// Refuses surfaces that do not belong to the bases or are wound against each other.
pub(super) fn check(
    (source, on_source): (&Eigenbasis, &OrientedSurface<'_>),
    (target, on_target): (&Eigenbasis, &OrientedSurface<'_>),
) -> Result<()> {
    Error::length("vertices of the source's surface", source.n_vertices(), on_source.n_vertices())?;
    Error::length("vertices of the target's surface", target.n_vertices(), on_target.n_vertices())?;
    match (on_source.outward, on_target.outward) {
        (Some(source), Some(target)) if source != target => Error::out_of_range(
            "winding of the two surfaces",
            "counterclockwise as seen from outside, or clockwise on both",
            "one of each",
        ),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pair::tests::{blob, shape};
    use semfm_geom::zoo;

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
                    for (face, ids) in mesh.faces().iter().enumerate() {
                        let ids = ids.map(|v| v as usize);
                        let corners = mesh.corners(face);
                        let normal = mesh.face_normal_scaled(face);
                        let n = normal.normalize();
                        let gradient = |g: &dyn Fn(usize) -> f64| {
                            (0..3)
                                .map(|c| {
                                    let opposite = corners[(c + 2) % 3] - corners[(c + 1) % 3];
                                    n.cross(opposite) * g(ids[c]) / (2.0 * mesh.face_area(face))
                                })
                                .sum::<semfm_geom::math::DVec3>()
                        };
                        let phi = |c: usize| move |v: usize| basis.functions[(v, c)];
                        let turned = gradient(&|v| f[(v, d)]).cross(gradient(&phi(j))).dot(n);
                        let mean = ids.iter().map(|&v| basis.functions[(v, i)]).sum::<f64>() / 3.0;
                        entry += mesh.face_area(face) * mean * turned;
                    }
                    let found = ours.of(d)[(i, j)];
                    assert!((found - entry).abs() < 1e-10, "{d} {i} {j}: {found} for {entry}");
                }
            }
        }
    }

    #[test]
    fn a_mirror_changes_the_sign_and_nothing_else() {
        let mesh = zoo::open_grid(9, 7);
        let faces = mesh.faces().iter().map(|&[a, b, c]| [a, c, b]).collect();
        let mirrored = Mesh::new(mesh.vertices().to_vec(), faces).unwrap();
        let basis = shape(&mesh, 8).basis().clone();
        let a = Mat::<f64>::identity(8, 8);
        let turns = |mesh| turns(a.as_ref(), &basis, &OrientedSurface::new(mesh).unwrap());
        let (here, there) = (turns(&mesh), turns(&mirrored));
        assert!(here.square() > 1.0);
        for (o, p) in here.iter().zip(there.iter()) {
            assert!((o + p).norm_max() < 1e-12 && (o + o.transpose()).norm_max() == 0.0);
        }
    }

    #[test]
    fn surfaces_without_two_sides_are_refused_and_named() {
        for (name, mesh) in zoo::all() {
            let oriented = semfm_geom::connectivity::MeshReport::new(&mesh).oriented;
            let found = OrientedSurface::new(&mesh);
            assert_eq!(found.is_ok(), oriented, "{name}");
        }
        let error = OrientedSurface::new(&zoo::moebius(12, 2)).unwrap_err().to_string();
        assert!(error.contains("the same way"), "{error}");
        let ball = zoo::icosphere(1);
        let faces = ball.faces().iter().map(|&[a, b, c]| [a, c, b]).collect();
        let inside_out = Mesh::new(ball.vertices().to_vec(), faces).unwrap();
        let (out, inside) = (OrientedSurface::new(&ball), OrientedSurface::new(&inside_out));
        let basis = shape(&ball, 4).basis().clone();
        assert!(check((&basis, &out.unwrap()), (&basis, &inside.unwrap())).is_err());
    }
}
