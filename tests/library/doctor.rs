//! The look at the data before they are scored: good data give no finding, and each fault is found,
//! over many random recordings.

use ndarray::{Array3, Axis};
use tracklens::data::{
    Alignment, AxisOrder, Flip, Parsed, Space, TableOptions, join_aligned, parse_ground_truth,
    parse_keypoints,
};
use tracklens::evaluation::MinConfidence;
use tracklens::evaluation::doctor::{Finding, Problem, Remedy, Side, Subject, examine};
use tracklens::track::{GroundTruth, KeypointTrack};

/// How objects move.
const MOTIONS: [&str; 6] = ["jumps", "walks", "circles", "rests", "slow", "pushed"];
/// Good recordings of every kind of motion.
const RECORDINGS: u64 = 20;
/// Those that faults are looked for in.
const FAULTY: u64 = 8;

struct Rng(u64);

impl Rng {
    /// -1 to 1.
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^= z >> 31;
        (z >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.uniform() + 1.0) / 2.0
    }

    fn below(&mut self, n: usize) -> usize {
        (self.between(0.0, n as f64) as usize).min(n - 1)
    }

    /// About normal.
    fn noise(&mut self) -> f64 {
        (0..4).map(|_| self.uniform()).sum::<f64>() * 0.75_f64.sqrt()
    }
}

/// A recording of a detector that follows its objects: keypoints lie on the objects but for a small
/// scale, a shear and a shift, which an encoder's latent space has, and noise.
struct Recording {
    sequences: usize,
    length: usize,
    /// (sequences x length) x objects x 2.
    truth: Array3<f64>,
    /// (sequences x length) x keypoints x 2.
    keypoints: Array3<f64>,
}

impl Recording {
    fn random(seed: u64, motion: &str) -> Self {
        let mut rng = Rng(seed * 7919 + motion.len() as u64 * 104_729);
        let [sequences, length] = match rng.below(4) {
            // An object that rests needs sequences to be somewhere else in.
            0 | 1 if motion == "rests" => [12, 20],
            0 => [1, 150 + rng.below(200)],
            1 => [4 + rng.below(4), 40 + rng.below(40)],
            2 => [30 + rng.below(40), 10],
            _ => [12 + rng.below(12), 20 + rng.below(20)],
        };
        let frames = sequences * length;
        let objects = 1 + rng.below(4);
        let keypoints = objects + 2 + rng.below(14);
        let paths = |rng: &mut Rng, count: usize, motion: &str| {
            let mut points = Array3::zeros((frames, count, 2));
            for k in 0..count {
                let rate = rng.between(0.1, 0.5);
                let mut at = [rng.uniform(), rng.uniform()].map(|v| 0.8 * v);
                let mut speed = [0.0; 2];
                for t in 0..frames {
                    let start = t % length == 0;
                    if start && motion != "slow" || motion == "jumps" {
                        at = [rng.uniform(), rng.uniform()].map(|v| 0.8 * v);
                    }
                    if start || rng.uniform() > 0.8 {
                        speed = [rng.uniform(), rng.uniform()].map(|v| 0.1 * v);
                    }
                    for axis in 0..2 {
                        let phase = rate * t as f64 + axis as f64;
                        match motion {
                            "walks" => at[axis] += 0.06 * rng.noise(),
                            "circles" => at[axis] = 0.7 * phase.sin(),
                            "slow" => at[axis] += 0.02 * rng.noise(),
                            "pushed" => at[axis] += speed[axis],
                            _ => {}
                        }
                        if at[axis].abs() > 1.0 {
                            at[axis] = at[axis].signum() * (2.0 - at[axis].abs());
                            speed[axis] = -speed[axis];
                        }
                        points[[t, k, axis]] = at[axis];
                    }
                }
            }
            points
        };
        let truth = paths(&mut rng, objects, motion);
        let mut found = paths(&mut rng, keypoints, "pushed");
        let noise = rng.between(0.005, 0.05);
        for k in 0..objects {
            // One object in four is not followed.
            if k > 0 && rng.below(4) == 0 {
                continue;
            }
            let n = 2 * k % keypoints;
            let scale = [rng.between(0.7, 1.1), rng.between(0.7, 1.1)];
            let shear = [rng.between(-0.2, 0.2), rng.between(-0.2, 0.2)];
            let shift = [0.1 * rng.uniform(), 0.1 * rng.uniform()];
            for t in 0..frames {
                for axis in 0..2 {
                    let own = scale[axis] * truth[[t, k, axis]];
                    let other = shear[axis] * truth[[t, k, 1 - axis]];
                    found[[t, n, axis]] = own + other + shift[axis] + noise * rng.noise();
                }
            }
        }
        Self {
            sequences,
            length,
            truth,
            keypoints: found,
        }
    }

