//! Results and figures, the same for the terminal and the page.

mod evaluation;
mod figure;
mod measured;
#[cfg(feature = "cli")]
mod plots;
mod runs;

pub use evaluation::{
    EvaluationReport, HeldOutObjectReport, HeldOutReport, IntervalReport, IntervalsReport, JoinReport,
    MapReport, ObjectReport, Unmatched,
};
pub use figure::{Color, LineFigure, LineSeries, PlotArea, draw_lines, lines_to_svg};
#[cfg(feature = "cli")]
pub use plots::{Figure, figures};
pub use runs::{Group, GroupReport, ImprovementReport, ObjectRunsReport, Run, RunReport, Runs, RunsReport};
