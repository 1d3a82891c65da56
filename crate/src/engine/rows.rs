//! Convolutions of 7 x 7 filters with stride 1 by Winograd's algorithm along rows: 4 outputs side by
//! side cost 10 products for every row of the filter instead of 28.
//!
//! The products of a filter's rows and channels are summed up before they are transformed back, so
//! that the algorithm pays with few channels as well, where tiles of two axes would spend more on
//! their transforms than they save. The channels of a column of cells lie one after the other, row
//! by row, so that the taps of a filter's column are one run of values.

use rten_simd::ops::{BitOps, NumOps};
use rten_simd::{Isa, SimdOp};

use super::buffer::LINE;
use super::gemm::{Left, Packed, Panels, WIDE, multiply_to, tile_rows, with_rows};
use super::map::Map;
use super::simd::larger;
use crate::error::Result;

/// Side of the filters.
pub(super) const KERNEL: usize = 7;
/// Outputs of a tile.
pub(super) const OUTPUTS: usize = 4;
/// Cells of a tile, and places of its transform.
pub(super) const PLACES: usize = OUTPUTS + KERNEL - 1;

/// The points at which the polynomials of tiles are evaluated are these and their negatives, then 0
/// and infinity. Of sets with two more powers of 2 or their neighbours, this one rounds least.
const POINTS: [f64; 4] = [0.5, 0.75, 1.0, 2.0];

/// Coefficients of the even powers of `prod (x² - p²)` over all points but one; that of the highest
/// power is 1.
const fn coefficients(left_out: usize) -> [f32; POINTS.len() + 1] {
    let mut product = [0.0f64; POINTS.len() + 1];
    product[0] = 1.0;
    let mut i = 0;
    while i < POINTS.len() {
        if i != left_out {
            let mut power = POINTS.len();
            while power > 0 {
                product[power] = product[power - 1] - POINTS[i] * POINTS[i] * product[power];
                power -= 1;
            }
            product[0] *= -POINTS[i] * POINTS[i];
        }
        i += 1;
    }
    let mut result = [0.0; POINTS.len() + 1];
    let mut power = 0;
    while power < result.len() {
        result[power] = product[power] as f32;
        power += 1;
    }
    result
}

/// [`coefficients`] without one of the points.
const OTHERS: [[f32; POINTS.len() + 1]; POINTS.len()] = [
    coefficients(0),
    coefficients(1),
    coefficients(2),
    coefficients(3),
];
/// [`coefficients`] of all points.
const ALL: [f32; POINTS.len() + 1] = coefficients(POINTS.len());

/// Values of a band of transformed rows: half of a common second-level cache.
const BAND: usize = 128 * 1024;

/// Tiles that are multiplied before they are transformed back, in tiles of the product.
const GROUP: usize = 4;

/// What the taps of a filter's row become: a factor a tap for every place.
fn filter_transform() -> [[f64; KERNEL]; PLACES] {
    let finite: [f64; PLACES - 1] = std::array::from_fn(|place| match POINTS.get(place / 2) {
        Some(point) if place % 2 == 0 => *point,
        Some(point) => -point,
        None => 0.0,
    });
    let mut matrix = [[0.0; KERNEL]; PLACES];
    for (i, (point, row)) in finite.iter().zip(&mut matrix).enumerate() {
        let others = finite.iter().enumerate().filter(|(j, _)| *j != i);
        let scale: f64 = others.map(|(_, other)| point - other).product();
        for (power, factor) in row.iter_mut().enumerate() {
            *factor = point.powi(power as i32) / scale;
        }
    }
    // Infinity, where only the highest power counts.
    matrix[PLACES - 1][KERNEL - 1] = 1.0;
    matrix
}

