//! The intrinsics of a camera (`K.json`), as calibration tools and ROS write them.

use std::path::Path;

use semfm_align::DepthImage;
use semfm_geom::io::{FormatError, read_json};
use semfm_geom::math::DAffine3;
use semfm_geom::{Intrinsics, Pinhole};
use serde::Deserialize;
use serde_json::Value;

use crate::Result;
use crate::distortion::Distortion;

/// A camera as a calibration has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration {
    /// The camera without its lens, in its own frame.
    pub camera: Pinhole,
    /// What the lens adds; `None` for a pinhole.
    pub distortion: Option<Distortion>,
}

/// Reads the calibration of a camera whose pictures have `width` × `height` pixels: `{"fx", "fy", "cx", "cy"}` (or
/// librealsense's `ppx` and `ppy`), or `{"K": …}` (`cam_K`, `camera_matrix`) with a 3 × 3 matrix or its nine
/// numbers row by row, or these bare. In the file, pixel centres have whole coordinates, as
/// calibration tools count ([`Pinhole::with_pixel_centres_at_integers`]). Where it has `width` and
/// `height`, they must be the picture's. Coefficients of distortion are understood in OpenCV's order (`D`, `dist_coeffs`,
/// `distortion_coefficients`, `coeffs`) or by name (`k1` … `p2`), of the models `plumb_bob`, `rational_polynomial` and
/// `equidistant`, as ROS, OpenCV, COLMAP and librealsense call them.
///
/// # Errors
/// [`Error::Geom`](crate::Error::Geom) where the file cannot be read or is not JSON,
/// [`Error::Format`](crate::Error::Format) with the field at fault: distortion of another model among them, since a
/// pixel's ray would be wrong by as much as the lens bends it.
pub fn read_calibration(path: &Path, width: u32, height: u32) -> Result<Calibration> {
    let value: Value = read_json(path)?;
    calibration_of(path, &value, width, height)
}

/// Reads intrinsics as [`read_calibration`] does, for a picture that is without distortion already.
///
/// # Errors
/// As [`read_calibration`], and [`Error::Format`](crate::Error::Format) for coefficients of distortion that are not 0.
pub fn read_intrinsics(path: &Path, image: &DepthImage) -> Result<Pinhole> {
    let value: Value = read_json(path)?;
    if let Some((field, coefficient)) = distortion(&value) {
        let expected = "no distortion: undistort the image first (OpenCV's undistort, ROS's \
                        image_proc) and give the intrinsics of what comes out";
        return Err(FormatError::new(path, field, expected, coefficient.to_string()).into());
    }
    Ok(calibration_of(path, &value, image.width() as u32, image.height() as u32)?.camera)
}

/// A calibration out of JSON; `path` is for messages.
pub(crate) fn calibration_of(
    path: &Path,
    value: &Value,
    width: u32,
    height: u32,
) -> Result<Calibration> {
    for (field, has) in [("width", width), ("height", height)] {
        let found = value.get(field).filter(|found| found.as_f64() != Some(f64::from(has)));
        if let Some(found) = found {
            let expected = format!("{has}, as the picture");
            return Err(FormatError::new(path, field, expected, found.to_string()).into());
        }
    }
    let matrix = ["K", "k", "cam_K", "camera_matrix"].iter().find_map(|name| value.get(name));
    let matrix = matrix.map(|matrix| matrix.get("data").unwrap_or(matrix));
    let [fx, fy, cx, cy] = match matrix {
        Some(matrix) => from_matrix(path, matrix)?,
        None if value.is_array() => from_matrix(path, value)?,
        None => {
            let has = |name: &str| value.get(name).is_some();
            let centre = if has("ppx") && has("ppy") { ["ppx", "ppy"] } else { ["cx", "cy"] };
            [
                number(path, value, "fx")?,
                number(path, value, "fy")?,
                number(path, value, centre[0])?,
                number(path, value, centre[1])?,
            ]
        }
    };
    let intrinsics = Intrinsics { width, height, fx, fy, cx, cy };
    let camera = Pinhole::with_pixel_centres_at_integers(intrinsics, DAffine3::IDENTITY);
    let camera = camera.map_err(|error| match error {
        semfm_geom::Error::OutOfRange { what, expected, found } => {
            FormatError::new(path, what.trim_start_matches("camera: "), expected, found).into()
        }
        other => crate::Error::from(other),
    })?;
    Ok(Calibration { camera, distortion: lens_of(path, value)? })
}

