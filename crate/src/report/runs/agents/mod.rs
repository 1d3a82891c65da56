//! Runs of agents: how much they solve, and whether the tracking of their encoders says so before.

mod encoders;
mod plots;
mod run;
mod statistics;
mod tables;

pub use encoders::{Agent, AgentGroup, Agents, Encoder, Weights};
pub use run::AgentRun;
pub use statistics::{
    AgentGroupReport, AgentReport, AgentsReport, CorrelationReport, EncoderReport, IncompleteAgent,
    SuccessPoint,
};

pub(super) use plots::agents_figures;
pub use tables::{agents_csv, success_csv};
pub(super) use tables::{agents_lead, agents_tables};
