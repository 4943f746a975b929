//! Pictures in messages: `sensor_msgs/Image` and `CompressedImage`, as colour or as depth.

use image::DynamicImage;
use semfm_views::mcap::CdrReader;

use super::compressed_depth::{self, Depth, Fault};
use crate::depth_image::metres_of_16_bits;
use crate::picture::picture_of;

/// A colour picture.
#[derive(Debug, PartialEq)]
pub(super) struct Color {
    pub width: usize,
    pub height: usize,
    pub pixels: Vec<[u8; 3]>,
}

pub(super) const IMAGE: &str = "sensor_msgs/msg/Image";
pub(super) const COMPRESSED: &str = "sensor_msgs/msg/CompressedImage";

/// `sensor_msgs/Image` behind its header.
struct Raw<'a> {
    width: usize,
    height: usize,
    encoding: &'a str,
    is_big_endian: bool,
    step: usize,
    data: &'a [u8],
}

impl<'a> Raw<'a> {
    fn read(message: &'a [u8]) -> Option<Self> {
        let mut cdr = CdrReader::new(message)?;
        cdr.header()?;
        let (height, width) = (cdr.u32()? as usize, cdr.u32()? as usize);
        let encoding = cdr.string()?;
        let is_big_endian = cdr.u8()? != 0;
        Some(Self {
            width,
            height,
            encoding,
            is_big_endian,
            step: cdr.u32()? as usize,
            data: cdr.bytes()?,
        })
    }

    /// The rows, each of `bytes` bytes a pixel.
    fn rows(&self, bytes: usize) -> Result<impl Iterator<Item = &'a [u8]>, Fault> {
        let row = self.width.checked_mul(bytes);
        let whole = self.step.checked_mul(self.height.saturating_sub(1));
        let whole = whole.zip(row).and_then(|(rows, last)| rows.checked_add(last));
        match (row, whole) {
            (Some(row), Some(whole))
                if row > 0 && self.height > 0 && self.step >= row && self.data.len() >= whole =>
            {
                Ok(self.data.chunks(self.step).take(self.height).map(move |chunk| &chunk[..row]))
            }
            _ => {
                let Self { width, height, step, .. } = self;
                let expected =
                    format!("{width} × {height} pixels of {bytes} bytes in rows of {step} bytes");
                Err(Fault::new(expected, format!("{} bytes", self.data.len())))
            }
        }
    }
}

fn cut() -> Fault {
    Fault::new("the fields of this message in CDR", "fewer bytes, or another encoding")
}

/// The colour of a message.
pub(super) fn color(schema: &str, message: &[u8]) -> Result<Color, Fault> {
    if schema == COMPRESSED {
        let (format, data) = compressed(message)?;
        if format.contains("compressedDepth") {
            return Err(Fault::new("colour", format!("`{format}`")));
        }
        let picture = picture_of(data).map_err(|found| Fault::new("a PNG or JPEG", found))?;
        let picture = picture.into_rgb8();
        let (width, height) = picture.dimensions();
        let pixels = picture.pixels().map(|pixel| pixel.0).collect();
        return Ok(Color { width: width as usize, height: height as usize, pixels });
    }
    let raw = Raw::read(message).ok_or_else(cut)?;
    // Bytes a pixel, and which of them are red, green and blue.
    let (bytes, order) = match raw.encoding {
        "rgb8" => (3, [0, 1, 2]),
        "bgr8" | "8UC3" => (3, [2, 1, 0]),
        "rgba8" => (4, [0, 1, 2]),
        "bgra8" | "8UC4" => (4, [2, 1, 0]),
        "mono8" | "8UC1" => (1, [0, 0, 0]),
        other => {
            let expected =
                "rgb8, bgr8, rgba8, bgra8 or mono8 (image_proc turns Bayer and YUV into them)";
            return Err(Fault::new(expected, format!("`{other}`")));
        }
    };
    let pixels = raw.rows(bytes)?.flat_map(|row| row.chunks_exact(bytes));
    let pixels = pixels.map(|pixel| order.map(|channel| pixel[channel])).collect();
    Ok(Color { width: raw.width, height: raw.height, pixels })
}

