//! Damage to files: what a bad cable, a bad program or a bad intention does to bytes.

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Numbers that readers trip over, as text.
const WORDS: [&str; 16] = [
    "0",
    "-1",
    "1e300",
    "-1e-300",
    "nan",
    "inf",
    "1e12",
    "4294967295",
    "4294967296",
    "2147483648",
    "18446744073709551616",
    "0.0",
    "null",
    "[]",
    "{}",
    "\"\"",
];

/// The same as four little-endian bytes.
const NUMBERS: [u32; 8] =
    [0, 1, u32::MAX, i32::MAX as u32, 1 << 31, 0x7f80_0000, 0x7fc0_0000, 0x0001_0000];

/// Longest input.
const MAX_BYTES: usize = 1 << 20;

/// Input number `round` of a reader: one of its seeds, damaged. The same number gives the same bytes.
///
/// # Panics
/// Without a seed.
pub fn mutated(seeds: &[Vec<u8>], reader: &str, round: u64) -> Vec<u8> {
    let mut seed = [0; 32];
    seed[..8].copy_from_slice(&round.to_le_bytes());
    seed[8..].iter_mut().zip(reader.bytes()).for_each(|(to, from)| *to = from);
    let mut rng = ChaCha8Rng::from_seed(seed);
    let mut bytes = seeds[rng.random_range(0..seeds.len())].clone();
    for _ in 0..1 + rng.random_range(0..4u32) {
        damage(&mut bytes, seeds, &mut rng);
    }
    bytes.truncate(MAX_BYTES);
    bytes
}

fn damage(bytes: &mut Vec<u8>, seeds: &[Vec<u8>], rng: &mut ChaCha8Rng) {
    if bytes.is_empty() {
        bytes.push(rng.next_u32() as u8);
    }
    let at = rng.random_range(0..bytes.len());
    let end = (at + 1 + rng.random_range(0..32usize)).min(bytes.len());
    match rng.random_range(0..9u32) {
        // Cut short, a piece taken out, a piece many times.
        0 => bytes.truncate(at),
        1 => drop(bytes.drain(at..end)),
        2 => {
            let times = 1 << rng.random_range(1..10u32);
            let piece = bytes[at..end].repeat(times);
            bytes.splice(at..at, piece);
        }
        3 => bytes[at] = rng.next_u32() as u8,
        4 => bytes[at] ^= 1 << rng.random_range(0..8u32),
        5 => {
            let number = NUMBERS[rng.random_range(0..NUMBERS.len())];
            let number = if rng.random() { number.to_le_bytes() } else { number.to_be_bytes() };
            bytes.iter_mut().skip(at).zip(number).for_each(|(to, from)| *to = from);
        }
        // A number in the text becomes another one.
        6 | 7 => {
            let is_number = |b: &u8| b.is_ascii_digit() || b"+-.eE".contains(b);
            let start = (at..bytes.len()).find(|&i| bytes[i].is_ascii_digit()).unwrap_or(at);
            let length = bytes[start..].iter().take_while(|b| is_number(b)).count();
            let word = WORDS[rng.random_range(0..WORDS.len())];
            bytes.splice(start..start + length, word.bytes());
        }
        // The end of another file.
        _ => {
            let other = &seeds[rng.random_range(0..seeds.len())];
            let from = rng.random_range(0..=other.len());
            bytes.truncate(at);
            bytes.extend(&other[from..]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_names_its_bytes_and_most_of_them_differ() {
        let seeds = [b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n".to_vec()];
        let inputs: std::collections::HashSet<Vec<u8>> =
            (0..200).map(|round| mutated(&seeds, "obj", round)).collect();
        assert!(inputs.len() > 150, "{}", inputs.len());
        assert_eq!(mutated(&seeds, "obj", 7), mutated(&seeds, "obj", 7));
        assert_ne!(mutated(&seeds, "obj", 7), mutated(&seeds, "ply", 7));
    }
}
