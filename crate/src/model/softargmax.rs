use burn::prelude::{Tensor, TensorData};

use super::grid::grid;

/// The centre of attention of every map: softmax over the cells, then the mean of their
/// coordinates.
///
/// Coordinates run from -1 to 1 between the centres of the border cells. The softmax subtracts the
/// largest activation first, so that no activation overflows; activations are to be divided by the
/// temperature before.
///
/// # Shapes
/// - `maps`: `[B, N, H, W]`
/// - output: `[B, N, 2]`, (y, x)
pub fn spatial_softargmax(maps: Tensor<4>) -> Tensor<3> {
    let [batch, points, height, width] = maps.dims();
    let device = maps.device();
    let maps = maps.reshape([batch * points, height, width]);
    let largest = maps.clone().detach().max_dim(2).max_dim(1);
    let attention = (maps - largest).exp();
    // Rows and columns first: sums over thousands of cells in one go lose digits in f32.
    let [rows, columns] = [2, 1].map(|axis| attention.clone().sum_dim(axis));
    let total = rows.clone().sum_dim(1);
    let mean = |sums: Tensor<3>, length: usize| {
        let coordinates =
            Tensor::<3>::from_data(TensorData::new(grid(length), [1, length, 1]), &device);
        let sums = sums.reshape([batch * points, length, 1]);
        ((sums * coordinates).sum_dim(1) / total.clone()).reshape([batch, points, 1])
    };
    Tensor::cat(vec![mean(rows, height), mean(columns, width)], 2)
}
