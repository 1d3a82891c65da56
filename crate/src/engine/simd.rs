//! What the kernels share.

use rten_simd::Isa;
#[cfg(target_arch = "wasm32")]
use rten_simd::ops::BitOps;
use rten_simd::ops::NumOps;

/// The larger of `value` and `floor`.
///
/// In wasm `f32x4.max` promises what happens to a NaN, which costs browsers on x86 several instructions.
#[inline(always)]
pub(super) fn larger<I: Isa>(isa: I, value: I::F32, floor: I::F32) -> I::F32 {
    let ops = isa.f32();
    #[cfg(target_arch = "wasm32")]
    return ops.select(value, floor, ops.gt(value, floor));
    #[cfg(not(target_arch = "wasm32"))]
    ops.max(value, floor)
}
