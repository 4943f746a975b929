//! Pictures inside the page: JPEG bytes as data URIs, so that the page needs no other file.

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
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
    Some(format!("data:image/jpeg;base64,{}", BASE64_STANDARD.encode(&bytes)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_survives_and_a_wrong_size_is_none() {
        let rgb = [200, 40, 40].repeat(16 * 8);
        let uri = jpeg(&rgb, 16, 8).unwrap();
        assert!(uri.starts_with("data:image/jpeg;base64,/9j/"), "{uri}");
        assert_eq!(jpeg(&rgb, 16, 9), None);
        assert_eq!(jpeg(&[], 0, 0), None);
    }
}
