//! The encoder of a Basic SAE.

use rten_gemm::GemmExecutor;

use super::conv::{Conv, Im2ColOffsets};
use super::pool::{max_pool_affine_relu, pooled};
use super::softargmax::soft_argmax;
use crate::checkpoint::{Checkpoint, SaeConfig};
use crate::data::{Filter, Frame};
use crate::error::{Error, Result};

/// PyTorch's default `eps` of batch norm.
const BATCH_NORM_EPSILON: f32 = 1e-5;

/// An encoder ready to run on the CPU: images in, keypoints out.
pub struct Encoder {
    config: SaeConfig,
    blocks: Vec<Block>,
    aggregation: Conv,
}

/// Convolution (batch norm folded in), ReLU, convolution, max-pool, batch norm, ReLU.
struct Block {
    first: Conv,
    second: Conv,
    scale: Vec<f32>,
    shift: Vec<f32>,
}

/// What one thread needs to run an [`Encoder`]; grows to the largest frame and stays.
#[derive(Default)]
pub struct Workspace {
    gemm: GemmExecutor,
    offsets: Vec<Im2ColOffsets>,
    front: Vec<f32>,
    back: Vec<f32>,
}

/// Where the cells of the last feature map lie in the image.
///
/// The latent coordinates -1 and +1 are the centres of its border cells, which are not the edges of the image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LatentGrid {
    ndc_from_latent: [[f64; 2]; 2],
}

impl LatentGrid {
    /// Places a latent point (x, y) in the image (ndc).
    pub fn to_image(&self, point: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|axis| {
            let [scale, shift] = self.ndc_from_latent[axis];
            scale * point[axis] + shift
        })
    }
}

impl Encoder {
    /// Folds and packs the encoder's weights.
    ///
    /// # Errors
    /// When a tensor is missing or has another shape than its neighbours need.
    pub fn new(checkpoint: &Checkpoint) -> Result<Self> {
        let gemm = GemmExecutor::default();
        let tensor = |name: &str| checkpoint.tensor(name);
        let mut blocks = Vec::new();
        for block in 1..=checkpoint.config.encoder_channels.len() {
            let name = |part: &str| format!("encoder.block{block}.{part}");
            let (scale, shift) = batch_norm(checkpoint, &name("bn1"))?;
            let first = Conv::new(&gemm, tensor(&name("conv1.weight"))?, Some(&scale), Some(shift))?;
            let second = Conv::new(&gemm, tensor(&name("conv2.weight"))?, None, None)?;
            let (scale, shift) = batch_norm(checkpoint, &name("bn2"))?;
            blocks.push(Block {
                first,
                second,
                scale,
                shift,
            });
        }
        let bias = tensor("encoder.aggregate_conv.bias")?.data.clone();
        let aggregation = Conv::new(&gemm, tensor("encoder.aggregate_conv.weight")?, None, Some(bias))?;
        Ok(Self {
            config: checkpoint.config.clone(),
            blocks,
            aggregation,
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
        let size = self
            .config
            .input_size
            .unwrap_or([frame.width() as usize, frame.height() as usize]);
        self.run(
            workspace,
            &frame.to_planar(Some(size), Filter::BilinearAntialias),
            size,
        )
    }

    /// The keypoints of an input of 3 x height x width values in [0, 1] with `size` = `[width, height]`.
    ///
    /// # Errors
    /// When the input is not of that size, or a keypoint is not a finite number.
    pub fn run(&self, workspace: &mut Workspace, input: &[f32], size: [usize; 2]) -> Result<Vec<[f32; 2]>> {
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
        offsets.resize_with(2 * self.blocks.len() + 1, Im2ColOffsets::default);
        let mut size = size;
        front.clear();
        front.extend_from_slice(input);
        for (block, offsets) in self.blocks.iter().zip(offsets.chunks_exact_mut(2)) {
            let channels = block.first.outputs();
            back.resize(channels * size[0] * size[1], 0.0);
            block.first.run(gemm, &mut offsets[0], front, size, back)?;
            back.iter_mut().for_each(|v| *v = v.max(0.0));
            front.resize(channels * size[0] * size[1], 0.0);
            block.second.run(gemm, &mut offsets[1], back, size, front)?;
            let to = pooled(size);
            back.resize(channels * to[0] * to[1], 0.0);
            max_pool_affine_relu(front, size, &block.scale, &block.shift, back);
            std::mem::swap(front, back);
            size = to;
        }
        back.resize(self.keypoints() * size[0] * size[1], 0.0);
        self.aggregation
            .run(gemm, &mut offsets[2 * self.blocks.len()], front, size, back)?;
        let keypoints: Vec<[f32; 2]> = back
            .chunks_exact(size[0] * size[1])
            .map(|map| soft_argmax(map, size[0]))
            .collect();
        match keypoints
            .iter()
            .position(|point| point.iter().any(|v| !v.is_finite()))
        {
            Some(n) => Err(Error::numeric(format!(
                "keypoint {n} is not a finite number; the activations overflow, which weights of a diverged \
                 training do"
            ))),
            None => Ok(keypoints),
        }
    }

    /// Where latent points lie in an image of `[width, height]`.
    pub fn grid(&self, image_size: [u32; 2]) -> LatentGrid {
        let input = self
            .config
            .input_size
            .unwrap_or(image_size.map(|side| side as usize));
        let ndc_from_latent = input.map(|side| {
            // Pooling once puts cell k at pixel 2k - 0.5 of its input; three times at 8k - 3.5.
            let (mut stride, mut first, mut cells) = (1.0, 0.0, side);
            for _ in &self.blocks {
                first -= 0.5 * stride;
                stride *= 2.0;
                cells = cells / 2 + 1;
            }
            let last = first + stride * (cells - 1) as f64;
            let ndc = |pixel: f64| (2.0 * pixel + 1.0) / side as f64 - 1.0;
            [(ndc(last) - ndc(first)) / 2.0, (ndc(last) + ndc(first)) / 2.0]
        });
        LatentGrid { ndc_from_latent }
    }
}

/// Scale and shift per channel of a batch norm in evaluation.
fn batch_norm(checkpoint: &Checkpoint, name: &str) -> Result<(Vec<f32>, Vec<f32>)> {
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
