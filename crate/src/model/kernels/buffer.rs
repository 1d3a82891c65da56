//! Memory of the kernels: outputs that are written by several threads, tensors whose memory is used
//! again, and scratch that a thread keeps.

use std::cell::RefCell;
use std::marker::PhantomData;
use std::mem::{ManuallyDrop, MaybeUninit};
use std::ptr::NonNull;
use std::sync::{Mutex, MutexGuard, PoisonError};

use burn_std::{AccessError, AccessPolicy, AllocationController, AllocationProperty, Bytes};
use rten_simd::{Isa, SimdOp};

/// Values in a cache line.
const LINE: usize = 16;

/// An output that is not initialised yet, to be written in disjoint pieces by several threads.
pub(super) struct Output {
    values: Vec<f32>,
}

impl Output {
    pub fn new(len: usize) -> Self {
        Self {
            values: take(len).unwrap_or_else(|| Vec::with_capacity(len)),
        }
    }

    /// The memory, for who writes all of it in order.
    pub fn uninit(&mut self) -> &mut [MaybeUninit<f32>] {
        self.values.spare_capacity_mut()
    }

    pub fn pieces(&mut self) -> Pieces<'_> {
        Pieces {
            start: self.values.as_mut_ptr(),
            len: self.values.capacity(),
            memory: PhantomData,
        }
    }

    /// # Safety
    /// The first `len` values must have been written.
    pub unsafe fn into_vec(mut self, len: usize) -> Vec<f32> {
        assert!(len <= self.values.capacity());
        // SAFETY: within the capacity, and written by the caller's promise.
        unsafe { self.values.set_len(len) };
        self.values
    }
}

/// Hands out pieces of an [`Output`].
pub(super) struct Pieces<'a> {
    start: *mut f32,
    len: usize,
    memory: PhantomData<&'a mut [f32]>,
}

// SAFETY: the memory is borrowed exclusively; who writes where is promised by the callers of
// `write`.
unsafe impl Sync for Pieces<'_> {}

impl Pieces<'_> {
    /// Copies `values` to `at`.
    ///
    /// # Safety
    /// No other thread may access these places at the same time.
    #[inline(always)]
    pub unsafe fn write(&self, at: usize, values: &[f32]) {
        assert!(at + values.len() <= self.len);
        // SAFETY: within the allocation; no other thread accesses it, by the caller's promise.
        unsafe { std::ptr::copy_nonoverlapping(values.as_ptr(), self.start.add(at), values.len()) };
    }

    /// Copies `values` to every `step`-th place from `at`.
    ///
    /// # Safety
    /// As [`Self::write`].
    #[inline(always)]
    pub unsafe fn write_every(&self, at: usize, step: usize, values: &[f32]) {
        assert!(values.is_empty() || at + (values.len() - 1) * step < self.len);
        for (i, value) in values.iter().enumerate() {
            // SAFETY: within the allocation; no other thread accesses it, by the caller's promise.
            unsafe { self.start.add(at + i * step).write(*value) };
        }
    }
}

/// Memory for at least this many values comes from [`KEPT`] and goes back to it.
const LARGE: usize = 1 << 16;

/// The most values that are kept: 1 GiB.
const MOST: usize = 1 << 28;

/// Memory of tensors that are gone, oldest first. A step of training needs what the last one
/// needed, and memory from the system costs a fault and a wipe a page.
static KEPT: Mutex<Vec<Vec<f32>>> = Mutex::new(Vec::new());

fn kept() -> MutexGuard<'static, Vec<Vec<f32>>> {
    // Nothing panics half-way through a change of the list.
    KEPT.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The smallest memory for `len` values that wastes less than half.
fn take(len: usize) -> Option<Vec<f32>> {
    if len < LARGE {
        return None;
    }
    let mut kept = kept();
    let fitting = |(_, capacity): &(usize, usize)| (len..2 * len).contains(capacity);
    let (at, _) = kept
        .iter()
        .map(Vec::capacity)
        .enumerate()
        .filter(fitting)
        .min_by_key(|(_, capacity)| *capacity)?;
    Some(kept.remove(at))
}