    /// The tables as a person would write them: `truth` and `keypoints` give for a position its text.
    fn examine(&self, how: &How) -> Vec<Finding> {
        let (truth, keypoints) = self.tables(how);
        let truth =
            parse_ground_truth(truth.as_bytes(), "gt.csv", &how.truth_options).expect("a table");
        let keypoints = parse_keypoints(keypoints.as_bytes(), "kp.csv", &how.keypoints_options)
            .expect("a table");
        examined(&truth, &keypoints, how.alignment, how.image_size)
    }

    fn tables(&self, how: &How) -> (String, String) {
        let mut truth = String::from("sequence,frame,object,x,y\n");
        let mut keypoints = String::from("sequence,frame,keypoint,x,y\n");
        for s in 0..self.sequences {
            for t in 0..self.length {
                let row = s * self.length + t;
                let frame = t as u64 + how.truth_base;
                let sequence = s as u64 + how.sequence_base;
                for (k, p) in self.truth.index_axis(Axis(0), row).outer_iter().enumerate() {
                    let [x, y] = (how.truth)([p[0], p[1]]);
                    truth += &format!("seq_{sequence},{frame},object_{k},{x},{y}\n");
                }
                // Keypoints of an earlier frame.
                let Some(shown) = (t as i64)
                    .checked_sub(how.lag)
                    .filter(|t| (0..self.length as i64).contains(t))
                else {
                    continue;
                };
                let row = s * self.length + shown as usize;
                let frame = t as u64 + how.keypoints_base;
                for (n, p) in self
                    .keypoints
                    .index_axis(Axis(0), row)
                    .outer_iter()
                    .enumerate()
                {
                    let [x, y] = (how.keypoints)([p[0], p[1]]);
                    keypoints += &format!("seq_{s},{frame},{n},{x},{y}\n");
                }
            }
        }
        (truth, keypoints)
    }
}

type Write = fn([f64; 2]) -> [f64; 2];

/// How a recording is written and read.
struct How {
    truth: Write,
    keypoints: Write,
    truth_base: u64,
    keypoints_base: u64,
    sequence_base: u64,
    lag: i64,
    truth_options: TableOptions,
    keypoints_options: TableOptions,
    alignment: Alignment,
    image_size: Option<[u32; 2]>,
}

impl Default for How {
    fn default() -> Self {
        Self {
            truth: |p| p,
            keypoints: |p| p,
            truth_base: 0,
            keypoints_base: 0,
            sequence_base: 0,
            lag: 0,
            truth_options: TableOptions::default(),
            keypoints_options: TableOptions::default(),
            alignment: Alignment::default(),
            image_size: None,
        }
    }
}

fn examined(
    truth: &Parsed<GroundTruth>,
    keypoints: &Parsed<KeypointTrack>,
    alignment: Alignment,
    image_size: Option<[u32; 2]>,
) -> Vec<Finding> {
    let join =
        join_aligned(keypoints.content.keys(), truth.content.keys(), alignment).expect("joined");
    examine(&Subject {
        truth: &truth.content,
        truth_reading: Some(&truth.reading),
        keypoints: &keypoints.content,
        keypoints_reading: Some(&keypoints.reading),
        join: &join,
        alignment,
        least: MinConfidence::default(),
        image_size,
    })
}

