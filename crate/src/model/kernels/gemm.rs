//! Products with an operand that is read in place.
//!
//! Both operands stay close to the layout they have anyway: the right one is read in place, at an
//! offset a step of the sum, so that a shifted image is a row of the matrix and no im2col matrix is
//! ever built.

use rten_simd::ops::BitOps;
use rten_simd::{Isa, SimdOp};

use crate::engine::gemm::{Left, Right, lanes, multiply};

/// Vectors a tile is wide.
const TILE: usize = 3;

/// Rows of a tile: with [`TILE`] vectors a row, as many sums as the registers of the instruction
/// set hold.
const fn tile_rows(lanes: usize) -> usize {
    if lanes == 8 { 4 } else { 8 }
}

/// Rows of a panel of the left operand on this CPU.
pub(super) fn panel_rows() -> usize {
    tile_rows(lanes())
}

/// The columns that the product writes for `width` of them.
pub(super) fn padded(width: usize) -> usize {
    width.next_multiple_of(lanes())
}

/// A right operand that is read in place.
#[derive(Clone, Copy)]
struct Shifted<'a> {
    start: *const f32,
    /// Where a step begins.
    offsets: &'a [u32],
}

impl Right for Shifted<'_> {
    #[inline(always)]
    unsafe fn at(self, step: usize) -> *const f32 {
        // SAFETY: the caller's promise.
        unsafe { self.start.add(*self.offsets.get_unchecked(step) as usize) }
    }
}

/// `output[r][j] += sum over k of left[k * left_step + r] * right[offsets[k] + j]` for a panel of
/// [`panel_rows`] rows.
///
/// Every value is summed in the order of k, wherever it lies in a tile.
pub(super) struct Product<'a> {
    /// One panel: [`panel_rows`] values for each step of the sum.
    pub left: &'a [f32],
    /// Values of `left` from a step to the next, at least [`panel_rows`].
    pub left_step: usize,
    /// Where the row of the right operand starts, a step of the sum.
    pub offsets: &'a [u32],
    /// Not below any of `offsets`.
    pub max_offset: u32,
    /// Readable to `max_offset` + the padded width.
    pub right: &'a [f32],
    /// Rows of `stride` values.
    pub output: &'a mut [f32],
    /// At least the padded width.
    pub stride: usize,
    /// Columns; [`padded`] columns are read and written.
    pub width: usize,
    /// Whether `output` is added to; otherwise it is overwritten.
    pub accumulate: bool,
}

impl SimdOp for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn eval<I: Isa>(self, isa: I) {
        let lanes = isa.f32().len();
        if lanes == 8 {
            self.tiles::<I, { tile_rows(8) }>(isa, lanes);
        } else {
            self.tiles::<I, { tile_rows(16) }>(isa, lanes);
        }
    }
}

impl Product<'_> {
    #[inline(always)]
    fn tiles<I: Isa, const ROWS: usize>(self, isa: I, lanes: usize) {
        let vectors = self.width.div_ceil(lanes);
        let steps = self.offsets.len();
        assert!(self.left_step >= ROWS);
        assert!(steps == 0 || self.left.len() >= (steps - 1) * self.left_step + ROWS);
        assert!(self.right.len() >= self.max_offset as usize + vectors * lanes);
        assert!(self.stride >= vectors * lanes && self.output.len() >= ROWS * self.stride);
        debug_assert!(self.offsets.iter().all(|offset| *offset <= self.max_offset));
        let mut vector = 0;
        while vector < vectors {
            let column = vector * lanes;
            // SAFETY: `left` holds ROWS values at every step; the tile reads `right` up to its
            // largest offset plus the padded width and writes ROWS rows within `stride`, all of
            // which is asserted above.
            unsafe {
                let right = self.right.as_ptr().add(column);
                let output = self.output.as_mut_ptr().add(column);
                match vectors - vector {
                    1 => {
                        self.tile::<I, ROWS, 1>(isa, right, output);
                        vector += 1;
                    }
                    // Two and two, not three and one: a tile of one vector has too few sums to keep
                    // the CPU busy.
                    2 | 4 => {
                        self.tile::<I, ROWS, 2>(isa, right, output);
                        vector += 2;
                    }
                    _ => {
                        self.tile::<I, ROWS, TILE>(isa, right, output);
                        vector += TILE;
                    }
                }
            }
        }
    }

    /// # Safety
    /// `right` must be readable at every offset, and `output` writable in ROWS rows, for WIDE
    /// vectors.
    #[inline(always)]
    unsafe fn tile<I: Isa, const ROWS: usize, const WIDE: usize>(
        &self,
        isa: I,
        right: *const f32,
        output: *mut f32,
    ) {
        let ops = isa.f32();
        let lanes = ops.len();
        let mut sums = [[ops.zero(); WIDE]; ROWS];
        // SAFETY: the caller's promise, and `left` has ROWS values at every step.
        unsafe {
            if self.accumulate {
                for (r, row) in sums.iter_mut().enumerate() {
                    for (i, sum) in row.iter_mut().enumerate() {
                        *sum = ops.load_ptr(output.add(r * self.stride + i * lanes));
                    }
                }
            }
            let left = Left {
                start: self.left.as_ptr(),
                row: 1,
                step: self.left_step,
            };
            let right = Shifted {
                start: right,
                offsets: self.offsets,
            };
            let steps = self.offsets.len();
            multiply::<I, _, ROWS, WIDE>(isa, &mut sums, left, right, steps);
            for (r, row) in sums.iter().enumerate() {
                for (i, sum) in row.iter().enumerate() {
                    ops.store_ptr(*sum, output.add(r * self.stride + i * lanes));
                }
            }
        }
    }
}
