// SPDX-License-Identifier: GPL-3.0-or-later
//! The verdict: does this ray hit this triangle, and where?
//!
//! Every structure, traversal, instruction set and packet width asks this one function about each
//! candidate it finds, and so all give the same answer. The verdict is the exact one for the f32
//! inputs: hit or miss is decided on the closed triangle without error, and `t` is the correctly
//! rounded distance. f64 decides where its error bound allows (all but about one in a million
//! candidates); exact arithmetic decides the rest.
//!
//! Edge functions after Woop, Benthin and Wald 2013, section 3, without their shear; the bounds
//! are in the manner of Shewchuk 1997, section 4.3, coarser and cheaper.

use super::exact::{edge_signs, from_origin, intersect};
use super::vec3::{Vec3, cross, dot, map, widen};

/// A 3x3 determinant whose rows are differences rounded once is computed with 8 roundings
/// (three differences, two products, three sums), each of half an epsilon; each of its six
/// products is at most the product of its rows' largest components. Ten roundings leave room for the
/// second order and for the bound itself.
pub(crate) const DETERMINANT_ERROR: f64 = 6.0 * 5.0 * f64::EPSILON;

/// f64 computes `t` only where the determinant is at least this many times its own error.
const WELL_CONDITIONED: f64 = 1_048_576.0;

/// Where a ray meets a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Verdict {
    /// Distance in units of the ray's direction, correctly rounded to f32; may be negative.
    pub t: f32,
    /// Barycentric weight of the second corner.
    pub u: f32,
    /// Barycentric weight of the third corner.
    pub v: f32,
}

/// A vector and its largest component by absolute value.
#[derive(Clone, Copy)]
struct Sized {
    vector: Vec3,
    size: f64,
}

impl Sized {
    #[inline(always)]
    fn new(vector: Vec3) -> Self {
        Self {
            vector,
            size: vector[0].abs().max(vector[1].abs()).max(vector[2].abs()),
        }
    }
}

/// A determinant with a bound on its error.
#[derive(Clone, Copy)]
struct Bounded {
    value: f64,
    error: f64,
}

/// `row . (p x q)`, and its bound. Exchanging `p` and `q` changes the sign and nothing else.
#[inline(always)]
fn determinant(row: Sized, p: Sized, q: Sized) -> Bounded {
    Bounded {
        value: dot(row.vector, cross(p.vector, q.vector)),
        error: DETERMINANT_ERROR * (row.size * (p.size * q.size)),
    }
}

/// What the verdict knows of a triangle and an origin before it knows the direction, for directions
/// whose components are below 2.
#[derive(Debug, Clone, Copy)]
pub struct FromOrigin {
    /// The weight of each corner is the product of its normal with the direction.
    pub normals: [Vec3; 3],
    /// Bounds on the errors of the weights.
    pub errors: [f64; 3],
    /// The distance times the sum of the weights, and a bound on its error.
    pub distance: (f64, f64),
}

impl FromOrigin {
    /// `t` is certain where the sum of the weights is this many times its own error.
    pub const WELL_CONDITIONED: f64 = WELL_CONDITIONED;

    /// From an origin and corners.
    #[inline(always)]
    pub fn new(o: [f32; 3], [a, b, c]: [[f32; 3]; 3]) -> Self {
        let [a, b, c] = from_origin(widen(o), [widen(a), widen(b), widen(c)]);
        let (a, b, c) = (Sized::new(a), Sized::new(b), Sized::new(c));
        let distance = determinant(a, b, c);
        let error = |p: Sized, q: Sized| DETERMINANT_ERROR * (2.0 * (p.size * q.size));
        Self {
            normals: [
                cross(b.vector, c.vector),
                cross(c.vector, a.vector),
                cross(a.vector, b.vector),
            ],
            errors: [error(b, c), error(c, a), error(a, b)],
            distance: (distance.value, distance.error),
        }
    }
}

/// Decides on the line `o + t d` and the closed triangle `v`. A line in the triangle's plane misses
/// it; a triangle without area is missed by every line. `d` need not be of unit length.
///
/// Only a `t` inside the closed interval `span` matters: where f64 proves
/// that `t` lies outside it, its last bits are not worked out and the answer is a miss. This is
/// what happens to the triangle that a scattered ray starts from, whose `t` is all rounding error.
#[inline(always)]
pub fn verdict_within(
    o: [f32; 3],
    d: [f32; 3],
    v: [[f32; 3]; 3],
    span: [f32; 2],
) -> Option<Verdict> {
    let (o64, d64, v64) = (widen(o), widen(d), map(v, widen));
    let [a, b, c] = map(from_origin(o64, v64), Sized::new);
    let direction = Sized::new(d64);
    let mut w = [
        determinant(direction, b, c),
        determinant(direction, c, a),
        determinant(direction, a, b),
    ];
    let positive = w.iter().any(|w| w.value > w.error);
    let negative = w.iter().any(|w| w.value < -w.error);
    if positive && negative {
        return None;
    }
    if w.iter().any(|w| w.value.abs() <= w.error) && !settle_signs(o, d, v, &mut w) {
        return None;
    }

    // Weights of one sign: their sum is as accurate as they are.
    let sum = w[0].value + w[1].value + w[2].value;
    let sum_error = w[0].error + w[1].error + w[2].error + 2.0 * f64::EPSILON * sum.abs();
    if sum.abs() > WELL_CONDITIONED * sum_error {
        let distance = determinant(a, b, c);
        let inverse = 1.0 / sum;
        let t = distance.value * inverse;
        // 1 / (sum - error) is at most 1 + 2^-19 times as large.
        let slack = (distance.error + t.abs() * sum_error) * inverse.abs() * (1.0 + 2e-6)
            + 2.0 * f64::EPSILON * t.abs();
        #[expect(clippy::cast_possible_truncation, reason = "rounding is the point")]
        let (low, high) = ((t - slack) as f32, (t + slack) as f32);
        if high < span[0] || low > span[1] {
            return None;
        }
        if low == high {
            #[expect(clippy::cast_possible_truncation, reason = "rounding is the point")]
            return Some(Verdict {
                t: low + 0.0, // -0.0 becomes 0.0
                u: (w[1].value * inverse) as f32,
                v: (w[2].value * inverse) as f32,
            });
        }
    }
    exact_verdict(o, d, v)
}

