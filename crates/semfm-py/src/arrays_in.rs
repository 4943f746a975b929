//! Arrays of any dtype, order and stride in; checked rows of numbers out.
//!
//! Every function names the argument, the array it wants and the array it found: `semfm.InvalidType`
//! (a TypeError) for kinds of numbers, `semfm.InvalidInput` (a ValueError) for shapes and values.

use faer::{Mat, MatRef};
use numpy::{Element, PyReadonlyArrayDyn, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;
use semfm::files::rigid_pose;
use semfm::geom::math::DVec3;
use semfm::observe::Numbers;
use semfm::robot::Pose;

use crate::errors;

/// One axis of the shape that is wanted.
#[derive(Clone, Copy)]
pub enum Axis {
    /// Any length, called by this letter.
    Any(&'static str),
    /// This length.
    Is(usize),
    /// One per working vertex of a shape, whose mesh as given has another number of them.
    Working { n: usize, n_original: usize },
    /// One per vertex of a shape's mesh as given.
    Original { n: usize, n_working: usize },
}

impl Axis {
    fn length(self) -> Option<usize> {
        match self {
            Self::Any(_) => None,
            Self::Is(n) | Self::Working { n, .. } | Self::Original { n, .. } => Some(n),
        }
    }

    /// What the axis counts, where that may be mistaken.
    fn space(self) -> Option<&'static str> {
        match self {
            Self::Any(_) | Self::Is(_) => None,
            Self::Working { .. } => Some("one per working vertex of the shape"),
            Self::Original { .. } => Some("one per vertex of the mesh as given"),
        }
    }

    /// What to do with an axis of length `found` that counts the vertices of the other mesh.
    fn advice(self, found: usize) -> Option<&'static str> {
        match self {
            Self::Working { n, n_original } if found == n_original && found != n => Some(
                ", one per vertex of the mesh as given: `Shape.onto_working(values)` reads them off \
                 at the working vertices",
            ),
            Self::Original { n, n_working } if found == n_working && found != n => Some(
                ", one per working vertex: `Shape.onto_original(values)` extends them to the mesh as \
                 given",
            ),
            _ => None,
        }
    }
}

use Axis::{Any, Is};

/// A kind of numbers, by NumPy's letters.
#[derive(Clone, Copy)]
struct Kind {
    letters: &'static str,
    name: &'static str,
}

const REAL: Kind = Kind { letters: "fiu", name: "real numbers (float64, float32 or integers)" };
const WHOLE: Kind = Kind { letters: "iu", name: "integers (int32, int64, uint32 …)" };
const TRUTH: Kind = Kind { letters: "b", name: "bool" };

/// Row-major values and shape; every value finite.
pub fn floats(
    value: &Bound<'_, PyAny>,
    name: &str,
    axes: &[Axis],
) -> PyResult<(Vec<f64>, Vec<usize>)> {
    let (values, shape) = values::<f64>(value, name, REAL, axes)?;
    finite(value.py(), name, &values, &shape, |x| x.is_finite())?;
    Ok((values, shape))
}

/// As [`floats`], in 32 bits.
pub fn floats32(
    value: &Bound<'_, PyAny>,
    name: &str,
    axes: &[Axis],
) -> PyResult<(Vec<f32>, Vec<usize>)> {
    let (values, shape) = values::<f32>(value, name, REAL, axes)?;
    finite(value.py(), name, &values, &shape, |x| x.is_finite())?;
    Ok((values, shape))
}

/// As [`floats32`], but any number will do.
pub fn any32(
    value: &Bound<'_, PyAny>,
    name: &str,
    axes: &[Axis],
) -> PyResult<(Vec<f32>, Vec<usize>)> {
    values::<f32>(value, name, REAL, axes)
}

/// A matrix (rows × columns) of finite numbers.
pub fn matrix(value: &Bound<'_, PyAny>, name: &str, axes: [Axis; 2]) -> PyResult<Mat<f64>> {
    let (values, shape) = floats(value, name, &axes)?;
    let columns = shape[1];
    Ok(Mat::from_fn(shape[0], columns, |i, j| values[i * columns + j]))
}

/// A matrix as it lies in memory, row by row or column by column.
pub struct Laid {
    values: Vec<f64>,
    shape: [usize; 2],
    by_columns: bool,
}

impl Laid {
    /// The matrix (rows × columns), a view.
    pub fn view(&self) -> MatRef<'_, f64> {
        let [rows, columns] = self.shape;
        if self.by_columns {
            MatRef::from_column_major_slice(&self.values, rows, columns)
        } else {
            MatRef::from_row_major_slice(&self.values, rows, columns)
        }
    }

    /// Number of columns.
    pub fn ncols(&self) -> usize {
        self.shape[1]
    }
}

