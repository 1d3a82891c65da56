//! Random keypoints pass for tracking in at most 5 % of the recordings that are called sufficient.
//!
//! `cargo test --test library random -- --nocapture` prints the shares before and after.

use std::ops::Range;

use ndarray::{Array3, s};
use tracklens::metric::{CHANCE, NonFinite, Object, Settings, Sufficiency, evaluate, sufficiency};

const KEYPOINTS: usize = 32;
const TRIALS: usize = 60;

/// How points move.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Motion {
    /// A new position in every frame.
    Jumps,
    /// Steps from frame to frame, from a new position in every sequence.
    Walks,
    /// One position in each sequence.
    Rests,
    /// Rests in most sequences, and moves steadily in a few.
    RarelyMoves,
    /// A position in each sequence, with jumps of the same size around it.
    JumpsAround,
    /// A new position in every frame, on a line: the case in which the bound is exact.
    Line,
}

const MOTIONS: [Motion; 6] = [
    Motion::Jumps,
    Motion::Walks,
    Motion::Rests,
    Motion::RarelyMoves,
    Motion::JumpsAround,
    Motion::Line,
];

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

    /// (sequences x length) x count x 2.
    fn points(
        &mut self,
        motion: Motion,
        [sequences, length]: [usize; 2],
        count: usize,
    ) -> Array3<f64> {
        let mut points = Array3::zeros((sequences * length, count, 2));
        for sequence in 0..sequences {
            for n in 0..count {
                let start = [self.uniform(), self.uniform()];
                let speed = [self.uniform(), self.uniform()];
                let moves = self.uniform() > 0.6;
                let mut at = start;
                for t in 0..length {
                    for axis in 0..2 {
                        let random = self.uniform();
                        let part = t as f64 / length as f64;
                        at[axis] = match motion {
                            Motion::Jumps => random,
                            Motion::Line if axis == 1 => 0.5,
                            Motion::Line => random * 2f64.sqrt(),
                            Motion::Walks => at[axis] + random / (length as f64).sqrt(),
                            Motion::Rests => at[axis],
                            Motion::RarelyMoves if moves => start[axis] + speed[axis] * part,
                            Motion::RarelyMoves => start[axis],
                            Motion::JumpsAround => start[axis] + random,
                        };
                        points[[sequence * length + t, n, axis]] = at[axis];
                    }
                }
            }
        }
        points
    }
}

fn ranges([sequences, length]: [usize; 2]) -> Vec<Range<usize>> {
    (0..sequences)
        .map(|s| s * length..(s + 1) * length)
        .collect()
}

fn judged(truth: &Array3<f64>, size: [usize; 2], objects: &[Object]) -> Vec<Sufficiency> {
    sufficiency(truth.view(), &ranges(size), KEYPOINTS, 2, 1.0, objects).expect("the shapes fit")
}

