//! The encoder of an SAE.

use rten_simd::SimdOp;

use super::buffer::Buffer;
use super::gemm;
use super::layer::{Layer, PlannedLayer, Sizes};
use super::map::Map;
use super::softargmax::{SoftArgmax, softmax};
#[cfg(feature = "model")]
use crate::checkpoint::ConvLayer;
use crate::checkpoint::{Checkpoint, SaeConfig, TEMPERATURE};
use crate::data::{Filter, Frame, Pixels};
use crate::error::{Error, Result};
use crate::memory;

/// An encoder ready to run on the CPU: images in, keypoints out.
pub struct CpuEncoder {
    config: SaeConfig,
    layers: Vec<Layer>,
    temperature: f32,
}

/// What one thread needs to run an [`CpuEncoder`]; grows to the largest frame and stays.
#[derive(Default)]
pub struct Workspace {
    /// What goes into a layer.
    front: Buffer,
    /// What comes out.
    back: Buffer,
    scratch: Buffer,
}

/// The softmax of one keypoint's last feature map: the weights whose mean position the keypoint is.
#[derive(Debug, Clone, PartialEq)]
pub struct HeatMap {
    /// The number of columns. The centres of the border cells are -1 and +1 of the latent space.
    pub width: usize,
    /// Row by row from the top; their sum is 1.
    pub weights: Vec<f32>,
}

impl CpuEncoder {
    /// Folds and packs the encoder's weights.
    ///
    /// # Errors
    /// When a tensor is missing or has another shape than its neighbours need, when weights are not
    /// finite numbers (names the layer), or when there is no memory for them.
    pub fn new(checkpoint: &Checkpoint) -> Result<Self> {
        let config = checkpoint.config.clone();
        let lanes = gemm::lanes();
        let mut layers: Vec<Layer> = Vec::new();
        check_memory(&config, lanes)?;
        let mut channels = 3;
        for shape in config.encoder_layers() {
            let layer = Layer::new(checkpoint, shape, lanes, channels)?;
            channels = layer.outputs();
            layers.push(layer);
        }
        let temperature = match config.trained_temperature {
            true => *checkpoint
                .tensor(TEMPERATURE)?
                .data
                .first()
                .ok_or_else(|| Error::input(format!("tensor `{TEMPERATURE}` is empty")))?,
            false => config.temperature as f32,
        };
        Ok(Self {
            config,
            layers,
            temperature,
        })
    }

    /// The architecture and sizes.
    pub fn config(&self) -> &SaeConfig {
        &self.config
    }

    /// The number of keypoints N.
    pub fn keypoints(&self) -> usize {
        self.config.keypoints
    }

    /// The N keypoints (x, y) of a frame in the latent space: -1 and +1 are the centres of the
    /// border cells of the last feature map. The frame is resized to the encoder's input size, if
    /// it has one.
    ///
    /// # Errors
    /// As [`CpuEncoder::run`].
    pub fn extract(&self, workspace: &mut Workspace, frame: &Frame) -> Result<Vec<[f32; 2]>> {
        self.with_input(frame, |input, size| self.points(workspace, input, size))
    }

    /// The weights behind keypoint `n` of a frame, which is resized as in [`CpuEncoder::extract`].
    ///
    /// # Errors
    /// When there is no keypoint `n`; as [`CpuEncoder::run`].
    pub fn heat_map(&self, workspace: &mut Workspace, frame: &Frame, n: usize) -> Result<HeatMap> {
        if n >= self.config.keypoints {
            return Err(Error::input(format!(
                "there is no keypoint {n}; expected one below {}",
                self.config.keypoints
            )));
        }
        let map = self.with_input(frame, |input, size| {
            self.maps(workspace, input, size, false)
        })?;
        let channel = workspace.front[n..map.len()].iter().step_by(map.channels);
        let values: Vec<f32> = channel.copied().collect();
        let weights = softmax(&values, self.temperature);
        if weights.iter().any(|weight| !weight.is_finite()) {
            return Err(not_finite(n));
        }
        Ok(HeatMap {
            width: map.size[0],
            weights,
        })
    }

    /// What `run` makes of a frame in the encoder's input size, if it has one.
    fn with_input<T>(
        &self,
        frame: &Frame,
        run: impl FnOnce(Input, [usize; 2]) -> Result<T>,
    ) -> Result<T> {
        let own = [frame.width() as usize, frame.height() as usize];
        match self.config.input_size {
            Some(size) if size != own => {
                let planes = frame.to_planar(Some(size), Filter::BilinearAntialias);
                run(Input::Planes(&planes), size)
            }
            _ => run(Input::Pixels(frame.pixels()), own),
        }
    }

    /// The keypoints of an input of 3 x height x width values in [0, 1] with `size` = `[width,
    /// height]`.
    ///
    /// # Errors
    /// When the input is not of that size or too small, when there is no memory for the
    /// activations, or when a keypoint is not a finite number; names the layer that overflows.
    pub fn run(
        &self,
        workspace: &mut Workspace,
        input: &[f32],
        size: [usize; 2],
    ) -> Result<Vec<[f32; 2]>> {
        if input.len() != 3 * size[0] * size[1] || input.is_empty() {
            return Err(Error::input(format!(
                "an input of {} values for {} x {} pixels; expected 3 values a pixel",
                input.len(),
                size[0],
                size[1]
            )));
        }
        self.points(workspace, Input::Planes(input), size)
    }

