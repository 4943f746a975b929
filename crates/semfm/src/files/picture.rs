//! PNG and JPEG files as pixels.

use std::path::Path;

use image::{DynamicImage, ImageReader};
use semfm_geom::io::FormatError;

use crate::Result;

/// Reads a picture.
///
/// # Errors
/// [`semfm_geom::Error::Io`]; [`Error::Format`](crate::Error::Format) where it is none.
pub(super) fn read_picture(path: &Path) -> Result<DynamicImage> {
    let io = |source| semfm_geom::Error::Io { path: path.to_owned(), source };
    let reader = ImageReader::open(path).map_err(io)?.with_guessed_format().map_err(io)?;
    reader.decode().map_err(|error| {
        FormatError::new(path, "picture", "a PNG or JPEG", error.to_string()).into()
    })
}
