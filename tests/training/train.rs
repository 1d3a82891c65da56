//! Short trainings on real frames: the loss falls, the run folder is whole, and nothing depends on
//! luck.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use tracklens::checkpoint::{Checkpoint, SaeConfig};
use tracklens::data::{EncodedFrames, FrameIndex, TableOptions, parse_ground_truth};
use tracklens::engine::{CpuEncoder, Workspace};
use tracklens::error::Error;
use tracklens::event::{Cancel, Event};
use tracklens::model::{fresh_weights, pointwise_encoder};
use tracklens::run::{
    BackgroundStart, CONFIG, ColorError, EncoderStart, EpochLog, LOG, RunConfig, SUMMARY, Split,
    SplitBy, TrainConfig, TrainSummary, ValidationFrames, read_log,
};
use tracklens::train::{DEFAULT_CACHE, Dataset, Existing, RunLock, RunOptions, train};

fn recording() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../tests/data/panda_push")
}

fn config(epochs: u32) -> TrainConfig {
    let mut sae = SaeConfig::new("basic-vel-std-bg".parse().expect("an architecture"));
    sae.keypoints = 4;
    sae.encoder_channels = vec![4, 6, 8];
    sae.decoder_channels = vec![8, 6, 4];
    sae.input_size = Some([32, 32]);
    sae.target_size = [16, 16];
    let split = Split::Shares {
        training: 0.67,
        validation: 0.33,
    };
    TrainConfig {
        epochs,
        batch: 2,
        seed: 7,
        split,
        ..TrainConfig::new(sae)
    }
}

fn dataset(config: &TrainConfig, cache: u64) -> Dataset {
    let truth = fs::read(recording().join("ground_truth.csv")).expect("a ground truth");
    let truth = parse_ground_truth(&truth, "ground_truth.csv", &TableOptions::default())
        .expect("a table")
        .content;
    let mut paths = Vec::new();
    for sequence in ["seq_0000", "seq_0001", "seq_0012"] {
        for frame in 0..5 {
            paths.push(format!("{sequence}/frame_{frame:03}.png"));
        }
    }
    let index = FrameIndex::new(&paths).expect("frames");
    let order = index.order().to_vec();
    let read = move |i: usize| {
        let name = &paths[order[i]];
        Ok((
            name.clone(),
            fs::read(recording().join(name)).expect("a frame"),
        ))
    };
    let source = Arc::new(EncodedFrames::new(index, read));
    Dataset::load(source, &truth, config, cache, &Cancel::default()).expect("a data set")
}

fn attempt(
    config: &TrainConfig,
    out: &Path,
    existing: Existing,
    report: &mut dyn FnMut(Event),
    cancel: &Cancel,
) -> Result<TrainSummary, Error> {
    let dataset = dataset(config, DEFAULT_CACHE);
    let weights = fresh_weights(&config.sae, config.seed);
    let options = RunOptions {
        existing,
        tensorboard: false,
    };
    train(
        config,
        &dataset,
        &weights,
        &RunLock::take(out)?,
        options,
        report,
        cancel,
    )
}

fn run(config: &TrainConfig, out: &Path) -> TrainSummary {
    attempt(
        config,
        out,
        Existing::Refuse,
        &mut |_| {},
        &Cancel::default(),
    )
    .expect("a training")
}

fn resume(config: &TrainConfig, out: &Path) -> Result<TrainSummary, Error> {
    attempt(
        config,
        out,
        Existing::Resume,
        &mut |_| {},
        &Cancel::default(),
    )
}

fn weights(folder: &Path) -> Checkpoint {
    let bytes = fs::read(folder.join("checkpoint_final.safetensors")).expect("a checkpoint");
    Checkpoint::from_safetensors(&bytes).expect("a valid checkpoint")
}