/// The lens that a calibration describes; an error where it describes one that is not known.
fn lens_of(path: &Path, value: &Value) -> Result<Option<Distortion>> {
    let model =
        ["distortion_model", "camera_model", "model"].iter().find_map(|name| value.get(name));
    let model = model.and_then(Value::as_str).unwrap_or("").to_ascii_lowercase();
    let is_fisheye = ["equidistant", "fisheye", "kannala"].iter().any(|name| model.contains(name));
    let Some((field, coefficient)) = distortion(value) else {
        // A fisheye lens bends rays with coefficients of 0, too.
        return if is_fisheye { Ok(Some(Distortion::equidistant(&[0.0; 4])?)) } else { Ok(None) };
    };
    let fault = |found: String| {
        let expected = "distortion of the model plumb_bob, rational_polynomial or equidistant, in OpenCV's \
                        order; undistort the pictures first (OpenCV's undistort, ROS's image_proc) and give \
                        the intrinsics of what comes out";
        crate::Error::from(FormatError::new(path, field, expected, found))
    };
    let is_foreign = ["inverse", "ftheta", "thin_prism"].iter().any(|name| model.contains(name));
    if is_foreign || model == "fov" {
        return Err(fault(format!("the model `{model}`")));
    }
    let listed = value.as_object().and_then(|fields| {
        fields.iter().find(|(name, _)| is_coefficient_list(name)).map(|(_, list)| list)
    });
    let named = ["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"];
    let coefficients: Vec<f64> = match listed.map(|list| list.get("data").unwrap_or(list)) {
        Some(list) => Vec::deserialize(list).map_err(|error| fault(error.to_string()))?,
        None if is_fisheye && named.contains(&field) && value.get(field).is_some() => {
            let others = ["p1", "p2", "k5", "k6"].into_iter().find_map(|name| {
                let value = value.get(name).and_then(not_zero)?;
                Some(format!("{name} = {value}, which a fisheye lens does not have"))
            });
            if let Some(found) = others {
                return Err(fault(found));
            }
            ["k1", "k2", "k3", "k4"].iter().map(|n| value[*n].as_f64().unwrap_or(0.0)).collect()
        }
        None if named.contains(&field) && value.get(field).is_some() => {
            named.iter().map(|name| value[*name].as_f64().unwrap_or(0.0)).collect()
        }
        None => return Err(fault(coefficient.to_string())),
    };
    let lens = if is_fisheye {
        // librealsense lists five, the last of them 0.
        let (known, further) = coefficients.split_at(coefficients.len().min(4));
        let is_plain = further.iter().all(|&x| x == 0.0);
        Distortion::equidistant(if is_plain { known } else { &coefficients }).map(Some)
    } else {
        Distortion::brown(&coefficients)
    };
    lens.map_err(|error| fault(error.to_string()))
}

fn is_coefficient_list(name: &str) -> bool {
    let name = name.to_ascii_lowercase();
    matches!(name.as_str(), "d" | "dist" | "coeffs" | "coefficients" | "distortion")
        || name.starts_with("dist_coef")
        || name.starts_with("distcoef")
        || name == "distortion_coefficients"
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

    #[test]
    fn lenses_are_read_in_the_words_of_others() {
        let read = |text: &str| {
            let value = serde_json::from_str(text).unwrap();
            calibration_of(Path::new("K.json"), &value, 2, 1)
        };
        let lens = Distortion::brown(&[0.1, -0.2, 0.001, 0.002, 0.05]).unwrap();
        for rest in [
            r#""D": [0.1, -0.2, 0.001, 0.002, 0.05], "distortion_model": "plumb_bob""#,
            r#""dist_coeffs": [0.1, -0.2, 0.001, 0.002, 0.05]"#,
            r#""k1": 0.1, "k2": -0.2, "p1": 0.001, "p2": 0.002, "k3": 0.05"#,
            r#""distortion_coefficients": {"rows": 1, "cols": 5, "data": [0.1, -0.2, 0.001, 0.002, 0.05]}"#,
        ] {
            let text = format!("{{\"fx\": 500, \"fy\": 510, \"ppx\": 1, \"ppy\": 0, {rest}}}");
            assert_eq!(read(&text).unwrap().distortion, lens, "{text}");
        }
        let k = r#""cam_K": [500, 0, 0.5, 0, 510, 0.25, 0, 0, 1]"#;
        let fisheye =
            read(&format!("{{{k}, \"distortion_model\": \"equidistant\", \"D\": [0,0,0,0]}}"));
        assert_eq!(fisheye.unwrap().distortion, Some(Distortion::equidistant(&[0.0; 4]).unwrap()));
        assert_eq!(read(&format!("{{{k}, \"depth_scale\": 1.0}}")).unwrap().distortion, None);
        for rest in [
            r#""D": [0.1, 0.2]"#,
            r#""coeffs": [0.1, 0, 0, 0, 0], "model": "distortion.inverse_brown_conrady""#,
            r#""lens": {"radial": [0.1]}"#,
            r#""model": "fisheye", "k1": 0.1, "k2": 0.0, "p1": 0.01, "p2": 0.0"#,
            r#""model": "fisheye", "lens": {"k1": 0.1}"#,
        ] {
            let error = read(&format!("{{{k}, {rest}}}")).unwrap_err().to_string();
            assert!(error.contains("undistort"), "{error}");
        }
    }
}
