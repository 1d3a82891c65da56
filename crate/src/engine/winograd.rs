//! Convolutions by Winograd's algorithm: a tile of M x M outputs costs as many products as it has
//! cells instead of M² kernel², at the price of additions.
//!
//! Tiles of 6 x 6 cells serve filters of 3 x 3 (M = 4) and 5 x 5 (M = 2) with stride 1, which
//! differ in the transforms of filters and results only. Filters of 3 x 3 with stride 2 take tiles
//! of 9 x 9 (M = 4): along an axis, the first and the last tap meet every other cell, which is a
//! filter of 2 taps with stride 1 and has a transform of 5 points; the middle tap meets the 4 cells
//! between, which stay as they are. So 81 products do the work of 144.
//!
//! Tiles go through in blocks whose transforms stay in the second-level cache: input transform of a
//! block, then for every panel of outputs the products and the output transform, which adds the
//! bias, pools and applies the ReLU, so that no sum is written to memory other than as a result.
//!
//! A. Lavin, S. Gray: Fast Algorithms for Convolutional Neural Networks (2016).

use rten_simd::ops::{BitOps, NumOps};
use rten_simd::{Isa, SimdOp};

use super::buffer::LINE;
use super::epilogue::Epilogue;
use super::gemm::{Left, Packed, Panels, WIDE, multiply_to, tile_rows, with_rows};
use super::map::Map;
use super::pool::pooled;
use super::simd::larger;
use super::tile::{FAR, Inputs, NEAR, Outputs, transform, transform_to};
use crate::error::Result;

/// Values of a block of transformed tiles: half of a common second-level cache.
const BLOCK: usize = 128 * 1024;

/// How the cells of a convolution are cut into tiles.
#[derive(Clone, Copy)]
pub(crate) struct Tiling {
    pub kernel: usize,
    pub stride: usize,
    /// Cells of a side of a tile, and places of its transform.
    pub side: usize,
    /// Cells that a tile results in, a side.
    pub outputs: usize,
}

impl Tiling {
    /// `None` where no transform exists for it.
    pub fn new(kernel: usize, stride: usize) -> Option<Self> {
        let outputs = match (kernel, stride) {
            (3, 1 | 2) => 4,
            (5, 1) => 2,
            _ => return None,
        };
        Some(Self {
            kernel,
            stride,
            side: (outputs - 1) * stride + kernel,
            outputs,
        })
    }

    /// Places of a tile.
    pub fn places(&self) -> usize {
        self.side * self.side
    }

    /// Tiles along the axes for `convolved` cells.
    pub fn tiles(&self, pool: bool, convolved: [usize; 2]) -> [usize; 2] {
        // A pool takes its first maximum over the first row and the one before it, so tiles begin
        // there as well.
        convolved.map(|side| (side + usize::from(pool)).div_ceil(self.outputs))
    }

    /// Cells that `tiles` look at along an axis.
    pub fn reach(&self, tiles: usize) -> usize {
        (tiles * self.outputs - 1) * self.stride + self.kernel
    }

    /// Cells in front of the input of a convolution and behind it on both axes, of which `size`
    /// come in and `convolved` out.
    pub fn frame(
        &self,
        padding: usize,
        pool: bool,
        size: [usize; 2],
        convolved: [usize; 2],
    ) -> (usize, [usize; 2]) {
        let before = padding + usize::from(pool);
        let tiles = self.tiles(pool, convolved);
        // With a stride, the last cells may meet no tap.
        let after = [0, 1].map(|axis| self.reach(tiles[axis]).saturating_sub(before + size[axis]));
        (before, after)
    }

    /// Tiles that are transformed at a time, and values that a convolution of `tiles` needs besides
    /// input and output.
    pub fn scratch(&self, lanes: usize, channels: usize, tiles: usize) -> (usize, usize) {
        let rows = tile_rows(lanes);
        let most = (BLOCK / (self.places() * channels)).clamp(rows, 32 * rows);
        // Equal blocks, as whole tiles of the product.
        let blocks = tiles.div_ceil(most);
        let block = tiles.div_ceil(blocks).next_multiple_of(rows);
        let strides = Strides::new(block, channels, lanes);
        (block, self.places() * (strides.source + strides.product))
    }

