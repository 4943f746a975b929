//! One-to-one pairs of largest total gain, exactly.

use faer::MatRef;

/// A row of a matrix and the column that it is assigned to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Assigned {
    /// The row.
    pub row: usize,
    /// The column.
    pub column: usize,
}

/// The `count` pairs (row, column) of `gain` (rows × columns) with the largest sum, no row and no
/// column twice, sorted by row; fewer where the matrix has fewer rows or columns.
///
/// An exact k-cardinality assignment (Dell'Amico & Martello 1997): the matrix is padded with
/// `columns − count` rows and `rows − count` columns that cost nothing and may not meet each
/// other, which leaves exactly `count` real pairs to a full assignment. A greedy pick is not
/// enough: from `[[.9, .8], [.8, .1]]` it takes .9 + .1 where .8 + .8 is to be had.
///
/// Entries must be finite.
pub fn best_pairs(gain: MatRef<'_, f64>, count: usize) -> Vec<Assigned> {
    let (rows, columns) = (gain.nrows(), gain.ncols());
    let count = count.min(rows).min(columns);
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for column in gain.col_iter() {
        for &g in column.iter() {
            (low, high) = (low.min(g), high.max(g));
        }
    }
    let n = rows + columns - count;
    // More than any number of real pairs can gain.
    let forbidden = (high - low + 1.0) * (n + 1) as f64;
    let column_of = Padded { gain, high, forbidden }.assign(n);
    let assigned = (0..rows).map(|row| Assigned { row, column: column_of[row] });
    assigned.filter(|pair| pair.column < columns).collect()
}

/// The gains as costs of a square matrix, padded.
struct Padded<'a> {
    gain: MatRef<'a, f64>,
    /// The largest gain.
    high: f64,
    /// The cost where padding meets padding.
    forbidden: f64,
}

impl Padded<'_> {
    fn cost(&self, i: usize, j: usize) -> f64 {
        match (i < self.gain.nrows(), j < self.gain.ncols()) {
            (true, true) => self.high - self.gain[(i, j)],
            (false, false) => self.forbidden,
            // A real pair must not lose against staying alone: the count is fixed by the padding.
            _ => 0.0,
        }
    }

    /// The permutation of least cost: `column_of[row]`, by shortest augmenting paths (Jonker &
    /// Volgenant 1987; O(n³)).
    fn assign(&self, n: usize) -> Vec<usize> {
        const FREE: usize = usize::MAX;
        let (mut row_price, mut column_price) = (vec![0.0; n], vec![0.0; n]);
        let mut row_of = vec![FREE; n];
        for start in 0..n {
            // Dijkstra over columns from the unassigned row `start`, on reduced costs.
            let mut distance = vec![f64::INFINITY; n];
            let mut came_from = vec![FREE; n];
            let mut done = vec![false; n];
            let (mut row, mut reached, mut last) = (start, 0.0, FREE);
            let end = loop {
                let (mut nearest, mut next) = (f64::INFINITY, FREE);
                for j in (0..n).filter(|&j| !done[j]) {
                    let through = reached + self.cost(row, j) - row_price[row] - column_price[j];
                    if through < distance[j] {
                        (distance[j], came_from[j]) = (through, last);
                    }
                    if distance[j] < nearest {
                        (nearest, next) = (distance[j], j);
                    }
                }
                (done[next], reached) = (true, nearest);
                if row_of[next] == FREE {
                    break next;
                }
                (row, last) = (row_of[next], next);
            };
            row_price[start] += reached;
            for j in (0..n).filter(|&j| done[j] && j != end) {
                column_price[j] -= reached - distance[j];
                row_price[row_of[j]] += reached - distance[j];
            }
            let mut column = end;
            while column != FREE {
                let before = came_from[column];
                row_of[column] = if before == FREE { start } else { row_of[before] };
                column = before;
            }
        }
        let mut column_of = vec![0; n];
        for (j, &i) in row_of.iter().enumerate() {
            column_of[i] = j;
        }
        column_of
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use faer::{Mat, mat};
    use proptest::prelude::*;

    fn brute_force(gain: MatRef<'_, f64>, count: usize, row: usize, taken: u32) -> f64 {
        if count == 0 {
            return 0.0;
        }
        if row == gain.nrows() {
            return f64::NEG_INFINITY;
        }
        let skip = brute_force(gain, count, row + 1, taken);
        (0..gain.ncols()).filter(|j| taken & (1 << j) == 0).fold(skip, |best, j| {
            best.max(gain[(row, j)] + brute_force(gain, count - 1, row + 1, taken | (1 << j)))
        })
    }

    #[test]
    fn a_greedy_pick_is_beaten() {
        let gain = mat![[0.9, 0.8], [0.8, 0.1]];
        let [first, second] = [(0, 1), (1, 0)].map(|(row, column)| Assigned { row, column });
        assert_eq!(best_pairs(gain.as_ref(), 2), [first, second]);
        assert_eq!(best_pairs(gain.as_ref(), 1), [Assigned { row: 0, column: 0 }]);
        assert_eq!(best_pairs(gain.as_ref(), 7).len(), 2);
        assert!(best_pairs(gain.as_ref(), 0).is_empty());
    }

    proptest! {
        #[test]
        fn no_choice_of_pairs_is_better(
            rows in 1usize..6,
            columns in 1usize..6,
            count in 1usize..6,
            entries in prop::collection::vec(-1.0f64..1.0, 25),
        ) {
            let gain = Mat::from_fn(rows, columns, |i, j| entries[5 * i + j]);
            let count = count.min(rows).min(columns);
            let pairs = best_pairs(gain.as_ref(), count);
            prop_assert_eq!(pairs.len(), count);
            let mut seen: Vec<usize> = pairs.iter().map(|p| p.column).collect();
            seen.sort_unstable();
            seen.dedup();
            prop_assert_eq!(seen.len(), count);
            let total: f64 = pairs.iter().map(|p| gain[(p.row, p.column)]).sum();
            let best = brute_force(gain.as_ref(), count, 0, 0);
            prop_assert!((total - best).abs() < 1e-12, "{} against {}", total, best);
        }
    }
}
