//! An evaluation in words.

use crate::evaluation::EvaluationReport;
use crate::report::Precision;

/// An evaluation in three lines for a paper: TC with the error of every object, how they were
/// scored, and by what.
pub fn evaluation_text(report: &EvaluationReport) -> String {
    let tracked = report.objects.iter().filter(|object| object.tracked);
    let objects = report.objects.iter().map(|object| {
        let error = object.error.map_or_else(
            || "never visible".to_owned(),
            |error| format!("e = {}", Precision::Short.write(error)),
        );
        format!("{} {error} (threshold {})", object.name, object.threshold)
    });
    let tc = match report.tc {
        Some(tc) => format!("{tc:.2}"),
        None => "unknown".to_owned(),
    };
    format!(
        "Tracking capability {tc}: {} of {} objects tracked; {}.\n{}\nFrom {} frames, by tracklens {}; metric: E. Cramer, \
         J. Reiher, S. Trimpe, Tracking Object Positions in Reinforcement Learning: A Metric for Keypoint Detection, L4DC \
         2024.\n",
        tracked.count(),
        report.objects.len(),
        objects.collect::<Vec<_>>().join(", "),
        protocol(report),
        report.frames,
        report.version
    )
}

/// How the objects were scored, in whole sentences.
pub(super) fn protocol(report: &EvaluationReport) -> String {
    let map = if report.transform == "identity" {
        "keypoints are scored as they are, without a fitted map".to_owned()
    } else {
        format!(
            "a time-invariant {} map from keypoint to object is fitted and scored on the same frames, as in the authors’ code \
             (rank rule: {})",
            report.transform, report.rank
        )
    };
    let unit = match report.is_in_space() {
        true => "in space, in the squared unit of the ground truth",
        false => "in ndc (−1 to +1 across the image)",
    };
    let mut text = format!(
        "The tracking error is the mean squared distance {unit}; {map}. An object is tracked when \
         the error of its best keypoint is at most its threshold; the tracking capability (TC) is the share of tracked objects."
    );
    if let Some(held_out) = &report.held_out {
        text += &format!(
            " Held out: maps and best keypoints are of the other sequences, in {} folds; TC {:.3}.",
            held_out.folds, held_out.tc
        );
    }
    if let Some(intervals) = &report.intervals {
        text += &format!(
            " Small figures: {:.0} % intervals of the errors that are fitted and scored on the same frames, {}, {} \
             resamples; of the TC on these frames: {:.3}–{:.3}.",
            100.0 * intervals.level,
            intervals.method,
            intervals.resamples,
            intervals.tc[0],
            intervals.tc[1]
        );
    }
    if report.excluded > 0 {
        text += &format!(
            " {} frames were left out because a keypoint was not a finite number.",
            report.excluded
        );
    }
    text
}
