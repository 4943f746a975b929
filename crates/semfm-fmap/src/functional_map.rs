//! Linear maps between functions (Ovsjanikov et al., "Functional maps", 2012).

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatRef, Par};
use semfm_geom::Eigenbasis;

use crate::zoomout::{MapSide, point_map};
use crate::{Error, PointMap, Result, nearest_rows};

/// C (k_target × k_source): takes coefficients of a source function to those of the same function
/// on the target.
#[derive(Clone, Debug, PartialEq)]
pub struct FunctionalMap {
    matrix: Mat<f64>,
}

impl FunctionalMap {
    /// A map from its matrix (k_target × k_source).
    pub fn new(matrix: Mat<f64>) -> Self {
        Self { matrix }
    }

    /// C f = f ∘ T in the two bases: Φ_targetᵀ M_target Φ_source\[T\], of size `k` × `k`.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a `k` of 0, [`Error::BasisTooSmall`] where a basis holds fewer than `k` pairs,
    /// [`Error::Length`] where the point map is not one of the target.
    pub fn from_point_map(
        map: &PointMap,
        source: &Eigenbasis,
        target: &Eigenbasis,
        k: usize,
    ) -> Result<Self> {
        Error::length("point map (target vertices)", target.n_vertices(), map.n_target())?;
        check_size("the functional map", k, source, target)?;
        Ok(Self::projected(map.pull_back_basis(source, k), target.first(k), &target.mass))
    }

    /// Φ_targetᵀ M_target F of functions F (n × k) on vertices of the target that have these rows of the basis
    /// (n × k) and these masses (n); of size k × k.
    pub(crate) fn projected(mut functions: Mat<f64>, basis: MatRef<'_, f64>, mass: &[f64]) -> Self {
        let k = functions.ncols();
        for c in 0..k {
            for (x, m) in functions.col_as_slice_mut(c).iter_mut().zip(mass) {
                *x *= m;
            }
        }
        let mut matrix = Mat::zeros(k, k);
        let (basis, functions) = (basis.transpose(), functions.as_ref());
        matmul(matrix.as_mut(), Accum::Replace, basis, functions, 1.0, Par::Seq);
        Self { matrix }
    }

    /// The matrix C (k_target × k_source).
    pub fn matrix(&self) -> MatRef<'_, f64> {
        self.matrix.as_ref()
    }

    /// Size of the source basis.
    pub fn k_source(&self) -> usize {
        self.matrix.ncols()
    }

    /// Size of the target basis.
    pub fn k_target(&self) -> usize {
        self.matrix.nrows()
    }

    /// The images of the source's delta functions: Φ_source Cᵀ (n_source × k_target), to be
    /// compared with the rows of Φ_target.
    pub(crate) fn mapped_deltas(&self, source: MatRef<'_, f64>) -> Mat<f64> {
        let mut mapped = Mat::zeros(source.nrows(), self.k_target());
        matmul(mapped.as_mut(), Accum::Replace, source, self.matrix.transpose(), 1.0, Par::Seq);
        mapped
    }

    /// source_of\[j\] = argminᵢ ‖Φ_target\[j\] − (Φ_source Cᵀ)\[i\]‖: the delta functions of the
    /// source are sent through C and each target vertex takes the nearest.
    ///
    /// # Errors
    /// [`Error::BasisTooSmall`] for a map larger than a basis, [`Error::OutOfRange`] for numbers that are not finite.
    pub fn point_map(&self, source: &Eigenbasis, target: &Eigenbasis) -> Result<PointMap> {
        point_map(self, &MapSide::spectral(source), &MapSide::spectral(target), 0.0)
    }

    /// The adjoint reading, argminᵢ ‖(Φ_target C)\[j\] − Φ_source\[i\]‖: the target's delta functions
    /// come back through Cᵀ. The same for an orthogonal C.
    ///
    /// # Errors
    /// As [`Self::point_map`].
    pub fn adjoint_point_map(&self, source: &Eigenbasis, target: &Eigenbasis) -> Result<PointMap> {
        let k = self.k_source().max(self.k_target());
        check_size("the point map", k, source, target)?;
        let returned = target.first(self.k_target()) * self.matrix(); // (n_target × k_source)
        let source_of = nearest_rows(returned.as_ref(), source.first(self.k_source()))?;
        Ok(PointMap { source_of })
    }

    /// ‖C Cᵀ − I‖ / √k_target (Frobenius): 0 where the map keeps areas.
    pub fn orthogonality(&self) -> f64 {
        let k = self.k_target();
        if k == 0 {
            return 0.0;
        }
        let mut gram = &self.matrix * self.matrix.transpose();
        (0..k).for_each(|i| gram[(i, i)] -= 1.0);
        gram.norm_l2() / (k as f64).sqrt()
    }

    /// ‖C Λ_source − Λ_target C‖ / (λ_max ‖C‖) (Frobenius): 0 where the map keeps lengths.
    pub fn commutativity(&self, source: &Eigenbasis, target: &Eigenbasis) -> f64 {
        if self.k_source() == 0 || self.k_target() == 0 {
            return 0.0;
        }
        let (c, s, t) = (&self.matrix, &source.values, &target.values);
        let largest = s[self.k_source() - 1].max(t[self.k_target() - 1]);
        let defect = Mat::from_fn(c.nrows(), c.ncols(), |i, j| c[(i, j)] * (s[j] - t[i]));
        defect.norm_l2() / (largest * c.norm_l2()).max(f64::MIN_POSITIVE)
    }
}

pub(crate) fn check_size(
    what: &'static str,
    asked: usize,
    source: &Eigenbasis,
    target: &Eigenbasis,
) -> Result<()> {
    if asked == 0 {
        return Error::out_of_range(what, "at least one pair of basis functions", asked);
    }
    for (side, basis) in [("source", source), ("target", target)] {
        let available = basis.k();
        if asked > available {
            return Err(Error::BasisTooSmall { what, side, asked, available });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_objects::{blob, shape};

    #[test]
    fn the_identity_maps_to_the_identity_and_back() {
        let shape = shape(&blob(1.0), 20);
        let n = shape.mesh().n_vertices() as u32;
        let identity = PointMap { source_of: (0..n).collect() };
        let map =
            FunctionalMap::from_point_map(&identity, shape.basis(), shape.basis(), 20).unwrap();
        for i in 0..20 {
            for j in 0..20 {
                let expected = f64::from(u8::from(i == j));
                // Eigenfunctions of a shape are rounded to f32.
                assert!((map.matrix()[(i, j)] - expected).abs() < 1e-6, "C[{i}, {j}]");
            }
        }
        assert!(
            map.orthogonality() < 1e-6 && map.commutativity(shape.basis(), shape.basis()) < 1e-6
        );
        assert_eq!(map.point_map(shape.basis(), shape.basis()).unwrap(), identity);
        assert_eq!(map.adjoint_point_map(shape.basis(), shape.basis()).unwrap(), identity);
    }

    #[test]
    fn a_map_larger_than_a_basis_is_refused() {
        let shape = shape(&blob(1.0), 10);
        let map = PointMap { source_of: vec![0; shape.mesh().n_vertices()] };
        let error =
            FunctionalMap::from_point_map(&map, shape.basis(), shape.basis(), 11).unwrap_err();
        assert!(matches!(error, Error::BasisTooSmall { asked: 11, available: 10, .. }), "{error}");
    }
}
