//! SVG figures by plotters, and the text in them.
//!
//! With a figure comes where its plot lies and the ranges of its axes, so that the page finds values
//! under the pointer.

use plotters::backend::SVGBackend;
use plotters::coord::Shift;
use plotters::drawing::{DrawingArea, DrawingAreaErrorKind, IntoDrawingArea};
use plotters::element::PathElement;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color as _, IntoFont, RGBColor, TextStyle};
use serde::{Deserialize, Serialize};

use super::decades::below;
use super::lines::Color;
use super::measured::{ADVANCE, Measured};
use crate::error::{Error, Result};

type Backend<'a> = Measured<SVGBackend<'a>>;
pub(in crate::report) type Area<'a> = DrawingArea<Backend<'a>, Shift>;
pub(in crate::report) type Done<T = ()> =
    std::result::Result<T, DrawingAreaErrorKind<std::io::Error>>;

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

    pub(in crate::report) fn em(&self) -> i32 {
        self.font_size.clamp(1, 100) as i32
    }

    pub(in crate::report) fn text(&self, color: Color) -> TextStyle<'static> {
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
    /// The width of the document in pixels.
    pub width: u32,
    /// The height of the document in pixels.
    pub height: u32,
    /// Left, top, width and height of the plot in these pixels.
    pub plot: [f64; 4],
    /// The values at the left and right end of the plot; a logarithmic axis but for the matrix.
    pub x: [f64; 2],
    /// The values at the bottom and top end of the plot; a logarithmic axis in `sequences`.
    pub y: [f64; 2],
}

/// Draws a document; `draw` returns the place of the plot and the ranges of its axes.
pub(in crate::report) fn canvas(
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
pub(in crate::report) fn place(ranges: (std::ops::Range<i32>, std::ops::Range<i32>)) -> [f64; 4] {
    let (x, y) = ranges;
    [x.start, y.start, x.end - x.start, y.end - y.start].map(f64::from)
}

/// The width of a text in pixels, as every figure estimates it.
pub(in crate::report) fn width_of(text: &str, em: i32) -> i32 {
    (ADVANCE * f64::from(em) * text.chars().count() as f64).ceil() as i32
}

/// A text of at most `room` pixels.
pub(in crate::report) fn fitted(text: &str, em: i32, room: i32) -> String {
    if width_of(text, em) <= room {
        return text.to_owned();
    }
    let count = (f64::from(room) / (ADVANCE * f64::from(em))).floor() as usize;
    let kept: String = text.chars().take(count.saturating_sub(1)).collect();
    kept + "…"
}

pub(in crate::report) fn anchored(h: HPos, v: VPos) -> Pos {
    Pos::new(h, v)
}

/// An error as it stands in a cell: two significant digits.
pub(in crate::report) fn short(value: f64) -> String {
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
pub(in crate::report) fn ink_on(color: RGBColor) -> RGBColor {
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

/// Which line is which, above a plot, from `left` on.
pub(in crate::report) fn legend(
    area: &Area<'_>,
    theme: &Theme,
    mut left: i32,
    lines: &[(&str, RGBColor)],
) -> Done {
    let em = theme.em();
    for (label, color) in lines {
        area.draw(&PathElement::new(
            vec![(left, em), (left + 2 * em, em)],
            color.stroke_width(2),
        ))?;
        let style = theme
            .text(theme.foreground)
            .pos(anchored(HPos::Left, VPos::Center));
        area.draw_text(label, &style, (left + 5 * em / 2, em))?;
        left += 4 * em + width_of(label, em);
    }
    Ok(())
}
