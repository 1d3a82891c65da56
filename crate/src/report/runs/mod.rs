//! Many runs: read, grouped, compared, and shown as tables, figures and documents.

mod agents;
mod data_set;
mod draws;
mod group;
mod grouping;
mod markdown;
mod page;
mod panels;
mod plots;
mod published;
mod reference;
mod run;
mod statistics;
mod tables;
mod trajectories;

pub use agents::{
    Agent, AgentGroup, AgentGroupReport, AgentReport, AgentRun, Agents, AgentsReport,
    CorrelationReport, Encoder, EncoderReport, IncompleteAgent, SuccessPoint, Weights, agents_csv,
    success_csv,
};
pub use data_set::{DataSet, data_sets};
pub use group::{Group, Runs};
pub use grouping::Grouping;
pub use markdown::runs_markdown;
pub use page::runs_page;
pub use plots::runs_figures;
pub use reference::{
    Claim, ClaimComparison, ClaimReport, Pair, Reference, ReferenceNumbers, ReferenceReport,
    ReferenceRow, Statistic,
};
pub use run::{Epoch, Run, Unread};
pub use statistics::{
    GroupReport, ImprovementReport, IncompleteRun, ObjectRunsReport, RunReport, RunsReport,
};
pub use tables::{errors_csv, runs_csv, runs_latex, runs_tables};
pub use trajectories::{Scene, Trajectory, trajectories};
