//! Convolutions and their gradients by Winograd's algorithm, with the tiles of the engine: a band
//! of an image is laid out as the engine has its maps, convolved, and laid back.

use rayon::prelude::*;
use rten_simd::ops::BitOps;
use rten_simd::{Isa, SimdOp};

use super::buffer::{Output, vectorised, with_scratch};
use super::convolution::{BAND, Convolution, GROUPS};
use super::gemm::{Product, panel_rows};
use super::layout::{Framed, scatter};
use crate::engine::epilogue::Epilogue;
use crate::engine::gemm::{Panels, lanes};
use crate::engine::map::Map;
use crate::engine::tile::{Gradients, Inputs, transform_to};
use crate::engine::winograd::{Tiling, Winograd};

/// Channels that come in or go out, below which the transforms cost more than they save.
const WORTH: usize = 16;

/// A convolution by tiles.
pub(super) struct Tiled {
    tiling: Tiling,
    batch: usize,
    /// Channels, rows and columns of the images that come in.
    source: [usize; 3],
    /// Zero rows and columns in front of them.
    padding: usize,
    /// Channels, rows and columns of the images that go out.
    output: [usize; 3],
    /// Values of a pixel in and out.
    cells: [usize; 2],
    panels: Vec<Panels>,
}

impl Tiled {
    /// The convolution of `batch` images with the filters that `at` gives by output, input, row and
    /// column; `None` where there are no tiles for it, where they are not worth it, or where there
    /// is no memory for the transformed filters.
    pub fn new(
        batch: usize,
        [source, output]: [[usize; 3]; 2],
        [kernel, stride, padding]: [usize; 3],
        at: impl Fn(usize, usize, usize, usize) -> f32 + Sync,
    ) -> Option<Self> {
        let (inputs, outputs) = (source[0], output[0]);
        let tiling = Tiling::new(kernel, stride).filter(|_| inputs.min(outputs) >= WORTH)?;
        let lanes = lanes();
        let cells = [inputs, outputs].map(|channels| channels.next_multiple_of(lanes));
        let at = |o: usize, i: usize, ky: usize, kx: usize| {
            if o < outputs && i < inputs {
                at(o, i, ky, kx)
            } else {
                0.0
            }
        };
        let rows: Vec<Vec<Panels>> = (0..tiling.side)
            .into_par_iter()
            .map(|row| {
                tiling
                    .transform_filters(row, lanes, [cells[1], cells[0]], at)
                    .ok()
            })
            .collect::<Option<_>>()?;
        Some(Self {
            tiling,
            batch,
            source,
            padding,
            output,
            cells,
            panels: rows.into_iter().flatten().collect(),
        })
    }

    /// The outputs.
    pub fn run(&self, source: &[f32]) -> Vec<f32> {
        let [channels, rows, columns] = self.output;
        let len = self.batch * channels * rows * columns;
        let mut output = Output::new(len);
        let pieces = output.pieces();
        let across = columns.div_ceil(self.tiling.outputs);
        let line = self.tiling.reach(across) * self.cells[0];
        // Tiles of a band, which should stay in the cache.
        let fitting = |tiles: &usize| self.tiling.reach(*tiles) * line <= BAND;
        let most = rows.div_ceil(self.tiling.outputs);
        let down = (1..=most).take_while(fitting).last().unwrap_or(1);
        let band = down * self.tiling.outputs;
        let bands = rows.div_ceil(band);
        let image: usize = self.source.iter().product();
        let bias = vec![0.0; self.cells[1]];
        (0..self.batch * bands).into_par_iter().for_each(|task| {
            let (index, top) = (task / bands, task % bands * band);
            let here = band.min(rows - top);
            let down = here.div_ceil(self.tiling.outputs);
            let from = Map::bare(
                [self.tiling.reach(across), self.tiling.reach(down)],
                self.cells[0],
            );
            let to = Map::bare([columns, here], self.cells[1]);
            let scratch = self.tiling.scratch(lanes(), self.cells[0], across * down).1;
            with_scratch(
                [from.len(), to.len(), scratch],
                |[framed, result, scratch]| {
                    let frame = Framed {
                        top: (top * self.tiling.stride) as isize - self.padding as isize,
                        left: self.padding,
                        columns: from.size[0],
                        cell: self.cells[0],
                    };
                    frame.copy(&source[index * image..][..image], self.source, framed);
                    Winograd {
                        panels: &self.panels,
                        tiling: self.tiling,
                        convolved: to.size,
                        epilogue: Epilogue {
                            scale: None,
                            bias: &bias,
                            floor: f32::NEG_INFINITY,
                        },
                        input: framed,
                        from,
                        output: &mut *result,
                        to,
                        scratch,
                    }
                    .dispatch();
                    vectorised(
                        #[inline(always)]
                        || {
                            let at =
                                |channel| ((index * channels + channel) * rows + top) * columns;
                            // SAFETY: tasks differ in the image or in its rows.
                            unsafe { scatter(result, self.cells[1], channels, &pieces, at) };
                        },
                    );
                },
            );
        });
        // SAFETY: the bands are all rows of all images.
        unsafe { output.into_vec(len) }
    }
}

