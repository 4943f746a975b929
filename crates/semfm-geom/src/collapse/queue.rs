//! The collapses that wait, cheapest first.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Of those that cost more than all that are sorted, this share is sorted next: a heap that fits the processor's cache
/// is several times faster than one of a million entries.
const SHARE: usize = 32;
/// At least so many are sorted at once.
const LEAST: usize = 4096;

/// A vertex whose collapse is waiting; the cheapest is the greatest, ties by name.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct Waiting {
    pub cost: f64,
    pub name: u32,
    /// That of the vertex when it began to wait: another one makes it void.
    pub stamp: u32,
}

impl Eq for Waiting {}

impl Ord for Waiting {
    fn cmp(&self, other: &Self) -> Ordering {
        let key = (other.name, other.stamp).cmp(&(self.name, self.stamp));
        other.cost.total_cmp(&self.cost).then(key)
    }
}

impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// A queue whose dear end is not sorted until it is needed.
#[derive(Default)]
pub(super) struct Queue {
    /// All that cost at most `limit`.
    sorted: BinaryHeap<Waiting>,
    dear: Vec<Waiting>,
    limit: f64,
}

impl Queue {
    /// The cheapest that is not void.
    pub(super) fn pop(&mut self, is_void: impl Fn(&Waiting) -> bool) -> Option<Waiting> {
        loop {
            match self.sorted.pop() {
                Some(next) if is_void(&next) => {}
                Some(next) => return Some(next),
                None if self.dear.is_empty() => return None,
                None => self.raise_limit(&is_void),
            }
        }
    }

    /// Sorts the next share.
    fn raise_limit(&mut self, is_void: &impl Fn(&Waiting) -> bool) {
        self.dear.retain(|waiting| !is_void(waiting));
        let count = (self.dear.len() / SHARE).max(LEAST);
        if count < self.dear.len() {
            let (_, last, _) =
                self.dear.select_nth_unstable_by(count, |a, b| a.cost.total_cmp(&b.cost));
            self.limit = last.cost;
        } else {
            self.limit = f64::INFINITY;
        }
        let limit = self.limit;
        // What is not a number is dear for ever, and sorted at last.
        let is_cheap = |waiting: &Waiting| limit == f64::INFINITY || waiting.cost <= limit;
        let cheap = self.dear.extract_if(.., |waiting| is_cheap(waiting));
        self.sorted.extend(cheap);
    }
}

impl Extend<Waiting> for Queue {
    fn extend<T: IntoIterator<Item = Waiting>>(&mut self, waiting: T) {
        for waiting in waiting {
            if waiting.cost <= self.limit || self.limit == f64::INFINITY {
                self.sorted.push(waiting);
            } else {
                self.dear.push(waiting);
            }
        }
    }
}

impl FromIterator<Waiting> for Queue {
    fn from_iter<T: IntoIterator<Item = Waiting>>(waiting: T) -> Self {
        let dear = waiting.into_iter().collect();
        Self { sorted: BinaryHeap::new(), dear, limit: f64::NEG_INFINITY }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn waiting(name: u32) -> Waiting {
        Waiting { cost: f64::from(name.wrapping_mul(2_654_435_761) % 1000), name, stamp: name % 3 }
    }

    #[test]
    fn everything_comes_out_in_order_whenever_it_was_put_in() {
        let mut queue: Queue = (0..20_000).map(waiting).collect();
        let mut expected: Vec<Waiting> = (0..25_000).map(waiting).collect();
        let first = queue.pop(|_| false).unwrap();
        // What comes later and costs less than all that is sorted comes next.
        queue.extend((20_000..25_000).map(waiting));
        let mut found = vec![first];
        found.extend(std::iter::from_fn(|| queue.pop(|_| false)));
        expected.sort_by(|a, b| b.cmp(a));
        found[1..].sort_by(|a, b| a.cost.total_cmp(&b.cost)); // stable
        let costs = |list: &[Waiting]| list.iter().map(|w| w.cost).collect::<Vec<_>>();
        assert_eq!(costs(&found), costs(&expected));
        let mut queue: Queue = (0..20_000).map(waiting).collect();
        let sound: Vec<Waiting> =
            std::iter::from_fn(|| queue.pop(|waiting| waiting.stamp == 1)).collect();
        assert!(sound.windows(2).all(|pair| pair[0] > pair[1]), "not in order");
        assert_eq!(sound.len(), (0..20_000).filter(|name| name % 3 != 1).count());
    }
}