#[test]
fn the_loss_falls_and_the_run_folder_is_whole() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("run");
    // A tiny model and 75 steps: a larger rate than the paper's shows the fall clearly.
    let summary = run(
        &TrainConfig {
            learning_rate: 3e-3,
            ..config(25)
        },
        &out,
    );
    let log = fs::read_to_string(out.join("log.jsonl")).expect("a log");
    let log: Vec<EpochLog> = log
        .lines()
        .map(|l| serde_json::from_str(l).expect("a line"))
        .collect();
    assert_eq!(log.len(), 25);
    let (first, last) = (&log[0], &log[24]);
    assert!(
        last.training.total < 0.5 * first.training.total,
        "{} after {}",
        last.training.total,
        first.training.total
    );
    assert_eq!(summary.last.as_ref(), Some(last));
    assert_eq!((summary.epochs, summary.interrupted), (25, false));
    assert_eq!(last.errors.len(), 3);
    for (map, errors) in &last.errors {
        assert_eq!(errors.len(), 3, "{map}");
    }
    // A map with more freedom fits at least as well.
    let error = |map: &str| last.errors[map]["cube"].expect("visible");
    let [affine, scale_translate, identity] = ["affine", "scale-translate", "identity"].map(error);
    assert!(affine <= scale_translate + 1e-9 && scale_translate <= identity + 1e-9);

    let written: serde_json::Value =
        serde_json::from_slice(&fs::read(out.join("config.json")).expect("a config"))
            .expect("JSON");
    assert_eq!(written["sae"]["architecture"], "basic-vel-std-bg");
    assert_eq!(
        written["training_sequences"].as_array().map(Vec::len),
        Some(2)
    );
    assert_eq!(
        written["validation_sequences"].as_array().map(Vec::len),
        Some(1)
    );
    assert!(out.join("summary.json").exists() && out.join("checkpoint_best.safetensors").exists());

    // What was trained is what extraction runs: input size, architecture and epoch travel with the
    // weights.
    let checkpoint = weights(&out);
    assert_eq!(checkpoint.config.input_size, Some([32, 32]));
    assert_eq!(checkpoint.metadata["tracklens.epoch"], "25");
    let encoder = CpuEncoder::new(&checkpoint).expect("a plan");
    let points = encoder
        .run(&mut Workspace::default(), &vec![0.5; 3 * 32 * 32], [32, 32])
        .expect("points");
    assert_eq!(points.len(), 4);
    let left: Vec<_> = fs::read_dir(&out)
        .expect("a folder")
        .map(|e| e.expect("a file").file_name())
        .collect();
    assert_eq!(left.len(), 6, "no temporary file is left behind: {left:?}");
}

#[test]
fn the_same_seed_gives_the_same_weights() {
    let folder = tempfile::tempdir().expect("a folder");
    let [a, b, c] = ["a", "b", "c"].map(|name| folder.path().join(name));
    run(&config(2), &a);
    run(&config(2), &b);
    run(
        &TrainConfig {
            seed: 8,
            ..config(2)
        },
        &c,
    );
    assert_eq!(weights(&a).tensors, weights(&b).tensors);
    assert_ne!(weights(&a).tensors, weights(&c).tensors);
}

#[test]
fn a_cancelled_training_keeps_its_last_whole_epoch_and_goes_on_to_the_same_weights() {
    let folder = tempfile::tempdir().expect("a folder");
    let [out, straight] = ["run", "straight"].map(|name| folder.path().join(name));
    let config = config(5);
    let cancel = Cancel::default();
    let switch = cancel.clone();
    let mut warned = false;
    let mut report = |event: Event| match event {
        Event::Progress { done: 8, .. } => switch.cancel(),
        Event::Warning(text) => warned = text.contains("after epoch 2 is kept"),
        _ => {}
    };
    let summary =
        attempt(&config, &out, Existing::Refuse, &mut report, &cancel).expect("a summary");
    assert!(summary.interrupted && warned);
    // Two training sequences of three snippets, two a step: three steps an epoch, so two whole
    // epochs.
    assert_eq!(summary.epochs, 2);
    assert_eq!(weights(&out).metadata["tracklens.epoch"], "2");
    let lines = || {
        fs::read_to_string(out.join("log.jsonl"))
            .expect("a log")
            .lines()
            .count()
    };
    assert_eq!(lines(), 2);
    let written: TrainSummary =
        serde_json::from_slice(&fs::read(out.join("summary.json")).expect("a summary"))
            .expect("JSON");
    assert_eq!(written, summary);

    // A line of an epoch that never ended, as a killed process leaves it.
    let mut log = fs::read(out.join("log.jsonl")).expect("a log");
    log.extend_from_slice(b"{\"epoch\":3,\"sec");
    fs::write(out.join("log.jsonl"), log).expect("written");
    let resumed = resume(&config, &out).expect("a training");
    assert_eq!(
        (resumed.epochs, resumed.interrupted, lines()),
        (5, false, 5)
    );
    let uninterrupted = run(&config, &straight);
    assert_eq!(weights(&out).tensors, weights(&straight).tensors);
    let (mut a, mut b) = (
        resumed.last.expect("an epoch"),
        uninterrupted.last.expect("an epoch"),
    );
    (a.seconds, b.seconds) = (0.0, 0.0);
    assert_eq!(a, b);
    assert_eq!(resumed.best_epoch, uninterrupted.best_epoch);

    // A finished run stays as it is; it can be made longer, not shorter, and not into another one.
    assert_eq!(resume(&config, &out).expect("nothing to do").epochs, 5);
    assert_eq!(
        resume(
            &TrainConfig {
                epochs: 6,
                ..config.clone()
            },
            &out
        )
        .expect("one more")
        .epochs,
        6
    );
    let error = resume(
        &TrainConfig {
            epochs: 3,
            ..config.clone()
        },
        &out,
    )
    .expect_err("fewer");
    assert!(error.to_string().contains("has come to epoch 6"), "{error}");
    let other = TrainConfig {
        epochs: 7,
        batch: 3,
        ..config
    };
    let error = resume(&other, &out).expect_err("another run").to_string();
    assert!(error.contains("`batch` is 2 there and 3 here"), "{error}");
}

