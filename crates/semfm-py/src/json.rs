//! Reports and settings: JSON on our side, dicts and lists on Python's.

use std::collections::BTreeMap;
use std::path::PathBuf;

use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use semfm::geom::io;
use serde_json::Value;

use crate::errors;
use crate::interruptible::run;

/// A dict, a list or a number from whatever can be written as JSON.
pub fn to_python<'py>(
    py: Python<'py>,
    value: &impl serde::Serialize,
) -> PyResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(value).map_err(|e| errors::internal(py, &e.to_string()))?;
    py.import("json")?.call_method1("loads", (text,))
}

/// A dict of text.
pub fn text_entries<'py>(
    py: Python<'py>,
    entries: &BTreeMap<String, String>,
) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    for (key, value) in entries {
        dict.set_item(key, value)?;
    }
    Ok(dict)
}

/// JSON from dicts, lists, strings and finite numbers.
pub fn from_python(value: &Bound<'_, PyAny>, name: &str) -> PyResult<Value> {
    let py = value.py();
    let options = PyDict::new(py);
    options.set_item("allow_nan", false)?;
    let text = py.import("json")?.call_method("dumps", (value,), Some(&options));
    let text: String = text
        .map_err(|_| errors::wrong_type(name, "dicts, lists, text and finite numbers", value))?
        .extract()?;
    serde_json::from_str(&text).map_err(|error| errors::internal(py, &error.to_string()))
}

/// Writes named arrays as an .npz file, whole or not at all.
pub fn write_npz(py: Python<'_>, path: PathBuf, arrays: &Bound<'_, PyDict>) -> PyResult<()> {
    let buffer = py.import("io")?.getattr("BytesIO")?.call0()?;
    py.import("numpy")?.call_method("savez", (&buffer,), Some(arrays))?;
    let bytes: Vec<u8> = buffer.call_method0("getvalue")?.extract()?;
    run(py, None, move |_| {
        io::refuse_input(&path)?;
        Ok(io::write_atomically(&path, |out| out.write_all(&bytes))?)
    })
}

/// The named arrays of an .npz file.
pub fn read_npz<'py, const N: usize>(
    py: Python<'py>,
    path: &std::path::Path,
    names: [&str; N],
) -> PyResult<[Bound<'py, PyAny>; N]> {
    let path_of = path.to_owned();
    let bytes = run(py, None, move |_| Ok(io::read_file(&path_of)?))?;
    let place = path.display().to_string();
    let not_ours = |expected: &str, found: &str| errors::format(py, &place, expected, found);
    let foreign = io::foreign_kind(&bytes).filter(|kind| !kind.contains("ZIP"));
    if let Some(kind) = foreign {
        return Err(not_ours("an .npz file", kind));
    }
    let content = py.import("io")?.getattr("BytesIO")?.call1((PyBytes::new(py, &bytes),))?;
    let file = py.import("numpy")?.call_method1("load", (content,)); // without pickles
    let file = file.map_err(|error| not_ours("an .npz file", &error.value(py).to_string()))?;
    if !file.hasattr("files")? {
        return Err(not_ours("an .npz file", "a single array"));
    }
    let mut arrays = Vec::with_capacity(N);
    for name in names {
        let missing = |_| not_ours(&format!("an .npz file with `{name}`"), "none");
        arrays.push(file.get_item(name).map_err(missing)?);
    }
    arrays.try_into().map_err(|_| errors::internal(py, "arrays of an .npz file"))
}

/// Writes bytes to a file, whole or not at all.
///
/// Parameters
/// ----------
/// path : path
/// content : bytes
#[pyfunction]
pub fn write_file(py: Python<'_>, path: PathBuf, content: &Bound<'_, PyBytes>) -> PyResult<()> {
    let content = content.as_bytes();
    let written = py.detach(|| io::write_atomically(&path, |out| out.write_all(content)));
    written.map_err(|error| errors::raise(py, &error.into()))
}

/// Reads a regular file whole; a device, a pipe, a folder or a stand-in of Git LFS is refused.
///
/// Parameters
/// ----------
/// path : path
///
/// Returns
/// -------
/// bytes
#[pyfunction]
pub fn read_file(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyBytes>> {
    let bytes = py.detach(|| io::read_file(&path));
    let bytes = bytes.map_err(|error| errors::raise(py, &error.into()))?;
    Ok(PyBytes::new(py, &bytes))
}

/// Refuses an output that would replace one of the inputs, or that cannot be written as a file.
///
/// Parameters
/// ----------
/// output : path
/// inputs : list of path
#[pyfunction]
pub fn check_output(py: Python<'_>, output: PathBuf, inputs: Vec<PathBuf>) -> PyResult<()> {
    let inputs: Vec<&std::path::Path> = inputs.iter().map(PathBuf::as_path).collect();
    let outputs = [output];
    let checked =
        io::refuse_to_overwrite(&outputs, &inputs).and_then(|()| io::check_output(&outputs[0]));
    checked.map_err(|error| errors::raise(py, &error.into()))
}

/// The text without what a terminal would obey (escape sequences of others).
///
/// Parameters
/// ----------
/// text : str
///
/// Returns
/// -------
/// str
#[pyfunction]
pub fn printable(text: &str) -> std::borrow::Cow<'_, str> {
    io::printable(text)
}