/// The filters (outputs x inputs x rows x columns, by `at`), packed for the product: a matrix (rows
/// x inputs) x outputs for every place.
///
/// # Errors
/// When there is no memory for them.
pub(super) fn transform_filters(
    lanes: usize,
    [outputs, inputs]: [usize; 2],
    at: impl Fn(usize, usize, usize, usize) -> f32,
) -> Result<Vec<Panels>> {
    let place = |factors: [f64; KERNEL]| {
        Panels::new(lanes, KERNEL * inputs, outputs, |step, output| {
            let tap = |kx| f64::from(at(output, step % inputs, step / inputs, kx));
            let row = factors.iter().enumerate();
            row.map(|(kx, factor)| factor * tap(kx)).sum::<f64>() as f32
        })
    };
    filter_transform().into_iter().map(place).collect()
}

/// Tiles of a row of `columns` results.
pub(super) fn tiles(columns: usize) -> usize {
    columns.div_ceil(OUTPUTS)
}

/// Columns and rows behind an input of `size` that has `padding` in front of it and gives
/// `convolved` results.
pub(super) fn behind(padding: usize, size: [usize; 2], convolved: [usize; 2]) -> [usize; 2] {
    let reach = [
        tiles(convolved[0]) * OUTPUTS + KERNEL - 1,
        convolved[1] + KERNEL - 1,
    ];
    [0, 1].map(|axis| reach[axis].saturating_sub(padding + size[axis]))
}

/// Values that are readable behind an input, since whole vectors are read.
pub(super) fn slack(lanes: usize) -> usize {
    lanes
}

/// How a convolution goes through in bands of rows.
struct Bands {
    /// Rows of results.
    rows: usize,
    /// Values from a tile to the next.
    tile: usize,
    /// Values from a place to the next, in the transformed input and in the products.
    places: [usize; 2],
}

impl Bands {
    fn new(lanes: usize, channels: usize, [columns, rows]: [usize; 2]) -> Self {
        // Whole tiles of the product.
        let tiles = tiles(columns).next_multiple_of(tile_rows(lanes));
        let fitting = (BAND / (PLACES * tiles * channels)).saturating_sub(KERNEL - 1);
        // Equal bands, each of which transforms the rows that it shares with the next.
        let bands = rows.div_ceil(fitting.clamp(KERNEL.min(rows), rows));
        let rows = rows.div_ceil(bands);
        let tile = (rows + KERNEL - 1) * channels;
        // Whole vectors are written. An odd number of cache lines: with a power of two, all places
        // would fall into one set of the cache.
        let odd = |values: usize| (values.div_ceil(LINE) | 1) * LINE;
        let group = GROUP * tile_rows(lanes) * WIDE * lanes;
        Self {
            rows,
            tile,
            places: [odd(tiles * tile + lanes), odd(group)],
        }
    }

    fn scratch(&self) -> usize {
        PLACES * (self.places[0] + self.places[1])
    }
}

/// Values that a convolution needs besides input and output.
pub(super) fn scratch(lanes: usize, channels: usize, convolved: [usize; 2]) -> usize {
    Bands::new(lanes, channels, convolved).scratch()
}

/// A convolution by tiles of a row, and what is done to its sums.
pub(super) struct Rows<'a> {
    /// What [`transform_filters`] gives.
    pub panels: &'a [Panels],
    /// Added to the sums, one value an output.
    pub bias: &'a [f32],
    /// What results below are raised to: 0 for a ReLU.
    pub floor: f32,
    pub input: &'a [f32],
    /// Framed by the padding, and as [`behind`] has it.
    pub from: Map,
    pub output: &'a mut [f32],
    pub to: Map,
    /// As many values as [`scratch`] says.
    pub scratch: &'a mut [f32],
}

/// Rows `top..top + rows` of the results.
#[derive(Clone, Copy)]
struct Band {
    top: usize,
    rows: usize,
}

/// Tiles of a row.
#[derive(Clone, Copy)]
struct Group {
    row: usize,
    first: usize,
    count: usize,
}

