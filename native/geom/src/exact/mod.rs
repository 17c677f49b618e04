// SPDX-License-Identifier: GPL-3.0-or-later
//! Exact arithmetic on f32 inputs, for the few decisions that f64 cannot make.
//!
//! With a ray `o + t d` and a triangle `a b c`, let `A = a - o` and so on. The three edge functions are
//! `w_a = det[d, B, C]`, `w_b = det[d, C, A]`, `w_c = det[d, A, B]`, and
//! `t = det[A, B, C] / (w_a + w_b + w_c)`. All of them are polynomials in the fifteen f32 inputs, so their values
//! are exact in integers once points and direction are each scaled to a common exponent. Signs that f64 computes without
//! rounding ([`short`]) need no integers. Otherwise, numbers of 64 bits suffice
//! for these, and [`long`] ones for their determinants, unless coordinates of very different size meet. Otherwise,
//! signs come from sums in fixed point ([`wide`]) and values from integers of any size.

mod determinant;
mod long;
mod short;
mod wide;

use crate::vec3::{Vec3, sub};
use determinant::{Factor, determinant, sign, weight, weights};
use long::{Long, power};
use num_bigint::{BigInt, Sign};
use std::cmp::Ordering;

/// Largest number of binary places of numbers whose difference fits into 64 bits, and whose determinants are below
/// 2^187: eighteen products of a direction and two differences, each of which takes one place more.
const WORD: i32 = 60;

/// Returns whether the triangle has no area: its vertices lie exactly on one line.
pub fn is_degenerate(v: [Vec3; 3]) -> bool {
    let shadow = |i: usize, j: usize| {
        let coord = |p: Vec3| robust::Coord { x: p[i], y: p[j] };
        robust::orient2d(coord(v[0]), coord(v[1]), coord(v[2])) == 0.0
    };
    shadow(0, 1) && shadow(1, 2) && shadow(2, 0)
}

/// The exact intersection of a ray's line with a closed triangle, rounded once at the end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExactHit {
    /// Distance, correctly rounded to f32 (ties to even).
    pub t: f32,
    /// Weights of the second and the third vertex, correctly rounded to f32.
    pub weights: [f32; 2],
    /// Number of edge functions that vanish: 0 inside, 1 on an edge, 2 at a vertex.
    pub zeros: usize,
}

/// Returns the signs (-1, 0, 1) of the edge functions of the vertices that `asked` names; 0 for the others.
pub fn edge_signs(o: [f32; 3], d: [f32; 3], v: [[f32; 3]; 3], asked: [bool; 3]) -> [i32; 3] {
    // A ray within an axis-aligned wall is the most common case, and needs only comparisons.
    if (0..3).any(|k| d[k] == 0.0 && v.iter().all(|p| p[k] == o[k])) {
        return [0; 3];
    }
    // Two weights of 0 are those of a ray through the third vertex.
    let vertex = [0, 1, 2].into_iter().find(|&k: &usize| !asked[k]);
    if let ([false, true, true] | [true, false, true] | [true, true, false], Some(vertex)) =
        (asked, vertex)
        && short::passes_through(o, d, v[vertex])
    {
        return [0; 3];
    }
    let mut units = None;
    [0, 1, 2].map(|vertex: usize| {
        if !asked[vertex] {
            return 0;
        }
        let edge = [v[(vertex + 1) % 3], v[(vertex + 2) % 3]];
        if let Some(sign) = short::edge_sign(o, d, edge) {
            return sign;
        }
        let units = units.get_or_insert_with(|| {
            let units = Units::of(o, d, v);
            units.are_small().then(|| units.small(o, d, v))
        });
        match units {
            Some((d, corners)) => sign(&weight(d, corners, vertex)),
            None => wide::edge_sign(o, d, v, vertex),
        }
    })
}

