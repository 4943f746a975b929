//! The intrinsics of a camera (`K.json`), as calibration tools and ROS write them.

use std::path::Path;

use semfm_align::DepthImage;
use semfm_geom::io::{FormatError, read_json};
use semfm_geom::math::DAffine3;
use semfm_geom::{Intrinsics, Pinhole};
use serde::Deserialize;
use serde_json::Value;

use crate::Result;

/// Reads intrinsics: `{"fx", "fy", "cx", "cy"}`, or `{"K": …}` with a 3 × 3 matrix or its nine
/// numbers row by row, or these bare. In the file, pixel centres have whole coordinates, as
/// calibration tools count ([`Pinhole::with_pixel_centres_at_integers`]). Where it has `width` and
/// `height`, they must be the image's. Coefficients of distortion (`D`, `coeffs`, `k1`, …) must be 0: a
/// pinhole has none, and a pixel's ray would be wrong by as much as they bend it.
///
/// # Errors
/// [`Error::Geom`](crate::Error::Geom) where the file cannot be read or is not JSON,
/// [`Error::Format`](crate::Error::Format) with the field at fault.
pub fn read_intrinsics(path: &Path, image: &DepthImage) -> Result<Pinhole> {
    let value: Value = read_json(path)?;
    for (field, has) in [("width", image.width()), ("height", image.height())] {
        if let Some(found) = value.get(field).filter(|found| found.as_f64() != Some(has as f64)) {
            let expected = format!("{has}, as the depth image");
            return Err(FormatError::new(path, field, expected, found.to_string()).into());
        }
    }
    if let Some((field, coefficient)) = distortion(&value) {
        let expected = "no distortion: undistort the image first (OpenCV's undistort, ROS's \
                        image_proc) and give the intrinsics of what comes out";
        return Err(FormatError::new(path, field, expected, coefficient.to_string()).into());
    }
    let [fx, fy, cx, cy] = match value.get("K").or_else(|| value.get("k")) {
        Some(matrix) => from_matrix(path, matrix)?,
        None if value.is_array() => from_matrix(path, &value)?,
        None => [
            number(path, &value, "fx")?,
            number(path, &value, "fy")?,
            number(path, &value, "cx")?,
            number(path, &value, "cy")?,
        ],
    };
    let (width, height) = (image.width() as u32, image.height() as u32);
    let intrinsics = Intrinsics { width, height, fx, fy, cx, cy };
    Pinhole::with_pixel_centres_at_integers(intrinsics, DAffine3::IDENTITY).map_err(|error| {
        match error {
            semfm_geom::Error::OutOfRange { what, expected, found } => {
                FormatError::new(path, what.trim_start_matches("camera: "), expected, found).into()
            }
            other => other.into(),
        }
    })
}

/// The first field that holds coefficients of distortion, and the first of them that is not 0: as ROS
/// (`D`), librealsense (`coeffs`), OpenCV (`distortion_coefficients`, `dist_coeffs`), COLMAP and
/// nerfstudio (`k1` … `p2`) name them, at any depth.
fn distortion(value: &Value) -> Option<(&str, f64)> {
    match value {
        Value::Object(fields) => fields.iter().find_map(|(name, field)| {
            let coefficient = is_distortion(name).then(|| not_zero(field)).flatten();
            coefficient.map(|x| (name.as_str(), x)).or_else(|| distortion(field))
        }),
        _ => None,
    }
}

fn is_distortion(name: &str) -> bool {
    let name = name.to_ascii_lowercase();
    let numbered = |letter: char, most: char| {
        let mut rest = name.strip_prefix(letter).unwrap_or_default().chars();
        rest.next().is_some_and(|digit| ('1'..=most).contains(&digit)) && rest.next().is_none()
    };
    name == "d"
        || name == "dist"
        || name.starts_with("dist_")
        || name.starts_with("distcoef")
        || name.contains("distortion")
        || name == "coeffs"
        || name == "coefficients"
        || name == "radial"
        || name == "tangential"
        || numbered('k', '6')
        || numbered('p', '2')
        || numbered('s', '4')
}

