//! Memory of the engine, aligned to cache lines.

use std::ops::{Deref, DerefMut};

use crate::error::Result;
use crate::memory;

/// Values in a cache line.
pub(super) const LINE: usize = 16;

const WHAT: &str = "weights or activations";
const ADVICE: &str = "use smaller images, fewer threads, or an encoder with fewer channels";

#[derive(Clone, Copy)]
#[repr(C, align(64))]
struct Line([f32; LINE]);

/// A slice of `f32` that starts at a cache line, so that no vector load straddles two of them, and
/// that only grows.
#[derive(Default)]
pub(super) struct Buffer {
    lines: Vec<Line>,
}

impl Buffer {
    /// Makes room for `len` values; new ones are 0.
    ///
    /// # Errors
    /// When there is no memory for them.
    pub fn grow(&mut self, len: usize) -> Result<()> {
        let lines = len.div_ceil(LINE);
        if lines > self.lines.len() {
            let more = lines - self.lines.len();
            let bytes = more.saturating_mul(size_of::<Line>()) as u64;
            memory::check(bytes, WHAT, ADVICE)?;
            memory::trying(|| self.lines.try_reserve_exact(more))
                .map_err(|_| memory::too_much(bytes, None, WHAT, ADVICE))?;
            self.lines.resize(lines, Line([0.0; LINE]));
        }
        Ok(())
    }
}

impl Deref for Buffer {
    type Target = [f32];

    fn deref(&self) -> &[f32] {
        // SAFETY: a `Line` is LINE values without padding.
        unsafe { std::slice::from_raw_parts(self.lines.as_ptr().cast(), self.lines.len() * LINE) }
    }
}

impl DerefMut for Buffer {
    fn deref_mut(&mut self) -> &mut [f32] {
        // SAFETY: as above.
        unsafe {
            std::slice::from_raw_parts_mut(self.lines.as_mut_ptr().cast(), self.lines.len() * LINE)
        }
    }
}
