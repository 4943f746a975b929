//! Which demonstrations a memory holds, drawn by chance.

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

/// Memories that are drawn for one target where more are possible.
const MOST_DRAWS: usize = 6;

/// Demonstrations of one memory, by their places in the dataset, ascending.
pub(super) type Draw = Vec<usize>;

/// Memories of at most `n` objects of `pool` and `n_distractors` of `others`: each object of the pool alone for
/// n = 1, the whole pool once where it has no more than n, else some random ones. The same `key` and seed draw the
/// same.
pub(super) fn draws(
    pool: &[usize],
    n: usize,
    others: &[usize],
    n_distractors: usize,
    key: &str,
    seed: u64,
) -> Vec<Draw> {
    let count = if n == 1 {
        pool.len()
    } else if n >= pool.len() {
        1
    } else {
        MOST_DRAWS.min(pool.len())
    };
    let mut rng = generator(key, n, seed);
    let mut rotated = pool.to_vec();
    rotated.shuffle(&mut rng);
    let drawn = (0..count).map(|number| {
        // Every object is in as many of the draws: they go round.
        rotated.rotate_left(usize::from(number > 0));
        let mut draw: Draw = rotated.iter().take(n).copied().collect();
        let mut strangers = others.to_vec();
        strangers.shuffle(&mut rng);
        draw.extend(strangers.iter().take(n_distractors));
        draw.sort_unstable();
        draw
    });
    drawn.collect()
}

fn generator(key: &str, n: usize, seed: u64) -> ChaCha8Rng {
    let hash = blake3::hash(format!("{key} {n} {seed}").as_bytes());
    ChaCha8Rng::from_seed(*hash.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn draws_are_subsets_that_do_not_depend_on_chance() {
        let (pool, others) = ([3, 5, 8, 9], [100, 101, 102]);
        let alone = draws(&pool, 1, &others, 0, "mug", 0);
        let mut seen: Vec<usize> = alone.into_iter().flatten().collect();
        seen.sort_unstable();
        assert_eq!(seen, pool);
        assert_eq!(draws(&pool, 9, &others, 0, "mug", 0), [pool.to_vec()]);
        let mixed = draws(&pool, 2, &others, 2, "mug", 0);
        assert_eq!(mixed, draws(&pool, 2, &others, 2, "mug", 0));
        assert_ne!(mixed, draws(&pool, 2, &others, 2, "mug", 1));
        for draw in &mixed {
            assert_eq!(draw.len(), 4);
            assert_eq!(draw.iter().filter(|&place| pool.contains(place)).count(), 2);
        }
        // Each object of the pool is in as many memories.
        for place in pool {
            assert_eq!(mixed.iter().filter(|draw| draw.contains(&place)).count(), 2);
        }
    }
}
