//! Depth images.

use std::path::Path;

use image::DynamicImage;
use semfm_align::DepthImage;
use semfm_geom::io::FormatError;

use super::picture::read_picture;
use crate::{Error, Result};

/// Reads a depth image: a 16-bit grey PNG, `per_metre` units to the metre (1000 where it counts
/// millimetres), 0 where nothing came back.
///
/// # Errors
/// [`Error::Format`] for a picture of another kind or without any depth; [`Error::Invalid`] for a
/// scale that is not positive.
pub fn read_depth_image(path: &Path, per_metre: f64) -> Result<DepthImage> {
    if !(per_metre > 0.0 && per_metre.is_finite()) {
        let expected = "a positive number of units per metre";
        return Err(Error::invalid("depth scale", expected, per_metre.to_string()));
    }
    let picture = read_picture(path)?;
    let DynamicImage::ImageLuma16(picture) = picture else {
        let found = format!("{:?}", picture.color());
        return Err(FormatError::new(path, "pixel format", "16-bit grey pixels", found).into());
    };
    let (width, height) = picture.dimensions();
    let depth = picture.pixels().map(|p| (f64::from(p.0[0]) / per_metre) as f32).collect();
    DepthImage::new(width as usize, height as usize, depth).map_err(|error| match error {
        semfm_align::Error::OutOfRange { what, expected, found } => {
            FormatError::new(path, what, expected, found).into()
        }
        other => other.into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_is_counted_in_units_and_other_pictures_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let depth = image::ImageBuffer::<image::Luma<u16>, _>::from_raw(2, 1, vec![500u16, 250]);
        depth.unwrap().save(at("depth.png")).unwrap();
        let image = DepthImage::new(2, 1, vec![0.5, 0.25]).unwrap();
        assert_eq!(read_depth_image(&at("depth.png"), 1000.0).unwrap(), image);
        assert!(read_depth_image(&at("depth.png"), 0.0).is_err());
        image::ImageBuffer::<image::Luma<u16>, Vec<u16>>::new(3, 1).save(at("none.png")).unwrap();
        image::RgbImage::new(2, 1).save(at("rgb.png")).unwrap();
        std::fs::write(at("text.png"), "hello").unwrap();
        let words = |name: &str| read_depth_image(&at(name), 1000.0).unwrap_err().to_string();
        assert!(words("none.png").contains("3 pixels"));
        assert!(words("rgb.png").contains("Rgb8"));
        assert!(words("text.png").contains("text.png"));
        assert!(words("gone.png").contains("gone.png"));
    }
}
