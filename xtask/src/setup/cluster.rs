//! Slurm and GNU parallel, for the tests of sweeps.

use anyhow::{Result, bail};

use super::install::Package;

const CLUSTER: Package = Package {
    what: "Slurm, MUNGE and GNU parallel",
    apt: &["slurm-wlm", "munge", "parallel", "procps"],
    elsewhere: &[
        (
            "dnf",
            "sudo dnf install slurm slurm-slurmctld slurm-slurmd munge parallel",
        ),
        (
            "zypper",
            "sudo zypper install slurm slurm-node munge gnu_parallel",
        ),
    ],
    otherwise: "the tests of sweeps start a Slurm of one node, on Linux and as root; elsewhere, \
                run `cargo xtask test` without the part `cluster`",
};

/// The programs that the tests start.
const PROGRAMS: [&str; 8] = [
    "sbatch",
    "scancel",
    "sinfo",
    "slurmctld",
    "slurmd",
    "munged",
    "mungekey",
    "parallel",
];

/// Finds the programs, or installs them.
///
/// # Errors
/// This is not Linux, or one of them is missing and cannot be installed; says what to do.
pub fn cluster() -> Result<()> {
    if std::env::consts::OS != "linux" {
        bail!("{}", CLUSTER.otherwise);
    }
    for program in PROGRAMS {
        CLUSTER.program(program)?;
    }
    Ok(())
}
