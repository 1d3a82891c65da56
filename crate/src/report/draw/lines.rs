//! Line figures by plotters, on any of its backends: a canvas in the page, SVG in files.

use plotters::backend::SVGBackend;
use plotters::chart::ChartBuilder;
use plotters::coord::Shift;
use plotters::drawing::{DrawingArea, IntoDrawingArea};
use plotters::element::PathElement;
use plotters::prelude::DrawingBackend;
use plotters::series::LineSeries as Line;
use plotters::style::{Color as _, IntoFont, RGBColor, ShapeStyle, TextStyle};
use serde::{Deserialize, Serialize};

use super::measured::Measured;
use crate::error::{Error, Result};

/// A colour, `#rrggbb`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub struct Color(pub [u8; 3]);

impl TryFrom<String> for Color {
    type Error = Error;

    fn try_from(text: String) -> Result<Self> {
        let digits = text
            .strip_prefix('#')
            .filter(|d| d.len() == 6 && d.is_ascii());
        let parse = |d: &str| {
            let byte = |i: usize| u8::from_str_radix(&d[i..i + 2], 16).ok();
            Some([byte(0)?, byte(2)?, byte(4)?])
        };
        digits
            .and_then(parse)
            .map(Self)
            .ok_or_else(|| Error::input(format!("`{text}` is not a colour; expected #rrggbb")))
    }
}

impl Color {
    pub(in crate::report) fn rgb(self) -> RGBColor {
        RGBColor(self.0[0], self.0[1], self.0[2])
    }
}

/// One line of values over frames.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct LineSeries {
    /// Its name in the legend.
    pub label: String,
    /// Its colour.
    pub color: Color,
    /// One value a frame; NaN leaves a gap, as does a value beyond 1e100.
    pub values: Vec<f64>,
}

/// Values over the frames of a sequence.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct LineFigure {
    /// Shown above; empty for none.
    pub title: String,
    /// The label of the x axis.
    pub x_label: String,
    /// The label of the y axis.
    pub y_label: String,
    /// Frame number of the first value.
    pub start: f64,
    /// The lines, the last one on top.
    pub series: Vec<LineSeries>,
    /// Position of a vertical marker, as an index into the values.
    pub cursor: Option<f64>,
    /// Whether the y axis starts at 0, as it should for what is never negative.
    #[serde(default)]
    pub from_zero: bool,
    /// Colour of text and axes.
    pub foreground: Color,
    /// Colour of the plate.
    pub background: Color,
    /// Colour of the grid.
    pub grid: Color,
    /// Height of the text, in units of the backend (pixels).
    pub font_size: u32,
}

/// Where a figure has its axes: what it takes to find the value under a pointer, or to mark one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PlotArea {
    /// Pixel column of the first value.
    pub left: i32,
    /// Pixel column of the last value.
    pub right: i32,
    /// Pixel row of `high`.
    pub top: i32,
    /// Pixel row of `low`.
    pub bottom: i32,
    /// Frame number at `left`.
    pub start: f64,
    /// Frame number at `right`.
    pub end: f64,
    /// Value at `bottom`.
    pub low: f64,
    /// Value at `top`.
    pub high: f64,
}

/// Draws the figure over the whole of a backend and says where its axes are.
///
/// # Errors
/// When the backend fails.
pub fn draw_lines<B: DrawingBackend>(backend: B, figure: &LineFigure) -> Result<PlotArea> {
    draw(&Measured(backend).into_drawing_area(), figure)
        .map_err(|e| Error::input(format!("the figure could not be drawn: {e}")))
}

/// The figure as an SVG document of `width` x `height`.
///
/// # Errors
/// When a side is 0.
pub fn lines_to_svg(figure: &LineFigure, width: u32, height: u32) -> Result<String> {
    if width == 0 || height == 0 {
        return Err(Error::input(format!(
            "a figure of {width} x {height} has no room; expected at least 1 x 1"
        )));
    }
    let mut svg = String::new();
    draw_lines(SVGBackend::with_string(&mut svg, (width, height)), figure)?;
    Ok(svg)
}

fn draw<B: DrawingBackend>(
    area: &DrawingArea<B, Shift>,
    figure: &LineFigure,
) -> std::result::Result<PlotArea, plotters::drawing::DrawingAreaErrorKind<B::ErrorType>> {
    let em = figure.font_size.max(1) as i32;
    let foreground = figure.foreground.rgb();
    let text_style = || TextStyle::from(("sans-serif", em).into_font()).color(&foreground);
    let line_width = (em as u32).div_ceil(8);
    area.fill(&figure.background.rgb())?;

    let frames = figure
        .series
        .iter()
        .map(|s| s.values.len())
        .max()
        .unwrap_or(0);
    let span = frames.saturating_sub(1).max(1) as f64;
    let end = figure.start + span.max(RESOLVED * figure.start.abs());
    let [low, high] = value_range(figure);
    let has_legend = figure.series.iter().any(|s| !s.label.is_empty());
    // A low figure has room for few labels.
    let labels = (area.dim_in_pixel().1 as usize / (3 * em.max(1) as usize)).clamp(2, 5);
    let mut builder = ChartBuilder::on(area);
    builder
        .margin(em / 2)
        .margin_top(if figure.title.is_empty() && has_legend {
            2 * em
        } else {
            em / 2
        })
        .margin_right(em)
        .x_label_area_size(em * if figure.x_label.is_empty() { 2 } else { 3 })
        .y_label_area_size(em * 5);
    if !figure.title.is_empty() {
        builder.caption(&figure.title, text_style());
    }
    let mut chart = builder.build_cartesian_2d(figure.start..end, low..high)?;
    chart
        .configure_mesh()
        .x_labels(frames.clamp(2, 10))
        .y_labels(labels)
        .max_light_lines(0)
        .bold_line_style(figure.grid.rgb())
        .axis_style(figure.foreground.rgb())
        .label_style(text_style())
        .x_label_formatter(&|x| format!("{x:.0}"))
        .y_label_formatter(&|y| tick(*y, high - low))
        .x_desc(&figure.x_label)
        .y_desc(&figure.y_label)
        .draw()?;
    if let Some(cursor) = figure.cursor {
        let x = figure.start + cursor;
        let marker = ShapeStyle::from(&figure.foreground.rgb().mix(0.5)).stroke_width(line_width);
        chart.draw_series([PathElement::new(vec![(x, low), (x, high)], marker)])?;
    }
    for series in &figure.series {
        let style = ShapeStyle::from(&series.color.rgb())
            .stroke_width((em as u32).div_ceil(6))
            .filled();
        for run in runs(&series.values) {
            let points = run
                .clone()
                .map(|i| (figure.start + i as f64, series.values[i]));
            let dot = line_width * u32::from(run.len() == 1);
            chart.draw_series(Line::new(points, style).point_size(dot))?;
        }
    }
    if has_legend {
        legend(area, figure, &text_style())?;
    }
    area.present()?;
    let (columns, rows) = chart.plotting_area().get_pixel_range();
    Ok(PlotArea {
        left: columns.start,
        right: columns.end,
        top: rows.start,
        bottom: rows.end,
        start: figure.start,
        end,
        low,
        high,
    })
}

