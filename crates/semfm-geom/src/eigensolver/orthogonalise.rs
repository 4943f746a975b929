//! Orthonormal blocks: block Gram–Schmidt and Cholesky QR, both made of matrix products.

use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::{Accum, Mat, MatMut, MatRef, Par};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// A column whose sine of the angle to the columns before it falls below the root of this would
/// lose more digits in a Gram matrix than a second pass restores; such blocks go column by column.
const SMALLEST_SQUARED_SINE: f64 = 1e-11;

/// `destination = left · right` on this thread.
pub(super) fn product(destination: MatMut<'_, f64>, left: MatRef<'_, f64>, right: MatRef<'_, f64>) {
    matmul(destination, Accum::Replace, left, right, 1.0, Par::Seq);
}

/// Takes out of `block` (n × b) its components along the orthonormal `basis` (n × c), and returns
/// them (c × b): one pass of classical Gram–Schmidt.
fn project_out(basis: MatRef<'_, f64>, block: &mut Mat<f64>) -> Mat<f64> {
    let mut components = Mat::zeros(basis.ncols(), block.ncols());
    product(components.as_mut(), basis.transpose(), block.as_ref());
    matmul(block.as_mut(), Accum::Add, basis, components.as_ref(), -1.0, Par::Seq);
    components
}

/// A block (n × b) with uniform entries from −1 to 1.
pub(super) fn random_block(n: usize, b: usize, random: &mut ChaCha8Rng) -> Mat<f64> {
    Mat::from_fn(n, b, |_, _| random.random::<f64>() * 2.0 - 1.0)
}

/// Makes the columns of a block orthonormal, W = Q R, with its working memory kept between calls.
pub(super) struct Orthonormaliser {
    spare: Mat<f64>,
    random: ChaCha8Rng,
    /// A column shorter than this is rounding error: it is replaced by a random direction.
    pub negligible: f64,
}

impl Orthonormaliser {
    /// For blocks (n × b); `random` supplies the directions that replace negligible columns.
    pub fn new(n: usize, b: usize, negligible: f64, random: ChaCha8Rng) -> Self {
        Self { spare: Mat::zeros(n, b), random, negligible }
    }

    /// Replaces `block` by Q and returns R (b × b, upper triangular).
    ///
    /// Cholesky QR: R from the Gram matrix WᵀW, Q = W R⁻¹. One call leaves Q orthonormal up to
    /// ε·cond(W)²; the caller's second call, after the block was once more cleared of the
    /// basis, completes what Yamamoto et al. (2015) call CholeskyQR2. A block that is
    /// (nearly) rank deficient takes the slower [`column_by_column`](Self::column_by_column).
    /// `clear` takes out of a column its components along the basis so far.
    pub fn orthonormalise(
        &mut self,
        block: &mut Mat<f64>,
        clear: &dyn Fn(&mut Mat<f64>),
    ) -> Mat<f64> {
        let b = block.ncols();
        let mut gram = Mat::zeros(b, b);
        product(gram.as_mut(), block.transpose(), block.as_ref());
        let Some(r) = self.cholesky(&gram) else {
            return self.column_by_column(block, clear);
        };
        product(self.spare.as_mut(), block.as_ref(), inverse_of_upper(&r).as_ref());
        std::mem::swap(block, &mut self.spare);
        r
    }

    /// Upper triangular R with RᵀR = `gram`, unless a column is negligible or nearly dependent.
    fn cholesky(&self, gram: &Mat<f64>) -> Option<Mat<f64>> {
        let b = gram.ncols();
        let mut r = Mat::<f64>::zeros(b, b);
        for j in 0..b {
            for i in 0..j {
                let known: f64 = (0..i).map(|l| r[(l, i)] * r[(l, j)]).sum();
                r[(i, j)] = (gram[(i, j)] - known) / r[(i, i)];
            }
            let known: f64 = (0..j).map(|l| r[(l, j)] * r[(l, j)]).sum();
            let pivot = gram[(j, j)] - known;
            let smallest = SMALLEST_SQUARED_SINE * gram[(j, j)];
            // Written so that NaN is refused as well.
            if !(pivot > smallest && pivot > self.negligible * self.negligible) {
                return None;
            }
            r[(j, j)] = pivot.sqrt();
        }
        Some(r)
    }

