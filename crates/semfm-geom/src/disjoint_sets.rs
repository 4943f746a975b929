//! Union–find with path halving (R. E. Tarjan, 1975).

/// A partition of 0..n into sets, each named by its lowest member.
///
/// ```
/// use semfm_geom::DisjointSets;
/// let mut sets = DisjointSets::new(3);
/// assert!(sets.join(2, 1) && !sets.join(1, 2));
/// assert_eq!([sets.root(0), sets.root(1), sets.root(2)], [0, 1, 1]);
/// ```
#[derive(Clone, Debug)]
pub struct DisjointSets {
    /// Of each member; the lowest of its set is its own.
    parent: Vec<u32>,
}

impl DisjointSets {
    /// Every member in a set of its own.
    pub fn new(n: usize) -> Self {
        Self { parent: (0..n as u32).collect() }
    }

    /// The lowest member of the set of `id`.
    pub fn root(&mut self, mut id: u32) -> u32 {
        while self.parent[id as usize] != id {
            let grandparent = self.parent[self.parent[id as usize] as usize];
            self.parent[id as usize] = grandparent;
            id = grandparent;
        }
        id
    }

    /// Makes one set of those of `a` and `b`; false where they were one already.
    pub fn join(&mut self, a: u32, b: u32) -> bool {
        let (a, b) = (self.root(a), self.root(b));
        self.parent[a.max(b) as usize] = a.min(b);
        a != b
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lowest_member_names_the_set_in_whatever_order_it_was_joined() {
        let mut sets = DisjointSets::new(6);
        assert!(sets.join(5, 3) && sets.join(4, 5) && sets.join(1, 4));
        assert!(!sets.join(3, 1), "they are one set already");
        let roots: Vec<u32> = (0..6).map(|id| sets.root(id)).collect();
        assert_eq!(roots, [0, 1, 2, 1, 1, 1]);
    }
}
