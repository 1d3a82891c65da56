//! Bilinear upsampling to twice the size, pixel edges aligned, and its gradient.
//!
//! On an axis, a pixel i becomes 1/4 of its neighbour and 3/4 of itself, on either side; beyond the
//! border lies the border pixel once more. The gradient of pixel i collects the same weights from
//! the pixels 2i - 1 to 2i + 2.

use rayon::prelude::*;

use super::buffer::{Output, vectorised, with_scratch};

const NEAR: f32 = 0.75;
const FAR: f32 = 0.25;

/// The transpose of the matrix that enlarges an axis: length x (2 length).
pub(super) fn transpose(length: usize) -> Vec<f32> {
    let mut weights = vec![0.0; length * 2 * length];
    for enlarged in 0..2 * length {
        let (near, odd) = (enlarged / 2, enlarged % 2);
        let far = (near + odd).saturating_sub(1 - odd).min(length - 1);
        weights[near * 2 * length + enlarged] += NEAR;
        weights[far * 2 * length + enlarged] += FAR;
    }
    weights
}

/// Maps of twice the height and width.
pub(super) fn upsample(input: &[f32], [height, width]: [usize; 2]) -> Vec<f32> {
    let mut output = Output::new(4 * input.len());
    output
        .uninit()
        .par_chunks_exact_mut(4 * height * width)
        .zip(input.par_chunks_exact(height * width))
        .for_each(|(output, input)| {
            with_scratch([width + 2], |[blend]| {
                for (y, line) in output.chunks_exact_mut(2 * width).enumerate() {
                    let other = if y % 2 == 0 {
                        (y / 2).saturating_sub(1)
                    } else {
                        (y / 2 + 1).min(height - 1)
                    };
                    let [near, far] = [y / 2, other].map(|y| &input[y * width..][..width]);
                    vectorised(
                        #[inline(always)]
                        || {
                            for ((blend, near), far) in blend[1..].iter_mut().zip(near).zip(far) {
                                *blend = NEAR * near + FAR * far;
                            }
                            blend[0] = blend[1];
                            blend[width + 1] = blend[width];
                            for (i, pair) in line.chunks_exact_mut(2).enumerate() {
                                pair[0].write(FAR * blend[i] + NEAR * blend[i + 1]);
                                pair[1].write(NEAR * blend[i + 1] + FAR * blend[i + 2]);
                            }
                        },
                    );
                }
            });
        });
    // SAFETY: the maps are all there is, and each was written.
    unsafe { output.into_vec(4 * input.len()) }
}

/// The gradient of the input, whose maps are height x width.
pub(super) fn gradient(gradient: &[f32], [height, width]: [usize; 2]) -> Vec<f32> {
    let mut output = Output::new(gradient.len() / 4);
    output
        .uninit()
        .par_chunks_exact_mut(height * width)
        .zip(gradient.par_chunks_exact(4 * height * width))
        .for_each(|(output, gradient)| {
            with_scratch([2 * width + 2], |[blend]| {
                for (y, line) in output.chunks_exact_mut(width).enumerate() {
                    let rows = [
                        (2 * y).saturating_sub(1),
                        2 * y,
                        2 * y + 1,
                        (2 * y + 2).min(2 * height - 1),
                    ];
                    let rows = rows.map(|y| &gradient[y * 2 * width..][..2 * width]);
                    vectorised(
                        #[inline(always)]
                        || {
                            for (x, blend) in blend[1..=2 * width].iter_mut().enumerate() {
                                *blend = NEAR * (rows[1][x] + rows[2][x])
                                    + FAR * (rows[0][x] + rows[3][x]);
                            }
                            blend[0] = blend[1];
                            blend[2 * width + 1] = blend[2 * width];
                            for (i, value) in line.iter_mut().enumerate() {
                                let four = &blend[2 * i..2 * i + 4];
                                value.write(NEAR * (four[1] + four[2]) + FAR * (four[0] + four[3]));
                            }
                        },
                    );
                }
            });
        });
    // SAFETY: the maps are all there is, and each was written.
    unsafe { output.into_vec(gradient.len() / 4) }
}
