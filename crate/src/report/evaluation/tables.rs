//! The tables of one evaluation.

use super::words::protocol;
use crate::evaluation::{
    ContextReport, EvaluationReport, ObjectReport, SequencesReport, TemporalReport,
};
use crate::metric::AffineMap;
use crate::report::{Cell, Column, Emphasis, Precision, Table};

/// Sequences that the page lists for an object.
pub(super) const WORST: usize = 10;

fn short(value: impl Into<Option<f64>>) -> Cell {
    Cell::number(value, None, Precision::Short)
}

/// One line an object as CSV: what a spreadsheet of many evaluations is made of.
pub fn evaluation_csv(report: &EvaluationReport) -> String {
    let labels = [
        "object",
        "tracked",
        "error",
        "threshold",
        "best_keypoint",
        "error_sum",
        "rmse",
        "rmse_px",
        "frames",
        "outside",
        "transform",
        "rank",
        "protocol",
        "held_out_error",
        "enough_data",
    ];
    let mut table = Table::new("objects", "Objects", labels.map(Column::text));
    let full = |value: Option<f64>| Cell::number(value, None, Precision::Full);
    for object in &report.objects {
        let best = object.best_keypoint;
        let held_out = report
            .held_out
            .iter()
            .flat_map(|held_out| &held_out.objects);
        let held_out = held_out.into_iter().find(|own| own.name == object.name);
        let sufficiency = report.sufficiency.iter().flatten();
        let known = sufficiency.into_iter().find(|own| own.name == object.name);
        table.push([
            Cell::text(&object.name),
            Cell::text(object.tracked.to_string()),
            full(object.error),
            full(Some(object.threshold)),
            best.map_or_else(|| Cell::text(""), |n| Cell::count(n as u64)),
            full(object.error_sum),
            full(object.rmse),
            full(object.rmse_px),
            Cell::count(object.frames),
            Cell::count(object.outside),
            Cell::text(&report.transform),
            Cell::text(&report.rank),
            Cell::text(&report.protocol),
            full(held_out.and_then(|own| own.error)),
            known.map_or_else(
                || Cell::text(""),
                |own| Cell::text(own.is_known.to_string()),
            ),
        ]);
    }
    table.to_csv()
}

/// A threshold as it was given; one that was computed has more digits than anybody reads.
fn threshold(value: f64) -> Cell {
    const GIVEN: usize = 8;
    let precision = match value.to_string().len() <= GIVEN {
        true => Precision::Full,
        false => Precision::Short,
    };
    Cell::number(value, None, precision)
}

/// The objects as a LaTeX table for a paper, with how they were scored in its caption.
pub fn evaluation_tex(report: &EvaluationReport) -> String {
    let pixels = report.objects.iter().any(|object| object.rmse_px.is_some());
    let held_out = report.held_out.as_ref();
    let mut columns = vec![
        Column::text("object"),
        Column::number("threshold"),
        Column::number("error"),
    ];
    if held_out.is_some() {
        columns.push(Column::number("held-out error"));
    }
    if pixels {
        columns.push(Column::number("RMSE, px"));
    }
    columns.push(Column::number("keypoint"));
    let caption = match report.tc {
        Some(tc) => format!("Tracking errors, tracking capability {tc:.2}"),
        None => "Tracking errors; the tracking capability is unknown".to_owned(),
    };
    let mut table = Table::new("objects", caption, columns).note(protocol(report));
    for object in &report.objects {
        let intervals = report.intervals.iter().flat_map(|i| &i.objects);
        let interval = intervals
            .filter(|interval| interval.name == object.name)
            .find_map(|interval| interval.error);
        let mut cells = vec![
            Cell::text(&object.name),
            threshold(object.threshold),
            Cell::number(object.error, interval, Precision::Short)
                .emphasis(Emphasis::verdict(object.tracked)),
        ];
        if let Some(held_out) = held_out {
            let own = held_out.objects.iter().find(|own| own.name == object.name);
            let emphasis = own.and_then(|own| Emphasis::verdict(own.tracked));
            cells.push(short(own.and_then(|own| own.error)).emphasis(emphasis));
        }
        if pixels {
            cells.push(short(object.rmse_px));
        }
        cells.push(Cell::count(object.best_keypoint.map(|n| n as u64)));
        table.push(cells);
    }
    table.to_latex()
}