/// Intersects a ray's line with a closed triangle in exact arithmetic. A line in the triangle's plane misses it.
/// The distance may be negative.
pub fn intersect(o: [f32; 3], d: [f32; 3], v: [[f32; 3]; 3]) -> Option<ExactHit> {
    let units = Units::of(o, d, v);
    let unit = units.points.low - units.direction.low;
    if units.are_small() {
        let (d, corners) = units.small(o, d, v);
        hit(&d, &corners, |n, d, scaled| {
            quotient(*n, *d, if scaled { unit } else { 0 })
        })
    } else {
        #[cfg(test)]
        tests::ANY_SIZE.with(|count| count.set(count.get() + 1));
        let (d, corners) = units.large(o, d, v);
        hit(&d, &corners, |n, d, scaled| {
            round_to_f32(n, d, if scaled { unit } else { 0 })
        })
    }
}

/// Decides by the signs of the edge functions. `round(n, d, scaled)` returns `n / d`, multiplied by the unit of
/// distance if `scaled` is set.
fn hit<F: Factor>(
    d: &[F; 3],
    corners: &[[F; 3]; 3],
    round: impl Fn(&F::Sum, &F::Sum, bool) -> f32,
) -> Option<ExactHit> {
    let [wa, wb, wc] = weights(d, corners);
    let signs = [sign(&wa), sign(&wb), sign(&wc)];
    if signs.contains(&1) == signs.contains(&-1) {
        return None; // mixed signs: outside; all zero: the line lies in the plane
    }
    // Divide only for hits, each value rounded once.
    let [a, b, c] = corners;
    let sum = wa + wb.clone() + wc.clone();
    Some(ExactHit {
        t: round(&determinant(a, b, c), &sum, true),
        weights: [round(&wb, &sum, false), round(&wc, &sum, false)],
        zeros: signs.iter().filter(|&&s| s == 0).count(),
    })
}

/// Binary places of the integers that represent the points (vertices and origin) and the direction. The ratio of
/// their units is the unit of the distance `det[A, B, C] / (w_a + w_b + w_c)`.
struct Units {
    points: Places,
    direction: Places,
}

impl Units {
    /// Returns the places that a ray and a triangle need.
    #[inline(always)]
    fn of(o: [f32; 3], d: [f32; 3], [a, b, c]: [[f32; 3]; 3]) -> Self {
        Self {
            points: Places::of([o, a, b, c].as_flattened()),
            direction: Places::of(&d),
        }
    }

    /// Returns whether 64 bits hold the direction, and differences of the points.
    #[inline(always)]
    fn are_small(&self) -> bool {
        self.points.count().max(self.direction.count()) <= WORD
    }

    /// Returns the direction, and the vertices relative to the origin, as 64-bit integers.
    #[inline(always)]
    fn small(&self, o: [f32; 3], d: [f32; 3], v: [[f32; 3]; 3]) -> ([i64; 3], [[i64; 3]; 3]) {
        let o = self.points.small(o);
        // Differences take at most one place more, and fit into 64 bits.
        let seen = |p: [f32; 3]| {
            let p = self.points.small(p);
            [p[0] - o[0], p[1] - o[1], p[2] - o[2]]
        };
        (
            self.direction.small(d),
            [seen(v[0]), seen(v[1]), seen(v[2])],
        )
    }

    /// Returns the direction, and the vertices relative to the origin, as integers of any size.
    fn large(&self, o: [f32; 3], d: [f32; 3], v: [[f32; 3]; 3]) -> ([BigInt; 3], [[BigInt; 3]; 3]) {
        let o = o.map(|x| self.points.large(x));
        let seen = |p: [f32; 3]| std::array::from_fn(|k| self.points.large(p[k]) - &o[k]);
        (d.map(|x| self.direction.large(x)), v.map(seen))
    }
}

/// Range of binary places of some numbers: from 2^low to below 2^high.
struct Places {
    low: i32,
    high: i32,
}

