//! The errors of all keypoints for all objects as a heat map.

use plotters::element::{Circle, Rectangle};
use plotters::style::colors::colormaps::{ColorMap, ViridisRGB};
use plotters::style::text_anchor::{HPos, VPos};
use plotters::style::{Color as _, RGBColor, ShapeStyle};

use crate::error::Result;
use crate::evaluation::EvaluationReport;
use crate::report::draw::{
    Drawn, Theme, above, anchored, below, canvas, fitted, ink_on, power, short, tick, width_of,
};

/// Errors below this share of the largest have the brightest colour.
const SPAN: f64 = 1e-6;

/// The matrix of an evaluation, `width` pixels wide or as wide as its cells need. `chosen` are
/// keypoints in place of the best ones, by object; they are outlined in the accent colour.
///
/// Viridis, turned round: the smallest errors are the brightest.
///
/// # Errors
/// When it cannot be drawn.
pub fn matrix(
    report: &EvaluationReport,
    chosen: &[Option<usize>],
    theme: &Theme,
    width: u32,
) -> Result<Drawn> {
    let em = theme.em();
    let columns = report.errors.first().map_or(0, Vec::len).max(1) as i32;
    let rows = report.objects.len().max(1) as i32;
    let longest = report.objects.iter().map(|o| width_of(&o.name, em)).max();
    let labels = longest
        .unwrap_or(0)
        .clamp(3 * em, (width as i32 / 4).max(5 * em))
        + em;
    let cell = ((width as i32 - labels - em / 2) / columns).clamp(17.max(3 * em / 2), 6 * em);
    let row = (5 * em / 2).min(40);
    let (left, top) = (labels, 2 * em);
    let (right, bottom) = (left + columns * cell, top + rows * row);
    // Below the cells: the name of the columns, then the scale.
    let scale = bottom + 3 * em;
    let size = [
        (right + em / 2).max(width.min(20 * em as u32) as i32),
        scale + 3 * em,
    ];

    let finite = || report.errors.iter().flatten().flatten().copied();
    let high = finite().fold(0.0, f64::max).max(f64::MIN_POSITIVE);
    let low = finite()
        .filter(|e| *e > 0.0)
        .fold(high, f64::min)
        .max(SPAN * high);
    let span = (high / low).ln();
    let share = |error: f64| {
        if span > 0.0 {
            1.0 - (error.max(low) / low).ln() / span
        } else {
            0.5
        }
    };
    let color = |share: f64| -> RGBColor { ViridisRGB.get_color(share as f32) };
    let outlined = |color: RGBColor, stroke: u32| ShapeStyle::from(&color).stroke_width(stroke);
    let text = theme.text(theme.foreground);
    let muted = theme.text(theme.muted);
    let values_fit = cell >= width_of("0.0000", em - 2) + 6;

    canvas(size.map(|side| side.max(1) as u32), theme, |area| {
        for (k, (object, errors)) in report.objects.iter().zip(&report.errors).enumerate() {
            let y = top + k as i32 * row;
            let style = text.pos(anchored(HPos::Right, VPos::Center));
            let name = fitted(&object.name, em, labels - em);
            area.draw_text(&name, &style, (left - em / 2, y + row / 2))?;
            for (n, error) in errors.iter().enumerate() {
                let x = left + n as i32 * cell;
                let Some(error) = error else {
                    area.draw(&Rectangle::new(
                        [(x + 1, y + 1), (x + cell - 1, y + row - 1)],
                        theme.grid.rgb().filled(),
                    ))?;
                    continue;
                };
                let fill = color(share(*error));
                area.draw(&Rectangle::new(
                    [(x + 1, y + 1), (x + cell - 1, y + row - 1)],
                    fill.filled(),
                ))?;
                let ink = ink_on(fill);
                if values_fit {
                    let style = plotters::style::TextStyle::from(("sans-serif", em - 2))
                        .color(&ink)
                        .pos(anchored(HPos::Center, VPos::Center));
                    area.draw_text(&short(*error), &style, (x + cell / 2, y + row / 2))?;
                }
                if *error <= object.threshold {
                    let at = if values_fit {
                        (x + cell - 7, y + 7)
                    } else {
                        (x + cell / 2, y + row / 2)
                    };
                    area.draw(&Circle::new(at, 3, ink.filled()))?;
                }
            }
        }
        // Outlines lie over the neighbours.
        for (k, object) in report.objects.iter().enumerate() {
            let y = top + k as i32 * row;
            let outline = |n: usize, color: RGBColor| {
                let x = left + n as i32 * cell;
                Rectangle::new([(x, y), (x + cell, y + row)], outlined(color, 3))
            };
            if let Some(best) = object.best_keypoint {
                area.draw(&outline(best, theme.foreground.rgb()))?;
                let other = chosen.get(k).copied().flatten().filter(|n| *n != best);
                if let Some(other) = other {
                    area.draw(&outline(other, theme.accent.rgb()))?;
                }
            }
        }
        // Numbers that have room, at even steps.
        let widest = width_of(&(columns - 1).to_string(), em) + em / 2;
        let step = [1, 2, 5, 10, 20, 50, 100, 200, 500]
            .into_iter()
            .find(|step| step * cell >= widest)
            .unwrap_or(1000);
        for n in (0..columns).step_by(step as usize) {
            let style = muted.pos(anchored(HPos::Center, VPos::Bottom));
            area.draw_text(
                &n.to_string(),
                &style,
                (left + n * cell + cell / 2, top - em / 3),
            )?;
        }
        area.draw_text(
            "keypoint",
            &muted.pos(anchored(HPos::Left, VPos::Top)),
            (left, bottom + em / 2),
        )?;
        // The scale of colours.
        let length = (size[0] - left - 2 * em).clamp(6 * em, 22 * em);
        for i in 0..length {
            let fill = color(1.0 - f64::from(i) / f64::from(length - 1));
            area.draw(&Rectangle::new(
                [(left + i, scale), (left + i + 1, scale + em)],
                fill.filled(),
            ))?;
        }
        let style = muted.pos(anchored(HPos::Center, VPos::Top));
        let first = above(low);
        let last = below(high);
        let mut free = i32::MIN;
        for exponent in first..=last {
            let value = power(exponent);
            let x = left + ((1.0 - share(value)) * f64::from(length - 1)) as i32;
            let label = tick(value);
            let half = width_of(&label, em) / 2;
            if x - half > free {
                area.draw(&Rectangle::new(
                    [(x, scale + em), (x + 1, scale + em + em / 3)],
                    theme.muted.rgb().filled(),
                ))?;
                area.draw_text(&label, &style, (x, scale + em + em / 2))?;
                free = x + half + em / 2;
            }
        }
        let style = muted.pos(anchored(HPos::Right, VPos::Center));
        area.draw_text("error e", &style, (left - em / 2, scale + em / 2))?;
        Ok((
            [left, top, right - left, bottom - top].map(f64::from),
            [0.0, f64::from(columns)],
            [f64::from(rows), 0.0],
        ))
    })
}