/// The errors of the objects, with their intervals and held-out errors where there are any.
pub(super) fn objects(report: &EvaluationReport) -> Table {
    let pixels = report.objects.iter().any(|object| object.rmse_px.is_some());
    let mut columns = vec![
        Column::text("object"),
        Column::text("tracked"),
        Column::number("error"),
        Column::number("threshold"),
    ];
    if report.held_out.is_some() {
        columns.push(Column::number("held-out error"));
    }
    columns.extend(["best keypoint", "second best", "RMSE"].map(Column::number));
    if pixels {
        columns.push(Column::number("RMSE, px"));
    }
    columns.extend(["frames", "outside"].map(Column::number));
    let mut table = Table::new("objects", "Objects", columns);
    for object in &report.objects {
        table.push(object_cells(report, object, pixels));
    }
    table
}

fn object_cells(report: &EvaluationReport, object: &ObjectReport, pixels: bool) -> Vec<Cell> {
    let intervals = report.intervals.iter().flat_map(|i| &i.objects);
    let interval = intervals
        .filter(|interval| interval.name == object.name)
        .find_map(|interval| interval.error);
    let tracked = if object.tracked { "yes" } else { "no" };
    let mut cells = vec![
        Cell::text(&object.name),
        Cell::text(tracked).emphasis(Emphasis::verdict(object.tracked)),
        Cell::number(object.error, interval, Precision::Short),
        threshold(object.threshold),
    ];
    if let Some(held_out) = &report.held_out {
        let own = held_out.objects.iter().find(|own| own.name == object.name);
        let emphasis = own.and_then(|own| Emphasis::verdict(own.tracked));
        cells.push(short(own.and_then(|own| own.error)).emphasis(emphasis));
    }
    cells.push(Cell::count(object.best_keypoint.map(|n| n as u64)));
    cells.push(match object.second_best {
        Some(second) => {
            Cell::count(second.keypoint as u64).note(Some(Precision::Short.write(second.error)))
        }
        None => Cell::count(None),
    });
    cells.push(short(object.rmse));
    if pixels {
        cells.push(short(object.rmse_px));
    }
    cells.extend([object.frames, object.outside].map(Cell::count));
    cells
}

/// The fitted maps.
pub(super) fn maps(report: &EvaluationReport) -> Table {
    let [coordinates, of_keypoint] = match report.dimensions {
        Some(dimensions) => [dimensions.truth, dimensions.keypoints],
        None => [2, 2],
    };
    let columns = ["x", "y", "z"].into_iter().take(coordinates);
    let columns = [Column::text("object"), Column::number("keypoint")]
        .into_iter()
        .chain(columns.map(Column::number));
    let unit = if report.is_in_space() {
        "the unit of the ground truth"
    } else {
        "ndc"
    };
    let names = KEYPOINT[..of_keypoint.min(KEYPOINT.len())].join(", ");
    let mut table = Table::new("maps", "Fitted maps", columns).note(format!(
        "Position of the object from the keypoint ({names}), in {unit}."
    ));
    for object in &report.objects {
        let Some((map, keypoint)) = object.map.zip(object.best_keypoint) else {
            continue;
        };
        let first = [Cell::text(&object.name), Cell::count(keypoint as u64)];
        let terms = terms(&map).into_iter().map(Cell::text);
        table.push(first.into_iter().chain(terms));
    }
    table
}

/// What the coordinates of a keypoint are called.
const KEYPOINT: [&str; 3] = ["u", "v", "w"];

/// A map row by row, as terms of the keypoint (u, v) or (u, v, w).
fn terms(map: &AffineMap) -> Vec<String> {
    let signed = |value: f64, what: &str| {
        let sign = if value < 0.0 { "−" } else { "+" };
        format!("{sign} {:.4}{what}", value.abs())
    };
    let row = |axis: usize| {
        let mut text = String::new();
        for (i, (factor, name)) in map.a[axis].iter().zip(KEYPOINT).enumerate() {
            text += &match i {
                0 => format!(
                    "{}{:.4} {name}",
                    if *factor < 0.0 { "−" } else { "" },
                    factor.abs()
                ),
                _ => format!(" {}", signed(*factor, &format!(" {name}"))),
            };
        }
        format!("{text} {}", signed(map.b[axis], ""))
    };
    (0..map.a.len()).map(row).collect()
}

/// The sequences in which the best keypoint of an object is furthest from it.
pub(super) fn worst_sequences(of: &SequencesReport) -> Table {
    let columns = [
        Column::text(format!("{}, keypoint {}", of.object, of.keypoint)),
        Column::number("error"),
        Column::number("frames"),
        Column::number("worst frame"),
        Column::number("squared distance there"),
    ];
    let mut table = Table::new("sequences", format!("Sequences of {}", of.object), columns);
    if of.errors.len() > WORST {
        table = table.note(format!(
            "The first {WORST} of {} sequences.",
            of.errors.len()
        ));
    }
    for sequence in of.errors.iter().take(WORST) {
        table.push([
            Cell::text(&sequence.sequence),
            short(sequence.error),
            Cell::count(sequence.frames),
            Cell::count(sequence.worst_frame),
            short(sequence.worst_error),
        ]);
    }
    table
}

fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

/// Columns of shares within the distances of `context`.
fn within(context: &ContextReport) -> impl Iterator<Item = Column> {
    let close = context.close.iter();
    close.map(|share| Column::number(format!("within {}", percent(*share))))
}

/// As many cells as [`within`] has columns.
fn shares<'a>(
    context: &'a ContextReport,
    shares: Option<&'a Vec<f64>>,
) -> impl Iterator<Item = Cell> + 'a {
    (0..context.close.len()).map(move |i| {
        let share = shares.and_then(|shares| shares.get(i));
        share.map_or_else(|| Cell::count(None), |share| Cell::text(percent(*share)))
    })
}

/// The best keypoints over time: a row a measure, a column an object, and one for all together
/// where there is such a number.
pub fn temporal(report: &EvaluationReport, measures: &TemporalReport) -> Table {
    let objects = report.objects.iter();
    let columns = std::iter::once(Column::text("temporal quality"))
        .chain(objects.map(|object| Column::number(&object.name)))
        .chain([Column::number("all")]);
    let mut table = Table::new("temporal", "Temporal quality", columns).note(
        "Of every object's best keypoint under its map; none of it changes the TC. docs/metrics.md has the \
         definitions.",
    );
    for row in &measures.measures {
        let (name, is_share) = measure(&row.measure);
        let cell = |value: &Option<f64>| match value {
            Some(share) if is_share => Cell::text(percent(*share)),
            value => short(*value),
        };
        let cells = row.objects.iter().chain([&row.all]).map(cell);
        table.push(std::iter::once(Cell::text(name)).chain(cells));
    }
    table
}

/// What a measure is called, and whether it is a share.
fn measure(name: &str) -> (String, bool) {
    let (words, is_share) = match name {
        "jitter" => ("jitter, ndc/frame²", false),
        "velocity_correlation" => ("velocity correlation", false),
        "lag" => ("lag, frames", false),
        "handed_over" => ("handed over", true),
        "held_out_affine" => ("held out, affine map", false),
        "held_out_orientation" => ("held out, with orientation", false),
        "held_out_projective" => ("held out, projective map", false),
        "visibility_accuracy" => ("visibility accuracy", true),
        "position_accuracy" => ("position accuracy", true),
        "average_jaccard" => ("average Jaccard", true),
        "oks" => ("OKS", true),
        other => match other.strip_prefix("pck_") {
            Some(close) => return (format!("PCK within {close} %"), true),
            None => (other, false),
        },
    };
    (words.to_owned(), is_share)
}

/// Linear regression from all keypoints.
pub(super) fn regression(context: &ContextReport) -> Table {
    let columns = [
        Column::text("object"),
        Column::text("predicted frames"),
        Column::number("error"),
    ];
    let columns = columns.into_iter().chain(within(context));
    let mut table = Table::new("regression", "Linear regression", columns).note(
        "Linear regression of every object from all keypoints together, and the percentage of correct positions (PCK) \
         within a share of the side of the image, as in Jakab et al. (2018).",
    );
    for row in &context.regression {
        let fitted = if row.held_out { "held out" } else { "fitted" };
        let cells = [
            Cell::text(&row.object),
            Cell::text(format!("{fitted}, {}", row.frames)),
            short(row.error),
        ];
        table.push(cells.into_iter().chain(shares(context, row.pck.as_ref())));
    }
    table
}

/// The min-cost assignment of keypoints to objects.
pub(super) fn assignment(context: &ContextReport) -> Table {
    let columns = [Column::group("matched"), Column::text("")];
    let columns = columns.into_iter().chain(within(context));
    let mut table = Table::new("assignment", "Assignment", columns).note(
        "Keypoints as they are, matched one to one to the objects with the smallest total distance, as in Kulkarni et \
         al. (2019): precision is the share of keypoints that are matched that closely, recall that of objects.",
    );
    for row in &context.assignment {
        for (name, values) in [("precision", &row.precision), ("recall", &row.recall)] {
            let cells = [
                Cell::text(format!("once a {}", row.trajectory)),
                Cell::text(name),
            ];
            table.push(cells.into_iter().chain(shares(context, Some(values))));
        }
    }
    table
}
