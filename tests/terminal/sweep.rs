//! Sweeps by the real binary: plans, runs here, and on a Slurm and a GNU parallel that the tests
//! start.

use std::ffi::OsStr;
use std::fs;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use tempfile::TempDir;

use crate::binary::stderr;

const PATIENCE: Duration = Duration::from_secs(120);

/// A folder with a sweep file of four tiny runs on the repository's recording.
struct Sweep {
    folder: TempDir,
    /// Where Slurm's configuration is.
    slurm: Option<PathBuf>,
}

impl Sweep {
    fn new(epochs: u32) -> Self {
        let sweep = Self {
            folder: tempfile::tempdir().expect("a folder"),
            slurm: None,
        };
        sweep.write(&file(epochs));
        sweep
    }

    fn write(&self, text: &str) {
        fs::write(self.folder.path().join("sweep.toml"), text).expect("a sweep file");
    }

    fn runs(&self) -> PathBuf {
        self.folder.path().join("runs")
    }

    fn command<S: AsRef<OsStr>>(&self, arguments: &[S]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tracklens"));
        command
            .arg("sweep")
            .args(arguments)
            .current_dir(self.folder.path());
        if let Some(configuration) = &self.slurm {
            command.env("SLURM_CONF", configuration);
        }
        command
    }

    fn try_sweep(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().expect("the binary runs")
    }

    fn sweep(&self, arguments: &[&str]) -> String {
        let done = self.try_sweep(arguments);
        assert!(done.status.success(), "{}", stderr(&done));
        String::from_utf8(done.stdout).expect("text")
    }

    /// The states of the runs, by the line.
    fn states(&self) -> Vec<String> {
        let json = self.sweep(&["status", "runs", "--json"]);
        let runs: Vec<Value> = serde_json::from_str(&json).expect("JSON");
        let state = |run: &Value| run["state"].as_str().expect("a state").to_owned();
        runs.iter().map(state).collect()
    }

    fn final_weights(&self, run: &str) -> Vec<u8> {
        fs::read(self.runs().join(run).join("checkpoint_final.safetensors")).expect("a checkpoint")
    }

    /// Waits until `done`.
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

    /// Whole epochs of a run that is worked on.
    fn epochs(&self, run: &str) -> usize {
        let log = self.runs().join(format!("{run}.partial/log.jsonl"));
        fs::read(log).map_or(0, |log| log.iter().filter(|b| **b == b'\n').count())
    }
}

fn file(epochs: u32) -> String {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/panda_push");
    format!(
        r#"# Four runs that take no time.
data = "{}"
architectures = ["basic-vel-std-bg", "keynet"]
seeds = "0-1"

[train]
epochs = {epochs}
batch = 2
keypoints = 4
input-size = 32
target-size = 16
split = "0.67,0.33"

[architecture.basic-vel-std-bg]
encoder-channels = [4, 6, 8]
decoder-channels = [8, 6, 4]

[architecture.keynet]
encoder-channels = "4,4,6,8"
decoder-channels = "8,6,4"
"#,
        data.display()
    )
}

const NAMES: [&str; 4] = [
    "basic-vel-std-bg/seed-00",
    "basic-vel-std-bg/seed-01",
    "keynet/seed-00",
    "keynet/seed-01",
];