#[test]
fn what_the_paper_and_the_code_do_differently_is_a_switch() {
    let folder = tempfile::tempdir().expect("a folder");
    let frames = |name: &str, config: &TrainConfig| {
        let summary = run(config, &folder.path().join(name));
        summary.evaluation.expect("an evaluation").frames
    };
    // One sequence of five frames to validate on: three snippets, of which a batch of two leaves
    // one out.
    assert_eq!(frames("code", &config(1)), 2);
    assert_eq!(
        frames(
            "keep",
            &TrainConfig {
                drop_last: false,
                ..config(1)
            }
        ),
        3
    );
    let all = TrainConfig {
        validation_frames: ValidationFrames::All,
        ..config(1)
    };
    assert_eq!(frames("all", &all), 5);
}

#[test]
fn sequences_of_an_episode_stay_together() {
    let pair = |sequence: &str, episode: &str| (sequence.to_owned(), episode.to_owned());
    // By name, and by the number in the name.
    let episodes = [pair("0", "a"), pair("seq_0001", "b"), pair("12", "a")];
    for seed in 0..4 {
        let folder = tempfile::tempdir().expect("a folder");
        let config = TrainConfig {
            seed,
            split_by: SplitBy::Episode,
            batch: 1,
            ..config(1)
        };
        let dataset = dataset(&config, DEFAULT_CACHE)
            .with_episodes(&episodes)
            .expect("episodes");
        let weights = fresh_weights(&config.sae, config.seed);
        let options = RunOptions {
            existing: Existing::Refuse,
            tensorboard: false,
        };
        let cancel = Cancel::default();
        train(
            &config,
            &dataset,
            &weights,
            &RunLock::take(folder.path()).expect("the folder"),
            options,
            &mut |_| {},
            &cancel,
        )
        .expect("a training");
        let said: RunConfig =
            serde_json::from_slice(&fs::read(folder.path().join(CONFIG)).expect("a file"))
                .expect("valid JSON");
        let mut parts = [said.training_sequences, said.validation_sequences];
        parts.iter_mut().for_each(|part| part.sort());
        parts.sort();
        assert_eq!(parts[0], ["seq_0000", "seq_0012"]);
        assert_eq!(parts[1], ["seq_0001"]);
    }
    let missing = dataset(&config(1), DEFAULT_CACHE).with_episodes(&episodes[..2]);
    let error = missing.expect_err("no episode").to_string();
    assert!(error.contains("`seq_0012` has no episode"), "{error}");
}

#[test]
fn training_lowers_the_error_of_whitened_colours() {
    let folder = tempfile::tempdir().expect("a folder");
    let losses = |color_error: ColorError| {
        let out = folder.path().join(format!("{color_error:?}"));
        let config = TrainConfig {
            color_error,
            background: BackgroundStart::Mean,
            ..config(3)
        };
        run(&config, &out);
        let log = fs::read(out.join(LOG)).expect("a log");
        let (entries, _) = read_log::<EpochLog>(&log);
        let losses: Vec<f64> = entries.iter().map(|e| e.training.reconstruction).collect();
        losses
    };
    let [plain, whitened] = [ColorError::Plain, ColorError::Whitened].map(losses);
    assert!(whitened[2] < whitened[0], "{whitened:?}");
    assert_ne!(whitened, plain, "the option has no effect");
}

