//! A layer of an encoder: its convolution with what follows it, and the kernel that computes them.

#[cfg(test)]
mod tests;

use rten_simd::SimdOp;

use super::buffer::Buffer;
use super::direct::{Direct, slack};
use super::epilogue::Epilogue;
use super::gemm::Panels;
use super::map::Map;
use super::pool::MaxPool;
use super::rows::{self, Rows};
use super::winograd::{Tiling, Winograd};
use crate::checkpoint::{BATCH_NORM_EPSILON, Checkpoint, ConvLayer, Tensor};
use crate::error::{Error, Result};

/// A convolution and what follows it, with its weights packed.
pub(super) struct Layer {
    pub shape: ConvLayer,
    lanes: usize,
    /// Values of a cell that comes in and of one that goes out.
    channels: [usize; 2],
    kernel: Kernel,
    /// The scale of the batch norm after a pool; otherwise the weights include it.
    scale: Option<Vec<f32>>,
    bias: Vec<f32>,
    /// In place of the bias that comes after a pool.
    zeros: Vec<f32>,
    floor: f32,
}

/// How a convolution is computed.
enum Kernel {
    Direct(Panels),
    Rows(Vec<Panels>),
    Winograd(Tiling, Vec<Panels>),
}

/// The [`Kernel`] of a layer, which its shape decides.
enum Method {
    Direct,
    Rows,
    Winograd(Tiling),
}

impl Method {
    /// Tiles where they are worth their transforms, as a channel that is transformed serves enough
    /// sums. No encoder pools what it takes in strides, so there are no such tiles.
    fn of(shape: &ConvLayer, lanes: usize, channels: usize) -> Self {
        let worth = channels.is_multiple_of(lanes) && shape.inputs.min(shape.outputs) >= 16;
        let strided_pool = shape.pool && shape.stride > 1;
        match Tiling::new(shape.kernel, shape.stride) {
            Some(tiling) if worth && !strided_pool => Self::Winograd(tiling),
            _ if shape.kernel == rows::KERNEL && shape.stride == 1 && !shape.pool => Self::Rows,
            _ => Self::Direct,
        }
    }
}

/// How a layer is computed, see [`CpuEncoder::plan`](super::CpuEncoder::plan).
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct PlannedLayer {
    /// The name of the convolution in the state dict.
    pub name: String,
    /// The kernel, e.g. `Winograd F(4x4, 3x3)`, with what is computed on the way.
    pub kernel: String,
    /// Width and height of what goes out.
    pub size: [usize; 2],
    /// Multiplications by the definition of the convolution.
    pub defined: u64,
    /// Multiplications that the kernel does, without those of transforms.
    pub done: u64,
}

/// Width and height of what comes into a layer, of what its convolution gives, and of what goes
/// out.
#[derive(Clone, Copy)]
pub(super) struct Sizes {
    pub from: [usize; 2],
    pub convolved: [usize; 2],
    pub to: [usize; 2],
}

impl Sizes {
    /// What a layer makes of an input of `from`.
    ///
    /// # Errors
    /// When it is too small.
    pub fn new(layer: &ConvLayer, from: [usize; 2]) -> Result<Self> {
        let sides = from.map(|side| layer.convolved_side(side).zip(layer.output_side(side)));
        match sides {
            [Some((width, to_width)), Some((height, to_height))] => Ok(Self {
                from,
                convolved: [width, height],
                to: [to_width, to_height],
            }),
            _ => Err(Error::input(format!(
                "the frame is too small for this encoder: `{}` gets {} x {} cells for a kernel of {} x {}",
                layer.name, from[0], from[1], layer.kernel, layer.kernel
            ))),
        }
    }
}

impl Layer {
    /// Folds the batch norm into the weights and packs them. `channels` are the values of a cell
    /// that comes in, `lanes` those of a vector.
    ///
    /// # Errors
    /// When a tensor is missing or a folded weight is not finite.
    pub fn new(
        checkpoint: &Checkpoint,
        shape: ConvLayer,
        lanes: usize,
        channels: usize,
    ) -> Result<Self> {
        let weight = checkpoint.tensor(&format!("{}.weight", shape.name))?;
        let norm = shape
            .norm
            .as_ref()
            .map(|name| batch_norm(checkpoint, name))
            .transpose()?;
        let outputs = shape.outputs.next_multiple_of(lanes);
        let padded = |mut values: Vec<f32>| {
            values.resize(outputs, 0.0);
            values
        };
        let (factors, scale, bias) = match norm {
            None => {
                let bias = &checkpoint.tensor(&format!("{}.bias", shape.name))?.data;
                (None, None, bias.clone())
            }
            Some((scale, bias)) if shape.pool => (None, Some(scale), bias),
            Some((scale, bias)) => (Some(scale), None, bias),
        };
        let (scale, bias) = (scale.map(padded), padded(bias));
        let weights = Weights {
            tensor: weight,
            factors: factors.as_deref(),
        };
        weights.check(&shape, &bias)?;
        let at = |output, input, ky, kx| weights.at(output, input, ky, kx);
        let kernel = match Method::of(&shape, lanes, channels) {
            Method::Winograd(tiling) => {
                let mut panels = Vec::with_capacity(tiling.places());
                for row in 0..tiling.side {
                    panels.extend(tiling.transform_filters(row, lanes, [outputs, channels], at)?);
                }
                Kernel::Winograd(tiling, panels)
            }
            Method::Rows => Kernel::Rows(rows::transform_filters(lanes, [outputs, channels], at)?),
            Method::Direct => {
                let run = shape.kernel * channels;
                Kernel::Direct(Panels::new(
                    lanes,
                    shape.kernel * run,
                    outputs,
                    |step, output| at(output, step % channels, step / run, step % run / channels),
                )?)
            }
        };
        Ok(Self {
            lanes,
            channels: [channels, outputs],
            kernel,
            scale,
            bias,
            zeros: vec![0.0; outputs],
            floor: if shape.norm.is_some() {
                0.0
            } else {
                f32::NEG_INFINITY
            },
            shape,
        })
    }

