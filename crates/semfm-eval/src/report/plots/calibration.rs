//! What a confidence is worth: each answer by confidence and IoU, and the reliability diagram.

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, VPos};
use semfm::Verdict;
use semfm_show::colors::{EXTRA, MISSED, RIGHT};

use super::{Area, DrawError, GRID, SOFT_INK, at, dashes, font, ink, svg};
use crate::calibration::{self, ReliabilityBin};
use crate::table::number;

const SIZE: (u32, u32) = (440, 410);

/// One answer.
pub(in crate::report) struct Answer {
    pub confidence: f64,
    pub iou: f64,
    pub verdict: Option<Verdict>,
}

/// Confidence against IoU. Verdicts differ in shape as well as in colour.
pub(in crate::report) fn scatter(answers: &[Answer]) -> Result<String, DrawError> {
    svg(SIZE, |area| {
        let mut chart = square(area, "confidence", "IoU")?;
        let right = calibration::RIGHT;
        let style = SOFT_INK.stroke_width(1);
        chart.draw_series(dashes((0.0, right), (1.0, right), 5, 4, style))?;
        for answer in answers {
            let point = (answer.confidence, answer.iou);
            match answer.verdict {
                Some(Verdict::Check) => {
                    let style = ink(MISSED).mix(0.7).filled();
                    chart.draw_series([TriangleMarker::new(point, 5, style)])?;
                }
                Some(Verdict::Refuse) => {
                    let style = ink(EXTRA).stroke_width(2);
                    chart.draw_series([Cross::new(point, 3, style)])?;
                }
                _ => {
                    let style = ink(RIGHT).mix(0.6).filled();
                    chart.draw_series([Circle::new(point, 3, style)])?;
                }
            }
        }
        Ok(())
    })
}

/// Share of right answers in each tenth of confidence, at its mean confidence.
pub(in crate::report) fn reliability(bins: &[ReliabilityBin]) -> Result<String, DrawError> {
    svg(SIZE, |area| {
        let mut chart = square(area, "confidence", "share of answers with IoU ≥ .5")?;
        for bin in bins {
            let corners = [(bin.low + 0.004, 0.0), (bin.high - 0.004, bin.right)];
            chart.draw_series([Rectangle::new(corners, ink(RIGHT).mix(0.3).filled())])?;
        }
        chart.draw_series(dashes((0.0, 0.0), (1.0, 1.0), 5, 4, SOFT_INK.stroke_width(1)))?;
        let base = area.get_base_pixel();
        for bin in bins {
            let point = (bin.mean_confidence, bin.right);
            chart.draw_series([Circle::new(point, 4, ink(RIGHT).filled())])?;
            // The count stands inside the bar where there is room, else above it.
            let (x, y) = chart.backend_coord(&((bin.low + bin.high) / 2.0, 0.0));
            let style = at(font(10.0), HPos::Center, VPos::Bottom);
            area.draw_text(&bin.n.to_string(), &style, (x - base.0, y - base.1 - 3))?;
        }
        Ok(())
    })
}

type Square<'a, 'b> = ChartContext<
    'a,
    SVGBackend<'b>,
    Cartesian2d<plotters::coord::types::RangedCoordf64, plotters::coord::types::RangedCoordf64>,
>;

/// Axes from 0 to 1 both ways.
fn square<'a, 'b>(area: &'a Area<'b>, x: &str, y: &str) -> Result<Square<'a, 'b>, DrawError> {
    let mut chart = ChartBuilder::on(area)
        .margin(10)
        .x_label_area_size(38)
        .y_label_area_size(48)
        .build_cartesian_2d(0.0..1.0, 0.0..1.0)?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(GRID)
        .axis_style(SOFT_INK)
        .x_labels(6)
        .y_labels(6)
        .x_label_formatter(&|x| number(Some(*x), 1))
        .y_label_formatter(&|y| number(Some(*y), 1))
        .x_desc(x)
        .y_desc(y)
        .label_style(font(11.0))
        .axis_desc_style(font(12.0))
        .draw()?;
    Ok(chart)
}
