//! The inner loops of the transport, written so that they run in wide registers.
//!
//! They are values and not closures, so that they are inlined where the wide registers are switched on.

/// Lanes of the hand-unrolled sums: two AVX-512 registers, four of AVX2.
const LANES: usize = 32;
/// Below this a kernel sum has lost its digits and the scaling moves to the log domain.
pub(super) const UNDERFLOW: f32 = 1e-30;
/// Where the exponential is cut to zero, at 2e-25: what is left out is below the rounding of sums that hold a 1. Cut at
/// −87 the products with small scalings are subnormal, and an iteration takes four times as long.
const CUT: f32 = -57.0;

/// One pass over some rows of the kernel: u from K v, and this block's share of Kᵀ u. `None` where
/// a sum underflows.
pub(super) struct ScaleRows<'a> {
    pub kernel: &'a [f32],
    pub v: &'a [f32],
    pub u: &'a mut [f32],
    pub mass: &'a [f64],
    /// What u absorbs of the row's least cost.
    pub factor: &'a [f32],
    pub exponent: f32,
}

impl pulp::WithSimd for ScaleRows<'_> {
    type Output = Option<Vec<f32>>;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> Option<Vec<f32>> {
        let mut share = vec![0.0f32; self.v.len()];
        for (i, row) in self.kernel.chunks_exact(self.v.len()).enumerate() {
            let sum = dot(row, self.v);
            if sum < UNDERFLOW {
                return None;
            }
            let u = (self.mass[i] as f32 / sum).powf(self.exponent) * self.factor[i];
            self.u[i] = u;
            share.iter_mut().zip(row).for_each(|(s, k)| *s += u * k);
        }
        Some(share)
    }
}

/// One row of the kernel from one row of costs.
pub(super) struct Exponentiate<'a> {
    pub kernel: &'a mut [f32],
    pub costs: &'a [f32],
    pub least: f32,
    pub least_of_column: &'a [f32],
    /// 1 / ε.
    pub per_blur: f32,
}

impl pulp::WithSimd for Exponentiate<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        for ((k, d), b) in self.kernel.iter_mut().zip(self.costs).zip(self.least_of_column) {
            *k = exp_of_negative((self.least + b - d) * self.per_blur);
        }
    }
}

/// The product of two rows.
pub(super) struct Dot<'a>(pub &'a [f32], pub &'a [f32]);

impl pulp::WithSimd for Dot<'_> {
    type Output = f32;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> f32 {
        dot(self.0, self.1)
    }
}

/// Σ aᵢ bᵢ in [`LANES`] lanes, in the same order on every machine.
#[inline(always)]
fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut lanes = [0.0f32; LANES];
    let (a_blocks, a_rest) = a.as_chunks::<LANES>();
    let (b_blocks, b_rest) = b.as_chunks::<LANES>();
    for (x, y) in a_blocks.iter().zip(b_blocks) {
        for ((lane, x), y) in lanes.iter_mut().zip(x).zip(y) {
            *lane += x * y;
        }
    }
    let rest: f32 = a_rest.iter().zip(b_rest).map(|(x, y)| x * y).sum();
    let mut half = LANES / 2;
    while half > 0 {
        for i in 0..half {
            lanes[i] += lanes[i + half];
        }
        half /= 2;
    }
    lanes[0] + rest
}

/// eˣ for x ≤ 0 to 2e-7 relative, 0 from [`CUT`] on: written so that it runs in lanes (libm's does not).
#[inline(always)]
fn exp_of_negative(x: f32) -> f32 {
    let x = if x < CUT { CUT } else { x };
    let scaled = x * std::f32::consts::LOG2_E;
    // Adding 1.5 · 2²³ rounds to the nearest integer and leaves it in the low bits.
    let shifted = scaled + 12_582_912.0;
    let whole = shifted - 12_582_912.0;
    let r = (x - whole * 0.693_359_4) + whole * 2.121_944_4e-4; // ln 2 in two parts
    let series = 1.0
        + r * (1.0
            + r * (0.5 + r * (1.0 / 6.0 + r * (1.0 / 24.0 + r * (1.0 / 120.0 + r / 720.0)))));
    let power =
        f32::from_bits((shifted.to_bits().wrapping_sub(0x4B40_0000).wrapping_add(127)) << 23);
    if x <= CUT { 0.0 } else { series * power }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exponential_is_one() {
        for i in 0..5700 {
            let x = -0.01 * i as f32;
            let (found, expected) = (exp_of_negative(x), f64::from(x).exp());
            assert!(
                (f64::from(found) - expected).abs() <= 3e-7 * expected + 1e-38,
                "exp({x}) = {found}"
            );
        }
        assert_eq!(exp_of_negative(-1e9), 0.0);
    }
}