#[test]
fn a_plan_has_a_line_a_run() {
    let sweep = Sweep::new(3);
    assert!(
        sweep
            .sweep(&["plan", "sweep.toml"])
            .trim()
            .ends_with("/runs")
    );
    let plan = fs::read_to_string(sweep.runs().join("plan.jsonl")).expect("a plan");
    let lines: Vec<Value> = plan
        .lines()
        .map(|l| serde_json::from_str(l).expect("JSON"))
        .collect();
    let names: Vec<&str> = lines
        .iter()
        .map(|l| l["run"].as_str().expect("a name"))
        .collect();
    assert_eq!(names, NAMES);
    assert_eq!(sweep.states(), ["missing"; 4]);

    // The same plan again is no change; another one needs a word.
    sweep.sweep(&["plan", "sweep.toml"]);
    sweep.write(&file(4));
    let other = sweep.try_sweep(&["plan", "sweep.toml"]);
    assert_eq!(other.status.code(), Some(4));
    assert!(stderr(&other).contains("--replace"), "{}", stderr(&other));
    sweep.sweep(&["plan", "sweep.toml", "--replace"]);

    let variants =
        "\n[[variants]]\nname = \"small\"\n\n[[variants]]\nname = \"large\"\ninput-size = 48\n";
    sweep.write(&(file(4) + variants));
    sweep.sweep(&["plan", "sweep.toml", "--out", "other"]);
    let plan = fs::read_to_string(sweep.folder.path().join("other/plan.jsonl")).expect("a plan");
    let last: Value = serde_json::from_str(plan.lines().last().expect("a line")).expect("JSON");
    assert_eq!(plan.lines().count(), 8);
    assert_eq!(last["run"], "keynet-large/seed-01");
    let sizes: Vec<&Value> = last["arguments"]
        .as_array()
        .expect("arguments")
        .iter()
        .filter(|a| a.as_str().is_some_and(|a| a.starts_with("--input-size")))
        .collect();
    assert_eq!(sizes, ["--input-size=48"], "the variant's counts alone");
}

#[test]
fn bad_sweep_files_name_the_line_and_the_nearest_name() {
    let sweep = Sweep::new(3);
    let good = file(3);
    let message = |from: &str, to: &str| {
        assert!(good.contains(from), "{from}");
        sweep.write(&good.replacen(from, to, 1));
        let planned = sweep.try_sweep(&["plan", "sweep.toml"]);
        assert!(!planned.status.success(), "{to}");
        assert!(!sweep.runs().exists(), "{to}: nothing is written");
        stderr(&planned)
    };
    for (from, to, parts) in [
        (
            "epochs =",
            "epoch =",
            &["sweep.toml: line 7: unknown option `epoch`; did you mean `epochs`?"][..],
        ),
        (
            "seeds =",
            "seed =",
            &["line 4: unknown key `seed`; did you mean `seeds`?"],
        ),
        (
            "\"keynet\"]",
            "\"keynets\"]",
            &[
                "line 3: unknown architecture `keynets`",
                "did you mean `keynet`?",
            ],
        ),
        (
            "[architecture.keynet]",
            "[architecture.dsae]",
            &["line 18: unknown architecture `dsae`"],
        ),
        ("\"0-1\"", "\"1-0\"", &["line 4: expected seeds such as"]),
        ("\"0-1\"", "[0, 0]", &["line 4: expected seeds such as"]),
        ("seeds = \"0-1\"", "", &["`seeds` is missing"]),
        (
            "batch = 2",
            "batch = 0",
            &["basic-vel-std-bg/seed-00: the batch is 0; expected at least 1 snippet"],
        ),
        (
            "batch = 2",
            "batch = \"two\"",
            &["basic-vel-std-bg/seed-00: ", "'two'", "--batch"],
        ),
        (
            "batch = 2",
            "batch = 2\nkeep-last = 3",
            &["line 9: `keep-last` is true or false"],
        ),
        ("batch = 2", "batch = ", &["line 8: "]),
        ("panda_push", "panda_pull", &["panda_pull is not there"]),
    ] {
        let told = message(from, to);
        for part in parts {
            assert!(told.contains(part), "{to}: {told}");
        }
    }
    sweep.write(&good);
    let unplanned = sweep.try_sweep(&["run", "runs"]);
    assert!(
        stderr(&unplanned).contains("tracklens sweep plan"),
        "{}",
        stderr(&unplanned)
    );
}

