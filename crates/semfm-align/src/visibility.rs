//! How the pieces of a model that should have been seen compare with what was seen.

/// Counts of pieces of the model's surface that face the camera.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Visibility {
    /// Something was observed where the piece is.
    pub explained: usize,
    /// The camera looked through the piece, or saw nothing of the object there.
    pub violating: usize,
    /// Something observed stands before it.
    pub hidden: usize,
}

impl Visibility {
    /// Share of the pieces that should have been seen and were. Pieces behind something count a
    /// third: a few are usual, but a model that hides altogether explains nothing.
    ///
    /// > explained / (explained + violating + hidden/3)
    pub fn share(&self) -> f64 {
        let should = self.explained as f64 + self.violating as f64 + self.hidden as f64 / 3.0;
        if should > 0.0 { self.explained as f64 / should } else { 0.0 }
    }
}