impl Places {
    /// Returns the smallest range that holds all `numbers`; zeros do not count.
    #[inline(always)]
    fn of(numbers: &[f32]) -> Self {
        let mut places = Self {
            low: i32::MAX,
            high: i32::MIN,
        };
        // Trailing zeros of the mantissa need no places.
        for (mantissa, exponent) in numbers.iter().map(|&x| parts(x)) {
            if mantissa != 0 {
                let size = mantissa.unsigned_abs();
                let zeros = size.trailing_zeros().cast_signed();
                let bits = 32 - size.leading_zeros().cast_signed();
                places.low = places.low.min(exponent + zeros);
                places.high = places.high.max(exponent + bits);
            }
        }
        if places.high < places.low {
            places = Self { low: 0, high: 0 }; // all are zero
        }
        places
    }

    /// Returns the number of binary places.
    fn count(&self) -> i32 {
        self.high - self.low
    }

    /// Returns `numbers / 2^low`, for at most [`WORD`] places, where f64 holds the power and the quotients.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "a whole number of few places"
    )]
    fn small(&self, numbers: [f32; 3]) -> [i64; 3] {
        let unit = power(-self.low);
        let scaled = |x: f32| (f64::from(x) * unit) as i64;
        [scaled(numbers[0]), scaled(numbers[1]), scaled(numbers[2])]
    }

    /// Returns `x / 2^low`.
    fn large(&self, x: f32) -> BigInt {
        let (mantissa, exponent) = parts(x);
        let shift = exponent - self.low;
        if shift >= 0 {
            BigInt::from(mantissa) << shift
        } else {
            BigInt::from(mantissa >> (-shift).min(31))
        }
    }
}

/// Returns mantissa and exponent of a finite number: `x = m 2^e`.
#[inline(always)]
pub fn parts(x: f32) -> (i32, i32) {
    let bits = x.to_bits();
    let exponent = ((bits >> 23) & 0xff).cast_signed();
    let fraction = (bits & 0x7f_ffff).cast_signed();
    // Normal numbers have an implicit leading bit, subnormal ones do not.
    let mantissa = if exponent == 0 {
        fraction
    } else {
        fraction | 0x80_0000
    };
    let signed = if x.is_sign_negative() {
        -mantissa
    } else {
        mantissa
    };
    (signed, exponent.max(1) - 150)
}

/// Returns `numerator / denominator 2^unit`, rounded once to the nearest f32, ties to even. f64 decides unless its
/// error of three roundings leaves two results possible.
fn quotient(numerator: Long, denominator: Long, unit: i32) -> f32 {
    let value = numerator.to_f64() / denominator.to_f64() * power(unit);
    #[expect(clippy::cast_possible_truncation, reason = "rounding is the point")]
    // Round both ends of the error interval.
    let (low, high) = (
        (value.abs() * (1.0 - 4.0 * f64::EPSILON)) as f32,
        (value.abs() * (1.0 + 4.0 * f64::EPSILON)) as f32,
    );
    let size = if low == high {
        low
    } else {
        // Compare with the middle of these neighbours, whose mantissa takes one bit more.
        let (mantissa, exponent) = parts(low);
        let middle = (2 * mantissa + 1).cast_unsigned();
        let (n, d) = (numerator.abs(), denominator.abs().times(middle));
        let shift = unit - (exponent - 1);
        let beside = if shift >= 0 {
            n.shifted(shift.unsigned_abs()).cmp(&d)
        } else {
            n.cmp(&d.shifted(shift.unsigned_abs()))
        };
        match beside {
            Ordering::Less => low,
            Ordering::Equal if mantissa % 2 == 0 => low,
            _ => high,
        }
    };
    if value < 0.0 { -size } else { size }
}

