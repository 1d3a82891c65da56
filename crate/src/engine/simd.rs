//! What the kernels share.

use rten_simd::Isa;
use rten_simd::ops::{BitOps, NumOps};

/// The larger of `a` and `b`; a NaN in `b` stays, so that a ReLU with `b` as its input hides none.
///
/// Maximum instructions differ in what becomes of a NaN, and wasm's costs browsers on x86 more than
/// this.
#[inline(always)]
pub(super) fn larger<I: Isa>(isa: I, a: I::F32, b: I::F32) -> I::F32 {
    let ops = isa.f32();
    ops.select(a, b, ops.gt(a, b))
}
