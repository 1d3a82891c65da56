//! Convolution and its gradients on slices, in the layout of the tensors: images x channels x rows
//! x columns.
//!
//! Layers of common shapes go by tiles (`winograd`). For all others, forward and gradient of the
//! input are the same thing, a
//! [`Correlation`]: an image is copied into a frame of
//! zeros, a band of rows at a time, and every tap of the filter then is a shift of the band.
//! Columns that would wrap around the frame are computed and dropped. A stride splits the source
//! (forward) or the result (gradient) into phases, each of which is a correlation with stride 1.
//!
//! Nothing depends on how bands and images are spread over threads: each value of a result is one
//! sum in a fixed order. The gradient of the weights sums over the images as well, in a fixed
//! number of groups of images.

use rayon::prelude::*;
use rten_simd::SimdOp;

use super::buffer::{Output, Pieces, with_scratch};
use super::convolution::{BAND, Convolution, GROUPS};
use super::gemm::{Product, padded, panel_rows};
use super::layout::{Framed, interleave};
use super::winograd::{Tiled, TiledWeights};

/// Correlations with stride 1 of framed images, whose results are spread over the images of the
/// output.
struct Correlation {
    batch: usize,
    /// Channels, rows and columns of the source images.
    source: [usize; 3],
    /// Phases of the source on an axis.
    split: usize,
    /// Zero rows and columns in front of a source image.
    padding: usize,
    /// Rows and columns of a result.
    result: [usize; 2],
    /// Rows and columns that a result needs beyond its own.
    halo: usize,
    /// Rows of a result that are computed at once.
    band: usize,
    phases: Vec<Phase>,
    /// Channels, rows and columns of the output images.
    output: [usize; 3],
    /// Step on the output between neighbours of a result.
    spread: usize,
}

/// One of the results of a [`Correlation`].
struct Phase {
    /// Where a step of the sum finds its source in a band.
    offsets: Vec<u32>,
    /// The filters in panels of [`panel_rows`] outputs.
    panels: Vec<f32>,
    /// Where the first row and column of the result lie in an output image.
    start: [isize; 2],
}

impl Convolution {
    /// The outputs.
    pub fn forward(&self, input: &[f32], weight: &[f32]) -> Vec<f32> {
        let [rows, columns] = self.output_size();
        let images = [
            [self.inputs, self.size[0], self.size[1]],
            [self.outputs, rows, columns],
        ];
        let shape = [self.kernel, self.stride, self.padding];
        let tap = self.taps(weight);
        if let Some(tiled) = Tiled::new(self.batch, images, shape, tap) {
            return tiled.run(input);
        }
        let mut correlation = Correlation {
            batch: self.batch,
            source: [self.inputs, self.size[0], self.size[1]],
            split: self.stride,
            padding: self.padding,
            result: [rows, columns],
            halo: (self.kernel - 1) / self.stride,
            band: 0,
            phases: Vec::new(),
            output: [self.outputs, rows, columns],
            spread: 1,
        };
        correlation.choose_band();
        let mut offsets = Vec::with_capacity(self.inputs * self.kernel * self.kernel);
        for input in 0..self.inputs {
            for ky in 0..self.kernel {
                for kx in 0..self.kernel {
                    let phase = [ky % self.stride, kx % self.stride];
                    offsets.push(correlation.offset(
                        input,
                        phase,
                        [ky / self.stride, kx / self.stride],
                    ));
                }
            }
        }
        let steps = offsets.len();
        let panels = panels(panel_rows(), self.outputs, steps, |output, step| {
            weight[output * steps + step]
        });
        correlation.phases.push(Phase {
            offsets,
            panels,
            start: [0, 0],
        });
        correlation.run(input)
    }