#[test]
fn runs_are_trained_once_and_failures_do_not_stop_the_others() {
    let sweep = Sweep::new(3);
    // A target of another size than the frames allow: the second architecture fails when it starts.
    sweep.write(
        &(file(3).replace(
            "decoder-channels = \"8,6,4\"",
            "decoder-channels = \"8,6,4\"\nobjects = \"moon\"",
        )),
    );
    sweep.sweep(&["plan", "sweep.toml"]);
    let first = sweep.try_sweep(&["run", "runs", "--jobs", "2", "--quiet"]);
    assert_eq!(first.status.code(), Some(5), "{}", stderr(&first));
    assert!(
        stderr(&first).contains("2 of 4 runs are complete (0 were before), 2 failed"),
        "{}",
        stderr(&first)
    );
    assert_eq!(sweep.states(), ["done", "done", "failed", "failed"]);
    let status = sweep.sweep(&["status", "runs"]);
    assert!(status.contains("2 done, 0 running, 2 failed"), "{status}");
    assert!(
        status.contains("keynet/seed-01  failed after epoch 0 of 3: ") && status.contains("moon"),
        "{status}"
    );

    let before = sweep.final_weights(NAMES[0]);
    sweep.write(&file(3));
    sweep.sweep(&["plan", "sweep.toml", "--replace"]);
    let second = sweep.try_sweep(&["run", "runs", "--quiet"]);
    assert!(second.status.success(), "{}", stderr(&second));
    assert!(
        stderr(&second).contains("4 of 4 runs are complete (2 were before)"),
        "{}",
        stderr(&second)
    );
    assert_eq!(sweep.states(), ["done"; 4]);
    assert!(
        sweep.final_weights(NAMES[0]) == before,
        "a complete run is left alone"
    );
    let again = sweep.try_sweep(&["run", "runs", "--line", "2"]);
    assert!(
        stderr(&again).contains("seed-01 is complete"),
        "{}",
        stderr(&again)
    );

    let no_line = sweep.try_sweep(&["run", "runs", "--line", "5"]);
    assert!(
        stderr(&no_line).contains("there is no line 5; expected 1 to 4"),
        "{}",
        stderr(&no_line)
    );

    // More epochs: what is complete is taken up again and comes to what it would have been.
    sweep.write(&file(6));
    sweep.sweep(&["plan", "sweep.toml", "--replace"]);
    assert_eq!(sweep.states(), ["stopped"; 4]);
    sweep.sweep(&["run", "runs", "--quiet"]);
    let straight = Sweep::new(6);
    straight.sweep(&["plan", "sweep.toml"]);
    straight.sweep(&["run", "runs", "--quiet"]);
    for name in NAMES {
        assert!(
            sweep.final_weights(name) == straight.final_weights(name),
            "{name}"
        );
    }
}

#[test]
fn a_run_that_cannot_be_read_has_failed_and_the_others_go_on() {
    let sweep = Sweep::new(3);
    sweep.sweep(&["plan", "sweep.toml"]);
    let broken = sweep.runs().join(NAMES[0]);
    fs::create_dir_all(&broken).expect("a folder");
    fs::write(
        broken.join("summary.json"),
        "{\"version\": \"0.1.0\", \"inter",
    )
    .expect("written");
    assert_eq!(sweep.states(), ["failed", "missing", "missing", "missing"]);
    let status = sweep.sweep(&["status", "runs"]);
    assert!(
        status.contains("0 done, 0 running, 1 failed, 0 stopped, 3 missing")
            && status.contains("summary.json: cannot be read (EOF while parsing"),
        "{status}"
    );
    let run = sweep.try_sweep(&["run", "runs", "--quiet"]);
    assert_eq!(run.status.code(), Some(5), "{}", stderr(&run));
    assert!(
        stderr(&run).contains("3 of 4 runs are complete (0 were before), 1 failed"),
        "{}",
        stderr(&run)
    );
    assert_eq!(sweep.states(), ["failed", "done", "done", "done"]);
}

#[test]
fn a_run_that_another_process_works_on_has_not_failed() {
    let sweep = Sweep::new(3);
    sweep.sweep(&["plan", "sweep.toml"]);
    let partial = sweep.runs().join(format!("{}.partial", NAMES[1]));
    fs::create_dir_all(&partial).expect("a folder");
    let lock = fs::File::create(partial.join("lock")).expect("a file");
    fs::write(partial.join("lock"), "process 7 on elsewhere").expect("written");
    lock.lock().expect("a lock");
    let run = sweep.try_sweep(&["run", "runs", "--quiet"]);
    assert!(run.status.success(), "{}", stderr(&run));
    for part in [
        "process 7 on elsewhere works on it",
        "3 of 4 runs are complete (0 were before), 0 failed, 1 are worked on elsewhere",
    ] {
        assert!(stderr(&run).contains(part), "{}", stderr(&run));
    }
}

