//! What all figures over runs are drawn on: panels side by side, below a legend.
//!
//! Colours are those of Okabe and Ito, which people with any kind of colour vision tell apart.

use plotters::backend::{DrawingBackend, SVGBackend};
use plotters::chart::MeshStyle;
use plotters::coord::Shift;
use plotters::coord::ranged1d::Ranged;
use plotters::drawing::{DrawingArea, DrawingAreaErrorKind, IntoDrawingArea};
use plotters::element::Rectangle;
use plotters::style::{IntoFont, RGBColor, ShapeStyle, TextStyle};

use crate::error::{Error, Result};
use crate::report::draw::{Measured, width_of};

const PALETTE: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(230, 159, 0),
    RGBColor(0, 158, 115),
    RGBColor(213, 94, 0),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(90, 90, 90),
];
pub(super) const INK: RGBColor = RGBColor(34, 34, 34);
const GRID: RGBColor = RGBColor(222, 222, 222);
pub(super) const PAPER: RGBColor = RGBColor(255, 255, 255);

/// Values below this are drawn here on logarithmic axes.
pub(super) const FLOOR: f64 = 1e-5;
/// Room around the values on logarithmic axes, as a factor.
pub(super) const MARGIN: f64 = 1.2;

/// Height of the text in pixels.
pub(super) const EM: i32 = 13;
/// The size of one panel.
pub(super) const PANEL: [u32; 2] = [300, 250];
/// Room for a legend of one row above the panels, and for every row more.
const LEGEND: u32 = 34;
const LEGEND_ROW: u32 = 20;
/// From the start of a swatch to its label, and between a label and the next swatch.
const SWATCH: i32 = 18;
const SPACE: i32 = 2 * EM;

pub(super) type Backend<'a> = Measured<SVGBackend<'a>>;
pub(super) type Area<'a> = DrawingArea<Backend<'a>, Shift>;
pub(super) type Done = std::result::Result<(), DrawingAreaErrorKind<std::io::Error>>;

/// The colour of the group in place `i`.
pub(super) fn color(i: usize) -> RGBColor {
    PALETTE[i % PALETTE.len()]
}

pub(super) fn text<'a>() -> TextStyle<'a> {
    TextStyle::from(("sans-serif", EM).into_font()).color(&INK)
}

/// The grid, the axes and the text of every chart.
pub(super) fn plain<'m, 'a, 'b, X: Ranged, Y: Ranged, DB: DrawingBackend>(
    mesh: &'m mut MeshStyle<'a, 'b, X, Y, DB>,
) -> &'m mut MeshStyle<'a, 'b, X, Y, DB> {
    mesh.bold_line_style(GRID)
        .max_light_lines(0)
        .axis_style(INK)
        .label_style(text())
}

/// Draws on `count` panels side by side, below a legend that takes as many rows as it needs.
pub(super) fn panels(
    count: usize,
    width: u32,
    height: u32,
    legend: &[(String, RGBColor)],
    draw: impl for<'a> Fn(usize, &Area<'a>) -> Done,
) -> Result<String> {
    let widest = legend.iter().map(|entry| entry_width(entry) + SPACE).max();
    let across = (width * count.max(1) as u32).max(widest.unwrap_or(0) as u32);
    let rows = legend_rows(legend, across as i32);
    let above = match rows.len() as u32 {
        0 => 0,
        rows => LEGEND + LEGEND_ROW * (rows - 1),
    };
    let mut svg = String::new();
    let mut drawn = || -> Done {
        let size = (across, height + above);
        let area = Measured(SVGBackend::with_string(&mut svg, size)).into_drawing_area();
        area.fill(&PAPER)?;
        let (top, below) = area.split_vertically(above);
        for (row, entries) in rows.iter().enumerate() {
            let middle = LEGEND as i32 / 2 + row as i32 * LEGEND_ROW as i32;
            draw_legend(&top, middle, entries)?;
        }
        for (i, panel) in below.split_evenly((1, count.max(1))).iter().enumerate() {
            draw(i, panel)?;
        }
        area.present()
    };
    drawn().map_err(|e| Error::input(format!("a figure could not be drawn: {e}")))?;
    Ok(svg)
}

fn entry_width((label, _): &(String, RGBColor)) -> i32 {
    SWATCH + width_of(label, EM) + SPACE
}

/// The entries of a legend in rows of at most `width` pixels.
fn legend_rows(legend: &[(String, RGBColor)], width: i32) -> Vec<Vec<&(String, RGBColor)>> {
    let mut rows: Vec<Vec<&(String, RGBColor)>> = Vec::new();
    let mut left = width;
    for entry in legend {
        let own = entry_width(entry);
        match rows.last_mut() {
            Some(row) if left >= own => row.push(entry),
            _ => {
                rows.push(vec![entry]);
                left = width - EM;
            }
        }
        left -= own;
    }
    rows
}

fn draw_legend(area: &Area<'_>, middle: i32, entries: &[&(String, RGBColor)]) -> Done {
    let mut left = EM;
    for entry in entries {
        let (label, color) = entry;
        let swatch = [(left, middle - 5), (left + 12, middle + 5)];
        area.draw(&Rectangle::new(swatch, ShapeStyle::from(color).filled()))?;
        area.draw_text(label, &text(), (left + SWATCH, middle - EM / 2))?;
        left += entry_width(entry);
    }
    Ok(())
}
