//! Masks: pictures that are bright, or opaque, where something is.

use std::path::Path;

use image::DynamicImage;
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

/// A pixel is marked from this value on.
const MARKED: u8 = 128;

/// Reads the mask of a picture (height × width, row-major): true where it is opaque, if its alpha
/// channel is not the same everywhere, else where it is bright. Half of the range is enough for both.
///
/// # Errors
/// [`Error::Format`](crate::Error::Format) for another size and for a mask that marks nothing or
/// everything, which tells the object from nothing.
pub fn read_mask(path: &Path, of: MaskedPicture) -> Result<Vec<bool>> {
    let picture = read_picture(path)?;
    let MaskedPicture { width, height, name } = of;
    let [mask_width, mask_height] = [picture.width(), picture.height()];
    if (mask_width, mask_height) != (width, height) {
        let expected = format!("{width} × {height}, as {name}");
        let found = format!("{mask_width} × {mask_height}");
        return Err(FormatError::new(path, "size", expected, found).into());
    }
    let (values, marking) = match alpha(&picture) {
        Some(alpha) => (alpha, "opaque"),
        None => (picture.into_luma8().into_raw(), "bright"),
    };
    let marked: Vec<bool> = values.iter().map(|&value| value >= MARKED).collect();
    let n = marked.iter().filter(|&&marked| marked).count();
    let wrong = |expected: String, found: String| {
        Err(FormatError::new(path, "pixels", expected, found).into())
    };
    if n == 0 {
        let most = values.iter().max().copied().unwrap_or_default();
        let expected = format!("at least one {marking} pixel ({MARKED} and more of 255)");
        return wrong(expected, format!("{most} at most: nothing is marked"));
    }
    if n == marked.len() {
        let expected = format!("a mask that is {marking} on the object only");
        let found = "every pixel marked (leave the mask away if the picture shows nothing else)";
        return wrong(expected, found.into());
    }
    Ok(marked)
}

/// The alpha channel, where there is one that tells anything: opaque all over, it was only carried
/// along.
fn alpha(picture: &DynamicImage) -> Option<Vec<u8>> {
    if !picture.color().has_alpha() {
        return None;
    }
    let alpha: Vec<u8> = picture.to_rgba8().pixels().map(|pixel| pixel.0[3]).collect();
    alpha.iter().any(|&a| a < u8::MAX).then_some(alpha)
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

    #[test]
    fn an_alpha_channel_marks_the_object_whatever_the_colours_are() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let read = |name: &str, pixels: [[u8; 4]; 3]| {
            let pixels = pixels.concat();
            image::RgbaImage::from_raw(3, 1, pixels).unwrap().save(at(name)).unwrap();
            read_mask(&at(name), MaskedPicture { width: 3, height: 1, name: "the view" })
        };
        let [white, black, clear] = [[255; 4], [0, 0, 0, 255], [255, 255, 255, 0]];
        assert_eq!(read("cut.png", [white, clear, clear]).unwrap(), [true, false, false]);
        assert_eq!(read("dark.png", [black, clear, black]).unwrap(), [true, false, true]);
        // Opaque all over: the brightness tells.
        assert_eq!(read("grey.png", [black, white, black]).unwrap(), [false, true, false]);
        for (name, pixels, word) in [
            ("none.png", [clear; 3], "nothing is marked"),
            ("all.png", [white; 3], "every pixel marked"),
            ("black.png", [black; 3], "nothing is marked"),
        ] {
            let error = read(name, pixels).unwrap_err().to_string();
            assert!(error.contains(word) && error.contains(name), "{error}");
        }
        // Grey with alpha, sixteen bits.
        let image = image::ImageBuffer::<image::LumaA<u16>, _>::from_raw(
            3,
            1,
            vec![9u16, 65535, 9, 0, 9, 40000],
        );
        image.unwrap().save(at("deep.png")).unwrap();
        let of = MaskedPicture { width: 3, height: 1, name: "the view" };
        assert_eq!(read_mask(&at("deep.png"), of).unwrap(), [true, false, true]);
    }
}
