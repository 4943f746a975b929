//! Costs between two clouds and the scaling that turns them into a plan.

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatRef, Par};
use rayon::prelude::*;
use semfm_geom::Task;

use super::lanes::{Exponentiate, ScaleRows, UNDERFLOW};
use super::plan::Plan;
use super::settings::TransportSettings;
use crate::Result;

/// Rows of the kernel that one thread takes at a time. Fixed, so that sums are grouped in the same
/// way at every thread count.
const ROWS: usize = 160;
/// The median of the costs is taken over about this many of them.
const MEDIAN_SAMPLE: usize = 1 << 16;

/// D (M_target × M_source, row-major): squared distances over their median.
pub(super) struct Costs {
    distances: Vec<f32>,
    n_source: usize,
}

impl Costs {
    pub fn new(source: MatRef<'_, f64>, target: MatRef<'_, f64>) -> Self {
        let (n_source, n_target) = (source.nrows(), target.nrows());
        let (source, target) = (as_f32(source), as_f32(target));
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

    /// aᵢ = minⱼ Dᵢⱼ, bⱼ = minᵢ (Dᵢⱼ − aᵢ), Kᵢⱼ = exp((aᵢ + bⱼ − Dᵢⱼ)/ε)
    fn kernel(&self, blur: f32) -> Kernel {
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
        Kernel { entries: kernel, least_of_row, least_of_column }
    }

    /// The scaling in f32; `None` where a kernel sum underflows.
    ///
    /// uᵢ = (pᵢ / (K v)ᵢ)^e exp(−aᵢ/(τ+ε)), then vⱼ = (qⱼ / (Kᵀ u)ⱼ)^e exp(−bⱼ/(τ+ε)), with
    /// e = τ/(τ+ε), p the masses of the target's points and q those of the source's.
    pub fn scale(
        &self,
        p_source: &[f64],
        p_target: &[f64],
        settings: &TransportSettings,
        task: &Task,
    ) -> Result<Option<Plan>> {
        let n = self.n_source;
        let (blur, tau) = (settings.blur as f32, settings.kl_weight as f32);
        let exponent = if tau.is_finite() { tau / (tau + blur) } else { 1.0 };
        let kernel = self.kernel(blur);
        let absorbed_target = absorbed(&kernel.least_of_row, tau + blur);
        let absorbed_source = absorbed(&kernel.least_of_column, tau + blur);
        let mut u = vec![1.0f32; p_target.len()];
        let mut v: Vec<f32> =
            kernel.least_of_column.iter().map(|c| (-c / blur).exp().max(1e-20)).collect();
        let (mut change, mut iterations) = (f64::INFINITY, 0);
        for iteration in 0..settings.iterations {
            task.step("transport", iteration, settings.iterations)?;
            let (before, v_before) = (u.clone(), v.clone());
            let shares: Vec<Option<Vec<f32>>> = u
                .par_chunks_mut(ROWS)
                .zip(kernel.entries.par_chunks(ROWS * n))
                .enumerate()
                .map(|(chunk, (u, kernel))| {
                    let (mass, factor) =
                        (&p_target[chunk * ROWS..], &absorbed_target[chunk * ROWS..]);
                    pulp::Arch::new().dispatch(ScaleRows {
                        kernel,
                        v: &v,
                        u,
                        mass,
                        factor,
                        exponent,
                    })
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
            iterations = iteration + 1;
            let unevenness = unevenness(&u, &before).max(unevenness(&v, &v_before));
            if unevenness <= settings.tolerance {
                break;
            }
        }
        Ok(Some(Plan {
            kernel: kernel.entries,
            on_target: u,
            on_source: v,
            iterations,
            change,
            log_domain: false,
        }))
    }

    /// The same scaling on logarithms in f64: a hundred times slower, and never out of range.
    pub fn scale_in_logs(
        &self,
        p_source: &[f64],
        p_target: &[f64],
        settings: &TransportSettings,
        task: &Task,
    ) -> Result<Plan> {
        let (n, blur, tau) = (self.n_source, settings.blur, settings.kl_weight);
        let exponent = if tau.is_finite() { tau / (tau + blur) } else { 1.0 };
        let mut log_u = vec![0.0f64; p_target.len()];
        let mut log_v = vec![0.0f64; n];
        let (mut change, mut iterations) = (f64::INFINITY, 0);
        for iteration in 0..settings.iterations {
            task.step("transport", iteration, settings.iterations)?;
            let next: Vec<f64> = (0..p_target.len())
                .into_par_iter()
                .map(|i| {
                    let row = (0..n).map(|j| log_v[j] - self.cost(i, j) / blur);
                    exponent * (p_target[i].ln() - log_sum(row))
                })
                .collect();
            change = next.iter().zip(&log_u).fold(0.0, |m: f64, (x, y)| m.max((x - y).abs()));
            let moved_u = range_of(next.iter().zip(&log_u).map(|(x, y)| x - y));
            log_u = next;
            let next: Vec<f64> = (0..n)
                .into_par_iter()
                .map(|j| {
                    let column = (0..log_u.len()).map(|i| log_u[i] - self.cost(i, j) / blur);
                    exponent * (p_source[j].ln() - log_sum(column))
                })
                .collect();
            let moved_v = range_of(next.iter().zip(&log_v).map(|(x, y)| x - y));
            log_v = next;
            iterations = iteration + 1;
            if moved_u.max(moved_v).exp_m1() <= settings.tolerance {
                break;
            }
        }
        let mut kernel = vec![0.0; self.distances.len()];
        kernel.par_chunks_mut(n).enumerate().for_each(|(i, row)| {
            row.iter_mut().enumerate().for_each(|(j, k)| {
                *k = (log_u[i] + log_v[j] - self.cost(i, j) / blur).exp() as f32;
            });
        });
        Ok(Plan {
            kernel,
            on_target: vec![1.0; p_target.len()],
            on_source: vec![1.0; n],
            iterations,
            change,
            log_domain: true,
        })
    }

    /// Dᵢⱼ, i a target point and j a source point.
    fn cost(&self, i: usize, j: usize) -> f64 {
        f64::from(self.distances[i * self.n_source + j])
    }
}

/// K with the least costs that were taken out of it.
struct Kernel {
    /// K (M_target × M_source), row-major.
    entries: Vec<f32>,
    /// a (M_target).
    least_of_row: Vec<f32>,
    /// b (M_source).
    least_of_column: Vec<f32>,
}

fn as_f32(m: MatRef<'_, f64>) -> Mat<f32> {
    Mat::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)] as f32)
}

