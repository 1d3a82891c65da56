//! A run goes on to the weights that it would have come to, or says why it does not: after damage,
//! on other data, beside another process, after signals and kills. All by the real binary.

#![cfg(unix)]

use std::collections::HashMap;
use std::fs::{self, File};
use std::os::unix::process::CommandExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use safetensors::SafeTensors;
use tempfile::TempDir;

use crate::binary::stderr;

const PATIENCE: Duration = Duration::from_secs(120);

const STATE: &str = "state.safetensors";
const WEIGHTS: &str = "checkpoint_final.safetensors";

/// So many epochs that no training comes to its end by itself.
const ENDLESS: u32 = 1_000_000;

fn recording() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../tests/data/panda_push")
}

/// The command, which does not ignore SIGHUP even where the tests do, as under `nohup`.
fn tracklens() -> Command {
    use nix::sys::signal::{SigHandler, Signal, signal};
    let mut command = Command::new(env!("CARGO_BIN_EXE_tracklens"));
    // SAFETY: `signal` may be called between fork and exec, and the default installs no code.
    unsafe {
        command.pre_exec(|| {
            signal(Signal::SIGHUP, SigHandler::SigDfl)?;
            Ok(())
        });
    }
    command
}

/// Trainings of a tiny network, in a folder of their own.
struct Trainings {
    folder: TempDir,
    data: PathBuf,
}

impl Trainings {
    fn new() -> Self {
        Self {
            folder: tempfile::tempdir().expect("a folder"),
            data: recording(),
        }
    }

    /// On a copy of the recording, which a test may change.
    fn with_own_data() -> Self {
        let mut trainings = Self::new();
        trainings.data = trainings.path("data");
        copy(&recording(), &trainings.data);
        trainings
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn command(&self, out: &str, epochs: u32, more: &[&str]) -> Command {
        let mut command = tracklens();
        command
            .arg("train")
            .arg("--data")
            .arg(&self.data)
            .arg("--out")
            .arg(self.path(out))
            .arg(format!("--epochs={epochs}"))
            .args(["--arch=basic-vel-std-bg", "--keypoints=4", "--batch=2"])
            .args(["--encoder-channels=4,6,8", "--decoder-channels=8,6,4"])
            .args(["--input-size=32", "--target-size=16", "--split=0.67,0.33"])
            .args(["--threads=1", "--quiet"])
            .args(more)
            .stdout(Stdio::null())
            .stderr(Stdio::piped());
        command
    }

    fn train(&self, out: &str, epochs: u32, more: &[&str]) -> Output {
        let mut command = self.command(out, epochs, more);
        command.output().expect("the binary runs")
    }

    fn trained(&self, out: &str, epochs: u32, more: &[&str]) {
        let done = self.train(out, epochs, more);
        assert!(done.status.success(), "{}", stderr(&done));
    }

    /// A training that is refused with an exit code and a message.
    fn refused(&self, out: &str, epochs: u32, more: &[&str], code: i32, message: &str) {
        let done = self.train(out, epochs, more);
        let told = stderr(&done);
        assert_eq!(done.status.code(), Some(code), "{told}");
        assert!(told.contains(message), "expected `{message}` in: {told}");
    }

    /// Starts an endless training and waits for its first epochs.
    fn start(&self, out: &str, more: &[&str]) -> Child {
        self.started(self.command(out, ENDLESS, more), out)
    }

    fn started(&self, mut command: Command, out: &str) -> Child {
        let before = self.epochs(out);
        let training = command.spawn().expect("the binary runs");
        wait("the first epochs", || self.epochs(out) >= before + 2);
        training
    }

    fn read(&self, out: &str, name: &str) -> Vec<u8> {
        let path = self.path(out).join(name);
        fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
    }

    /// Whole epochs in the log.
    fn epochs(&self, out: &str) -> usize {
        fs::read(self.path(out).join("log.jsonl"))
            .map_or(0, |log| log.iter().filter(|b| **b == b'\n').count())
    }

    /// What a run that is not interrupted comes to.
    fn straight(&self, epochs: u32) -> Vec<u8> {
        let name = format!("straight-{epochs}");
        self.trained(&name, epochs, &[]);
        self.read(&name, WEIGHTS)
    }
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).expect("a folder");
    for entry in fs::read_dir(from).expect("a folder") {
        let entry = entry.expect("an entry");
        let to = to.join(entry.file_name());
        match entry.file_type().expect("a kind").is_dir() {
            true => copy(&entry.path(), &to),
            false => {
                fs::copy(entry.path(), to).expect("copied");
            }
        }
    }
}

