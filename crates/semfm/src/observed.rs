//! What a camera saw, from its files: depth images, intrinsics, masks.

use std::path::Path;

use image::DynamicImage;
use semfm_align::DepthImage;
use semfm_geom::io::{FormatError, read_json};
use semfm_geom::math::DAffine3;
use semfm_geom::{Intrinsics, Pinhole};
use serde::Deserialize;
use serde_json::Value;

use crate::Result;

/// Reads a depth image: a 16-bit grey PNG, `per_metre` units to the metre (1000 where it counts
/// millimetres), 0 where nothing came back.
///
/// # Errors
/// [`crate::Error::Format`] for a picture of another kind or without any depth;
/// [`crate::Error::Invalid`] for a scale that is not positive.
pub fn read_depth(path: &Path, per_metre: f64) -> Result<DepthImage> {
    if !(per_metre > 0.0 && per_metre.is_finite()) {
        let expected = "a positive number of units per metre";
        return Err(crate::Error::invalid("depth scale", expected, per_metre.to_string()));
    }
    let picture = picture(path)?;
    let DynamicImage::ImageLuma16(picture) = picture else {
        let expected = "16-bit grey pixels";
        return Err(FormatError::new(
            path,
            "pixel format",
            expected,
            format!("{:?}", picture.color()),
        )
        .into());
    };
    let (width, height) = picture.dimensions();
    let depth = picture.pixels().map(|p| (f64::from(p.0[0]) / per_metre) as f32).collect();
    DepthImage::new(width as usize, height as usize, depth).map_err(|error| within(path, error))
}

/// Reads a mask of the same size as a depth image, row-major: true where it is bright.
///
/// # Errors
/// [`crate::Error::Format`] for another size or a mask without a bright pixel.
pub fn read_mask(path: &Path, image: &DepthImage) -> Result<Vec<bool>> {
    let picture = picture(path)?.into_luma8();
    let (width, height) = picture.dimensions();
    if (width as usize, height as usize) != (image.width(), image.height()) {
        let expected = format!("{} × {}, as the depth image", image.width(), image.height());
        return Err(FormatError::new(path, "size", expected, format!("{width} × {height}")).into());
    }
    let mask: Vec<bool> = picture.pixels().map(|pixel| pixel.0[0] >= 128).collect();
    if !mask.contains(&true) {
        let expected = "at least one bright pixel";
        return Err(FormatError::new(path, "pixels", expected, "a dark picture").into());
    }
    Ok(mask)
}

/// Reads intrinsics: `{"fx", "fy", "cx", "cy"}`, or `{"K": …}` with a 3 × 3 matrix or its nine
/// numbers row by row, or these bare. In the file, pixel centres have whole coordinates, as
/// calibration tools count ([`Pinhole::with_pixel_centres_at_integers`]). Where it has `width` and
/// `height`, they must be the image's.
///
/// # Errors
/// [`crate::Error::Format`] with the field at fault.
pub fn read_intrinsics(path: &Path, image: &DepthImage) -> Result<Pinhole> {
    let value: Value = read_json(path)?;
    for (field, has) in [("width", image.width()), ("height", image.height())] {
        if let Some(told) = value.get(field).filter(|told| told.as_f64() != Some(has as f64)) {
            let expected = format!("{has}, as the depth image");
            return Err(FormatError::new(path, field, expected, told.to_string()).into());
        }
    }
    let [fx, fy, cx, cy] = match value.get("K").or_else(|| value.get("k")) {
        Some(matrix) => from_matrix(path, matrix)?,
        None if value.is_array() => from_matrix(path, &value)?,
        None => {
            let number = |field: &str| {
                value.get(field).and_then(Value::as_f64).ok_or_else(|| {
                    let found = value.get(field).map_or("nothing".into(), Value::to_string);
                    FormatError::new(path, field, "a number of pixels (or a matrix `K`)", found)
                })
            };
            let [fx, fy, cx, cy] = ["fx", "fy", "cx", "cy"].map(number);
            [fx?, fy?, cx?, cy?]
        }
    };
    let (width, height) = (image.width() as u32, image.height() as u32);
    let intrinsics = Intrinsics { width, height, fx, fy, cx, cy };
    Pinhole::with_pixel_centres_at_integers(intrinsics, DAffine3::IDENTITY).map_err(|error| {
        match error {
            semfm_geom::Error::OutOfRange { what, expected, found } => {
                let place = what.trim_start_matches("camera: ");
                FormatError::new(path, place, expected, found).into()
            }
            other => other.into(),
        }
    })
}

