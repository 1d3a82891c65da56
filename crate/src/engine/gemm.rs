//! The product behind all convolutions: a few rows of values, read in place, times a panel of
//! packed weights.

use rten_simd::ops::{BitOps, NumOps};
use rten_simd::{Isa, SimdOp};

use super::buffer::Buffer;
use crate::error::Result;

/// Vectors a panel is wide, except for the last one of an odd number of vectors.
pub(crate) const WIDE: usize = 2;

/// Rows that are multiplied at a time: with [`WIDE`] vectors a row, as many sums as the registers
/// hold next to their operands.
pub(crate) const fn tile_rows(lanes: usize) -> usize {
    match lanes {
        16 => 12,
        8 => 6,
        // 32 registers, against 16 of which a browser keeps some to itself.
        _ if cfg!(target_arch = "aarch64") => 8,
        _ => 4,
    }
}

/// Runs `$body` with the constant `$rows` that [`tile_rows`] gives for the instruction set.
macro_rules! with_rows {
    ($isa:expr, $rows:ident => $body:expr) => {
        match rten_simd::ops::BitOps::<f32>::len($isa.f32()) {
            16 => {
                const $rows: usize = $crate::engine::gemm::tile_rows(16);
                $body
            }
            8 => {
                const $rows: usize = $crate::engine::gemm::tile_rows(8);
                $body
            }
            _ => {
                const $rows: usize = $crate::engine::gemm::tile_rows(4);
                $body
            }
        }
    };
}
pub(crate) use with_rows;

/// Values in a vector on this CPU.
pub(crate) fn lanes() -> usize {
    struct Lanes;
    impl SimdOp for Lanes {
        type Output = usize;
        #[inline(always)]
        fn eval<I: Isa>(self, isa: I) -> usize {
            isa.f32().len()
        }
    }
    Lanes.dispatch()
}

/// A matrix in panels of [`WIDE`] vectors, step by step; zeros after the last column.
pub(crate) struct Panels {
    data: Buffer,
    steps: usize,
    columns: usize,
    /// Columns of a panel.
    width: usize,
}

impl Panels {
    /// Zeros for `steps` rows of values in `columns` columns, a multiple of `lanes`.
    ///
    /// # Errors
    /// When there is no memory for them.
    pub fn zeros(lanes: usize, steps: usize, columns: usize) -> Result<Self> {
        let mut data = Buffer::default();
        data.grow(steps * columns)?;
        Ok(Self {
            data,
            steps,
            columns,
            width: WIDE * lanes,
        })
    }

    /// Packs `steps` rows of values in `columns` columns, a multiple of `lanes`.
    ///
    /// # Errors
    /// When there is no memory for it.
    pub fn new(
        lanes: usize,
        steps: usize,
        columns: usize,
        at: impl Fn(usize, usize) -> f32,
    ) -> Result<Self> {
        let mut panels = Self::zeros(lanes, steps, columns)?;
        for column in 0..columns {
            for (step, place) in panels.column_mut(column).enumerate() {
                *place = at(step, column);
            }
        }
        Ok(panels)
    }

    /// A column, step by step.
    pub fn column_mut(&mut self, column: usize) -> impl Iterator<Item = &mut f32> {
        let first = column / self.width * self.width;
        let width = self.width.min(self.columns - first);
        let panel = &mut self.data[first * self.steps..][..width * self.steps];
        panel[column - first..].iter_mut().step_by(width)
    }

    /// Steps of the sum.
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// Columns with the zeros after them.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// The panel that begins with the column `first`.
    pub fn panel(&self, first: usize) -> &[f32] {
        &self.data[first * self.steps..]
    }
}

/// The left operand of a product.
#[derive(Clone, Copy)]
pub(crate) struct Left {
    pub start: *const f32,
    /// Values from a row to the next.
    pub row: usize,
    /// Values from a step of the sum to the next.
    pub step: usize,
}