impl SimdOp for Rows<'_> {
    type Output = ();

    #[inline(always)]
    fn eval<I: Isa>(mut self, isa: I) {
        let lanes = isa.f32().len();
        let channels = self.from.channels;
        let outputs = self.to.channels;
        let [width, height] = self.to.size;
        let bands = Bands::new(lanes, channels, self.to.size);
        let [columns, rows] = self.from.framed();
        assert!(tiles(width) * OUTPUTS + KERNEL - 1 <= columns);
        assert!(height + KERNEL - 1 <= rows);
        assert!(self.input.len() >= self.from.len() + slack(lanes));
        assert!(self.output.len() >= self.to.len());
        assert!(self.scratch.len() >= bands.scratch());
        assert_eq!([self.bias.len(), outputs % lanes], [outputs, 0]);
        assert_eq!(self.panels.len(), PLACES);
        for panels in self.panels {
            assert_eq!(
                [panels.steps(), panels.columns()],
                [KERNEL * channels, outputs]
            );
        }
        with_rows!(isa, ROWS => {
            for top in (0..height).step_by(bands.rows) {
                let band = Band {
                    top,
                    rows: bands.rows.min(height - top),
                };
                // SAFETY: the sizes are asserted above.
                unsafe {
                    self.transform_input(isa, band, &bands);
                    let mut first = 0;
                    while first + WIDE * lanes <= outputs {
                        self.results::<I, ROWS, WIDE>(isa, band, &bands, first);
                        first += WIDE * lanes;
                    }
                    if first < outputs {
                        self.results::<I, ROWS, 1>(isa, band, &bands, first);
                    }
                }
            }
        });
    }
}

