//! Objects that the best keypoint loses to another one.

use std::ops::Range;

use crate::error::Result;

/// Frames of a stretch.
const STRETCH: usize = 10;

/// The share of the frames, in stretches of ten, in which the best keypoint loses the object to
/// another one: its mean squared distance is above the threshold, and that of another keypoint under
/// its own map is not. `None` where the object is never visible together with a keypoint.
///
/// `distances` gives the squared distances of a keypoint in every frame, NaN where it or the object
/// is missing; a stretch in which a keypoint is missing is one that it does not have.
///
/// # Errors
/// As `distances`.
pub fn handed_over(
    best: usize,
    keypoints: usize,
    threshold: f64,
    runs: &[Range<usize>],
    distances: impl Fn(usize) -> Result<Vec<f64>>,
) -> Result<Option<f64>> {
    let stretches: Vec<Range<usize>> = runs.iter().flat_map(stretches).collect();
    let own = means(&distances(best)?, &stretches);
    let mut is_seen: Vec<bool> = own.iter().map(Option::is_some).collect();
    let lost = |mean: &Option<f64>| mean.is_none_or(|mean| mean > threshold);
    let is_lost: Vec<bool> = own.iter().map(lost).collect();
    let mut is_taken = vec![false; stretches.len()];
    if is_lost.contains(&true) {
        for other in (0..keypoints).filter(|n| *n != best) {
            let means = means(&distances(other)?, &stretches);
            for (i, mean) in means.into_iter().enumerate() {
                is_seen[i] |= mean.is_some();
                is_taken[i] |= is_lost[i] && mean.is_some_and(|mean| mean <= threshold);
            }
        }
    }
    let frames = |which: &[bool]| -> usize {
        let which = stretches.iter().zip(which).filter(|(_, is)| **is);
        which.map(|(stretch, _)| stretch.len()).sum()
    };
    let seen = frames(&is_seen);
    Ok((seen > 0).then(|| frames(&is_taken) as f64 / seen as f64))
}

/// A run in stretches; the last one takes what is too short for another.
fn stretches(run: &Range<usize>) -> impl Iterator<Item = Range<usize>> + use<> {
    let (start, end) = (run.start, run.end);
    let count = (run.len() / STRETCH).max(1);
    (0..count).map(move |i| {
        let from = start + i * STRETCH;
        from..if i + 1 == count { end } else { from + STRETCH }
    })
}

fn means(distances: &[f64], stretches: &[Range<usize>]) -> Vec<Option<f64>> {
    let mean = |stretch: &Range<usize>| {
        let values = distances[stretch.clone()].iter().filter(|v| !v.is_nan());
        let (sum, count) = values.fold((0.0, 0), |(sum, count), v| (sum + v, count + 1));
        super::mean(sum, count)
    };
    stretches.iter().map(mean).collect()
}
