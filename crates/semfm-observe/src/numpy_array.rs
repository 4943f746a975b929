//! Arrays of NumPy (`.npy`): the one reader of this format in the workspace.

use std::path::Path;

use npyz::{NpyFile, Order};
use semfm_geom::io::{FormatError, foreign_kind, read_file};

use crate::Result;

/// An array of numbers, row-major whatever the order in its file.
#[derive(Clone, Debug, PartialEq)]
pub struct NumpyArray {
    /// Length along each axis.
    pub shape: Vec<usize>,
    /// As many numbers as the shape says.
    pub numbers: Numbers,
}

/// Numbers of one type.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Numbers {
    /// `float64`.
    F64(Vec<f64>),
    /// `float32`.
    F32(Vec<f32>),
    /// Whole numbers of any width, with or without a sign.
    Whole(Vec<i64>),
    /// `bool`.
    Bool(Vec<bool>),
}

impl NumpyArray {
    /// Reads an array.
    ///
    /// # Errors
    /// [`semfm_geom::Error::Io`]; [`Error::Format`](crate::Error::Format) for what is no array of numbers or truth
    /// values, or has fewer of them than its shape says.
    pub fn read(path: &Path) -> Result<Self> {
        Self::parse(path, "", &read_file(path)?)
    }

    /// An array out of bytes; `path` and the name of the array in it (empty for a file of its own) are for messages.
    pub(crate) fn parse(path: &Path, name: &str, bytes: &[u8]) -> Result<Self> {
        let place = |what: &str| if name.is_empty() { what.to_owned() } else { name.to_owned() };
        let open = || {
            NpyFile::new(bytes).map_err(|error| {
                let foreign = foreign_kind(bytes).filter(|kind| !kind.contains(".npy"));
                let found = foreign.map_or_else(|| error.to_string(), Into::into);
                FormatError::new(path, place("header"), "a NumPy array", found)
            })
        };
        let header = open()?;
        let shape = header.shape().to_vec();
        let count = shape.iter().try_fold(1u64, |n, &d| n.checked_mul(d));
        if count.is_none_or(|n| n > bytes.len() as u64) {
            let expected = format!("no more values than the file's {} bytes", bytes.len());
            let found =
                format!("({})", shape.iter().map(u64::to_string).collect::<Vec<_>>().join(", "));
            return Err(FormatError::new(path, place("shape"), expected, found).into());
        }
        let by_columns = header.order() == Order::Fortran && shape.len() > 1;
        let shape: Vec<usize> = shape.iter().map(|&d| d as usize).collect();
        let short = |error: std::io::Error| {
            let expected = format!("{} values", count.unwrap_or(0));
            FormatError::new(path, place("data"), expected, error.to_string())
        };
        macro_rules! read_as {
            ($($kind:ty => $variant:ident as $to:ty),*) => {
                $(if let Ok(values) = open()?.data::<$kind>() {
                    let values = values.map(|value| value.map(|x| x as $to));
                    let values = values.collect::<std::io::Result<Vec<$to>>>().map_err(short)?;
                    let values = if by_columns { by_rows(&shape, &values) } else { values };
                    return Ok(Self { shape, numbers: Numbers::$variant(values) });
                })*
            };
        }
        read_as!(
            f64 => F64 as f64, f32 => F32 as f32, bool => Bool as bool, u8 => Whole as i64, i8 => Whole as i64,
            u16 => Whole as i64, i16 => Whole as i64, u32 => Whole as i64, i32 => Whole as i64,
            i64 => Whole as i64, u64 => Whole as i64
        );
        let kind = header.dtype().descr();
        Err(FormatError::new(path, place("dtype"), "numbers or truth values", kind).into())
    }

    /// The shape in words, as NumPy prints it.
    pub fn shape_in_words(&self) -> String {
        let sides: Vec<String> = self.shape.iter().map(usize::to_string).collect();
        format!("({})", sides.join(", "))
    }

    /// The numbers in double precision; truth values are 0 and 1.
    pub fn into_f64(self) -> Vec<f64> {
        match self.numbers {
            Numbers::F64(values) => values,
            Numbers::F32(values) => values.into_iter().map(f64::from).collect(),
            Numbers::Whole(values) => values.into_iter().map(|x| x as f64).collect(),
            Numbers::Bool(values) => values.into_iter().map(|x| f64::from(u8::from(x))).collect(),
        }
    }

    /// The numbers in single precision; truth values are 0 and 1.
    pub fn into_f32(self) -> Vec<f32> {
        match self.numbers {
            Numbers::F32(values) => values,
            Numbers::F64(values) => values.into_iter().map(|x| x as f32).collect(),
            Numbers::Whole(values) => values.into_iter().map(|x| x as f32).collect(),
            Numbers::Bool(values) => values.into_iter().map(|x| f32::from(u8::from(x))).collect(),
        }
    }
}

/// Values whose first index runs fastest, in the order in which the last one does.
fn by_rows<T: Copy>(shape: &[usize], values: &[T]) -> Vec<T> {
    let strides: Vec<usize> = shape
        .iter()
        .scan(1, |stride, &side| {
            let this = *stride;
            *stride *= side;
            Some(this)
        })
        .collect();
    let mut index = vec![0; shape.len()];
    (0..values.len())
        .map(|_| {
            let at: usize = index.iter().zip(&strides).map(|(i, s)| i * s).sum();
            for axis in (0..shape.len()).rev() {
                index[axis] += 1;
                if index[axis] < shape[axis] {
                    break;
                }
                index[axis] = 0;
            }
            values[at]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::npz::testing::npy;

    #[test]
    fn values_of_every_type_come_in_rows() {
        let path = Path::new("a.npy");
        let whole = NumpyArray::parse(path, "", &npy(&[2, 3], &[1i32, 2, 3, 4, 5, -6])).unwrap();
        assert_eq!((whole.shape.clone(), whole.into_f64()[5]), (vec![2, 3], -6.0));
        let truths = NumpyArray::parse(path, "", &npy(&[2], &[true, false])).unwrap();
        assert_eq!(truths.numbers, Numbers::Bool(vec![true, false]));
        // Columns first: [[1, 2, 3], [4, 5, 6]] lies as 1 4 2 5 3 6.
        assert_eq!(by_rows(&[2, 3], &[1, 4, 2, 5, 3, 6]), [1, 2, 3, 4, 5, 6]);
        assert_eq!(by_rows(&[2, 2, 2], &[0, 4, 2, 6, 1, 5, 3, 7]), [0, 1, 2, 3, 4, 5, 6, 7]);
    }

    #[test]
    fn what_is_no_array_is_named() {
        let words = |bytes: &[u8]| {
            NumpyArray::parse(Path::new("a.npy"), "", bytes).unwrap_err().to_string()
        };
        assert!(words(b"\x89PNG\r\n\x1a\n").contains("a PNG picture"));
        let whole = npy(&[4], &[1.0f64, 2.0, 3.0, 4.0]);
        assert!(words(&whole[..whole.len() - 1]).contains("4 values"));
    }
}
