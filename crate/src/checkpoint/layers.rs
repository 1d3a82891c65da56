//! The layers of an SAE: what [`SaeConfig`] stands for, written down once for everything that runs
//! or stores it.

use super::{Family, SaeConfig};

/// A convolution with what comes before and after it.
///
/// In this order: upsampling, convolution with zero padding, pooling, batch norm with ReLU (else a
/// bias and no ReLU).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ConvLayer {
    /// Name of the convolution in the state dict, e.g. `encoder.block1.conv1`.
    pub name: String,
    /// Name of the batch norm, e.g. `encoder.block1.bn1`, after which comes a ReLU. A convolution
    /// without one has a bias.
    pub norm: Option<String>,
    /// Input channels.
    pub inputs: usize,
    /// Output channels.
    pub outputs: usize,
    /// Side of the square kernel.
    pub kernel: usize,
    /// Step of the kernel along both axes.
    pub stride: usize,
    /// Zeros on every side of the input.
    pub padding: usize,
    /// Whether the input is made twice as large by bilinear interpolation (corners not aligned).
    pub upsample: bool,
    /// Whether the result goes through a 2 x 2 max-pool with stride 2 and a border that never wins,
    /// one cell wide: H / 2 + 1 rows out of H.
    pub pool: bool,
}

impl ConvLayer {
    /// Convolution, batch norm, ReLU; the size is kept.
    fn block(module: &str, index: usize, inputs: usize, outputs: usize, kernel: usize) -> Self {
        Self {
            name: format!("{module}conv{index}"),
            norm: Some(format!("{module}bn{index}")),
            inputs,
            outputs,
            kernel,
            stride: 1,
            padding: kernel / 2,
            upsample: false,
            pool: false,
        }
    }

    /// A 1 x 1 convolution with a bias.
    fn aggregation(module: &str, inputs: usize, outputs: usize) -> Self {
        Self {
            name: format!("{module}aggregate_conv"),
            norm: None,
            ..Self::block(module, 1, inputs, outputs, 1)
        }
    }

    /// Whether it follows another convolution in its block, as in KeyNet.
    pub fn is_second_in_block(&self) -> bool {
        self.name.contains(".block") && self.name.ends_with(".conv2")
    }

    /// The side of what the convolution makes of an input with this side, before a pool; `None`
    /// when the kernel does not fit.
    pub fn convolved_side(&self, side: usize) -> Option<usize> {
        let side = if self.upsample { 2 * side } else { side };
        let room = (side + 2 * self.padding).checked_sub(self.kernel)?;
        Some(room / self.stride + 1)
    }

    /// The side of what the layer makes of an input with this side; `None` when the kernel does not
    /// fit.
    pub fn output_side(&self, side: usize) -> Option<usize> {
        let side = self.convolved_side(side)?;
        Some(if self.pool { side / 2 + 1 } else { side })
    }
}

/// The name of the temperature that a DSAE trains.
pub const TEMPERATURE: &str = "encoder.spatial_softargmax.spatial_softmax.temperature";
/// The name of the standard deviation that `-std` trains.
pub const SIGMA: &str = "decoder.gaussian_sampling.std";
/// The name of the bias image of `-bg`.
pub const BACKGROUND: &str = "decoder.background_bias.bias";
/// The name of the decoder of a DSAE.
pub const DENSE: &str = "decoder.dense";

impl SaeConfig {
    /// The convolutions of the encoder, from an RGB image to N feature maps.
    pub fn encoder_layers(&self) -> Vec<ConvLayer> {
        let (channels, kernels) = (&self.encoder_channels, &self.encoder_kernels);
        let mut layers = Vec::new();
        let mut inputs = 3;
        match self.architecture.family {
            Family::Basic => {
                for (i, (&outputs, &kernel)) in channels.iter().zip(kernels).enumerate() {
                    let module = format!("encoder.block{}.", i + 1);
                    layers.push(ConvLayer::block(&module, 1, inputs, outputs, kernel));
                    layers.push(ConvLayer {
                        pool: true,
                        ..ConvLayer::block(&module, 2, outputs, outputs, kernel)
                    });
                    inputs = outputs;
                }
            }
            Family::Dsae => {
                let outputs = channels.iter().copied().chain([self.keypoints]);
                for (i, (outputs, &kernel)) in outputs.zip(kernels).enumerate() {
                    layers.push(ConvLayer {
                        stride: if i == 0 { 2 } else { 1 },
                        padding: 0,
                        ..ConvLayer::block("encoder.", i + 1, inputs, outputs, kernel)
                    });
                    inputs = outputs;
                }
                return layers;
            }
            Family::KeyNet => {
                for (i, &outputs) in channels.iter().enumerate() {
                    let module = format!("encoder.block{}.", i + 1);
                    let first = i == 0;
                    let paper = if first { 1 } else { 2 };
                    layers.push(ConvLayer {
                        stride: self.encoder_strides.get(i).copied().unwrap_or(paper),
                        ..ConvLayer::block(
                            &module,
                            1,
                            inputs,
                            outputs,
                            kernels[usize::from(!first)],
                        )
                    });
                    layers.push(ConvLayer::block(&module, 2, outputs, outputs, kernels[1]));
                    inputs = outputs;
                }
            }
        }
        layers.push(ConvLayer::aggregation("encoder.", inputs, self.keypoints));
        layers
    }