/// Returns `numerator / denominator 2^unit`, rounded once to the nearest f32, ties to even.
///
/// The quotient is first truncated to about 40 bits, with its last bit set if the remainder is not zero (rounding
/// to odd), so that the second rounding is correct (Boldo and Melquiond 2008).
fn round_to_f32(numerator: &BigInt, denominator: &BigInt, unit: i32) -> f32 {
    if numerator.sign() == Sign::NoSign {
        return 0.0;
    }
    let (n, d) = (numerator.magnitude(), denominator.magnitude());
    let bits = |x: u64| i64::try_from(x).expect("bit counts are small");
    // Shift so that the integer quotient has 40 to 42 bits.
    let shift = 40 - (bits(n.bits()) - bits(d.bits()));
    let (n, d) = if shift >= 0 {
        (n << shift, d.clone())
    } else {
        (n.clone(), d << shift.unsigned_abs())
    };
    // Set the last bit if the division leaves a remainder.
    let quotient = &n / &d;
    let odd = u64::from(&quotient * &d != n);
    let head = u64::try_from(&quotient).expect("the quotient has at most 42 bits") | odd;
    let scale = 2.0_f64.powi(unit - i32::try_from(shift).expect("exponents are small"));
    let negative = (numerator.sign() == Sign::Minus) != (denominator.sign() == Sign::Minus);
    #[expect(clippy::cast_precision_loss, reason = "42 bits fit an f64 exactly")]
    let value = head as f64 * scale;
    #[expect(clippy::cast_possible_truncation, reason = "this is the one rounding")]
    let rounded = value as f32;
    if negative { -rounded } else { rounded }
}