/// The first number in it that is not 0. `rows` and `cols` of an OpenCV matrix are no coefficients.
fn not_zero(value: &Value) -> Option<f64> {
    match value {
        Value::Number(number) => number.as_f64().filter(|&x| x != 0.0),
        Value::Array(items) => items.iter().find_map(not_zero),
        Value::Object(fields) => match fields.get("data") {
            Some(data) => not_zero(data),
            None => fields.values().find_map(not_zero),
        },
        _ => None,
    }
}

fn number(path: &Path, value: &Value, field: &str) -> Result<f64> {
    value.get(field).and_then(Value::as_f64).ok_or_else(|| {
        let found = value.get(field).map_or("nothing".into(), Value::to_string);
        FormatError::new(path, field, "a number of pixels (or a matrix `K`)", found).into()
    })
}

/// fx, fy, cx, cy.
fn from_matrix(path: &Path, value: &Value) -> Result<[f64; 4]> {
    let flat = <[f64; 9]>::deserialize(value).ok();
    let rows = <[[f64; 3]; 3]>::deserialize(value).ok();
    let Some(k) = flat.map(Vec::from).or_else(|| rows.map(|rows| rows.concat())) else {
        let found: String = value.to_string().chars().take(60).collect();
        return Err(FormatError::new(path, "K", "a 3 × 3 matrix or nine numbers", found).into());
    };
    let rest = [k[1], k[3], k[6], k[7], k[8] - 1.0];
    if rest.iter().any(|&x| x != 0.0) {
        let expected = "fx 0 cx, 0 fy cy, 0 0 1";
        return Err(FormatError::new(path, "K", expected, format!("{k:?}")).into());
    }
    Ok([k[0], k[4], k[2], k[5]])
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
            r#"{"k": [500, 0, 0.5, 0, 510, 0.25, 0, 0, 1], "d": [0, 0.0, 0, 0, 0],
                "distortion_model": "plumb_bob"}"#,
            r#"{"fx": 500, "fy": 510, "cx": 0.5, "cy": 0.25, "k1": 0, "p2": 0.0,
                "distortion": {"rows": 1, "cols": 5, "data": [0, 0, 0, 0, 0]}}"#,
        ] {
            assert_eq!(intrinsics(text).unwrap(), same, "{text}");
        }
        for (text, place) in [
            (r#"{"fx": 500, "fy": 510, "cx": 0.5}"#, "cy"),
            (r#"{"fx": "a", "fy": 510, "cx": 0.5, "cy": 0}"#, "fx"),
            (r#"{"fx": 0, "fy": 510, "cx": 0.5, "cy": 0}"#, "fx"),
            (r#"{"K": [500, 0, 0.5], "width": 2}"#, "K"),
            (r#"{"fx": 500, "fy": 510, "cx": 0.5, "cy": 0, "D": [0, 0, 1e-3, 0, 0]}"#, "D"),
            (r#"{"fx": 500, "fy": 510, "cx": 0.5, "cy": 0, "k1": -0.1}"#, "k1"),
            (r#"{"fx": 500, "fy": 510, "cx": 0.5, "cy": 0, "coeffs": [0.1, 0]}"#, "coeffs"),
            (
                r#"{"K": [500, 0, 0.5, 0, 510, 0, 0, 0, 1],
                    "distortion_coefficients": {"rows": 1, "cols": 2, "data": [0, 0.2]}}"#,
                "distortion_coefficients",
            ),
            (r#"{"K": [500, 7, 0.5, 0, 510, 0.25, 0, 0, 1]}"#, "K"),
            (r#"{"K": [500, 0, 0.5, 0, 510, 0.25, 0, 0, 1], "width": 640}"#, "width"),
            ("{", "line 1"),
        ] {
            let error = intrinsics(text).unwrap_err();
            assert_eq!(error.place().as_deref(), Some(place), "{text}: {error}");
        }
    }
}
