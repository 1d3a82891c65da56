//! Results and figures, the same for the terminal and the page.

mod evaluation;
mod figure;
mod measured;

pub use evaluation::{
    EvaluationReport, HeldOutObjectReport, HeldOutReport, IntervalReport, IntervalsReport, JoinReport,
    MapReport, ObjectReport, Unmatched,
};
pub use figure::{Color, LineFigure, LineSeries, draw_lines, lines_to_svg};
