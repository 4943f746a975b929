//! Coupling two clouds without a map: unbalanced entropic transport (Sinkhorn).
//!
//! Cuturi 2013; the unbalanced scaling after Chizat, Peyré, Schmitzer & Vialard, "Scaling algorithms
//! for unbalanced optimal transport problems", 2018: minimise ⟨P, D⟩ + ε KL(P | 1) + τ KL(P1 | p) +
//! τ KL(Pᵀ1 | q).

mod lanes;
mod plan;
mod scaling;
mod settings;

use faer::MatRef;
use semfm_geom::Task;

use self::scaling::Costs;
use crate::{Error, Result};

pub use self::plan::Plan;
pub use self::settings::TransportSettings;

/// Points in some space, one per row, with their masses.
#[derive(Clone, Copy, Debug)]
pub struct Weighted<'a> {
    /// The points (M × d).
    pub rows: MatRef<'a, f64>,
    /// Their masses (M).
    pub masses: &'a [f64],
}

/// Couples two clouds by squared distance between their rows over its median.
///
/// The rows of both lie in one space; the masses are positive and sum to 1 each.
///
/// The kernel is stabilised by subtracting from each row of D its least cost a and then from each
/// column its least remaining cost b: every row and column then holds a 1 and f32 is enough. With
/// e = τ/(τ+ε), what u and v absorb is the benign factors exp(−a/(τ+ε)) and exp(−b/(τ+ε)). Each
/// iteration reads the kernel once: a row gives K v, hence uᵢ, and at once its share of Kᵀu.
///
/// # Errors
/// [`Error::Length`] where counts differ, [`Error::OutOfRange`] for settings that are not positive,
/// [`Error::Geom`] on cancellation.
pub fn couple(
    source: Weighted<'_>,
    target: Weighted<'_>,
    settings: &TransportSettings,
    task: &Task,
) -> Result<Plan> {
    Error::length("dimensions of the target's points", source.rows.ncols(), target.rows.ncols())?;
    Error::length("masses of the source's points", source.rows.nrows(), source.masses.len())?;
    Error::length("masses of the target's points", target.rows.nrows(), target.masses.len())?;
    if settings.tolerance.is_nan() || settings.tolerance < 0.0 {
        let found = settings.tolerance;
        return Error::out_of_range("transport", "a tolerance of at least 0", found);
    }
    if !(settings.blur > 0.0 && settings.kl_weight > 0.0) {
        let found = format!("blur {}, KL weight {}", settings.blur, settings.kl_weight);
        return Error::out_of_range("transport", "a positive blur and KL weight", found);
    }
    let costs = Costs::new(source.rows, target.rows);
    match costs.scale(source.masses, target.masses, settings, task)? {
        Some(plan) => Ok(plan),
        None => costs.scale_in_logs(source.masses, target.masses, settings, task),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use faer::Mat;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    struct Cloud {
        rows: Mat<f64>,
        masses: Vec<f64>,
    }

    impl Cloud {
        fn weighted(&self) -> Weighted<'_> {
            Weighted { rows: self.rows.as_ref(), masses: &self.masses }
        }
    }

    fn cloud(n: usize, seed: u64, spread: f64) -> Cloud {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let rows = Mat::from_fn(n, 3, |_, _| rng.random::<f64>() * spread);
        Cloud { rows, masses: vec![1.0 / n as f64; n] }
    }

    fn plan_of(a: &Cloud, b: &Cloud, settings: &TransportSettings) -> Plan {
        couple(a.weighted(), b.weighted(), settings, &Task::default()).unwrap()
    }

    fn both_ways(a: &Cloud, b: &Cloud, settings: &TransportSettings) -> (Plan, Plan) {
        let costs = Costs::new(a.rows.as_ref(), b.rows.as_ref());
        let exact = costs.scale_in_logs(&a.masses, &b.masses, settings, &Task::default());
        (plan_of(a, b, settings), exact.unwrap())
    }

    #[test]
    fn the_stabilised_kernel_gives_the_plan_of_the_log_domain() {
        let (a, b) = (cloud(70, 1, 1.0), cloud(90, 2, 1.0));
        for settings in [
            TransportSettings { iterations: 300, tolerance: 0.0, ..TransportSettings::default() },
            TransportSettings { blur: 0.02, kl_weight: 0.5, iterations: 300, tolerance: 0.0 },
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
    fn a_plan_that_has_settled_says_the_same_as_one_of_many_iterations() {
        let (a, b) = (cloud(300, 8, 1.0), cloud(250, 9, 1.1));
        let default = TransportSettings::default();
        let all = TransportSettings { iterations: 400, tolerance: 0.0, ..default };
        let (settled, long) = (plan_of(&a, &b, &default), plan_of(&a, &b, &all));
        assert!(settled.iterations < 60 && long.iterations > 60, "{}", settled.iterations);
        let differ = |x: &[u32], y: &[u32]| x.iter().zip(y).filter(|(x, y)| x != y).count();
        assert!(differ(&settled.source_of(), &long.source_of()) <= 2);
        assert!(differ(&settled.target_of(), &long.target_of()) <= 2);
        let function: Vec<f64> = (0..300).map(|i| f64::from(i % 2)).collect();
        for (x, y) in settled.vote(&function).iter().zip(long.vote(&function)) {
            assert!((x - y).abs() < 0.005, "{x} for {y}");
        }
        let wrong = TransportSettings { tolerance: f64::NAN, ..default };
        let error = couple(a.weighted(), b.weighted(), &wrong, &Task::default()).unwrap_err();
        assert!(error.to_string().contains("tolerance"), "{error}");
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
        let settings = TransportSettings {
            blur: 0.1,
            kl_weight: f64::INFINITY,
            iterations: 500,
            tolerance: 0.0,
        };
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
        a.rows[(7, 0)] = 1e4;
        b.rows[(9, 1)] = -1e4;
        let settings = TransportSettings::default();
        let plan = plan_of(&a, &b, &settings);
        assert!((0..60).all(|i| (0..60).all(|j| plan.mass(i, j).is_finite())));
        assert!(plan.vote(&[1.0; 60]).iter().all(|&v| v == 0.0 || (v - 1.0).abs() < 1e-5));
    }

    #[test]
    fn a_cloud_moved_onto_itself_is_matched_to_itself() {
        let a = cloud(80, 7, 1.0);
        let settings = TransportSettings { blur: 0.002, ..TransportSettings::default() };
        let plan = plan_of(&a, &a, &settings);
        let identity: Vec<u32> = (0..80).collect();
        assert_eq!(plan.source_of(), identity);
        assert_eq!(plan.target_of(), identity);
        let function: Vec<f64> = (0..80).map(f64::from).collect();
        let vote = plan.vote(&function);
        assert!(vote.iter().zip(&function).all(|(x, y)| (x - y).abs() < 8.0));
    }
}
