//! The parts of an observation out of arrays, dicts and paths.

use std::path::PathBuf;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use semfm::files::read_camera_pose;
use semfm::geom::math::DAffine3;
use semfm::observe::{Distortion, MaskFile, Numbers};

use crate::arrays_in::{self, Axis};
use crate::errors;
use crate::interruptible::guard;
use crate::pinhole::pose_of;

/// Rows and columns of pictures, where they are known.
pub type Size = Option<[usize; 2]>;

/// The axes of pictures of a size.
pub fn axes(size: Size) -> [Axis; 2] {
    match size {
        Some([height, width]) => [Axis::Is(height), Axis::Is(width)],
        None => [Axis::Any("height"), Axis::Any("width")],
    }
}

/// Pictures as they were given, of one size.
#[derive(Default)]
pub struct Pictures {
    pub size: Size,
    pub color: Option<Vec<[u8; 3]>>,
    pub depth: Option<Numbers>,
}

impl Pictures {
    pub fn of(
        size: Size,
        color: Option<&Bound<'_, PyAny>>,
        depth: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let mut found = Self { size, ..Self::default() };
        if let Some(depth) = depth {
            let (numbers, shape) = arrays_in::numbers(depth, "depth", &axes(size))?;
            found = Self { size: Some([shape[0], shape[1]]), depth: Some(numbers), ..found };
        }
        if let Some(color) = color {
            let [height, width] = axes(found.size);
            let (bytes, shape) = arrays_in::bytes(color, "color", &[height, width, Axis::Is(3)])?;
            found.size = Some([shape[0], shape[1]]);
            found.color = Some(bytes.as_chunks::<3>().0.to_vec());
        }
        Ok(found)
    }
}

/// Masks by name, out of a dict or a list.
pub fn masks_of(masks: &Bound<'_, PyAny>, size: [usize; 2]) -> PyResult<Vec<(String, Vec<bool>)>> {
    let named: Vec<(String, Bound<'_, PyAny>)> = match masks.cast::<PyDict>() {
        Ok(dict) => dict
            .iter()
            .map(|(name, mask)| {
                let words = "text as names of masks";
                let name = name.extract().map_err(|_| errors::wrong_type("masks", words, &name))?;
                Ok((name, mask))
            })
            .collect::<PyResult<_>>()?,
        Err(_) => {
            let list = masks.try_iter();
            let list = list.map_err(|_| errors::wrong_type("masks", "a dict or a list", masks))?;
            let number = |(i, mask): (usize, PyResult<_>)| Ok((i.to_string(), mask?));
            list.enumerate().map(number).collect::<PyResult<_>>()?
        }
    };
    let checked = |(name, mask): (String, Bound<'_, PyAny>)| {
        let marked = arrays_in::mask(&mask, &format!("mask `{name}`"), &axes(Some(size)))?.0;
        Ok((name, marked))
    };
    named.into_iter().map(checked).collect()
}

/// Refuses a scale that no depth is read with.
pub fn check_scale(py: Python<'_>, scale: Option<f64>, has_depth: bool) -> PyResult<()> {
    match scale {
        Some(_) if !has_depth => {
            Err(errors::invalid(py, "depth_scale", "`depth` beside it", "none"))
        }
        _ => Ok(()),
    }
}

/// The lens of these coefficients, of `plumb_bob` where no model is named; `None` where it bends nothing.
pub fn lens_of(
    py: Python<'_>,
    coefficients: Option<&Bound<'_, PyAny>>,
    model: Option<&str>,
) -> PyResult<Option<Distortion>> {
    let Some(coefficients) = coefficients else {
        return match model {
            Some(_) => {
                Err(errors::invalid(py, "distortion_model", "`distortion` beside it", "none"))
            }
            None => Ok(None),
        };
    };
    let (numbers, _) = arrays_in::floats(coefficients, "distortion", &[Axis::Any("c")])?;
    match model.unwrap_or("plumb_bob") {
        "plumb_bob" | "rational_polynomial" => guard(py, || Ok(Distortion::brown(&numbers)?)),
        "equidistant" => guard(py, || Ok(Some(Distortion::equidistant(&numbers)?))),
        other => {
            let expected = "'plumb_bob', 'rational_polynomial' or 'equidistant'";
            Err(errors::invalid(py, "distortion_model", expected, &format!("{other:?}")))
        }
    }
}

/// The files of masks that an argument names: one, several, or several by name.
pub fn mask_files(masks: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<MaskFile>> {
    let Some(masks) = masks else { return Ok(Vec::new()) };
    let file = |path: &Bound<'_, PyAny>| -> PyResult<MaskFile> {
        let wanted = "a path, paths, or a dict of paths by name";
        let path: PathBuf = path.extract().map_err(|_| errors::wrong_type("mask", wanted, path))?;
        Ok(match path.to_str() {
            Some(text) => MaskFile::parse(text),
            None => MaskFile { path, label: None, called: None },
        })
    };
    if let Ok(dict) = masks.cast::<PyDict>() {
        let named = dict.iter().map(|(name, path)| {
            let wanted = "text as names of masks";
            let name: String =
                name.extract().map_err(|_| errors::wrong_type("mask", wanted, &name))?;
            Ok(file(&path)?.named(name))
        });
        return named.collect();
    }
    if masks.extract::<PathBuf>().is_ok() {
        return Ok(vec![file(masks)?]);
    }
    let list = masks.try_iter();
    let list = list.map_err(|_| errors::wrong_type("mask", "a path or paths", masks))?;
    list.map(|path| file(&path?)).collect()
}

/// The pose of a camera: a matrix, or a file of one.
pub fn given_pose(value: &Bound<'_, PyAny>) -> PyResult<DAffine3> {
    match value.extract::<PathBuf>() {
        Ok(path) => guard(value.py(), || read_camera_pose(&path)),
        Err(_) => pose_of(Some(value)),
    }
}
