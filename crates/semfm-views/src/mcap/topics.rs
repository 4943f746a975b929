//! Topics, frames and times of our files: view NNN has the topics `/views/NNN/…` and the frame
//! `view_NNN`, and its pose stands on `/tf` in the frame `object`.

/// The frame of the mesh file.
pub(super) const OBJECT: &str = "object";

/// Topic of all transforms.
pub const TF: &str = "/tf";

/// Topic of the object itself.
pub(super) const MESH: &str = "/mesh";

/// Time of recording of a view, in nanoseconds: one second each, so that playing the file in
/// Foxglove goes around the object.
pub(super) fn time_of(view: usize) -> u64 {
    view as u64 * 1_000_000_000
}

/// `view_NNN`.
pub(super) fn frame(view: usize) -> String {
    format!("view_{view:03}")
}

/// `/views/NNN/WHAT`.
pub(super) fn topic(view: usize, what: &str) -> String {
    format!("/views/{view:03}/{what}")
}

/// The view and the last word of a topic `/views/NNN/WHAT`.
pub(super) fn parse_topic(topic: &str) -> Option<(usize, &str)> {
    let (number, what) = topic.strip_prefix("/views/")?.split_once('/')?;
    parse_number(number).map(|view| (view, what))
}

/// The view of a frame `view_NNN`.
pub(super) fn parse_frame(frame: &str) -> Option<usize> {
    parse_number(frame.strip_prefix("view_")?)
}

/// At least three digits, without zeros in front of more than three.
fn parse_number(text: &str) -> Option<usize> {
    let number = text.parse().ok()?;
    (format!("{number:03}") == text).then_some(number)
}