    /// The numbers of the encoder's largest tensor for an input of `[width, height]`: the input
    /// itself, or what a convolution makes before its pool.
    pub fn largest_maps(&self, size: [usize; 2]) -> usize {
        let mut largest = 3 * size[0] * size[1];
        let mut sides = Some(size);
        for layer in self.encoder_layers() {
            let side = |of: fn(&ConvLayer, usize) -> Option<usize>, [w, h]: [usize; 2]| {
                Some([of(&layer, w)?, of(&layer, h)?])
            };
            let Some([width, height]) = sides.and_then(|s| side(ConvLayer::convolved_side, s))
            else {
                break;
            };
            largest = largest.max(layer.outputs * width * height);
            sides = sides.and_then(|s| side(ConvLayer::output_side, s));
        }
        largest
    }

    /// Where the cells of the encoder's last feature map lie in its input: the pixel of the first
    /// one's centre and the pixels from one to the next, along both axes.
    pub fn cell_positions(&self) -> [f64; 2] {
        let (mut first, mut step) = (0.0, 1.0);
        for layer in self.encoder_layers() {
            first += step * ((layer.kernel - 1) as f64 / 2.0 - layer.padding as f64);
            step *= layer.stride as f64;
            if layer.pool {
                first -= 0.5 * step;
                step *= 2.0;
            }
        }
        [first, step]
    }

    /// The convolutions of the decoder, from N Gaussian maps to an RGB image; none for a DSAE.
    pub fn decoder_layers(&self) -> Vec<ConvLayer> {
        let (channels, kernels) = (&self.decoder_channels, &self.decoder_kernels);
        let mut layers = Vec::new();
        let mut inputs = self.keypoints;
        match self.architecture.family {
            Family::Basic => {
                for (i, (&outputs, &kernel)) in channels.iter().zip(kernels).enumerate() {
                    layers.push(ConvLayer::block("decoder.", i + 1, inputs, outputs, kernel));
                    inputs = outputs;
                }
            }
            Family::Dsae => return layers,
            Family::KeyNet => {
                for (i, &outputs) in channels.iter().enumerate() {
                    let module = format!("decoder.block{}.", i + 1);
                    layers.push(ConvLayer {
                        upsample: i > 0,
                        ..ConvLayer::block(&module, 1, inputs, outputs, kernels[0])
                    });
                    layers.push(ConvLayer::block(&module, 2, outputs, outputs, kernels[0]));
                    inputs = outputs;
                }
            }
        }
        layers.push(ConvLayer::aggregation("decoder.", inputs, 3));
        layers
    }

    /// Width and height of the decoder's Gaussian maps.
    pub fn map_size(&self) -> [usize; 2] {
        match self.architecture.family {
            Family::KeyNet => self.target_size.map(|side| side / 4),
            Family::Basic | Family::Dsae => self.target_size,
        }
    }

    /// Every tensor of the state dict with its shape, encoder first. Counters are left out.
    pub fn tensor_shapes(&self) -> Vec<(String, Vec<usize>)> {
        let mut shapes = Vec::new();
        let mut push = |name: String, shape: Vec<usize>| shapes.push((name, shape));
        let [width, height] = self.target_size;
        let convolutions = |layers: Vec<ConvLayer>, push: &mut dyn FnMut(String, Vec<usize>)| {
            for layer in layers {
                let ConvLayer {
                    name,
                    inputs,
                    outputs,
                    kernel,
                    ..
                } = layer;
                push(
                    format!("{name}.weight"),
                    vec![outputs, inputs, kernel, kernel],
                );
                match layer.norm {
                    None => push(format!("{name}.bias"), vec![outputs]),
                    Some(norm) => {
                        for part in ["weight", "bias", "running_mean", "running_var"] {
                            push(format!("{norm}.{part}"), vec![outputs]);
                        }
                    }
                }
            }
        };
        convolutions(self.encoder_layers(), &mut push);
        if self.trained_temperature {
            push(TEMPERATURE.to_owned(), vec![1]);
        }
        if self.architecture.trained_sigma {
            let shape = match self.sigma_per_keypoint {
                true => vec![self.keypoints, 1, 1],
                false => vec![1],
            };
            push(SIGMA.to_owned(), shape);
        }
        convolutions(self.decoder_layers(), &mut push);
        if self.architecture.family == Family::Dsae {
            push(
                format!("{DENSE}.weight"),
                vec![3 * width * height, 2 * self.keypoints],
            );
            push(format!("{DENSE}.bias"), vec![3 * width * height]);
        }
        if self.architecture.background {
            push(BACKGROUND.to_owned(), vec![3, height, width]);
        }
        shapes
    }
}
