//! The spatial soft-argmax that turns a feature map into a keypoint.

/// The expected position (x, y) under the softmax of a `width` x `height` map; -1 and +1 are the centres of the
/// border cells (paper, section 2).
///
/// The maximum is subtracted first, so that no activation overflows; sums are in f64.
pub(super) fn soft_argmax(map: &[f32], width: usize, temperature: f32) -> [f32; 2] {
    let height = map.len() / width;
    // A trained temperature may be negative: what counts is the largest quotient.
    let activation = |value: &f32| value / temperature;
    let max = map.iter().map(activation).fold(f32::NEG_INFINITY, f32::max);
    let (mut total, mut along_x, mut along_y) = (0.0f64, 0.0f64, 0.0f64);
    for (y, row) in map.chunks_exact(width).enumerate() {
        let mut row_total = 0.0f64;
        for (x, value) in row.iter().enumerate() {
            let weight = f64::from((activation(value) - max).exp());
            row_total += weight;
            along_x += weight * cell(x, width);
        }
        total += row_total;
        along_y += row_total * cell(y, height);
    }
    [(along_x / total) as f32, (along_y / total) as f32]
}

/// The softmax of a map, the maximum subtracted first.
pub(super) fn softmax(map: &[f32], temperature: f32) -> Vec<f32> {
    let activation = |value: &f32| value / temperature;
    let max = map.iter().map(activation).fold(f32::NEG_INFINITY, f32::max);
    let weight = |value: &f32| f64::from((activation(value) - max).exp());
    let total: f64 = map.iter().map(weight).sum();
    map.iter().map(|value| (weight(value) / total) as f32).collect()
}

/// `linspace(-1, 1, cells)[i]`; a single cell is at -1, as PyTorch has it.
pub(super) fn cell(i: usize, cells: usize) -> f64 {
    if cells == 1 {
        return -1.0;
    }
    2.0 * i as f64 / (cells - 1) as f64 - 1.0
}
