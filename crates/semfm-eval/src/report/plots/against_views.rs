//! The paper's figure: IoU, or seconds, against the number of views that a vision-language model was
//! shown, one panel per category, with a line across for each method that needs no such model.

use plotters::coord::ranged1d::{AsRangedCoord, ValueFormatter};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, VPos};
use semfm_show::colors::{EXTRA, QUOTED, QUOTED_VLM, RIGHT, SECOND};

use super::{Area, DrawError, GRID, SOFT_INK, at, dashes, font, ink, inked, svg};
use crate::table::number;

const SIZE: (u32, u32) = (960, 520);
/// Labels stand at least so many pixels below each other.
const APART: i32 = 12;

/// One category.
pub(in crate::report) struct Panel {
    pub title: String,
    /// The paper's model.
    pub quoted_model: Vec<AtViews>,
    pub quoted_semfm: Option<f64>,
    /// A model that was asked in this run.
    pub model: Vec<AtViews>,
    pub lead: Option<f64>,
    pub second: Option<f64>,
}

/// A value at a number of views.
pub(in crate::report) struct AtViews {
    pub n_views: f64,
    pub value: f64,
}

impl AtViews {
    fn point(&self) -> (f64, f64) {
        (self.n_views, self.value)
    }
}

/// What the vertical axis shows.
#[derive(Clone, Copy, PartialEq)]
pub(in crate::report) enum Scale {
    /// 0 to 1.
    Share,
    /// Seconds, logarithmic.
    Seconds,
}

impl Scale {
    fn axis_label(self, value: f64) -> String {
        match self {
            Self::Share => number(Some(value), 1),
            Self::Seconds => format!("{value}"),
        }
    }

    fn write(self, value: f64) -> String {
        match self {
            Self::Share => number(Some(value), 2),
            Self::Seconds if value >= 10.0 => format!("{value:.0} s"),
            Self::Seconds if value >= 1.0 => format!("{value:.1} s"),
            Self::Seconds => format!("{value:.2} s"),
        }
    }
}

/// The numbers of views in the paper.
fn views_label(x: f64) -> String {
    match x.round() as i64 {
        n @ (1 | 3 | 6) if (x - x.round()).abs() < 1e-9 => n.to_string(),
        _ => String::new(),
    }
}

/// All panels, three in a line.
pub(in crate::report) fn draw(panels: &[Panel], scale: Scale) -> Result<String, DrawError> {
    svg(SIZE, |area| {
        for (panel, area) in panels.iter().zip(area.split_evenly((2, 3))) {
            match scale {
                Scale::Share => draw_panel(panel, &area, 0.0..1.0, scale)?,
                Scale::Seconds => {
                    let [low, high] = decades(panels);
                    draw_panel(panel, &area, (low..high).log_scale(), scale)?;
                }
            }
        }
        Ok(())
    })
}

/// Powers of ten around all values.
fn decades(panels: &[Panel]) -> [f64; 2] {
    let all = panels.iter().flat_map(|p| {
        let points = p.quoted_model.iter().chain(&p.model).map(|point| point.value);
        points.chain([p.quoted_semfm, p.lead, p.second].into_iter().flatten())
    });
    let (low, high) = all
        .filter(|value| *value > 0.0)
        .fold((1.0f64, 100.0f64), |(low, high), value| (low.min(value), high.max(value)));
    [10f64.powf(low.log10().floor()), 10f64.powf(high.log10().ceil())]
}

fn draw_panel<Y>(panel: &Panel, area: &Area<'_>, y: Y, scale: Scale) -> Result<(), DrawError>
where
    Y: AsRangedCoord<Value = f64>,
    Y::CoordDescType: ValueFormatter<f64>,
{
    let mut chart = ChartBuilder::on(area)
        .margin(6)
        .margin_right(40)
        .caption(&panel.title, font(14.0))
        .x_label_area_size(34)
        .y_label_area_size(46)
        .build_cartesian_2d(0.5..6.5, y)?;
    chart
        .configure_mesh()
        .disable_x_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(GRID)
        .axis_style(SOFT_INK)
        .x_labels(7)
        .y_labels(if scale == Scale::Share { 6 } else { 4 })
        .x_label_formatter(&|x| views_label(*x))
        .y_label_formatter(&|value| scale.axis_label(*value))
        .x_desc("views")
        .label_style(font(11.0))
        .axis_desc_style(font(11.0))
        .draw()?;
    let across = [
        (panel.quoted_semfm, QUOTED, (7, 5)),
        (panel.second, SECOND, (2, 4)),
        (panel.lead, RIGHT, (3, 4)),
    ];
    for (value, color, (dash, gap)) in across {
        let Some(value) = value else { continue };
        let style = ink(color).stroke_width(if color == RIGHT { 3 } else { 2 });
        chart.draw_series(dashes((0.5, value), (6.5, value), dash, gap, style))?;
    }
    for (points, color) in [(&panel.quoted_model, QUOTED_VLM), (&panel.model, EXTRA)] {
        let points = points.iter().map(AtViews::point);
        chart.draw_series(LineSeries::new(points.clone(), ink(color).stroke_width(2)))?;
        let fill = ink(color).filled();
        if color == EXTRA {
            chart.draw_series(points.map(|point| TriangleMarker::new(point, 5, fill)))?;
        } else {
            chart.draw_series(points.map(|point| Circle::new(point, 4, fill)))?;
        }
    }
    let known = across.iter().filter_map(|&(value, color, _)| {
        let value = value?;
        let (x, y) = chart.backend_coord(&(6.5, value));
        Some((y, x, scale.write(value), color))
    });
    let mut labels: Vec<_> = known.collect();
    labels.sort_by_key(|label| label.0);
    let heights = moved_apart(&labels.iter().map(|label| label.0).collect::<Vec<_>>());
    let base = area.get_base_pixel();
    for ((_, x, text, color), y) in labels.into_iter().zip(heights) {
        let style = at(inked(11.0, ink(color)), HPos::Left, VPos::Center);
        area.draw_text(&text, &style, (x - base.0 + 5, y - base.1))?;
    }
    Ok(())
}

/// Ascending heights, each at least [`APART`] below the one before, moved as a whole as little as
/// needed.
fn moved_apart(heights: &[i32]) -> Vec<i32> {
    let mut moved: Vec<i32> = Vec::new();
    for &height in heights {
        moved.push(moved.last().map_or(height, |&above| height.max(above + APART)));
    }
    let excess: i32 = moved.iter().zip(heights).map(|(new, old)| new - old).sum();
    let shift = excess / heights.len().max(1) as i32;
    moved.into_iter().map(|height| height - shift).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_that_meet_are_moved_apart_and_others_stay() {
        assert_eq!(moved_apart(&[10, 50, 90]), [10, 50, 90]);
        let close = moved_apart(&[50, 51, 52]);
        assert!(close.windows(2).all(|pair| pair[1] - pair[0] >= APART), "{close:?}");
        assert!((close[1] - 51).abs() <= 1, "{close:?}");
        assert_eq!(moved_apart(&[]), Vec::<i32>::new());
    }
}
