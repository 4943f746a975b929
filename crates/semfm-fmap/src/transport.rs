//! Coupling two clouds without a map: unbalanced entropic transport (Sinkhorn).
//!
//! Cuturi 2013; the unbalanced scaling after Chizat, Peyré, Schmitzer & Vialard, "Scaling algorithms
//! for unbalanced optimal transport problems", 2018: minimise ⟨P, D⟩ + ε KL(P | 1) + τ KL(P1 | p) +
//! τ KL(Pᵀ1 | q).

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatRef, Par};
use rayon::prelude::*;
use semfm_geom::Task;
use serde::{Deserialize, Serialize};

use crate::{Error, Result};

/// Rows of the kernel that one thread walks at a time. Fixed, so that sums are grouped in the same
/// way at every thread count.
const ROWS: usize = 160;
/// Lanes of the hand-unrolled sums: two AVX-512 registers, four of AVX2.
const LANES: usize = 32;
/// Below this a kernel sum has lost its digits and the scaling moves to the log domain.
const UNDERFLOW: f32 = 1e-30;
/// The median of the costs is taken over about this many of them.
const MEDIAN_SAMPLE: usize = 1 << 16;

/// How the clouds are coupled.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TransportSettings {
    /// ε: blur, in units of the median cost.
    pub blur: f64,
    /// τ: what it costs to leave mass behind (weight of the KL terms); infinite for balanced.
    pub kl_weight: f64,
    /// Scaling iterations.
    pub iterations: usize,
}

impl Default for TransportSettings {
    fn default() -> Self {
        Self { blur: 0.05, kl_weight: 1.0, iterations: 60 }
    }
}

/// A coupling P (M_target × M_source) of two clouds, kept as diag(u) K diag(v).
#[derive(Clone, Debug)]
pub struct Plan {
    /// K, row-major: one row per target point.
    kernel: Vec<f32>,
    /// u (M_target).
    on_target: Vec<f32>,
    /// v (M_source).
    on_source: Vec<f32>,
    /// Largest relative change of u in the last iteration.
    pub change: f64,
    /// Whether the scaling had to move to the log domain.
    pub log_domain: bool,
}

