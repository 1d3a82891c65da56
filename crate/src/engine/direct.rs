//! Convolutions as products of shifted rows: of a map that holds a cell's channels together, the
//! taps of a filter's row are one run of values, so that nothing has to be gathered.

use rten_simd::ops::BitOps;
use rten_simd::{Isa, SimdOp};

use super::gemm::{Left, Packed, Panels, WIDE, multiply, tile_rows, with_rows};
use super::map::Map;
use super::simd::larger;

/// A convolution, and what is done to its sums.
pub(super) struct Direct<'a> {
    /// Filters: rows of a filter x columns x channels, times outputs.
    pub panels: &'a Panels,
    /// Added to the sums, one value for each output.
    pub bias: &'a [f32],
    /// What results below are raised to: 0 for a ReLU.
    pub floor: f32,
    pub kernel: usize,
    pub stride: usize,
    pub input: &'a [f32],
    /// Framed by the padding.
    pub from: Map,
    pub output: &'a mut [f32],
    pub to: Map,
}

/// Values that are readable behind an input, since whole tiles are read.
pub(super) fn slack(lanes: usize, stride: usize, channels: usize) -> usize {
    tile_rows(lanes) * stride * channels
}

impl SimdOp for Direct<'_> {
    type Output = ();

    #[inline(always)]
    fn eval<I: Isa>(mut self, isa: I) {
        let lanes = isa.f32().len();
        let run = self.kernel * self.from.channels;
        let [width, height] = self.to.size;
        assert_eq!(self.panels.steps(), self.kernel * run);
        assert_eq!(self.panels.columns(), self.bias.len());
        assert_eq!(self.panels.columns(), self.to.channels);
        assert_eq!(self.to.channels % lanes, 0);
        let [columns, rows] = self.from.framed();
        assert!((width - 1) * self.stride + self.kernel <= columns);
        assert!((height - 1) * self.stride + self.kernel <= rows);
        assert!(
            self.input.len() >= self.from.len() + slack(lanes, self.stride, self.from.channels)
        );
        assert!(self.output.len() >= self.to.len());
        with_rows!(isa, ROWS => {
            for row in 0..height {
                let mut first = 0;
                while first + WIDE * lanes <= self.to.channels {
                    // SAFETY: the sizes are asserted above.
                    unsafe { self.row::<I, ROWS, WIDE>(isa, row, first) };
                    first += WIDE * lanes;
                }
                if first < self.to.channels {
                    // SAFETY: as above.
                    unsafe { self.row::<I, ROWS, 1>(isa, row, first) };
                }
            }
        });
    }
}

impl Direct<'_> {
    /// N vectors of outputs, from `first` on, of a row of cells.
    #[cfg_attr(target_arch = "wasm32", inline(never))]
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    unsafe fn row<I: Isa, const ROWS: usize, const N: usize>(
        &mut self,
        isa: I,
        row: usize,
        first: usize,
    ) {
        let ops = isa.f32();
        let lanes = ops.len();
        let run = self.kernel * self.from.channels;
        let pitch = self.from.pitch();
        let step = self.stride * self.from.channels;
        let width = self.to.size[0];
        let floor = ops.splat(self.floor);
        let panel = self.panels.panel(first).as_ptr();
        // SAFETY: `eval` asserts that the sizes fit each other; tiles that reach beyond the last
        // column read the slack.
        unsafe {
            let mut bias = [ops.zero(); N];
            for (i, bias) in bias.iter_mut().enumerate() {
                *bias = ops.load_ptr(self.bias.as_ptr().add(first + i * lanes));
            }
            let input = self.input.as_ptr().add(row * self.stride * pitch);
            let output = self.output.as_mut_ptr().add(self.to.at(0, row) + first);
            let mut column = 0;
            while column < width {
                let mut sums = [bias; ROWS];
                for ky in 0..self.kernel {
                    let left = Left {
                        start: input.add(ky * pitch + column * step),
                        row: step,
                        step: 1,
                    };
                    let right = Packed {
                        start: panel.add(ky * run * N * lanes),
                        width: N * lanes,
                    };
                    multiply::<I, _, ROWS, N>(isa, &mut sums, left, right, run);
                }
                let output = output.add(column * self.to.channels);
                let cells = width - column;
                for (r, sums) in sums.iter().enumerate() {
                    if r < cells {
                        for (i, sum) in sums.iter().enumerate() {
                            let to = output.add(r * self.to.channels + i * lanes);
                            ops.store_ptr(larger(isa, floor, *sum), to);
                        }
                    }
                }
                column += ROWS;
            }
        }
    }
}
