//! NumPy arrays: shapes checked with the argument's name on the way in, no copies on the way out.

use isolux::{Array, Data};
use numpy::prelude::*;
use numpy::{Element, PyArrayDyn, PyReadonlyArrayDyn};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// A shape as Python writes it, for messages.
fn shape_text(shape: &[usize]) -> String {
    match shape {
        [one] => format!("({one},)"),
        _ => format!("({})", shape.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")),
    }
}

/// The rows of an array of shape `(n, COLUMNS)`.
pub(crate) fn rows<T: Element + Copy, const COLUMNS: usize>(
    name: &str,
    array: &PyReadonlyArrayDyn<'_, T>,
) -> PyResult<Vec<[T; COLUMNS]>> {
    let view = array.as_array();
    if view.ndim() != 2 || view.shape()[1] != COLUMNS {
        return Err(wrong_shape(name, &format!("(n, {COLUMNS})"), view.shape()));
    }
    Ok(view.outer_iter().map(|row| std::array::from_fn(|column| row[column])).collect())
}

/// The entries of an array of shape `(n,)`.
pub(crate) fn entries<T: Element + Copy>(name: &str, array: &PyReadonlyArrayDyn<'_, T>) -> PyResult<Vec<T>> {
    let view = array.as_array();
    if view.ndim() != 1 {
        return Err(wrong_shape(name, "(n,)", view.shape()));
    }
    Ok(view.iter().copied().collect())
}

/// `ValueError` for an argument of the wrong shape.
pub(crate) fn wrong_shape(name: &str, expected: &str, found: &[usize]) -> PyErr {
    PyValueError::new_err(format!("{name}: expected shape {expected}, got {}", shape_text(found)))
}

/// `ValueError` where two arguments should be equally long.
pub(crate) fn same_length(name: &str, length: usize, other: &str, other_length: usize) -> PyResult<()> {
    if length == other_length {
        return Ok(());
    }
    Err(PyValueError::new_err(format!("{name} has {length} rows, but {other} has {other_length}")))
}

/// A read-only array of any shape; takes the numbers without copying them.
pub(crate) fn read_only<'py, T: Element>(
    py: Python<'py>,
    data: Vec<T>,
    shape: &[usize],
) -> PyResult<Bound<'py, PyAny>> {
    let flat = data.into_pyarray(py);
    // Before the view is made, so that neither the view nor its base can be written.
    flat.call_method1("setflags", (false,))?;
    Ok(flat.reshape(shape)?.into_any())
}

/// An array of a record as a read-only NumPy array.
pub(crate) fn from_record_array<'py>(py: Python<'py>, array: Array) -> PyResult<Bound<'py, PyAny>> {
    match array.data {
        Data::U8(data) => read_only(py, data, &array.shape),
        Data::U32(data) => read_only(py, data, &array.shape),
        Data::U64(data) => read_only(py, data, &array.shape),
        Data::F32(data) => read_only(py, data, &array.shape),
        Data::F64(data) => read_only(py, data, &array.shape),
    }
}

/// A NumPy array as an array of a record; `None` for a type of number that records do not hold.
pub(crate) fn to_record_array(name: String, value: &Bound<'_, PyAny>) -> Option<Array> {
    fn read<T: Element + Copy>(value: &Bound<'_, PyAny>) -> Option<(Vec<usize>, Vec<T>)> {
        let array = value.cast::<PyArrayDyn<T>>().ok()?.readonly();
        let view = array.as_array();
        let data = view.as_slice().map_or_else(|| view.iter().copied().collect(), <[T]>::to_vec);
        Some((view.shape().to_vec(), data))
    }
    let (shape, data) = None
        .or_else(|| read(value).map(|(shape, data)| (shape, Data::U8(data))))
        .or_else(|| read(value).map(|(shape, data)| (shape, Data::U32(data))))
        .or_else(|| read(value).map(|(shape, data)| (shape, Data::U64(data))))
        .or_else(|| read(value).map(|(shape, data)| (shape, Data::F32(data))))
        .or_else(|| read(value).map(|(shape, data)| (shape, Data::F64(data))))?;
    Some(Array { name, shape, data })
}
