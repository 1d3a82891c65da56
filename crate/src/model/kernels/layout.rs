//! Between the layout of the tensors, channels x rows x columns, and rows x columns x channels.

use super::buffer::{Pieces, vectorised};

/// Channels, and pixels, that are moved at a time.
const BLOCK: usize = 8;

/// Rows of an image with zeros around it, their pixels one after the other.
#[derive(Debug, Clone, Copy)]
pub(super) struct Framed {
    /// Rows of the image above the first one that is wanted; below 0, zeros come first.
    pub top: isize,
    /// Zero columns in front of the image.
    pub left: usize,
    /// Columns with the zeros on both sides; what of the image lies beyond is left out.
    pub columns: usize,
    /// Values of a pixel: the channels, and zeros behind them.
    pub cell: usize,
}

impl Framed {
    /// Copies rows from `image`, which is channels x rows x columns, until `to` is full.
    pub fn copy(&self, image: &[f32], [channels, height, width]: [usize; 3], to: &mut [f32]) {
        vectorised(
            #[inline(always)]
            || {
                for (row, line) in to.chunks_exact_mut(self.columns * self.cell).enumerate() {
                    let y = usize::try_from(self.top + row as isize).unwrap_or(height);
                    if y >= height {
                        line.fill(0.0);
                        continue;
                    }
                    let inside = width.min(self.columns - self.left);
                    let (before, rest) = line.split_at_mut(self.left * self.cell);
                    let (pixels, after) = rest.split_at_mut(inside * self.cell);
                    before.fill(0.0);
                    after.fill(0.0);
                    let row_of = |channel| &image[(channel * height + y) * width..][..inside];
                    interleave((0..channels).map(row_of), pixels, self.cell);
                }
            },
        );
    }
}

/// Interleaves rows, of which those beyond `cell` are left out, into pixels of `cell` values; the
/// values of missing rows are 0.
#[inline(always)]
pub(super) fn interleave<'a>(
    mut rows: impl Iterator<Item = &'a [f32]>,
    pixels: &mut [f32],
    cell: usize,
) {
    let mut first = 0;
    while first < cell {
        let mut held = 0;
        let mut block: [&[f32]; BLOCK] = [&[]; BLOCK];
        while held < BLOCK.min(cell - first) {
            let Some(row) = rows.next() else { break };
            block[held] = row;
            held += 1;
        }
        if held == BLOCK {
            gather(block, pixels, cell, first);
            first += BLOCK;
            continue;
        }
        for (i, row) in block.iter().enumerate().take(held) {
            for (pixel, value) in pixels.chunks_exact_mut(cell).zip(*row) {
                pixel[first + i] = *value;
            }
        }
        if first + held < cell {
            for pixel in pixels.chunks_exact_mut(cell) {
                pixel[first + held..].fill(0.0);
            }
        }
        return;
    }
}

/// Writes rows of pixels with `cell` values each to the channels of an image in an output: channel
/// c of the pixels goes to `at(c)`, whose rows lie one after the other.
///
/// # Safety
/// As [`Pieces::write`], for all of these places.
#[inline(always)]
pub(super) unsafe fn scatter(
    pixels: &[f32],
    cell: usize,
    channels: usize,
    pieces: &Pieces,
    at: impl Fn(usize) -> usize,
) {
    let count = pixels.len() / cell;
    let whole = channels / BLOCK * BLOCK;
    for channel in (0..whole).step_by(BLOCK) {
        let mut first = 0;
        while first < count {
            let here = BLOCK.min(count - first);
            let mut block = [[0.0; BLOCK]; BLOCK];
            for (i, row) in block.iter_mut().enumerate().take(here) {
                row.copy_from_slice(&pixels[(first + i) * cell + channel..][..BLOCK]);
            }
            let block = transposed(block);
            for (i, row) in block.iter().enumerate() {
                // SAFETY: the caller's promise.
                unsafe { pieces.write(at(channel + i) + first, &row[..here]) };
            }
            first += here;
        }
    }
    for channel in whole..channels {
        let mut first = 0;
        while first < count {
            let here = BLOCK.min(count - first);
            let mut row = [0.0; BLOCK];
            for (i, value) in row.iter_mut().enumerate().take(here) {
                *value = pixels[(first + i) * cell + channel];
            }
            // SAFETY: the caller's promise.
            unsafe { pieces.write(at(channel) + first, &row[..here]) };
            first += here;
        }
    }
}

/// Interleaves a block of rows into pixels of `cell` values, from the value `first` of each on.
#[inline(always)]
fn gather(rows: [&[f32]; BLOCK], pixels: &mut [f32], cell: usize, first: usize) {
    let count = rows[0].len();
    let whole = count / BLOCK * BLOCK;
    for x in (0..whole).step_by(BLOCK) {
        let mut block = [[0.0; BLOCK]; BLOCK];
        for (values, row) in block.iter_mut().zip(rows) {
            values.copy_from_slice(&row[x..x + BLOCK]);
        }
        let block = transposed(block);
        for (i, values) in block.iter().enumerate() {
            pixels[(x + i) * cell + first..][..BLOCK].copy_from_slice(values);
        }
    }
    for x in whole..count {
        let pixel = &mut pixels[x * cell + first..][..BLOCK];
        for (value, row) in pixel.iter_mut().zip(rows) {
            *value = row[x];
        }
    }
}

/// Rows as columns. With plain loops: the functions of arrays are not inlined here.
#[inline(always)]
fn transposed(block: [[f32; BLOCK]; BLOCK]) -> [[f32; BLOCK]; BLOCK] {
    let mut result = [[0.0; BLOCK]; BLOCK];
    for (i, row) in block.iter().enumerate() {
        for (j, value) in row.iter().enumerate() {
            result[j][i] = *value;
        }
    }
    result
}
