//! `memory.png`: what a memory says of an object, and who said what.
//!
//! The first row is the fused answer. Each further row is a demonstration, the most trusted first: its object
//! with the region, and the answer that it would have given alone, from where the fused answer is seen.

use std::path::Path;

use semfm::memory::{EntryAnswer, MemoryTransfer};
use semfm::views::{RenderSettings, SurfaceColor, View, render};
use semfm::{Mesh, Prepared, Task};

use super::sheet::{Entry, PICTURE_SIDE, Row, Sheet};
use super::{Viewpoints, viewpoints};
use crate::Result;
use crate::colors::weight_colors;

/// Writes the picture of a memory's answer.
///
/// # Errors
/// [`Error::Semfm`](crate::Error::Semfm) where rendering or writing fails, and where the task was cancelled.
pub fn write_memory_picture(
    path: &Path,
    target: &Prepared,
    answer: &MemoryTransfer,
    task: &Task,
) -> Result<()> {
    let mesh = target.object.shape().original();
    let weights = answer.fused.region.weights();
    let on_target = viewpoints(mesh, weights, PICTURE_SIDE, task)?;
    let fused = &answer.fused;
    let mut pictures = vec![from_both_sides(mesh, weights, &on_target, task)?];
    let mut titles = vec![format!(
        "{}, confidence {:.2}, agreement {:.2}",
        fused.verdict, fused.confidence, fused.agreement
    )];
    for said in &answer.answers {
        pictures.push(of_answer(said, mesh, &on_target, task)?);
        titles.push(format!(
            "{}: {:.0} % of the vote, alone {} ({:.2})",
            said.entry.name,
            100.0 * said.trust.share,
            said.transfer.verdict,
            said.transfer.confidence
        ));
    }
    let rows: Vec<Row<'_>> = titles
        .into_iter()
        .zip(&pictures)
        .map(|(title, pictures)| Row { title, pictures })
        .collect();
    let note = "above the fused answer; below each demonstration and what it says alone";
    let legend = [Entry::Weights, Entry::Note(note.into())];
    Sheet { columns: &[], rows: &rows, legend: &legend }.write(path)
}

/// A demonstration beside its own answer.
fn of_answer(
    said: &EntryAnswer,
    target: &Mesh,
    seen: &Viewpoints,
    task: &Task,
) -> Result<Vec<View>> {
    let (mesh, weights) = (said.mesh(), said.region().weights());
    let own = viewpoints(mesh, weights, PICTURE_SIDE, task)?;
    let mut pictures = drawn(mesh, weights, &[own.best], task)?;
    pictures.extend(drawn(target, said.transfer.weights(), &[seen.best], task)?);
    Ok(pictures)
}

fn from_both_sides(
    mesh: &Mesh,
    weights: &[f64],
    seen: &Viewpoints,
    task: &Task,
) -> Result<Vec<View>> {
    drawn(mesh, weights, &[seen.best, seen.other], task)
}

fn drawn(
    mesh: &Mesh,
    weights: &[f64],
    cameras: &[semfm::geom::Pinhole],
    task: &Task,
) -> Result<Vec<View>> {
    let colors = weight_colors(weights);
    Ok(render(mesh, &SurfaceColor::Vertices(&colors), cameras, &RenderSettings::default(), task)?)
}
