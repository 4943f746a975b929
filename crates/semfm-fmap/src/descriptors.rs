//! Anchors as smooth functions: the paper's heat-diffused indicators (section IV-E).

use faer::{Mat, MatRef};
use semfm_geom::Eigenbasis;
use serde::{Deserialize, Serialize};

/// What "unit ℓ₂ norm" means for a function on a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DescriptorNorm {
    /// Over the surface: ∫ f² = 1. Does not change with the mesh's density.
    Surface,
    /// Over the vertices: Σ f² = 1, the letter of the paper. Two meshes of n and 4n vertices get
    /// descriptors that differ by a factor of 2 once they are in the basis.
    Vertices,
}

/// How indicators become descriptors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Indicators {
    /// Heat time t, on area 1.
    pub heat_time: f64,
    /// What they are scaled to.
    pub norm: DescriptorNorm,
    /// Coefficients k that are returned.
    pub k: usize,
}

/// Spectral coefficients (k × n_functions) of the indicator functions of some labels, diffused by
/// heat and scaled to unit norm.
///
/// `labels` (n) holds one label per vertex; column c of the answer belongs to `chosen[c]`. On the
/// truncated basis exp(−tΔ) is exactly exp(−tλᵢ) on the coefficients, so no linear system is
/// solved. All of the basis takes part in the diffusion and in the norm. A label that no vertex
/// has gives a column of zeros.
pub fn diffused_indicators(
    basis: &Eigenbasis,
    labels: &[u32],
    chosen: &[u32],
    &Indicators { heat_time: t, norm, k }: &Indicators,
) -> Mat<f64> {
    let mut out = Mat::zeros(k, chosen.len());
    for (c, &label) in chosen.iter().enumerate() {
        let indicator: Vec<f64> = labels.iter().map(|&l| f64::from(u8::from(l == label))).collect();
        let mut coefficients = basis.project(&indicator);
        for (a, lambda) in coefficients.iter_mut().zip(&basis.values) {
            *a *= (-t * lambda).exp();
        }
        let square: f64 = match norm {
            DescriptorNorm::Surface => coefficients.iter().map(|a| a * a).sum(),
            DescriptorNorm::Vertices => {
                basis.reconstruct(&coefficients).iter().map(|f| f * f).sum()
            }
        };
        if square > 0.0 {
            let scale = square.sqrt().recip();
            (0..k).for_each(|i| out[(i, c)] = coefficients[i] * scale);
        }
    }
    out
}

/// Spectral coefficients (k × p) of functions given on the vertices (n × p), each scaled to unit
/// norm over the surface (within the whole basis).
pub fn normalised_coefficients(
    basis: &Eigenbasis,
    functions: MatRef<'_, f64>,
    k: usize,
) -> Mat<f64> {
    let mut out = Mat::zeros(k, functions.ncols());
    for c in 0..functions.ncols() {
        let function: Vec<f64> = functions.col(c).iter().copied().collect();
        let coefficients = basis.project(&function);
        let norm = coefficients.iter().map(|a| a * a).sum::<f64>().sqrt();
        if norm > 0.0 {
            (0..k).for_each(|i| out[(i, c)] = coefficients[i] / norm);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_objects::{blob, shape};

    #[test]
    fn descriptors_have_unit_norm_in_the_sense_that_was_asked_for() {
        let shape = shape(&blob(1.0), 30);
        let labels: Vec<u32> =
            shape.mesh().vertices().iter().map(|p| u32::from(p.x > 0.3)).collect();
        let basis = shape.basis();
        let on_surface = Indicators { heat_time: 0.005, norm: DescriptorNorm::Surface, k: 30 };
        let surface = diffused_indicators(basis, &labels, &[1, 0, 7], &on_surface);
        assert!((surface.col(0).squared_norm_l2() - 1.0).abs() < 1e-12);
        assert!((surface.col(1).squared_norm_l2() - 1.0).abs() < 1e-12);
        assert_eq!(surface.col(2).norm_l2(), 0.0, "no vertex has label 7");
        let on_vertices = Indicators { norm: DescriptorNorm::Vertices, ..on_surface };
        let vertices = diffused_indicators(basis, &labels, &[1], &on_vertices);
        let coefficients: Vec<f64> = vertices.col(0).iter().copied().collect();
        let sum: f64 = basis.reconstruct(&coefficients).iter().map(|f| f * f).sum();
        assert!((sum - 1.0).abs() < 1e-12);
    }

    #[test]
    fn heat_flattens_and_keeps_the_total() {
        let shape = shape(&blob(1.0), 30);
        let labels: Vec<u32> =
            shape.mesh().vertices().iter().map(|p| u32::from(p.x > 0.3)).collect();
        let [sharp, diffused] = [0.0, 0.05].map(|heat_time| {
            let indicators = Indicators { heat_time, norm: DescriptorNorm::Surface, k: 30 };
            let d = diffused_indicators(shape.basis(), &labels, &[1], &indicators);
            d.col(0).iter().zip(&shape.basis().values).map(|(a, l)| l * a * a).sum::<f64>()
        });
        assert!(diffused < 0.5 * sharp);
    }
}