/// Squared length of each row.
fn squares(m: &Mat<f32>) -> Vec<f32> {
    (0..m.nrows()).map(|i| m.row(i).squared_norm_l2()).collect()
}

/// exp(−c/(τ+ε)) of each least cost c.
fn absorbed(least: &[f32], tau_plus_blur: f32) -> Vec<f32> {
    least.iter().map(|c| (-c / tau_plus_blur).exp()).collect()
}

/// The sum of the blocks' shares; `None` where a block has none.
fn add_up(shares: Vec<Option<Vec<f32>>>, n: usize) -> Option<Vec<f32>> {
    let mut total = vec![0.0f32; n];
    for share in shares {
        total.iter_mut().zip(share?).for_each(|(t, s)| *t += s);
    }
    Some(total)
}

/// (maxᵢ xᵢ/yᵢ) / (minᵢ xᵢ/yᵢ) − 1 of scalings x that were y: 0 where all changed by one factor.
fn unevenness(now: &[f32], before: &[f32]) -> f64 {
    let changed = now.iter().zip(before).filter(|(x, y)| **x > 0.0 && **y > 0.0);
    let (mut low, mut high) = (f32::INFINITY, 0.0f32);
    for (x, y) in changed {
        low = low.min(x / y);
        high = high.max(x / y);
    }
    f64::from(high / low) - 1.0
}

/// Greatest less least.
fn range_of(numbers: impl Iterator<Item = f64>) -> f64 {
    let (low, high) = numbers
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
    high - low
}

fn least(row: &[f32]) -> f32 {
    row.iter().fold(f32::INFINITY, |m, &d| if d < m { d } else { m })
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