#[test]
fn a_folder_that_breaks_scripts_is_refused() {
    let sweep = Sweep::new(3);
    let planned = sweep.try_sweep(&["plan", "sweep.toml", "--out", "a\nb"]);
    assert_eq!(planned.status.code(), Some(3));
    assert!(
        stderr(&planned).contains("control character in its path"),
        "{}",
        stderr(&planned)
    );
    assert!(!sweep.folder.path().join("a\nb").exists());
    sweep.sweep(&["plan", "sweep.toml", "--out", "a\"b"]);
    let quoted = sweep.try_sweep(&["submit", "a\"b", "--slurm", "--dry-run"]);
    assert_eq!(quoted.status.code(), Some(3));
    assert!(
        stderr(&quoted).contains("double quote"),
        "{}",
        stderr(&quoted)
    );
}

#[test]
fn a_run_has_one_worker_and_goes_on_when_it_is_killed() {
    let sweep = Sweep::new(100_000);
    sweep.sweep(&["plan", "sweep.toml"]);
    let mut worker = sweep
        .command(&["run", "runs", "--line", "1", "--quiet"])
        .stderr(Stdio::null())
        .spawn()
        .expect("the binary runs");
    sweep.wait("the first epochs", |sweep| sweep.epochs(NAMES[0]) >= 3);
    assert_eq!(sweep.states()[0], "running");
    let second = sweep.try_sweep(&["run", "runs", "--line", "1", "--quiet"]);
    assert_eq!(second.status.code(), Some(4));
    let told = stderr(&second);
    assert!(
        told.contains(&format!("is being worked on by process {}", worker.id())),
        "{told}"
    );
    worker.kill().expect("it is ours");
    worker.wait().expect("it ends");
    assert_eq!(sweep.states()[0], "stopped");

    let reached = sweep.epochs(NAMES[0]) as u32;
    let epochs = reached + 2;
    sweep.write(&file(epochs));
    sweep.sweep(&["plan", "sweep.toml", "--replace"]);
    sweep.sweep(&["run", "runs", "--line", "1", "--quiet"]);
    let straight = Sweep::new(epochs);
    straight.sweep(&["plan", "sweep.toml"]);
    straight.sweep(&["run", "runs", "--line", "1", "--quiet"]);
    assert!(sweep.final_weights(NAMES[0]) == straight.final_weights(NAMES[0]));
    assert!(!sweep.runs().join(format!("{}.partial", NAMES[0])).exists());
}

#[test]
fn ctrl_c_ends_all_jobs_and_the_same_command_goes_on() {
    let sweep = Sweep::new(100_000);
    sweep.sweep(&["plan", "sweep.toml"]);
    let running = sweep
        .command(&["run", "runs", "--jobs", "2", "--quiet"])
        .stderr(Stdio::piped())
        .spawn()
        .expect("the binary runs");
    sweep.wait("the first epochs", |sweep| {
        NAMES[..2].iter().all(|name| sweep.epochs(name) >= 2)
    });
    // As a terminal does: to the process and to those that it started.
    let pid = running.id().to_string();
    let jobs = Command::new("pgrep")
        .args(["-P", &pid])
        .output()
        .expect("pgrep runs");
    let jobs = String::from_utf8(jobs.stdout).expect("numbers");
    let kill = Command::new("kill")
        .arg("-INT")
        .arg(&pid)
        .args(jobs.lines())
        .status();
    assert!(kill.expect("kill runs").success());
    let ended = running.wait_with_output().expect("it ends");
    assert_eq!(ended.status.code(), Some(130), "{}", stderr(&ended));
    assert!(
        stderr(&ended).contains("the same command goes on"),
        "{}",
        stderr(&ended)
    );
    assert_eq!(sweep.states(), ["stopped", "stopped", "missing", "missing"]);
}

/// Whether the tests may use Slurm and GNU parallel, which `cargo xtask test` installs before it
/// says so.
fn cluster() -> bool {
    let there = std::env::var_os("TRACKLENS_CLUSTER").is_some();
    if !there {
        eprintln!("skipped: needs Slurm and GNU parallel; run it with `cargo xtask test`");
    }
    there
}

