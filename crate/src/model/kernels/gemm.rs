//! The one product behind all convolutions.
//!
//! Both operands stay close to the layout they have anyway: the right one is read in place, at an
//! offset a step of the sum, so that a shifted image is a row of the matrix and no im2col matrix is
//! ever built.

use rten_simd::ops::{BitOps, NumOps};
use rten_simd::{Isa, SimdOp};

/// Vectors a tile is wide.
const TILE: usize = 3;

/// Rows of a tile: with [`TILE`] vectors a row, as many sums as the registers of the instruction
/// set hold.
const fn tile_rows(lanes: usize) -> usize {
    if lanes == 8 { 4 } else { 8 }
}

/// The shape of the tiles on this CPU.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tiling {
    /// Rows of a panel of the left operand.
    pub rows: usize,
    /// Numbers in a vector: widths are rounded up to it.
    pub lanes: usize,
}

impl Tiling {
    pub fn new() -> Self {
        struct Lanes;
        impl SimdOp for Lanes {
            type Output = usize;
            #[inline(always)]
            fn eval<I: Isa>(self, isa: I) -> usize {
                isa.f32().len()
            }
        }
        let lanes = Lanes.dispatch();
        Self {
            rows: tile_rows(lanes),
            lanes,
        }
    }

    /// `width` as the product writes it.
    pub fn padded(&self, width: usize) -> usize {
        width.next_multiple_of(self.lanes)
    }
}

/// `output[r][j] += sum over k of left[k * left_step + r] * right[offsets[k] + j]` for a panel of
/// [`Tiling::rows`] rows.
///
/// Every number is summed in the order of k, whatever its place in a tile.
pub(super) struct Product<'a> {
    /// One panel: [`Tiling::rows`] numbers a step of the sum.
    pub left: &'a [f32],
    /// Numbers of `left` from a step to the next, at least [`Tiling::rows`].
    pub left_step: usize,
    /// Where the row of the right operand starts, a step of the sum.
    pub offsets: &'a [u32],
    /// Not below any of `offsets`.
    pub max_offset: u32,
    /// Readable to `max_offset` + the padded width.
    pub right: &'a [f32],
    /// Rows of `stride` numbers.
    pub output: &'a mut [f32],
    /// At least the padded width.
    pub stride: usize,
    /// Columns; [`Tiling::padded`] columns are read and written.
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
            // SAFETY: `left` holds ROWS numbers at every step; the tile reads `right` up to its
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
        // SAFETY: the caller's promise, and `left` has ROWS numbers at every step.
        unsafe {
            if self.accumulate {
                for (r, row) in sums.iter_mut().enumerate() {
                    for (i, sum) in row.iter_mut().enumerate() {
                        *sum = ops.load_ptr(output.add(r * self.stride + i * lanes));
                    }
                }
            }
            for (step, &offset) in self.offsets.iter().enumerate() {
                let left = self.left.as_ptr().add(step * self.left_step);
                let start = right.add(offset as usize);
                let mut columns = [ops.zero(); WIDE];
                for (i, column) in columns.iter_mut().enumerate() {
                    *column = ops.load_ptr(start.add(i * lanes));
                }
                for (r, row) in sums.iter_mut().enumerate() {
                    let factor = ops.splat(*left.add(r));
                    for (sum, column) in row.iter_mut().zip(columns) {
                        *sum = ops.mul_add(factor, column, *sum);
                    }
                }
            }
            for (r, row) in sums.iter().enumerate() {
                for (i, sum) in row.iter().enumerate() {
                    ops.store_ptr(*sum, output.add(r * self.stride + i * lanes));
                }
            }
        }
    }
}
