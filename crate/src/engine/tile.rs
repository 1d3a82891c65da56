//! The transforms of tiles.

use rten_simd::Isa;
use rten_simd::ops::{BitOps, NumOps};

/// The points at which the polynomials of tiles with stride 1 are evaluated: 0, ±[`NEAR`], ±[`FAR`]
/// and infinity. With stride 2 they are 0, ±[`NEAR`], [`FAR`] and infinity.
pub(super) const NEAR: f32 = 1.0;
pub(super) const FAR: f32 = 2.0;

/// A transform of FROM cells along one axis. (A trait, since functions that are passed on are not
/// inlined into the code of an instruction set.)
pub(crate) trait Points<const FROM: usize, const TO: usize> {
    fn points<I: Isa>(isa: I, cells: [I::F32; FROM]) -> [I::F32; TO];
}

/// Transforms the tile of FROM x FROM vectors at `from`, with `[row, column]` values from one to the
/// next, along both axes; `put` gets the results row by row.
///
/// # Safety
/// The vectors must be readable.
#[inline(always)]
pub(super) unsafe fn transform<I: Isa, P: Points<FROM, TO>, const FROM: usize, const TO: usize>(
    isa: I,
    from: *const f32,
    [row_step, column_step]: [usize; 2],
    mut put: impl FnMut(usize, [I::F32; TO]),
) {
    let ops = isa.f32();
    let mut half = [[ops.zero(); TO]; FROM];
    for (column, half) in half.iter_mut().enumerate() {
        let mut cells = [ops.zero(); FROM];
        for (row, cell) in cells.iter_mut().enumerate() {
            // SAFETY: the caller's promise.
            *cell = unsafe { ops.load_ptr(from.add(row * row_step + column * column_step)) };
        }
        *half = P::points(isa, cells);
    }
    for row in 0..TO {
        let mut cells = [ops.zero(); FROM];
        for (cell, half) in cells.iter_mut().zip(&half) {
            *cell = half[row];
        }
        put(row, P::points(isa, cells));
    }
}

/// As [`transform`]; the results go to `to`, `[.., place]` values apart.
///
/// # Safety
/// The vectors must be readable, and those of the results writable.
#[inline(always)]
pub(crate) unsafe fn transform_to<
    I: Isa,
    P: Points<FROM, TO>,
    const FROM: usize,
    const TO: usize,
>(
    isa: I,
    from: *const f32,
    to: *mut f32,
    [row_step, column_step, place_step]: [usize; 3],
) {
    let ops = isa.f32();
    // SAFETY: the caller's promise.
    unsafe {
        transform::<I, P, FROM, TO>(
            isa,
            from,
            [row_step, column_step],
            #[inline(always)]
            |row, values| {
                for (column, value) in values.into_iter().enumerate() {
                    ops.store_ptr(value, to.add((row * TO + column) * place_step));
                }
            },
        );
    }
}

/// The transform of inputs.
pub(crate) struct Inputs;

impl<const SIDE: usize> Points<SIDE, SIDE> for Inputs {
    #[inline(always)]
    fn points<I: Isa>(isa: I, d: [I::F32; SIDE]) -> [I::F32; SIDE] {
        let ops = isa.f32();
        let scaled = |factor: f32, value, sum| ops.mul_add(ops.splat(factor), value, sum);
        let (near, far) = (NEAR * NEAR, FAR * FAR);
        let mut points = d;
        match SIDE {
            6 => {
                let even_near = scaled(-far, d[2], d[4]);
                let odd_near = scaled(-far, d[1], d[3]);
                let even_far = scaled(-near, d[2], d[4]);
                let odd_far = scaled(-near, d[1], d[3]);
                points[0] = scaled(near * far, d[0], scaled(-(near + far), d[2], d[4]));
                points[1] = scaled(NEAR, odd_near, even_near);
                points[2] = scaled(-NEAR, odd_near, even_near);
                points[3] = scaled(FAR, odd_far, even_far);
                points[4] = scaled(-FAR, odd_far, even_far);
                points[5] = scaled(near * far, d[1], scaled(-(near + far), d[3], d[5]));
            }
            9 => {
                // The cells of the outer taps; those of the middle one come behind them.
                let between: [I::F32; 4] = std::array::from_fn(|i| d[2 * i + 1]);
                let d: [I::F32; 5] = std::array::from_fn(|i| d[2 * i]);
                let at_far = scaled(-near, d[1], d[3]);
                points[0] = scaled(near * FAR, d[0], scaled(-FAR, d[2], at_far));
                points[1] = scaled(-(NEAR * FAR), d[1], scaled(NEAR - FAR, d[2], d[3]));
                points[2] = scaled(NEAR * FAR, d[1], scaled(-(NEAR + FAR), d[2], d[3]));
                points[3] = at_far;
                points[4] = scaled(-FAR, at_far, scaled(-near, d[2], d[4]));
                points[5..].copy_from_slice(&between);
            }
            _ => unreachable!("no transform for tiles of {SIDE} x {SIDE}"),
        }
        points
    }
}

/// The transform of products into results: result i is the sum of a point's product times the point
/// to the power of i, and the last one has infinity's as well. With stride 2, the products of the
/// middle tap are added.
pub(super) struct Outputs;

impl<const SIDE: usize, const M: usize> Points<SIDE, M> for Outputs {
    #[inline(always)]
    fn points<I: Isa>(isa: I, m: [I::F32; SIDE]) -> [I::F32; M] {
        let ops = isa.f32();
        let strided = SIDE == 9;
        let even = ops.add(m[1], m[2]);
        let odd = ops.sub(m[1], m[2]);
        let [even_far, odd_far, infinity] = match strided {
            false => [ops.add(m[3], m[4]), ops.sub(m[3], m[4]), m[5]],
            true => [m[3], m[3], m[4]],
        };
        let mut cells = [m[0]; M];
        for (power, cell) in cells.iter_mut().enumerate() {
            let (near, far) = match power % 2 {
                0 => (even, even_far),
                _ => (odd, odd_far),
            };
            let [at_near, at_far] = [NEAR, FAR].map(|point| {
                let mut value = 1.0;
                for _ in 0..power {
                    value *= point;
                }
                ops.splat(value)
            });
            let mut last = match power {
                0 => ops.add(m[0], near),
                _ if power + 1 == M => ops.mul_add(at_near, near, infinity),
                _ => ops.mul(at_near, near),
            };
            if strided {
                last = ops.add(last, m[5 + power]);
            }
            *cell = ops.mul_add(at_far, far, last);
        }
        cells
    }
}

/// The transpose of the transform of results of 6 x 6 tiles: the polynomial of the cells at the
/// tile's points, of which the near ones are 1 and -1.
#[cfg(feature = "model")]
pub(crate) struct Gradients;

#[cfg(feature = "model")]
impl Points<4, 6> for Gradients {
    #[inline(always)]
    fn points<I: Isa>(isa: I, d: [I::F32; 4]) -> [I::F32; 6] {
        let ops = isa.f32();
        let (even, odd) = (ops.add(d[0], d[2]), ops.add(d[1], d[3]));
        let even_far = ops.mul_add(ops.splat(FAR * FAR), d[2], d[0]);
        let odd_far = ops.mul_add(ops.splat(FAR * FAR), d[3], d[1]);
        [
            d[0],
            ops.add(even, odd),
            ops.sub(even, odd),
            ops.mul_add(ops.splat(FAR), odd_far, even_far),
            ops.mul_add(ops.splat(-FAR), odd_far, even_far),
            d[3],
        ]
    }
}