    /// The gradient of the inputs.
    pub fn input_gradient(&self, weight: &[f32], gradient: &[f32]) -> Vec<f32> {
        let [rows, columns] = self.output_size();
        let tap = self.taps(weight);
        if self.stride == 1 {
            // The filters turned round, with inputs and outputs exchanged.
            let images = [
                [self.outputs, rows, columns],
                [self.inputs, self.size[0], self.size[1]],
            ];
            let last = self.kernel - 1;
            let turned = |input, output, ky, kx| tap(output, input, last - ky, last - kx);
            let shape = [self.kernel, 1, last - self.padding];
            if let Some(tiled) = Tiled::new(self.batch, images, shape, turned) {
                return tiled.run(gradient);
            }
        }
        // Taps of a phase on an axis, at most.
        let taps = self.kernel.div_ceil(self.stride);
        let mut correlation = Correlation {
            batch: self.batch,
            source: [self.outputs, rows, columns],
            split: 1,
            padding: taps - 1,
            result: self
                .size
                .map(|side| (self.padding + side - 1) / self.stride + 1),
            halo: taps - 1,
            band: 0,
            phases: Vec::new(),
            output: [self.inputs, self.size[0], self.size[1]],
            spread: self.stride,
        };
        correlation.choose_band();
        let own_taps = |phase: usize| (phase..self.kernel).step_by(self.stride);
        for py in 0..self.stride {
            for px in 0..self.stride {
                let mut offsets = Vec::new();
                let mut taps_of = Vec::new();
                for output in 0..self.outputs {
                    for (ty, ky) in own_taps(py).enumerate() {
                        for (tx, kx) in own_taps(px).enumerate() {
                            offsets.push(correlation.offset(
                                output,
                                [0, 0],
                                [taps - 1 - ty, taps - 1 - tx],
                            ));
                            taps_of.push((output, ky, kx));
                        }
                    }
                }
                let panels = panels(panel_rows(), self.inputs, taps_of.len(), |input, step| {
                    let (output, ky, kx) = taps_of[step];
                    tap(output, input, ky, kx)
                });
                correlation.phases.push(Phase {
                    offsets,
                    panels,
                    start: [py, px].map(|phase| phase as isize - self.padding as isize),
                });
            }
        }
        correlation.run(gradient)
    }

    /// The gradient of the weights.
    ///
    /// A product whose sum runs over the pixels. Channels lie next to each other here (the input is
    /// transposed), so that the taps of a row of the filter and their channels are one run of
    /// values: one row of the product.
    pub fn weight_gradient(&self, input: &[f32], gradient: &[f32]) -> Vec<f32> {
        if let Some(tiled) = TiledWeights::new(self) {
            return tiled.run(input, gradient);
        }
        let panel_rows = panel_rows();
        let [rows, columns] = self.output_size();
        let width = self.kernel * self.inputs;
        let padded = padded(width);
        let height = self.outputs.next_multiple_of(panel_rows);
        let groups = self.batch.min(GROUPS);
        let framed = (columns - 1) * self.stride + self.kernel;
        let line = framed * self.inputs;
        let band = (BAND / (self.stride * line).max(self.outputs * columns)).clamp(1, rows);
        let source = ((band - 1) * self.stride + self.kernel) * line + padded;
        let offsets: Vec<u32> = (0..band)
            .flat_map(|y| {
                (0..columns).map(move |x| ((y * line + x * self.inputs) * self.stride) as u32)
            })
            .collect();
        let image = self.inputs * self.size[0] * self.size[1];
        let pixels = rows * columns;
        let partials: Vec<Vec<f32>> = (0..groups)
            .into_par_iter()
            .map(|group| {
                let mut sums = vec![0.0; self.kernel * height * padded];
                let images = group * self.batch / groups..(group + 1) * self.batch / groups;
                with_scratch([source, height * band * columns], |[source, left]| {
                    for (index, top) in
                        images.flat_map(|i| (0..rows).step_by(band).map(move |top| (i, top)))
                    {
                        let here = band.min(rows - top);
                        let steps = here * columns;
                        let frame = Framed {
                            top: (top * self.stride) as isize - self.padding as isize,
                            left: self.padding,
                            columns: framed,
                            cell: self.inputs,
                        };
                        let rows = (here - 1) * self.stride + self.kernel;
                        let shape = [self.inputs, self.size[0], self.size[1]];
                        frame.copy(
                            &input[index * image..][..image],
                            shape,
                            &mut source[..rows * line],
                        );
                        let own =
                            &gradient[index * self.outputs * pixels..][..self.outputs * pixels];
                        for (panel, left) in
                            left.chunks_mut(band * columns * panel_rows).enumerate()
                        {
                            let channels = own.chunks_exact(pixels).skip(panel * panel_rows);
                            let rows = channels.map(|channel| &channel[top * columns..][..steps]);
                            interleave(rows, &mut left[..steps * panel_rows], panel_rows);
                        }
                        for (ky, sums) in sums.chunks_exact_mut(height * padded).enumerate() {
                            for (left, sums) in left
                                .chunks(band * columns * panel_rows)
                                .zip(sums.chunks_exact_mut(panel_rows * padded))
                            {
                                Product {
                                    left: &left[..steps * panel_rows],
                                    left_step: panel_rows,
                                    offsets: &offsets[..steps],
                                    max_offset: offsets[steps - 1],
                                    right: &source[ky * line..],
                                    output: sums,
                                    stride: padded,
                                    width,
                                    accumulate: true,
                                }
                                .dispatch();
                            }
                        }
                    }
                });
                sums
            })
            .collect();
        let mut result = vec![0.0; self.outputs * self.inputs * self.kernel * self.kernel];
        result
            .par_chunks_exact_mut(self.inputs * self.kernel * self.kernel)
            .enumerate()
            .for_each(|(output, filter)| {
                for ky in 0..self.kernel {
                    for sums in &partials {
                        let sums = &sums[(ky * height + output) * padded..][..width];
                        for (kx, sums) in sums.chunks_exact(self.inputs).enumerate() {
                            let taps = filter[ky * self.kernel + kx..].iter_mut();
                            for (tap, sum) in taps.step_by(self.kernel * self.kernel).zip(sums) {
                                *tap += sum;
                            }
                        }
                    }
                }
            });
        result
    }
}

