//! From weighted edges to a sparse stiffness matrix.

use faer::sparse::{SparseColMat, SymbolicSparseColMat};

/// An edge between the vertices i and j with its weight w: it adds w (fᵢ − fⱼ)² to the Dirichlet
/// energy.
#[derive(Clone, Copy)]
pub(super) struct WeightedEdge {
    pub ends: [u32; 2],
    pub weight: f64,
}

impl WeightedEdge {
    /// Whether it joins two different vertices.
    fn is_proper(&self) -> bool {
        self.ends[0] != self.ends[1]
    }
}

/// The stiffness (n × n) of a weighted graph: −w off the diagonal, and on it what makes each row
/// sum to zero,
///
///   Sᵢⱼ = −Σ w over the edges between i and j,   Sᵢᵢ = −Σ_{j ≠ i} Sᵢⱼ.
///
/// Weights of the same pair add up, edges from a vertex to itself have no energy and are left out,
/// and the diagonal is always stored. Both copies of an entry are summed in the same order, so the
/// matrix is symmetric to the last bit.
pub(super) fn stiffness(n: usize, edges: &[WeightedEdge]) -> SparseColMat<usize, f64> {
    // Bucket the entries by column, in the order of the edges.
    let mut starts = vec![0usize; n + 1];
    for edge in edges.iter().filter(|edge| edge.is_proper()) {
        for id in edge.ends {
            starts[id as usize + 1] += 1;
        }
    }
    for column in 0..n {
        starts[column + 1] += starts[column];
    }
    let mut entries = vec![(0u32, 0f64); starts[n]];
    let mut fill = starts.clone();
    for edge in edges.iter().filter(|edge| edge.is_proper()) {
        let [i, j] = edge.ends;
        for [row, column] in [[i, j], [j, i]] {
            entries[fill[column as usize]] = (row, edge.weight);
            fill[column as usize] += 1;
        }
    }

    // Merge each bucket: a stable sort keeps equal rows in the order of the edges.
    let mut column_starts = Vec::with_capacity(n + 1);
    let mut rows = Vec::with_capacity(starts[n] + n);
    let mut values: Vec<f64> = Vec::with_capacity(starts[n] + n);
    column_starts.push(0);
    for column in 0..n {
        let bucket = &mut entries[starts[column]..starts[column + 1]];
        bucket.sort_by_key(|&(row, _)| row);
        let (first, mut diagonal, mut degree) = (rows.len(), None, 0.0);
        for &(row, weight) in bucket.iter() {
            let row = row as usize;
            if rows.len() > first && rows[rows.len() - 1] == row {
                let last = values.len() - 1;
                values[last] -= weight;
                continue;
            }
            if row > column && diagonal.is_none() {
                diagonal = Some(rows.len());
                rows.push(column);
                values.push(0.0);
            }
            rows.push(row);
            values.push(-weight);
        }
        let at = diagonal.unwrap_or_else(|| {
            rows.push(column);
            values.push(0.0);
            rows.len() - 1
        });
        values[first..].iter().for_each(|value| degree -= value);
        values[at] = degree;
        column_starts.push(rows.len());
    }
    SparseColMat::new(SymbolicSparseColMat::new_checked(n, n, column_starts, None, rows), values)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_add_up_and_loops_vanish() {
        let edges = [([0, 2], 1.0), ([2, 0], 0.5), ([1, 1], 9.0), ([2, 1], 0.25)];
        let matrix = stiffness(4, &edges.map(|(ends, weight)| WeightedEdge { ends, weight }));
        let stored = [(0, 0, 1.5), (0, 2, -1.5), (1, 1, 0.25), (2, 0, -1.5), (2, 2, 1.75)];
        for (i, j, value) in stored {
            assert_eq!(matrix.get(i, j), Some(&value), "({i}, {j})");
        }
        assert_eq!(matrix.get(3, 3), Some(&0.0), "a vertex without edges keeps its diagonal");
        assert_eq!(matrix.get(0, 1), None);
    }
}
