//! A logarithmic axis of whole decades, which is drawn alike by the terminal and by the page.
//!
//! plotters' own one finds its marks by logarithms, whose last bit is another one on other
//! machines: marks come and go with it.

use std::ops::Range;

use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};
use plotters::coord::types::RangedCoordf64;

/// Parts of a decade that positions are rounded to: far below a pixel, far above the last bit.
const PARTS: f64 = 1e9;

/// The axis between two powers of ten, with marks at powers of ten alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::report) struct Decades {
    low: i32,
    high: i32,
}

impl Decades {
    /// At least one decade, around all finite values and `margin` times more at either end. Values
    /// below `floor` count as `floor`, values above 1e300 as that; without any the axis ends at 1.
    pub fn around(values: impl Iterator<Item = f64>, floor: f64, margin: f64) -> Self {
        let (mut low, mut high) = (f64::INFINITY, 0.0_f64);
        for value in values.filter(|v| v.is_finite()) {
            // A power of ten above the greatest value has to be a float as well.
            let value = value.max(floor).min(1e300);
            low = low.min(value);
            high = high.max(value);
        }
        if low > high {
            return Self {
                low: below(floor),
                high: 0,
            };
        }
        let low = below(low / margin);
        Self {
            low,
            high: above(high * margin).max(low + 1),
        }
    }

    /// The least value on the axis.
    pub fn low(self) -> f64 {
        power(self.low)
    }

    /// The greatest value on the axis.
    pub fn high(self) -> f64 {
        power(self.high)
    }
}

impl Ranged for Decades {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let position = value.max(f64::MIN_POSITIVE).log10();
        let linear = RangedCoordf64::from(f64::from(self.low)..f64::from(self.high));
        linear.map(&((position * PARTS).round() / PARTS), limit)
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        let most = hint.max_num_points() as i32;
        if most == 0 {
            return Vec::new();
        }
        let step = (1..).find(|step| (self.high - self.low) / step <= most);
        let marks = (self.low..=self.high).step_by(step.unwrap_or(1) as usize);
        marks.map(power).collect()
    }

    fn range(&self) -> Range<f64> {
        self.low()..self.high()
    }
}

/// A power of ten; exact as far as a float can hold it, or the float next to it.
pub(in crate::report) fn power(exponent: i32) -> f64 {
    // Products of tens are exact here, up to 1e22.
    10.0_f64.powi(exponent)
}

/// The exponent of the greatest power of ten that is not above a positive value.
pub(in crate::report) fn below(value: f64) -> i32 {
    let near = value.log10().floor() as i32;
    // The logarithm of a power of ten may come out on either side.
    if power(near + 1) <= value {
        near + 1
    } else if power(near) > value {
        near - 1
    } else {
        near
    }
}

/// The exponent of the least power of ten that is not below a positive value.
pub(in crate::report) fn above(value: f64) -> i32 {
    let below = below(value);
    below + i32::from(power(below) < value)
}

/// A power of ten as it stands at its mark.
pub(in crate::report) fn tick(value: f64) -> String {
    if (0.001..100_000.0).contains(&value) {
        let digits = (-below(value)).max(0) as usize;
        format!("{value:.digits$}")
    } else {
        format!("{value:.0e}")
    }
}

#[cfg(test)]
mod tests {
    use plotters::coord::ranged1d::BoldPoints;

    use super::*;

    #[test]
    fn powers_of_ten_are_their_own_bounds() {
        for exponent in -20..=20 {
            let value: f64 = format!("1e{exponent}").parse().expect("a number");
            assert_eq!(power(exponent), value);
            assert_eq!([below(value), above(value)], [exponent; 2]);
            let [less, more] = [value.next_down(), value.next_up()];
            assert_eq!([below(less), above(less)], [exponent - 1, exponent]);
            assert_eq!([below(more), above(more)], [exponent, exponent + 1]);
        }
    }

    #[test]
    fn every_power_of_ten_on_the_axis_is_marked() {
        for low in -12..6 {
            let axis = Decades { low, high: low + 5 };
            let marks: Vec<f64> = (low..=low + 5).map(power).collect();
            assert_eq!(axis.key_points(BoldPoints(6)), marks);
            for (i, mark) in marks.iter().enumerate() {
                assert_eq!(axis.map(mark, (0, 100)), 20 * i as i32);
            }
        }
        let long = Decades { low: -8, high: 1 };
        assert_eq!(
            long.key_points(BoldPoints(4)),
            [1e-8, 1e-6, 1e-4, 1e-2, 1.0]
        );
    }

    #[test]
    fn an_axis_holds_its_values_with_a_margin() {
        let around = |values: &[f64], margin| {
            let axis = Decades::around(values.iter().copied(), 1e-5, margin);
            [axis.low(), axis.high()]
        };
        assert_eq!(around(&[0.01, 0.2, f64::NAN], 1.0), [0.01, 1.0]);
        assert_eq!(around(&[0.01, 0.2], 1.2), [0.001, 1.0]);
        assert_eq!(around(&[0.1], 1.0), [0.1, 1.0]);
        assert_eq!(around(&[0.0, 0.5], 1.0), [1e-5, 1.0]);
        assert_eq!(around(&[], 1.2), [1e-5, 1.0]);
        assert_eq!(around(&[f64::MAX], 1.2), [1e299, 1e301]);
    }

    #[test]
    fn marks_are_written_without_needless_digits() {
        let written: Vec<String> = [1e-4, 1e-3, 0.1, 1.0, 1e4, 1e5].map(tick).into();
        assert_eq!(written, ["1e-4", "0.001", "0.1", "1", "10000", "1e5"]);
    }
}
