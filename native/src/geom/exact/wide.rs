// SPDX-License-Identifier: GPL-3.0-or-later
//! Signs of edge functions whose numbers differ so much in size that no integer type holds them.
//!
//! Multiplied out, `det[d, b - o, c - o] = det[d, b, c] + det[d, c, o] + det[d, o, b]`: eighteen
//! products of three f32. Each is an integer of 72 bits at some binary place, and they are added in
//! a number of fixed point that reaches over all places there are (Kulisch's accumulator). Nothing is
//! rounded, nothing is allocated, and the work is the same for all exponents.

use super::parts;

/// Bits of a limb that count; the others of its 64 take up carries: eighteen products come together.
const LIMB: usize = 32;

/// The least place of a product: that of the smallest f32, three times.
const LEAST: i32 = 3 * -149;

/// Limbs for products of 72 bits at any place up to that of the largest f32, and for carries.
const LIMBS: usize = 3 * 253 / LIMB + 5;

/// A mantissa and its exponent.
type Part = (i32, i32);

/// The signs (-1, 0, 1) of the three edge functions of a ray and a triangle, all finite.
#[cold]
pub(super) fn edge_signs(o: [f32; 3], d: [f32; 3], v: [[f32; 3]; 3]) -> [i32; 3] {
    let (o, d) = (o.map(parts), d.map(parts));
    let [a, b, c] = v.map(|p| p.map(parts));
    [[b, c], [c, a], [a, b]].map(|[p, q]| {
        let mut sum = Sum::default();
        sum.add_determinant(&d, &p, &q);
        sum.add_determinant(&d, &q, &o);
        sum.add_determinant(&d, &o, &p);
        sum.sign()
    })
}

/// A number of fixed point. Limbs are signed, and carry nothing before the end.
#[derive(Default)]
struct Sum {
    limbs: [i64; LIMBS],
}

impl Sum {
    fn add_determinant(&mut self, a: &[Part; 3], b: &[Part; 3], c: &[Part; 3]) {
        for (i, j, k) in [(0, 1, 2), (1, 2, 0), (2, 0, 1)] {
            self.add_product(a[i], b[j], c[k], 1);
            self.add_product(a[i], b[k], c[j], -1);
        }
    }

    fn add_product(&mut self, a: Part, b: Part, c: Part, sign: i64) {
        let product = i128::from(a.0) * i128::from(i64::from(b.0) * i64::from(c.0));
        if product == 0 {
            return;
        }
        let sign = if product < 0 { -sign } else { sign };
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

    /// -1, 0 or 1.
    fn sign(&self) -> i32 {
        let (mut carry, mut any) = (0, false);
        for limb in &self.limbs {
            let all = limb + carry;
            // What stays in the limb is not negative, whatever the sign of the whole.
            carry = all >> LIMB;
            any |= all & ((1 << LIMB) - 1) != 0;
        }
        // The carry out of the last limb is all that can be negative.
        if carry < 0 { -1 } else { i32::from(any) }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{sign, weights};
    use super::*;
    use crate::geom::exact::Units;
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
        fn signs_are_those_of_integers_of_any_size(
            o in point(), d in point(), corners in prop::array::uniform3(point()), aim in 0usize..4,
        ) {
            // Three in four are aimed at a corner or an edge.
            let d = match aim {
                3 => d,
                k => std::array::from_fn(|i| corners[k][i] / 2.0 + corners[aim / 2][i] / 2.0 - o[i]),
            };
            prop_assume!(d.iter().all(|x: &f32| x.is_finite()));
            let (long, seen) = Units::of(o, d, corners).large(o, d, corners);
            let plain = weights(&long, &seen).map(|w| sign(&w));
            prop_assert_eq!(edge_signs(o, d, corners), plain);
        }
    }

    #[test]
    fn the_largest_and_the_smallest_meet() {
        let (big, small) = (f32::MAX, f32::from_bits(1));
        // The largest products cancel but for the smallest one.
        let corners = [[big, 0.0, 0.0], [0.0, big, 0.0], [0.0, 0.0, 0.0]];
        assert_eq!(edge_signs([0.0; 3], [big, big, big], corners)[2], 1);
        assert_eq!(edge_signs([0.0; 3], [big, big, -big], corners)[2], -1);
        let thin = [[small, 0.0, 0.0], [0.0, small, 0.0], [0.0, 0.0, 0.0]];
        assert_eq!(edge_signs([0.0; 3], [0.0, 0.0, small], thin), [0, 0, 1]);
        assert_eq!(edge_signs([0.0; 3], [0.0, 0.0, -small], thin), [0, 0, -1]);
        assert_eq!(edge_signs([big; 3], [small; 3], [[big; 3]; 3]), [0; 3]);
    }
}
