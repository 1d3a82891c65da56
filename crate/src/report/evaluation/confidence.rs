//! TC over the confidence that keypoints need to count.

use plotters::chart::ChartBuilder;
use plotters::element::{Circle, PathElement};
use plotters::series::{DashedLineSeries, LineSeries};
use plotters::style::{Color as _, RGBColor, ShapeStyle};

use crate::error::{Error, Result};
use crate::evaluation::EvaluationReport;
use crate::report::draw::{Drawn, Theme, canvas, legend, place, short};

/// Confidences beyond are drawn here.
const FAR: f64 = 1e100;

/// TC when keypoints below a confidence count as missing, over that confidence, and the share of the
/// keypoints that is left (dashed). The smallest confidence in force is marked. A TC that is unknown
/// is left out.
///
/// # Errors
/// When the evaluation has no confidences, or it cannot be drawn.
pub fn confidence(report: &EvaluationReport, theme: &Theme, width: u32) -> Result<Drawn> {
    let found = report.confidence.as_ref();
    let Some(found) = found.filter(|found| !found.levels.is_empty()) else {
        return Err(Error::input("the keypoints have no confidences to draw"));
    };
    let em = theme.em();
    let drawable = |least: f64| least.clamp(-FAR, FAR);
    let ends = found.levels.iter().map(|level| level.least);
    let ends = ends.chain(found.least_keypoints).map(drawable);
    let [low, high] = ends.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], level| {
        [low.min(level), high.max(level)]
    });
    // An axis needs a width that its labels can tell.
    let [low, high] = match high - low > (1e-9 * low.abs().max(high.abs())).max(1e-100) {
        true => [low, high],
        false => [
            low - low.abs().max(1.0) / 2.0,
            low + low.abs().max(1.0) / 2.0,
        ],
    };
    let at = |least: f64, share: f64| (drawable(least), share.clamp(0.0, 1.0));
    let levels = || found.levels.iter();
    let tc: Vec<(f64, f64)> = levels()
        .filter_map(|level| Some(at(level.least, level.tc?)))
        .collect();
    let kept = levels().map(|level| at(level.least, level.kept));
    let (good, muted) = (theme.good.rgb(), theme.muted.rgb());
    let dashed = |color: RGBColor| ShapeStyle::from(&color).stroke_width(2);

    canvas([width, 21 * theme.em() as u32], theme, |area| {
        let mut chart = ChartBuilder::on(area)
            .margin(em / 2)
            .margin_top(2 * em)
            .margin_right(em)
            .x_label_area_size(3 * em)
            .y_label_area_size(4 * em)
            .build_cartesian_2d(low..high, 0.0..1.0)?;
        chart
            .configure_mesh()
            .bold_line_style(theme.grid.rgb())
            .max_light_lines(0)
            .axis_style(theme.muted.rgb())
            .label_style(theme.text(theme.muted))
            .axis_desc_style(theme.text(theme.foreground))
            .x_labels(6)
            .y_labels(5)
            .x_desc("smallest confidence that counts")
            .y_desc("TC")
            .x_label_formatter(&|x| level(*x))
            .y_label_formatter(&|y| format!("{y:.1}"))
            .draw()?;
        chart.draw_series(DashedLineSeries::new(kept, 6, 4, dashed(muted)))?;
        chart.draw_series(LineSeries::new(tc.iter().copied(), good.stroke_width(2)))?;
        chart.draw_series(tc.iter().map(|at| Circle::new(*at, 4, good.filled())))?;
        if let Some(least) = found.least_keypoints.map(drawable) {
            chart.draw_series([PathElement::new(
                vec![(least, 0.0), (least, 1.0)],
                theme.accent.rgb().stroke_width(2),
            )])?;
        }
        let placed = chart.plotting_area().get_pixel_range();
        let lines = [("TC", good), ("keypoints left (dashed)", muted)];
        legend(area, theme, placed.0.start, &lines)?;
        Ok((place(placed), [low, high], [0.0, 1.0]))
    })
}

/// A confidence on the axis.
fn level(value: f64) -> String {
    if value.abs() >= 1e4 {
        return short(value);
    }
    let text = format!("{value:.3}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}
