//! How a feature map lies in memory.

/// Rows x columns x channels, framed by as many zeros as the next layer looks beyond the border.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Map {
    /// Columns and rows without the frame.
    pub size: [usize; 2],
    /// Values per cell: channels, and zeros up to a whole number of vectors.
    pub channels: usize,
    /// Columns to the left and rows above.
    pub before: usize,
    /// Columns to the right and rows below.
    pub after: [usize; 2],
}

impl Map {
    /// A map without a frame.
    pub fn bare(size: [usize; 2], channels: usize) -> Self {
        Self {
            size,
            channels,
            before: 0,
            after: [0; 2],
        }
    }

    /// Columns and rows with the frame.
    pub fn framed(&self) -> [usize; 2] {
        [0, 1].map(|axis| self.before + self.size[axis] + self.after[axis])
    }

    /// Values from a row to the next.
    pub fn pitch(&self) -> usize {
        self.framed()[0] * self.channels
    }

    /// Values of the whole map.
    pub fn len(&self) -> usize {
        self.framed()[1] * self.pitch()
    }

    /// Where the cell (column, row) begins; the first one inside the frame is (0, 0).
    pub fn at(&self, column: usize, row: usize) -> usize {
        (row + self.before) * self.pitch() + (column + self.before) * self.channels
    }

    /// Sets the frame to 0.
    pub fn clear_frame(&self, data: &mut [f32]) {
        let [width, height] = self.size;
        let data = &mut data[..self.len()];
        data[..self.at(0, 0)].fill(0.0);
        for row in 1..height {
            data[self.at(width, row - 1)..self.at(0, row)].fill(0.0);
        }
        data[self.at(width, height - 1)..].fill(0.0);
    }
}
