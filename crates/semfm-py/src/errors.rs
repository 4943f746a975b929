//! Our errors as Python exceptions, and bugs as `semfm.InternalError`.
//!
//! The classes are written in Python (`semfm/errors.py`): there they can be ValueErrors and
//! OSErrors at the same time, and go through pickle.

use pyo3::prelude::*;
use semfm::geom;
use semfm::geom::io::printable;

/// The exception of an error of any crate, with its code and place.
pub fn raise(py: Python<'_>, error: &semfm::Error) -> PyErr {
    let (class, message) = (class_of(error), error.to_string());
    // A traceback prints the message to a terminal, and parts of it may be a file's.
    exception(py, class, &printable(&message), error.code(), error.place().as_deref())
}

/// The exception of a run that failed: that of its cause, which names the stage.
pub fn raise_run(py: Python<'_>, error: &semfm_run::Error) -> PyErr {
    let mut cause = error;
    while let semfm_run::Error::Stage { cause: inner, .. } = cause {
        cause = inner;
    }
    let (class, place) = match cause {
        semfm_run::Error::Semfm(cause) => (class_of(cause), cause.place()),
        semfm_run::Error::Recipe(format) => ("FormatError", Some(format.place.clone())),
        _ => ("InvalidInput", None),
    };
    let message = error.to_string();
    exception(py, class, &printable(&message), error.code(), place.as_deref())
}

/// The name of an error's class.
fn class_of(error: &semfm::Error) -> &'static str {
    match error {
        semfm::Error::Geom(geom::Error::InFile { .. }) => "FormatError",
        semfm::Error::Format { .. } => "FormatError",
        semfm::Error::Views(
            semfm::views::Error::Format { .. }
            | semfm::views::Error::Container { .. }
            | semfm::views::Error::OtherMesh { .. },
        ) => "FormatError",
        _ => match error.code() {
            "io" => "FileError",
            "format" => "FormatError",
            "cancelled" => "Cancelled",
            "not-converged" | "not-positive-definite" | "linear-algebra" => "ComputationError",
            _ => "InvalidInput",
        },
    }
}

/// An argument of the right type that holds what it may not: `semfm.InvalidInput`, a ValueError.
pub fn invalid(py: Python<'_>, argument: &str, expected: &str, found: &str) -> PyErr {
    let message = format!("{argument}: expected {expected}, found {found}");
    exception(py, "InvalidInput", &message, "invalid", Some(argument))
}

/// A file that is not what it must be: `semfm.FormatError`, a ValueError.
pub fn format(py: Python<'_>, path: &str, expected: &str, found: &str) -> PyErr {
    let message = format!("{path}: expected {expected}, found {found}");
    exception(py, "FormatError", &message, "format", Some(path))
}

/// An argument of the wrong type: `semfm.InvalidType`, a TypeError.
pub fn wrong_type(argument: &str, expected: &str, found: &Bound<'_, PyAny>) -> PyErr {
    let name = found.get_type().name().map_or_else(|_| "something else".into(), |n| n.to_string());
    invalid_type(found.py(), argument, expected, &name)
}

/// As [`wrong_type`], of a type that has been put into words.
pub fn invalid_type(py: Python<'_>, argument: &str, expected: &str, found: &str) -> PyErr {
    let message = format!("{argument}: expected {expected}, found {found}");
    exception(py, "InvalidType", &message, "type", Some(argument))
}

/// A name that is none of the attributes: `semfm.UnknownAttribute`, an AttributeError.
pub fn unknown_attribute(py: Python<'_>, message: &str, name: &str) -> PyErr {
    exception(py, "UnknownAttribute", message, "attribute", Some(name))
}

/// A position past the end: `semfm.IndexOutOfRange`, an IndexError.
pub fn index_out_of_range(py: Python<'_>, message: &str) -> PyErr {
    exception(py, "IndexOutOfRange", message, "index", None)
}

/// An optional package that is needed: `semfm.MissingPackage`, an ImportError.
pub fn missing_package(py: Python<'_>, package: &str, message: &str) -> PyErr {
    exception(py, "MissingPackage", message, "missing-package", Some(package))
}

/// Threads that the system does not give: `semfm.SemfmError`.
pub fn no_threads(py: Python<'_>, reason: &str) -> PyErr {
    let message = format!("cannot start worker threads: {reason}");
    exception(py, "SemfmError", &message, "threads", None)
}

/// A bug of ours.
pub fn internal(py: Python<'_>, message: &str) -> PyErr {
    let message = format!("a bug in semfm, please report it: {message}");
    exception(py, "InternalError", &message, "internal", None)
}

fn exception(py: Python<'_>, class: &str, message: &str, code: &str, place: Option<&str>) -> PyErr {
    let made = py
        .import("semfm.errors")
        .and_then(|module| module.getattr(class))
        .and_then(|class| class.call1((message, code, place)));
    made.map_or_else(|error| error, PyErr::from_value)
}
