//! Runs in groups.

use std::sync::Arc;

use super::agents::{AgentGroup, Agents};
use super::data_set::data_sets;
use super::grouping::{Grouping, grouped, has_setting};
use super::run::Run;
use crate::error::{Error, Result};
use crate::evaluation::Thresholds;
use crate::metric::Object;

/// Runs of one group.
#[derive(Debug, Clone)]
pub struct Group {
    /// Its name; by settings the architecture, and where several groups have the same one, the settings
    /// that differ.
    pub name: String,
    /// The runs, complete ones first.
    pub runs: Vec<Arc<Run>>,
}

impl Group {
    /// The complete runs.
    pub fn complete(&self) -> impl Iterator<Item = &Run> + Clone {
        self.runs
            .iter()
            .map(Arc::as_ref)
            .filter(|run| run.incomplete.is_none())
    }
}

/// Runs in groups, and the objects that all of them have.
#[derive(Debug, Clone)]
pub struct Runs {
    /// The objects with their thresholds.
    pub objects: Vec<Object>,
    /// The groups, by name.
    pub groups: Vec<Group>,
    /// The groups of agents, by name.
    pub agents: Vec<AgentGroup>,
}

impl Runs {
    /// Puts runs into groups, and agents into theirs. A setting to group by has to be one of the
    /// runs or of the agents; those without it are grouped by all settings.
    ///
    /// # Errors
    /// When nothing is complete, when runs are not of one data set ([`data_sets`]), so that their
    /// errors cannot be compared, when there is no such setting to group by, and when a threshold
    /// is given for an object that neither runs nor the agents' encoders have.
    pub fn new(
        runs: Vec<Arc<Run>>,
        agents: &Agents,
        thresholds: &Thresholds,
        grouping: &Grouping,
    ) -> Result<Self> {
        let mut runs = of_one_data_set(runs)?;
        need_complete(&runs, agents)?;
        runs.sort_by(|a, b| {
            (a.incomplete.is_some(), a.seed, &a.name).cmp(&(
                b.incomplete.is_some(),
                b.seed,
                &b.name,
            ))
        });
        let names = match runs.first() {
            Some(run) => run.objects.clone(),
            None => agents.objects(),
        };
        let objects = thresholds.objects(&names, "the runs have", 1.0)?;
        let can_group = has_setting(&runs, grouping);
        let by = match !can_group && agents.have_setting(grouping) {
            true => &Grouping::Settings,
            false => grouping,
        };
        let groups = grouped(runs, by)?.into_iter();
        let groups: Vec<Group> = groups.map(|(name, runs)| Group { name, runs }).collect();
        let family = |run: &Arc<Run>| {
            let holds = |group: &&Group| group.runs.iter().any(|other| Arc::ptr_eq(other, run));
            groups.iter().find(holds).map(|group| group.name.clone())
        };
        let agents = agents.grouped(&family, thresholds, grouping, can_group)?;
        Ok(Self {
            objects,
            groups,
            agents,
        })
    }
}

/// The runs, if all are of one data set.
fn of_one_data_set(runs: Vec<Arc<Run>>) -> Result<Vec<Arc<Run>>> {
    let mut sets = data_sets(runs);
    if let Some(reason) = sets.iter().find_map(|set| set.reason.as_ref()) {
        return Err(Error::mismatch(format!(
            "the runs are of {} different data sets, whose errors cannot be compared ({reason}); report on them one by one",
            sets.len()
        )));
    }
    Ok(sets.pop().map(|set| set.runs).unwrap_or_default())
}

/// Refuses runs and agents of which nothing is complete.
fn need_complete(runs: &[Arc<Run>], agents: &Agents) -> Result<()> {
    let of_runs = runs.iter().map(|run| (&run.name, &run.incomplete));
    let of_agents = agents.runs().iter().map(|run| (&run.name, &run.incomplete));
    let all: Vec<(&String, &Option<String>)> = of_runs.chain(of_agents).collect();
    if all.iter().any(|(_, incomplete)| incomplete.is_none()) {
        return Ok(());
    }
    let why = all
        .iter()
        .take(3)
        .filter_map(|(name, incomplete)| Some(format!("{name}: {}", incomplete.as_ref()?)));
    let why = why.collect::<Vec<_>>().join("; ");
    Err(Error::numeric(match all.len() {
        0 => "there is no run; expected folders that `tracklens train` or `tools/rl/train_rl.py` wrote, or folders with \
              such folders"
            .to_owned(),
        count => {
            format!("none of the {count} runs is complete ({why}); finish them with --resume")
        }
    }))
}
