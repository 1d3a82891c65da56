use burn::prelude::{Tensor, TensorData};
use burn::tensor::activation::softmax;

use super::grid;

/// The centre of attention of every map: softmax over the cells, then the mean of their coordinates.
///
/// Coordinates run from -1 to 1 between the centres of the border cells. The softmax subtracts the largest activation
/// first, so that no activation overflows; activations are to be divided by the temperature before.
///
/// # Shapes
/// - `maps`: `[B, N, H, W]`
/// - output: `[B, N, 2]`, (y, x)
pub fn spatial_softargmax(maps: Tensor<4>) -> Tensor<3> {
    let [batch, points, height, width] = maps.dims();
    let device = maps.device();
    let attention =
        softmax(maps.reshape([batch * points, height * width]), 1).reshape([batch * points, height, width]);
    // Rows and columns first: sums over thousands of cells in one go lose digits in f32.
    let along = |axis: usize, length: usize| {
        let coordinates = Tensor::<3>::from_data(TensorData::new(grid(length), [1, length, 1]), &device);
        let weights = attention
            .clone()
            .sum_dim(3 - axis)
            .reshape([batch * points, length, 1]);
        (weights * coordinates).sum_dim(1).reshape([batch, points, 1])
    };
    Tensor::cat(vec![along(1, height), along(2, width)], 2)
}
