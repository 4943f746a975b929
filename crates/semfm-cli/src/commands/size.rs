//! The line that says how large an object is.

use semfm::{Mesh, ObjectSize};

use crate::console;

/// `object      95 × 110 × 80 mm`, at `scale` metres per unit.
pub fn size_in_metres(mesh: &Mesh, scale: f64) -> String {
    format!("object      {}", ObjectSize::of(mesh, scale))
}

/// The line, and a question where the size is unusual in a gripper.
pub fn print_size(size: &ObjectSize) {
    console::message(format_args!("object      {size}"));
    if let Some(question) = size.question() {
        console::message(format_args!("note: {question}"));
    }
}