fn wait(what: &str, mut done: impl FnMut() -> bool) {
    let start = Instant::now();
    while !done() {
        assert!(
            start.elapsed() < PATIENCE,
            "{what}: waited for {PATIENCE:?}"
        );
        std::thread::sleep(Duration::from_millis(10));
    }
}

fn signal(name: &str, process: &Child) {
    let id = process.id().to_string();
    let sent = Command::new("kill").args([name, &id]).status();
    assert!(sent.expect("kill runs").success());
}

/// Files in `folder` that were not meant to stay.
fn left_over(folder: &Path) -> Vec<String> {
    let names = fs::read_dir(folder).expect("a folder");
    names
        .map(|entry| entry.expect("an entry").file_name())
        .map(|name| name.to_string_lossy().into_owned())
        .filter(|name| name.starts_with('.'))
        .collect()
}

#[test]
fn a_state_with_a_flipped_bit_is_refused_or_goes_on_to_the_same_weights() {
    // 10 000 take a quarter of an hour.
    let flips: u64 = std::env::var("TRACKLENS_BIT_FLIPS")
        .map_or(200, |n| n.parse().expect("a number of bit flips"));
    let trainings = Trainings::new();
    let expected = trainings.straight(3);
    trainings.trained("run", 2, &[]);
    let whole = trainings.read("run", STATE);
    let log = trainings.read("run", "log.jsonl");
    let state = trainings.path("run").join(STATE);
    let bits = 8 * whole.len() as u64;
    let (mut refused, mut same) = (0, 0);
    let mut random = fastrand::Rng::with_seed(7);
    // The metadata are a small part of the file, and the one where something may not matter.
    let header = 8 * (8 + u64::from_le_bytes(whole[..8].try_into().expect("a length")));
    for i in 0..flips {
        let bit = random.u64(..if i % 2 == 0 { header } else { bits }) as usize;
        let mut flipped = whole.clone();
        flipped[bit / 8] ^= 1 << (bit % 8);
        fs::write(&state, &flipped).expect("written");
        let done = trainings.train("run", 3, &["--resume"]);
        let told = stderr(&done);
        match done.status.code() {
            Some(3) => {
                assert!(told.contains("start again in another folder"), "{told}");
                assert!(trainings.read("run", STATE) == flipped, "it was changed");
                refused += 1;
            }
            Some(0) => {
                assert!(
                    trainings.read("run", WEIGHTS) == expected,
                    "bit {bit}: other weights"
                );
                fs::write(trainings.path("run").join("log.jsonl"), &log).expect("written");
                same += 1;
            }
            code => panic!("bit {bit}: exit code {code:?}: {told}"),
        }
    }
    println!("{flips} flips: {refused} refused, {same} went on to the same weights");
    assert!(refused > 0);
    fs::write(&state, &whole).expect("written");
    trainings.trained("run", 3, &["--resume"]);
    assert!(trainings.read("run", WEIGHTS) == expected);
}

#[test]
fn a_state_without_a_checksum_is_refused() {
    let trainings = Trainings::new();
    trainings.trained("run", 2, &[]);
    let state = trainings.read("run", STATE);
    let file = SafeTensors::deserialize(&state).expect("safetensors");
    // As it was written before there was one.
    let old = HashMap::from([("tracklens.progress".to_owned(), "{}".to_owned())]);
    let bytes = safetensors::serialize(file.tensors(), Some(old)).expect("safetensors");
    fs::write(trainings.path("run").join(STATE), bytes).expect("written");
    trainings.refused(
        "run",
        3,
        &["--resume"],
        3,
        "an earlier version of tracklens wrote the state",
    );
    // Cut short, as by a copy to a full disk.
    fs::write(
        trainings.path("run").join(STATE),
        &state[..state.len() - 100],
    )
    .expect("written");
    trainings.refused(
        "run",
        3,
        &["--resume"],
        3,
        "the state of the run is damaged",
    );
}

