//! Evaluations in JavaScript: written and drawn.

use wasm_bindgen::prelude::*;

use super::{JsResult, js_error, to_js};
use crate::error::Error;
use crate::evaluation::EvaluationReport;
use crate::report::draw::Theme;
use crate::report::evaluation::{
    Film, capability, confidence, evaluation_csv, evaluation_page, evaluation_tex, evaluation_text,
    matrix, sequences, temporal,
};

fn evaluation_from_js(evaluation: JsValue) -> JsResult<EvaluationReport> {
    serde_wasm_bindgen::from_value(evaluation)
        .map_err(|e| js_error(&Error::input(format!("the evaluation: {e}"))))
}

/// An evaluation as one HTML file, with a film ([`Film`]) or without.
///
/// # Errors
/// When the evaluation or the film is not understood.
#[wasm_bindgen(js_name = evaluationPage)]
pub fn evaluation_page_of(evaluation: JsValue, film: JsValue) -> JsResult<String> {
    let film: Option<Film> = serde_wasm_bindgen::from_value(film)
        .map_err(|e| js_error(&Error::input(format!("the film: {e}"))))?;
    evaluation_page(&evaluation_from_js(evaluation)?, film.as_ref()).map_err(|e| js_error(&e))
}

/// The measures over time of an evaluation that has them, as a table.
///
/// # Errors
/// When the evaluation is not understood.
#[wasm_bindgen(js_name = temporalTable)]
pub fn temporal_table_of(evaluation: JsValue) -> JsResult<JsValue> {
    let evaluation = evaluation_from_js(evaluation)?;
    let measures = evaluation.temporal.as_ref();
    to_js(&measures.map(|measures| temporal(&evaluation, measures)))
}

/// An evaluation as CSV, one line an object.
///
/// # Errors
/// When the evaluation is not understood.
#[wasm_bindgen(js_name = evaluationCsv)]
pub fn evaluation_csv_of(evaluation: JsValue) -> JsResult<String> {
    Ok(evaluation_csv(&evaluation_from_js(evaluation)?))
}

/// An evaluation as a LaTeX table.
///
/// # Errors
/// When the evaluation is not understood.
#[wasm_bindgen(js_name = evaluationTex)]
pub fn evaluation_tex_of(evaluation: JsValue) -> JsResult<String> {
    Ok(evaluation_tex(&evaluation_from_js(evaluation)?))
}

/// An evaluation in three lines for a paper.
///
/// # Errors
/// When the evaluation is not understood.
#[wasm_bindgen(js_name = evaluationText)]
pub fn evaluation_text_of(evaluation: JsValue) -> JsResult<String> {
    Ok(evaluation_text(&evaluation_from_js(evaluation)?))
}

fn theme_from_js(theme: JsValue) -> JsResult<Theme> {
    if theme.is_undefined() || theme.is_null() {
        return Ok(Theme::PRINT);
    }
    serde_wasm_bindgen::from_value(theme)
        .map_err(|e| js_error(&Error::input(format!("the theme: {e}"))))
}

/// The matrix of errors; see [`matrix`].
///
/// # Errors
/// When an argument is not understood.
#[wasm_bindgen(js_name = matrixFigure)]
pub fn matrix_figure(
    evaluation: JsValue,
    chosen: Vec<i32>,
    theme: JsValue,
    width: u32,
) -> JsResult<JsValue> {
    let chosen: Vec<Option<usize>> = chosen
        .into_iter()
        .map(|n| usize::try_from(n).ok())
        .collect();
    let evaluation = evaluation_from_js(evaluation)?;
    let drawn = matrix(&evaluation, &chosen, &theme_from_js(theme)?, width);
    to_js(&drawn.map_err(|e| js_error(&e))?)
}

/// TC over a common factor of the thresholds; see [`capability`].
///
/// # Errors
/// When an argument is not understood.
#[wasm_bindgen(js_name = capabilityFigure)]
pub fn capability_figure(
    evaluation: JsValue,
    factor: Option<f64>,
    theme: JsValue,
    width: u32,
) -> JsResult<JsValue> {
    let evaluation = evaluation_from_js(evaluation)?;
    let drawn = capability(&evaluation, factor, &theme_from_js(theme)?, width);
    to_js(&drawn.map_err(|e| js_error(&e))?)
}

/// TC over the confidence that keypoints need to count; see [`confidence`].
///
/// # Errors
/// When an argument is not understood, or the evaluation has no confidences.
#[wasm_bindgen(js_name = confidenceFigure)]
pub fn confidence_figure(evaluation: JsValue, theme: JsValue, width: u32) -> JsResult<JsValue> {
    let evaluation = evaluation_from_js(evaluation)?;
    let drawn = confidence(&evaluation, &theme_from_js(theme)?, width);
    to_js(&drawn.map_err(|e| js_error(&e))?)
}

/// Errors by sequence; see [`sequences`].
///
/// # Errors
/// When an argument is not understood.
#[wasm_bindgen(js_name = sequencesFigure)]
pub fn sequences_figure(
    errors: Vec<f64>,
    threshold: f64,
    selected: Option<usize>,
    theme: JsValue,
    width: u32,
) -> JsResult<JsValue> {
    let drawn = sequences(&errors, threshold, selected, &theme_from_js(theme)?, width);
    to_js(&drawn.map_err(|e| js_error(&e))?)
}