/// Couples two clouds by squared distance between their rows over its median.
///
/// `source` (M_source × d) and `target` (M_target × d) are rows in one space; the masses are
/// positive and sum to 1 each.
///
/// The kernel is stabilised by subtracting from each row of D its least cost a and then from each
/// column its least remaining cost b: every row and column then holds a 1 and f32 is enough. With
/// e = τ/(τ+ε), what u and v absorb is the benign factors exp(−a/(τ+ε)) and exp(−b/(τ+ε)). Each
/// iteration walks the kernel once: a row gives K v, hence uᵢ, and at once its share of Kᵀu.
///
/// # Errors
/// [`Error::Length`] where counts differ, [`Error::OutOfRange`] for settings that are not positive,
/// cancellation.
pub fn couple(
    (source, source_mass): (MatRef<'_, f64>, &[f64]),
    (target, target_mass): (MatRef<'_, f64>, &[f64]),
    settings: &TransportSettings,
    task: &Task,
) -> Result<Plan> {
    Error::length("dimensions of the target's points", source.ncols(), target.ncols())?;
    Error::length("masses of the source's points", source.nrows(), source_mass.len())?;
    Error::length("masses of the target's points", target.nrows(), target_mass.len())?;
    if !(settings.blur > 0.0 && settings.kl_weight > 0.0) {
        let found = format!("blur {}, KL weight {}", settings.blur, settings.kl_weight);
        return Error::out_of_range("transport", "a positive blur and KL weight", found);
    }
    let costs = Costs::new(source, target);
    let plan = costs.scale(source_mass, target_mass, settings, task)?;
    match plan {
        Some(plan) => Ok(plan),
        None => costs.scale_in_logs(source_mass, target_mass, settings, task),
    }
}

/// D (M_target × M_source, row-major): squared distances over their median.
struct Costs {
    distances: Vec<f32>,
    n_source: usize,
}

impl Costs {
    fn new(source: MatRef<'_, f64>, target: MatRef<'_, f64>) -> Self {
        let (n_source, n_target) = (source.nrows(), target.nrows());
        let as_f32 =
            |m: MatRef<'_, f64>| Mat::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)] as f32);
        let (source, target) = (as_f32(source), as_f32(target));
        let squares = |m: &Mat<f32>| -> Vec<f32> {
            (0..m.nrows()).map(|i| m.row(i).squared_norm_l2()).collect()
        };
        let (source_squares, target_squares) = (squares(&source), squares(&target));
        let mut distances = vec![0.0f32; n_source * n_target];
        distances.par_chunks_mut(ROWS * n_source).enumerate().for_each(|(chunk, block)| {
            let rows = block.len() / n_source;
            // Row-major (rows × n_source) is column-major (n_source × rows).
            let out = faer::MatMut::from_column_major_slice_mut(block, n_source, rows);
            let queries = target.as_ref().subrows(chunk * ROWS, rows);
            matmul(out, Accum::Replace, source.as_ref(), queries.transpose(), -2.0, Par::Seq);
            for (row, t) in block.chunks_mut(n_source).zip(&target_squares[chunk * ROWS..]) {
                row.iter_mut().zip(&source_squares).for_each(|(d, s)| *d = (*d + s + t).max(0.0));
            }
        });
        let scale = median(&distances).recip();
        if scale.is_finite() {
            distances
                .par_chunks_mut(1 << 14)
                .for_each(|block| block.iter_mut().for_each(|d| *d *= scale));
        }
        Self { distances, n_source }
    }

    /// Subtracts the least of each row, then of each column, and exponentiates: (K, a, b).
    fn kernel(&self, blur: f32) -> (Vec<f32>, Vec<f32>, Vec<f32>) {
        let n = self.n_source;
        let least_of_row: Vec<f32> = self.distances.par_chunks(n).map(least).collect();
        let blocks: Vec<Vec<f32>> = self
            .distances
            .par_chunks(ROWS * n)
            .zip(least_of_row.par_chunks(ROWS))
            .map(|(block, least_of_row)| {
                let mut low = vec![f32::INFINITY; n];
                for (row, a) in block.chunks(n).zip(least_of_row) {
                    low.iter_mut().zip(row).for_each(|(low, d)| *low = low.min(d - a));
                }
                low
            })
            .collect();
        let mut least_of_column = vec![f32::INFINITY; n];
        for block in blocks {
            least_of_column.iter_mut().zip(block).for_each(|(low, d)| *low = low.min(d));
        }
        let per_blur = blur.recip();
        let mut kernel = vec![0.0f32; self.distances.len()];
        let rows = kernel.par_chunks_mut(n).zip(self.distances.par_chunks(n)).zip(&least_of_row);
        rows.for_each(|((kernel, costs), &least)| {
            pulp::Arch::new().dispatch(Exponentiate {
                kernel,
                costs,
                least,
                least_of_column: &least_of_column,
                per_blur,
            });
        });
        (kernel, least_of_row, least_of_column)
    }

    /// The scaling in f32; `None` where a kernel sum underflows.
    fn scale(
        &self,
        p_source: &[f64],
        p_target: &[f64],
        settings: &TransportSettings,
        task: &Task,
    ) -> Result<Option<Plan>> {
        let n = self.n_source;
        let (blur, tau) = (settings.blur as f32, settings.kl_weight as f32);
        let exponent = if tau.is_finite() { tau / (tau + blur) } else { 1.0 };
        let (kernel, a, b) = self.kernel(blur);
        let absorbed = |least: &[f32]| -> Vec<f32> {
            least.iter().map(|c| (-c / (tau + blur)).exp()).collect()
        };
        let (absorbed_target, absorbed_source) = (absorbed(&a), absorbed(&b));
        let mut u = vec![1.0f32; p_target.len()];
        let mut v: Vec<f32> = b.iter().map(|c| (-c / blur).exp().max(1e-20)).collect();
        let mut change = f64::INFINITY;
        for iteration in 0..settings.iterations {
            task.step("transport", iteration, settings.iterations)?;
            let before = u.clone();
            let shares: Vec<Option<Vec<f32>>> = u
                .par_chunks_mut(ROWS)
                .zip(kernel.par_chunks(ROWS * n))
                .enumerate()
                .map(|(chunk, (u, kernel))| {
                    let (mass, factor) =
                        (&p_target[chunk * ROWS..], &absorbed_target[chunk * ROWS..]);
                    pulp::Arch::new().dispatch(Walk { kernel, v: &v, u, mass, factor, exponent })
                })
                .collect();
            let Some(columns) = add_up(shares, n) else { return Ok(None) };
            for (((v, sum), p), factor) in
                v.iter_mut().zip(&columns).zip(p_source).zip(&absorbed_source)
            {
                if *sum < UNDERFLOW {
                    return Ok(None);
                }
                *v = (*p as f32 / sum).powf(exponent) * factor;
            }
            if u.iter().chain(&v).any(|x| !x.is_finite()) {
                return Ok(None);
            }
            change = u
                .iter()
                .zip(&before)
                .fold(0.0, |m, (x, y)| f64::from((x - y).abs() / x.max(1e-30)).max(m));
        }
        Ok(Some(Plan { kernel, on_target: u, on_source: v, change, log_domain: false }))
    }

    /// The same scaling on logarithms in f64: a hundred times slower, and never out of range.
    fn scale_in_logs(
        &self,
        p_source: &[f64],
        p_target: &[f64],
        settings: &TransportSettings,
        task: &Task,
    ) -> Result<Plan> {
        let (n, blur, tau) = (self.n_source, settings.blur, settings.kl_weight);
        let exponent = if tau.is_finite() { tau / (tau + blur) } else { 1.0 };
        let cost = |i: usize, j: usize| f64::from(self.distances[i * n + j]) / blur;
        let mut log_u = vec![0.0f64; p_target.len()];
        let mut log_v = vec![0.0f64; n];
        let mut change = f64::INFINITY;
        for iteration in 0..settings.iterations {
            task.step("transport", iteration, settings.iterations)?;
            let next: Vec<f64> = (0..p_target.len())
                .into_par_iter()
                .map(|i| {
                    exponent * (p_target[i].ln() - log_sum((0..n).map(|j| log_v[j] - cost(i, j))))
                })
                .collect();
            change = next.iter().zip(&log_u).fold(0.0, |m: f64, (x, y)| m.max((x - y).abs()));
            log_u = next;
            log_v = (0..n)
                .into_par_iter()
                .map(|j| {
                    exponent
                        * (p_source[j].ln()
                            - log_sum((0..log_u.len()).map(|i| log_u[i] - cost(i, j))))
                })
                .collect();
        }
        let mut kernel = vec![0.0; self.distances.len()];
        kernel.par_chunks_mut(n).enumerate().for_each(|(i, row)| {
            row.iter_mut()
                .enumerate()
                .for_each(|(j, k)| *k = (log_u[i] + log_v[j] - cost(i, j)).exp() as f32);
        });
        Ok(Plan {
            kernel,
            on_target: vec![1.0; p_target.len()],
            on_source: vec![1.0; n],
            change,
            log_domain: true,
        })
    }
}

impl Plan {
    /// Number of source points.
    pub fn n_source(&self) -> usize {
        self.on_source.len()
    }

    /// Number of target points.
    pub fn n_target(&self) -> usize {
        self.on_target.len()
    }

    /// Mass that goes from source point `source` to target point `target`.
    pub fn mass(&self, target: usize, source: usize) -> f64 {
        let kernel = self.kernel[target * self.n_source() + source];
        f64::from(self.on_target[target]) * f64::from(kernel) * f64::from(self.on_source[source])
    }

    /// A function on the source's points (M_source) as each target point (M_target) receives it: the
    /// mean over where its mass comes from, 0 where no mass arrives.
    pub fn vote(&self, on_source: &[f64]) -> Vec<f64> {
        let weighted: Vec<f32> =
            self.on_source.iter().zip(on_source).map(|(v, f)| v * *f as f32).collect();
        let rows = self.kernel.par_chunks(self.n_source());
        rows.map(|row| {
            let vote = pulp::Arch::new().dispatch(Dot(row, &weighted));
            let all = pulp::Arch::new().dispatch(Dot(row, &self.on_source));
            if all > UNDERFLOW { f64::from(vote) / f64::from(all) } else { 0.0 }
        })
        .collect()
    }

    /// A function on the target's points (M_target) as each source point (M_source) finds it where
    /// its mass goes: the mean over there, 0 where no mass leaves.
    pub fn vote_back(&self, on_target: &[f64]) -> Vec<f64> {
        let (mut votes, mut all) = (vec![0.0; self.n_source()], vec![0.0; self.n_source()]);
        for ((row, &u), &f) in
            self.kernel.chunks(self.n_source()).zip(&self.on_target).zip(on_target)
        {
            for ((vote, all), &k) in votes.iter_mut().zip(&mut all).zip(row) {
                let mass = f64::from(u) * f64::from(k);
                *vote += mass * f;
                *all += mass;
            }
        }
        let mean = |(vote, all): (f64, f64)| if all > 0.0 { vote / all } else { 0.0 };
        votes.into_iter().zip(all).map(mean).collect()
    }

    /// For each target point the source point that sends it the most.
    pub fn source_of(&self) -> Vec<u32> {
        let best = |row: &[f32]| largest(row.iter().zip(&self.on_source).map(|(k, v)| k * v)).0;
        self.kernel.par_chunks(self.n_source()).map(best).collect()
    }

    /// For each source point the target point that it sends the most to.
    pub fn target_of(&self) -> Vec<u32> {
        let mut best = vec![(0u32, f32::NEG_INFINITY); self.n_source()];
        for ((i, row), u) in (0..).zip(self.kernel.chunks(self.n_source())).zip(&self.on_target) {
            for (best, k) in best.iter_mut().zip(row) {
                if u * k > best.1 {
                    *best = (i, u * k);
                }
            }
        }
        best.into_iter().map(|(i, _)| i).collect()
    }
}

// The inner loops are values and not closures, so that they are inlined where the wide registers
// are switched on.

/// One pass over some rows of the kernel: u from K v, and this block's share of Kᵀ u. `None` where
/// a sum underflows.
struct Walk<'a> {
    kernel: &'a [f32],
    v: &'a [f32],
    u: &'a mut [f32],
    mass: &'a [f64],
    /// What u absorbs of the row's least cost.
    factor: &'a [f32],
    exponent: f32,
}

impl pulp::WithSimd for Walk<'_> {
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
struct Exponentiate<'a> {
    kernel: &'a mut [f32],
    costs: &'a [f32],
    least: f32,
    least_of_column: &'a [f32],
    /// 1 / ε.
    per_blur: f32,
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

struct Dot<'a>(&'a [f32], &'a [f32]);

impl pulp::WithSimd for Dot<'_> {
    type Output = f32;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> f32 {
        dot(self.0, self.1)
    }
}

