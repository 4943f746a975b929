//! `compressedDepth` of ROS (`compressed_depth_image_transport`, `compression_common.h` and `codec.cpp`): a header of
//! 12 bytes, then a PNG of 16 bits or RVL; depth in floats as quantised inverses.

use image::DynamicImage;

use super::rvl;
use crate::depth_image::metres_of_16_bits;
use crate::picture::picture_of;

/// The header: which form the depth has (not used by readers), and the two numbers of its quantisation.
const HEADER_BYTES: usize = 12;
/// Depth of 16 bits counts millimetres.
const PER_METRE: f64 = 1000.0;
/// No camera has more pixels than this: a run of zeros unpacks to any number of them.
const MAX_PIXELS: u64 = 1 << 25;

/// A depth image in metres.
#[derive(Debug, PartialEq)]
pub(super) struct Depth {
    pub width: usize,
    pub height: usize,
    pub metres: Vec<f32>,
}

/// What is wrong with a message: what should stand there and what does.
#[derive(Debug)]
pub(super) struct Fault {
    pub expected: String,
    pub found: String,
}

impl Fault {
    pub fn new(expected: impl Into<String>, found: impl Into<String>) -> Self {
        Self { expected: expected.into(), found: found.into() }
    }
}

/// Decodes the data of a message whose `format` is such as `16UC1; compressedDepth png` or `32FC1; compressedDepth rvl`.
pub(super) fn decode(format: &str, data: &[u8]) -> Result<Depth, Fault> {
    let encoding = format.split(';').next().unwrap_or("").trim();
    let is_inverse = match encoding {
        "32FC1" => true,
        "16UC1" | "mono16" => false,
        other => {
            return Err(Fault::new("depth as 16UC1 or 32FC1", format!("`{other}`")));
        }
    };
    let Some((header, packed)) = data.split_at_checked(HEADER_BYTES) else {
        let found = format!("{} bytes", data.len());
        return Err(Fault::new("a header of 12 bytes before the picture", found));
    };
    let is_rvl = format.to_ascii_lowercase().contains("rvl");
    let (width, height, values) = if is_rvl { rvl_values(packed)? } else { png_values(packed)? };
    let metres = if is_inverse {
        let number =
            |at: usize| f32::from_le_bytes(header[at..at + 4].try_into().expect("4 bytes"));
        let (a, b) = (f64::from(number(4)), f64::from(number(8)));
        // depth = a / (value − b); 0 is no return.
        let metres = |&value: &u16| match value {
            0 => 0.0,
            value => (a / (f64::from(value) - b)) as f32,
        };
        values.iter().map(metres).collect()
    } else {
        metres_of_16_bits(&values, PER_METRE)
    };
    Ok(Depth { width, height, metres })
}

type Values = (usize, usize, Vec<u16>);

fn png_values(packed: &[u8]) -> Result<Values, Fault> {
    match picture_of(packed) {
        Ok(DynamicImage::ImageLuma16(picture)) => {
            let (width, height) = picture.dimensions();
            Ok((width as usize, height as usize, picture.into_raw()))
        }
        Ok(other) => Err(Fault::new("a PNG of 16-bit grey pixels", format!("{:?}", other.color()))),
        Err(found) => Err(Fault::new("a PNG behind the header of 12 bytes", found)),
    }
}

/// Width and height as 32-bit numbers stand before the words.
fn rvl_values(packed: &[u8]) -> Result<Values, Fault> {
    let fault = |found: String| Fault::new("width, height and RVL's words", found);
    let Some((sides, words)) = packed.split_first_chunk::<8>() else {
        return Err(fault(format!("{} bytes", packed.len())));
    };
    let side = |at: usize| u32::from_le_bytes(sides[at..at + 4].try_into().expect("4 bytes"));
    let (width, height) = (side(0), side(4));
    if !(1..=MAX_PIXELS).contains(&(u64::from(width) * u64::from(height))) {
        return Err(fault(format!("{width} × {height} pixels")));
    }
    let n = width as usize * height as usize;
    let values = rvl::decode(words, n)
        .ok_or_else(|| fault("words that give another number of pixels".into()))?;
    Ok((width as usize, height as usize, values))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn png(values: &[u16], width: u32) -> Vec<u8> {
        let picture: image::ImageBuffer<image::Luma<u16>, _> =
            image::ImageBuffer::from_raw(width, values.len() as u32 / width, values.to_vec())
                .unwrap();
        let mut bytes = std::io::Cursor::new(Vec::new());
        DynamicImage::from(picture).write_to(&mut bytes, image::ImageFormat::Png).unwrap();
        bytes.into_inner()
    }

    fn message(a: f32, b: f32, packed: &[u8]) -> Vec<u8> {
        [&[0; 4], &a.to_le_bytes()[..], &b.to_le_bytes(), packed].concat()
    }

    #[test]
    fn whole_numbers_are_millimetres_in_png_and_rvl() {
        let values = [500, 0, 65535, 1234];
        let expected = Depth { width: 2, height: 2, metres: vec![0.5, 0.0, 0.0, 1.234] };
        let packed = message(0.0, 0.0, &png(&values, 2));
        assert_eq!(decode("16UC1; compressedDepth png", &packed).unwrap(), expected);
        assert_eq!(decode("16UC1; compressedDepth", &packed).unwrap(), expected, "older ROS");
        let words =
            [&2u32.to_le_bytes()[..], &2u32.to_le_bytes(), &rvl::tests::encode(&values)].concat();
        let packed = message(0.0, 0.0, &words);
        assert_eq!(decode("16UC1; compressedDepth rvl", &packed).unwrap(), expected);
    }

    #[test]
    fn floats_are_inverses() {
        // The transport's own numbers for depth_max 10 and depth_quantization 100:
        // a = 100 · 101, b = 1 − a / 10; value = a / depth + b.
        let (a, b) = (10_100.0f32, 1.0 - 1010.0f32);
        let value = |z: f32| (a / z + b).round() as u16;
        let packed = message(a, b, &png(&[value(1.0), value(2.5), 0, value(9.0)], 2));
        let read = decode("32FC1; compressedDepth png", &packed).unwrap();
        for (found, expected) in read.metres.iter().zip([1.0, 2.5, 0.0, 9.0]) {
            assert!((found - expected).abs() < 0.01 * expected.max(0.1), "{found} for {expected}");
        }
    }

    #[test]
    fn what_lost_its_depth_is_refused() {
        let mut bytes = std::io::Cursor::new(Vec::new());
        image::GrayImage::new(2, 2).write_to(&mut bytes, image::ImageFormat::Png).unwrap();
        let eight = decode("16UC1; compressedDepth png", &message(0.0, 0.0, bytes.get_ref()));
        assert!(eight.unwrap_err().found.contains("L8"));
        assert!(decode("8UC1; compressedDepth png", &[0; 40]).unwrap_err().found.contains("8UC1"));
        assert!(decode("16UC1; compressedDepth png", &[0; 3]).is_err());
        let huge = message(0.0, 0.0, &[255; 8]);
        assert!(decode("16UC1; compressedDepth rvl", &huge).unwrap_err().found.contains("pixels"));
    }
}