/// A label of the y axis, with the digits that tell it from its neighbours.
fn tick(y: f64, span: f64) -> String {
    if y != 0.0 && !(1e-3..1e9).contains(&span) {
        return format!("{y:.1e}");
    }
    // About five labels a span.
    let decimals = (0.7 - span.log10()).ceil().max(2.0) as usize;
    format!("{y:.decimals$}")
}

/// One line above the plot, from the right: a stroke of the colour and the label.
///
/// plotters' own legend measures its text through the page's elements, which a strict
/// Content-Security-Policy forbids.
fn legend<B: DrawingBackend>(
    area: &DrawingArea<B, Shift>,
    figure: &LineFigure,
    style: &TextStyle,
) -> std::result::Result<(), plotters::drawing::DrawingAreaErrorKind<B::ErrorType>> {
    let em = figure.font_size.max(1) as i32;
    let mut right = area.dim_in_pixel().0 as i32 - em;
    let middle = em;
    for series in figure.series.iter().rev() {
        let (width, height) = area.estimate_text_size(&series.label, style)?;
        let left = right - width as i32;
        area.draw_text(&series.label, style, (left, middle - height as i32 / 2))?;
        let stroke = vec![(left - 2 * em, middle), (left - em / 2, middle)];
        let line = ShapeStyle::from(&series.color.rgb()).stroke_width((em as u32).div_ceil(4));
        area.draw(&PathElement::new(stroke, line))?;
        right = left - 3 * em;
    }
    Ok(())
}

/// Values up to this are drawn: the span of an axis is in range then.
const DRAWN: f64 = 1e100;

/// The least span of an axis as a share of its values: below it plotters finds marks that do not
/// differ, and goes on looking for more.
const RESOLVED: f64 = 1e-9;

fn is_drawn(value: &f64) -> bool {
    value.abs() <= DRAWN
}

/// The range of all values that are drawn with a margin, never empty; starting at 0 if the figure
/// asks for it.
fn value_range(figure: &LineFigure) -> [f64; 2] {
    let values = || {
        figure
            .series
            .iter()
            .flat_map(|s| &s.values)
            .copied()
            .filter(is_drawn)
    };
    let low = values().fold(f64::INFINITY, f64::min);
    let high = values().fold(f64::NEG_INFINITY, f64::max);
    if figure.from_zero {
        return [0.0, if high > 1.0 / DRAWN { 1.08 * high } else { 1.0 }];
    }
    if low > high {
        return [-1.0, 1.0];
    }
    let margin = (0.08 * (high - low))
        .max(0.02)
        .max(RESOLVED * low.abs().max(high.abs()));
    [low - margin, high + margin]
}

/// The stretches of values that are drawn.
fn runs(values: &[f64]) -> Vec<std::ops::Range<usize>> {
    let mut out: Vec<std::ops::Range<usize>> = Vec::new();
    for (i, _) in values.iter().enumerate().filter(|(_, v)| is_drawn(v)) {
        match out.last_mut() {
            Some(run) if run.end == i => run.end = i + 1,
            _ => out.push(i..i + 1),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figure(values: &[f64], start: f64, from_zero: bool) -> LineFigure {
        let color = Color([0; 3]);
        LineFigure {
            title: String::new(),
            x_label: String::new(),
            y_label: String::new(),
            start,
            series: vec![LineSeries {
                label: "x".to_owned(),
                color,
                values: values.to_vec(),
            }],
            cursor: None,
            from_zero,
            foreground: color,
            background: color,
            grid: color,
            font_size: 12,
        }
    }

    #[test]
    fn every_axis_has_an_end() {
        let values = [
            [1e308, -1e308],
            [f64::INFINITY, f64::NAN],
            [1e17, 1e17],
            [1e100, -1e100],
            [5e-324, 0.0],
            [-1e99, 1.0],
        ];
        for values in values {
            for from_zero in [false, true] {
                for start in [0.0, 1e18, 1.8e19] {
                    let svg = lines_to_svg(&figure(&values, start, from_zero), 300, 200);
                    let svg = svg.expect("a figure");
                    assert!(svg.len() < 20_000 && !svg.contains("NaN"), "{values:?}");
                }
            }
        }
    }
}
