//! Max-pool over 2 x 2 cells with stride 2 and a border one cell wide, and its gradient.
//!
//! Rows are copied between columns of -inf, so that every cell has four values.

use rayon::prelude::*;

use super::buffer::{Output, vectorised, with_scratch};
use crate::engine::pool::{pooled, window};

/// The largest value of every cell; a NaN counts as the largest.
pub(super) fn max_pool(input: &[f32], [height, width]: [usize; 2]) -> Vec<f32> {
    let columns = pooled(width);
    let size = pooled(height) * columns;
    let len = input.len() / (height * width) * size;
    let mut output = Output::new(len);
    output
        .uninit()
        .par_chunks_exact_mut(size)
        .zip(input.par_chunks_exact(height * width))
        .for_each(|(output, input)| {
            with_scratch([2 * columns; 2], |[upper, lower]| {
                for (row, line) in output.chunks_exact_mut(columns).enumerate() {
                    frame([&mut *upper, &mut *lower], input, width, row);
                    vectorised(
                        #[inline(always)]
                        || {
                            for ((cell, a), b) in
                                line.iter_mut().zip(pairs(&*upper)).zip(pairs(&*lower))
                            {
                                cell.write(larger(larger(a[0], a[1]), larger(b[0], b[1])));
                            }
                        },
                    );
                }
            });
        });
    // SAFETY: the maps are all there is, and each was written.
    unsafe { output.into_vec(len) }
}

/// The gradient of the input: a cell's goes to the first of its largest values.
pub(super) fn gradient(input: &[f32], [height, width]: [usize; 2], gradient: &[f32]) -> Vec<f32> {
    let columns = pooled(width);
    let size = pooled(height) * columns;
    let mut output = Output::new(input.len());
    let pieces = output.pieces();
    input
        .par_chunks_exact(height * width)
        .zip(gradient.par_chunks_exact(size))
        .enumerate()
        .for_each(|(map, (input, gradient))| {
            with_scratch([2 * columns; 2], |[upper, lower]| {
                for (row, line) in gradient.chunks_exact(columns).enumerate() {
                    frame([&mut *upper, &mut *lower], input, width, row);
                    vectorised(
                        #[inline(always)]
                        || {
                            for ((gradient, a), b) in line
                                .iter()
                                .zip(pairs_mut(&mut *upper))
                                .zip(pairs_mut(&mut *lower))
                            {
                                let below = exceeds(larger(b[0], b[1]), larger(a[0], a[1]));
                                for (pair, here) in [(a, !below), (b, below)] {
                                    let second = exceeds(pair[1], pair[0]);
                                    pair[0] = if here && !second { *gradient } else { 0.0 };
                                    pair[1] = if here && second { *gradient } else { 0.0 };
                                }
                            }
                        },
                    );
                    for (y, line) in window(row).into_iter().zip([&*upper, &*lower]) {
                        if let Some(y) = y.filter(|y| *y < height) {
                            // SAFETY: maps, and the rows of the cells of a map, do not overlap.
                            unsafe { pieces.write((map * height + y) * width, &line[1..=width]) };
                        }
                    }
                }
            });
        });
    // SAFETY: every row of every map belongs to one row of cells, and was written with it.
    unsafe { output.into_vec(input.len()) }
}

/// The two rows of a row of cells, -inf where the map ends.
fn frame(lines: [&mut [f32]; 2], map: &[f32], width: usize, row: usize) {
    for (line, y) in lines.into_iter().zip(window(row)) {
        line.fill(f32::NEG_INFINITY);
        if let Some(values) = y.and_then(|y| map.get(y * width..(y + 1) * width)) {
            line[1..=width].copy_from_slice(values);
        }
    }
}

#[inline(always)]
fn pairs(line: &[f32]) -> impl Iterator<Item = &[f32; 2]> {
    line.as_chunks().0.iter()
}

#[inline(always)]
fn pairs_mut(line: &mut [f32]) -> impl Iterator<Item = &mut [f32; 2]> {
    line.as_chunks_mut().0.iter_mut()
}

#[inline(always)]
fn exceeds(a: f32, b: f32) -> bool {
    a > b || (a.is_nan() & !b.is_nan())
}

#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if exceeds(b, a) { b } else { a }
}