fn add_up(shares: Vec<Option<Vec<f32>>>, n: usize) -> Option<Vec<f32>> {
    let mut total = vec![0.0f32; n];
    for share in shares {
        total.iter_mut().zip(share?).for_each(|(t, s)| *t += s);
    }
    Some(total)
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

/// eˣ for x ≤ 0 to 2e-7 relative, 0 below −87: written so that it runs in lanes (libm's does not).
#[inline(always)]
fn exp_of_negative(x: f32) -> f32 {
    let x = if x < -87.0 { -87.0 } else { x };
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
    if x <= -87.0 { 0.0 } else { series * power }
}

fn least(row: &[f32]) -> f32 {
    row.iter().fold(f32::INFINITY, |m, &d| if d < m { d } else { m })
}

fn largest(values: impl Iterator<Item = f32>) -> (u32, f32) {
    let mut best = (0, f32::NEG_INFINITY);
    for (j, x) in (0..).zip(values) {
        if x > best.1 {
            best = (j, x);
        }
    }
    best
}

/// The median, of every value where there are few and of an even sample where there are many.
fn median(values: &[f32]) -> f32 {
    // An odd stride does not fall into step with the rows.
    let stride = (values.len() / MEDIAN_SAMPLE).max(1) | 1;
    let mut sample: Vec<f32> = values.iter().step_by(stride).copied().collect();
    let middle = sample.len() / 2;
    *sample.select_nth_unstable_by(middle, f32::total_cmp).1
}

fn log_sum(terms: impl Iterator<Item = f64> + Clone) -> f64 {
    let top = terms.clone().fold(f64::NEG_INFINITY, f64::max);
    if top.is_finite() { top + terms.map(|x| (x - top).exp()).sum::<f64>().ln() } else { top }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn cloud(n: usize, seed: u64, spread: f64) -> (Mat<f64>, Vec<f64>) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        (Mat::from_fn(n, 3, |_, _| rng.random::<f64>() * spread), vec![1.0 / n as f64; n])
    }

    fn both_ways(
        a: &(Mat<f64>, Vec<f64>),
        b: &(Mat<f64>, Vec<f64>),
        settings: &TransportSettings,
    ) -> (Plan, Plan) {
        let task = Task::default();
        let costs = Costs::new(a.0.as_ref(), b.0.as_ref());
        let fast = couple((a.0.as_ref(), &a.1), (b.0.as_ref(), &b.1), settings, &task).unwrap();
        (fast, costs.scale_in_logs(&a.1, &b.1, settings, &task).unwrap())
    }

    #[test]
    fn the_exponential_is_one() {
        for i in 0..8700 {
            let x = -0.01 * i as f32;
            let (found, expected) = (exp_of_negative(x), f64::from(x).exp());
            assert!(
                (f64::from(found) - expected).abs() <= 3e-7 * expected + 1e-38,
                "exp({x}) = {found}"
            );
        }
        assert_eq!(exp_of_negative(-1e9), 0.0);
    }

    #[test]
    fn the_stabilised_kernel_gives_the_plan_of_the_log_domain() {
        let (a, b) = (cloud(70, 1, 1.0), cloud(90, 2, 1.0));
        for settings in [
            TransportSettings { iterations: 300, ..TransportSettings::default() },
            TransportSettings { blur: 0.02, kl_weight: 0.5, iterations: 300 },
        ] {
            let (fast, exact) = both_ways(&a, &b, &settings);
            assert!(!fast.log_domain && exact.log_domain);
            let largest = (0..90 * 70).map(|x| exact.mass(x / 70, x % 70)).fold(0.0, f64::max);
            for i in 0..90 {
                for j in 0..70 {
                    let (x, y) = (fast.mass(i, j), exact.mass(i, j));
                    assert!((x - y).abs() < 2e-4 * largest, "P[{i}, {j}] = {x} against {y}");
                }
            }
        }
    }

    #[test]
    fn votes_go_back_along_the_same_masses() {
        let (a, b) = (cloud(40, 3, 1.0), cloud(30, 4, 1.0));
        let (plan, _) = both_ways(&a, &b, &TransportSettings::default());
        let function: Vec<f64> = (0..30).map(|i| f64::from(i) / 30.0).collect();
        for (j, found) in plan.vote_back(&function).into_iter().enumerate() {
            let all: f64 = (0..30).map(|i| plan.mass(i, j)).sum();
            let mean: f64 = (0..30).map(|i| plan.mass(i, j) * function[i]).sum::<f64>() / all;
            assert!((found - mean).abs() < 1e-6, "{found} for {mean}");
        }
        assert!(plan.vote_back(&[1.0; 30]).iter().all(|x| (x - 1.0).abs() < 1e-9));
    }

    #[test]
    fn a_balanced_plan_has_the_given_masses() {
        let (a, b) = (cloud(40, 3, 1.0), cloud(30, 4, 1.0));
        let settings = TransportSettings { blur: 0.1, kl_weight: f64::INFINITY, iterations: 500 };
        let (fast, _) = both_ways(&a, &b, &settings);
        for j in 0..40 {
            let arrives: f64 = (0..30).map(|i| fast.mass(i, j)).sum();
            assert!((arrives - 1.0 / 40.0).abs() < 1e-5, "source point {j} sends {arrives}");
        }
        assert!(fast.change < 1e-3);
    }

    #[test]
    fn a_point_far_from_everything_neither_breaks_the_plan_nor_gets_nan() {
        let (mut a, mut b) = (cloud(60, 5, 1.0), cloud(60, 6, 1.0));
        a.0[(7, 0)] = 1e4;
        b.0[(9, 1)] = -1e4;
        let settings = TransportSettings::default();
        let plan = couple((a.0.as_ref(), &a.1), (b.0.as_ref(), &b.1), &settings, &Task::default())
            .unwrap();
        assert!((0..60).all(|i| (0..60).all(|j| plan.mass(i, j).is_finite())));
        assert!(plan.vote(&[1.0; 60]).iter().all(|&v| v == 0.0 || (v - 1.0).abs() < 1e-5));
    }

    #[test]
    fn a_cloud_moved_onto_itself_is_matched_to_itself() {
        let a = cloud(80, 7, 1.0);
        let settings = TransportSettings { blur: 0.002, ..TransportSettings::default() };
        let plan = couple((a.0.as_ref(), &a.1), (a.0.as_ref(), &a.1), &settings, &Task::default())
            .unwrap();
        let identity: Vec<u32> = (0..80).collect();
        assert_eq!(plan.source_of(), identity);
        assert_eq!(plan.target_of(), identity);
        let function: Vec<f64> = (0..80).map(f64::from).collect();
        let vote = plan.vote(&function);
        assert!(vote.iter().zip(&function).all(|(x, y)| (x - y).abs() < 8.0));
    }
}