fn recordings(count: u64) -> impl Iterator<Item = (String, Recording)> {
    MOTIONS.iter().flat_map(move |motion| {
        (0..count).map(move |seed| {
            let recording = Recording::random(seed, motion);
            let (sequences, length) = (recording.sequences, recording.length);
            (
                format!("{motion} {seed}, {sequences} x {length}"),
                recording,
            )
        })
    })
}

/// How many recordings have a finding that `is` what is expected, of how many; prints the others.
fn found(
    how: &How,
    select: impl Fn(&str) -> bool,
    is: impl Fn(&Finding) -> bool,
) -> (usize, usize) {
    let (mut hits, mut all) = (0, 0);
    for (name, recording) in recordings(FAULTY).filter(|(name, _)| select(name)) {
        let findings = recording.examine(how);
        all += 1;
        match findings.iter().any(&is) {
            true => hits += 1,
            false => println!("{name}: {findings:?}"),
        }
    }
    (hits, all)
}

fn has(problem: Problem, remedy: Remedy) -> impl Fn(&Finding) -> bool {
    move |finding| finding.problem == problem && finding.remedies.first() == Some(&remedy)
}

#[test]
fn good_data_stay_quiet() {
    let mut alarms = 0;
    for (name, recording) in recordings(RECORDINGS) {
        let findings = recording.examine(&How::default());
        if !findings.is_empty() {
            alarms += 1;
            println!("{name}: {findings:?}");
        }
    }
    assert_eq!(alarms, 0, "false alarms on good data");
}

#[test]
fn keypoints_that_follow_nothing_stay_quiet() {
    for (name, mut recording) in recordings(FAULTY) {
        let other = Recording::random(name.len() as u64 + 1000, "walks");
        let (frames, count, _) = recording.keypoints.dim();
        let mut rng = Rng(17);
        for t in 0..frames {
            for n in 0..count {
                for axis in 0..2 {
                    let there = other.keypoints.dim();
                    let value = other.keypoints[[t % there.0, n % there.1, axis]];
                    recording.keypoints[[t, n, axis]] = value + 0.05 * rng.noise();
                }
            }
        }
        let findings = recording.examine(&How::default());
        assert!(findings.is_empty(), "{name}: {findings:?}");
    }
}

#[test]
fn a_lag_is_found() {
    for lag in [-3, -1, 1, 2, 5] {
        let how = How {
            lag,
            ..How::default()
        };
        // An object that rests, or hardly moves from frame to frame, shows no lag. On a circle at a
        // constant pace a lag is a rotation, which is an affine map: it changes no error.
        let moves = |name: &str| {
            let hidden = ["rests", "slow", "circles"];
            // With and without a lag of 5 frames, sequences of 10 have no row in common.
            let is_long = lag < 5 || !name.ends_with("x 10");
            is_long && !hidden.iter().any(|motion| name.starts_with(motion))
        };
        let (hits, all) = found(
            &how,
            moves,
            has(Problem::Lag, Remedy::ShiftFrames { by: lag }),
        );
        println!("lag {lag}: {hits} of {all}");
        assert!(hits * 100 >= all * 90, "lag {lag}: {hits} of {all}");
    }
}

/// The pixel of an image of 256 x 256 at a position in ndc.
fn pixels(p: [f64; 2]) -> [f64; 2] {
    p.map(|v| ((v + 1.0) * 256.0 - 1.0) / 2.0)
}

fn fractions(p: [f64; 2]) -> [f64; 2] {
    p.map(|v| (v + 1.0) / 2.0)
}

