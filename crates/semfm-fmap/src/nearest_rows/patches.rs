//! An order of rows in which neighbours in space are neighbours in memory.

use super::Rows;
use super::panels::{CHUNK, PANEL, TILE};

/// Orders of the points and the queries of a search. They decide how much it computes, never what it answers, so that
/// those of one embedding serve all later ones of the same rows.
#[derive(Clone, Debug)]
pub(crate) struct Patches {
    /// All points; every [`PANEL`] of them lie near each other.
    pub points: Vec<u32>,
    /// All queries; every [`TILE`] of them lie near each other.
    pub queries: Vec<u32>,
}

impl Patches {
    /// Patches from the first [`CHUNK`] columns, which on shapes are the smoothest.
    pub fn of(queries: &Rows<'_>, points: &Rows<'_>) -> Self {
        Self { points: halved(points, PANEL), queries: halved(queries, TILE) }
    }

    /// Patches of rows that stand in such an order already.
    pub fn in_order(n_queries: usize, n_points: usize) -> Self {
        let all = |n: usize| (0..n as u32).collect();
        Self { points: all(n_points), queries: all(n_queries) }
    }
}

/// The ids of all rows, halved again and again across the widest column, at multiples of `size`.
fn halved(rows: &Rows<'_>, size: usize) -> Vec<u32> {
    let n_columns = rows.n_columns().min(CHUNK);
    let mut ids: Vec<u32> = (0..rows.len() as u32).collect();
    // (n × n_columns), row after row
    let mut numbers = vec![0.0f32; rows.len() * n_columns];
    for c in 0..n_columns {
        let column = numbers.iter_mut().skip(c).step_by(n_columns.max(1));
        column.zip(rows.entries(c, &ids)).for_each(|(x, entry)| *x = entry as f32);
    }
    halve(&mut ids, &numbers, n_columns, size);
    ids
}

fn halve(ids: &mut [u32], numbers: &[f32], n_columns: usize, size: usize) {
    if ids.len() <= size || n_columns == 0 {
        return;
    }
    let axis = widest(ids, numbers, n_columns);
    let at = |id: &u32| numbers[*id as usize * n_columns + axis];
    let middle = (ids.len() / 2).next_multiple_of(size).min(ids.len() - 1);
    ids.select_nth_unstable_by(middle, |a, b| at(a).total_cmp(&at(b)).then(a.cmp(b)));
    let (low, high) = ids.split_at_mut(middle);
    halve(low, numbers, n_columns, size);
    halve(high, numbers, n_columns, size);
}

/// The column of largest variance over some rows.
fn widest(ids: &[u32], numbers: &[f32], n_columns: usize) -> usize {
    let (mut sums, mut squares) = ([0.0f32; CHUNK], [0.0f32; CHUNK]);
    for &id in ids {
        let row = &numbers[id as usize * n_columns..][..n_columns];
        for ((sum, square), x) in sums.iter_mut().zip(&mut squares).zip(row) {
            *sum += x;
            *square += x * x;
        }
    }
    let n = ids.len() as f32;
    let spread = |c: usize| squares[c] - sums[c] * sums[c] / n;
    (0..n_columns).max_by(|&a, &b| spread(a).total_cmp(&spread(b))).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use faer::Mat;

    #[test]
    fn every_group_is_compact_and_every_row_occurs_once() {
        // 8 × 8 clumps of 16 points each.
        let at = |i: usize| (((i * 37) % 64) as f64, 0.001 * (i / 64) as f64);
        let points = Mat::from_fn(1024, 2, |i, c| {
            let (clump, aside) = at(i);
            if c == 0 { (clump / 8.0).floor() + aside } else { clump % 8.0 }
        });
        let order = halved(&Rows::of(points.as_ref()), 16);
        for group in order.chunks(16) {
            let clump = at(group[0] as usize).0;
            assert!(group.iter().all(|&i| at(i as usize).0 == clump), "{group:?}");
        }
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert!(sorted.iter().copied().eq(0..1024));
    }
}
