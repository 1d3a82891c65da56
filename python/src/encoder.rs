//! Keypoints of frames.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::process;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use ndarray::{Array2, Array3};
use numpy::{IntoPyArray, PyArray2, PyArray3, PyArrayDyn, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use rayon::{ThreadPool, ThreadPoolBuilder};
use tracklens::data::{Frame, FramesInMemory};
use tracklens::detector::{OnnxExtractor, Settings};
use tracklens::error::{Error, Result};
use tracklens::event::Cancel;
use tracklens::extract::{CpuExtractor, Extraction, Extractor, extract_frames};
use tracklens::weights::{model_settings, read_checkpoint, read_onnx};

use crate::errors::{exception, input, wrong_type};
use crate::frames::{Batch, as_array};

/// Frames that are copied and extracted at a time: it bounds the memory, and how long Ctrl-C waits.
const BLOCK: usize = 64;

/// See `_tracklens.pyi`.
#[pyclass(frozen, module = "tracklens")]
pub struct Encoder {
    path: PathBuf,
    key: Option<String>,
    settings: Option<String>,
    threads: usize,
    detector: Detector,
    pool: Mutex<Option<Pool>>,
    said_that_it_resizes: AtomicBool,
}

/// What finds the keypoints.
struct Detector {
    extractor: Box<dyn Extractor + Send + Sync>,
    /// The name of its architecture, where it is an SAE.
    architecture: Option<String>,
}

/// Threads, which a process does not get from the one that it was forked from.
struct Pool {
    process: u32,
    threads: Arc<ThreadPool>,
}

impl Detector {
    /// As `tracklens extract --checkpoint` opens it.
    fn open(path: &Path, key: Option<&str>, settings: Option<&str>) -> Result<Self> {
        let place = |e: Error| e.at(path.display());
        let Some(bytes) = read_onnx(path)? else {
            if settings.is_some() {
                return Err(place(Error::mismatch(
                    "`settings` are for ONNX models and say nothing of a checkpoint of tracklens; \
                     leave them out",
                )));
            }
            let encoder = CpuExtractor::new(&read_checkpoint(path, key)?).map_err(place)?;
            return Ok(Self {
                architecture: Some(encoder.config().name()),
                extractor: Box::new(encoder),
            });
        };
        if key.is_some() {
            return Err(place(Error::mismatch(
                "`key` chooses among sets of weights, and an ONNX model has one; leave it out",
            )));
        }
        let given = settings.map_or(Ok(Settings::default()), |json| {
            Settings::from_json(json.as_bytes())
        })?;
        let settings = model_settings(path, given)?;
        let model = OnnxExtractor::new(bytes, &settings).map_err(place)?;
        Ok(Self {
            architecture: model.config().map(|config| config.name()),
            extractor: Box::new(model),
        })
    }
}

#[pymethods]
impl Encoder {
    #[new]
    #[pyo3(signature = (path, *, key=None, threads=None, settings=None))]
    fn new(
        py: Python<'_>,
        path: PathBuf,
        key: Option<String>,
        threads: Option<isize>,
        settings: Option<Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let cores = || std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
        let threads = match threads {
            None => cores(),
            Some(threads) => usize::try_from(threads)
                .ok()
                .filter(|n| *n > 0)
                .ok_or_else(|| {
                    input(format!(
                        "threads is {threads}; expected 1 or more, or None for all cores"
                    ))
                })?,
        };
        let settings: Option<String> = match settings {
            Some(settings) => {
                let json = py.import("json")?.call_method1("dumps", (settings,))?;
                Some(json.extract()?)
            }
            None => None,
        };
        let opened = py.detach(|| Detector::open(&path, key.as_deref(), settings.as_deref()));
        Ok(Self {
            detector: opened.map_err(|e| exception(&e))?,
            // A copy in another process may run in another folder.
            path: std::path::absolute(&path).unwrap_or(path),
            key,
            settings,
            threads,
            pool: Mutex::default(),
            said_that_it_resizes: AtomicBool::new(false),
        })
    }

    /// The keypoints of frames.
    fn __call__<'py>(
        &self,
        py: Python<'py>,
        frames: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let found = self.extract(py, frames)?;
        let shape = (found.len(), self.keypoints(), 2);
        let points = Array3::from_shape_fn(shape, |(t, n, axis)| found[t].points[n][axis]);
        Ok(points.into_pyarray(py))
    }

    /// The keypoints of frames and how sure the detector is of each.
    #[expect(clippy::type_complexity, reason = "a pair of arrays")]
    fn with_confidence<'py>(
        &self,
        py: Python<'py>,
        frames: &Bound<'py, PyAny>,
    ) -> PyResult<(Bound<'py, PyArray3<f32>>, Option<Bound<'py, PyArray2<f32>>>)> {
        let found = self.extract(py, frames)?;
        let (frames, keypoints) = (found.len(), self.keypoints());
        let points = Array3::from_shape_fn((frames, keypoints, 2), |(t, n, axis)| {
            found[t].points[n][axis]
        });
        let confidences: Option<Vec<&Vec<f32>>> =
            found.iter().map(|one| one.confidences.as_ref()).collect();
        let confidences = confidences.filter(|all| !all.is_empty()).map(|all| {
            Array2::from_shape_fn((frames, keypoints), |(t, n)| all[t][n]).into_pyarray(py)
        });
        Ok((points.into_pyarray(py), confidences))
    }

    /// Places keypoints in the image.
    fn to_ndc<'py>(
        &self,
        points: &Bound<'py, PyAny>,
        image_size: [u32; 2],
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let array = as_array(points, "the points")?;
        if array.shape().last() != Some(&2) {
            return Err(input(format!(
                "the points have shape {:?}; expected [..., 2], (x, y)",
                array.shape()
            )));
        }
        if image_size.contains(&0) {
            return Err(input(format!(
                "the image size is {image_size:?}; expected (width, height) in pixels"
            )));
        }
        let array = array.call_method1("astype", ("float64",))?;
        let array = array.cast_into::<PyArrayDyn<f64>>()?;
        let mut points = array.readonly().as_array().to_owned();
        let grid = self.detector.extractor.grid(image_size);
        for mut point in points.rows_mut() {
            let placed = grid.to_image([point[0], point[1]]);
            point[0] = placed[0];
            point[1] = placed[1];
        }
        Ok(points.into_pyarray(array.py()))
    }

    #[getter]
    fn keypoints(&self) -> usize {
        self.detector.extractor.keypoints()
    }

    #[getter]
    fn input_size(&self) -> Option<(usize, usize)> {
        self.detector.extractor.input_size().map(|[w, h]| (w, h))
    }

    #[getter]
    fn architecture(&self) -> Option<&str> {
        self.detector.architecture.as_deref()
    }

    /// `latent` or `ndc`.
    #[getter]
    fn space(&self) -> &'static str {
        match self.detector.architecture {
            Some(_) => "latent",
            None => "ndc",
        }
    }

    #[getter]
    fn threads(&self) -> usize {
        self.threads
    }

    #[getter]
    fn path(&self) -> PathBuf {
        self.path.clone()
    }

    fn __repr__(&self) -> String {
        let what = self.architecture().unwrap_or("an ONNX model");
        let size = match self.input_size() {
            Some((width, height)) => format!("frames resized to {width} x {height}"),
            None => "frames of any size".to_owned(),
        };
        format!(
            "<tracklens.Encoder {}: {what}, {} keypoints, {size}, {} threads>",
            self.path.display(),
            self.keypoints(),
            self.threads
        )
    }

    /// Copies, and those in other processes, open the file again.
    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let open = py.import("tracklens._open")?.getattr("open_encoder")?;
        let arguments = (
            self.path.clone(),
            self.key.as_deref(),
            self.threads,
            self.settings.as_deref(),
        );
        Ok((open, arguments.into_pyobject(py)?))
    }
}

