//! Per-vertex features from a NumPy file (`.npy`).

use std::path::Path;

use npyz::{NpyFile, Order};
use semfm_geom::Mesh;
use semfm_geom::io::{FormatError, foreign_kind, read_file};

use crate::Result;

/// Reads an array (n × d) of 32- or 64-bit floats, one row per vertex of `mesh`, in either order.
/// Returns the values row-major.
///
/// # Errors
/// [`semfm_geom::Error::Io`] where the file cannot be read; [`Error::Format`](crate::Error::Format)
/// for another shape or type, missing values or values that are not finite.
pub fn read_vertex_features(path: &Path, mesh: &Mesh) -> Result<Vec<f32>> {
    let bytes = read_file(path)?;
    let array = open(path, &bytes)?;
    let by_columns = array.order() == Order::Fortran;
    let n = mesh.n_vertices();
    let d = dimension(path, array.shape(), n, bytes.len())?;
    let values = floats(path, &bytes)?.map_err(|error| {
        FormatError::new(path, "data", format!("{n} × {d} values"), error.to_string())
    })?;
    if let Some(at) = values.iter().position(|x| !x.is_finite()) {
        let (row, column) = if by_columns { (at % n, at / n) } else { (at / d, at % d) };
        let place = format!("row {row}, column {column}");
        return Err(FormatError::new(path, place, "a finite number", values[at].to_string()).into());
    }
    if !by_columns {
        return Ok(values);
    }
    Ok((0..n * d).map(|i| values[(i % d) * n + i / d]).collect())
}

fn open<'a>(path: &Path, bytes: &'a [u8]) -> Result<NpyFile<&'a [u8]>> {
    NpyFile::new(bytes).map_err(|error| {
        let found = foreign_kind(bytes).map_or_else(|| error.to_string(), Into::into);
        FormatError::new(path, "header", "a NumPy array", found).into()
    })
}

/// The number d of features for each of `n` vertices, if the shape is (n, d) and the file of
/// `n_bytes` can hold it.
fn dimension(path: &Path, shape: &[u64], n: usize, n_bytes: usize) -> Result<usize> {
    let found = shape.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
    let found = format!("({found})");
    let n = n as u64;
    if shape.len() != 2 || shape[0] != n || shape[1] == 0 {
        let expected = format!("({n}, d), one row per vertex");
        return Err(FormatError::new(path, "shape", expected, found).into());
    }
    if shape[1].checked_mul(n).is_none_or(|count| count > n_bytes as u64) {
        let expected = format!("no more values than the file's {n_bytes} bytes");
        return Err(FormatError::new(path, "shape", expected, found).into());
    }
    Ok(shape[1] as usize)
}

/// The values in the order of the file; the inner error is one of the data.
fn floats(path: &Path, bytes: &[u8]) -> Result<std::io::Result<Vec<f32>>> {
    if let Ok(values) = open(path, bytes)?.data::<f32>() {
        return Ok(values.collect());
    }
    let array = open(path, bytes)?;
    let kind = array.dtype().descr();
    match array.data::<f64>() {
        Ok(values) => Ok(values.map(|value| value.map(|x| x as f32)).collect()),
        Err(_) => Err(FormatError::new(path, "dtype", "float32 or float64", kind).into()),
    }
}
