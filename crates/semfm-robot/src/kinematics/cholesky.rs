//! Small symmetric systems, row-major, by Cholesky's factor.

/// Replaces the lower triangle of `matrix` (n × n, symmetric, only the lower triangle is read) by its factor L with
/// L Lᵀ = matrix; `false` where it is not positive definite.
pub(super) fn factor(matrix: &mut [f64], n: usize) -> bool {
    for i in 0..n {
        for j in 0..=i {
            let (above, row) = matrix.split_at_mut(i * n);
            let other = if j < i { &above[j * n..] } else { &row[..] };
            let sum: f64 = (0..j).map(|k| row[k] * other[k]).sum();
            let rest = row[j] - sum;
            if i == j {
                if !(rest.is_finite() && rest > 0.0) {
                    return false;
                }
                row[j] = rest.sqrt();
            } else {
                row[j] = rest / above[j * n + j];
            }
        }
    }
    true
}

/// Solves L Lᵀ x = b in place.
pub(super) fn solve(factor: &[f64], b: &mut [f64]) {
    let n = b.len();
    for i in 0..n {
        let sum: f64 = (0..i).map(|k| factor[i * n + k] * b[k]).sum();
        b[i] = (b[i] - sum) / factor[i * n + i];
    }
    for i in (0..n).rev() {
        let sum: f64 = (i + 1..n).map(|k| factor[k * n + i] * b[k]).sum();
        b[i] = (b[i] - sum) / factor[i * n + i];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_solution_solves_and_singular_matrices_are_refused() {
        let matrix = [4.0, 0.0, 0.0, 2.0, 5.0, 0.0, -1.0, 3.0, 6.0];
        let x = [1.0, -2.0, 0.5];
        let entry = |i: usize, j: usize| matrix[i.max(j) * 3 + i.min(j)];
        let mut b: Vec<f64> = (0..3).map(|i| (0..3).map(|j| entry(i, j) * x[j]).sum()).collect();
        let mut l = matrix;
        assert!(factor(&mut l, 3));
        solve(&l, &mut b);
        assert!(b.iter().zip(x).all(|(b, x)| (b - x).abs() < 1e-14), "{b:?}");
        assert!(!factor(&mut [1.0, 0.0, 1.0, 1.0], 2));
        assert!(!factor(&mut [f64::NAN], 1));
    }
}
