//! Results and figures, the same for the terminal and the page.

mod decades;
mod document;
mod figure;
mod figures;
mod measured;
mod page;
mod plots;
mod reference;
mod runs;
mod runs_page;
mod runs_report;
mod tables;
mod trajectories;

pub use figure::{Color, LineFigure, LineSeries, PlotArea, draw_lines, lines_to_svg};
pub use figures::{Drawn, Figure, Theme, capability, evaluation_figures, matrix, sequences};
pub use page::evaluation_page;
pub use plots::figures;
pub use reference::{
    Claim, ClaimComparison, ClaimReport, Pair, Reference, ReferenceNumbers, ReferenceReport,
    ReferenceRow, Statistic,
};
pub use runs::{DataSet, Epoch, Group, Grouping, Run, Runs, Unread, data_sets};
pub use runs_page::runs_page;
pub use runs_report::{
    GroupReport, ImprovementReport, IncompleteRun, ObjectRunsReport, RunReport, RunsReport,
};
pub use tables::{errors_csv, runs_csv, runs_markdown};
pub use trajectories::{Scene, Trajectory, trajectories};
