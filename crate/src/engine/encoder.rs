//! The encoder of an SAE.

use rten_gemm::GemmExecutor;

use super::conv::{Conv, Im2ColOffsets};
use super::pool::max_pool_affine_relu;
use super::softargmax::{soft_argmax, softmax};
use crate::checkpoint::{Checkpoint, ConvLayer, LatentGrid, SaeConfig, TEMPERATURE};
use crate::data::{Filter, Frame};
use crate::error::{Error, Result};

/// PyTorch's default `eps` of batch norm.
const BATCH_NORM_EPSILON: f32 = 1e-5;

/// An encoder ready to run on the CPU: images in, keypoints out.
pub struct Encoder {
    config: SaeConfig,
    layers: Vec<Layer>,
    temperature: f32,
}

/// A convolution and what follows it.
struct Layer {
    shape: ConvLayer,
    /// With the batch norm folded in, unless a pool lies between the two.
    conv: Conv,
    /// Scale and shift of the batch norm after a pool.
    after_pool: Option<(Vec<f32>, Vec<f32>)>,
}

/// What one thread needs to run an [`Encoder`]; grows to the largest frame and stays.
#[derive(Default)]
pub struct Workspace {
    gemm: GemmExecutor,
    offsets: Vec<Im2ColOffsets>,
    front: Vec<f32>,
    back: Vec<f32>,
}

/// The softmax of one keypoint's last feature map: the weights whose mean position the keypoint is.
#[derive(Debug, Clone, PartialEq)]
pub struct HeatMap {
    /// The number of columns. The centres of the border cells are -1 and +1 of the latent space.
    pub width: usize,
    /// Row by row from the top; their sum is 1.
    pub weights: Vec<f32>,
}

impl Encoder {
    /// Folds and packs the encoder's weights.
    ///
    /// # Errors
    /// When a tensor is missing or has another shape than its neighbours need.
    pub fn new(checkpoint: &Checkpoint) -> Result<Self> {
        let gemm = GemmExecutor::default();
        let config = checkpoint.config.clone();
        let layers = config
            .encoder_layers()
            .into_iter()
            .map(|layer| Layer::new(&gemm, checkpoint, layer))
            .collect::<Result<_>>()?;
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

    /// The N keypoints (x, y) of a frame in the latent space: -1 and +1 are the centres of the border cells of
    /// the last feature map. The frame is resized to the encoder's input size, if it has one.
    ///
    /// # Errors
    /// As [`Encoder::run`].
    pub fn extract(&self, workspace: &mut Workspace, frame: &Frame) -> Result<Vec<[f32; 2]>> {
        let (input, size) = self.input(frame);
        self.run(workspace, &input, size)
    }

    /// The weights behind keypoint `n` of a frame, which is resized as in [`Encoder::extract`].
    ///
    /// # Errors
    /// When there is no keypoint `n`; as [`Encoder::run`].
    pub fn heat_map(&self, workspace: &mut Workspace, frame: &Frame, n: usize) -> Result<HeatMap> {
        if n >= self.config.keypoints {
            return Err(Error::input(format!(
                "there is no keypoint {n}; expected one below {}",
                self.config.keypoints
            )));
        }
        let (input, size) = self.input(frame);
        let [width, height] = self.features(workspace, &input, size)?;
        let map = &workspace.front[n * width * height..][..width * height];
        let weights = softmax(map, self.temperature);
        if weights.iter().any(|weight| !weight.is_finite()) {
            return Err(not_finite(n));
        }
        Ok(HeatMap { width, weights })
    }

    /// The planar input of a frame and its `[width, height]`.
    fn input(&self, frame: &Frame) -> (Vec<f32>, [usize; 2]) {
        let size = self
            .config
            .input_size
            .unwrap_or([frame.width() as usize, frame.height() as usize]);
        (frame.to_planar(Some(size), Filter::BilinearAntialias), size)
    }

    /// The keypoints of an input of 3 x height x width values in [0, 1] with `size` = `[width, height]`.
    ///
    /// # Errors
    /// When the input is not of that size, or a keypoint is not a finite number.
    pub fn run(&self, workspace: &mut Workspace, input: &[f32], size: [usize; 2]) -> Result<Vec<[f32; 2]>> {
        let [width, height] = self.features(workspace, input, size)?;
        finite(
            workspace
                .front
                .chunks_exact(width * height)
                .map(|map| soft_argmax(map, width, self.temperature))
                .collect(),
        )
    }

    /// Leaves the N feature maps of an input in `front` of the workspace and returns their `[width, height]`.
    fn features(&self, workspace: &mut Workspace, input: &[f32], size: [usize; 2]) -> Result<[usize; 2]> {
        if input.len() != 3 * size[0] * size[1] || input.is_empty() {
            return Err(Error::input(format!(
                "an input of {} values for {} x {} pixels; expected 3 values a pixel",
                input.len(),
                size[0],
                size[1]
            )));
        }
        let Workspace {
            gemm,
            offsets,
            front,
            back,
        } = workspace;
        offsets.resize_with(self.layers.len(), Im2ColOffsets::default);
        let mut size = size;
        front.clear();
        front.extend_from_slice(input);
        for (layer, offsets) in self.layers.iter().zip(offsets) {
            size = layer.run(gemm, offsets, front, back, size)?;
        }
        Ok(size)
    }

    /// Checks that an input of `[width, height]` is large enough for every layer.
    ///
    /// # Errors
    /// Names the layer that it is too small for.
    pub fn check_size(&self, size: [usize; 2]) -> Result<()> {
        let after = |size, layer: &Layer| Ok(sides(&layer.shape, size)?.map(|(_, to)| to));
        self.layers.iter().try_fold(size, after).map(drop)
    }

    /// Where latent points lie in an image of `[width, height]`.
    pub fn grid(&self, image_size: [u32; 2]) -> LatentGrid {
        self.config.latent_grid(image_size)
    }
}

impl Layer {
    fn new(gemm: &GemmExecutor, checkpoint: &Checkpoint, shape: ConvLayer) -> Result<Self> {
        let weight = checkpoint.tensor(&format!("{}.weight", shape.name))?;
        let norm = shape
            .norm
            .as_ref()
            .map(|name| batch_norm(checkpoint, name))
            .transpose()?;
        let (conv, after_pool) = match norm {
            None => {
                let bias = checkpoint.tensor(&format!("{}.bias", shape.name))?.data.clone();
                (Conv::new(gemm, &shape, weight, None, Some(bias))?, None)
            }
            Some(norm) if shape.pool => (Conv::new(gemm, &shape, weight, None, None)?, Some(norm)),
            Some((scale, shift)) => (Conv::new(gemm, &shape, weight, Some(&scale), Some(shift))?, None),
        };
        Ok(Self {
            shape,
            conv,
            after_pool,
        })
    }