/// Cells of a side of a tile of the inputs.
const SIDE: usize = 6;

/// Cells of a side of the tile of the gradients that goes with it.
const CELLS: usize = 4;

const PLACES: usize = SIDE * SIDE;

/// Tiles that are summed up at a time, about: what is loaded and stored for it should be little
/// compared to the sums.
const TILES: usize = 64;

/// The gradient of the weights by tiles: the inputs are transformed as they are forwards, the
/// gradients of the outputs as the transpose of the transform of the outputs, and at every place of
/// the tile the products are summed up over all tiles. The transpose of the transform of the
/// filters makes taps of the sums.
pub(super) struct TiledWeights {
    convolution: Convolution,
    tiling: Tiling,
    /// Values of a pixel of the inputs and of the gradients.
    cells: [usize; 2],
}

/// A place for the transforms of tiles: places x tiles x channels.
struct Transformed<'a> {
    values: &'a mut [f32],
    /// Tiles that it holds.
    tiles: usize,
    cell: usize,
}

impl TiledWeights {
    /// `None` where there are no tiles for it, or where they are not worth it.
    pub fn new(convolution: &Convolution) -> Option<Self> {
        let Convolution {
            kernel,
            stride,
            inputs,
            outputs,
            ..
        } = *convolution;
        // With a stride, tiles of 9 x 9 are no faster than the product of all pixels.
        let worth = kernel == 3 && stride == 1 && inputs.min(outputs) >= WORTH;
        let tiling = Tiling::new(kernel, stride).filter(|_| worth)?;
        let lanes = lanes();
        let rows = panel_rows();
        Some(Self {
            convolution: *convolution,
            tiling,
            cells: [
                inputs.next_multiple_of(lanes),
                outputs.next_multiple_of(lanes.max(rows)),
            ],
        })
    }

    /// The gradient: outputs x inputs x rows x columns.
    pub fn run(&self, input: &[f32], gradient: &[f32]) -> Vec<f32> {
        let batch = self.convolution.batch;
        let groups = batch.min(GROUPS);
        let sums: Vec<Vec<f32>> = (0..groups)
            .into_par_iter()
            .map(|group| {
                let images = group * batch / groups..(group + 1) * batch / groups;
                self.sums(images, input, gradient)
            })
            .collect();
        self.taps(&sums)
    }

    /// Sums over the tiles of some images: places x outputs x inputs.
    fn sums(&self, images: std::ops::Range<usize>, input: &[f32], gradient: &[f32]) -> Vec<f32> {
        let Convolution {
            inputs,
            outputs,
            size: [height, width],
            padding,
            ..
        } = self.convolution;
        let [rows, columns] = self.convolution.output_size();
        let [across, most] = [columns, rows].map(|side| side.div_ceil(CELLS));
        let down = TILES.div_ceil(across).min(most);
        let band = down * across;
        let tiles = band.max(TILES);
        let reach = [across, down].map(|tiles| self.tiling.reach(tiles));
        let [from, to] = self.cells;
        let mut sums = vec![0.0; PLACES * from * to];
        let lengths = [
            reach[0] * reach[1] * from,
            band * CELLS * CELLS * to,
            PLACES * tiles * from,
            PLACES * tiles * to,
        ];
        with_scratch(lengths, |[source, result, sources, results]| {
            let mut held = 0;
            for (image, top) in
                images.flat_map(|i| (0..most).step_by(down).map(move |top| (i, top)))
            {
                let here = down.min(most - top);
                let frame = Framed {
                    top: (top * CELLS) as isize - padding as isize,
                    left: padding,
                    columns: reach[0],
                    cell: from,
                };
                let image_of = |data, channels, pixels| {
                    let data: &[f32] = data;
                    &data[image * channels * pixels..][..channels * pixels]
                };
                let image = image_of(input, inputs, height * width);
                frame.copy(image, [inputs, height, width], source);
                let frame = Framed {
                    top: (top * CELLS) as isize,
                    left: 0,
                    columns: across * CELLS,
                    cell: to,
                };
                let image = image_of(gradient, outputs, rows * columns);
                frame.copy(image, [outputs, rows, columns], result);
                if held + here * across > tiles {
                    self.accumulate([sources, results], [held, tiles], &mut sums);
                    held = 0;
                }
                Transform {
                    source,
                    result,
                    to: [(&mut *sources, from), (&mut *results, to)].map(|(values, cell)| {
                        Transformed {
                            values,
                            tiles,
                            cell,
                        }
                    }),
                    columns: [reach[0], across * CELLS],
                    held,
                    across,
                    down: here,
                }
                .dispatch();
                held += here * across;
            }
            self.accumulate([sources, results], [held, tiles], &mut sums);
        });
        sums
    }

