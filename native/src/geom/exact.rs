// SPDX-License-Identifier: GPL-3.0-or-later
//! Exact arithmetic on f32 inputs, for the few decisions that f64 cannot make.
//!
//! A ray `o + t d` and a triangle `a b c`, seen from the origin `o`: with `A = a - o` and so on,
//! the three edge functions are `w_a = det[d, B, C]`, `w_b = det[d, C, A]`, `w_c = det[d, A, B]`,
//! and `t = det[A, B, C] / (w_a + w_b + w_c)`. All of them are polynomials in the fifteen f32
//! inputs, so they have exact values.

use super::vec3::{Vec3, sub};
use num_bigint::{BigInt, Sign};
use robust::Coord3D;

/// The sign (-1, 0, 1) of `det[d, p - o, q - o]`, exact.
pub fn edge_sign(o: Vec3, d: Vec3, p: Vec3, q: Vec3) -> i32 {
    // The predicate wants four points; `o + d` is one whenever the sum is exact in f64.
    let tip = [o[0] + d[0], o[1] + d[1], o[2] + d[2]];
    let exact = (0..3).all(|k| tip[k] - o[k] == d[k] && tip[k] - d[k] == o[k]);
    if exact {
        let coord = |v: Vec3| Coord3D {
            x: v[0],
            y: v[1],
            z: v[2],
        };
        let det = robust::orient3d(coord(tip), coord(p), coord(q), coord(o));
        return if det > 0.0 { 1 } else { -i32::from(det < 0.0) };
    }
    let (o, d) = (integers(o), integers(d));
    sign(&determinant(
        &d,
        &difference(&integers(p), &o),
        &difference(&integers(q), &o),
    ))
}

/// Whether the triangle has no area at all: its corners lie exactly on one line.
pub fn is_degenerate(v: [Vec3; 3]) -> bool {
    let shadow = |i: usize, j: usize| {
        let coord = |p: Vec3| robust::Coord { x: p[i], y: p[j] };
        robust::orient2d(coord(v[0]), coord(v[1]), coord(v[2])) == 0.0
    };
    shadow(0, 1) && shadow(1, 2) && shadow(2, 0)
}

/// The exact intersection of a ray's line with a closed triangle.
#[derive(Debug, Clone, PartialEq)]
pub struct ExactHit {
    /// Weights of the three corners times `sum`, all of one sign (or zero).
    pub weights: [BigInt; 3],
    /// Their sum, not zero.
    pub sum: BigInt,
    /// Distance times `sum`.
    pub distance: BigInt,
}

impl ExactHit {
    /// The distance, correctly rounded to f32 (ties to even).
    pub fn t(&self) -> f32 {
        round_to_f32(&self.distance, &self.sum)
    }

    /// The weight of corner `k`, correctly rounded to f32.
    pub fn weight(&self, k: usize) -> f32 {
        round_to_f32(&self.weights[k], &self.sum)
    }

    /// How many of the three edge functions vanish: 0 inside, 1 on an edge, 2 at a corner.
    pub fn zeros(&self) -> usize {
        self.weights
            .iter()
            .filter(|w| w.sign() == Sign::NoSign)
            .count()
    }
}

/// Intersects a ray's line with a closed triangle in exact arithmetic. A line in the triangle's
/// plane meets nothing. The distance may be negative.
pub fn intersect(o: [f32; 3], d: [f32; 3], v: [[f32; 3]; 3]) -> Option<ExactHit> {
    let (origin, d) = (integers32(o), integers32(d));
    let [a, b, c] = v.map(|p| difference(&integers32(p), &origin));
    let weights = [
        determinant(&d, &b, &c),
        determinant(&d, &c, &a),
        determinant(&d, &a, &b),
    ];
    let signs = [sign(&weights[0]), sign(&weights[1]), sign(&weights[2])];
    if signs.contains(&1) == signs.contains(&-1) {
        return None; // mixed signs: outside; all zero: the line lies in the plane
    }
    let sum = &weights[0] + &weights[1] + &weights[2];
    let distance = determinant(&a, &b, &c);
    Some(ExactHit {
        weights,
        sum,
        distance,
    })
}

/// Three coordinates as integers in units of 2^-149, the smallest f32.
type Int3 = [BigInt; 3];

fn integers32(v: [f32; 3]) -> Int3 {
    v.map(|x| {
        let bits = x.to_bits();
        let exponent = (bits >> 23) & 0xff;
        let fraction = i64::from(bits & 0x7f_ffff);
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
        BigInt::from(signed) << exponent.saturating_sub(1)
    })
}

fn integers(v: Vec3) -> Int3 {
    // Every f64 that reaches this point was widened from f32.
    #[expect(clippy::cast_possible_truncation, reason = "exact: widened from f32")]
    integers32(v.map(|x| x as f32))
}

