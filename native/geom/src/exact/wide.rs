// SPDX-License-Identifier: GPL-3.0-or-later
//! Signs of edge functions whose coordinates differ too much in size for integers of 64 bits.
//!
//! Expanded, `det[d, b - o, c - o] = det[d, b, c] + det[d, c, o] + det[d, o, b]`: eighteen products of three f32.
//! Each is an integer of 72 bits at some binary place, and they are added to a fixed-point number that covers all
//! places (Kulisch's accumulator). Nothing is rounded, nothing is allocated, and the work is the same for all
//! exponents.

use crate::exact::parts;

/// Number of significant bits of a limb; the rest of its 64 bits hold the carries of eighteen products.
const LIMB: usize = 32;

/// Lowest binary place of a product: that of the cube of the smallest f32.
const LEAST: i32 = 3 * -149;

/// Number of limbs: the lowest bit of a product lies at most 3 * 253 places above [`LEAST`], because that of an f32
/// lies at most 253 above 2^-149; five further limbs hold the other bits of the highest product, and carries.
const LIMBS: usize = 3 * 253 / LIMB + 5;

/// A mantissa and its exponent.
type Part = (i32, i32);

/// Returns the sign (-1, 0, 1) of the edge function of a vertex, for a ray and a triangle, all finite.
#[cold]
pub fn edge_sign(o: [f32; 3], d: [f32; 3], v: [[f32; 3]; 3], vertex: usize) -> i32 {
    let (o, d) = (o.map(parts), d.map(parts));
    let (p, q) = (
        v[(vertex + 1) % 3].map(parts),
        v[(vertex + 2) % 3].map(parts),
    );
    let mut sum = Sum::default();
    sum.add_determinant(&d, &p, &q);
    sum.add_determinant(&d, &q, &o);
    sum.add_determinant(&d, &o, &p);
    sum.sign()
}

/// A fixed-point number. Limbs are signed, and carries are propagated only at the end.
#[derive(Default)]
struct Sum {
    limbs: [i64; LIMBS],
}

impl Sum {
    /// Adds the determinant of three rows.
    fn add_determinant(&mut self, a: &[Part; 3], b: &[Part; 3], c: &[Part; 3]) {
        for (i, j, k) in [(0, 1, 2), (1, 2, 0), (2, 0, 1)] {
            self.add_product(a[i], b[j], c[k], 1);
            self.add_product(a[i], b[k], c[j], -1);
        }
    }

    /// Adds the product of three numbers, multiplied by `sign`.
    fn add_product(&mut self, a: Part, b: Part, c: Part, sign: i64) {
        let product = i128::from(a.0) * i128::from(i64::from(b.0) * i64::from(c.0));
        if product == 0 {
            return;
        }
        let sign = if product < 0 { -sign } else { sign };
        // Shift the product to its place, and add it limb by limb; carries stay in the limbs.
        let place = usize::try_from(a.1 + b.1 + c.1 - LEAST).expect("no f32 is smaller");
        let mut rest = product.unsigned_abs() << (place % LIMB);
        for limb in &mut self.limbs[place / LIMB..] {
            if rest == 0 {
                break;
            }
            *limb += sign * i64::from(rest as u32);
            rest >>= LIMB;
        }
    }

    /// Returns the sign: -1, 0 or 1.
    fn sign(&self) -> i32 {
        let (mut carry, mut nonzero) = (0, false);
        for limb in &self.limbs {
            let all = limb + carry;
            // The shift rounds down, so what remains in the limb is not negative.
            carry = all >> LIMB;
            nonzero |= all & ((1 << LIMB) - 1) != 0;
        }
        // Only the carry out of the last limb can be negative.
        if carry < 0 { -1 } else { i32::from(nonzero) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exact::Units;
    use crate::exact::determinant::{sign, weights};
    use proptest::prelude::*;

    fn coordinate() -> impl Strategy<Value = f32> {
        prop_oneof![
            (-4i8..4).prop_map(f32::from),
            -1.0f32..1.0,
            (-4i16..4, -126i32..126).prop_map(|(m, e)| f32::from(m) * 2.0_f32.powi(e)),
            prop::num::f32::NORMAL | prop::num::f32::SUBNORMAL | prop::num::f32::ZERO,
            prop::sample::select(vec![
                f32::MAX,
                f32::MIN,
                f32::from_bits(1),
                -f32::from_bits(1)
            ]),
        ]
    }

    fn point() -> impl Strategy<Value = [f32; 3]> {
        [coordinate(), coordinate(), coordinate()]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]
        #[test]
        fn signs_equal_those_of_integers_of_any_size(
            o in point(), d in point(), corners in prop::array::uniform3(point()), aim in 0usize..4,
        ) {
            // Three of four rays are aimed at a vertex or an edge.
            let d = match aim {
                3 => d,
                k => std::array::from_fn(|i| corners[k][i] / 2.0 + corners[aim / 2][i] / 2.0 - o[i]),
            };
            prop_assume!(d.iter().all(|x: &f32| x.is_finite()));
            let (long, seen) = Units::of(o, d, corners).large(o, d, corners);
            let plain = weights(&long, &seen).map(|w| sign(&w));
            prop_assert_eq!([0, 1, 2].map(|vertex| edge_sign(o, d, corners, vertex)), plain);
        }
    }

    #[test]
    fn the_largest_and_the_smallest_meet() {
        let edge_signs = |o, d, v| [0, 1, 2].map(|vertex| edge_sign(o, d, v, vertex));
        let (big, small) = (f32::MAX, f32::from_bits(1));
        // The largest products cancel except for the smallest one.
        let corners = [[big, 0.0, 0.0], [0.0, big, 0.0], [0.0, 0.0, 0.0]];
        assert_eq!(edge_signs([0.0; 3], [big, big, big], corners)[2], 1);
        assert_eq!(edge_signs([0.0; 3], [big, big, -big], corners)[2], -1);
        let thin = [[small, 0.0, 0.0], [0.0, small, 0.0], [0.0, 0.0, 0.0]];
        assert_eq!(edge_signs([0.0; 3], [0.0, 0.0, small], thin), [0, 0, 1]);
        assert_eq!(edge_signs([0.0; 3], [0.0, 0.0, -small], thin), [0, 0, -1]);
        assert_eq!(edge_signs([big; 3], [small; 3], [[big; 3]; 3]), [0; 3]);
    }
}