impl Rows<'_> {
    /// Places x tiles x rows x channels.
    #[cfg_attr(target_arch = "wasm32", inline(never))]
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    unsafe fn transform_input<I: Isa>(&mut self, isa: I, band: Band, bands: &Bands) {
        let ops = isa.f32();
        let lanes = ops.len();
        let channels = self.from.channels;
        let pitch = self.from.pitch();
        for tile in 0..tiles(self.to.size[0]) {
            for row in 0..band.rows + KERNEL - 1 {
                // Vectors that reach beyond the last channel are written in order, so that what
                // follows the channels is right in the end.
                for channel in (0..channels).step_by(lanes) {
                    // SAFETY: `eval` asserts that input and scratch hold all tiles and the slack
                    // behind them.
                    unsafe {
                        let from = self
                            .input
                            .as_ptr()
                            .add((band.top + row) * pitch + tile * OUTPUTS * channels + channel);
                        let to = self
                            .scratch
                            .as_mut_ptr()
                            .add(tile * bands.tile + row * channels + channel);
                        let mut cells = [ops.zero(); PLACES];
                        for (column, cell) in cells.iter_mut().enumerate() {
                            *cell = ops.load_ptr(from.add(column * channels));
                        }
                        for (place, value) in points(isa, cells).into_iter().enumerate() {
                            ops.store_ptr(value, to.add(place * bands.places[0]));
                        }
                    }
                }
            }
        }
    }

    /// N vectors of outputs, from `first` on, of the cells of a band.
    #[inline(always)]
    unsafe fn results<I: Isa, const ROWS: usize, const N: usize>(
        &mut self,
        isa: I,
        band: Band,
        bands: &Bands,
        first: usize,
    ) {
        let across = tiles(self.to.size[0]);
        for row in 0..band.rows {
            for tile in (0..across).step_by(GROUP * ROWS) {
                let group = Group {
                    row,
                    first: tile,
                    count: (across - tile).min(GROUP * ROWS),
                };
                // SAFETY: the caller's promise.
                unsafe {
                    self.product::<I, ROWS, N>(isa, group, bands, first);
                    self.transform_output::<I, N>(isa, band, group, bands, first);
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
        group: Group,
        bands: &Bands,
        first: usize,
    ) {
        let lanes = isa.f32().len();
        let channels = self.from.channels;
        let (source, product) = self.scratch.split_at_mut(PLACES * bands.places[0]);
        for (place, panels) in self.panels.iter().enumerate() {
            let panel = Packed {
                start: panels.panel(first).as_ptr(),
                width: N * lanes,
            };
            for tile in (0..group.count).step_by(ROWS) {
                // SAFETY: scratch holds whole tiles of the product; what is computed for tiles
                // behind the last one is never looked at.
                unsafe {
                    let left = Left {
                        start: source.as_ptr().add(
                            place * bands.places[0]
                                + (group.first + tile) * bands.tile
                                + group.row * channels,
                        ),
                        row: bands.tile,
                        step: 1,
                    };
                    let to = product
                        .as_mut_ptr()
                        .add(place * bands.places[1] + tile * N * lanes);
                    multiply_to::<I, ROWS, N>(isa, left, panel, KERNEL * channels, to);
                }
            }
        }
    }

    /// Results of N vectors of outputs, from `first` on.
    #[cfg_attr(target_arch = "wasm32", inline(never))]
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    unsafe fn transform_output<I: Isa, const N: usize>(
        &mut self,
        isa: I,
        band: Band,
        group: Group,
        bands: &Bands,
        first: usize,
    ) {
        let ops = isa.f32();
        let lanes = ops.len();
        let floor = ops.splat(self.floor);
        let product = &self.scratch[PLACES * bands.places[0]..];
        for tile in 0..group.count {
            let column = (group.first + tile) * OUTPUTS;
            let held = self.to.size[0] - column;
            for i in 0..N {
                let channel = first + i * lanes;
                // SAFETY: scratch holds the products of the group; cells are written only where
                // `eval` asserts that they are.
                unsafe {
                    let from = product.as_ptr().add((tile * N + i) * lanes);
                    let mut places = [ops.zero(); PLACES];
                    for (place, value) in places.iter_mut().enumerate() {
                        *value = ops.load_ptr(from.add(place * bands.places[1]));
                    }
                    let bias = ops.load_ptr(self.bias.as_ptr().add(channel));
                    let to = self
                        .output
                        .as_mut_ptr()
                        .add(self.to.at(column, band.top + group.row) + channel);
                    for (column, cell) in cells(isa, places).into_iter().enumerate() {
                        if column < held {
                            let value = larger(isa, floor, ops.add(cell, bias));
                            ops.store_ptr(value, to.add(column * self.to.channels));
                        }
                    }
                }
            }
        }
    }
}

/// The input transform.
#[inline(always)]
fn points<I: Isa>(isa: I, d: [I::F32; PLACES]) -> [I::F32; PLACES] {
    let ops = isa.f32();
    let scaled = |factor: f32, value, sum| ops.mul_add(ops.splat(factor), value, sum);
    let mut points = d;
    for (pair, others) in OTHERS.iter().enumerate() {
        let [mut even, mut odd] = [d[8], d[7]];
        for power in 0..3 {
            even = scaled(others[power], d[2 * power + 2], even);
            odd = scaled(others[power], d[2 * power + 1], odd);
        }
        let point = POINTS[pair] as f32;
        points[2 * pair] = scaled(point, odd, even);
        points[2 * pair + 1] = scaled(-point, odd, even);
    }
    let [mut zero, mut infinity] = [d[8], d[9]];
    for power in 0..4 {
        zero = scaled(ALL[power], d[2 * power], zero);
        infinity = scaled(ALL[power], d[2 * power + 1], infinity);
    }
    points[8] = zero;
    points[9] = infinity;
    points
}

/// The output transform: result i is the sum of a point's product times the point to the power of
/// i, and the last one has infinity's as well.
#[inline(always)]
fn cells<I: Isa>(isa: I, m: [I::F32; PLACES]) -> [I::F32; OUTPUTS] {
    let ops = isa.f32();
    let mut cells = [m[8], ops.zero(), ops.zero(), m[9]];
    for (pair, point) in POINTS.iter().enumerate() {
        let even = ops.add(m[2 * pair], m[2 * pair + 1]);
        let odd = ops.sub(m[2 * pair], m[2 * pair + 1]);
        let point = *point as f32;
        cells[0] = ops.add(cells[0], even);
        cells[1] = ops.mul_add(ops.splat(point), odd, cells[1]);
        cells[2] = ops.mul_add(ops.splat(point * point), even, cells[2]);
        cells[3] = ops.mul_add(ops.splat(point * point * point), odd, cells[3]);
    }
    cells
}
