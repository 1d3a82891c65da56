//! The figures and the page of one evaluation.

mod capability;
mod confidence;
mod film;
mod matrix;
mod page;
mod sequences;
mod tables;
mod words;

use super::draw::{Figure, FileNames, Theme};
use crate::error::Result;
use crate::evaluation::EvaluationReport;

pub use capability::capability;
pub use confidence::confidence;
pub use film::{Film, FilmTrack};
pub use matrix::matrix;
pub use page::{evaluation_page, evaluation_part};
pub use sequences::sequences;
pub use tables::{evaluation_csv, evaluation_tex, temporal};
pub use words::evaluation_text;

/// All figures of an evaluation, for files; those by sequence where it has the sequences.
///
/// # Errors
/// When a figure cannot be drawn.
pub fn evaluation_figures(report: &EvaluationReport) -> Result<Vec<Figure>> {
    const WIDTH: u32 = 880;
    let theme = &Theme::PRINT;
    let mut figures = vec![
        Figure {
            name: "errors".to_owned(),
            caption: "Tracking error of every keypoint for every object, on a logarithmic scale of colour: the brighter, the \
                      closer. Outlined: the best keypoint of the object; dots: errors up to the threshold."
                .to_owned(),
            svg: matrix(report, &[], theme, WIDTH)?.svg,
        },
        Figure {
            name: "capability".to_owned(),
            caption: "Tracking capability with all thresholds times a common factor; an object joins where the factor reaches \
                      its error divided by its threshold. Dashed: the thresholds as they are."
                .to_owned(),
            svg: capability(report, None, theme, WIDTH)?.svg,
        },
    ];
    if report
        .confidence
        .as_ref()
        .is_some_and(|found| !found.levels.is_empty())
    {
        figures.push(Figure {
            name: "confidence".to_owned(),
            caption: "Tracking capability when keypoints below a confidence count as missing, over that confidence; dashed: the \
                      share of the keypoints that is left."
                .to_owned(),
            svg: confidence(report, theme, WIDTH)?.svg,
        });
    }
    let mut names = FileNames::default();
    for of in report.sequences.iter().flatten() {
        let threshold = report
            .objects
            .iter()
            .find(|object| object.name == of.object);
        let errors: Vec<f64> = of.errors.iter().map(|sequence| sequence.error).collect();
        if let Some(object) = threshold {
            figures.push(Figure {
                name: format!("sequences-{}", names.unique(&of.object)),
                caption: format!(
                    "Error of {} with keypoint {} in each of {} sequences, the worst one first; dashed: the threshold.",
                    of.object,
                    of.keypoint,
                    errors.len()
                ),
                svg: sequences(&errors, object.threshold, None, theme, WIDTH)?.svg,
            });
        }
    }
    Ok(figures)
}
