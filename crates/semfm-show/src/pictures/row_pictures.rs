//! The three pictures of an object in a row of a sheet: a colouring from two sides, and another from the better one.

use semfm::Task;
use semfm::views::{RenderSettings, SurfaceColor, View, render_colorings};

use super::{ObjectFigure, Viewpoints};
use crate::Result;

/// The colours of a row, one per vertex.
pub(super) struct RowColors {
    pub from_two_sides: Vec<[f32; 3]>,
    pub from_the_best: Vec<[f32; 3]>,
}

/// The pictures of some rows of one object, each of three. What each pixel sees is found once for all of them.
pub(super) fn row_pictures(
    figure: &ObjectFigure<'_>,
    rows: &[RowColors],
    task: &Task,
) -> Result<Vec<Vec<View>>> {
    let Viewpoints { best, other, .. } = figure.viewpoints;
    let draw = |colorings: &[SurfaceColor<'_>], camera| {
        render_colorings(figure.mesh(), colorings, &[camera], &RenderSettings::default(), task)
    };
    let two_sides = rows.iter().map(|row| SurfaceColor::Vertices(&row.from_two_sides));
    let the_best = rows.iter().map(|row| SurfaceColor::Vertices(&row.from_the_best));
    let from_other: Vec<SurfaceColor<'_>> = two_sides.clone().collect();
    let from_best: Vec<SurfaceColor<'_>> = two_sides.chain(the_best).collect();
    let (from_best, from_other) =
        rayon::join(|| draw(&from_best, best), || draw(&from_other, other));
    let mut of_best = from_best?.into_iter().flatten();
    let firsts: Vec<View> = of_best.by_ref().take(rows.len()).collect();
    let others = from_other?.into_iter().flatten();
    Ok(firsts.into_iter().zip(others).zip(of_best).map(|((a, b), c)| vec![a, b, c]).collect())
}
