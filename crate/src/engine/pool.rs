//! Max-pooling followed by the batch norm and ReLU that come after it, for convolutions that cannot
//! do it themselves.

use rten_simd::ops::{BitOps, NumOps};
use rten_simd::{Isa, SimdOp};

use super::epilogue::Epilogue;
use super::map::Map;
use super::simd::larger;

/// Rows or columns of a pooled map.
pub(crate) fn pooled(side: usize) -> usize {
    side / 2 + 1
}

/// The two rows or columns of a map that a cell of the pooled map covers; `None` in front of the
/// map. The second one may lie behind it.
pub(crate) fn window(at: usize) -> [Option<usize>; 2] {
    [(2 * at).checked_sub(1), Some(2 * at)]
}

/// Kernel 2, stride 2, one ring of padding that never wins (as in the authors' code; the paper has
/// none); then scale, bias and floor.
///
/// The batch norm cannot move before the maximum: where its scale is negative it would turn it into
/// a minimum.
pub(super) struct MaxPool<'a> {
    pub epilogue: Epilogue<'a>,
    pub input: &'a [f32],
    pub from: Map,
    pub output: &'a mut [f32],
    pub to: Map,
}

impl SimdOp for MaxPool<'_> {
    type Output = ();

    #[inline(always)]
    fn eval<I: Isa>(self, isa: I) {
        let ops = isa.f32();
        let lanes = ops.len();
        let channels = self.from.channels;
        let scale = self.epilogue.scale.unwrap_or_default();
        assert_eq!(self.to.size, self.from.size.map(pooled));
        assert_eq!([self.to.channels, channels % lanes], [channels, 0]);
        assert_eq!([scale.len(), self.epilogue.bias.len()], [channels; 2]);
        assert!(self.input.len() >= self.from.len() && self.output.len() >= self.to.len());
        let floor = ops.splat(self.epilogue.floor);
        for row in 0..self.to.size[1] {
            for column in 0..self.to.size[0] {
                let [columns, rows] = [(column, 0), (row, 1)].map(|(at, axis)| {
                    let side = self.from.size[axis];
                    let inside = move |at: &usize| *at < side;
                    window(at).into_iter().flatten().filter(inside)
                });
                for channel in (0..channels).step_by(lanes) {
                    let mut value = ops.splat(f32::NEG_INFINITY);
                    // SAFETY: both maps hold the cells, and the channels are whole vectors, as
                    // asserted above.
                    unsafe {
                        for row in rows.clone() {
                            for column in columns.clone() {
                                let cell =
                                    self.input.as_ptr().add(self.from.at(column, row) + channel);
                                value = larger(isa, value, ops.load_ptr(cell));
                            }
                        }
                        let scale = ops.load_ptr(scale.as_ptr().add(channel));
                        let bias = ops.load_ptr(self.epilogue.bias.as_ptr().add(channel));
                        let value = larger(isa, floor, ops.mul_add(scale, value, bias));
                        let to = self
                            .output
                            .as_mut_ptr()
                            .add(self.to.at(column, row) + channel);
                        ops.store_ptr(value, to);
                    }
                }
            }
        }
    }
}