#[test]
fn gnu_parallel_runs_what_is_exported() {
    if !cluster() {
        return;
    }
    let sweep = Sweep::new(3);
    sweep.sweep(&["plan", "sweep.toml"]);
    sweep.sweep(&["run", "runs", "--line", "2", "--quiet"]);
    let commands = sweep.sweep(&["export", "runs", "--parallel"]);
    let commands = fs::File::open(commands.trim()).expect("a file of commands");
    let done = Command::new("parallel")
        .args(["--jobs", "2"])
        .stdin(commands)
        .output()
        .expect("parallel runs");
    assert!(done.status.success(), "{}", stderr(&done));
    assert_eq!(sweep.states(), ["done"; 4]);
    let left = sweep.try_sweep(&["export", "runs", "--parallel"]);
    assert!(
        stderr(&left).contains("no run is left"),
        "{}",
        stderr(&left)
    );
}

#[test]
fn without_slurm_the_script_is_there_and_the_error_says_so() {
    let sweep = Sweep::new(3);
    sweep.sweep(&["plan", "sweep.toml"]);
    let submitted = sweep
        .command(&[
            "submit",
            "runs",
            "--slurm",
            "--throttle",
            "2",
            "--time",
            "01:00:00",
            "--sbatch=--account=lab",
        ])
        .env("PATH", sweep.folder.path())
        .output()
        .expect("the binary runs");
    assert_eq!(submitted.status.code(), Some(1));
    assert!(
        stderr(&submitted).contains("sbatch cannot be run here")
            && stderr(&submitted).contains("sweep.sbatch"),
        "{}",
        stderr(&submitted)
    );
    let script = fs::read_to_string(sweep.runs().join("sweep.sbatch")).expect("a script");
    for line in [
        "#SBATCH --array=1-4%2",
        "#SBATCH --time=01:00:00",
        "#SBATCH --account=lab",
        "#SBATCH --requeue",
    ] {
        assert!(script.lines().any(|l| l == line), "{line}\n{script}");
    }
}

/// A Slurm of one node on the loopback interface, and what it takes to end it.
struct Slurm {
    folder: TempDir,
    daemons: Vec<Child>,
}

impl Slurm {
    fn start() -> Self {
        let mut slurm = Self {
            folder: tempfile::tempdir().expect("a folder"),
            daemons: Vec::new(),
        };
        let folder = slurm.folder.path().display().to_string();
        for name in ["state", "spool"] {
            fs::create_dir(slurm.folder.path().join(name)).expect("a folder");
        }
        let port = || {
            let free = TcpListener::bind("127.0.0.1:0").expect("a free port");
            free.local_addr().expect("its address").port()
        };
        let configuration = format!(
            "ClusterName=local
SlurmctldHost=localhost(127.0.0.1)
SlurmctldPort={}
SlurmdPort={}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
SlurmUser=root
SlurmdUser=root
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/ctld.pid
SlurmdPidFile={folder}/d.pid
SlurmctldLogFile={folder}/ctld.log
SlurmdLogFile={folder}/d.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
ReturnToService=2
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
JobAcctGatherType=jobacct_gather/none
KillWait=1
NodeName=localhost NodeAddr=127.0.0.1 CPUs=2 RealMemory=1000 State=UNKNOWN
PartitionName=main Nodes=ALL Default=YES MaxTime=INFINITE State=UP
",
            port(),
            port()
        );
        fs::write(slurm.configuration(), configuration).expect("a configuration");
        let key = format!("--keyfile={folder}/munge.key");
        let made = Command::new("mungekey").args(["--create", &key]).status();
        assert!(made.expect("mungekey runs").success());
        slurm.daemon(Command::new("munged").args([
            "--foreground",
            "--force",
            &format!("--key-file={folder}/munge.key"),
            &format!("--socket={folder}/munge.socket"),
            &format!("--pid-file={folder}/munge.pid"),
            &format!("--log-file={folder}/munge.log"),
            &format!("--seed-file={folder}/munge.seed"),
        ]));
        let socket = slurm.folder.path().join("munge.socket");
        slurm.wait("munged", || socket.exists());
        slurm.daemon(Command::new("slurmctld").args(["-D", "-i"]));
        slurm.daemon(Command::new("slurmd").args(["-D", "-N", "localhost"]));
        slurm.wait("an idle node", || {
            let nodes = slurm.command("sinfo").args(["-h", "-o", "%T"]).output();
            nodes.is_ok_and(|nodes| nodes.stdout.starts_with(b"idle"))
        });
        slurm
    }

