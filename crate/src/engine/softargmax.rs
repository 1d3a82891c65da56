//! The spatial soft-argmax that turns a feature map into a keypoint.

use rten_simd::ops::{BitOps, FloatOps, NumOps};
use rten_simd::{Isa, Simd, SimdOp, SimdUnaryOp};
use rten_vecmath::Exp;

use super::map::Map;
use super::simd::larger;

/// Cells whose weights are added up in f32 before they are added to the sum in f64.
const RUN: usize = 32;

/// Expected positions (x, y) under the softmax of every channel; -1 and +1 are the centres of the
/// border cells (paper, section 2).
///
/// The maximum is subtracted first, so that no activation overflows. A channel with a value that is
/// not finite gives NaN.
pub(super) struct SoftArgmax<'a> {
    pub input: &'a [f32],
    pub from: Map,
    pub temperature: f32,
    /// One a channel, without the channels that only pad the vectors.
    pub points: &'a mut [[f32; 2]],
}

impl SimdOp for SoftArgmax<'_> {
    type Output = ();

    #[inline(always)]
    fn eval<I: Isa>(self, isa: I) {
        let ops = isa.f32();
        let lanes = ops.len();
        let [width, height] = self.from.size;
        let channels = self.from.channels;
        assert!(self.points.len() <= channels && channels.is_multiple_of(lanes));
        assert!(self.input.len() >= self.from.len());
        let temperature = ops.splat(self.temperature);
        for (group, points) in self.points.chunks_mut(lanes).enumerate() {
            // SAFETY: the map holds every cell with all its channels.
            let cell = |column: usize, row: usize| unsafe {
                ops.load_ptr(
                    self.input
                        .as_ptr()
                        .add(self.from.at(column, row) + group * lanes),
                )
            };
            let mut max = ops.splat(f32::NEG_INFINITY);
            // 0, as long as all values are finite: `max` may look over a NaN.
            let mut poison = ops.zero();
            for row in 0..height {
                for column in 0..width {
                    // A trained temperature may be negative: what counts is the largest quotient.
                    let value = ops.div(cell(column, row), temperature);
                    max = larger(isa, value, max);
                    poison = ops.mul_add(value, ops.zero(), poison);
                }
            }
            let [mut total, mut along_x, mut along_y] = [[0.0f64; 16]; 3];
            for row in 0..height {
                let y = position(row, height);
                for start in (0..width).step_by(RUN) {
                    let (mut weights, mut moments) = (ops.zero(), ops.zero());
                    for column in start..(start + RUN).min(width) {
                        let value = ops.sub(ops.div(cell(column, row), temperature), max);
                        let weight = Exp::apply(isa, value);
                        let x = ops.splat(position(column, width) as f32);
                        weights = ops.add(weights, weight);
                        moments = ops.mul_add(weight, x, moments);
                    }
                    let (weights, moments) = (weights.to_array(), moments.to_array());
                    for lane in 0..lanes {
                        let weight = f64::from(weights[lane]);
                        total[lane] += weight;
                        along_x[lane] += f64::from(moments[lane]);
                        along_y[lane] += weight * y;
                    }
                }
            }
            let poison = poison.to_array();
            for (lane, point) in points.iter_mut().enumerate() {
                let total = total[lane] + f64::from(poison[lane]);
                *point = [along_x[lane] / total, along_y[lane] / total].map(|v| v as f32);
            }
        }
    }
}

/// The softmax of a map, the maximum subtracted first.
pub(super) fn softmax(map: &[f32], temperature: f32) -> Vec<f32> {
    let activation = |value: &f32| value / temperature;
    let max = map.iter().map(activation).fold(f32::NEG_INFINITY, f32::max);
    let weight = |value: &f32| f64::from((activation(value) - max).exp());
    let total: f64 = map.iter().map(weight).sum();
    map.iter()
        .map(|value| (weight(value) / total) as f32)
        .collect()
}

/// `linspace(-1, 1, cells)[i]`; a single cell is at -1, as PyTorch has it.
pub(super) fn position(i: usize, cells: usize) -> f64 {
    if cells == 1 {
        return -1.0;
    }
    2.0 * i as f64 / (cells - 1) as f64 - 1.0
}