/// A fault of one table that must be found in all recordings of some motions, whatever the other
/// table is like.
fn always_found(how: &How, select: impl Fn(&str) -> bool, is: impl Fn(&Finding) -> bool) {
    let (hits, all) = found(how, select, is);
    assert_eq!(hits, all);
}

#[test]
fn each_unit_is_found() {
    let size = Some([256, 256]);
    for side in [Side::Truth, Side::Keypoints] {
        let how = |write: Write, image_size| match side {
            Side::Truth => How {
                truth: write,
                image_size,
                ..How::default()
            },
            Side::Keypoints => How {
                keypoints: write,
                image_size,
                ..How::default()
            },
        };
        let unit = |space| has(Problem::Unit, Remedy::Unit { side, space });
        always_found(&how(pixels, None), |_| true, unit(Space::Pixels));
        // The positions of a few objects may all lie in one quarter of the image, which is why the
        // other table is looked at: it needs something that moves.
        let moves = |name: &str| !name.starts_with("slow");
        let (hits, all) = found(&how(fractions, size), moves, unit(Space::Fraction));
        println!("fractions, {side:?}: {hits} of {all}");
        assert!(hits * 100 >= all * 95, "{hits} of {all}");
    }
    // Both tables from 0 to 1.
    let how = How {
        truth: fractions,
        keypoints: fractions,
        ..How::default()
    };
    let space = Space::Fraction;
    for side in [Side::Truth, Side::Keypoints] {
        let spread = |name: &str| name.starts_with("jumps") || name.starts_with("rests");
        let (hits, all) = found(
            &how,
            spread,
            has(Problem::Unit, Remedy::Unit { side, space }),
        );
        println!("both fractions, {side:?}: {hits} of {all}");
        assert!(hits * 100 >= all * 90, "{hits} of {all}");
    }
}

#[test]
fn points_slightly_outside_hide_no_unit() {
    // A coordinate in a hundred lies up to a twentieth of the image outside.
    let outside: Write = |p| {
        let stray = |v: f64| {
            if (v * 1e4) as i64 % 100 == 7 {
                -0.04
            } else {
                v
            }
        };
        fractions(p).map(stray)
    };
    let how = How {
        keypoints: outside,
        ..How::default()
    };
    let side = Side::Keypoints;
    let remedy = Remedy::Unit {
        side,
        space: Space::Fraction,
    };
    let (hits, all) = found(
        &how,
        |name| !name.starts_with("slow"),
        has(Problem::Unit, remedy),
    );
    assert!(hits * 100 >= all * 95, "{hits} of {all}");
    let outside: Write = |p| pixels(p).map(|v| 1.2 * v - 20.0);
    let how = How {
        truth: outside,
        ..How::default()
    };
    let side = Side::Truth;
    let remedy = Remedy::Unit {
        side,
        space: Space::Pixels,
    };
    let spread = |name: &str| name.starts_with("jumps") || name.starts_with("rests");
    always_found(&how, spread, has(Problem::Unit, remedy));
}

#[test]
fn a_unit_that_a_person_said_is_not_questioned() {
    let said = TableOptions {
        space: Some(Space::Ndc),
        ..TableOptions::default()
    };
    for (name, recording) in recordings(FAULTY) {
        let findings = recording.examine(&How {
            truth: fractions,
            keypoints: pixels,
            truth_options: said,
            keypoints_options: said,
            ..How::default()
        });
        assert!(findings.is_empty(), "{name}: {findings:?}");
    }
}

