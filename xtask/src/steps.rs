//! A list of steps that goes on after a failure and ends with a summary.

use std::fmt;
use std::time::{Duration, Instant};

use anyhow::{Result, bail};

/// The steps so far, in order.
pub struct Steps {
    started: Instant,
    done: Vec<Step>,
}

struct Step {
    name: String,
    outcome: Outcome,
    time: Duration,
}

#[derive(Clone, Copy, PartialEq)]
enum Outcome {
    Passed,
    Failed,
    /// Something it needs failed.
    Blocked,
    /// Left out on request.
    Skipped,
}

impl Steps {
    pub fn new() -> Self {
        Self {
            started: Instant::now(),
            done: Vec::new(),
        }
    }

    /// Runs a step, prints its error if it fails, and returns what it made if it passes.
    pub fn run<T>(
        &mut self,
        name: impl Into<String>,
        step: impl FnOnce() -> Result<T>,
    ) -> Option<T> {
        let name = name.into();
        eprintln!("\n== {name}");
        let started = Instant::now();
        let result = step();
        let outcome = match &result {
            Ok(_) => Outcome::Passed,
            Err(error) => {
                eprintln!("error: {error:#}");
                Outcome::Failed
            }
        };
        self.record(name, outcome, started.elapsed());
        result.ok()
    }

    /// Notes a step that cannot be run because another one failed.
    pub fn blocked(&mut self, name: &str) {
        self.record(name.to_owned(), Outcome::Blocked, Duration::ZERO);
    }

    /// Notes a step that was left out on request.
    pub fn skipped(&mut self, name: &str) {
        self.record(name.to_owned(), Outcome::Skipped, Duration::ZERO);
    }

    fn record(&mut self, name: String, outcome: Outcome, time: Duration) {
        self.done.push(Step {
            name,
            outcome,
            time,
        });
    }

    /// Prints the summary.
    ///
    /// # Errors
    /// A step failed or could not be run.
    pub fn finish(self) -> Result<()> {
        eprintln!("\n== summary\n{self}");
        let failed = self
            .done
            .iter()
            .filter(|step| step.outcome.is_failure())
            .count();
        if failed > 0 {
            bail!("{failed} of {} steps did not pass", self.done.len());
        }
        Ok(())
    }
}

impl Outcome {
    fn is_failure(self) -> bool {
        matches!(self, Self::Failed | Self::Blocked)
    }
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Passed => "pass",
            Self::Failed => "FAIL",
            Self::Blocked => "NOT RUN",
            Self::Skipped => "skipped",
        })
    }
}

impl fmt::Display for Steps {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for step in &self.done {
            writeln!(
                f,
                "{:<8} {:>8.1} s  {}",
                step.outcome,
                step.time.as_secs_f64(),
                step.name
            )?;
        }
        write!(
            f,
            "{:<8} {:>8.1} s",
            "in all",
            self.started.elapsed().as_secs_f64()
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_step_does_not_stop_the_next_one_but_fails_the_whole() {
        let mut steps = Steps::new();
        assert_eq!(
            steps.run("first", || -> Result<i32> { bail!("broken") }),
            None
        );
        assert_eq!(steps.run("second", || Ok(2)), Some(2));
        let error = steps.finish().map_err(|error| error.to_string());
        assert_eq!(error, Err("1 of 2 steps did not pass".to_owned()));
    }

    #[test]
    fn a_step_that_could_not_be_run_is_a_failure_and_one_left_out_is_not() {
        let mut steps = Steps::new();
        steps.skipped("page");
        assert!(steps.finish().is_ok());
        let mut steps = Steps::new();
        steps.blocked("page");
        assert!(steps.finish().is_err());
    }

    #[test]
    fn the_summary_has_one_line_a_step() {
        let mut steps = Steps::new();
        steps.run("metric alone", || Ok(()));
        steps.skipped("page");
        let summary = steps.to_string();
        assert_eq!(summary.lines().count(), 3);
        assert!(summary.starts_with("pass"));
    }
}