/// fx, fy, cx, cy.
fn from_matrix(path: &Path, value: &Value) -> Result<[f64; 4]> {
    let flat = <[f64; 9]>::deserialize(value).ok();
    let square = || <[[f64; 3]; 3]>::deserialize(value).ok().map(|rows| rows.concat());
    let Some(k) = flat.map(Vec::from).or_else(square) else {
        let expected = "a 3 × 3 matrix or nine numbers";
        let found: String = value.to_string().chars().take(60).collect();
        return Err(FormatError::new(path, "K", expected, found).into());
    };
    let rest = [k[1], k[3], k[6], k[7], k[8] - 1.0];
    if rest.iter().any(|&x| x != 0.0) {
        let expected = "fx 0 cx, 0 fy cy, 0 0 1";
        return Err(FormatError::new(path, "K", expected, format!("{k:?}")).into());
    }
    Ok([k[0], k[4], k[2], k[5]])
}

fn picture(path: &Path) -> Result<DynamicImage> {
    let io = |source| semfm_geom::Error::Io { path: path.to_owned(), source };
    let reader = image::ImageReader::open(path).map_err(io)?.with_guessed_format().map_err(io)?;
    let picture = reader
        .decode()
        .map_err(|error| FormatError::new(path, "picture", "a PNG or JPEG", error.to_string()))?;
    Ok(picture)
}

/// An error about the contents, with the file's name.
fn within(path: &Path, error: semfm_align::Error) -> crate::Error {
    match error {
        semfm_align::Error::OutOfRange { what, expected, found } => {
            FormatError::new(path, what, expected, found).into()
        }
        other => other.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image() -> DepthImage {
        DepthImage::new(2, 1, vec![0.5, 0.25]).unwrap()
    }

    fn intrinsics(text: &str) -> Result<Pinhole> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("K.json");
        std::fs::write(&path, text).unwrap();
        read_intrinsics(&path, &image())
    }

    #[test]
    fn every_way_to_write_intrinsics_is_the_same_camera() {
        let same = Intrinsics { width: 2, height: 1, fx: 500.0, fy: 510.0, cx: 0.5, cy: 0.25 };
        let same = Pinhole::with_pixel_centres_at_integers(same, DAffine3::IDENTITY).unwrap();
        for text in [
            r#"{"fx": 500, "fy": 510, "cx": 0.5, "cy": 0.25, "width": 2, "height": 1}"#,
            r#"{"K": [[500, 0, 0.5], [0, 510, 0.25], [0, 0, 1]]}"#,
            r#"{"k": [500, 0, 0.5, 0, 510, 0.25, 0, 0, 1]}"#,
            "[500, 0, 0.5, 0, 510, 0.25, 0, 0, 1]",
        ] {
            assert_eq!(intrinsics(text).unwrap(), same, "{text}");
        }
        for (text, place) in [
            (r#"{"fx": 500, "fy": 510, "cx": 0.5}"#, "cy"),
            (r#"{"fx": "a", "fy": 510, "cx": 0.5, "cy": 0}"#, "fx"),
            (r#"{"fx": 0, "fy": 510, "cx": 0.5, "cy": 0}"#, "fx"),
            (r#"{"K": [500, 0, 0.5], "width": 2}"#, "K"),
            (r#"{"K": [500, 7, 0.5, 0, 510, 0.25, 0, 0, 1]}"#, "K"),
            (r#"{"K": [500, 0, 0.5, 0, 510, 0.25, 0, 0, 1], "width": 640}"#, "width"),
            ("{", "line 1"),
        ] {
            let error = intrinsics(text).unwrap_err();
            assert_eq!(error.place().as_deref(), Some(place), "{text}: {error}");
        }
    }

    #[test]
    fn depth_is_counted_in_units_and_other_pictures_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let depth = image::ImageBuffer::<image::Luma<u16>, _>::from_raw(2, 1, vec![500u16, 250]);
        depth.unwrap().save(at("depth.png")).unwrap();
        assert_eq!(read_depth(&at("depth.png"), 1000.0).unwrap(), image());
        assert!(read_depth(&at("depth.png"), 0.0).is_err());
        image::ImageBuffer::<image::Luma<u16>, Vec<u16>>::new(3, 1).save(at("none.png")).unwrap();
        image::RgbImage::new(2, 1).save(at("rgb.png")).unwrap();
        image::GrayImage::from_raw(2, 1, vec![255, 0]).unwrap().save(at("mask.png")).unwrap();
        std::fs::write(at("text.png"), "hello").unwrap();
        let words = |error: crate::Error| error.to_string();
        assert!(words(read_depth(&at("none.png"), 1000.0).unwrap_err()).contains("3 pixels"));
        assert!(words(read_depth(&at("rgb.png"), 1000.0).unwrap_err()).contains("Rgb8"));
        assert!(words(read_depth(&at("text.png"), 1000.0).unwrap_err()).contains("text.png"));
        assert!(words(read_depth(&at("gone.png"), 1000.0).unwrap_err()).contains("gone.png"));
        assert_eq!(read_mask(&at("mask.png"), &image()).unwrap(), [true, false]);
        assert!(words(read_mask(&at("none.png"), &image()).unwrap_err()).contains("3 × 1"));
        assert!(words(read_mask(&at("rgb.png"), &image()).unwrap_err()).contains("bright"));
    }
}