#[test]
fn the_encoder_has_a_learning_rate_of_its_own() {
    let folder = tempfile::tempdir().expect("a folder");
    let trained = |name: &str, learning_rate: f64, encoder_learning_rate: Option<f64>| {
        let out = folder.path().join(name);
        let config = TrainConfig {
            learning_rate,
            encoder_learning_rate,
            ..config(1)
        };
        run(&config, &out);
        weights(&out).tensors
    };
    let same = trained("same", 1e-3, None);
    assert_eq!(trained("equal", 1e-3, Some(1e-3)), same, "one step, twice");
    // A rate at which weights stay where they start; the statistics of batch norms are no weights.
    let start = fresh_weights(&config(1).sae, config(1).seed).tensors;
    let [still, only] = [("still", 1e-3, 1e-30), ("only", 1e-30, 1e-3)]
        .map(|(name, rate, of_encoder)| trained(name, rate, Some(of_encoder)));
    for name in start.keys().filter(|name| name.ends_with("conv1.weight")) {
        let is_encoder = name.starts_with("encoder.");
        assert_eq!(still[name] == start[name], is_encoder, "{name}");
        assert_eq!(only[name] != start[name], is_encoder, "{name}");
    }
}

#[test]
fn an_encoder_that_starts_pointwise_sees_whitened_colours() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("run");
    let config = TrainConfig {
        encoder_start: EncoderStart::Pointwise,
        // Zero in single precision, so that weights stay where they start.
        learning_rate: 1e-60,
        ..config(1)
    };
    run(&config, &out);
    let (trained, drawn) = (weights(&out), fresh_weights(&config.sae, config.seed));
    let name = "encoder.block1.conv1.weight";
    let tensor = trained.tensor(name).expect("a filter");
    // The middle of 3 x 3, four filters of three colours.
    let filters: Vec<f64> = tensor.data.iter().map(|v| f64::from(*v)).collect();
    for (i, value) in filters.iter().enumerate() {
        assert_eq!(*value != 0.0, i % 9 == 4, "{i}");
    }
    // The same filters of colours as they are, and what whitening made of them.
    let mut plain = drawn.clone();
    let identity = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    pointwise_encoder(&mut plain, &identity, config.seed).expect("an encoder");
    assert_ne!(&plain.tensors[name], tensor);
    for (name, tensor) in &plain.tensors {
        let weights = name.ends_with("conv2.weight") || name.ends_with("conv.weight");
        if weights {
            assert_eq!(tensor, &trained.tensors[name], "{name}");
        }
    }
    // A resumed run goes on from its state, not from the start.
    let longer = TrainConfig {
        epochs: 2,
        ..config
    };
    resume(&longer, &out).expect("a resumed run");
    assert_eq!(&weights(&out).tensors[name], tensor);
}

#[test]
fn the_background_can_start_at_the_mean_of_the_training_targets() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("run");
    // A rate at which weights stay where they start.
    let config = TrainConfig {
        background: BackgroundStart::Mean,
        learning_rate: 1e-12,
        ..config(1)
    };
    run(&config, &out);
    let said: RunConfig =
        serde_json::from_slice(&fs::read(out.join(CONFIG)).expect("a configuration"))
            .expect("valid JSON");
    let dataset = dataset(&config, DEFAULT_CACHE);
    let frames: Vec<_> = dataset
        .sequences
        .iter()
        .filter(|s| said.training_sequences.contains(&s.name))
        .flat_map(|s| (0..s.len()).map(move |t| (s, t)))
        .collect();
    assert_eq!(frames.len(), 10);
    let (_, targets) = dataset.gather(&frames).expect("targets");
    let weights = weights(&out);
    let bias = &weights
        .tensor("decoder.aggregate_conv.bias")
        .expect("a bias")
        .data;
    let background = weights
        .tensor("decoder.background_bias.bias")
        .expect("a background");
    assert_eq!(background.shape, [3, 16, 16]);
    for (i, value) in background.data.iter().enumerate() {
        let mean = targets.iter().skip(i).step_by(3 * 256).sum::<f32>() / 10.0;
        let start = value + bias[i / 256];
        // Ten f32 numbers of at most 1 added up: within 1e-6.
        assert!(
            (start - mean).abs() < 1e-6,
            "{i}: {start} instead of {mean}"
        );
    }
}

