//! The error of one object by sequence, the worst one first.

use plotters::chart::ChartBuilder;
use plotters::element::{Circle, PathElement};
use plotters::series::DashedLineSeries;
use plotters::style::{Color as _, ShapeStyle};

use crate::error::Result;
use crate::report::draw::{Decades, Drawn, Theme, canvas, place, tick};

/// Errors below are drawn here.
const FLOOR: f64 = 1e-7;

/// A stem and a dot a sequence; `errors` are in order, the worst one first (ndc, mean squared
/// distance). `selected` is the position of one that is marked.
///
/// # Errors
/// When it cannot be drawn.
pub fn sequences(
    errors: &[f64],
    threshold: f64,
    selected: Option<usize>,
    theme: &Theme,
    width: u32,
) -> Result<Drawn> {
    let em = theme.em();
    let count = errors.len().max(1) as f64;
    let axis = Decades::around(errors.iter().copied().chain([threshold]), FLOOR, 1.0);
    let [low, high] = [axis.low(), axis.high()];
    canvas([width, 19 * theme.em() as u32], theme, |area| {
        let mut chart = ChartBuilder::on(area)
            .margin(em / 2)
            .margin_top(em)
            .margin_right(em)
            .x_label_area_size(3 * em)
            .y_label_area_size(5 * em)
            .build_cartesian_2d(0.0..count, axis)?;
        chart
            .configure_mesh()
            .disable_x_mesh()
            .bold_line_style(theme.grid.rgb())
            .max_light_lines(0)
            .axis_style(theme.muted.rgb())
            .label_style(theme.text(theme.muted))
            .axis_desc_style(theme.text(theme.foreground))
            .x_labels(0)
            .y_labels(6)
            .x_desc("sequences, worst first")
            .y_desc("error")
            .y_label_formatter(&|y| tick(*y))
            .draw()?;
        let placed = chart.plotting_area().get_pixel_range();
        let room = f64::from(placed.0.end - placed.0.start) / count;
        let radius = (room / 3.0).clamp(1.5, 4.0) as i32;
        for (i, error) in errors.iter().enumerate() {
            let color = if *error <= threshold {
                theme.good
            } else {
                theme.bad
            };
            let marked = selected == Some(i);
            let color = if marked { theme.accent } else { color }.rgb();
            let (x, y) = (i as f64 + 0.5, error.max(low));
            if room >= 4.0 || marked {
                let stem = color.mix(if marked { 1.0 } else { 0.45 });
                chart.draw_series([PathElement::new(
                    vec![(x, low), (x, y)],
                    stem.stroke_width(if marked { 2 } else { 1 }),
                )])?;
            }
            let radius = if marked { radius + 2 } else { radius };
            chart.draw_series([Circle::new((x, y), radius, color.filled())])?;
        }
        let line = [(0.0, threshold), (count, threshold)];
        let dashes = ShapeStyle::from(&theme.foreground.rgb());
        chart.draw_series(DashedLineSeries::new(line, 4, 4, dashes))?;
        Ok((place(placed), [0.0, count], [low, high]))
    })
}
