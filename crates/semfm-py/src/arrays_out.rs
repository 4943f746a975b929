//! Numbers out: views into our own memory where something keeps it alive, moved vectors elsewhere.
#![allow(unsafe_code, reason = "NumPy is handed pointers; each view keeps its owner alive")]

use faer::MatRef;
use numpy::ndarray::{ArrayView1, ArrayView2, ShapeBuilder};
use numpy::{Element, PyArray1, PyArray2, PyArrayMethods};
use pyo3::PyClass;
use pyo3::prelude::*;
use pyo3::pyclass::boolean_struct::True;
use semfm::geom::math::{DAffine3, DVec3};

/// A read-only view (n) of numbers inside `owner`.
pub fn vector<'py, C: PyClass<Frozen = True> + Sync, T: Element>(
    owner: &Bound<'py, C>,
    pick: impl for<'a> FnOnce(&'a C) -> &'a [T],
) -> PyResult<Bound<'py, PyAny>> {
    let view = ArrayView1::from(pick(owner.get()));
    // SAFETY: `pick` borrows from the owner, which is frozen (nothing can change or move the
    // numbers) and becomes the array's base (so it outlives the array).
    let array = unsafe { PyArray1::borrow_from_array(&view, owner.clone().into_any()) };
    read_only(array.into_any())
}

/// A read-only view (n × width) of row-major numbers inside `owner`.
pub fn rows<'py, C: PyClass<Frozen = True> + Sync, T: Element>(
    owner: &Bound<'py, C>,
    width: usize,
    pick: impl for<'a> FnOnce(&'a C) -> &'a [T],
) -> PyResult<Bound<'py, PyAny>> {
    let array = vector(owner, pick)?;
    array.call_method1("reshape", (-1, width)) // a view of the view, as read-only as that
}

/// A read-only view of a dense matrix inside `owner`, columns apart as they lie.
pub fn matrix<'py, C: PyClass<Frozen = True> + Sync>(
    owner: &Bound<'py, C>,
    pick: impl for<'a> FnOnce(&'a C) -> MatRef<'a, f64>,
) -> PyResult<Bound<'py, PyAny>> {
    let matrix = pick(owner.get());
    let Ok(column_stride) = usize::try_from(matrix.col_stride()) else {
        return owned_matrix(owner.py(), matrix);
    };
    if matrix.row_stride() != 1 {
        return owned_matrix(owner.py(), matrix);
    }
    let shape = (matrix.nrows(), matrix.ncols()).strides((1, column_stride));
    // SAFETY: a faer matrix with row stride 1 holds nrows numbers at each multiple of its column
    // stride; owner and lifetime as in `vector`.
    let array = unsafe {
        let view = ArrayView2::from_shape_ptr(shape, matrix.as_ptr());
        PyArray2::borrow_from_array(&view, owner.clone().into_any())
    };
    read_only(array.into_any())
}

fn read_only(array: Bound<'_, PyAny>) -> PyResult<Bound<'_, PyAny>> {
    array.call_method1("setflags", (false,))?;
    Ok(array)
}

/// An array (n) that owns the vector's memory.
pub fn owned<T: Element>(py: Python<'_>, values: Vec<T>) -> Bound<'_, PyAny> {
    PyArray1::from_vec(py, values).into_any()
}

/// An array (n × width) that owns the row-major vector's memory.
pub fn owned_rows<T: Element>(
    py: Python<'_>,
    values: Vec<T>,
    width: usize,
) -> PyResult<Bound<'_, PyAny>> {
    owned(py, values).call_method1("reshape", (-1, width))
}

/// An array (n × 3) of points.
pub fn points<'py>(py: Python<'py>, points: &[DVec3]) -> PyResult<Bound<'py, PyAny>> {
    owned_rows(py, points.iter().flat_map(|p| p.to_array()).collect(), 3)
}

/// A rigid motion as a homogeneous matrix (4 × 4), rows first.
pub fn motion<'py>(py: Python<'py>, motion: &DAffine3) -> PyResult<Bound<'py, PyAny>> {
    let DAffine3 { matrix3, translation } = motion;
    let mut rows = Vec::with_capacity(16);
    for i in 0..3 {
        rows.extend(matrix3.row(i).to_array());
        rows.push(translation[i]);
    }
    rows.extend([0.0, 0.0, 0.0, 1.0]);
    owned_rows(py, rows, 4)
}

/// A matrix (rows × columns, columns together) of its own.
pub fn owned_matrix<'py>(py: Python<'py>, matrix: MatRef<'_, f64>) -> PyResult<Bound<'py, PyAny>> {
    let (n, k) = (matrix.nrows(), matrix.ncols());
    let values: Vec<f64> = (0..k).flat_map(|j| matrix.col(j).iter().copied()).collect();
    let array = PyArray1::from_vec(py, values);
    array.reshape([k, n])?.call_method0("transpose")
}