    /// Values of a layer's packed weights, before anything is made for them.
    pub fn weights(shape: &ConvLayer, lanes: usize, channels: usize) -> u64 {
        let places = match Method::of(shape, lanes, channels) {
            Method::Winograd(tiling) => tiling.places(),
            Method::Rows => rows::PLACES * shape.kernel,
            Method::Direct => shape.kernel * shape.kernel,
        };
        let outputs = shape.outputs.next_multiple_of(lanes);
        [places, channels, outputs]
            .into_iter()
            .fold(1, |product: u64, n| product.saturating_mul(n as u64))
    }

    /// Values of a cell that goes out.
    pub fn outputs(&self) -> usize {
        self.channels[1]
    }

    /// How the input has to lie in memory, and the values of the buffer that holds it.
    pub fn input(&self, sizes: &Sizes) -> (Map, usize) {
        let ConvLayer {
            padding,
            stride,
            pool,
            ..
        } = self.shape;
        let [channels, _] = self.channels;
        let (before, after) = match &self.kernel {
            Kernel::Winograd(tiling, _) => tiling.frame(padding, pool, sizes.from, sizes.convolved),
            Kernel::Rows(_) => (padding, rows::behind(padding, sizes.from, sizes.convolved)),
            Kernel::Direct(_) => (padding, [padding; 2]),
        };
        let map = Map {
            size: sizes.from,
            channels,
            before,
            after,
        };
        let behind = match self.kernel {
            Kernel::Winograd(..) => 0,
            Kernel::Rows(_) => rows::slack(self.lanes),
            Kernel::Direct(_) => slack(self.lanes, stride, channels),
        };
        (map, map.len() + behind)
    }

    /// Values that the layer needs besides input and output.
    pub fn scratch(&self, sizes: &Sizes) -> usize {
        let [channels, outputs] = self.channels;
        match &self.kernel {
            Kernel::Winograd(tiling, _) => {
                tiling
                    .scratch(self.lanes, channels, self.tiles(tiling, sizes))
                    .1
            }
            Kernel::Rows(_) => rows::scratch(self.lanes, channels, sizes.convolved),
            Kernel::Direct(_) if self.shape.pool => Map::bare(sizes.convolved, outputs).len(),
            Kernel::Direct(_) => 0,
        }
    }

    /// Tiles of a convolution by Winograd's algorithm.
    fn tiles(&self, tiling: &Tiling, sizes: &Sizes) -> usize {
        tiling
            .tiles(self.shape.pool, sizes.convolved)
            .into_iter()
            .product()
    }

    /// How `sizes` are computed.
    pub fn plan(&self, sizes: &Sizes) -> PlannedLayer {
        let ConvLayer {
            kernel,
            stride,
            inputs,
            outputs,
            ..
        } = self.shape;
        let count = |numbers: &[usize]| numbers.iter().map(|n| *n as u64).product();
        let [width, height] = sizes.convolved;
        let [channels, padded] = self.channels;
        let (mut by, done) = match &self.kernel {
            Kernel::Winograd(tiling, _) => {
                let cells = tiling.outputs;
                let by = format!("Winograd F({cells}x{cells}, {kernel}x{kernel})");
                let by = match stride {
                    1 => by,
                    _ => format!("{by}, stride {stride}"),
                };
                (
                    by,
                    count(&[self.tiles(tiling, sizes), tiling.places(), channels, padded]),
                )
            }
            Kernel::Rows(_) => (
                format!("Winograd F({}, {kernel}) along rows", rows::OUTPUTS),
                count(&[
                    rows::tiles(width),
                    height,
                    rows::PLACES * kernel,
                    channels,
                    padded,
                ]),
            ),
            Kernel::Direct(_) => (
                format!("direct {kernel}x{kernel}, stride {stride}"),
                count(&[width, height, channels, padded, kernel, kernel]),
            ),
        };
        if self.shape.pool {
            by.push_str(" + pool");
        }
        if self.shape.norm.is_some() {
            by.push_str(" + ReLU");
        }
        PlannedLayer {
            name: self.shape.name.clone(),
            kernel: by,
            size: sizes.to,
            defined: count(&[width, height, inputs, outputs, kernel, kernel]),
            done,
        }
    }