    /// What the taps of an axis become: `kernel` factors for every place.
    pub fn filter_transform(&self) -> Vec<f64> {
        let points = [0.0, NEAR, -NEAR, FAR, -FAR].map(f64::from);
        // The taps that are a filter with stride 1; the place of a tap between them stands for
        // itself.
        let taps: Vec<usize> = (0..self.kernel).step_by(self.stride).collect();
        let finite = &points[..self.outputs + taps.len() - 2];
        let mut matrix = vec![0.0f64; self.side * self.kernel];
        for (i, row) in matrix.chunks_exact_mut(self.kernel).enumerate() {
            if let Some(p) = finite.get(i) {
                let others = finite.iter().enumerate().filter(|(j, _)| *j != i);
                let scale: f64 = others.map(|(_, q)| p - q).product();
                for (power, tap) in taps.iter().enumerate() {
                    row[*tap] = p.powi(power as i32) / scale;
                }
            } else if i == finite.len() {
                // Infinity, where only the highest power counts.
                row[self.kernel - 1] = 1.0;
            } else {
                row[1] = 1.0;
            }
        }
        matrix
    }

    /// The filters (outputs x inputs x kernel x kernel, by `at`) at the tile's points of `row`,
    /// packed for the product: a matrix inputs x outputs for every place of that row.
    ///
    /// # Errors
    /// When there is no memory for them.
    pub fn transform_filters(
        &self,
        row: usize,
        lanes: usize,
        [outputs, inputs]: [usize; 2],
        at: impl Fn(usize, usize, usize, usize) -> f32,
    ) -> Result<Vec<Panels>> {
        let matrix = self.filter_transform();
        let of = |place: usize| &matrix[place * self.kernel..][..self.kernel];
        let mut places = (0..self.side)
            .map(|_| Panels::zeros(lanes, inputs, outputs))
            .collect::<Result<Vec<_>>>()?;
        // Taps of a column of the filter, input by input.
        let mut taps = vec![0.0; self.kernel * inputs];
        for output in 0..outputs {
            for (kx, taps) in taps.chunks_exact_mut(inputs).enumerate() {
                for (input, tap) in taps.iter_mut().enumerate() {
                    let column = of(row).iter().enumerate();
                    *tap = column
                        .map(|(ky, y)| y * f64::from(at(output, input, ky, kx)))
                        .sum();
                }
            }
            for (place, panels) in places.iter_mut().enumerate() {
                for (input, value) in panels.column_mut(output).enumerate() {
                    let row = of(place).iter().zip(taps.chunks_exact(inputs));
                    *value = row.map(|(x, taps)| x * taps[input]).sum::<f64>() as f32;
                }
            }
        }
        Ok(places)
    }
}

/// A convolution by tiles.
pub(crate) struct Winograd<'a> {
    /// Transformed filters, a place of the tile after the other.
    pub panels: &'a [Panels],
    pub tiling: Tiling,
    /// Columns and rows of the convolution, before a pool.
    pub convolved: [usize; 2],
    pub epilogue: Epilogue<'a>,
    pub input: &'a [f32],
    /// As [`Tiling::frame`] has it.
    pub from: Map,
    pub output: &'a mut [f32],
    pub to: Map,
    /// As many values as [`Tiling::scratch`] says.
    pub scratch: &'a mut [f32],
}

/// Values from a place of the tile to the next.
struct Strides {
    source: usize,
    product: usize,
}

impl Strides {
    /// An odd number of cache lines: with a power of two, all places would fall into one set of the
    /// cache.
    fn new(block: usize, channels: usize, lanes: usize) -> Self {
        let odd = |numbers: usize| (numbers.div_ceil(LINE) | 1) * LINE;
        Self {
            source: odd(block * channels),
            product: odd(block * WIDE * lanes),
        }
    }
}

impl SimdOp for Winograd<'_> {
    type Output = ();

    #[inline(always)]
    fn eval<I: Isa>(self, isa: I) {
        with_rows!(isa, ROWS => {
            let Tiling { side, outputs, .. } = self.tiling;
            match (side, outputs, self.epilogue.scale.is_some()) {
                (6, 4, false) => self.run::<I, ROWS, 6, 4, false>(isa),
                (6, 4, true) => self.run::<I, ROWS, 6, 4, true>(isa),
                (6, 2, false) => self.run::<I, ROWS, 6, 2, false>(isa),
                (6, 2, true) => self.run::<I, ROWS, 6, 2, true>(isa),
                (9, 4, false) => self.run::<I, ROWS, 9, 4, false>(isa),
                _ => unreachable!("no transform for tiles of {side} x {side}"),
            }
        });
    }
}

