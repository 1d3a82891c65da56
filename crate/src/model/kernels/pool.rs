//! Max-pool over 2 x 2 cells with stride 2 and a border one cell wide, and its gradient.

use rayon::prelude::*;

use super::buffer::Output;

/// Rows or columns of a pooled map.
pub(super) fn pooled(side: usize) -> usize {
    side / 2 + 1
}

/// The largest number of every cell; a NaN counts as the largest.
pub(super) fn max_pool(input: &[f32], [height, width]: [usize; 2]) -> Vec<f32> {
    let size = pooled(height) * pooled(width);
    let len = input.len() / (height * width) * size;
    let mut output = Output::new(len);
    output
        .uninit()
        .par_chunks_exact_mut(size)
        .zip(input.par_chunks_exact(height * width))
        .for_each(|(output, input)| {
            for (row, line) in output.chunks_exact_mut(pooled(width)).enumerate() {
                let [upper, lower] = rows(row, height).map(|y| y.map(|y| &input[y * width..][..width]));
                for (column, cell) in line.iter_mut().enumerate() {
                    cell.write(largest([upper, lower], column).0);
                }
            }
        });
    // SAFETY: the maps are all there is, and each was written.
    unsafe { output.into_vec(len) }
}

/// The gradient of the input: a cell's goes to the first of its largest numbers.
pub(super) fn gradient(input: &[f32], [height, width]: [usize; 2], gradient: &[f32]) -> Vec<f32> {
    let size = pooled(height) * pooled(width);
    let mut result = vec![0.0; input.len()];
    result
        .par_chunks_exact_mut(height * width)
        .zip(input.par_chunks_exact(height * width))
        .zip(gradient.par_chunks_exact(size))
        .for_each(|((result, input), gradient)| {
            for (row, line) in gradient.chunks_exact(pooled(width)).enumerate() {
                let rows = rows(row, height);
                let lines = rows.map(|y| y.map(|y| &input[y * width..][..width]));
                for (column, gradient) in line.iter().enumerate() {
                    let (_, place) = largest(lines, column);
                    if let Some(y) = rows[place / 2] {
                        result[y * width + 2 * column + place % 2 - 1] = *gradient;
                    }
                }
            }
        });
    result
}

/// The rows of the cells of a pooled row, where they lie in the map.
fn rows(row: usize, height: usize) -> [Option<usize>; 2] {
    [(2 * row).checked_sub(1), Some(2 * row).filter(|y| *y < height)]
}

/// The largest number of a cell and its place in the cell.
#[inline(always)]
fn largest(lines: [Option<&[f32]>; 2], column: usize) -> (f32, usize) {
    let mut best = (f32::NEG_INFINITY, usize::MAX);
    for (i, line) in lines.into_iter().enumerate() {
        let Some(line) = line else { continue };
        for j in 0..2 {
            let Some(value) = (2 * column + j).checked_sub(1).and_then(|x| line.get(x)) else {
                continue;
            };
            if *value > best.0 || value.is_nan() || best.1 == usize::MAX {
                best = (*value, 2 * i + j);
            }
        }
    }
    best
}
