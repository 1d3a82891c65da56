//! Files of any size, of which JavaScript reads what is asked for.

use std::cell::RefCell;
use std::collections::{HashMap, VecDeque};
use std::sync::{Mutex, PoisonError};

use js_sys::{Function, Uint8Array};
use wasm_bindgen::prelude::*;

use crate::error::{Error, Result};

/// What is read at once where less is asked for: the structures of a file lie close together.
const BLOCK: u64 = 1 << 16;
/// So many blocks are kept.
const KEPT: usize = 32;

thread_local! {
    /// What reads each open file. A value of JavaScript stays in its thread.
    static READERS: RefCell<HashMap<u32, Function>> = RefCell::default();
}

/// A function that reads, as a value that may go to other threads, in which it reads nothing.
pub struct Reader(u32);

impl Reader {
    pub fn new(read: Function) -> Self {
        Self(READERS.with_borrow_mut(|readers| {
            let id = readers.keys().max().map_or(0, |last| last + 1);
            readers.insert(id, read);
            id
        }))
    }

    /// What it gives for two numbers; `None` where it fails.
    pub fn call(&self, first: f64, second: f64) -> Option<Vec<u8>> {
        let read = READERS.with_borrow(|readers| readers.get(&self.0).cloned())?;
        let bytes = read.call2(&JsValue::NULL, &first.into(), &second.into());
        let bytes: Uint8Array = bytes.ok()?.dyn_into().ok()?;
        Some(bytes.to_vec())
    }
}

impl Drop for Reader {
    fn drop(&mut self) {
        READERS.with_borrow_mut(|readers| readers.remove(&self.0));
    }
}

/// An open file.
pub struct Slices {
    reader: Reader,
    size: u64,
    /// The blocks that were read last, each with its number, the newest at the end.
    blocks: Mutex<VecDeque<(u64, Vec<u8>)>>,
}

impl Slices {
    /// A file of `size` bytes; `read(start, length)` gives some of them.
    pub fn new(read: Function, size: u64) -> Self {
        Self {
            reader: Reader::new(read),
            size,
            blocks: Mutex::default(),
        }
    }

    pub fn size(&self) -> u64 {
        self.size
    }

    /// The `length` bytes from `start` on.
    ///
    /// # Errors
    /// When they cannot be read.
    pub fn range(&self, start: u64, length: usize) -> Result<Vec<u8>> {
        let (block, from) = (start / BLOCK, (start % BLOCK) as usize);
        match from + length <= BLOCK as usize {
            true => self.within(block, from, length),
            false => self.read(start, length as u64),
        }
    }

    fn read(&self, start: u64, length: u64) -> Result<Vec<u8>> {
        let bytes = self.reader.call(start as f64, length as f64);
        let bytes = bytes.filter(|bytes| bytes.len() as u64 == length);
        bytes.ok_or_else(|| {
            Error::input(format!(
                "{length} bytes from {start} on cannot be read; is the file still there?"
            ))
        })
    }

    /// A part of one block.
    fn within(&self, block: u64, from: usize, length: usize) -> Result<Vec<u8>> {
        let mut blocks = self.blocks.lock().unwrap_or_else(PoisonError::into_inner);
        let place = blocks.iter().position(|(number, _)| *number == block);
        let kept = match place.and_then(|place| blocks.remove(place)) {
            Some(kept) => kept,
            None => {
                let start = block * BLOCK;
                (block, self.read(start, BLOCK.min(self.size - start))?)
            }
        };
        let part = kept.1.get(from..from + length).map(<[u8]>::to_vec);
        blocks.push_back(kept);
        if blocks.len() > KEPT {
            blocks.pop_front();
        }
        part.ok_or_else(|| Error::input("the file ends before what it declares"))
    }
}
