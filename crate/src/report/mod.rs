//! Results and figures, the same for the terminal and the page.

mod evaluation;
mod figure;
mod figures;
mod measured;
mod page;
#[cfg(feature = "cli")]
mod plots;
mod request;
mod runs;
mod unmatched;

pub use evaluation::{
    AssignmentReport, ContextReport, EvaluationReport, HeldOutObjectReport, HeldOutReport, IntervalReport,
    IntervalsReport, JoinReport, JoinSummary, KeypointError, MapReport, ObjectReport, RegressionReport,
    SequenceReport, SequencesReport, Unmatched,
};
pub use figure::{Color, LineFigure, LineSeries, draw_lines, lines_to_svg};
pub use figures::{Drawn, Figure, Theme, capability, evaluation_figures, matrix, sequences};
pub use page::{STYLE, evaluation_page};
#[cfg(feature = "cli")]
pub use plots::figures;
pub use request::{Inputs, Request, shell_line};
pub use runs::{Group, GroupReport, ImprovementReport, ObjectRunsReport, Run, RunReport, Runs, RunsReport};
pub use unmatched::{UnmatchedSequence, unmatched_sequences};