/// As [`matrix`], without turning over what lies column by column, as our own functions do.
pub fn laid(value: &Bound<'_, PyAny>, name: &str, axes: [Axis; 2]) -> PyResult<Laid> {
    let array = checked(value, name, REAL, &axes)?;
    let by_columns = has_flag(&array, "F_CONTIGUOUS")? && !has_flag(&array, "C_CONTIGUOUS")?;
    if by_columns {
        let (values, shape) = contiguous::<f64>(&array.getattr("T")?, name)?;
        if values.iter().all(|x| x.is_finite()) {
            return Ok(Laid { values, shape: [shape[1], shape[0]], by_columns });
        }
    }
    let (values, shape) = floats(&array, name, &axes)?; // names the number that is not finite
    Ok(Laid { values, shape: [shape[0], shape[1]], by_columns: false })
}

/// One of NumPy's flags of an array.
fn has_flag(array: &Bound<'_, PyAny>, flag: &str) -> PyResult<bool> {
    array.getattr("flags")?.get_item(flag)?.extract()
}

/// Points (n × 3). Numbers that are not finite are left to the constructor that takes them, which
/// names the vertex.
pub fn points(value: &Bound<'_, PyAny>, name: &str) -> PyResult<Vec<DVec3>> {
    let (values, _) = values::<f64>(value, name, REAL, &[Any("n"), Is(3)])?;
    Ok(values.as_chunks::<3>().0.iter().map(|&p| DVec3::from_array(p)).collect())
}

/// One point (3).
pub fn point(value: &Bound<'_, PyAny>, name: &str) -> PyResult<DVec3> {
    let (values, _) = floats(value, name, &[Is(3)])?;
    Ok(DVec3::new(values[0], values[1], values[2]))
}

/// A rotation and a translation from a homogeneous matrix (4 × 4), rows first.
pub fn rigid(value: &Bound<'_, PyAny>, name: &str) -> PyResult<Pose> {
    let (numbers, _) = floats(value, name, &[Is(4), Is(4)])?;
    let rows = [0, 1, 2, 3].map(|i| [0, 1, 2, 3].map(|j| numbers[4 * i + j]));
    let expected = "a rotation and a translation, rows first";
    rigid_pose(rows).map_err(|found| errors::invalid(value.py(), name, expected, &found))
}

/// Ids from 0 to 2³² − 1, row-major, and the shape.
pub fn ids(
    value: &Bound<'_, PyAny>,
    name: &str,
    axes: &[Axis],
) -> PyResult<(Vec<u32>, Vec<usize>)> {
    let py = value.py();
    // An empty list has no integers to be recognised by.
    if value.len().is_ok_and(|n| n == 0) && axes.len() == 1 {
        return Ok((Vec::new(), vec![0]));
    }
    let array = checked(value, name, WHOLE, axes)?;
    let unsigned = array.getattr("dtype")?.getattr("kind")?.extract::<String>()? == "u";
    let out_of_range =
        |found: String| errors::invalid(py, name, "ids from 0 to 4294967295", &found);
    if unsigned {
        let (wide, shape) = contiguous::<u64>(&array, name)?;
        let narrow =
            wide.iter().map(|&id| u32::try_from(id).map_err(|_| out_of_range(id.to_string())));
        Ok((narrow.collect::<PyResult<_>>()?, shape))
    } else {
        let (wide, shape) = contiguous::<i64>(&array, name)?;
        let narrow =
            wide.iter().map(|&id| u32::try_from(id).map_err(|_| out_of_range(id.to_string())));
        Ok((narrow.collect::<PyResult<_>>()?, shape))
    }
}

/// A count in an array without axes, as .npz files have them.
pub fn count(value: &Bound<'_, PyAny>, name: &str) -> PyResult<usize> {
    let number = value.call_method0("item").and_then(|number| number.extract());
    number.map_err(|_| errors::wrong_type(name, "a whole number of at least 0", value))
}

/// Numbers as they were given, floats or whole, row-major, and the shape.
pub fn numbers(
    value: &Bound<'_, PyAny>,
    name: &str,
    axes: &[Axis],
) -> PyResult<(Numbers, Vec<usize>)> {
    let array = checked(value, name, REAL, axes)?;
    let letter: String = array.getattr("dtype")?.getattr("kind")?.extract()?;
    if letter == "f" {
        let (values, shape) = contiguous(&array, name)?;
        return Ok((Numbers::F64(values), shape));
    }
    let (values, shape) = contiguous(&array, name)?;
    Ok((Numbers::Whole(values), shape))
}

/// Truth values, row-major, and the shape.
pub fn mask(
    value: &Bound<'_, PyAny>,
    name: &str,
    axes: &[Axis],
) -> PyResult<(Vec<bool>, Vec<usize>)> {
    values::<bool>(value, name, TRUTH, axes)
}

