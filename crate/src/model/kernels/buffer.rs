//! Memory of the kernels: outputs that are written by several threads, and scratch that a thread keeps.

use std::cell::RefCell;
use std::marker::PhantomData;
use std::mem::MaybeUninit;

use rten_simd::{Isa, SimdOp};

/// An output that is not initialised yet, to be written in disjoint pieces by several threads.
pub(super) struct Output {
    values: Vec<f32>,
}

impl Output {
    pub fn new(len: usize) -> Self {
        Self {
            values: Vec::with_capacity(len),
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

// SAFETY: the memory is borrowed exclusively; who writes where is promised by the callers of `write`.
unsafe impl Sync for Pieces<'_> {}

impl Pieces<'_> {
    /// Copies `values` to `at`.
    ///
    /// # Safety
    /// No other thread may access these places at the same time.
    #[inline(always)]
    pub unsafe fn write(&self, at: usize, values: &[f32]) {
        assert!(at + values.len() <= self.len);
        // SAFETY: within the allocation; nobody else is there by the caller's promise.
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
            // SAFETY: within the allocation; nobody else is there by the caller's promise.
            unsafe { self.start.add(at + i * step).write(*value) };
        }
    }
}

/// Scratch of a thread; what it holds at the start of a use is left over from the last one.
#[derive(Default)]
pub(super) struct Scratch {
    first: Vec<f32>,
    second: Vec<f32>,
}

impl Scratch {
    /// Two buffers of these lengths for `work`.
    pub fn with<R>(lengths: [usize; 2], work: impl FnOnce(&mut [f32], &mut [f32]) -> R) -> R {
        thread_local! {
            static KEPT: RefCell<Scratch> = RefCell::default();
        }
        KEPT.with_borrow_mut(|Scratch { first, second }| {
            for (buffer, length) in [&mut *first, &mut *second].into_iter().zip(lengths) {
                if buffer.len() < length {
                    buffer.resize(length, 0.0);
                }
            }
            work(&mut first[..lengths[0]], &mut second[..lengths[1]])
        })
    }
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
