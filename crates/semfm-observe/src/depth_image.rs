//! Depth images.

use std::path::Path;

use image::DynamicImage;
use semfm_align::DepthImage;
use semfm_geom::io::{FormatError, read_file};

use crate::exr_picture::{ExrPicture, is_exr};
use crate::numpy_array::{Numbers, NumpyArray};
use crate::picture::picture_in;
use crate::{Error, Result};

/// What a sensor of 16 bits writes where nothing came back, beside 0.
pub(crate) const NO_RETURN: u16 = u16::MAX;

/// Units to the metre where nothing is said: depth in whole numbers counts millimetres.
const MILLIMETRES: f64 = 1000.0;

/// Reads a depth image: a grey PNG of 16 bits, an EXR, or a NumPy array (height, width) of whole numbers or floats.
/// `per_metre` is the number of its units to the metre; without it whole numbers count millimetres and floats metres.
/// Where nothing came back there is 0, in whole numbers also 65535, or a number that is not finite, in an EXR also 65504 in
/// floats of 16 bits, and 65504 m and more. Of an EXR with several channels the depth is the one of whose dotted name a part
/// is `depth` (in any case), else `Z`, else the only `*.Z` without an X or a Y beside it, else R, G and B of the only layer with
/// colours that are the same.
///
/// # Errors
/// [`Error::Format`] for a picture of another kind (depth in 8 bits, or in a JPEG, was thrown away when it was
/// written), or without any depth; [`Error::Invalid`] for a scale that is not positive.
pub fn read_depth_image(path: &Path, per_metre: Option<f64>) -> Result<DepthImage> {
    let image = read_depth_of_frame(path, per_metre)?;
    if image.has_depth() {
        return Ok(image);
    }
    let found = format!("{} pixels without", image.metres().len());
    Err(FormatError::new(path, "depth image", "at least one pixel with a depth", found).into())
}

/// As [`read_depth_image`], of one frame of many: there may be no depth in it.
pub(crate) fn read_depth_of_frame(path: &Path, per_metre: Option<f64>) -> Result<DepthImage> {
    check_scale(per_metre)?;
    let is_array = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("npy"));
    let (width, height, depth) =
        if is_array { from_array(path, per_metre)? } else { from_picture(path, per_metre)? };
    DepthImage::new(width, height, depth).map_err(|error| match error {
        semfm_align::Error::OutOfRange { what, expected, found } => {
            FormatError::new(path, what, expected, found).into()
        }
        other => other.into(),
    })
}

/// A depth image of an array's numbers (height × width), understood as [`read_depth_image`] does.
///
/// # Errors
/// [`Error::Invalid`] for truth values and for a scale that is not positive; [`Error::Align`] for another number of pixels.
pub fn depth_of_numbers(
    width: usize,
    height: usize,
    numbers: Numbers,
    per_metre: Option<f64>,
) -> Result<DepthImage> {
    check_scale(per_metre)?;
    let depth = metres_of_numbers(numbers, per_metre)
        .ok_or_else(|| Error::invalid("depth", "depths", "truth values"))?;
    Ok(DepthImage::new(width, height, depth)?)
}

fn check_scale(per_metre: Option<f64>) -> Result<()> {
    match per_metre.filter(|&scale| !(scale > 0.0 && scale.is_finite())) {
        Some(scale) => {
            let expected = "a positive number of units per metre";
            Err(Error::invalid("depth scale", expected, scale))
        }
        None => Ok(()),
    }
}

/// Metres of an array's numbers; `None` for truth values.
fn metres_of_numbers(numbers: Numbers, per_metre: Option<f64>) -> Option<Vec<f32>> {
    let of_floats = |value: f64| (value / per_metre.unwrap_or(1.0)) as f32;
    let of_whole = |value: i64| match value {
        value if value == i64::from(NO_RETURN) => 0.0,
        value => (value as f64 / per_metre.unwrap_or(MILLIMETRES)) as f32,
    };
    match numbers {
        Numbers::Whole(values) => Some(values.into_iter().map(of_whole).collect()),
        Numbers::F32(values) => Some(values.into_iter().map(|z| of_floats(z.into())).collect()),
        Numbers::F64(values) => Some(values.into_iter().map(of_floats).collect()),
        Numbers::Bool(_) => None,
    }
}

/// Metres of depths counted in 16 bits; 0 where nothing came back.
pub(crate) fn metres_of_16_bits(values: &[u16], per_metre: f64) -> Vec<f32> {
    let metres = |&value: &u16| match value {
        NO_RETURN => 0.0,
        value => (f64::from(value) / per_metre) as f32,
    };
    values.iter().map(metres).collect()
}