#[test]
fn random_keypoints_pass_for_tracking_in_at_most_5_percent_of_sufficient_recordings() {
    // A threshold as a share of the variance of uniform positions, 2/3.
    let shares = [0.02, 0.2, 0.6];
    let sizes = [[1, 12], [1, 300], [4, 25], [12, 10], [40, 10], [100, 5]];
    let (mut before, mut after, mut known, mut worst) = (0, 0, 0, 0.0_f64);
    let mut trials = 0;
    for size in sizes {
        for object in MOTIONS {
            for keypoint in MOTIONS {
                for share in shares {
                    let objects = [Object::new("a", share * 2.0 / 3.0)];
                    let mut rng = Rng(trials as u64);
                    let mut passed = [0; 2];
                    let mut sufficient = 0;
                    for _ in 0..TRIALS {
                        let truth = rng.points(object, size, 1);
                        let keypoints = rng.points(keypoint, size, KEYPOINTS);
                        let found = evaluate(
                            keypoints.view(),
                            truth.view(),
                            &objects,
                            NonFinite::Error,
                            &Settings::default(),
                        )
                        .expect("an evaluation");
                        let is_known = judged(&truth, size, &objects)[0].is_known;
                        let tracked = found.objects[0].tracked;
                        passed[0] += usize::from(tracked);
                        passed[1] += usize::from(tracked && is_known);
                        sufficient += usize::from(is_known);
                    }
                    let rate = passed[1] as f64 / TRIALS as f64;
                    if rate > 0.0 {
                        println!(
                            "{size:?}, {keypoint:?} for {object:?}, threshold {share} of the variance: tracked \
                             {:.1} % before, {:.1} % after, {:.0} % sufficient",
                            100.0 * passed[0] as f64 / TRIALS as f64,
                            100.0 * rate,
                            100.0 * sufficient as f64 / TRIALS as f64,
                        );
                    }
                    // A share of 5 % comes out above 15 % of 60 trials with a probability of 1e-3.
                    assert!(
                        rate <= 0.15,
                        "{size:?}, {keypoint:?} for {object:?}, {share}: {rate}"
                    );
                    worst = if rate > worst { rate } else { worst };
                    before += passed[0];
                    after += passed[1];
                    known += sufficient;
                    trials += TRIALS;
                }
            }
        }
    }
    let percent = |count: usize| 100.0 * count as f64 / trials as f64;
    println!(
        "{trials} recordings: random keypoints tracked in {:.1} % before, {:.2} % after; {:.1} % sufficient; worst cell {:.1} %",
        percent(before),
        percent(after),
        percent(known),
        100.0 * worst,
    );
    assert!(after as f64 <= CHANCE * trials as f64);
}

#[test]
fn what_is_needed_is_enough_and_hardly_more() {
    let objects = [Object::new("a", 0.1)];
    let size = [8, 10];
    let found = &judged(&Rng(1).points(Motion::Rests, size, 1), size, &objects)[0];
    assert!(
        !found.is_known && (found.observations - 8.0).abs() < 1e-9,
        "{found:?}"
    );
    let needed = found.needed.expect("it moves enough");
    let sequences = needed.sequences.expect("there are several") as usize;
    assert_eq!((needed.frames as usize).div_ceil(10), sequences);
    // The same motion in more sequences: eight positions, again and again.
    let positions = Rng(1).points(Motion::Rests, size, 1);
    let of = |count: usize| {
        let frames: Vec<usize> = (0..10 * count).map(|t| t % 80).collect();
        let truth = positions.select(ndarray::Axis(0), &frames);
        judged(&truth, [count, 10], &objects)[0].clone()
    };
    // The variance is that of eight positions only at multiples of eight.
    assert!(of(sequences.next_multiple_of(8)).is_known);
    assert!(!of(sequences / 8 * 8 - 8).is_known, "{sequences}");
}

#[test]
fn an_object_that_moves_less_than_its_threshold_is_unknown_whatever_there_is() {
    let truth = 0.01 * Rng(2).points(Motion::Jumps, [50, 20], 1);
    let found = &judged(&truth, [50, 20], &[Object::new("a", 0.015)])[0];
    assert!(!found.is_known && found.needed.is_none(), "{found:?}");
    let still = Array3::from_elem((1000, 1, 2), 0.3);
    let found = &judged(&still, [50, 20], &[Object::new("a", 0.015)])[0];
    assert_eq!(
        (found.is_known, found.needed, found.chance),
        (false, None, 1.0)
    );
}

#[test]
fn hidden_frames_and_unseen_objects_do_not_count() {
    let mut truth = Rng(3).points(Motion::Jumps, [20, 10], 2);
    truth.slice_mut(s![.., 1, ..]).fill(f64::NAN);
    truth.slice_mut(s![..100, 0, 0]).fill(f64::NAN);
    let objects = [Object::new("a", 0.015), Object::new("b", 0.015)];
    let found = judged(&truth, [20, 10], &objects);
    assert!(
        found[0].is_known && found[0].observations <= 100.0,
        "{found:?}"
    );
    assert_eq!((found[1].is_known, found[1].needed), (false, None));
    assert!(sufficiency(truth.view(), &ranges([20, 10]), 4, 2, 1.0, &objects[..1]).is_err());
}
