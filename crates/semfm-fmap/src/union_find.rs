//! Connected components by union–find (Tarjan 1975), with path halving.

/// A forest of pointers towards the root of each element's component.
pub(crate) struct UnionFind(Vec<u32>);

impl UnionFind {
    /// n elements, each a component of its own.
    pub fn new(n: usize) -> Self {
        Self((0..n as u32).collect())
    }

    /// The element that stands for the component of i.
    pub fn root(&mut self, mut i: u32) -> u32 {
        while self.0[i as usize] != i {
            self.0[i as usize] = self.0[self.0[i as usize] as usize];
            i = self.0[i as usize];
        }
        i
    }

    /// Joins the components of two elements; false where they were one already.
    pub fn join(&mut self, i: u32, j: u32) -> bool {
        let (a, b) = (self.root(i), self.root(j));
        self.0[a.max(b) as usize] = a.min(b);
        a != b
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joined_elements_share_a_root() {
        let mut components = UnionFind::new(5);
        assert!(components.join(0, 3) && components.join(3, 4) && !components.join(0, 4));
        let roots: Vec<u32> = (0..5).map(|i| components.root(i)).collect();
        assert_eq!(roots, [0, 1, 2, 0, 0]);
    }
}
