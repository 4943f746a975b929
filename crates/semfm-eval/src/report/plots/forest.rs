//! Methods under each other: the mean with its interval, and a dot for each group.

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, VPos};
use semfm_show::colors::RIGHT;

use super::{DrawError, GRID, SOFT_INK, TEXT_INK, at, font, ink, inked, svg};
use crate::table::number;

const WIDTH: u32 = 900;
const LINE: u32 = 30;
const LEFT: u32 = 150;
const RIGHT_MARGIN: u32 = 70;

/// One method.
pub(in crate::report) struct Line {
    pub name: String,
    pub is_bound: bool,
    pub is_lead: bool,
    pub mean: f64,
    pub interval: Option<[f64; 2]>,
    /// Means of the groups.
    pub groups: Vec<f64>,
}

/// The plot of IoU by method.
pub(in crate::report) fn draw(lines: &[Line]) -> Result<String, DrawError> {
    let n = lines.len() as f64;
    svg((WIDTH, LINE * lines.len() as u32 + 56), |area| {
        let mut chart = ChartBuilder::on(area)
            .margin(8)
            .margin_left(LEFT)
            .margin_right(RIGHT_MARGIN)
            .x_label_area_size(40)
            .build_cartesian_2d(0.0..1.0, (n - 0.5)..-0.5)?;
        chart
            .configure_mesh()
            .disable_y_mesh()
            .disable_y_axis()
            .light_line_style(TRANSPARENT)
            .bold_line_style(GRID)
            .axis_style(SOFT_INK)
            .x_labels(11)
            .x_label_formatter(&|x| number(Some(*x), 1))
            .x_desc("IoU")
            .label_style(font(11.0))
            .axis_desc_style(font(11.0))
            .draw()?;
        for (place, line) in lines.iter().enumerate() {
            let y = place as f64;
            let color = match (line.is_lead, line.is_bound) {
                (true, _) => ink(RIGHT),
                (_, true) => SOFT_INK,
                _ => TEXT_INK,
            };
            let faint = SOFT_INK.mix(0.45).filled();
            chart.draw_series(line.groups.iter().map(|&x| Circle::new((x, y), 3, faint)))?;
            if let Some([low, high]) = line.interval {
                let bar = PathElement::new(vec![(low, y), (high, y)], color.stroke_width(3));
                chart.draw_series([bar])?;
            }
            chart.draw_series([Circle::new((line.mean, y), 6, color.filled())])?;
            let (_, pixel) = chart.backend_coord(&(0.0, y));
            let name = at(inked(13.0, color), HPos::Right, VPos::Center);
            area.draw_text(&line.name, &name, (LEFT as i32 - 10, pixel))?;
            let value = at(inked(13.0, color), HPos::Left, VPos::Center);
            let x = (WIDTH - RIGHT_MARGIN) as i32 + 12;
            area.draw_text(&number(Some(line.mean), 3), &value, (x, pixel))?;
        }
        Ok(())
    })
}