type Read = (usize, usize, Vec<f32>);

fn from_picture(path: &Path, per_metre: Option<f64>) -> Result<Read> {
    let bytes = read_file(path)?;
    if is_exr(&bytes) {
        return from_exr(path, &bytes, per_metre);
    }
    let picture = picture_in(path, &bytes)?;
    let DynamicImage::ImageLuma16(picture) = picture else {
        let found = match picture.color() {
            image::ColorType::L8 | image::ColorType::Rgb8 => {
                format!("{:?}: a picture of depth, which has lost its depths", picture.color())
            }
            other => format!("{other:?}"),
        };
        return Err(FormatError::new(path, "pixel format", "16-bit grey pixels", found).into());
    };
    let (width, height) = picture.dimensions();
    let depth = metres_of_16_bits(picture.as_raw(), per_metre.unwrap_or(MILLIMETRES));
    Ok((width as usize, height as usize, depth))
}

fn from_exr(path: &Path, bytes: &[u8], per_metre: Option<f64>) -> Result<Read> {
    let picture = ExrPicture::read(path, bytes)?;
    let depth = picture.depth()?;
    let scale = per_metre.unwrap_or(if depth.is_whole() { MILLIMETRES } else { 1.0 });
    Ok((picture.width, picture.height, depth.metres(scale)))
}

fn from_array(path: &Path, per_metre: Option<f64>) -> Result<Read> {
    let array = NumpyArray::read(path)?;
    let [height, width] = array.shape[..] else {
        let found = array.shape_in_words();
        return Err(FormatError::new(path, "shape", "(height, width)", found).into());
    };
    let depth = metres_of_numbers(array.numbers, per_metre)
        .ok_or_else(|| FormatError::new(path, "dtype", "depths", "truth values"))?;
    Ok((width, height, depth))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::npz::testing::npy;

    #[test]
    fn depth_is_counted_in_units_and_other_pictures_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let depth =
            image::ImageBuffer::<image::Luma<u16>, _>::from_raw(3, 1, vec![500u16, 250, 65535]);
        depth.unwrap().save(at("depth.png")).unwrap();
        let image = DepthImage::new(3, 1, vec![0.5, 0.25, 0.0]).unwrap();
        assert_eq!(read_depth_image(&at("depth.png"), None).unwrap(), image);
        assert_eq!(read_depth_image(&at("depth.png"), Some(1000.0)).unwrap(), image);
        assert!(read_depth_image(&at("depth.png"), Some(0.0)).is_err());
        image::ImageBuffer::<image::Luma<u16>, Vec<u16>>::new(3, 1).save(at("none.png")).unwrap();
        image::RgbImage::new(2, 1).save(at("rgb.png")).unwrap();
        std::fs::write(at("text.png"), "hello").unwrap();
        std::fs::write(at("lfs.png"), "version https://git-lfs.github.com/spec/v1\noid x").unwrap();
        let words = |name: &str| read_depth_image(&at(name), None).unwrap_err().to_string();
        assert!(words("none.png").contains("3 pixels"));
        assert!(words("rgb.png").contains("Rgb8") && words("rgb.png").contains("lost its depths"));
        assert!(words("text.png").contains("text.png"));
        assert!(words("gone.png").contains("gone.png"));
        assert!(words("lfs.png").contains("git lfs pull"));
    }

    #[test]
    fn arrays_of_floats_are_metres_and_those_of_whole_numbers_millimetres() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let image = DepthImage::new(2, 2, vec![0.5, 0.25, 0.0, 1.0]).unwrap();
        std::fs::write(at("m.npy"), npy(&[2, 2], &[0.5f32, 0.25, f32::NAN, 1.0])).unwrap();
        std::fs::write(at("mm.npy"), npy(&[2, 2], &[500u16, 250, 65535, 1000])).unwrap();
        assert_eq!(read_depth_image(&at("m.npy"), None).unwrap(), image);
        assert_eq!(read_depth_image(&at("mm.npy"), None).unwrap(), image);
        std::fs::write(at("cm.npy"), npy(&[2, 2], &[50.0f64, 25.0, f64::INFINITY, 100.0])).unwrap();
        assert_eq!(read_depth_image(&at("cm.npy"), Some(100.0)).unwrap(), image);
        std::fs::write(at("flat.npy"), npy(&[4], &[1.0f32; 4])).unwrap();
        let error = read_depth_image(&at("flat.npy"), None).unwrap_err().to_string();
        assert!(error.contains("(4)") && error.contains("(height, width)"), "{error}");
    }
}
