//! Masks: pictures that are bright where something is.

use std::path::Path;

use semfm_geom::io::FormatError;

use super::picture::read_picture;
use crate::Result;

/// The picture that a mask belongs to: they must be of one size.
#[derive(Clone, Copy, Debug)]
pub struct MaskedPicture {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// What it is, for messages: "the depth image".
    pub name: &'static str,
}

/// Reads the mask of a picture (height × width, row-major): true where it is bright.
///
/// # Errors
/// [`Error::Format`](crate::Error::Format) for another size or a mask without a bright pixel.
pub fn read_mask(path: &Path, of: MaskedPicture) -> Result<Vec<bool>> {
    let mask = read_picture(path)?.into_luma8();
    let MaskedPicture { width, height, name } = of;
    let (mask_width, mask_height) = mask.dimensions();
    if (mask_width, mask_height) != (width, height) {
        let expected = format!("{width} × {height}, as {name}");
        let found = format!("{mask_width} × {mask_height}");
        return Err(FormatError::new(path, "size", expected, found).into());
    }
    let marked: Vec<bool> = mask.pixels().map(|pixel| pixel.0[0] >= 128).collect();
    if !marked.contains(&true) {
        let expected = "at least one bright pixel";
        return Err(FormatError::new(path, "pixels", expected, "a dark picture").into());
    }
    Ok(marked)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bright_pixels_are_marked_and_other_sizes_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        image::GrayImage::from_raw(2, 1, vec![255, 0]).unwrap().save(at("mask.png")).unwrap();
        image::GrayImage::new(3, 1).save(at("wide.png")).unwrap();
        image::RgbImage::new(2, 1).save(at("dark.png")).unwrap();
        let read = |name: &str| {
            read_mask(&at(name), MaskedPicture { width: 2, height: 1, name: "the depth image" })
        };
        assert_eq!(read("mask.png").unwrap(), [true, false]);
        assert!(read("wide.png").unwrap_err().to_string().contains("3 × 1"));
        assert!(read("dark.png").unwrap_err().to_string().contains("bright"));
    }
}