    fn points(
        &self,
        workspace: &mut Workspace,
        input: Input,
        size: [usize; 2],
    ) -> Result<Vec<[f32; 2]>> {
        let map = self.maps(workspace, input, size, false)?;
        let mut points = vec![[0.0; 2]; self.keypoints()];
        SoftArgmax {
            input: &workspace.front,
            from: map,
            temperature: self.temperature,
            points: &mut points,
        }
        .dispatch();
        // Rare, and worth a second look for its cause.
        finite(points).or_else(|error| self.maps(workspace, input, size, true).and(Err(error)))
    }

    /// Leaves the last feature map in the front of the workspace; `checked` looks for activations
    /// that overflow.
    fn maps(
        &self,
        workspace: &mut Workspace,
        input: Input,
        size: [usize; 2],
        checked: bool,
    ) -> Result<Map> {
        let Workspace {
            front,
            back,
            scratch,
        } = workspace;
        let mut sizes = Sizes::new(&self.layers[0].shape, size)?;
        let (mut map, len) = self.layers[0].input(&sizes);
        front.grow(len)?;
        input.write(front, map);
        for (i, layer) in self.layers.iter().enumerate() {
            let (next, to, len) = match self.layers.get(i + 1) {
                Some(following) => {
                    let next = Sizes::new(&following.shape, sizes.to)?;
                    let (to, len) = following.input(&next);
                    (next, to, len)
                }
                None => {
                    let to = Map::bare(sizes.to, layer.outputs());
                    (sizes, to, to.len())
                }
            };
            back.grow(len)?;
            scratch.grow(layer.scratch(&sizes))?;
            to.clear_frame(back);
            layer.run(&sizes, front, back, to, scratch);
            if checked && !back[..to.len()].iter().all(|v| v.is_finite()) {
                return Err(Error::numeric(format!(
                    "the activations of `{}` overflow, which weights of a diverged training do",
                    layer.shape.name
                )));
            }
            std::mem::swap(front, back);
            (sizes, map) = (next, to);
        }
        Ok(map)
    }

    /// How the layers compute an input of `[width, height]` on this CPU.
    ///
    /// # Errors
    /// When it is too small.
    pub fn plan(&self, size: [usize; 2]) -> Result<Vec<PlannedLayer>> {
        let mut size = size;
        let plan = self.layers.iter().map(|layer| {
            let sizes = Sizes::new(&layer.shape, size)?;
            size = sizes.to;
            Ok(layer.plan(&sizes))
        });
        plan.collect()
    }
}

/// Checks that an input of `[width, height]` is large enough for every layer of an encoder.
///
/// # Errors
/// Names the layer that it is too small for.
#[cfg(feature = "model")]
pub(crate) fn check_size(config: &SaeConfig, size: [usize; 2]) -> Result<()> {
    let after = |size, layer: &ConvLayer| Ok(Sizes::new(layer, size)?.to);
    config
        .encoder_layers()
        .iter()
        .try_fold(size, after)
        .map(drop)
}

/// Checks that there is memory for all packed weights, before the first of them are.
fn check_memory(config: &SaeConfig, lanes: usize) -> Result<()> {
    let mut channels = 3;
    let layers = config.encoder_layers();
    let numbers = layers.iter().map(|shape| {
        let weights = Layer::weights(shape, lanes, channels);
        channels = shape.outputs.next_multiple_of(lanes);
        weights
    });
    let bytes = numbers.fold(0, u64::saturating_add).saturating_mul(4);
    memory::check(
        bytes,
        "packed weights",
        "use an encoder with fewer channels",
    )
}

/// What goes into the first layer.
#[derive(Clone, Copy)]
enum Input<'a> {
    /// 3 x height x width in [0, 1].
    Planes(&'a [f32]),
    Pixels(&'a Pixels),
}

impl Input<'_> {
    /// Writes it as cells of three channels, framed by zeros.
    fn write(self, to: &mut [f32], map: Map) {
        map.clear_frame(to);
        let [width, height] = map.size;
        for row in 0..height {
            let start = map.at(0, row);
            let cells = &mut to[start..start + 3 * width];
            let pixels = 3 * width * row..3 * width * (row + 1);
            match self {
                Self::Planes(planes) => {
                    let [red, green, blue] =
                        [0, 1, 2].map(|plane| &planes[(plane * height + row) * width..][..width]);
                    for (((cell, r), g), b) in
                        cells.chunks_exact_mut(3).zip(red).zip(green).zip(blue)
                    {
                        cell.copy_from_slice(&[*r, *g, *b]);
                    }
                }
                Self::Pixels(Pixels::Bytes(bytes)) => {
                    for (cell, byte) in cells.iter_mut().zip(&bytes[pixels]) {
                        *cell = f32::from(*byte) / 255.0;
                    }
                }
                Self::Pixels(Pixels::Floats(floats)) => cells.copy_from_slice(&floats[pixels]),
            }
        }
    }
}

/// `keypoints`, if they are finite numbers.
///
/// # Errors
/// Names the first that is not.
pub(crate) fn finite(keypoints: Vec<[f32; 2]>) -> Result<Vec<[f32; 2]>> {
    match keypoints
        .iter()
        .position(|point| point.iter().any(|v| !v.is_finite()))
    {
        Some(n) => Err(not_finite(n)),
        None => Ok(keypoints),
    }
}

fn not_finite(n: usize) -> Error {
    Error::numeric(format!(
        "keypoint {n} is not a finite number; the activations overflow, which weights of a diverged training do"
    ))
}
