//! Depth of 16 bits as runs of zeros and differences in variable length (Wilson, *Fast Lossless Depth Image
//! Compression*, ISS 2017): four bits at a time from the top of each 32-bit word, the fourth of which says that more
//! follow.

/// The values, exactly `n` of them; `None` where the words say something else.
pub(super) fn decode(bytes: &[u8], n: usize) -> Option<Vec<u16>> {
    let mut nibbles = Nibbles { bytes, word: 0, left: 0 };
    let mut values = Vec::with_capacity(n);
    let mut previous = 0i32;
    while values.len() < n {
        let zeros = nibbles.number()? as usize;
        if zeros > n - values.len() {
            return None;
        }
        values.resize(values.len() + zeros, 0);
        let others = nibbles.number()? as usize;
        if others > n - values.len() {
            return None;
        }
        for _ in 0..others {
            // The sign stands in the lowest bit: 0, -1, 1, -2, …
            let folded = nibbles.number()?;
            let difference = (folded >> 1) as i32 ^ -((folded & 1) as i32);
            previous = previous.checked_add(difference)?;
            values.push(u16::try_from(previous).ok()?);
        }
    }
    Some(values)
}

struct Nibbles<'a> {
    bytes: &'a [u8],
    word: u32,
    left: u32,
}

impl Nibbles<'_> {
    /// A number of up to 32 bits, three to a nibble, the lowest first.
    fn number(&mut self) -> Option<u32> {
        let (mut value, mut shift) = (0u32, 0);
        loop {
            if self.left == 0 {
                let (word, rest) = self.bytes.split_first_chunk::<4>()?;
                (self.word, self.bytes, self.left) = (u32::from_le_bytes(*word), rest, 8);
            }
            let nibble = self.word >> 28;
            self.word <<= 4;
            self.left -= 1;
            if shift > 30 {
                return None;
            }
            value |= (nibble & 7) << shift;
            shift += 3;
            if nibble & 8 == 0 {
                return Some(value);
            }
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Values in the same form, for tests.
    pub(in crate::bag) fn encode(values: &[u16]) -> Vec<u8> {
        let mut nibbles: Vec<u32> = Vec::new();
        let mut put = |mut value: u32| loop {
            let more = value > 7;
            nibbles.push((value & 7) | if more { 8 } else { 0 });
            value >>= 3;
            if !more {
                break;
            }
        };
        let (mut at, mut previous) = (0, 0i32);
        while at < values.len() {
            let zeros = values[at..].iter().take_while(|&&v| v == 0).count();
            put(zeros as u32);
            at += zeros;
            let others = values[at..].iter().take_while(|&&v| v != 0).count();
            put(others as u32);
            for &value in &values[at..at + others] {
                let difference = i32::from(value) - previous;
                put(((difference << 1) ^ (difference >> 31)) as u32);
                previous = value.into();
            }
            at += others;
        }
        let word =
            |chunk: &[u32]| (0..8).fold(0, |w, i| w << 4 | chunk.get(i).copied().unwrap_or(0));
        nibbles.chunks(8).flat_map(|chunk| word(chunk).to_le_bytes()).collect()
    }

    #[test]
    fn words_worked_out_by_hand() {
        // 2 zeros; 2 others: 5 (folded 10 = 0b001_010: nibbles 1010 0001) and 4 (difference −1, folded 1).
        // Nibbles 2 2 a 1 1, filled with zeros.
        assert_eq!(decode(&0x22a1_1000u32.to_le_bytes(), 4), Some(vec![0, 0, 5, 4]));
        assert_eq!(encode(&[0, 0, 5, 4]), 0x22a1_1000u32.to_le_bytes());
    }

    #[test]
    fn every_image_comes_back_and_no_damage_is_believed() {
        let values: Vec<u16> =
            (0..5000u32).map(|i| if i % 7 < 2 { 0 } else { (i * i % 65_521) as u16 }).collect();
        let bytes = encode(&values);
        assert_eq!(decode(&bytes, values.len()), Some(values.clone()));
        assert_eq!(decode(&bytes[..bytes.len() - 4], values.len()), None);
        for at in 0..bytes.len() {
            let mut broken = bytes.clone();
            broken[at] ^= 0x80;
            assert!(decode(&broken, values.len()).is_none_or(|read| read.len() == values.len()));
        }
    }
}