/// The depth of a message, metres.
pub(super) fn depth(schema: &str, message: &[u8]) -> Result<Depth, Fault> {
    if schema == COMPRESSED {
        let (format, data) = compressed(message)?;
        if format.contains("compressedDepth") {
            return compressed_depth::decode(format, data);
        }
        let lossy = "depth of 16 bits: this transport compresses pictures for people; record the raw topic or \
                     compressedDepth";
        return match picture_of(data) {
            Ok(DynamicImage::ImageLuma16(picture)) => {
                let (width, height) = picture.dimensions();
                let metres = metres_of_16_bits(picture.as_raw(), 1000.0);
                Ok(Depth { width: width as usize, height: height as usize, metres })
            }
            Ok(other) => Err(Fault::new(lossy, format!("`{format}`, {:?}", other.color()))),
            Err(found) => Err(Fault::new(lossy, found)),
        };
    }
    let raw = Raw::read(message).ok_or_else(cut)?;
    let metres = match raw.encoding {
        "16UC1" | "mono16" => {
            let number = |b: &[u8]| match raw.is_big_endian {
                true => u16::from_be_bytes([b[0], b[1]]),
                false => u16::from_le_bytes([b[0], b[1]]),
            };
            let values: Vec<u16> =
                raw.rows(2)?.flat_map(|row| row.chunks_exact(2)).map(number).collect();
            metres_of_16_bits(&values, 1000.0)
        }
        "32FC1" => {
            let number = |b: &[u8]| match raw.is_big_endian {
                true => f32::from_be_bytes([b[0], b[1], b[2], b[3]]),
                false => f32::from_le_bytes([b[0], b[1], b[2], b[3]]),
            };
            raw.rows(4)?.flat_map(|row| row.chunks_exact(4)).map(number).collect()
        }
        other => {
            let expected = "depth as 16UC1 (millimetres) or 32FC1 (metres)";
            return Err(Fault::new(expected, format!("`{other}`")));
        }
    };
    Ok(Depth { width: raw.width, height: raw.height, metres })
}

/// `sensor_msgs/CompressedImage`: format and data.
fn compressed(message: &[u8]) -> Result<(&str, &[u8]), Fault> {
    let read = || {
        let mut cdr = CdrReader::new(message)?;
        cdr.header()?;
        Some((cdr.string()?, cdr.bytes()?))
    };
    read().ok_or_else(cut)
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_views::mcap::Cdr;

    fn raw(encoding: &str, width: u32, height: u32, step: u32, big: u8, data: &[u8]) -> Vec<u8> {
        let mut cdr = Cdr::new();
        cdr.header(1, "camera");
        cdr.u32(height);
        cdr.u32(width);
        cdr.string(encoding);
        cdr.u8(big);
        cdr.u32(step);
        cdr.byte_sequence(data);
        cdr.into_bytes()
    }

    #[test]
    fn rows_may_be_longer_than_their_pixels_and_channels_stand_in_any_order() {
        // Two rows of one pixel, a byte beside each.
        let data = [1, 2, 3, 99, 4, 5, 6, 99];
        let rgb = color(IMAGE, &raw("rgb8", 1, 2, 4, 0, &data)).unwrap();
        assert_eq!(rgb.pixels, [[1, 2, 3], [4, 5, 6]]);
        assert_eq!(color(IMAGE, &raw("bgr8", 1, 2, 4, 0, &data)).unwrap().pixels[1], [6, 5, 4]);
        assert_eq!(color(IMAGE, &raw("mono8", 2, 1, 2, 0, &data)).unwrap().pixels[1], [2; 3]);
        assert!(
            color(IMAGE, &raw("rgb8", 2, 2, 6, 0, &data)).unwrap_err().found.contains("8 bytes")
        );
        assert!(
            color(IMAGE, &raw("rgb8", 2, 1, 4, 0, &data)).is_err(),
            "rows shorter than their pixels"
        );
        assert!(
            color(IMAGE, &raw("bayer_rggb8", 1, 1, 1, 0, &data))
                .unwrap_err()
                .expected
                .contains("Bayer")
        );
        assert!(color(IMAGE, &[0, 1, 0, 0, 1]).is_err());
    }

    #[test]
    fn depth_is_read_in_both_units_and_byte_orders() {
        let millimetres = [0x01, 0xf4, 0xff, 0xff]; // 500 and 65535, big-endian
        let read = depth(IMAGE, &raw("16UC1", 2, 1, 4, 1, &millimetres)).unwrap();
        assert_eq!(read.metres, [0.5, 0.0]);
        let metres = [0.25f32.to_le_bytes(), f32::NAN.to_le_bytes()].concat();
        let read = depth(IMAGE, &raw("32FC1", 2, 1, 8, 0, &metres)).unwrap();
        assert!(read.metres[0] == 0.25 && read.metres[1].is_nan());
        assert!(
            depth(IMAGE, &raw("rgb8", 1, 1, 3, 0, &[1, 2, 3])).unwrap_err().found.contains("rgb8")
        );
    }

    #[test]
    fn a_depth_topic_of_the_lossy_transport_is_refused() {
        let mut jpeg = std::io::Cursor::new(Vec::new());
        image::GrayImage::new(8, 8).write_to(&mut jpeg, image::ImageFormat::Jpeg).unwrap();
        let mut cdr = Cdr::new();
        cdr.header(1, "camera");
        cdr.string("16UC1; jpeg compressed ");
        cdr.byte_sequence(jpeg.get_ref());
        let message = cdr.into_bytes();
        let fault = depth(COMPRESSED, &message).unwrap_err();
        assert!(
            fault.expected.contains("compressedDepth") && fault.found.contains("L8"),
            "{fault:?}"
        );
        assert_eq!(color(COMPRESSED, &message).unwrap().pixels.len(), 64);
    }
}
