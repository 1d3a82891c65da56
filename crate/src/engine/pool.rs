//! Max-pooling followed by the batch norm and ReLU that come after it.

/// The size that pooling makes of `size`.
fn pooled(size: [usize; 2]) -> [usize; 2] {
    size.map(|side| side / 2 + 1)
}

/// Kernel 2, stride 2, one ring of padding that never wins (as in the authors' code; the paper has none);
/// then `max(0, scale * value + shift)` per channel.
///
/// The batch norm cannot move before the maximum: where its scale is negative it would turn it into a minimum.
pub(super) fn max_pool_affine_relu(
    input: &[f32],
    size: [usize; 2],
    scale: &[f32],
    shift: &[f32],
    output: &mut [f32],
) {
    let [width, height] = size;
    let [to_width, to_height] = pooled(size);
    let planes = input.chunks_exact(width * height);
    let outputs = output.chunks_exact_mut(to_width * to_height);
    for ((plane, out), (scale, shift)) in planes.zip(outputs).zip(scale.iter().zip(shift)) {
        for (y, out) in out.chunks_exact_mut(to_width).enumerate() {
            let rows = (2 * y).saturating_sub(1)..(2 * y + 1).min(height);
            out.fill(f32::NEG_INFINITY);
            for row in rows {
                let row = &plane[row * width..(row + 1) * width];
                for (x, value) in out.iter_mut().enumerate() {
                    for v in &row[(2 * x).saturating_sub(1)..(2 * x + 1).min(width)] {
                        *value = value.max(*v);
                    }
                }
            }
            for value in out.iter_mut() {
                *value = (scale * *value + shift).max(0.0);
            }
        }
    }
}