    /// Computes the inner cells of `output`, which lies as `to` says, of an `input` that lies as
    /// [`input`](Self::input) has it.
    pub fn run(
        &self,
        sizes: &Sizes,
        input: &[f32],
        output: &mut Buffer,
        to: Map,
        scratch: &mut Buffer,
    ) {
        let from = self.input(sizes).0;
        let epilogue = Epilogue {
            scale: self.scale.as_deref(),
            bias: &self.bias,
            floor: self.floor,
        };
        let direct = |panels, bias, floor, output, to| Direct {
            panels,
            bias,
            floor,
            kernel: self.shape.kernel,
            stride: self.shape.stride,
            input,
            from,
            output,
            to,
        };
        match &self.kernel {
            Kernel::Winograd(tiling, panels) => Winograd {
                panels,
                tiling: *tiling,
                convolved: sizes.convolved,
                epilogue,
                input,
                from,
                output,
                to,
                scratch,
            }
            .dispatch(),
            Kernel::Rows(panels) => Rows {
                panels,
                bias: &self.bias,
                floor: self.floor,
                input,
                from,
                output,
                to,
                scratch,
            }
            .dispatch(),
            Kernel::Direct(panels) if self.shape.pool => {
                let between = Map::bare(sizes.convolved, self.outputs());
                direct(
                    panels,
                    &self.zeros,
                    f32::NEG_INFINITY,
                    &mut scratch[..],
                    between,
                )
                .dispatch();
                MaxPool {
                    epilogue,
                    input: scratch,
                    from: between,
                    output,
                    to,
                }
                .dispatch();
            }
            Kernel::Direct(panels) => {
                direct(panels, &self.bias, self.floor, &mut output[..], to).dispatch();
            }
        }
    }
}

/// A filter bank with the batch norm's scale of every output.
struct Weights<'a> {
    tensor: &'a Tensor,
    factors: Option<&'a [f32]>,
}

impl Weights<'_> {
    /// A tap; 0 for outputs and inputs that only fill up the vectors.
    fn at(&self, output: usize, input: usize, ky: usize, kx: usize) -> f32 {
        let [outputs, inputs, height, width] = self.tensor.shape[..] else {
            return 0.0;
        };
        if output >= outputs || input >= inputs {
            return 0.0;
        }
        let tap = self.tensor.data[((output * inputs + input) * height + ky) * width + kx];
        self.factors.map_or(tap, |factors| tap * factors[output])
    }

    /// # Errors
    /// Names the layer when its weights have another shape, or they or its `bias` are not finite.
    fn check(&self, layer: &ConvLayer, bias: &[f32]) -> Result<()> {
        let expected = [layer.outputs, layer.inputs, layer.kernel, layer.kernel];
        if self.tensor.shape != expected {
            return Err(Error::input(format!(
                "the weights of `{}` have shape {:?}; expected {expected:?}",
                layer.name, self.tensor.shape
            )));
        }
        let filter = layer.inputs * layer.kernel * layer.kernel;
        let finite = self
            .tensor
            .data
            .chunks_exact(filter)
            .enumerate()
            .all(|(output, filter)| {
                let factor = self.factors.map_or(1.0, |factors| factors[output]);
                filter.iter().all(|tap| (tap * factor).is_finite())
            });
        if finite && bias.iter().all(|v| v.is_finite()) {
            return Ok(());
        }
        Err(Error::numeric(format!(
            "the weights of `{}` are not finite numbers{}; the file is damaged or the training diverged",
            layer.name,
            layer
                .norm
                .as_ref()
                .map(|norm| format!(", once the batch norm `{norm}` is folded into them"))
                .unwrap_or_default()
        )))
    }
}

/// Scale and shift per channel of a batch norm in evaluation.
pub(super) fn batch_norm(checkpoint: &Checkpoint, name: &str) -> Result<(Vec<f32>, Vec<f32>)> {
    let part = |part: &str| {
        checkpoint
            .tensor(&format!("{name}.{part}"))
            .map(|t| &t.data)
    };
    let (weight, bias) = (part("weight")?, part("bias")?);
    let (mean, variance) = (part("running_mean")?, part("running_var")?);
    let scale: Vec<f32> = weight
        .iter()
        .zip(variance)
        .map(|(w, v)| w / (v + BATCH_NORM_EPSILON as f32).sqrt())
        .collect();
    let shift = bias
        .iter()
        .zip(mean)
        .zip(&scale)
        .map(|((b, m), s)| b - m * s)
        .collect();
    Ok((scale, shift))
}