    /// Gram–Schmidt, each column twice (Giraud et al. 2005). A negligible column ends with zero on
    /// the diagonal of R and is replaced by a random direction orthogonal to basis and block, so
    /// that the Krylov space grows on past an invariant subspace.
    fn column_by_column(
        &mut self,
        block: &mut Mat<f64>,
        clear: &dyn Fn(&mut Mat<f64>),
    ) -> Mat<f64> {
        let (n, b) = (block.nrows(), block.ncols());
        let mut r = Mat::<f64>::zeros(b, b);
        for j in 0..b {
            let mut column = block.as_ref().subcols(j, 1).to_owned();
            for _ in 0..2 {
                let along = project_out(block.as_ref().subcols(0, j), &mut column);
                for i in 0..j {
                    r[(i, j)] += along[(i, 0)];
                }
            }
            let mut length = column.norm_l2();
            if length > self.negligible {
                r[(j, j)] = length;
            } else {
                column = random_block(n, 1, &mut self.random);
                for _ in 0..3 {
                    clear(&mut column);
                    project_out(block.as_ref().subcols(0, j), &mut column);
                    let shorter = 1.0 / column.norm_l2();
                    column.col_as_slice_mut(0).iter_mut().for_each(|x| *x *= shorter);
                }
                length = 1.0;
            }
            let from = column.col_as_slice(0);
            for (q, x) in block.col_as_slice_mut(j).iter_mut().zip(from) {
                *q = x / length;
            }
        }
        r
    }
}

/// The inverse of an upper triangular matrix (b × b), by back substitution.
fn inverse_of_upper(r: &Mat<f64>) -> Mat<f64> {
    let b = r.ncols();
    let mut inverse = Mat::<f64>::zeros(b, b);
    for j in 0..b {
        inverse[(j, j)] = 1.0 / r[(j, j)];
        for i in (0..j).rev() {
            let known: f64 = (i + 1..=j).map(|l| r[(i, l)] * inverse[(l, j)]).sum();
            inverse[(i, j)] = -known / r[(i, i)];
        }
    }
    inverse
}

/// Largest entry of |QᵀQ − I| for the columns of `q`.
pub(crate) fn orthonormality_error(q: MatRef<'_, f64>) -> f64 {
    let k = q.ncols();
    let mut gram = Mat::<f64>::zeros(k, k);
    triangular::matmul(
        gram.as_mut(),
        BlockStructure::TriangularLower,
        Accum::Replace,
        q.transpose(),
        BlockStructure::Rectangular,
        q,
        BlockStructure::Rectangular,
        1.0,
        Par::Seq,
    );
    let mut largest = 0.0f64;
    for j in 0..k {
        for i in j..k {
            largest = largest.max((gram[(i, j)] - f64::from(u8::from(i == j))).abs());
        }
    }
    largest
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    /// There is no basis to be cleared of.
    fn keep(_: &mut Mat<f64>) {}

    fn deviation(block: &Mat<f64>, q: &Mat<f64>, r: &Mat<f64>) -> f64 {
        (block - q * r).norm_max()
    }

    #[test]
    fn two_passes_give_orthonormal_columns_and_the_product_gives_the_block_back() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let mut block = random_block(500, 8, &mut random);
        // Columns of very different lengths, two of them close to each other.
        for i in 0..500 {
            block[(i, 7)] = block[(i, 0)] + 1e-4 * block[(i, 7)];
            block[(i, 3)] *= 1e-6;
        }
        let mut q = block.clone();
        let mut work = Orthonormaliser::new(500, 8, 1e-14, random);
        let first = work.orthonormalise(&mut q, &keep);
        let second = work.orthonormalise(&mut q, &keep);
        assert!(orthonormality_error(q.as_ref()) < 1e-14);
        assert!(deviation(&block, &q, &(second * first)) < 1e-13);
    }

    #[test]
    fn a_deficient_block_is_filled_with_new_directions_orthogonal_to_the_basis() {
        let mut random = ChaCha8Rng::seed_from_u64(2);
        let mut work = Orthonormaliser::new(60, 4, 1e-12, ChaCha8Rng::seed_from_u64(3));
        let mut basis = random_block(60, 4, &mut random);
        work.orthonormalise(&mut basis, &keep);
        work.orthonormalise(&mut basis, &keep);
        let mut block = random_block(60, 4, &mut random);
        project_out(basis.as_ref(), &mut block);
        for i in 0..60 {
            block[(i, 1)] = 0.0;
            block[(i, 2)] = 2.0 * block[(i, 0)];
        }
        let mut q = block.clone();
        let clear = |column: &mut Mat<f64>| {
            project_out(basis.as_ref(), column);
        };
        let r = work.orthonormalise(&mut q, &clear);
        assert_eq!((r[(1, 1)], r[(2, 2)]), (0.0, 0.0));
        assert!(orthonormality_error(q.as_ref()) < 1e-14);
        assert!((basis.transpose() * &q).norm_max() < 1e-14);
        assert!(deviation(&block, &q, &r) < 1e-14);
    }
}