    /// Adds the products of `held` of `tiles` tiles.
    fn accumulate(
        &self,
        [sources, results]: [&[f32]; 2],
        [held, tiles]: [usize; 2],
        sums: &mut [f32],
    ) {
        if held == 0 {
            return;
        }
        let [from, to] = self.cells;
        let rows = panel_rows();
        let offsets: Vec<u32> = (0..held).map(|tile| (tile * from) as u32).collect();
        for (place, sums) in sums.chunks_exact_mut(to * from).enumerate() {
            let left = &results[place * tiles * to..][..held * to];
            for (panel, sums) in sums.chunks_exact_mut(rows * from).enumerate() {
                Product {
                    left: &left[panel * rows..],
                    left_step: to,
                    offsets: &offsets,
                    max_offset: offsets[held - 1],
                    right: &sources[place * tiles * from..],
                    output: sums,
                    stride: from,
                    width: from,
                    accumulate: true,
                }
                .dispatch();
            }
        }
    }

    /// The taps of all sums.
    fn taps(&self, groups: &[Vec<f32>]) -> Vec<f32> {
        let Convolution {
            inputs, outputs, ..
        } = self.convolution;
        let [from, to] = self.cells;
        let matrix = self.tiling.filter_transform();
        let kernel = self.tiling.kernel;
        let mut result = vec![0.0; outputs * inputs * kernel * kernel];
        result
            .par_chunks_exact_mut(inputs * kernel * kernel)
            .enumerate()
            .for_each(|(output, filters)| {
                // Sums of the groups, then rows of taps: place by place, input by input.
                let mut line = vec![0.0f64; from];
                let mut half = vec![0.0f64; kernel * SIDE * from];
                for place in 0..PLACES {
                    line.fill(0.0);
                    for sums in groups {
                        let sums = &sums[(place * to + output) * from..][..from];
                        for (sum, value) in line.iter_mut().zip(sums) {
                            *sum += f64::from(*value);
                        }
                    }
                    for ky in 0..kernel {
                        let factor = matrix[place / SIDE * kernel + ky];
                        let half = &mut half[(ky * SIDE + place % SIDE) * from..][..from];
                        for (half, sum) in half.iter_mut().zip(&line) {
                            *half += factor * sum;
                        }
                    }
                }
                for (input, filter) in filters.chunks_exact_mut(kernel * kernel).enumerate() {
                    for (tap, value) in filter.iter_mut().enumerate() {
                        let (ky, kx) = (tap / kernel, tap % kernel);
                        let row = (0..SIDE).map(|place| {
                            matrix[place * kernel + kx] * half[(ky * SIDE + place) * from + input]
                        });
                        *value = row.sum::<f64>() as f32;
                    }
                }
            });
        result
    }
}

/// The transforms of a band of tiles.
struct Transform<'a> {
    /// Rows x columns x channels of the inputs.
    source: &'a [f32],
    /// Rows x columns x channels of the gradients.
    result: &'a [f32],
    /// Transforms of the inputs and of the gradients.
    to: [Transformed<'a>; 2],
    /// Columns of `source` and `result`.
    columns: [usize; 2],
    /// Tiles that are in `to` already.
    held: usize,
    across: usize,
    down: usize,
}

impl SimdOp for Transform<'_> {
    type Output = ();

    #[inline(always)]
    fn eval<I: Isa>(self, isa: I) {
        let Self {
            across, down, held, ..
        } = self;
        let [sources, results] = self.to;
        let cells = [sources.cell, results.cell];
        let pitch = [0, 1].map(|i| self.columns[i] * cells[i]);
        let lanes = isa.f32().len();
        let reach = |tiles: usize| (tiles - 1) * CELLS + SIDE;
        assert!(self.columns[0] >= reach(across) && self.columns[1] >= across * CELLS);
        assert!(self.source.len() >= reach(down) * pitch[0]);
        assert!(self.result.len() >= down * CELLS * pitch[1]);
        for to in [&sources, &results] {
            assert!(to.cell.is_multiple_of(lanes) && held + across * down <= to.tiles);
            assert!(to.values.len() >= PLACES * to.tiles * to.cell);
        }
        for tile in 0..across * down {
            let (x, y) = (tile % across, tile / across);
            // SAFETY: the maps hold all tiles, and `to` has room for them, both of which is
            // asserted above.
            unsafe {
                let from = self
                    .source
                    .as_ptr()
                    .add(y * CELLS * pitch[0] + x * CELLS * cells[0]);
                let to = sources.values.as_mut_ptr().add((held + tile) * cells[0]);
                let steps = [pitch[0], cells[0], sources.tiles * cells[0]];
                for channel in (0..cells[0]).step_by(lanes) {
                    transform_to::<I, Inputs, SIDE, SIDE>(
                        isa,
                        from.add(channel),
                        to.add(channel),
                        steps,
                    );
                }
                let from = self
                    .result
                    .as_ptr()
                    .add(y * CELLS * pitch[1] + x * CELLS * cells[1]);
                let to = results.values.as_mut_ptr().add((held + tile) * cells[1]);
                let steps = [pitch[1], cells[1], results.tiles * cells[1]];
                for channel in (0..cells[1]).step_by(lanes) {
                    transform_to::<I, Gradients, CELLS, SIDE>(
                        isa,
                        from.add(channel),
                        to.add(channel),
                        steps,
                    );
                }
            }
        }
    }
}
