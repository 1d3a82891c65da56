//! Powers of two that keep sums of squares within the range of f64.
//!
//! Squares of values beyond 1e154 overflow and those of values below 1e-154 vanish, although the
//! answer may be an ordinary value. Such values are divided by a power of two, which is exact,
//! before anything is squared. Ordinary values have the exponent 0 and stay as they are.

use std::ops::Range;

/// Magnitudes from 2^-100 to 2^101 are ordinary: products of four of them, summed over any number
/// of frames, stay far within the range of f64.
const LARGEST: i32 = 100;

/// Magnitudes that are ordinary, and those twice and half as large as well.
pub const ORDINARY: Range<f64> = power(1 - LARGEST)..power(LARGEST - 1);

/// The exponent of zeros, below that of every other value: zeros can be scaled to any exponent.
pub const ZERO: i32 = -1200;

/// The exponent of the power of two to divide values of this magnitude by; 0 if it is ordinary.
/// `magnitude` is finite.
pub fn exponent(magnitude: f64) -> i32 {
    let magnitude = magnitude.abs();
    if magnitude == 0.0 {
        return ZERO;
    }
    // Subnormal values have no leading bit; they are normal after an exact product.
    let (normal, shift) = if magnitude < f64::MIN_POSITIVE {
        (magnitude * power(64), -64)
    } else {
        (magnitude, 0)
    };
    let found = (normal.to_bits() >> 52) as i32 - 1023 + shift;
    if found.abs() <= LARGEST { 0 } else { found }
}

/// `value` times 2^`exponent`, infinite or rounded where f64 ends.
#[inline]
pub fn times_power(mut value: f64, mut exponent: i32) -> f64 {
    const STEP: i32 = 1000;
    while exponent > STEP {
        value *= power(STEP);
        exponent -= STEP;
    }
    while exponent < -STEP {
        value *= power(-STEP);
        exponent += STEP;
    }
    value * power(exponent)
}

/// 2^`exponent`, of a normal f64.
const fn power(exponent: i32) -> f64 {
    f64::from_bits(((exponent + 1023) as u64) << 52)
}

/// `value`, or 0 where rounding made it negative. NaN stays NaN, which `f64::max` would drop.
#[inline]
pub fn non_negative(value: f64) -> f64 {
    if value < 0.0 { 0.0 } else { value }
}

/// The larger of two values; NaN if one is.
#[inline]
pub fn larger(a: f64, b: f64) -> f64 {
    if a >= b || a.is_nan() { a } else { b }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponents_bring_every_value_near_one() {
        for value in [
            5e-324,
            f64::MIN_POSITIVE,
            1e-200,
            -1e-31,
            1e31,
            -1e200,
            f64::MAX,
        ] {
            let scaled = times_power(value, -exponent(value));
            assert!((1.0..2.0).contains(&scaled.abs()), "{value}: {scaled}");
            assert_eq!(times_power(scaled, exponent(value)), value);
        }
        for ordinary in [1e-30, 0.3, -1.0, 1e30] {
            assert_eq!(exponent(ordinary), 0);
        }
        assert_eq!(exponent(-0.0), ZERO);
        assert_eq!(times_power(1.0, 3000), f64::INFINITY);
        assert_eq!(times_power(1.0, -3000), 0.0);
    }

    #[test]
    fn nan_is_kept() {
        assert!(non_negative(f64::NAN).is_nan());
        assert!(larger(f64::NAN, 1.0).is_nan() && larger(1.0, f64::NAN).is_nan());
        assert_eq!([non_negative(-1e-20), larger(1.0, 2.0)], [0.0, 2.0]);
    }
}