/// Consecutive tiles, row by row.
#[derive(Clone, Copy)]
struct Block {
    first: usize,
    count: usize,
    /// Tiles of a row.
    across: usize,
}

impl Block {
    /// Column and row of a tile.
    fn place(&self, tile: usize) -> [usize; 2] {
        let tile = self.first + tile;
        [tile % self.across, tile / self.across]
    }
}

impl Winograd<'_> {
    #[inline(always)]
    fn run<I: Isa, const ROWS: usize, const SIDE: usize, const M: usize, const POOL: bool>(
        mut self,
        isa: I,
    ) {
        let lanes = isa.f32().len();
        let inputs = self.from.channels;
        let outputs = self.to.channels;
        let tiling = self.tiling;
        let [across, down] = tiling.tiles(POOL, self.convolved);
        let (block, needed) = tiling.scratch(lanes, inputs, across * down);
        let strides = Strides::new(block, inputs, lanes);
        let framed = self.from.framed();
        assert!(framed[0] >= tiling.reach(across) && framed[1] >= tiling.reach(down));
        assert!(self.input.len() >= self.from.len() && self.output.len() >= self.to.len());
        assert!(self.scratch.len() >= needed);
        assert!(inputs.is_multiple_of(lanes) && outputs.is_multiple_of(lanes));
        assert_eq!([tiling.side, tiling.outputs], [SIDE, M]);
        assert_eq!(self.panels.len(), tiling.places());
        for panels in self.panels {
            assert_eq!([panels.steps(), panels.columns()], [inputs, outputs]);
        }
        assert_eq!(self.epilogue.bias.len(), outputs);
        assert!(
            self.epilogue
                .scale
                .is_none_or(|scale| scale.len() == outputs)
        );
        let expected = self
            .convolved
            .map(|side| if POOL { pooled(side) } else { side });
        assert_eq!(self.to.size, expected);
        let tiles = across * down;
        for first in (0..tiles).step_by(block) {
            let block = Block {
                first,
                count: block.min(tiles - first),
                across,
            };
            // SAFETY: the sizes are asserted above.
            unsafe {
                self.transform_input::<I, SIDE>(isa, block, &strides);
                let mut first = 0;
                while first + WIDE * lanes <= outputs {
                    self.product::<I, ROWS, WIDE>(isa, block, &strides, first);
                    self.transform_output::<I, SIDE, M, WIDE, POOL>(isa, block, &strides, first);
                    first += WIDE * lanes;
                }
                if first < outputs {
                    self.product::<I, ROWS, 1>(isa, block, &strides, first);
                    self.transform_output::<I, SIDE, M, 1, POOL>(isa, block, &strides, first);
                }
            }
        }
    }

    /// Places x tiles x channels.
    #[cfg_attr(target_arch = "wasm32", inline(never))]
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    unsafe fn transform_input<I: Isa, const SIDE: usize>(
        &mut self,
        isa: I,
        block: Block,
        strides: &Strides,
    ) {
        let ops = isa.f32();
        let lanes = ops.len();
        let channels = self.from.channels;
        let pitch = self.from.pitch();
        let step = self.tiling.outputs * self.tiling.stride;
        for tile in 0..block.count {
            let [x, y] = block.place(tile).map(|place| place * step);
            for channel in (0..channels).step_by(lanes) {
                // SAFETY: `run` asserts that the frame holds all tiles, and scratch a block of
                // them.
                unsafe {
                    let from = self.input.as_ptr().add(y * pitch + x * channels + channel);
                    let to = self.scratch.as_mut_ptr().add(tile * channels + channel);
                    let steps = [pitch, channels, strides.source];
                    transform_to::<I, Inputs, SIDE, SIDE>(isa, from, to, steps);
                }
            }
        }
    }

    /// Places x tiles x N vectors of outputs, from `first` on.
    #[cfg_attr(target_arch = "wasm32", inline(never))]
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    unsafe fn product<I: Isa, const ROWS: usize, const N: usize>(
        &mut self,
        isa: I,
        block: Block,
        strides: &Strides,
        first: usize,
    ) {
        let lanes = isa.f32().len();
        let channels = self.from.channels;
        let (source, product) = self
            .scratch
            .split_at_mut(self.tiling.places() * strides.source);
        for (place, panels) in self.panels.iter().enumerate() {
            let panel = Packed {
                start: panels.panel(first).as_ptr(),
                width: N * lanes,
            };
            for tile in (0..block.count).step_by(ROWS) {
                // SAFETY: scratch holds a block, which is a multiple of ROWS tiles; what is
                // computed for tiles behind the last one is never looked at.
                unsafe {
                    let left = Left {
                        start: source
                            .as_ptr()
                            .add(place * strides.source + tile * channels),
                        row: channels,
                        step: 1,
                    };
                    let to = product
                        .as_mut_ptr()
                        .add(place * strides.product + tile * N * lanes);
                    multiply_to::<I, ROWS, N>(isa, left, panel, channels, to);
                }
            }
        }
    }

    /// Results of N vectors of outputs, from `first` on.
    #[cfg_attr(target_arch = "wasm32", inline(never))]
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    unsafe fn transform_output<
        I: Isa,
        const SIDE: usize,
        const M: usize,
        const N: usize,
        const POOL: bool,
    >(
        &mut self,
        isa: I,
        block: Block,
        strides: &Strides,
        first: usize,
    ) {
        let ops = isa.f32();
        let lanes = ops.len();
        let before = usize::from(POOL);
        let floor = ops.splat(self.epilogue.floor);
        let lowest = ops.splat(f32::NEG_INFINITY);
        let product = &self.scratch[SIDE * SIDE * strides.source..];
        for tile in 0..block.count {
            let place = block.place(tile);
            // Cells of the tile that the convolution has.
            let skipped = place.map(|p| before.saturating_sub(p));
            let held = [0, 1].map(|axis| (self.convolved[axis] + before - place[axis] * M).min(M));
            let whole = skipped == [0; 2] && held == [M; 2];
            for i in 0..N {
                let channel = first + i * lanes;
                // SAFETY: scratch holds the block's products; cells are written only where `run`
                // asserts that they are.
                unsafe {
                    let from = product.as_ptr().add((tile * N + i) * lanes);
                    let mut cells = [[ops.zero(); M]; M];
                    transform::<I, Outputs, SIDE, M>(
                        isa,
                        from,
                        [SIDE * strides.product, strides.product],
                        #[inline(always)]
                        |row, values| cells[row] = values,
                    );
                    let bias = ops.load_ptr(self.epilogue.bias.as_ptr().add(channel));
                    if POOL {
                        if !whole {
                            for (row, cells) in cells.iter_mut().enumerate() {
                                for (column, cell) in cells.iter_mut().enumerate() {
                                    let inside = row >= skipped[1]
                                        && row < held[1]
                                        && column >= skipped[0]
                                        && column < held[0];
                                    if !inside {
                                        *cell = lowest;
                                    }
                                }
                            }
                        }
                        let scale = self
                            .epilogue
                            .scale
                            .map_or(lowest, |scale| ops.load_ptr(scale.as_ptr().add(channel)));
                        for row in 0..M / 2 {
                            for column in 0..M / 2 {
                                let at = [place[0] * M / 2 + column, place[1] * M / 2 + row];
                                if whole || (at[0] < self.to.size[0] && at[1] < self.to.size[1]) {
                                    // Not by `map`, whose closure is not always inlined, and then
                                    // runs without the vectors of the instruction set.
                                    let (up, down) = (&cells[2 * row], &cells[2 * row + 1]);
                                    let (left, right) = (2 * column, 2 * column + 1);
                                    let value = larger(
                                        isa,
                                        larger(isa, up[left], up[right]),
                                        larger(isa, down[left], down[right]),
                                    );
                                    let value = larger(isa, floor, ops.mul_add(scale, value, bias));
                                    let to = self.output.as_mut_ptr();
                                    ops.store_ptr(
                                        value,
                                        to.add(self.to.at(at[0], at[1]) + channel),
                                    );
                                }
                            }
                        }
                    } else {
                        let to = self.output.as_mut_ptr();
                        let to = to.add(self.to.at(place[0] * M, place[1] * M) + channel);
                        for (row, cells) in cells.iter().enumerate() {
                            for (column, cell) in cells.iter().enumerate() {
                                if whole || (row < held[1] && column < held[0]) {
                                    let value = larger(isa, floor, ops.add(*cell, bias));
                                    let to =
                                        to.add(row * self.to.pitch() + column * self.to.channels);
                                    ops.store_ptr(value, to);
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}
