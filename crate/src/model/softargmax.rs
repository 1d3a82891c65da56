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
    let (ys, xs) = (grid(height), grid(width));
    let coordinates: Vec<f32> = ys
        .iter()
        .flat_map(|&y| xs.iter().flat_map(move |&x| [y, x]))
        .collect();
    let coordinates =
        Tensor::<2>::from_data(TensorData::new(coordinates, [height * width, 2]), &maps.device());
    let attention = softmax(maps.reshape([batch * points, height * width]), 1);
    attention.matmul(coordinates).reshape([batch, points, 2])
}
