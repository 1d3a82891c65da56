//! Sweeps of agents by the real binary. A script stands in for tools/rl/train_rl.py, which has tests
//! of its own.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::binary::stderr;
use crate::runs::write_run;

const PATIENCE: Duration = Duration::from_secs(60);

/// Evaluates every 1000 steps. Waits after the first evaluation while there is a file `hold`, and
/// fails with seed 1 while there is a file `fail`.
const PROGRAM: &str = r#"
here=$(dirname "$0")
for argument; do
  case "$before$argument" in
    --options) echo '{"states":["full","points","keypoints"],"values":["steps","task"],"switches":["processes"]}'; exit ;;
    --steps=*) steps=${argument#*=} ;;
    --seed=*) seed=${argument#*=} ;;
    --out*) out=${before:+$argument} ;;
  esac
  before=
  [ "$argument" = --out ] && before=--out
  [ "$argument" = --lock-held ] && held=yes
done
[ "$held" = yes ] || { echo "error: --lock-held is missing" >&2; exit 1; }
trap 'exit 130' TERM
echo "$@" >> "$out/arguments.txt"
echo '{"schema": "tracklens/rl-run/1"}' > "$out/config.json"
[ "$seed" = 1 ] && [ -e "$here/fail" ] && { echo "error: the disk is full" >&2; exit 1; }
step=$(grep -c . "$out/log.jsonl" 2> /dev/null)
step=$(( ${step:-0} * 1000 ))
while [ "$step" -lt "$steps" ]; do
  step=$((step + 1000))
  echo "{\"step\": $step, \"success\": 0.5, \"return\": -9.0}" >> "$out/log.jsonl"
  while [ -e "$here/hold" ]; do sleep 0.02; done
done
echo "{\"interrupted\": false, \"steps\": $step}" > "$out/summary.json"
"#;

struct Sweep(TempDir);

impl Sweep {
    fn new(rl: &str) -> Self {
        let sweep = Self(tempfile::tempdir().expect("a folder"));
        fs::write(sweep.path("train_rl.sh"), PROGRAM).expect("written");
        sweep.write(rl);
        sweep
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, rl: &str) {
        let text = format!("[rl]\npython = \"sh\"\nscript = \"train_rl.sh\"\n{rl}");
        fs::write(self.path("sweep.toml"), text).expect("written");
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tracklens"));
        command
            .arg("sweep")
            .args(arguments)
            .current_dir(self.0.path());
        command
    }

    fn output(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().expect("the binary runs")
    }

    fn refused(&self, arguments: &[&str]) -> String {
        let output = self.output(arguments);
        assert!(!output.status.success());
        stderr(&output)
    }

    fn sweep(&self, arguments: &[&str]) {
        let done = self.output(arguments);
        assert!(done.status.success(), "{}", stderr(&done));
    }

    fn start(&self, arguments: &[&str]) -> Child {
        let mut command = self.command(arguments);
        command.stdout(Stdio::null()).stderr(Stdio::null());
        command.spawn().expect("the binary runs")
    }

    fn status(&self) -> Vec<Value> {
        let output = self.output(&["status", "runs", "--json"]);
        serde_json::from_slice(&output.stdout).expect("JSON")
    }

    fn lines(&self, file: &str) -> usize {
        fs::read_to_string(self.path(file)).map_or(0, |text| text.lines().count())
    }

