//! TC over a common factor of the thresholds.

use plotters::chart::ChartBuilder;
use plotters::element::{Circle, PathElement};
use plotters::series::{DashedLineSeries, LineSeries};
use plotters::style::text_anchor::{HPos, VPos};
use plotters::style::{Color as _, RGBColor, ShapeStyle};

use crate::error::Result;
use crate::evaluation::EvaluationReport;
use crate::report::draw::{
    Area, Decades, Done, Drawn, Theme, anchored, canvas, legend, place, tick, width_of,
};

/// Factors below are drawn here.
const FLOOR: f64 = 1e-4;

/// TC when every threshold is multiplied by a common factor, over that factor; a dot where an
/// object joins, which is at its error divided by its threshold. With held-out folds their TC is a
/// second line. `factor` is marked.
///
/// # Errors
/// When it cannot be drawn.
pub fn capability(
    report: &EvaluationReport,
    factor: Option<f64>,
    theme: &Theme,
    width: u32,
) -> Result<Drawn> {
    let em = theme.em();
    let same: Vec<(f64, &str)> = ratios(report.objects.iter().map(|o| (o.error, o)));
    let held_out: Vec<(f64, &str)> = report
        .held_out
        .iter()
        .flat_map(|held_out| {
            ratios(
                held_out
                    .objects
                    .iter()
                    .map(|o| o.error)
                    .zip(&report.objects),
            )
        })
        .collect();
    let count = report.objects.len().max(1) as f64;
    let all = same.iter().chain(&held_out).map(|(ratio, _)| *ratio);
    let axis = Decades::around(all.chain([0.5, 2.0]), FLOOR, 1.0);
    let [low, high] = [axis.low(), axis.high()];
    let ink = theme.foreground.rgb();
    let dashes = |color: RGBColor| ShapeStyle::from(&color).stroke_width(1);

    canvas([width, 21 * theme.em() as u32], theme, |area| {
        let mut chart = ChartBuilder::on(area)
            .margin(em / 2)
            .margin_top(2 * em)
            .margin_right(em)
            .x_label_area_size(3 * em)
            .y_label_area_size(4 * em)
            .build_cartesian_2d(axis, 0.0..1.0)?;
        chart
            .configure_mesh()
            .bold_line_style(theme.grid.rgb())
            .max_light_lines(0)
            .axis_style(theme.muted.rgb())
            .label_style(theme.text(theme.muted))
            .axis_desc_style(theme.text(theme.foreground))
            .y_labels(5)
            .x_desc("factor on all thresholds")
            .y_desc("TC")
            .x_label_formatter(&|x| tick(*x))
            .y_label_formatter(&|y| format!("{y:.1}"))
            .draw()?;
        let now = [(1.0, 0.0), (1.0, 1.0)];
        chart.draw_series(DashedLineSeries::new(now, 4, 4, dashes(theme.muted.rgb())))?;
        if !held_out.is_empty() {
            let line = steps(&held_out, count, low, high);
            chart.draw_series(DashedLineSeries::new(
                line,
                6,
                4,
                ShapeStyle::from(&theme.bad.rgb()).stroke_width(2),
            ))?;
        }
        chart.draw_series(LineSeries::new(
            steps(&same, count, low, high),
            theme.good.rgb().stroke_width(2),
        ))?;
        if let Some(factor) = factor.filter(|f| *f != 1.0) {
            let x = factor.clamp(low, high);
            chart.draw_series([PathElement::new(
                vec![(x, 0.0), (x, 1.0)],
                theme.accent.rgb().stroke_width(2),
            )])?;
        }
        let placed = chart.plotting_area().get_pixel_range();
        for (i, (ratio, name)) in same.iter().enumerate() {
            let at = (ratio.max(low), (i + 1) as f64 / count);
            chart.draw_series([Circle::new(at, 4, theme.good.rgb().filled())])?;
            label(area, theme, name, chart.backend_coord(&at), placed.0.start)?;
        }
        if !held_out.is_empty() {
            let lines = [
                ("same frames", theme.good.rgb()),
                ("held-out folds (dashed)", theme.bad.rgb()),
            ];
            legend(area, theme, placed.0.start, &lines)?;
        }
        area.draw(&PathElement::new(
            vec![(placed.0.start, placed.1.end), (placed.0.end, placed.1.end)],
            ink.stroke_width(1),
        ))?;
        Ok((place(placed), [low, high], [0.0, 1.0]))
    })
}

/// The name of the object whose dot is at (`x`, `y`): before the dot, unless there is no room from
/// `start` on; above the line that comes from the left.
fn label(area: &Area<'_>, theme: &Theme, name: &str, (x, y): (i32, i32), start: i32) -> Done {
    let em = theme.em();
    let (side, x, y) = match x - width_of(name, em) - em > start {
        true => (HPos::Right, x - em / 2, y),
        false => (HPos::Left, x + em / 2, y + em),
    };
    let style = theme
        .text(theme.foreground)
        .pos(anchored(side, VPos::Center));
    area.draw_text(name, &style, (x, y))
}

/// Errors divided by thresholds, the smallest first; without objects that have no error.
fn ratios<'a>(
    errors: impl Iterator<Item = (Option<f64>, &'a crate::evaluation::ObjectReport)>,
) -> Vec<(f64, &'a str)> {
    let mut all: Vec<(f64, &str)> = errors
        .filter_map(|(error, object)| Some((error? / object.threshold, object.name.as_str())))
        .collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all
}

/// The corners of the steps between the ends of the axis.
fn steps(ratios: &[(f64, &str)], count: f64, low: f64, high: f64) -> Vec<(f64, f64)> {
    let mut points = vec![(low, 0.0)];
    for (i, (ratio, _)) in ratios.iter().enumerate() {
        let x = ratio.clamp(low, high);
        points.push((x, i as f64 / count));
        points.push((x, (i + 1) as f64 / count));
    }
    points.push((high, ratios.len() as f64 / count));
    points
}