    /// Takes `front`, of `size`, and leaves the result there; returns its size.
    fn run(
        &self,
        gemm: &GemmExecutor,
        offsets: &mut Im2ColOffsets,
        front: &mut Vec<f32>,
        back: &mut Vec<f32>,
        size: [usize; 2],
    ) -> Result<[usize; 2]> {
        let [(width, to_width), (height, to_height)] = sides(&self.shape, size)?;
        let channels = self.conv.outputs();
        back.resize(channels * width * height, 0.0);
        self.conv.run(gemm, offsets, front, size, back, [width, height])?;
        if let Some((scale, shift)) = &self.after_pool {
            front.resize(channels * to_width * to_height, 0.0);
            max_pool_affine_relu(back, [width, height], scale, shift, front);
        } else {
            if self.shape.norm.is_some() {
                back.iter_mut().for_each(|v| *v = v.max(0.0));
            }
            std::mem::swap(front, back);
        }
        Ok([to_width, to_height])
    }
}

/// Width and height of what the convolution of a layer makes of an input of `size`, each with that of the whole layer.
fn sides(layer: &ConvLayer, size: [usize; 2]) -> Result<[(usize, usize); 2]> {
    match size.map(|side| layer.convolved_side(side).zip(layer.output_side(side))) {
        [Some(width), Some(height)] => Ok([width, height]),
        _ => Err(Error::input(format!(
            "the frame is too small for this encoder: `{}` gets {} x {} cells for a kernel of {} x {}",
            layer.name, size[0], size[1], layer.kernel, layer.kernel
        ))),
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

/// Scale and shift per channel of a batch norm in evaluation.
pub(super) fn batch_norm(checkpoint: &Checkpoint, name: &str) -> Result<(Vec<f32>, Vec<f32>)> {
    let part = |part: &str| checkpoint.tensor(&format!("{name}.{part}")).map(|t| &t.data);
    let (weight, bias) = (part("weight")?, part("bias")?);
    let (mean, variance) = (part("running_mean")?, part("running_var")?);
    let scale: Vec<f32> = weight
        .iter()
        .zip(variance)
        .map(|(w, v)| w / (v + BATCH_NORM_EPSILON).sqrt())
        .collect();
    let shift = bias
        .iter()
        .zip(mean)
        .zip(&scale)
        .map(|((b, m), s)| b - m * s)
        .collect();
    Ok((scale, shift))
}
