//! Job arrays of Slurm.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// What the jobs of an array ask Slurm for; what is not given is left to the cluster's defaults.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Submission {
    /// Jobs that run at a time.
    pub throttle: Option<u32>,
    /// CPUs a job, which are its threads.
    pub cpus: Option<u32>,
    /// GPUs a job.
    pub gpus: Option<u32>,
    /// Time limit, e.g. `02:30:00`.
    pub time: Option<String>,
    /// Memory a job, e.g. `4G`.
    pub memory: Option<String>,
    /// The partition.
    pub partition: Option<String>,
    /// More options of `sbatch`, as they are.
    pub options: Vec<String>,
}

/// The lines (sorted, counted from 1) as Slurm writes array indices: `1-3,7`.
pub fn array(lines: &[usize]) -> String {
    let mut ranges: Vec<(usize, usize)> = Vec::new();
    for &line in lines {
        match ranges.last_mut() {
            Some((_, last)) if *last + 1 == line => *last = line,
            _ => ranges.push((line, line)),
        }
    }
    let range = |&(first, last): &(usize, usize)| match first == last {
        true => first.to_string(),
        false => format!("{first}-{last}"),
    };
    ranges.iter().map(range).collect::<Vec<_>>().join(",")
}

/// The batch script that runs these lines of the sweep in `folder` as a job array, with the program
/// `program`.
///
/// A job that its node loses, or that is preempted, is queued again and goes on after its last
/// whole epoch.
///
/// # Errors
/// When a path cannot be written in a script.
pub fn script(
    submission: &Submission,
    lines: &[usize],
    folder: &Path,
    program: &Path,
) -> Result<String> {
    let quote = |path: &Path| -> Result<String> {
        let text = path.to_string_lossy();
        let quoted = shlex::try_quote(&text)
            .map_err(|e| Error::input(format!("{}: {e}", path.display())))?;
        Ok(quoted.into_owned())
    };
    // Slurm reads its options as a shell does, but for a % before some letters, which is written
    // twice.
    let log = folder.join("slurm").to_string_lossy().replace('%', "%%");
    if log.contains('"') {
        return Err(Error::input(
            "the path contains a double quote, which Slurm does not take in the path of a log; use another folder",
        )
        .at(folder.display()));
    }
    let mut options = vec![
        "--job-name=tracklens".to_owned(),
        match submission.throttle {
            Some(throttle) => format!("--array={}%{throttle}", array(lines)),
            None => format!("--array={}", array(lines)),
        },
        format!("--output=\"{log}/%A_%a.log\""),
        "--open-mode=append".to_owned(),
        "--requeue".to_owned(),
    ];
    let mut add =
        |name: &str, value: Option<String>| options.extend(value.map(|v| format!("--{name}={v}")));
    add("cpus-per-task", submission.cpus.map(|n| n.to_string()));
    add("gpus", submission.gpus.map(|n| n.to_string()));
    add("time", submission.time.clone());
    add("mem", submission.memory.clone());
    add("partition", submission.partition.clone());
    options.extend(submission.options.iter().cloned());
    let mut script = "#!/bin/bash\n".to_owned();
    for option in options {
        if option.contains('\n') {
            return Err(Error::input(format!(
                "`{option}` is not an option of sbatch"
            )));
        }
        script += &format!("#SBATCH {option}\n");
    }
    script += &format!(
        "\nexec {} sweep run {} --line \"$SLURM_ARRAY_TASK_ID\" --threads \"${{SLURM_CPUS_PER_TASK:-1}}\" --quiet\n",
        quote(program)?,
        quote(folder)?,
    );
    Ok(script)
}