#[test]
fn a_state_of_another_run_is_refused() {
    let trainings = Trainings::new();
    trainings.trained("a", 4, &["--seed=1"]);
    trainings.trained("b", 2, &["--seed=2"]);
    trainings.trained("twin", 2, &["--seed=1"]);
    let whole = trainings.read("a", STATE);
    let (log, config) = (
        trainings.read("a", "log.jsonl"),
        trainings.read("a", "config.json"),
    );
    let state = trainings.path("a").join(STATE);
    let put = |other: &str, code: i32, message: &str| {
        fs::write(&state, trainings.read(other, STATE)).expect("written");
        trainings.refused("a", 6, &["--seed=1", "--resume"], code, message);
        assert!(trainings.read("a", "log.jsonl") == log);
        assert!(trainings.read("a", "config.json") == config);
    };
    put("b", 4, "is of another run: `seed` is 2 there and 1 here");
    // Of the same configuration, and still not the state that belongs to this log.
    put("twin", 3, "the log is not the one that state.safetensors");
    fs::write(&state, whole).expect("written");
    trainings.trained("a", 6, &["--seed=1", "--resume"]);
}

#[test]
fn other_data_are_refused() {
    let trainings = Trainings::with_own_data();
    trainings.trained("run", 2, &[]);
    let frame = |name: &str| trainings.data.join("seq_0000").join(name);
    let swap = |a: &str, b: &str| {
        let between = trainings.data.join("between");
        fs::rename(frame(a), &between).expect("renamed");
        fs::rename(frame(b), frame(a)).expect("renamed");
        fs::rename(&between, frame(b)).expect("renamed");
    };
    let frames = "the frames changed since the run was started";
    swap("frame_001.png", "frame_003.png");
    trainings.refused("run", 3, &["--resume"], 4, frames);
    swap("frame_001.png", "frame_003.png");

    let truth = trainings.data.join("ground_truth.csv");
    let text = fs::read_to_string(&truth).expect("a table");
    let changed = text.replacen("0.", "0.1", 1);
    assert_ne!(text, changed);
    fs::write(&truth, &changed).expect("written");
    let message = "the ground truth changed since the run was started";
    trainings.refused("run", 3, &["--resume"], 4, message);
    fs::write(&truth, &text).expect("written");

    // Nothing was written: with the old data the run goes on, to the same weights.
    trainings.trained("run", 3, &["--resume"]);
    assert!(trainings.read("run", WEIGHTS) == trainings.straight(3));
}

#[test]
fn frames_that_change_during_a_training_end_it() {
    let trainings = Trainings::with_own_data();
    let training = trainings.start("run", &["--cache=0"]);
    let frame = |name: &str| trainings.data.join("seq_0000").join(name);
    let copy = trainings.path("copy.png");
    fs::copy(frame("frame_003.png"), &copy).expect("copied");
    fs::rename(copy, frame("frame_001.png")).expect("renamed");
    let ended = training.wait_with_output().expect("it ends");
    let told = stderr(&ended);
    assert_eq!(ended.status.code(), Some(3), "{told}");
    assert!(
        told.contains("the frame has changed since the training was started"),
        "{told}"
    );
}

#[test]
fn a_folder_has_one_training() {
    let trainings = Trainings::new();
    let mut first = trainings.start("run", &[]);
    let message = format!("run: is being worked on by process {}", first.id());
    trainings.refused("run", 5, &[], 4, &message);
    trainings.refused("run", ENDLESS, &["--resume"], 4, &message);
    first.kill().expect("it is ours");
    first.wait().expect("it ends");
    let log = String::from_utf8(trainings.read("run", "log.jsonl")).expect("text");
    for line in log.lines().take(trainings.epochs("run")) {
        serde_json::from_str::<serde_json::Value>(line).expect("a whole line");
    }
    // The lock of a killed process holds nobody up.
    let epochs = trainings.epochs("run") as u32 + 1;
    trainings.trained("run", epochs, &["--resume"]);
    assert!(trainings.read("run", WEIGHTS) == trainings.straight(epochs));
    assert!(!trainings.path("run").join("lock").exists());
}