#[test]
fn counting_from_one_is_found() {
    let truth = Side::Truth;
    let frames = How {
        truth_base: 1,
        ..How::default()
    };
    let remedy = Remedy::CountFrom {
        side: truth,
        first: 1,
        first_keypoint: None,
    };
    always_found(&frames, |_| true, has(Problem::Counting, remedy));
    let frames = How {
        keypoints_base: 1,
        ..How::default()
    };
    let remedy = Remedy::CountFrom {
        side: Side::Keypoints,
        first: 1,
        first_keypoint: Some(0),
    };
    always_found(&frames, |_| true, has(Problem::Counting, remedy));
    let sequences = How {
        sequence_base: 1,
        ..How::default()
    };
    let (mut hits, mut all) = (0, 0);
    for (name, recording) in recordings(FAULTY).filter(|(_, recording)| recording.sequences > 1) {
        let findings = recording.examine(&sequences);
        all += 1;
        let is = has(Problem::Counting, Remedy::ShiftSequences { by: -1 });
        match findings.iter().any(is) {
            true => hits += 1,
            false => println!("{name}: {findings:?}"),
        }
    }
    assert_eq!(hits, all);
}

#[test]
fn swapped_and_flipped_axes_are_found() {
    let (xy, yx) = (AxisOrder::Xy, AxisOrder::Yx);
    let cases: [(Write, AxisOrder, Flip); 5] = [
        (|[x, y]| [y, x], yx, Flip::None),
        (|[x, y]| [x, -y], xy, Flip::Y),
        (|[x, y]| [-x, y], xy, Flip::X),
        (|[x, y]| [-x, -y], xy, Flip::Xy),
        (|[x, y]| [-y, x], yx, Flip::Y),
    ];
    for (keypoints, order, flip) in cases {
        let how = How {
            keypoints,
            ..How::default()
        };
        let remedy = Remedy::Axes {
            side: Side::Keypoints,
            order,
            flip,
        };
        let (hits, all) = found(&how, |_| true, has(Problem::Axes, remedy));
        println!("{order:?} {flip:?}: {hits} of {all}");
        assert!(hits * 100 >= all * 90, "{hits} of {all}");
    }
}

/// A remedy, applied to a table that is written wrongly, leaves nothing to be found.
#[test]
fn remedies_leave_nothing_to_be_found() {
    let turned: Write = |[x, y]| [-y, x];
    for (name, recording) in recordings(FAULTY) {
        for side in [Side::Truth, Side::Keypoints] {
            // Where a person said how the keypoints' axes are, those of the ground truth are wrong.
            let mut how = match side {
                Side::Keypoints => How {
                    keypoints: turned,
                    ..How::default()
                },
                Side::Truth => How {
                    truth: turned,
                    keypoints_options: TableOptions {
                        axes: Some(AxisOrder::Xy),
                        flip: Some(Flip::None),
                        ..TableOptions::default()
                    },
                    ..How::default()
                },
            };
            let findings = recording.examine(&how);
            let Some(Remedy::Axes {
                side: of,
                order,
                flip,
            }) = findings
                .first()
                .and_then(|finding| finding.remedies.first().copied())
            else {
                continue;
            };
            assert_eq!(of, side, "{name}");
            let options = match side {
                Side::Truth => &mut how.truth_options,
                Side::Keypoints => &mut how.keypoints_options,
            };
            (options.axes, options.flip) = (Some(order), Some(flip));
            // What was said is not questioned; said by the file, it would be looked at again.
            let (truth, keypoints) = recording.tables(&how);
            let mut truth = parse_ground_truth(truth.as_bytes(), "gt.csv", &how.truth_options)
                .expect("a table");
            let mut keypoints =
                parse_keypoints(keypoints.as_bytes(), "kp.csv", &how.keypoints_options)
                    .expect("a table");
            for reading in [&mut truth.reading, &mut keypoints.reading] {
                reading.axes.by = tracklens::data::Ground::File;
                reading.flip.by = tracklens::data::Ground::File;
            }
            let left = examined(&truth, &keypoints, Alignment::default(), None);
            assert!(left.is_empty(), "{name}, {side:?}: {left:?}");
        }
    }
}