/// The right operand of a product: N vectors for each step of the sum.
pub(crate) trait Right: Copy {
    /// Where the vectors of a step are.
    ///
    /// # Safety
    /// The operand must have the step.
    unsafe fn at(self, step: usize) -> *const f32;
}

/// A panel of [`Panels`], `width` values wide.
#[derive(Clone, Copy)]
pub(crate) struct Packed {
    pub start: *const f32,
    pub width: usize,
}

impl Right for Packed {
    #[inline(always)]
    unsafe fn at(self, step: usize) -> *const f32 {
        // SAFETY: the caller's promise.
        unsafe { self.start.add(step * self.width) }
    }
}

/// `sums[r][i] += sum over k of left[r][k] * right[k][i]` for `steps` values of k, in this order.
///
/// # Safety
/// `left` must be readable in ROWS rows of `steps` values, `right` in `steps` rows of N vectors.
#[inline(always)]
pub(crate) unsafe fn multiply<I: Isa, R: Right, const ROWS: usize, const N: usize>(
    isa: I,
    sums: &mut [[I::F32; N]; ROWS],
    left: Left,
    right: R,
    steps: usize,
) {
    let mut k = 0;
    if cfg!(target_arch = "wasm32") {
        // The compiler unrolls a loop whose count it knows, and then gathers the operands of
        // several steps, which are too many for the registers of a browser.
        let one = std::hint::black_box(1);
        while k != steps {
            // SAFETY: the caller's promise.
            unsafe { add_step::<I, R, ROWS, N>(isa, sums, left, right, k) };
            k += one;
        }
        return;
    }
    while k + 4 <= steps {
        // SAFETY: the caller's promise.
        unsafe {
            add_step::<I, R, ROWS, N>(isa, sums, left, right, k);
            add_step::<I, R, ROWS, N>(isa, sums, left, right, k + 1);
            add_step::<I, R, ROWS, N>(isa, sums, left, right, k + 2);
            add_step::<I, R, ROWS, N>(isa, sums, left, right, k + 3);
        }
        k += 4;
    }
    while k < steps {
        // SAFETY: the caller's promise.
        unsafe { add_step::<I, R, ROWS, N>(isa, sums, left, right, k) };
        k += 1;
    }
}

/// [`multiply`] of packed columns, into ROWS x N vectors at `to`.
///
/// # Safety
/// As [`multiply`]; the vectors at `to` must be writable.
#[inline(always)]
pub(super) unsafe fn multiply_to<I: Isa, const ROWS: usize, const N: usize>(
    isa: I,
    left: Left,
    right: Packed,
    steps: usize,
    to: *mut f32,
) {
    let ops = isa.f32();
    let mut sums = [[ops.zero(); N]; ROWS];
    // SAFETY: the caller's promise.
    unsafe {
        multiply::<I, _, ROWS, N>(isa, &mut sums, left, right, steps);
        for (i, sum) in sums.as_flattened().iter().enumerate() {
            ops.store_ptr(*sum, to.add(i * ops.len()));
        }
    }
}

/// Adds the products of the step k. (A function, since a closure that is called in several places
/// is not always inlined, and then runs without the vectors of the instruction set.)
///
/// # Safety
/// As [`multiply`], for this step.
#[inline(always)]
unsafe fn add_step<I: Isa, R: Right, const ROWS: usize, const N: usize>(
    isa: I,
    sums: &mut [[I::F32; N]; ROWS],
    left: Left,
    right: R,
    k: usize,
) {
    let ops = isa.f32();
    let lanes = ops.len();
    // SAFETY: the caller's promise.
    unsafe {
        let row = right.at(k);
        let mut columns = [ops.zero(); N];
        for (i, column) in columns.iter_mut().enumerate() {
            *column = ops.load_ptr(row.add(i * lanes));
        }
        for (r, row_sums) in sums.iter_mut().enumerate() {
            let factor = ops.splat(*left.start.add(r * left.row + k * left.step));
            for (sum, column) in row_sums.iter_mut().zip(columns) {
                *sum = ops.mul_add(factor, column, *sum);
            }
        }
    }
}
