//! The result of scoring.

use ndarray::Array2;
use numpy::{IntoPyArray, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use tracklens::evaluation::EvaluationReport;
use tracklens::report::evaluation::{
    evaluation_csv, evaluation_figures, evaluation_page, evaluation_part, evaluation_tex,
    evaluation_text,
};

use crate::errors::{exception, input, to_python};

/// See `_tracklens.pyi`.
#[pyclass(frozen, module = "tracklens")]
pub struct Evaluation {
    report: EvaluationReport,
    notes: Vec<String>,
}

impl Evaluation {
    pub(crate) fn new(report: EvaluationReport, notes: Vec<String>) -> Self {
        Self { report, notes }
    }
}

#[pymethods]
impl Evaluation {
    #[staticmethod]
    fn from_json(text: &str) -> PyResult<Self> {
        let report = EvaluationReport::parse(text.as_bytes(), "the evaluation");
        report
            .map(|report| Self::new(report, Vec::new()))
            .map_err(|e| exception(&e))
    }

    #[getter]
    fn tc(&self) -> Option<f64> {
        self.report.tc
    }

    #[getter]
    fn frames(&self) -> u64 {
        self.report.frames
    }

    #[getter]
    fn names(&self) -> Vec<String> {
        self.report
            .objects
            .iter()
            .map(|object| object.name.clone())
            .collect()
    }

    #[getter]
    fn objects<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let objects = PyDict::new(py);
        for object in &self.report.objects {
            objects.set_item(&object.name, to_python(py, object)?)?;
        }
        Ok(objects)
    }

    /// K x N; NaN where an object or a keypoint is there in too few frames.
    #[getter]
    fn errors<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let rows = &self.report.errors;
        let shape = (rows.len(), rows.first().map_or(0, Vec::len));
        let errors = Array2::from_shape_fn(shape, |(k, n)| rows[k][n].unwrap_or(f64::NAN));
        errors.into_pyarray(py)
    }

    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.report.warnings.clone()
    }

    #[getter]
    fn findings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &self.report.findings)
    }

    #[getter]
    fn notes(&self) -> Vec<String> {
        self.notes.clone()
    }

    fn to_json(&self) -> PyResult<String> {
        serde_json::to_string_pretty(&self.report)
            .map_err(|e| input(format!("the evaluation cannot be written as JSON: {e}")))
    }

    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &self.report)
    }

    fn to_csv(&self) -> String {
        evaluation_csv(&self.report)
    }

    fn to_latex(&self) -> String {
        evaluation_tex(&self.report)
    }

    fn to_html(&self) -> PyResult<String> {
        evaluation_page(&self.report, None).map_err(|e| exception(&e))
    }

    fn figures<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let figures = PyDict::new(py);
        for figure in evaluation_figures(&self.report).map_err(|e| exception(&e))? {
            figures.set_item(figure.name, figure.svg)?;
        }
        Ok(figures)
    }

    fn _repr_html_(&self) -> PyResult<String> {
        evaluation_part(&self.report).map_err(|e| exception(&e))
    }

    fn __str__(&self) -> String {
        evaluation_text(&self.report)
    }

    fn __repr__(&self) -> String {
        let tc = match self.report.tc {
            Some(tc) => format!("{tc:.3}"),
            None => "unknown".to_owned(),
        };
        let errors = self.report.objects.iter().map(|object| {
            let error = object
                .error
                .map_or_else(|| "–".to_owned(), |e| format!("{e:.4}"));
            format!("{} {error}", object.name)
        });
        let errors: Vec<String> = errors.collect();
        format!(
            "<tracklens.Evaluation: TC {tc}, {} frames; errors: {}>",
            self.report.frames,
            errors.join(", ")
        )
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        let parse = py.get_type::<Self>().getattr("from_json")?;
        Ok((parse, (self.to_json()?,)))
    }
}
