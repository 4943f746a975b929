//! Per-vertex features from a NumPy file (`.npy`).

use std::path::Path;

use semfm_geom::Mesh;
use semfm_geom::io::FormatError;
use semfm_observe::{Numbers, NumpyArray};

use crate::Result;

/// Reads an array (n × d) of 32- or 64-bit floats, one row per vertex of `mesh`, in either order.
/// Returns the values row-major.
///
/// # Errors
/// [`semfm_geom::Error::Io`] where the file cannot be read; [`Error::Format`](crate::Error::Format)
/// for another shape or type, missing values or values that are not finite.
pub fn read_vertex_features(path: &Path, mesh: &Mesh) -> Result<Vec<f32>> {
    let array = NumpyArray::read(path)?;
    let n = mesh.n_vertices();
    let d = match array.shape[..] {
        [rows, columns] if rows == n && columns > 0 => columns,
        _ => {
            let (expected, found) =
                (format!("({n}, d), one row per vertex"), array.shape_in_words());
            return Err(FormatError::new(path, "shape", expected, found).into());
        }
    };
    let found = match array.numbers {
        Numbers::F32(_) | Numbers::F64(_) => None,
        Numbers::Bool(_) => Some("truth values"),
        _ => Some("whole numbers"),
    };
    if let Some(found) = found {
        return Err(FormatError::new(path, "dtype", "float32 or float64", found).into());
    }
    let values = array.into_f32();
    if let Some(at) = values.iter().position(|x| !x.is_finite()) {
        let place = format!("row {}, column {}", at / d, at % d);
        return Err(FormatError::new(path, place, "a finite number", values[at].to_string()).into());
    }
    Ok(values)
}