impl Encoder {
    fn extract(&self, py: Python<'_>, frames: &Bound<'_, PyAny>) -> PyResult<Vec<Extraction>> {
        let batch = Batch::parse(frames)?;
        self.say_that_it_resizes(py, batch.image_size())?;
        let pool = self.pool()?;
        let mut found = Vec::with_capacity(batch.len());
        for start in (0..batch.len()).step_by(BLOCK) {
            let block = start..(start + BLOCK).min(batch.len());
            let frames = block
                .map(|i| batch.frame(i))
                .collect::<PyResult<Vec<_>>>()?;
            let extracted = py.detach(|| {
                let found = self.extract_block(&pool, start as u64, frames)?;
                found.into_iter().collect::<Result<Vec<_>>>()
            });
            found.extend(extracted.map_err(|e| exception(&e))?);
            py.check_signals()?;
        }
        Ok(found)
    }

    /// As `tracklens extract` does it with the frames of a folder.
    fn extract_block(
        &self,
        pool: &ThreadPool,
        first: u64,
        frames: Vec<Frame>,
    ) -> Result<Vec<Result<Extraction>>> {
        let all = 0..frames.len();
        let source = FramesInMemory::new(first, frames);
        let extractor = &*self.detector.extractor;
        pool.install(|| extract_frames(extractor, &source, all, &|_| {}, &Cancel::default()))
    }

    /// The threads of this process.
    fn pool(&self) -> PyResult<Arc<ThreadPool>> {
        let mut pool = self.pool.lock().unwrap_or_else(PoisonError::into_inner);
        let process = process::id();
        if let Some(pool) = pool.as_ref().filter(|pool| pool.process == process) {
            return Ok(pool.threads.clone());
        }
        let builder = ThreadPoolBuilder::new().num_threads(self.threads);
        let threads = builder
            .build()
            .map_err(|e| input(format!("{} threads cannot be started: {e}", self.threads)))?;
        let threads = Arc::new(threads);
        let before = pool.replace(Pool {
            process,
            threads: threads.clone(),
        });
        // Its threads are in another process, and waiting for them would have no end.
        std::mem::forget(before);
        Ok(threads)
    }

    /// Says once that frames of this size are resized.
    fn say_that_it_resizes(&self, py: Python<'_>, [width, height]: [usize; 2]) -> PyResult<()> {
        let Some((to_width, to_height)) = self.input_size() else {
            return Ok(());
        };
        if (to_width, to_height) == (width, height)
            || self.said_that_it_resizes.swap(true, Ordering::Relaxed)
        {
            return Ok(());
        }
        let message = format!(
            "the frames have {width} x {height} pixels and are resized to {to_width} x \
             {to_height}, the input size of {}, as in training",
            self.path.display()
        );
        let message = std::ffi::CString::new(message).map_err(|e| wrong_type(e.to_string()))?;
        PyErr::warn(py, &py.get_type::<PyUserWarning>(), &message, 1)
    }
}
