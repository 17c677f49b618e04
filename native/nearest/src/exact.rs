// SPDX-License-Identifier: GPL-3.0-or-later
//! Distances and closest points in integers, for the decisions that f64 cannot make.
//!
//! All coordinates of a decision are integers in units of one power of two, and so are the numerators and denominators
//! of what is computed from them.

use crate::feature::{Fraction, Seen, Vector};
use halfspace_geom::exact::parts;
use num_bigint::{BigInt, BigUint, Sign};
use std::cmp::Ordering;

/// Binary exponent of the unit of a decision.
#[derive(Debug, Clone, Copy)]
pub struct Unit(i32);

impl Unit {
    /// Returns the largest power of two of which all numbers are multiples.
    pub fn of(numbers: impl IntoIterator<Item = f32>) -> Self {
        let lowest = |x: f32| {
            let (mantissa, exponent) = parts(x);
            let zeros = i32::try_from(mantissa.trailing_zeros()).expect("at most 32");
            (mantissa != 0).then_some(exponent + zeros)
        };
        Self(numbers.into_iter().filter_map(lowest).min().unwrap_or(0))
    }

    /// Returns a number in this unit.
    pub fn count(self, x: f32) -> BigInt {
        let (mantissa, exponent) = parts(x);
        // The mantissa has a place below the unit only if it ends with as many zeros.
        match exponent - self.0 {
            shift @ 0.. => BigInt::from(mantissa) << shift,
            shift => BigInt::from(mantissa >> (-shift).min(31)),
        }
    }

    /// Returns a point in this unit.
    pub fn point(self, p: [f32; 3]) -> Vector<BigInt> {
        p.map(|x| self.count(x))
    }

    /// Returns a triangle relative to a point.
    pub fn seen(self, point: [f32; 3], corners: [[f32; 3]; 3]) -> Seen<BigInt> {
        let point = self.point(point);
        let [a, b, c] = corners.map(|corner| self.point(corner));
        let minus =
            |p: &Vector<BigInt>, q: &Vector<BigInt>| [0, 1, 2].map(|k: usize| &p[k] - &q[k]);
        Seen {
            sides: [minus(&c, &b), minus(&a, &c), minus(&b, &a)],
            corners: [minus(&a, &point), minus(&b, &point), minus(&c, &point)],
        }
    }

    /// Returns the quotient of two numbers, the numerator in this unit, rounded once to the nearest f32, ties to even.
    pub fn rounded(self, numerator: &BigInt, denominator: &BigUint) -> f32 {
        let (head, exponent) = head(numerator.magnitude(), denominator, 40);
        let value = to_f32(head, exponent + self.0);
        if numerator.sign() == Sign::Minus {
            -value + 0.0
        } else {
            value
        }
    }

    /// Returns the square root of a squared distance in this unit, rounded once to the nearest f32, ties to even.
    pub fn root(self, squared: &Fraction<BigInt>) -> f32 {
        let one = BigUint::from(1_u32);
        let denominator = (squared.denominator.as_ref()).map_or(&one, BigInt::magnitude);
        // Give the quotient 90 bits or one more, so that its exponent is even: its root has 45.
        let (n, d) = (squared.numerator.magnitude(), denominator);
        let odd = (90 - length(n) + length(d)) % 2 != 0;
        let (quotient, exponent) = long_head(n, d, if odd { 91 } else { 90 });
        let root = quotient.sqrt();
        // If the quotient itself was rounded to odd and is a square, its root is odd, too.
        let rest = &root * &root != quotient;
        let root = u64::try_from(root).expect("a root of 46 bits") | u64::from(rest);
        to_f32(root, exponent / 2 + self.0)
    }
}

/// Returns the exact order of two squared distances.
pub fn order(a: &Fraction<BigInt>, b: &Fraction<BigInt>) -> Ordering {
    a.order(b).expect("integers are certain").cmp(&0)
}

/// Returns the number of bits.
fn length(x: &BigUint) -> i64 {
    i64::try_from(x.bits()).expect("bit counts are small")
}

/// Returns the leading `bits` bits, or one more or less, of a quotient, and the exponent of the last of them. That last
/// bit is set if the rest is not zero: numbers rounded to odd can be rounded again (Boldo and Melquiond 2008).
fn long_head(n: &BigUint, d: &BigUint, bits: i64) -> (BigUint, i32) {
    let shift = bits - (length(n) - length(d));
    let (n, d) = if shift >= 0 {
        (n << shift, d.clone())
    } else {
        (n.clone(), d << shift.unsigned_abs())
    };
    let mut quotient = &n / &d;
    if &quotient * &d != n {
        quotient.set_bit(0, true);
    }
    (
        quotient,
        -i32::try_from(shift).expect("exponents are small"),
    )
}

/// As [`long_head`], for at most 62 bits.
fn head(n: &BigUint, d: &BigUint, bits: i64) -> (u64, i32) {
    let (quotient, exponent) = long_head(n, d, bits);
    let quotient = u64::try_from(quotient).expect("few bits were requested");
    (quotient, exponent)
}

/// Returns `head 2^exponent`, rounded to f32. `head` has at most 50 bits.
#[expect(clippy::cast_possible_truncation, reason = "this is the one rounding")]
#[expect(clippy::cast_precision_loss, reason = "50 bits fit an f64 exactly")]
fn to_f32(head: u64, exponent: i32) -> f32 {
    (head as f64 * 2.0_f64.powi(exponent)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quotients_and_roots_are_rounded_to_nearest_even() {
        let quotient = |n: i128, d: u64| Unit(0).rounded(&BigInt::from(n), &BigUint::from(d));
        assert_eq!(quotient(1, 3), 1.0 / 3.0);
        assert_eq!(quotient(-2, 3), -2.0 / 3.0);
        assert_eq!(quotient(0, 3).to_bits(), 0);
        assert_eq!(quotient((1 << 24) + 1, 1), 16_777_216.0);
        assert_eq!(quotient(((1 << 24) + 1) * 1000 + 1, 1000), 16_777_218.0);
        let root = |n: u128, d: u64| {
            Unit(0).root(&Fraction {
                numerator: BigInt::from(n),
                denominator: Some(BigInt::from(d)),
            })
        };
        assert_eq!(root(0, 7), 0.0);
        assert_eq!(root(25, 4), 2.5);
        assert_eq!(root(2, 1), std::f32::consts::SQRT_2);
        assert_eq!(root(1, 2), std::f32::consts::FRAC_1_SQRT_2);
        // The square of a tie, and the next numbers.
        let tie = (1_u128 << 24) + 1;
        assert_eq!(root(tie * tie, 1), 16_777_216.0);
        assert_eq!(root(tie * tie * 100 + 1, 100), 16_777_218.0);
        assert_eq!(root(tie * tie * 100 - 1, 100), 16_777_216.0);
    }

    #[test]
    fn numbers_are_counted_in_their_unit() {
        let unit = Unit::of([0.0, 6.0, -0.375]);
        assert_eq!(unit.0, -3);
        assert_eq!(unit.count(6.0), BigInt::from(48));
        assert_eq!(unit.count(-0.375), BigInt::from(-3));
        assert_eq!(unit.count(0.0), BigInt::from(0));
        assert_eq!(Unit::of([f32::from_bits(1)]).0, -149);
    }
}
