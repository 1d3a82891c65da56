//! Keypoints by an ONNX model.

#[cfg(not(target_arch = "wasm32"))]
use std::ops::Range;
#[cfg(not(target_arch = "wasm32"))]
use std::sync::Mutex;
#[cfg(not(target_arch = "wasm32"))]
use std::sync::atomic::{AtomicUsize, Ordering};

use super::plan::{Output, Plan};
use super::runtime::{Session, Threads};
use super::{Graph, Settings};
use crate::checkpoint::{LatentGrid, SaeConfig};
use crate::data::Frame;
#[cfg(not(target_arch = "wasm32"))]
use crate::data::FrameSource;
use crate::error::{Error, Result};
#[cfg(not(target_arch = "wasm32"))]
use crate::event::Cancel;
use crate::extract::{Extraction, Extractor};
use crate::memory;

/// Side of the image that a model of any input size is tried on.
const TRIAL: usize = 256;

/// An [`Extractor`] that runs an ONNX model, on the CPU.
pub struct OnnxExtractor {
    plan: Plan,
    session: Session,
    keypoints: usize,
}

impl OnnxExtractor {
    /// Opens a model with what is known of it beside its graph.
    ///
    /// # Errors
    /// As [`Graph::read`] and [`Plan::new`]; when the runtime refuses the model, or what comes out
    /// has not the shape of keypoints.
    pub fn new(bytes: Vec<u8>, settings: &Settings) -> Result<Self> {
        let graph = Graph::read(&bytes)?;
        let plan = Plan::new(&graph, settings)?;
        memory::check(
            3 * bytes.len() as u64,
            "weights, as they are and packed",
            "close other programs, or use a smaller model",
        )?;
        let session = Session::new(bytes, &plan.input.name, &plan.output.names())?;
        let mut extractor = Self {
            keypoints: plan.keypoints.unwrap_or_default(),
            plan,
            session,
        };
        if extractor.plan.keypoints.is_none() {
            let side = TRIAL as u32;
            let black = Frame::new(side, side, vec![0; TRIAL * TRIAL * 3])?;
            extractor.keypoints = extractor.run(&black, None)?.points.len();
        }
        Ok(extractor)
    }

    /// How the model is run.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The configuration of an encoder that was exported here; other points are in ndc.
    pub fn config(&self) -> Option<&SaeConfig> {
        match &self.plan.output {
            Output::Latent(config) => Some(config),
            _ => None,
        }
    }

    fn run(&self, frame: &Frame, threads: Option<&Threads>) -> Result<Extraction> {
        let input = &self.plan.input;
        let (values, size) = input.values(frame);
        let shape = input.shape(size);
        let outputs = self.session.run(values, shape, input.element, threads)?;
        let found = self.plan.output.keypoints(&outputs, input.layout, size)?;
        if self.keypoints != 0 && found.len() != self.keypoints {
            return Err(Error::mismatch(format!(
                "the model gave {} keypoints; expected {} as it says",
                found.len(),
                self.keypoints
            )));
        }
        let confidences: Vec<f32> = found
            .iter()
            .filter_map(|found| Some(found.confidence? as f32))
            .collect();
        Ok(Extraction {
            points: found
                .iter()
                .map(|found| found.point.map(|v| v as f32))
                .collect(),
            confidences: Some(confidences).filter(|all| !all.is_empty()),
            image_size: [frame.width(), frame.height()],
        })
    }
}

impl Extractor for OnnxExtractor {
    fn keypoints(&self) -> usize {
        self.keypoints
    }

    fn input_size(&self) -> Option<[usize; 2]> {
        self.plan.input.size
    }

    fn grid(&self, image_size: [u32; 2]) -> LatentGrid {
        match self.config() {
            Some(config) => config.latent_grid(image_size),
            None => LatentGrid::of_image(),
        }
    }

    fn extract_frame(&self, frame: &Frame) -> Result<Extraction> {
        self.run(frame, None)
    }

    /// Every thread runs the model on a frame of its own. They are not rayon's: the runtime waits for
    /// threads of its own, and one of rayon's would begin another frame meanwhile.
    #[cfg(not(target_arch = "wasm32"))]
    fn extract_range(
        &self,
        source: &dyn FrameSource,
        range: Range<usize>,
        progress: &(dyn Fn(u64) + Sync),
        cancel: &Cancel,
    ) -> Result<Vec<Result<Extraction>>> {
        let next = AtomicUsize::new(range.start);
        let found: Mutex<Vec<(usize, Result<Extraction>)>> = Mutex::default();
        let work = || {
            let own = super::runtime::threads(1);
            loop {
                let i = next.fetch_add(1, Ordering::Relaxed);
                if i >= range.end || cancel.check().is_err() {
                    return;
                }
                let one = source.read(i).and_then(|frame| {
                    let one = self.run(&frame, Some(&own));
                    one.map_err(|e| e.at(&source.index().keys()[i]))
                });
                let mut found = found
                    .lock()
                    .unwrap_or_else(std::sync::PoisonError::into_inner);
                found.push((i, one));
                progress(found.len() as u64);
            }
        };
        std::thread::scope(|scope| {
            for _ in 0..rayon::current_num_threads().min(range.len()) {
                scope.spawn(work);
            }
        });
        cancel.check()?;
        let mut found = found
            .into_inner()
            .unwrap_or_else(std::sync::PoisonError::into_inner);
        found.sort_by_key(|(i, _)| *i);
        Ok(found.into_iter().map(|(_, one)| one).collect())
    }
}
