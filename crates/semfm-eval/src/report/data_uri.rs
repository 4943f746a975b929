//! Pictures inside the page: JPEG bytes as data URIs, so that the page needs no other file.

use image::codecs::jpeg::JpegEncoder;
use image::{ExtendedColorType, ImageEncoder};

/// Shaded surfaces on white show no blocks at this quality, and take a third of a PNG's bytes.
const QUALITY: u8 = 84;

/// An RGB picture (height × width × 3) as a `data:` URI; none where the sizes disagree.
pub(super) fn jpeg(rgb: &[u8], width: u32, height: u32) -> Option<String> {
    if rgb.is_empty() || rgb.len() != width as usize * height as usize * 3 {
        return None;
    }
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, QUALITY)
        .write_image(rgb, width, height, ExtendedColorType::Rgb8)
        .ok()?;
    Some(format!("data:image/jpeg;base64,{}", base64(&bytes)))
}

/// RFC 4648, padded.
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let group = [0, 1, 2].map(|i| u32::from(chunk.get(i).copied().unwrap_or(0)));
        let bits = group[0] << 16 | group[1] << 8 | group[2];
        for digit in 0..4 {
            let known = digit <= chunk.len();
            let value = (bits >> (18 - 6 * digit)) as usize & 63;
            text.push(if known { char::from(DIGITS[value]) } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_that_of_the_rfc() {
        // The test vectors of RFC 4648, section 10.
        let vectors =
            [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")];
        for (bytes, text) in vectors {
            assert_eq!(base64(bytes.as_bytes()), text);
        }
        assert_eq!(base64(&[0xfb, 0xff, 0xfe]), "+//+");
    }

    #[test]
    fn a_picture_survives_and_a_wrong_size_is_none() {
        let rgb = [200, 40, 40].repeat(16 * 8);
        let uri = jpeg(&rgb, 16, 8).unwrap();
        assert!(uri.starts_with("data:image/jpeg;base64,/9j/"), "{uri}");
        assert_eq!(jpeg(&rgb, 16, 9), None);
        assert_eq!(jpeg(&[], 0, 0), None);
    }
}