fn difference(a: &Int3, b: &Int3) -> Int3 {
    [&a[0] - &b[0], &a[1] - &b[1], &a[2] - &b[2]]
}

fn determinant(a: &Int3, b: &Int3, c: &Int3) -> BigInt {
    &a[0] * (&b[1] * &c[2] - &b[2] * &c[1])
        + &a[1] * (&b[2] * &c[0] - &b[0] * &c[2])
        + &a[2] * (&b[0] * &c[1] - &b[1] * &c[0])
}

fn sign(x: &BigInt) -> i32 {
    match x.sign() {
        Sign::Minus => -1,
        Sign::NoSign => 0,
        Sign::Plus => 1,
    }
}

/// `numerator / denominator` rounded once, to nearest even, to f32.
///
/// The quotient is first cut to about 40 bits with its last bit forced odd when something was cut
/// off (rounding to odd), so that the second rounding cannot go wrong (Boldo and Melquiond 2008).
fn round_to_f32(numerator: &BigInt, denominator: &BigInt) -> f32 {
    if numerator.sign() == Sign::NoSign {
        return 0.0;
    }
    let (n, d) = (numerator.magnitude(), denominator.magnitude());
    let bits = |x: u64| i64::try_from(x).expect("bit counts are small");
    let shift = 40 - (bits(n.bits()) - bits(d.bits()));
    let (n, d) = if shift >= 0 {
        (n << shift, d.clone())
    } else {
        (n.clone(), d << shift.unsigned_abs())
    };
    let quotient = &n / &d;
    let odd = u64::from(&quotient * &d != n);
    let head = u64::try_from(&quotient).expect("the quotient has at most 42 bits") | odd;
    let scale = 2.0_f64.powi(-i32::try_from(shift).expect("exponents are small"));
    let negative = (numerator.sign() == Sign::Minus) != (denominator.sign() == Sign::Minus);
    #[expect(clippy::cast_precision_loss, reason = "42 bits fit an f64 exactly")]
    let value = head as f64 * scale;
    #[expect(clippy::cast_possible_truncation, reason = "this is the one rounding")]
    let rounded = value as f32;
    if negative { -rounded } else { rounded }
}

/// The corners of a triangle seen from `o`.
pub fn from_origin(o: Vec3, v: [Vec3; 3]) -> [Vec3; 3] {
    v.map(|p| sub(p, o))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::vec3::widen;

    const TRIANGLE: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

    #[test]
    fn edges_corners_and_planes_are_told_apart() {
        let down = |x: f32, y: f32| intersect([x, y, 1.0], [0.0, 0.0, -1.0], TRIANGLE);
        assert_eq!(down(0.25, 0.25).map(|h| (h.t(), h.zeros())), Some((1.0, 0)));
        assert_eq!(down(0.25, 0.0).map(|h| (h.t(), h.zeros())), Some((1.0, 1)));
        assert_eq!(down(0.0, 0.0).map(|h| (h.t(), h.zeros())), Some((1.0, 2)));
        assert_eq!(down(-1e-30, 0.25), None);
        assert_eq!(intersect([-1.0, 0.2, 0.0], [1.0, 0.0, 0.0], TRIANGLE), None);
    }

    #[test]
    fn signs_agree_between_expansions_and_integers() {
        // o + d is not exact here, so the integers decide.
        let (o, d) = ([1e20_f32, 0.0, 1.0], [1.0_f32, 1e-20, -1.0]);
        let [a, b, _] = TRIANGLE.map(widen);
        let hit = |o: [f32; 3], d: [f32; 3]| edge_sign(widen(o), widen(d), a, b);
        assert_eq!(hit(o, d), -1);
        assert_eq!(hit([0.5, 0.0, 1.0], [0.0, 0.0, -1.0]), 0);
        assert_eq!(hit([0.5, 1e-38, 1.0], [0.0, 0.0, -1.0]).abs(), 1);
    }

    #[test]
    fn rounding_is_to_nearest_even() {
        let ratio = |n: i64, d: i64| round_to_f32(&BigInt::from(n), &BigInt::from(d));
        assert_eq!(ratio(1, 3), 1.0 / 3.0);
        assert_eq!(ratio(-2, 3), -2.0 / 3.0);
        assert_eq!(ratio((1 << 24) + 1, 1), 16_777_216.0); // a tie goes to the even neighbour
        assert_eq!(ratio(((1 << 24) + 1) * 1000 + 1, 1000), 16_777_218.0);
        assert_eq!(
            round_to_f32(&BigInt::from(3), &(BigInt::from(1) << 150)),
            f32::from_bits(2)
        );
        assert_eq!(
            round_to_f32(&(BigInt::from(1) << 200), &BigInt::from(1)),
            f32::INFINITY
        );
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