/// A matrix in panels of `rows` rows, zeros below the last row.
fn panels(
    rows: usize,
    height: usize,
    steps: usize,
    at: impl Fn(usize, usize) -> f32 + Sync,
) -> Vec<f32> {
    let mut panels = vec![0.0; height.next_multiple_of(rows) * steps];
    if steps == 0 {
        return panels;
    }
    panels
        .par_chunks_exact_mut(rows * steps)
        .enumerate()
        .for_each(|(panel, to)| {
            for row in (0..rows).take_while(|row| panel * rows + row < height) {
                for (step, to) in to[row..].iter_mut().step_by(rows).enumerate() {
                    *to = at(panel * rows + row, step);
                }
            }
        });
    panels
}

impl Correlation {
    /// Bands that fit the cache, and enough of them for all threads.
    fn choose_band(&mut self) {
        let [channels, ..] = self.source;
        let row = channels * self.split * self.split * self.columns();
        let fitting = (BAND / row).saturating_sub(self.halo);
        let tasks = 4 * rayon::current_num_threads();
        let shared = (self.result[0] * self.batch).div_ceil(tasks);
        self.band = fitting.min(shared.max(4)).clamp(1, self.result[0]);
    }

    /// Columns of a framed phase.
    fn columns(&self) -> usize {
        self.result[1] + self.halo
    }

    /// Values of a framed phase.
    fn plane(&self) -> usize {
        (self.band + self.halo) * self.columns()
    }

    fn offset(&self, channel: usize, phase: [usize; 2], shift: [usize; 2]) -> u32 {
        let plane = (channel * self.split + phase[0]) * self.split + phase[1];
        (plane * self.plane() + shift[0] * self.columns() + shift[1]) as u32
    }

