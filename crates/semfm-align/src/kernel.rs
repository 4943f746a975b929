//! The robust kernel and how wide it is.

/// Width of the last steps' kernel in standard deviations of the noise: wide enough to lose little
/// against least squares, narrow enough that clutter a few millimetres away does no harm.
pub(crate) const WIDTH_PER_NOISE: f64 = 4.0;

/// Weight of a squared residual under the kernel of Geman & McClure (1985) of width σ:
///
/// > w(r) = 1 / (1 + r²/σ²)²
pub(crate) fn geman_mcclure(squared: f64, width: f64) -> f64 {
    let x = 1.0 + squared / (width * width);
    1.0 / (x * x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_residual_of_the_kernels_width_weighs_a_quarter() {
        assert_eq!(geman_mcclure(0.0, 0.3), 1.0);
        assert!((geman_mcclure(0.09, 0.3) - 0.25).abs() < 1e-15);
        assert!(geman_mcclure(100.0, 0.3) < 1e-5);
    }
}