#[test]
fn what_cannot_be_trained_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let error = |config: &TrainConfig, out: &Path| {
        attempt(
            config,
            out,
            Existing::Refuse,
            &mut |_| {},
            &Cancel::default(),
        )
        .expect_err("an error")
        .to_string()
    };
    let out = folder.path().join("run");
    run(&config(1), &out);
    let taken = error(&config(1), &out);
    assert!(
        taken.contains("holds a run already; resume it (--resume), give another folder"),
        "{taken}"
    );
    let other = folder.path().join("other");
    let large = error(
        &TrainConfig {
            batch: 100,
            ..config(1)
        },
        &other,
    );
    assert!(
        large.contains("hold 6 snippets of 3 frames; a batch needs 100"),
        "{large}"
    );
    let rate = error(
        &TrainConfig {
            learning_rate: -1.0,
            ..config(1)
        },
        &other,
    );
    assert!(
        rate.contains("the learning rate is -1; expected a positive number"),
        "{rate}"
    );
    let bare = error(
        &TrainConfig {
            sae: SaeConfig::named("basic-vel").expect("an architecture"),
            background: BackgroundStart::Mean,
            ..config(1)
        },
        &other,
    );
    assert!(
        bare.contains("the background's start is mean; expected zero, or an architecture with -bg"),
        "{bare}"
    );
    let diverged = error(
        &TrainConfig {
            learning_rate: 1e30,
            epochs: 20,
            ..config(1)
        },
        &other,
    );
    assert!(
        diverged.contains("diverged at learning rate") && diverged.contains("try a smaller one"),
        "{diverged}"
    );
}

#[test]
fn a_small_cache_changes_no_weight() {
    let folder = tempfile::tempdir().expect("a folder");
    let config = config(2);
    let trained = |cache: u64| {
        let out = folder.path().join(cache.to_string());
        let dataset = dataset(&config, cache);
        let again = dataset
            .notices
            .iter()
            .find(|n| n.contains("do not fit the cache"));
        let start = fresh_weights(&config.sae, config.seed);
        let (mut report, cancel) = (|_| {}, Cancel::default());
        train(
            &config,
            &dataset,
            &start,
            &RunLock::take(&out).expect("the folder"),
            RunOptions {
                existing: Existing::Refuse,
                tensorboard: false,
            },
            &mut report,
            &cancel,
        )
        .expect("a training");
        (weights(&out).tensors, again.cloned())
    };
    let (all, notice) = trained(DEFAULT_CACHE);
    assert_eq!(notice, None);
    // An input of 32 x 32 floats and a target of 16 x 16: 15360 bytes. Six frames fit, none fits.
    for (cache, left) in [(100_000, 9), (0, 15)] {
        let (some, notice) = trained(cache);
        assert_eq!(some, all, "a cache of {cache} bytes");
        let notice = notice.expect("a notice");
        assert!(notice.contains(&format!("{left} of 15")), "{notice}");
    }
}

#[test]
fn a_run_folder_is_read_back() {
    let folder = tempfile::tempdir().expect("a folder");
    let config = config(2);
    let summary = run(&config, folder.path());
    let read = |name: &str| fs::read(folder.path().join(name)).expect("a file");
    let written: RunConfig = serde_json::from_slice(&read(CONFIG)).expect("a configuration");
    assert_eq!(written.train, config);
    let (epochs, broken) = read_log(&read(LOG));
    assert_eq!(
        (epochs.len(), epochs.last(), broken.is_none()),
        (2, summary.last.as_ref(), true)
    );
    let again: TrainSummary = serde_json::from_slice(&read(SUMMARY)).expect("a summary");
    assert_eq!(again, summary);

    // A log that a crash cut in the middle of its last line.
    let log = read(LOG);
    let (epochs, broken) = read_log::<EpochLog>(&log[..log.len() - 9]);
    assert_eq!(epochs.len(), 1);
    assert!(
        broken
            .expect("a broken line")
            .to_string()
            .starts_with("line 2: ")
    );
}