/// Returns the vertices of a triangle relative to `o`.
#[inline(always)]
pub fn from_origin(o: Vec3, v: [Vec3; 3]) -> [Vec3; 3] {
    [sub(v[0], o), sub(v[1], o), sub(v[2], o)]
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::vec3::widen;
    use proptest::prelude::*;
    use std::cell::Cell;

    thread_local! {
        /// Number of intersections that this thread computed with integers of any size.
        pub static ANY_SIZE: Cell<u32> = const { Cell::new(0) };
    }

    const TRIANGLE: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

    #[test]
    fn edges_vertices_and_planes_are_distinguished() {
        let down = |x: f32, y: f32| intersect([x, y, 1.0], [0.0, 0.0, -1.0], TRIANGLE);
        assert_eq!(down(0.25, 0.25).map(|h| (h.t, h.zeros)), Some((1.0, 0)));
        assert_eq!(down(0.25, 0.0).map(|h| (h.t, h.zeros)), Some((1.0, 1)));
        assert_eq!(down(0.0, 0.0).map(|h| (h.t, h.zeros)), Some((1.0, 2)));
        assert_eq!(down(-1e-30, 0.25), None);
        assert_eq!(intersect([-1.0, 0.2, 0.0], [1.0, 0.0, 0.0], TRIANGLE), None);
    }

    #[test]
    fn signs_are_exact_over_all_exponents() {
        let third = |o, d| edge_signs(o, d, TRIANGLE, [true; 3])[2];
        assert_eq!(third([1e20, 0.0, 1.0], [1.0, 1e-20, -1.0]), -1);
        assert_eq!(third([0.5, 0.0, 1.0], [0.0, 0.0, -1.0]), 0);
        assert_eq!(third([0.5, 1e-38, 1.0], [0.0, 0.0, -1.0]).abs(), 1);
        assert_eq!(
            edge_signs([0.1, 0.2, 0.0], [0.3, -0.7, 0.0], TRIANGLE, [true; 3]),
            [0; 3]
        );
    }

    /// Computes the intersection with integers of any size in units of the smallest f32, without shortcuts.
    fn plainly(o: [f32; 3], d: [f32; 3], v: [[f32; 3]; 3]) -> Option<ExactHit> {
        let all = Places { low: -149, high: 0 };
        let o = o.map(|x| all.large(x));
        let corners = v.map(|p| std::array::from_fn(|k| all.large(p[k]) - &o[k]));
        hit(&d.map(|x| all.large(x)), &corners, |n, d, _| {
            round_to_f32(n, d, 0)
        })
    }

    fn coordinate() -> impl Strategy<Value = f32> {
        prop_oneof![
            (-8i8..8).prop_map(f32::from),
            -1.0f32..1.0,
            (-4i16..4, -20i32..20).prop_map(|(m, e)| f32::from(m) * 2.0_f32.powi(e)),
            prop::num::f32::NORMAL | prop::num::f32::SUBNORMAL | prop::num::f32::ZERO,
        ]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]
        #[test]
        fn short_and_long_integers_agree(
            o in [coordinate(), coordinate(), coordinate()],
            d in [coordinate(), coordinate(), coordinate()],
            corners in prop::array::uniform3([coordinate(), coordinate(), coordinate()]),
            aim in 0usize..4,
        ) {
            // Three of four rays are aimed at a vertex or an edge.
            let d = match aim {
                3 => d,
                k => std::array::from_fn(|i| corners[k][i] + corners[aim / 2][i] - 2.0 * o[i]),
            };
            prop_assume!(d.iter().all(|x| x.is_finite()));
            let plain = plainly(o, d, corners);
            prop_assert_eq!(intersect(o, d, corners), plain);
            let signs = edge_signs(o, d, corners, [true; 3]);
            prop_assert_eq!(signs.contains(&1) != signs.contains(&-1), plain.is_some());
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(5_000))]
        /// Sums at and beyond the limits for which 128 bits are used.
        #[test]
        fn nothing_overflows_at_the_limits(
            corners in prop::array::uniform4(prop::array::uniform3(0usize..5)),
            d in prop::array::uniform3(0usize..5),
            places in prop::sample::select(vec![(40, 40), (60, 24), (60, 60), (64, 24), (24, 64), (24, 72)]),
        ) {
            let number = |k: usize, places: i32| {
                let large = 16_777_215.0 * 2.0_f32.powi(places - 24);
                [large, -large, 1.0, -1.0, 0.0][k]
            };
            let [o, a, b, c] = corners.map(|p| p.map(|k| number(k, places.0)));
            let d = d.map(|k| number(k, places.1));
            prop_assert_eq!(intersect(o, d, [a, b, c]), plainly(o, d, [a, b, c]));
            let (long, seen) = Units::of(o, d, [a, b, c]).large(o, d, [a, b, c]);
            let signs = weights(&long, &seen).map(|w| sign(&w));
            prop_assert_eq!(edge_signs(o, d, [a, b, c], [true; 3]), signs);
        }
    }

    #[test]
    fn rounding_is_to_nearest_even() {
        let ratio = |n: i128, d: i128| {
            let long = round_to_f32(&BigInt::from(n), &BigInt::from(d), 0);
            assert_eq!(
                quotient(Long::product(1, n), Long::product(1, d), 0),
                long,
                "{n} / {d}"
            );
            long
        };
        assert_eq!(ratio(1, 3), 1.0 / 3.0);
        assert_eq!(ratio(-2, 3), -2.0 / 3.0);
        assert_eq!(ratio((1 << 24) + 1, 1), 16_777_216.0); // a tie goes to the even neighbour
        assert_eq!(ratio(((1 << 24) + 1) * 1000 + 1, 1000), 16_777_218.0);
        assert_eq!(ratio((1 << 100) + (1 << 76), 1 << 76), 16_777_216.0);
        assert_eq!(ratio((1 << 100) + (1 << 76) + 1, 1 << 76), 16_777_218.0);
        let whole = |n: i128, unit| quotient(Long::product(1, n), Long::product(1, 1), unit);
        assert_eq!(whole(3, -150), f32::from_bits(2));
        assert_eq!(whole(1, -150).to_bits(), 0);
        assert_eq!(whole(1, 200), f32::INFINITY);
        // The largest float, the middle between it and 2^128, and the last number below that.
        assert_eq!(whole((1 << 24) - 1, 104), f32::MAX);
        assert_eq!(whole((1 << 25) - 1, 103), f32::INFINITY);
        assert_eq!(whole((1 << 60) - (1 << 35) - 1, 68), f32::MAX);
    }

    #[test]
    fn degenerate_means_exactly_on_a_line() {
        let line = [[0.0, 0.0, 0.0], [0.1_f32, 0.2, 0.3], [0.2, 0.4, 0.6]];
        assert!(is_degenerate(line.map(widen)));
        let mut almost = line;
        almost[2][1] = f32::from_bits(almost[2][1].to_bits() + 1);
        assert!(!is_degenerate(almost.map(widen)));
    }
}
