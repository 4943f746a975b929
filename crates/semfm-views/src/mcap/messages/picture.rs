//! Pictures as Foxglove's CompressedImage, in PNG, there and back.

use std::io::Cursor;

use foxglove::messages::CompressedImage;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ColorType, ExtendedColorType, ImageEncoder, ImageFormat, ImageReader};

use super::super::decode::Mismatch;
use super::values::timestamp;
use crate::{Error, Result, View};

/// The picture of a view as a PNG in the frame `frame_id`, at `time` in nanoseconds.
///
/// # Errors
/// [`Error::Invalid`] where the picture does not have the size of its camera.
pub fn picture(frame_id: String, time: u64, view: &View) -> Result<CompressedImage> {
    let (width, height) = (view.camera.width(), view.camera.height());
    let mut png = Vec::new();
    PngEncoder::new_with_quality(&mut png, CompressionType::Fast, FilterType::Adaptive)
        .write_image(&view.rgb, width, height, ExtendedColorType::Rgb8)
        .map_err(|error| {
            let expected = format!("{width} × {height} pixels of three bytes");
            Error::invalid(format!("picture of {frame_id}"), expected, error.to_string())
        })?;
    Ok(CompressedImage {
        timestamp: Some(timestamp(time)),
        frame_id,
        data: png.into(),
        format: "png".to_owned(),
    })
}

/// sRGB bytes of a PNG that must have the given size; nothing larger is ever decoded.
pub(in super::super) fn decode_png(
    bytes: &[u8],
    size: (u32, u32),
) -> std::result::Result<Vec<u8>, Mismatch> {
    let expected = format!("a PNG of {} × {} pixels", size.0, size.1);
    let mut reader = ImageReader::with_format(Cursor::new(bytes), ImageFormat::Png);
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(size.0);
    limits.max_image_height = Some(size.1);
    reader.limits(limits);
    let image =
        reader.decode().map_err(|error| Mismatch::new(expected.clone(), error.to_string()))?;
    if (image.width(), image.height()) != size {
        let found = format!("{} × {}", image.width(), image.height());
        return Err(Mismatch::new(expected, found));
    }
    if image.color() != ColorType::Rgb8 {
        return Err(Mismatch::new("a PNG of 8-bit RGB", format!("{:?}", image.color())));
    }
    Ok(image.into_rgb8().into_raw())
}
