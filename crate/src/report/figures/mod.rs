//! The figures of one evaluation, as SVG by plotters: the matrix of errors, TC over thresholds,
//! errors by sequence.
//!
//! What they show beside the picture (the place of the plot and the ranges of its axes) lets the
//! page find values under the pointer.

mod capability;
mod matrix;
mod sequences;

use plotters::backend::SVGBackend;
use plotters::coord::Shift;
use plotters::drawing::{DrawingArea, DrawingAreaErrorKind, IntoDrawingArea};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color as _, IntoFont, RGBColor, TextStyle};
use serde::{Deserialize, Serialize};

use super::decades::below;
use super::figure::Color;
use super::measured::{ADVANCE, Measured};
use crate::error::{Error, Result};
use crate::evaluation::EvaluationReport;

pub use capability::capability;
pub use matrix::matrix;
pub use sequences::sequences;

type Backend<'a> = Measured<SVGBackend<'a>>;
type Area<'a> = DrawingArea<Backend<'a>, Shift>;
type Done<T = ()> = std::result::Result<T, DrawingAreaErrorKind<std::io::Error>>;

/// One figure in a file or on a page.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Figure {
    /// The name of its files, without the ending.
    pub name: String,
    /// What it shows, in one sentence.
    pub caption: String,
    /// The SVG document.
    pub svg: String,
}

/// Colours and sizes of a figure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Theme {
    /// Text and axes.
    pub foreground: Color,
    /// Text of less weight.
    pub muted: Color,
    /// The plate.
    pub background: Color,
    /// The grid.
    pub grid: Color,
    /// Lines, and what meets its threshold.
    pub good: Color,
    /// What does not meet its threshold.
    pub bad: Color,
    /// What the user has chosen.
    pub accent: Color,
    /// Height of the text in pixels.
    pub font_size: u32,
}

impl Theme {
    /// Dark on white, for files.
    pub const PRINT: Self = Self {
        foreground: Color([0x1b, 0x1f, 0x24]),
        muted: Color([0x56, 0x60, 0x6b]),
        background: Color([0xff, 0xff, 0xff]),
        grid: Color([0xe3, 0xe7, 0xeb]),
        good: Color([0x00, 0x70, 0x5c]),
        bad: Color([0xc2, 0x50, 0x0a]),
        accent: Color([0x1a, 0x5f, 0xc8]),
        font_size: 13,
    };

    fn em(&self) -> i32 {
        self.font_size.clamp(1, 100) as i32
    }

    fn text(&self, color: Color) -> TextStyle<'static> {
        let mut style = TextStyle::from(("sans-serif", self.em()).into_font());
        style.color = color.rgb().to_backend_color();
        style
    }
}

/// A figure and where its plot lies.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Drawn {
    /// The SVG document.
    pub svg: String,
    /// Of the document, in its pixels.
    pub width: u32,
    /// Of the document, in its pixels.
    pub height: u32,
    /// Left, top, width and height of the plot in these pixels.
    pub plot: [f64; 4],
    /// The values at the left and right end of the plot; a logarithmic axis but for the matrix.
    pub x: [f64; 2],
    /// The values at the bottom and top end of the plot; a logarithmic axis in `sequences`.
    pub y: [f64; 2],
}

/// All figures of an evaluation, for files; those by sequence where it has the sequences.
///
/// # Errors
/// When a figure cannot be drawn.
pub fn evaluation_figures(report: &EvaluationReport) -> Result<Vec<Figure>> {
    const WIDTH: u32 = 880;
    let theme = &Theme::PRINT;
    let mut figures = vec![
        Figure {
            name: "errors".to_owned(),
            caption: "Tracking error of every keypoint for every object, on a logarithmic scale of colour: the brighter, the \
                      closer. Outlined: the best keypoint of the object; dots: errors up to the threshold."
                .to_owned(),
            svg: matrix(report, &[], theme, WIDTH)?.svg,
        },
        Figure {
            name: "capability".to_owned(),
            caption: "Tracking capability with all thresholds times a common factor; an object joins where the factor reaches \
                      its error divided by its threshold. Dashed: the thresholds as they are."
                .to_owned(),
            svg: capability(report, None, theme, WIDTH)?.svg,
        },
    ];
    for of in report.sequences.iter().flatten() {
        let threshold = report
            .objects
            .iter()
            .find(|object| object.name == of.object);
        let errors: Vec<f64> = of.errors.iter().map(|sequence| sequence.error).collect();
        if let Some(object) = threshold {
            figures.push(Figure {
                name: format!("sequences-{}", file_name(&of.object)),
                caption: format!(
                    "Error of {} with keypoint {} in each of {} sequences, the worst one first; dashed: the threshold.",
                    of.object,
                    of.keypoint,
                    errors.len()
                ),
                svg: sequences(&errors, object.threshold, None, theme, WIDTH)?.svg,
            });
        }
    }
    Ok(figures)
}