/// Replaces each edge function that f64 cannot tell from zero by its exact sign; says whether
/// the ray still hits.
#[cold]
fn settle_signs(o: [f32; 3], d: [f32; 3], v: [[f32; 3]; 3], w: &mut [Bounded; 3]) -> bool {
    let signs = edge_signs(o, d, v);
    for (w, sign) in w.iter_mut().zip(signs) {
        if w.value.abs() <= w.error {
            // The magnitude below the bound is noise; the sign is now certain.
            w.value = f64::from(sign) * w.value.abs();
        }
    }
    signs.contains(&1) != signs.contains(&-1)
}

#[cold]
fn exact_verdict(o: [f32; 3], d: [f32; 3], v: [[f32; 3]; 3]) -> Option<Verdict> {
    let hit = intersect(o, d, v)?;
    Some(Verdict {
        t: hit.t + 0.0,
        u: hit.weights[0],
        v: hit.weights[1],
    })
}

/// The same wherever on the line.
#[cfg(test)]
pub(crate) fn verdict(o: [f32; 3], d: [f32; 3], v: [[f32; 3]; 3]) -> Option<Verdict> {
    verdict_within(o, d, v, [f32::NEG_INFINITY, f32::INFINITY])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn agrees_with_exact(o: [f32; 3], d: [f32; 3], v: [[f32; 3]; 3]) {
        let fast = verdict(o, d, v);
        let slow = exact_verdict(o, d, v);
        assert_eq!(
            fast.map(|h| h.t),
            slow.map(|h| h.t),
            "o {o:?} d {d:?} v {v:?}"
        );
        if let (Some(f), Some(s)) = (fast, slow) {
            assert!(
                (f.u - s.u).abs() <= 1e-5 && (f.v - s.v).abs() <= 1e-5,
                "{f:?} {s:?}"
            );
        }
    }

    /// Coordinates of few bits meet edges, corners and planes exactly; wild ones span exponents.
    fn coordinate() -> impl Strategy<Value = f32> {
        prop_oneof![
            (-8i8..8).prop_map(f32::from),
            (-8i8..8).prop_map(|x| f32::from(x) / 8.0),
            -1.0f32..1.0,
            prop::num::f32::NORMAL | prop::num::f32::SUBNORMAL | prop::num::f32::ZERO,
        ]
    }

    fn point() -> impl Strategy<Value = [f32; 3]> {
        [coordinate(), coordinate(), coordinate()]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]
        #[test]
        fn every_verdict_is_the_exact_one(o in point(), d in point(), a in point(), b in point(), c in point()) {
            agrees_with_exact(o, d, [a, b, c]);
        }

        #[test]
        fn rays_through_edges_are_decided_exactly(
            o in point(), a in point(), b in point(), c in point(), s in 0.0f32..1.0
        ) {
            // Aimed at a point of the edge a b, so that f64 often cannot tell the sign.
            let d = std::array::from_fn(|k| a[k] + s * (b[k] - a[k]) - o[k]);
            prop_assume!(d.iter().all(|x: &f32| x.is_finite()));
            agrees_with_exact(o, d, [a, b, c]);
        }
    }

    #[test]
    fn a_span_leaves_out_what_it_excludes_and_nothing_else() {
        // A ray that starts a hair above the triangle: t is tiny and hard to round.
        let v = [[0.1, 0.2, 0.3], [1.7, 0.4, 0.9], [0.6, 1.9, 0.5]];
        let mut decided = 0;
        for i in 0..2000_i16 {
            let lift = f32::from(i - 1000) * 1e-9;
            let o = [0.7 + lift, 0.7, 0.48 + lift];
            let d = [0.3, f32::from(i % 7) * 0.1 - 0.2, 0.9];
            let free = verdict(o, d, v);
            for span in [
                [0.0, f32::INFINITY],
                [f32::NEG_INFINITY, 0.0],
                [-0.01, 0.01],
            ] {
                let inside = free.filter(|f| span[0] <= f.t && f.t <= span[1]);
                let kept =
                    verdict_within(o, d, v, span).filter(|f| span[0] <= f.t && f.t <= span[1]);
                assert_eq!(kept, inside, "{o:?} {d:?} {span:?}");
                decided += usize::from(inside.is_some());
            }
        }
        assert!(decided > 100, "{decided}");
    }

    #[test]
    fn a_shared_edge_lets_no_ray_through() {
        // Two triangles of one quad; each ray through the diagonal hits one of them or both.
        let quad = [
            [0.1_f32, 0.2, 0.3],
            [1.3, 0.1, 0.2],
            [1.1, 1.4, 0.5],
            [-0.2, 1.2, 0.4],
        ];
        let (first, second) = ([quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]);
        for i in 1_u16..2000 {
            let s = f32::from(i) / 2000.0;
            let target: [f32; 3] =
                std::array::from_fn(|k| quad[0][k] + s * (quad[2][k] - quad[0][k]));
            let o = [0.3, 0.7, 5.0];
            let d = std::array::from_fn(|k| target[k] - o[k]);
            assert!(
                verdict(o, d, first).is_some() || verdict(o, d, second).is_some(),
                "ray {i}"
            );
        }
    }
}