/// A sweep of two endless runs, planned.
fn sweep(trainings: &Trainings) -> PathBuf {
    let text = format!(
        "data = \"{}\"\narchitectures = [\"basic\"]\nseeds = \"0-1\"\n\n\
         [train]\nepochs = {ENDLESS}\nbatch = 2\nkeypoints = 4\n\
         input-size = 32\ntarget-size = 16\nsplit = \"0.67,0.33\"\n\
         encoder-channels = [4, 6, 8]\ndecoder-channels = [8, 6, 4]\n",
        trainings.data.display()
    );
    let file = trainings.path("sweep.toml");
    fs::write(&file, text).expect("written");
    let planned = Command::new(env!("CARGO_BIN_EXE_tracklens"))
        .args(["sweep", "plan"])
        .arg(&file)
        .output()
        .expect("the binary runs");
    assert!(planned.status.success(), "{}", stderr(&planned));
    trainings.path("runs")
}

fn run_sweep(folder: &Path, more: &[&str]) -> Command {
    let mut command = tracklens();
    command
        .args(["sweep", "run", "--quiet", "--threads=1"])
        .arg(folder)
        .args(more)
        .stderr(Stdio::piped());
    command
}

#[test]
fn sweep_and_train_have_one_lock() {
    let trainings = Trainings::new();
    let folder = sweep(&trainings);
    let out = "runs/basic/seed-00.partial";
    let mut worker = trainings.started(run_sweep(&folder, &["--line=1"]), out);
    let message = format!("is being worked on by process {}", worker.id());
    trainings.refused(out, 5, &["--resume"], 4, &message);
    signal("-TERM", &worker);
    assert_eq!(worker.wait().expect("it ends").code(), Some(130));

    // And the other way round.
    let out = "runs/basic/seed-01.partial";
    let mut training = trainings.start(out, &[]);
    let refused = run_sweep(&folder, &["--line=2"]).output();
    let refused = refused.expect("the binary runs");
    assert_eq!(refused.status.code(), Some(4), "{}", stderr(&refused));
    let message = format!("is being worked on by process {}", training.id());
    assert!(stderr(&refused).contains(&message), "{}", stderr(&refused));
    training.kill().expect("it is ours");
    training.wait().expect("it ends");
}

#[test]
fn sigterm_and_sighup_end_like_ctrl_c() {
    let trainings = Trainings::new();
    for name in ["-INT", "-TERM", "-HUP"] {
        let training = trainings.start("run", &["--resume"]);
        signal(name, &training);
        let ended = training.wait_with_output().expect("it ends");
        let told = stderr(&ended);
        assert_eq!(ended.status.code(), Some(130), "{name}: {told}");
        assert!(told.contains("cancelled"), "{name}: {told}");
        assert!(!trainings.path("run").join("lock").exists(), "{name}");
        let summary: serde_json::Value =
            serde_json::from_slice(&trainings.read("run", "summary.json")).expect("JSON");
        assert_eq!(summary["interrupted"], true, "{name}");
        assert_eq!(
            summary["epochs"].as_u64(),
            Some(trainings.epochs("run") as u64),
            "{name}"
        );
    }
    let epochs = trainings.epochs("run") as u32 + 1;
    trainings.trained("run", epochs, &["--resume"]);
    assert!(trainings.read("run", WEIGHTS) == trainings.straight(epochs));
}

