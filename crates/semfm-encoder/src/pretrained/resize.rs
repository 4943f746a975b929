//! Pictures of another size, to the last bit as Pillow makes them.
//!
//! Encoders were trained on what Pillow gave them, and `semfm-embed` uses it, too. It filters the
//! columns of each line and then the lines, with the filter widened where the picture shrinks, in
//! fixed-point numbers, and rounds to bytes in between (`src/libImaging/Resample.c`; Pillow 13 takes the
//! lines first where a picture gets wider and lower, which a square that stays one never does).

use std::f64::consts::PI;

use super::token_network::Picture;

/// Bits behind the point of a weight: eight of the byte and two against overflow leave 22 of 32.
const PRECISION: u32 = 32 - 8 - 2;

/// How pixels are weighed; the names are Pillow's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Filter {
    /// A triangle of width 2.
    Bilinear,
    /// Keys' cubic convolution with a = −1/2 (1981), of width 4.
    #[cfg_attr(not(feature = "siglip"), allow(dead_code))]
    Bicubic,
    /// A windowed sinc of width 6.
    #[cfg_attr(not(feature = "siglip"), allow(dead_code))]
    Lanczos,
}

impl Filter {
    /// Half of its width.
    fn support(self) -> f64 {
        match self {
            Self::Bilinear => 1.0,
            Self::Bicubic => 2.0,
            Self::Lanczos => 3.0,
        }
    }

    fn at(self, x: f64) -> f64 {
        let x = x.abs();
        if x >= self.support() {
            return 0.0;
        }
        match self {
            Self::Bilinear => 1.0 - x,
            Self::Bicubic if x < 1.0 => (1.5 * x - 2.5) * x * x + 1.0,
            Self::Bicubic => (((x - 5.0) * x + 8.0) * x - 4.0) * -0.5,
            Self::Lanczos => sinc(x) * sinc(x / 3.0),
        }
    }
}

fn sinc(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { (PI * x).sin() / (PI * x) }
}

/// The picture at another size; itself where that is its own.
pub(crate) fn resized(picture: &Picture, height: usize, width: usize, filter: Filter) -> Picture {
    let mut resized = picture.clone();
    if width != picture.width {
        let weights = weights(picture.width, width, filter);
        let lines = resized.rgb.chunks_exact(picture.width);
        resized.rgb =
            lines.flat_map(|line| weights.iter().map(|w| w.sum(|place| line[place]))).collect();
        resized.width = width;
    }
    if height != picture.height {
        let weights = weights(picture.height, height, filter);
        let rgb = &resized.rgb;
        resized.rgb = weights
            .iter()
            .flat_map(|w| (0..width).map(|column| w.sum(|line| rgb[line * width + column])))
            .collect();
        resized.height = height;
    }
    resized
}

/// The weights of the pixels that make one of the new ones.
struct Weights {
    first: usize,
    weights: Vec<i32>,
}

impl Weights {
    /// The sum over the pixels that stand at the places, rounded.
    fn sum(&self, pixel: impl Fn(usize) -> [u8; 3]) -> [u8; 3] {
        let mut sums = [1i32 << (PRECISION - 1); 3];
        for (number, &weight) in self.weights.iter().enumerate() {
            let pixel = pixel(self.first + number);
            sums.iter_mut().zip(pixel).for_each(|(sum, byte)| *sum += i32::from(byte) * weight);
        }
        sums.map(|sum| (sum >> PRECISION).clamp(0, 255) as u8)
    }
}

/// The weights of each of `new` pixels in a row of `old` ones.
fn weights(old: usize, new: usize, filter: Filter) -> Vec<Weights> {
    let scale = old as f64 / new as f64;
    let (widening, narrowing) = (scale.max(1.0), scale.max(1.0).recip());
    let support = filter.support() * widening;
    let of_pixel = |number: usize| {
        let centre = (number as f64 + 0.5) * scale;
        let first = (centre - support + 0.5).max(0.0) as usize;
        let end = ((centre + support + 0.5) as usize).min(old);
        let at = |place: usize| filter.at((place as f64 - centre + 0.5) * narrowing);
        let weights: Vec<f64> = (first..end).map(at).collect();
        let sum: f64 = weights.iter().sum();
        let fixed = |weight: f64| {
            let weight = if sum == 0.0 { weight } else { weight / sum };
            // Rounds half away from zero, as the cast does behind ± 1/2.
            (weight * f64::from(1 << PRECISION) + 0.5f64.copysign(weight)) as i32
        };
        Weights { first, weights: weights.into_iter().map(fixed).collect() }
    };
    (0..new).map(of_pixel).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(height: usize, width: usize) -> Picture {
        let rgb = (0..height * width)
            .map(|i| [(i * 37 % 256) as u8, (i * i % 251) as u8, 255 * (i % 3 == 0) as u8])
            .collect();
        Picture { height, width, rgb }
    }

    /// FNV-1a over the bytes.
    fn digest(picture: &Picture) -> u64 {
        let bytes = picture.rgb.as_flattened().iter();
        bytes.fold(0xcbf2_9ce4_8422_2325, |digest: u64, &byte| {
            (digest ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        })
    }

    /// Digests of what Pillow 13.0.0 makes:
    /// `Image.fromarray(picture).resize((width, height), Image.Resampling.BICUBIC)`.
    #[test]
    fn pictures_are_those_of_pillow() {
        use Filter::{Bicubic, Bilinear, Lanczos};
        for (height, width, filter, expected) in [
            (32, 48, Bilinear, 0xfabd_7e20_7013_5f69),
            (16, 16, Bilinear, 0xcbd0_13c9_a221_82a0),
            (64, 31, Bicubic, 0x775a_a4b8_1212_83e8),
            (12, 20, Bicubic, 0x2c23_312e_995e_6776),
            (31, 20, Lanczos, 0xace4_7301_c073_af7f),
            (70, 45, Lanczos, 0xb0f3_46e7_0d19_a2c6),
        ] {
            let found = digest(&resized(&picture(31, 45), height, width, filter));
            assert_eq!(found, expected, "{height} × {width}, {filter:?}");
        }
    }

    #[test]
    fn a_picture_of_the_right_size_stays() {
        let picture = picture(9, 5);
        assert_eq!(resized(&picture, 9, 5, Filter::Lanczos), picture);
    }
}