    fn wait(&self, what: &str, mut done: impl FnMut(&Self) -> bool) {
        let start = Instant::now();
        while !done(self) {
            assert!(
                start.elapsed() < PATIENCE,
                "{what}: waited for {PATIENCE:?}"
            );
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

fn send(process: &Child, signal: Signal) {
    let id = i32::try_from(process.id()).expect("a number");
    kill(Pid::from_raw(id), signal).expect("a process");
}

/// A complete training with a checkpoint.
fn training(folder: &Path, seed: u64) {
    write_run(folder, "basic", seed, 2);
    fs::write(folder.join("checkpoint_best.safetensors"), "weights").expect("written");
}

const TWO: &str = "states = [\"points\"]\nseeds = \"0-1\"\nsteps = 3000\n";

#[test]
fn a_plan_has_every_state_with_the_encoders_drawn_and_every_seed() {
    let sweep = Sweep::new(
        "states = [\"full\", \"keypoints\"]\nseeds = [3, 4]\nsteps = 2000\nprocesses = true\n\
         [rl.encoders]\nruns = \"encoders\"\neach = 2\nseed = 7\n",
    );
    for family in ["basic", "wide"] {
        for seed in 0..3 {
            training(
                &sweep.path(&format!("encoders/{family}/seed-{seed:02}")),
                seed,
            );
        }
    }
    // Not complete, and of an agent.
    training(&sweep.path("encoders/basic/seed-03.partial"), 3);
    let other = sweep.path("encoders/agent");
    training(&other, 0);
    fs::write(
        other.join("config.json"),
        r#"{"schema": "tracklens/rl-run/1"}"#,
    )
    .expect("written");
    sweep.sweep(&["plan", "sweep.toml"]);
    let plan = fs::read_to_string(sweep.path("runs/plan.jsonl")).expect("a plan");
    let runs: Vec<Value> = plan
        .lines()
        .map(|line| serde_json::from_str(line).expect("JSON"))
        .collect();
    assert_eq!(runs.len(), 2 + 2 * 2 * 2);
    assert_eq!(runs[0]["run"], "full/seed-03");
    let script = sweep.path("train_rl.sh").to_string_lossy().into_owned();
    assert_eq!(runs[0]["program"], json!(["sh", script]));
    let given = json!(["--state=full", "--seed=3", "--processes", "--steps=2000"]);
    assert_eq!(runs[0]["arguments"], given);
    let name = runs[2]["run"].as_str().expect("a name");
    assert!(
        name.starts_with("keypoints/basic-seed-0") && name.ends_with("/seed-03"),
        "{name}"
    );
    let checkpoint = runs[2]["arguments"][2].as_str().expect("an argument");
    assert!(
        checkpoint.ends_with("/checkpoint_best.safetensors"),
        "{checkpoint}"
    );
    assert!(Path::new(checkpoint.trim_start_matches("--checkpoint=")).is_absolute());

    sweep.sweep(&["submit", "runs", "--slurm", "--dry-run", "--cpus", "2"]);
    let script = fs::read_to_string(sweep.path("runs/sweep.sbatch")).expect("a script");
    assert!(script.contains("--array=1-10") && script.contains("--line \"$SLURM_ARRAY_TASK_ID\""));
}

#[test]
fn bad_sweep_files_of_agents_say_what_is_wrong() {
    let sweep = Sweep::new(TWO);
    for (rl, told) in [
        (
            "states = [\"point\"]\nseeds = 0\nsteps = 1000\n",
            "line 4: unknown state `point`; did you mean `points`?",
        ),
        ("states = [\"points\"]\nseeds = 0\n", "`steps` is missing"),
        (
            "states = [\"points\"]\nseeds = 0\nsteps = 1\ntusk = \"push\"\n",
            "line 7: unknown option `tusk`; did you mean `task`?",
        ),
        (
            "states = [\"keypoints\"]\nseeds = 0\nsteps = 1000\n",
            "`[rl.encoders]` is missing",
        ),
        (
            "states = [\"keypoints\"]\nseeds = 0\nsteps = 1000\n[rl.encoders]\nfiles = [\"none.safetensors\"]\n",
            "none.safetensors: the checkpoint is not there",
        ),
        (
            "states = [\"keypoints\"]\nseeds = 0\nsteps = 1000\n[rl.encoders]\nruns = \".\"\n",
            "holds no complete training",
        ),
    ] {
        sweep.write(rl);
        let said = sweep.refused(&["plan", "sweep.toml"]);
        assert!(said.contains(told), "{told} in {said}");
    }
    let text = format!("[rl]\npython = \"./no-python\"\nscript = \"train_rl.sh\"\n{TWO}");
    fs::write(sweep.path("sweep.toml"), text).expect("written");
    assert!(
        sweep
            .refused(&["plan", "sweep.toml"])
            .contains("no-python cannot be started")
    );
    fs::write(
        sweep.path("train_rl.sh"),
        "echo 'error: torch is missing' >&2; exit 1",
    )
    .expect("written");
    sweep.write(TWO);
    assert!(
        sweep
            .refused(&["plan", "sweep.toml"])
            .contains("torch is missing")
    );
}

#[test]
fn agents_are_trained_once_and_failures_do_not_stop_the_others() {
    let sweep = Sweep::new(TWO);
    sweep.sweep(&["plan", "sweep.toml"]);
    fs::write(sweep.path("fail"), "").expect("written");
    let said = sweep.refused(&["run", "runs", "-j", "2", "--quiet"]);
    assert!(said.contains("points/seed-01: the disk is full"), "{said}");
    let status = sweep.status();
    assert_eq!(status[0]["state"], "done");
    assert_eq!(
        status[1],
        json!({
            "line": 2, "run": "points/seed-01", "planned_steps": 3000, "state": "failed",
            "error": "the disk is full", "steps": 0
        })
    );
    fs::remove_file(sweep.path("fail")).expect("removed");
    sweep.sweep(&["run", "runs", "--quiet"]);
    assert_eq!(
        sweep.lines("runs/points/seed-00/arguments.txt"),
        1,
        "it was complete"
    );
    assert_eq!(sweep.lines("runs/points/seed-01/arguments.txt"), 2);
    assert!(!sweep.path("runs/points/seed-01/error.txt").exists());
    let said = fs::read_to_string(sweep.path("runs/points/seed-01/arguments.txt")).expect("a text");
    assert!(
        said.contains("--state=points --seed=1 --steps=3000 --out ") && said.contains("--threads=")
    );

    // More steps: complete runs are taken up again.
    sweep.write(&TWO.replace("3000", "5000"));
    sweep.sweep(&["plan", "sweep.toml", "--replace"]);
    sweep.sweep(&["run", "runs", "--quiet"]);
    assert_eq!(sweep.lines("runs/points/seed-00/log.jsonl"), 5);
    assert!(sweep.status().iter().all(|run| run["state"] == "done"));
}

#[test]
fn an_agent_keeps_its_run_when_who_started_it_is_killed() {
    let sweep = Sweep::new(TWO);
    sweep.sweep(&["plan", "sweep.toml"]);
    let hold = sweep.path("hold");
    fs::write(&hold, "").expect("written");
    let mut worker = sweep.start(&["run", "runs", "--line", "1"]);
    let log = "runs/points/seed-00.partial/log.jsonl";
    sweep.wait("an evaluation", |sweep| sweep.lines(log) == 1);
    send(&worker, Signal::SIGKILL);
    worker.wait().expect("it ended");
    assert_eq!(sweep.status()[0]["state"], "running");
    let said = sweep.refused(&["run", "runs", "--line", "1"]);
    assert!(said.contains("is being worked on by"), "{said}");
    fs::remove_file(&hold).expect("removed");
    sweep.wait("the end", |sweep| sweep.status()[0]["state"] == "stopped");
    sweep.sweep(&["run", "runs", "--line", "1"]);
    assert_eq!(sweep.lines("runs/points/seed-00/log.jsonl"), 3);
}

#[test]
fn a_signal_ends_the_agents_and_the_same_command_goes_on() {
    let sweep = Sweep::new(TWO);
    sweep.sweep(&["plan", "sweep.toml"]);
    let hold = sweep.path("hold");
    fs::write(&hold, "").expect("written");
    let mut work = sweep.start(&["run", "runs", "-j", "2", "--quiet"]);
    let log = |seed: u64| format!("runs/points/seed-0{seed}.partial/log.jsonl");
    sweep.wait("both", |sweep| {
        (0..2).all(|seed| sweep.lines(&log(seed)) == 1)
    });
    send(&work, Signal::SIGTERM);
    assert_eq!(work.wait().expect("it ended").code(), Some(130));
    for run in sweep.status() {
        assert_eq!(
            (&run["state"], &run["steps"]),
            (&json!("stopped"), &json!(1000))
        );
    }
    fs::remove_file(&hold).expect("removed");
    sweep.sweep(&["run", "runs", "-j", "2", "--quiet"]);
    assert!(sweep.status().iter().all(|run| run["state"] == "done"));
}