#[test]
fn under_nohup_a_training_outlives_its_terminal() {
    let trainings = Trainings::new();
    let training = trainings.command("run", ENDLESS, &[]);
    // What nohup does.
    let mut command = Command::new("sh");
    command
        .args(["-c", "trap '' HUP; exec \"$0\" \"$@\""])
        .arg(training.get_program())
        .args(training.get_args())
        .stdout(Stdio::null())
        .stderr(Stdio::piped());
    let training = trainings.started(command, "run");
    signal("-HUP", &training);
    let epochs = trainings.epochs("run");
    wait("more epochs", || trainings.epochs("run") >= epochs + 3);
    signal("-TERM", &training);
    let ended = training.wait_with_output().expect("it ends");
    assert_eq!(ended.status.code(), Some(130), "{}", stderr(&ended));
}

#[test]
fn sigterm_ends_a_sweep_and_its_trainings() {
    let trainings = Trainings::new();
    let folder = sweep(&trainings);
    for name in ["-TERM", "-HUP"] {
        let sweep = run_sweep(&folder, &["--jobs=2"])
            .spawn()
            .expect("the binary runs");
        let outs = ["runs/basic/seed-00.partial", "runs/basic/seed-01.partial"];
        let before = outs.map(|out| trainings.epochs(out));
        wait("the first epochs", || {
            (0..2).all(|i| trainings.epochs(outs[i]) >= before[i] + 2)
        });
        let children = Command::new("pgrep")
            .args(["-P", &sweep.id().to_string()])
            .output()
            .expect("pgrep runs");
        let children = String::from_utf8(children.stdout).expect("numbers");
        assert_eq!(children.lines().count(), 2);
        signal(name, &sweep);
        let ended = sweep.wait_with_output().expect("it ends");
        assert_eq!(ended.status.code(), Some(130), "{name}: {}", stderr(&ended));
        for child in children.lines() {
            let alive = Command::new("kill")
                .args(["-0", child])
                .stderr(Stdio::null())
                .status();
            assert!(
                !alive.expect("kill runs").success(),
                "{name}: {child} lives"
            );
        }
        for out in outs {
            let summary: serde_json::Value =
                serde_json::from_slice(&trainings.read(out, "summary.json")).expect("JSON");
            assert_eq!(summary["interrupted"], true, "{name}");
        }
    }
}

#[test]
fn what_killed_processes_left_goes_at_the_next_start() {
    let trainings = Trainings::new();
    // Ten kills at any moment.
    for i in 0..10 {
        let mut training = trainings.start("run", &["--resume"]);
        std::thread::sleep(Duration::from_millis(3 * i));
        training.kill().expect("it is ours");
        training.wait().expect("it ends");
    }
    // And what is certain to be there: a file of a killed process, and one that is being written.
    let run = trainings.path("run");
    fs::write(run.join(".tracklens-killed.tmp"), "a part").expect("written");
    let written = File::create(run.join(".tracklens-writes.tmp")).expect("a file");
    written.lock().expect("locked");
    let epochs = trainings.epochs("run") as u32 + 1;
    trainings.trained("run", epochs, &["--resume"]);
    assert_eq!(left_over(&run), [".tracklens-writes.tmp"]);
    drop(written);
    trainings.trained("run", epochs, &["--resume"]);
    assert_eq!(left_over(&run), [""; 0]);
    assert!(trainings.read("run", WEIGHTS) == trainings.straight(epochs));
}

#[test]
fn conversions_remove_what_killed_ones_left() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    let leave = || {
        fs::write(path(".tracklens-killed.tmp"), "a part").expect("written");
        fs::create_dir_all(path(".tracklens-folder.tmp/seq_0000")).expect("a folder");
    };
    let tracklens = |arguments: &[&str], from: &Path, to: &Path| {
        let done = Command::new(env!("CARGO_BIN_EXE_tracklens"))
            .args(arguments)
            .arg(from)
            .arg(to)
            .output()
            .expect("the binary runs");
        assert!(done.status.success(), "{}", stderr(&done));
        assert_eq!(left_over(folder.path()), [""; 0]);
    };
    let checkpoint = recording().join("../../golden/basic-vel-std-bg-tiny.safetensors");
    leave();
    tracklens(&["convert"], &checkpoint, &path("weights.pth"));
    leave();
    tracklens(&["data", "convert"], &recording(), &path("data.npz"));
    leave();
    tracklens(&["data", "convert"], &path("data.npz"), &path("data"));
}