#[test]
fn positions_of_zero_that_stand_out_are_found() {
    // In pixels, where the first one is (0, 0), and in ndc, where it is the centre of the image.
    let lost = |p: [f64; 2], write: fn([f64; 2]) -> [f64; 2]| {
        let is_lost = (p[0] * 1e5) as i64 % 20 == 3;
        if is_lost { [0.0, 0.0] } else { write(p) }
    };
    let size = Some([256, 256]);
    let cases: [(Write, Option<Space>); 3] = [
        (|p| p, None),
        (pixels, Some(Space::Pixels)),
        (fractions, Some(Space::Fraction)),
    ];
    for (write, space) in cases {
        for (name, recording) in recordings(FAULTY) {
            let mut recording = recording;
            let options = TableOptions {
                space,
                image_size: size,
                ..TableOptions::default()
            };
            // Marks what is lost by a position that no object has.
            recording
                .keypoints
                .axis_iter_mut(Axis(1))
                .for_each(|mut of| {
                    for mut p in of.outer_iter_mut() {
                        let at = lost([p[0], p[1]], |p| p);
                        (p[0], p[1]) = (at[0], at[1]);
                    }
                });
            let marked: Write = match space {
                None => write,
                Some(Space::Pixels) => |p| if p == [0.0, 0.0] { p } else { pixels(p) },
                Some(_) => |p| if p == [0.0, 0.0] { p } else { fractions(p) },
            };
            let mut how = How {
                keypoints: marked,
                keypoints_options: options,
                ..How::default()
            };
            let findings = recording.examine(&how);
            let is = has(
                Problem::Zeros,
                Remedy::ZeroIsMissing {
                    side: Side::Keypoints,
                },
            );
            assert!(findings.iter().any(is), "{name}, {space:?}: {findings:?}");
            how.keypoints_options.zero_is_missing = Some(true);
            let left = recording.examine(&how);
            assert!(left.is_empty(), "{name}, {space:?}: {left:?}");
        }
    }
}

#[test]
fn an_object_that_does_not_move_is_named() {
    for (name, mut recording) in recordings(FAULTY) {
        recording.truth.index_axis_mut(Axis(1), 0).fill(0.3);
        let findings = recording.examine(&How::default());
        assert_eq!(findings.len(), 1, "{name}: {findings:?}");
        assert_eq!(findings[0].problem, Problem::Still);
        assert!(
            findings[0].text.contains("object_0"),
            "{}",
            findings[0].text
        );
    }
}

/// The recording that the paper's figures are like, with the keypoints of a detector: the folder
/// that `TRACKLENS_PANDA_PUSH` names.
#[test]
fn the_pandapush_recording_stays_quiet() {
    let Some(folder) = std::env::var_os("TRACKLENS_PANDA_PUSH") else {
        println!("skipped: TRACKLENS_PANDA_PUSH names no folder with the recording");
        return;
    };
    let path = std::path::PathBuf::from(folder).join("ground_truth.csv");
    let text = std::fs::read(&path).expect("the ground truth");
    let truth =
        parse_ground_truth(&text, "ground_truth.csv", &TableOptions::default()).expect("a table");
    // Keypoints that follow the objects with noise, and others that follow nothing.
    let points = truth.content.points_ndc();
    let (frames, objects, _) = points.dim();
    let mut rng = Rng(5);
    let keypoints = Array3::from_shape_fn((frames, objects + 8, 2), |(t, n, axis)| {
        let noise = 0.03 * rng.noise();
        match n < objects {
            true => 0.9 * points[[t, n, axis]] + noise,
            false => 20.0 * noise,
        }
    });
    let keys = truth.content.keys().to_vec();
    let csv =
        tracklens::data::keypoints_csv(&KeypointTrack::new(keys, keypoints).expect("a track"));
    let keypoints =
        parse_keypoints(csv.as_bytes(), "kp.csv", &TableOptions::default()).expect("a table");
    let findings = examined(&truth, &keypoints, Alignment::default(), Some([256, 256]));
    assert!(findings.is_empty(), "{findings:?}");
}
