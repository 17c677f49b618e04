// SPDX-License-Identifier: GPL-3.0-or-later
//! The arithmetics in which closest points are computed: one text serves all three.

use num_bigint::{BigInt, Sign};

/// Unit roundoff of f64, 2^-53.
pub const U: f64 = f64::EPSILON / 2.0;

/// Factor on error bounds that covers the rounding of the bounds themselves. Derived: at most six operations each.
const GROW: f64 = 1.0 + 16.0 * U;

/// A number of one of the arithmetics.
pub trait Number: Clone {
    /// Returns `self + other`.
    #[must_use]
    fn plus(&self, other: &Self) -> Self;

    /// Returns `self - other`.
    #[must_use]
    fn minus(&self, other: &Self) -> Self;

    /// Returns `self * other`.
    #[must_use]
    fn times(&self, other: &Self) -> Self;

    /// Returns the sign (-1, 0, 1), or `None` if it is not certain.
    fn sign(&self) -> Option<i32>;
}

/// Plain f64: every sign counts as certain.
impl Number for f64 {
    #[inline(always)]
    fn plus(&self, other: &Self) -> Self {
        self + other
    }

    #[inline(always)]
    fn minus(&self, other: &Self) -> Self {
        self - other
    }

    #[inline(always)]
    fn times(&self, other: &Self) -> Self {
        self * other
    }

    #[inline(always)]
    fn sign(&self) -> Option<i32> {
        Some(i32::from(*self > 0.0) - i32::from(*self < 0.0))
    }
}

impl Number for BigInt {
    fn plus(&self, other: &Self) -> Self {
        self + other
    }

    fn minus(&self, other: &Self) -> Self {
        self - other
    }

    fn times(&self, other: &Self) -> Self {
        self * other
    }

    fn sign(&self) -> Option<i32> {
        Some(match self.sign() {
            Sign::Minus => -1,
            Sign::NoSign => 0,
            Sign::Plus => 1,
        })
    }
}

/// An f64 with a bound on its error. Products of up to six differences of f32 neither overflow nor underflow, and no
/// computation here has more.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounded {
    /// The computed value.
    pub value: f64,
    /// Largest distance of the exact value from it.
    pub error: f64,
}

impl Bounded {
    /// Makes a number without error.
    #[inline(always)]
    pub fn exact(value: f64) -> Self {
        Self { value, error: 0.0 }
    }

    /// Adds the rounding of the value itself to the error of its operands.
    #[inline(always)]
    fn rounded(value: f64, error: f64) -> Self {
        let error = (error + U * value.abs()) * GROW;
        Self { value, error }
    }

    /// Returns the difference of two f64 without error; the error of the result is the rounding of that difference
    /// itself, which is 0 for most pairs of near coordinates (Knuth's exact sum).
    #[inline(always)]
    pub fn difference(a: f64, b: f64) -> Self {
        let value = a - b;
        let other = a - value;
        let error = ((a - (value + other)) + (other - b)).abs();
        Self { value, error }
    }

    /// Returns the quotient, or `None` if the divisor may be zero.
    #[inline(always)]
    pub fn over(self, divisor: Self) -> Option<Self> {
        let least = divisor.value.abs() - divisor.error;
        if least <= 0.0 {
            return None;
        }
        let value = self.value / divisor.value;
        let error = (self.error + value.abs() * divisor.error) * GROW / least;
        Some(Self::rounded(value, error * GROW))
    }

    /// Returns the f32 to which every value within the error rounds, or `None` if there are several.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "rounding is the point")]
    pub fn to_f32(self) -> Option<f32> {
        // The sums are rounded: two more places cover that.
        let error = self.error + 2.0 * U * self.value.abs();
        let (low, high) = ((self.value - error) as f32, (self.value + error) as f32);
        (low == high).then_some(low + 0.0)
    }
}

impl Number for Bounded {
    #[inline(always)]
    fn plus(&self, other: &Self) -> Self {
        Self::rounded(self.value + other.value, self.error + other.error)
    }

    #[inline(always)]
    fn minus(&self, other: &Self) -> Self {
        Self::rounded(self.value - other.value, self.error + other.error)
    }

    #[inline(always)]
    fn times(&self, other: &Self) -> Self {
        let error = self.value.abs() * other.error + self.error * (other.value.abs() + other.error);
        Self::rounded(self.value * other.value, error)
    }

    #[inline(always)]
    fn sign(&self) -> Option<i32> {
        if self.value.abs() > self.error {
            Some(if self.value > 0.0 { 1 } else { -1 })
        } else {
            (self.error == 0.0).then_some(0)
        }
    }
}