    fn configuration(&self) -> PathBuf {
        self.folder.path().join("slurm.conf")
    }

    fn command(&self, program: &str) -> Command {
        let mut command = Command::new(program);
        command.env("SLURM_CONF", self.configuration());
        command
    }

    fn daemon(&mut self, command: &mut Command) {
        let daemon = command
            .env("SLURM_CONF", self.configuration())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn();
        self.daemons.push(daemon.expect("a daemon"));
    }

    fn wait(&self, what: &str, done: impl Fn() -> bool) {
        let start = Instant::now();
        while !done() {
            let log =
                |name: &str| fs::read_to_string(self.folder.path().join(name)).unwrap_or_default();
            assert!(
                start.elapsed() < PATIENCE,
                "{what}: waited for {PATIENCE:?}\n{}\n{}\n{}",
                log("munge.log"),
                log("ctld.log"),
                log("d.log")
            );
            std::thread::sleep(Duration::from_millis(100));
        }
    }
}

impl Drop for Slurm {
    fn drop(&mut self) {
        let _ = self
            .command("scancel")
            .args(["--user=root", "--signal=KILL"])
            .status();
        for daemon in self.daemons.iter_mut().rev() {
            let _ = daemon.kill();
            let _ = daemon.wait();
        }
    }
}

#[test]
fn slurm_runs_a_sweep_and_resubmission_finishes_what_was_killed() {
    if !cluster() {
        return;
    }
    let slurm = Slurm::start();
    // Long enough for one to be hit in the middle.
    let mut sweep = Sweep::new(150);
    sweep.slurm = Some(slurm.configuration());
    sweep.sweep(&["plan", "sweep.toml"]);
    let job = sweep.sweep(&["submit", "runs", "--slurm", "--cpus", "1", "--time", "10"]);
    let job = job.trim();
    eprintln!("job array {job}");
    sweep.wait("the second run", |sweep| sweep.epochs(NAMES[1]) >= 5);
    let killed = slurm
        .command("scancel")
        .args(["--signal=KILL", "--full", &format!("{job}_2")])
        .status();
    assert!(killed.expect("scancel runs").success());
    sweep.wait("three runs", |sweep| {
        let mut states = sweep.states();
        let second = states.remove(1);
        states.iter().all(|state| state == "done") && second == "stopped"
    });
    eprintln!("{}", sweep.sweep(&["status", "runs"]));

    let again = sweep.try_sweep(&["status", "runs", "--resubmit"]);
    assert!(again.status.success(), "{}", stderr(&again));
    assert!(
        stderr(&again).contains("1 runs submitted as job"),
        "{}",
        stderr(&again)
    );
    sweep.wait("the resubmitted run", |sweep| sweep.states() == ["done"; 4]);
    eprintln!("{}", sweep.sweep(&["status", "runs"]));
    let straight = Sweep::new(150);
    straight.sweep(&["plan", "sweep.toml"]);
    straight.sweep(&["run", "runs", "--line", "2", "--quiet"]);
    assert!(sweep.final_weights(NAMES[1]) == straight.final_weights(NAMES[1]));

    // What Slurm says of a job that it does not take is passed on.
    sweep.write(&file(200));
    sweep.sweep(&["plan", "sweep.toml", "--replace"]);
    let refused = sweep.try_sweep(&[
        "submit",
        "runs",
        "--slurm",
        "--partition",
        "no-such-partition",
    ]);
    assert_eq!(refused.status.code(), Some(1));
    assert!(
        stderr(&refused).contains("Slurm did not take the job array")
            && stderr(&refused).contains("partition"),
        "{}",
        stderr(&refused)
    );
}
