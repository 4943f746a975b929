//! Share of pairs below each error: one staircase per method.

use plotters::prelude::*;
use semfm_show::colors::SERIES;

use super::{DrawError, GRID, SOFT_INK, font, ink, svg};
use crate::table::number;

const SIZE: (u32, u32) = (620, 380);

/// The errors of each method's pairs; `high`, which is finite and above 0, ends the axis.
pub(in crate::report) fn draw(methods: &[Vec<f64>], high: f64) -> Result<String, DrawError> {
    svg(SIZE, |area| {
        let mut chart = ChartBuilder::on(area)
            .margin(10)
            .margin_right(20)
            .x_label_area_size(38)
            .y_label_area_size(48)
            .build_cartesian_2d(0.0..high, 0.0..1.02)?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(GRID)
            .axis_style(SOFT_INK)
            .x_labels(8)
            .y_labels(6)
            .x_label_formatter(&|x| format!("{x:.0}"))
            .y_label_formatter(&|y| number(Some(*y), 1))
            .x_desc("mean geodesic error × 100 / √area")
            .y_desc("share of pairs")
            .label_style(font(11.0))
            .axis_desc_style(font(12.0))
            .draw()?;
        for (errors, color) in methods.iter().zip(SERIES.iter().cycle()) {
            let line = staircase(errors, high);
            chart.draw_series(LineSeries::new(line, ink(*color).stroke_width(2)))?;
        }
        Ok(())
    })
}

/// Corners of the share of values up to each x, from 0 to `high`.
fn staircase(values: &[f64], high: f64) -> Vec<(f64, f64)> {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|x| x.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len().max(1) as f64;
    let mut corners = vec![(0.0, 0.0)];
    for (before, &x) in sorted.iter().enumerate().take_while(|(_, x)| **x <= high) {
        corners.extend([(x, before as f64 / n), (x, (before + 1) as f64 / n)]);
    }
    let end = corners.last().map_or(0.0, |corner| corner.1);
    corners.push((high, end));
    corners
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_staircase_climbs_at_each_value_and_stays() {
        let steps = staircase(&[3.0, 1.0, f64::NAN, 9.0], 5.0);
        let thirds = [1.0 / 3.0, 2.0 / 3.0];
        assert_eq!(
            steps,
            [
                (0.0, 0.0),
                (1.0, 0.0),
                (1.0, thirds[0]),
                (3.0, thirds[0]),
                (3.0, thirds[1]),
                (5.0, thirds[1])
            ]
        );
        assert_eq!(staircase(&[], 5.0), [(0.0, 0.0), (5.0, 0.0)]);
    }
}