    fn run(&self, source: &[f32]) -> Vec<f32> {
        let [channels, height, width] = self.output;
        let len = self.batch * channels * height * width;
        let mut output = Output::new(len);
        let pieces = output.pieces();
        let bands = self.result[0].div_ceil(self.band);
        let [inputs, rows, columns] = self.source;
        let image = inputs * rows * columns;
        let longest = padded(self.band * self.columns());
        let framed = inputs * self.split * self.split * self.plane() + longest;
        (0..self.batch * bands).into_par_iter().for_each(|task| {
            let (index, top) = (task / bands, task % bands * self.band);
            let here = self.band.min(self.result[0] - top);
            with_scratch([framed, panel_rows() * longest], |[framed, product]| {
                self.frame(&source[index * image..][..image], top, here, framed);
                for phase in &self.phases {
                    self.multiply(phase, [index, top, here], framed, product, &pieces);
                }
            });
        });
        // SAFETY: every row and column of every output image belongs to one row of one phase, and
        // `run` went through all of them.
        unsafe { output.into_vec(len) }
    }

    fn multiply(
        &self,
        phase: &Phase,
        [index, top, here]: [usize; 3],
        framed: &[f32],
        product: &mut [f32],
        pieces: &Pieces,
    ) {
        let [channels, height, width] = self.output;
        let rows = panel_rows();
        let steps = phase.offsets.len();
        let columns = self.columns();
        let computed = (here - 1) * columns + self.result[1];
        let stride = padded(computed);
        // Results that lie within the output, on both axes.
        let first = phase.start.map(|start| {
            if start < 0 {
                start.unsigned_abs().div_ceil(self.spread)
            } else {
                0
            }
        });
        for panel in 0..channels.div_ceil(rows) {
            Product {
                left: &phase.panels[panel * rows * steps..][..rows * steps],
                left_step: rows,
                offsets: &phase.offsets,
                max_offset: phase.offsets.iter().copied().max().unwrap_or(0),
                right: framed,
                output: &mut *product,
                stride,
                width: computed,
                accumulate: false,
            }
            .dispatch();
            for row in (0..rows).take_while(|row| panel * rows + row < channels) {
                let channel = index * channels + panel * rows + row;
                for result in top.max(first[0])..top + here {
                    let y = (phase.start[0] + (result * self.spread) as isize) as usize;
                    if y >= height {
                        break;
                    }
                    let x = (phase.start[1] + (first[1] * self.spread) as isize) as usize;
                    let from = row * stride + (result - top) * columns;
                    let values = &product[from + first[1]..from + self.result[1]];
                    let values = &values[..values
                        .len()
                        .min(width.saturating_sub(x).div_ceil(self.spread))];
                    let at = (channel * height + y) * width + x;
                    // SAFETY: tasks differ in the image or in the rows of the result, phases and
                    // panels run one after the other.
                    unsafe {
                        if self.spread == 1 {
                            pieces.write(at, values);
                        } else {
                            pieces.write_every(at, self.spread, values);
                        }
                    }
                }
            }
        }
    }

    /// Copies the rows that `here` rows of the results from `top` need into phases framed by zeros.
    fn frame(&self, image: &[f32], top: usize, here: usize, framed: &mut [f32]) {
        let [channels, height, width] = self.source;
        let columns = self.columns();
        let split = self.split;
        let mut planes = framed.chunks_exact_mut(self.plane());
        for channel in image.chunks_exact(height * width).take(channels) {
            for py in 0..split {
                for px in 0..split {
                    let Some(plane) = planes.next() else { return };
                    let first = self.padding.saturating_sub(px).div_ceil(split);
                    let last = (width + self.padding).saturating_sub(px).div_ceil(split);
                    let (first, last) = (first.min(columns), last.min(columns));
                    for (i, line) in plane
                        .chunks_exact_mut(columns)
                        .take(here + self.halo)
                        .enumerate()
                    {
                        let y = ((top + i) * split + py).wrapping_sub(self.padding);
                        if y >= height || first >= last {
                            line.fill(0.0);
                            continue;
                        }
                        let row = &channel[y * width..][..width];
                        line[..first].fill(0.0);
                        line[last..].fill(0.0);
                        let from = first * split + px - self.padding;
                        let line = &mut line[first..last];
                        if split == 1 {
                            line.copy_from_slice(&row[from..from + line.len()]);
                        } else {
                            let values = row[from..].iter().step_by(split);
                            line.iter_mut()
                                .zip(values)
                                .for_each(|(to, value)| *to = *value);
                        }
                    }
                }
            }
        }
    }
}
