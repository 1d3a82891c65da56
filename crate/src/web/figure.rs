//! Figures in JavaScript.

use plotters_canvas::CanvasBackend;
use wasm_bindgen::prelude::*;
use web_sys::HtmlCanvasElement;

use super::{JsResult, js_error, to_js};
use crate::error::Error;
use crate::report::draw::{self, LineFigure};

fn figure_from_js(figure: JsValue) -> JsResult<LineFigure> {
    serde_wasm_bindgen::from_value(figure)
        .map_err(|e| js_error(&Error::input(format!("the figure: {e}"))))
}

/// Draws a figure over the whole of a canvas and says where its axes are, in canvas pixels.
///
/// # Errors
/// When the figure is not understood or the canvas has no 2D context.
#[wasm_bindgen(js_name = drawLines)]
pub fn draw_lines(canvas: HtmlCanvasElement, figure: JsValue) -> JsResult<JsValue> {
    let figure = figure_from_js(figure)?;
    let backend = CanvasBackend::with_canvas_object(canvas).ok_or_else(|| {
        js_error(&Error::input(
            "the canvas has no 2D context; is it used for WebGL?",
        ))
    })?;
    to_js(&draw::draw_lines(backend, &figure).map_err(|e| js_error(&e))?)
}

/// The same figure as an SVG document.
///
/// # Errors
/// When the figure is not understood.
#[wasm_bindgen(js_name = linesToSvg)]
pub fn lines_to_svg(figure: JsValue, width: u32, height: u32) -> JsResult<String> {
    draw::lines_to_svg(&figure_from_js(figure)?, width, height).map_err(|e| js_error(&e))
}
