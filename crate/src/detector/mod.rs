//! Keypoint detectors of any origin, as ONNX models.
//!
//! A model is read twice: [`Graph`] is what its file says about inputs, outputs and operators, and
//! refuses what cannot run; [`OnnxExtractor`] runs it with `rten`. Between the two stands a
//! [`Plan`]: how a frame becomes the input, and how the outputs become keypoints. What the graph
//! does not say comes from [`Settings`], which lie in its metadata under `tracklens.detector`, in a
//! file `model.onnx.json` beside it, or come from the user.
//!
//! Keypoints come out in ndc; those of an encoder that `tracklens export` wrote in the latent space,
//! as its checkpoint gives them.

mod decode;
mod extractor;
mod graph;
mod operators;
mod plan;
mod proto;
mod runtime;
mod settings;

pub use extractor::OnnxExtractor;
pub use graph::{Element, Graph, Port};
pub use plan::Plan;
pub use settings::{
    Channels, Columns, Decoding, InputSize, Layout, Normalization, OutputKind, SETTINGS_ENDING,
    Settings, Unit,
};
