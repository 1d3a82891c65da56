//! The errors of all keypoints for all objects as a heat map.

use plotters::element::{Circle, Rectangle};
use plotters::style::colors::colormaps::{ColorMap, ViridisRGB};
use plotters::style::text_anchor::{HPos, VPos};
use plotters::style::{Color as _, RGBColor, ShapeStyle, TextStyle};

use crate::error::Result;
use crate::evaluation::EvaluationReport;
use crate::report::draw::{
    Area, Done, Drawn, Theme, above, anchored, below, canvas, fitted, ink_on, power, short, tick,
    width_of,
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
    let matrix = Matrix::new(report, theme, width);
    canvas(matrix.size.map(|side| side.max(1) as u32), theme, |area| {
        matrix.draw_rows(area)?;
        matrix.draw_outlines(area, chosen)?;
        matrix.draw_numbers(area)?;
        matrix.draw_scale(area)?;
        let Matrix {
            left,
            top,
            right,
            bottom,
            columns,
            rows,
            ..
        } = matrix;
        Ok((
            [left, top, right - left, bottom - top].map(f64::from),
            [0.0, f64::from(columns)],
            [f64::from(rows), 0.0],
        ))
    })
}

/// The layout of a matrix, in pixels.
struct Matrix<'a> {
    report: &'a EvaluationReport,
    theme: &'a Theme,
    colors: Colors,
    em: i32,
    columns: i32,
    rows: i32,
    /// The width of the names of the objects.
    labels: i32,
    /// The width of a column.
    cell: i32,
    /// The height of a row.
    row: i32,
    left: i32,
    top: i32,
    right: i32,
    bottom: i32,
    /// The top of the scale of colours, which is below the cells and the name of the columns.
    scale: i32,
    size: [i32; 2],
}

/// The colours of errors, on a logarithmic scale.
struct Colors {
    low: f64,
    high: f64,
}

impl Colors {
    fn new(report: &EvaluationReport) -> Self {
        let finite = || report.errors.iter().flatten().flatten().copied();
        let high = finite().fold(0.0, f64::max).max(f64::MIN_POSITIVE);
        let low = finite()
            .filter(|e| *e > 0.0)
            .fold(high, f64::min)
            .max(SPAN * high);
        Self { low, high }
    }

    /// 1 for the smallest errors, 0 for the largest.
    fn share(&self, error: f64) -> f64 {
        let span = (self.high / self.low).ln();
        if span > 0.0 {
            1.0 - (error.max(self.low) / self.low).ln() / span
        } else {
            0.5
        }
    }
}

fn color(share: f64) -> RGBColor {
    ViridisRGB.get_color(share as f32)
}

impl<'a> Matrix<'a> {
    fn new(report: &'a EvaluationReport, theme: &'a Theme, width: u32) -> Self {
        let em = theme.em();
        let columns = report.errors.first().map_or(0, Vec::len).max(1) as i32;
        let rows = report.objects.len().max(1) as i32;
        let longest = report.objects.iter().map(|o| width_of(&o.name, em)).max();
        let labels = longest
            .unwrap_or(0)
            .clamp(3 * em, (width as i32 / 4).max(5 * em))
            + em;
        let cell = ((width as i32 - labels - em / 2) / columns).clamp(16.max(5 * em / 4), 6 * em);
        let row = (5 * em / 2).min(40);
        let (left, top) = (labels, 2 * em);
        let (right, bottom) = (left + columns * cell, top + rows * row);
        let scale = bottom + 3 * em;
        Self {
            report,
            theme,
            colors: Colors::new(report),
            em,
            columns,
            rows,
            labels,
            cell,
            row,
            left,
            top,
            right,
            bottom,
            scale,
            size: [
                (right + em / 2).max(width.min(20 * em as u32) as i32),
                scale + 3 * em,
            ],
        }
    }

    /// The left end of column `n`.
    fn x(&self, n: usize) -> i32 {
        self.left + n as i32 * self.cell
    }

    /// The upper end of row `k`.
    fn y(&self, k: usize) -> i32 {
        self.top + k as i32 * self.row
    }

    /// The names of the objects and the cells.
    fn draw_rows(&self, area: &Area) -> Done {
        let text = self.theme.text(self.theme.foreground);
        for (k, (object, errors)) in self
            .report
            .objects
            .iter()
            .zip(&self.report.errors)
            .enumerate()
        {
            let style = text.pos(anchored(HPos::Right, VPos::Center));
            let name = fitted(&object.name, self.em, self.labels - self.em);
            let at = (self.left - self.em / 2, self.y(k) + self.row / 2);
            area.draw_text(&name, &style, at)?;
            for (n, error) in errors.iter().enumerate() {
                self.draw_cell(area, (self.x(n), self.y(k)), *error, object.threshold)?;
            }
        }
        Ok(())
    }

