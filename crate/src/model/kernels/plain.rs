//! The layers in burn's own operations, for a build that runs on GPUs only and does not train.

use burn::nn::conv::Conv2d;
use burn::prelude::Tensor;
use burn::tensor::module::{interpolate, max_pool2d};
use burn::tensor::ops::{InterpolateMode, InterpolateOptions, MaxPoolOptions};

/// As [`Conv2d::forward`].
pub(super) fn conv(layer: &Conv2d, input: Tensor<4>) -> Tensor<4> {
    layer.forward(input)
}

/// Max-pool over 2 x 2 cells with stride 2 and a border of -inf one cell wide.
///
/// # Shapes
/// - `input`: `[B, C, H, W]`
/// - output: `[B, C, H / 2 + 1, W / 2 + 1]`
pub(super) fn max_pool(input: Tensor<4>) -> Tensor<4> {
    let options = MaxPoolOptions::new([2, 2]).with_padding([1, 1]);
    max_pool2d(input, options)
}

/// Bilinear upsampling to twice the height and width, pixel edges aligned (`align_corners` is
/// false).
///
/// # Shapes
/// - `input`: `[B, C, H, W]`
/// - output: `[B, C, 2 H, 2 W]`
pub(super) fn upsample(input: Tensor<4>) -> Tensor<4> {
    let options = InterpolateOptions::new(InterpolateMode::Bilinear)
        .with_align_corners(false)
        .with_scale_factor([2.0; 2]);
    interpolate(input, options)
}
