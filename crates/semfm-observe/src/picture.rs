//! PNG, JPEG and EXR files as pixels.

use std::io::Cursor;
use std::path::Path;

use image::{DynamicImage, ImageDecoder, ImageError, ImageReader, Limits};
use semfm_geom::io::{FormatError, foreign_kind, read_file};

use crate::Result;
use crate::exr_picture::{ExrPicture, is_exr};

/// Bytes that a colour profile or a text beside the pixels may unpack to, and those that the pixels may.
const MOST_BESIDE: u64 = 16 << 20;
const MOST_PIXEL_BYTES: u64 = 1 << 30;

/// Reads a picture.
///
/// # Errors
/// [`semfm_geom::Error::Io`]; [`Error::Format`](crate::Error::Format) where it is none, or where it unpacks to more
/// than a gigabyte, an EXR to more than 256 MB.
pub(crate) fn read_picture(path: &Path) -> Result<DynamicImage> {
    picture_in(path, &read_file(path)?)
}

/// The same of the bytes of a file.
pub(crate) fn picture_in(path: &Path, bytes: &[u8]) -> Result<DynamicImage> {
    if is_exr(bytes) {
        return Ok(ExrPicture::read(path, bytes)?.color()?.into());
    }
    let expected = "a PNG, JPEG or EXR";
    picture_of(bytes).map_err(|found| FormatError::new(path, "picture", expected, found).into())
}

/// A picture out of the bytes of a PNG or JPEG; what they are instead, in words, where they are none.
pub(crate) fn picture_of(bytes: &[u8]) -> std::result::Result<DynamicImage, String> {
    decode(bytes).map_err(|error| {
        let is_ours = matches!(error, ImageError::Decoding(_) | ImageError::Limits(_));
        let kind = foreign_kind(bytes).filter(|_| !is_ours);
        kind.map_or_else(|| error.to_string(), Into::into)
    })
}

fn decode(bytes: &[u8]) -> std::result::Result<DynamicImage, ImageError> {
    let mut reader =
        ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(ImageError::IoError)?;
    // A colour profile unpacks while the decoder is made, pixels when they are asked for.
    reader.limits(at_most(MOST_BESIDE));
    let mut decoder = reader.into_decoder()?;
    let mut limits = at_most(MOST_PIXEL_BYTES);
    limits.reserve(decoder.total_bytes())?;
    decoder.set_limits(limits)?;
    DynamicImage::from_decoder(decoder)
}

fn at_most(bytes: u64) -> Limits {
    let mut limits = Limits::default();
    limits.max_alloc = Some(bytes);
    limits
}