/// Bytes (0 to 255), row-major, and the shape.
pub fn bytes(
    value: &Bound<'_, PyAny>,
    name: &str,
    axes: &[Axis],
) -> PyResult<(Vec<u8>, Vec<usize>)> {
    let array = checked(value, name, WHOLE, axes)?;
    let dtype = array.getattr("dtype")?;
    if dtype.getattr("itemsize")?.extract::<usize>()? != 1 {
        let found = dtype.str()?.to_string();
        return Err(errors::invalid_type(array.py(), name, "uint8", &found));
    }
    contiguous::<u8>(&array, name)
}

fn values<T: Element + Copy>(
    value: &Bound<'_, PyAny>,
    name: &str,
    kind: Kind,
    axes: &[Axis],
) -> PyResult<(Vec<T>, Vec<usize>)> {
    contiguous(&checked(value, name, kind, axes)?, name)
}

/// The value as an array of the right kind and shape, as it lies in memory.
fn checked<'py>(
    value: &Bound<'py, PyAny>,
    name: &str,
    kind: Kind,
    axes: &[Axis],
) -> PyResult<Bound<'py, PyAny>> {
    let py = value.py();
    let numpy = py.import("numpy")?;
    let array = numpy
        .call_method1("asarray", (value,))
        .map_err(|_| errors::wrong_type(name, &wanted_array(kind, axes), value))?;
    let untyped = array.cast::<PyUntypedArray>()?;
    let dtype = array.getattr("dtype")?;
    let letter: String = dtype.getattr("kind")?.extract()?;
    let width: usize = dtype.getattr("itemsize")?.extract()?;
    if !kind.letters.contains(letter.as_str()) || width > 8 {
        return Err(errors::invalid_type(
            py,
            name,
            &wanted_array(kind, axes),
            &format!("dtype {dtype}"),
        ));
    }
    let shape = untyped.shape();
    let fits = shape.len() == axes.len()
        && shape.iter().zip(axes).all(|(&n, axis)| axis.length().is_none_or(|wanted| n == wanted));
    if !fits {
        let advice = shape.iter().zip(axes).find_map(|(&n, axis)| axis.advice(n));
        let found = format!("shape {}{}", tuple(shape), advice.unwrap_or_default());
        return Err(errors::invalid(py, name, &wanted_array(kind, axes), &found));
    }
    Ok(array)
}

/// Row-major values in the machine's own byte order.
fn contiguous<T: Element + Copy>(
    array: &Bound<'_, PyAny>,
    name: &str,
) -> PyResult<(Vec<T>, Vec<usize>)> {
    let py = array.py();
    let shape = array.cast::<PyUntypedArray>()?.shape().to_vec();
    let dtype = T::get_dtype(py);
    let array = py.import("numpy")?.call_method1("ascontiguousarray", (array, dtype))?;
    let array: PyReadonlyArrayDyn<'_, T> =
        array.extract().map_err(|_| errors::wrong_type(name, "an array", &array))?;
    Ok((array.as_slice()?.to_vec(), shape))
}

fn finite<T: Copy + std::fmt::Display>(
    py: Python<'_>,
    name: &str,
    values: &[T],
    shape: &[usize],
    is_finite: impl Fn(T) -> bool,
) -> PyResult<()> {
    let Some(mut at) = values.iter().position(|&x| !is_finite(x)) else { return Ok(()) };
    let found = values[at];
    let mut place = vec![0; shape.len()];
    for (index, n) in place.iter_mut().zip(shape).rev() {
        (*index, at) = (at % n, at / n);
    }
    let found = format!("{found} at {place:?}").to_lowercase();
    Err(errors::invalid(py, name, "finite numbers", &found))
}

fn wanted_array(kind: Kind, axes: &[Axis]) -> String {
    let space = axes.iter().find_map(|axis| axis.space());
    let space = space.map(|space| format!(" ({space})")).unwrap_or_default();
    format!("an array of {}, shape {}{space}", kind.name, wanted_shape(axes))
}

fn wanted_shape(axes: &[Axis]) -> String {
    let words: Vec<String> = axes
        .iter()
        .map(|axis| match axis {
            Any(letter) => (*letter).to_owned(),
            Is(n) | Axis::Working { n, .. } | Axis::Original { n, .. } => n.to_string(),
        })
        .collect();
    brackets(&words)
}

fn tuple(shape: &[usize]) -> String {
    brackets(&shape.iter().map(ToString::to_string).collect::<Vec<_>>())
}

fn brackets(words: &[String]) -> String {
    if let [only] = words { format!("({only},)") } else { format!("({})", words.join(", ")) }
}

/// Numbers that one call may allocate in a single array: 16 GiB of float64.
const MOST_NUMBERS: u128 = 1 << 31;

/// Refuses a count whose result no machine would hold: an allocation that fails ends the process.
pub fn within_memory(py: Python<'_>, name: &str, count: usize, each: usize) -> PyResult<()> {
    let numbers = count as u128 * each as u128;
    if numbers <= MOST_NUMBERS {
        return Ok(());
    }
    let most = MOST_NUMBERS / (each as u128).max(1);
    Err(errors::invalid(py, name, &format!("at most {most} here"), &count.to_string()))
}
