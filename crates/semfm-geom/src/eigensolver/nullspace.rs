//! The kernel of a Laplacian, read off its graph instead of iterated for.

use faer::Mat;

use crate::Laplacian;

/// Relative size of a row sum that still counts as zero: rounding of a sum of a few dozen cotangents.
const ROW_SUM_TOLERANCE: f64 = 1e-12;

/// The first (at most `k`) eigenfunctions with eigenvalue zero (n × c), orthonormal for the mass.
///
/// A Laplacian's kernel is spanned by the indicators of the connected components, so nothing has to
/// be iterated for, whatever the multiplicity. The basis chosen is the constant first, then the
/// contrasts of Helmert (1876): each sets one component, in the order of falling area, against all
/// the larger ones. Empty where a row of the stiffness does not sum to zero (an operator with a
/// potential, say).
pub(super) fn kernel(laplacian: &Laplacian, k: usize) -> Mat<f64> {
    let n = laplacian.n_vertices();
    if !rows_sum_to_zero(laplacian) {
        return Mat::zeros(n, 0);
    }
    let (component, areas) = components_by_area(laplacian);
    let mut functions = Mat::zeros(n, areas.len().min(k));
    let total: f64 = areas.iter().sum();
    let mut larger = 0.0; // area of the components before the one in hand
    for (c, area) in areas.iter().enumerate().take(functions.ncols()) {
        // On the components before c, on c, on those after it.
        let (before, on, after) = if c == 0 {
            let constant = 1.0 / total.sqrt();
            (constant, constant, constant)
        } else {
            let both = larger + area;
            ((area / (larger * both)).sqrt(), -(larger / (area * both)).sqrt(), 0.0)
        };
        larger += area;
        for (value, &of) in functions.col_as_slice_mut(c).iter_mut().zip(&component) {
            *value = match of.cmp(&c) {
                std::cmp::Ordering::Less => before,
                std::cmp::Ordering::Equal => on,
                std::cmp::Ordering::Greater => after,
            };
        }
    }
    functions
}

fn rows_sum_to_zero(laplacian: &Laplacian) -> bool {
    let stiffness = laplacian.stiffness.as_ref();
    (0..laplacian.n_vertices()).all(|j| {
        let column = stiffness.val_of_col(j);
        let size: f64 = column.iter().map(|v| v.abs()).sum();
        column.iter().sum::<f64>().abs() <= ROW_SUM_TOLERANCE * size
    })
}

/// For each vertex its component, components numbered by falling area (ties: by lowest vertex), and
/// the areas in that order.
fn components_by_area(laplacian: &Laplacian) -> (Vec<usize>, Vec<f64>) {
    const UNSEEN: usize = usize::MAX;
    let stiffness = laplacian.stiffness.as_ref();
    let mut component = vec![UNSEEN; laplacian.n_vertices()];
    let mut areas = Vec::new();
    let mut stack = Vec::new();
    for seed in 0..component.len() {
        if component[seed] != UNSEEN {
            continue;
        }
        component[seed] = areas.len();
        areas.push(0.0);
        stack.push(seed);
        while let Some(j) = stack.pop() {
            areas[component[seed]] += laplacian.mass[j];
            let entries = stiffness.row_idx_of_col_raw(j).iter().zip(stiffness.val_of_col(j));
            for (&i, &weight) in entries {
                if weight != 0.0 && component[i] == UNSEEN {
                    component[i] = component[seed];
                    stack.push(i);
                }
            }
        }
    }
    let mut order: Vec<usize> = (0..areas.len()).collect();
    order.sort_by(|&a, &b| areas[b].total_cmp(&areas[a])); // stable
    let mut rank = vec![0; order.len()];
    for (place, &c) in order.iter().enumerate() {
        rank[c] = place;
    }
    component.iter_mut().for_each(|c| *c = rank[*c]);
    (component, order.into_iter().map(|c| areas[c]).collect())
}
