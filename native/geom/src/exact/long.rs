// SPDX-License-Identifier: GPL-3.0-or-later
//! Signed integers of 256 bits, for determinants of 64-bit integers and their quotients. Nothing is allocated.

use std::ops::{Add, Sub};

/// Bits of one half.
const HALF: u32 = 128;

/// A number in two's complement. The fields are in the order of their weight, so that the derived order is that of the
/// numbers.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Long {
    high: i128,
    low: u128,
}

impl Long {
    /// Returns the product.
    #[inline(always)]
    pub fn product(a: i64, b: i128) -> Self {
        // The lower word of `b` is not negative, the upper one has its sign.
        let (lower, upper) = (b & i128::from(u64::MAX), b >> 64);
        let (lower, upper) = (i128::from(a) * lower, i128::from(a) * upper);
        let (low, carry) = (lower.cast_unsigned()).overflowing_add(upper.cast_unsigned() << 64);
        Self {
            high: (lower >> (HALF - 1)) + (upper >> 64) + i128::from(carry),
            low,
        }
    }

    /// Returns the absolute value.
    pub fn abs(self) -> Self {
        if self.high < 0 {
            Self::default() - self
        } else {
            self
        }
    }

    /// Returns the nearest f64, off by at most one rounding and 2^-127 of the number.
    pub fn to_f64(self) -> f64 {
        let Self { high, low } = self.abs();
        let size = if high == 0 {
            low as f64
        } else {
            let zeros = high.leading_zeros();
            let head = high.cast_unsigned() << zeros | low >> 1 >> (HALF - 1 - zeros);
            head as f64 * power(HALF.cast_signed() - zeros.cast_signed())
        };
        if self.high < 0 { -size } else { size }
    }

    /// Returns a positive number multiplied by a small one; the product must have less than 256 bits.
    pub fn times(self, by: u32) -> Self {
        let (lower, upper) = (self.low & u128::from(u64::MAX), self.low >> 64);
        let (lower, upper) = (lower * u128::from(by), upper * u128::from(by));
        let (low, carry) = lower.overflowing_add(upper << 64);
        let high = self.high * i128::from(by) + (upper >> 64).cast_signed();
        Self {
            high: high + i128::from(carry),
            low,
        }
    }

    /// Returns a positive number multiplied by a power of two; the product must have less than 256 bits.
    pub fn shifted(self, by: u32) -> Self {
        if by >= HALF {
            return Self {
                high: (self.low << (by - HALF)).cast_signed(),
                low: 0,
            };
        }
        Self {
            high: self.high << by | (self.low >> 1 >> (HALF - 1 - by)).cast_signed(),
            low: self.low << by,
        }
    }
}

impl Add for Long {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        let (low, carry) = self.low.overflowing_add(other.low);
        Self {
            high: self.high + other.high + i128::from(carry),
            low,
        }
    }
}

impl Sub for Long {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        let (low, borrow) = self.low.overflowing_sub(other.low);
        Self {
            high: self.high - other.high - i128::from(borrow),
            low,
        }
    }
}

/// Returns `2^exponent`, for exponents of normal f64.
#[inline(always)]
pub fn power(exponent: i32) -> f64 {
    f64::from_bits(u64::from((1023 + exponent).cast_unsigned()) << 52)
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_bigint::BigInt;
    use proptest::prelude::*;

    fn big(x: Long) -> BigInt {
        (BigInt::from(x.high) << HALF) + x.low
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]
        #[test]
        fn arithmetic_is_that_of_integers_of_any_size(
            (a, b) in (any::<i64>(), any::<i128>()), (c, d) in (any::<i64>(), any::<i128>()),
            (cut, by) in (0u32..120, any::<u32>()), shift in 0u32..255,
        ) {
            let (one, other) = (Long::product(a, b >> cut), Long::product(c, d));
            prop_assert_eq!(big(one), BigInt::from(a) * (b >> cut));
            prop_assert_eq!(big(one + other), big(one) + big(other));
            prop_assert_eq!(big(one - other), big(one) - big(other));
            prop_assert_eq!(one < other, big(one) < big(other));
            let size = one.abs();
            prop_assert_eq!(big(size.times(by)), big(size) * by);
            if big(size).bits() + u64::from(shift) < 255 {
                prop_assert_eq!(big(size.shifted(shift)), big(size) << shift);
            }
            // 2^200 as f64 and as an integer.
            let near = one.to_f64();
            if near != 0.0 {
                let scaled = Long::product(1, 1 << 60);
                prop_assert_eq!(scaled.to_f64(), power(60));
                let head = near.abs() / power(200);
                let exact = big(size).to_string().parse::<f64>().unwrap() / power(200);
                prop_assert!((head - exact).abs() <= exact * 1.2e-16, "{} {}", head, exact);
                prop_assert_eq!(near < 0.0, one.high < 0);
            }
        }
    }
}