    fn draw_cell(
        &self,
        area: &Area,
        (x, y): (i32, i32),
        error: Option<f64>,
        threshold: f64,
    ) -> Done {
        let (cell, row, em) = (self.cell, self.row, self.em);
        let plate = [(x + 1, y + 1), (x + cell - 1, y + row - 1)];
        let Some(error) = error else {
            return area.draw(&Rectangle::new(plate, self.theme.grid.rgb().filled()));
        };
        let fill = color(self.colors.share(error));
        area.draw(&Rectangle::new(plate, fill.filled()))?;
        let ink = ink_on(fill);
        let values_fit = cell >= width_of("0.0000", em - 2) + 6;
        if values_fit {
            let style = TextStyle::from(("sans-serif", em - 2))
                .color(&ink)
                .pos(anchored(HPos::Center, VPos::Center));
            area.draw_text(&short(error), &style, (x + cell / 2, y + row / 2))?;
        }
        if error <= threshold {
            let at = match values_fit {
                true => (x + cell - 7, y + 7),
                false => (x + cell / 2, y + row / 2),
            };
            area.draw(&Circle::new(at, 3, ink.filled()))?;
        }
        Ok(())
    }

    /// Outlines of the best and the chosen keypoints, which lie over the neighbours.
    fn draw_outlines(&self, area: &Area, chosen: &[Option<usize>]) -> Done {
        for (k, object) in self.report.objects.iter().enumerate() {
            let outline = |n: usize, color: RGBColor| {
                let (x, y) = (self.x(n), self.y(k));
                let style = ShapeStyle::from(&color).stroke_width(3);
                Rectangle::new([(x, y), (x + self.cell, y + self.row)], style)
            };
            if let Some(best) = object.best_keypoint {
                area.draw(&outline(best, self.theme.foreground.rgb()))?;
                let other = chosen.get(k).copied().flatten().filter(|n| *n != best);
                if let Some(other) = other {
                    area.draw(&outline(other, self.theme.accent.rgb()))?;
                }
            }
        }
        Ok(())
    }

    /// The numbers of the keypoints that have room, at even steps.
    fn draw_numbers(&self, area: &Area) -> Done {
        let em = self.em;
        let muted = self.theme.text(self.theme.muted);
        let widest = width_of(&(self.columns - 1).to_string(), em) + em / 2;
        let step = [1, 2, 5, 10, 20, 50, 100, 200, 500]
            .into_iter()
            .find(|step| step * self.cell >= widest)
            .unwrap_or(1000);
        for n in (0..self.columns as usize).step_by(step as usize) {
            let style = muted.pos(anchored(HPos::Center, VPos::Bottom));
            let at = (self.x(n) + self.cell / 2, self.top - em / 3);
            area.draw_text(&n.to_string(), &style, at)?;
        }
        let style = muted.pos(anchored(HPos::Left, VPos::Top));
        area.draw_text("keypoint", &style, (self.left, self.bottom + em / 2))
    }

    /// The scale of colours.
    fn draw_scale(&self, area: &Area) -> Done {
        let (em, left, scale) = (self.em, self.left, self.scale);
        let muted = self.theme.text(self.theme.muted);
        let length = (self.size[0] - left - 2 * em).clamp(6 * em, 22 * em);
        for i in 0..length {
            let fill = color(1.0 - f64::from(i) / f64::from(length - 1));
            area.draw(&Rectangle::new(
                [(left + i, scale), (left + i + 1, scale + em)],
                fill.filled(),
            ))?;
        }
        let style = muted.pos(anchored(HPos::Center, VPos::Top));
        let mut free = i32::MIN;
        for exponent in above(self.colors.low)..=below(self.colors.high) {
            let value = power(exponent);
            let x = left + ((1.0 - self.colors.share(value)) * f64::from(length - 1)) as i32;
            let label = tick(value);
            let half = width_of(&label, em) / 2;
            if x - half > free {
                area.draw(&Rectangle::new(
                    [(x, scale + em), (x + 1, scale + em + em / 3)],
                    self.theme.muted.rgb().filled(),
                ))?;
                area.draw_text(&label, &style, (x, scale + em + em / 2))?;
                free = x + half + em / 2;
            }
        }
        let style = muted.pos(anchored(HPos::Right, VPos::Center));
        area.draw_text("error e", &style, (left - em / 2, scale + em / 2))
    }
}
