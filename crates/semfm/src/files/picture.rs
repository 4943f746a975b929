//! PNG and JPEG files as pixels.

use std::io::Cursor;
use std::path::Path;

use image::{DynamicImage, ImageError, ImageReader};
use semfm_geom::io::{FormatError, foreign_kind, read_file};

use crate::Result;

/// Reads a picture.
///
/// # Errors
/// [`semfm_geom::Error::Io`]; [`Error::Format`](crate::Error::Format) where it is none.
pub(super) fn read_picture(path: &Path) -> Result<DynamicImage> {
    let bytes = read_file(path)?;
    let picture = ImageReader::new(Cursor::new(&bytes))
        .with_guessed_format()
        .map_err(ImageError::IoError)
        .and_then(ImageReader::decode);
    picture.map_err(|error| {
        let is_ours = matches!(error, ImageError::Decoding(_) | ImageError::Limits(_));
        let kind = foreign_kind(&bytes).filter(|_| !is_ours);
        let found = kind.map_or_else(|| error.to_string(), Into::into);
        FormatError::new(path, "picture", "a PNG or JPEG", found).into()
    })
}