/// A name that every file system takes.
pub(crate) fn file_name(name: &str) -> String {
    let plain = |c: char| {
        if c.is_ascii_alphanumeric() || c == '-' || c == '.' {
            c
        } else {
            '_'
        }
    };
    name.chars().map(plain).collect()
}

/// Draws a document; `draw` returns the place of the plot and the ranges of its axes.
fn document(
    size: [u32; 2],
    theme: &Theme,
    draw: impl for<'a> FnOnce(&Area<'a>) -> Done<([f64; 4], [f64; 2], [f64; 2])>,
) -> Result<Drawn> {
    let [width, height] = size;
    if width < 100 || height == 0 || width > 20_000 || height > 20_000 {
        return Err(Error::input(format!(
            "a figure of {width} x {height} pixels; expected at least 100 and at most 20000 a side"
        )));
    }
    let mut svg = String::new();
    let drawn = || -> Done<([f64; 4], [f64; 2], [f64; 2])> {
        let area = Measured(SVGBackend::with_string(&mut svg, (width, height))).into_drawing_area();
        area.fill(&theme.background.rgb())?;
        let placed = draw(&area)?;
        area.present()?;
        Ok(placed)
    };
    let (plot, x, y) =
        drawn().map_err(|e| Error::input(format!("the figure could not be drawn: {e}")))?;
    Ok(Drawn {
        svg,
        width,
        height,
        plot,
        x,
        y,
    })
}

/// The place of a chart's plot.
fn place(ranges: (std::ops::Range<i32>, std::ops::Range<i32>)) -> [f64; 4] {
    let (x, y) = ranges;
    [x.start, y.start, x.end - x.start, y.end - y.start].map(f64::from)
}

/// The width of a text in pixels, as every figure estimates it.
fn width_of(text: &str, em: i32) -> i32 {
    (ADVANCE * f64::from(em) * text.chars().count() as f64).ceil() as i32
}

/// A text of at most `room` pixels.
fn fitted(text: &str, em: i32, room: i32) -> String {
    if width_of(text, em) <= room {
        return text.to_owned();
    }
    let count = (f64::from(room) / (ADVANCE * f64::from(em))).floor() as usize;
    let kept: String = text.chars().take(count.saturating_sub(1)).collect();
    kept + "…"
}

fn anchored(h: HPos, v: VPos) -> Pos {
    Pos::new(h, v)
}

/// An error as it stands in a cell: two significant digits.
fn short(value: f64) -> String {
    if value == 0.0 {
        "0".to_owned()
    } else if (1e-3..1e4).contains(&value) {
        let digits = (1 - below(value)).max(0) as usize;
        format!("{value:.digits$}")
    } else {
        format!("{value:.0e}")
    }
}

/// Black or white, whichever can be read on `color`.
fn ink_on(color: RGBColor) -> RGBColor {
    let linear = |c: u8| {
        let c = f64::from(c) / 255.0;
        if c <= 0.04045 {
            c / 12.92
        } else {
            ((c + 0.055) / 1.055).powf(2.4)
        }
    };
    let (r, g, b) = color.rgb();
    let luminance = 0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b);
    // Where the contrasts with black and with white are equal (WCAG's formula).
    if luminance > 0.179 {
        RGBColor(0, 0, 0)
    } else {
        RGBColor(255, 255, 255)
    }
}