fn give_back(mut memory: Vec<f32>) {
    if memory.capacity() < LARGE {
        return;
    }
    memory.clear();
    let mut kept = kept();
    kept.push(memory);
    let mut total: usize = kept.iter().map(Vec::capacity).sum();
    while total > MOST {
        total -= kept.remove(0).capacity();
    }
}

/// Values as the bytes of a tensor, whose memory is kept when the tensor is gone.
pub(super) fn bytes(values: Vec<f32>) -> Bytes {
    let len = size_of_val(&values[..]);
    // SAFETY: the values are the first `len` bytes.
    unsafe { Bytes::from_controller(Box::new(Kept(values)), len) }
}

/// Owns the memory of a tensor.
struct Kept(Vec<f32>);

impl Kept {
    fn size(&self) -> usize {
        self.0.capacity() * size_of::<f32>()
    }
}

impl AllocationController for Kept {
    fn alloc_align(&self) -> usize {
        align_of::<f32>()
    }

    fn property(&self) -> AllocationProperty {
        AllocationProperty::Native
    }

    unsafe fn memory_mut(
        &mut self,
        _: AccessPolicy,
    ) -> Result<&mut [MaybeUninit<u8>], AccessError> {
        // SAFETY: the allocation of the vector, borrowed with it; the caller writes initialised
        // bytes only.
        Ok(unsafe { std::slice::from_raw_parts_mut(self.0.as_mut_ptr().cast(), self.size()) })
    }

    fn memory(&self, _: AccessPolicy) -> Result<&[MaybeUninit<u8>], AccessError> {
        // SAFETY: the allocation of the vector, borrowed with it.
        Ok(unsafe { std::slice::from_raw_parts(self.0.as_ptr().cast(), self.size()) })
    }

    fn try_detach(&mut self) -> Option<NonNull<u8>> {
        let mut memory = ManuallyDrop::new(std::mem::take(&mut self.0));
        NonNull::new(memory.as_mut_ptr().cast())
    }
}

impl Drop for Kept {
    fn drop(&mut self) {
        give_back(std::mem::take(&mut self.0));
    }
}

/// Runs `work` on scratch of these lengths, each from a cache line on, that the thread keeps; it
/// holds whatever the last use left in it.
pub(super) fn with_scratch<R, const N: usize>(
    lengths: [usize; N],
    work: impl FnOnce([&mut [f32]; N]) -> R,
) -> R {
    thread_local! {
        static OWN: RefCell<Vec<f32>> = RefCell::default();
    }
    OWN.with_borrow_mut(|own| {
        let whole = lengths.map(|length| length.next_multiple_of(LINE));
        let needed = whole.iter().sum::<usize>() + LINE;
        if own.len() < needed {
            own.resize(needed, 0.0);
        }
        let mut rest = &mut own[..];
        let start = rest
            .as_ptr()
            .align_offset(LINE * size_of::<f32>())
            .min(LINE);
        rest = &mut rest[start..];
        let mut parts = lengths.into_iter().zip(whole);
        work(std::array::from_fn(|_| {
            let (length, whole) = parts.next().unwrap_or_default();
            let (part, others) = std::mem::take(&mut rest).split_at_mut(whole);
            rest = others;
            &mut part[..length]
        }))
    })
}

/// Runs `work` compiled for the best vectors of this CPU; what it calls must be inlined.
#[inline(always)]
pub(super) fn vectorised<R>(work: impl FnOnce() -> R) -> R {
    struct Work<F>(F);
    impl<R, F: FnOnce() -> R> SimdOp for Work<F> {
        type Output = R;
        #[inline(always)]
        fn eval<I: Isa>(self, _: I) -> R {
            (self.0)()
        }
    }
    Work(work).dispatch()
}
