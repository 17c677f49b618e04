// SPDX-License-Identifier: GPL-3.0-or-later
//! The verdict: whether a ray hits a triangle, and where.
//!
//! Every structure, traversal, instruction set and packet width calls this one function for each candidate it
//! finds; therefore all give the same answer. The verdict is exact for the f32 inputs: hit or miss is decided on the
//! closed triangle without error, and `t`, `u` and `v` are correctly rounded: each is the f32 nearest to the exact
//! value, and none is -0.0. f64 decides where its error bound allows; exact arithmetic decides the rest.
//!
//! Edge functions follow Woop, Benthin and Wald 2013, section 3, without their shear; the bounds are in the manner
//! of Shewchuk 1997, section 4.3, coarser and cheaper.

use crate::exact::{edge_signs, from_origin, intersect};
use crate::vec3::{Vec3, cross, dot, map, sub, widen};

/// Relative error of a 3x3 determinant whose rows are differences rounded once. Derived: 8 roundings (three
/// differences, two products, three sums), each of half an epsilon; each of the six products is at most the
/// product of its rows' largest components. Ten roundings cover second-order terms and the rounding of the bound
/// itself.
pub const DETERMINANT_ERROR: f64 = 6.0 * 5.0 * f64::EPSILON;

/// f64 computes `t` and the weights only if their sum is at least this multiple of the sum of error bounds, 2^22:
/// to about two roundings of f32.
const WELL_CONDITIONED: f64 = 4_194_304.0;

/// Intersection of a ray and a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Verdict {
    /// Distance in units of the ray's direction, correctly rounded to f32; may be negative.
    pub t: f32,
    /// Barycentric weight of the second vertex, correctly rounded to f32, from 0 to 1.
    pub u: f32,
    /// Barycentric weight of the third vertex, correctly rounded to f32, from 0 to 1.
    pub v: f32,
}

/// A triangle relative to an origin. The edge function of two vertices is computed from one of them and the side
/// between them: two vertices would also do, but they are as long as the triangle's distance, and so would be the
/// error.
struct Seen {
    corners: [Vec3; 3],
    /// Sides opposite to the vertices, in order around the triangle.
    sides: [Vec3; 3],
    /// Largest component of the first vertex. Those of the others are at most this plus `size`.
    first: f64,
    /// Largest component of the sides that begin at the first vertex. Those of the other side are at most twice
    /// this.
    size: f64,
}

impl Seen {
    #[inline(always)]
    fn new(o: Vec3, v: [Vec3; 3]) -> Self {
        let [a, b, c] = v;
        let corners = from_origin(o, v);
        let sides = [sub(c, b), sub(a, c), sub(b, a)];
        Self {
            corners,
            sides,
            first: largest(corners[0]),
            size: larger(largest(sides[1]), largest(sides[2])),
        }
    }

    /// Returns the vectors whose products with a direction are the edge functions, the weights of the vertices.
    #[inline(always)]
    fn normals(&self) -> [Vec3; 3] {
        let ([a, b, c], [of_a, of_b, of_c]) = (self.corners, self.sides);
        [cross(b, of_a), cross(c, of_b), cross(a, of_c)]
    }

    /// Returns the vector whose product with a direction is the sum of the edge functions, and whose product with
    /// a vertex is `t` multiplied by that sum.
    #[inline(always)]
    fn normal(&self) -> Vec3 {
        cross(self.sides[1], self.sides[2])
    }

    /// Rounds the shares of the second and third vertex as [`rounded`], with bounds that are several times smaller and
    /// take longer.
    #[cold]
    fn rounded(
        &self,
        direction: Vec3,
        sum_error: f64,
        inverse: f64,
        shares: [f64; 2],
    ) -> Option<[f32; 2]> {
        let slack = [1, 2].map(|vertex: usize| {
            let corner = self.corners[(vertex + 1) % 3].map(f64::abs);
            let side = self.sides[vertex].map(f64::abs);
            let minor = |i: usize, j: usize| corner[i] * side[j] + corner[j] * side[i];
            let minors = [minor(1, 2), minor(2, 0), minor(0, 1)];
            let error = PERMANENT_ERROR * dot(direction.map(f64::abs), minors);
            (error + sum_error) * inverse.abs() * WEIGHT_SLACK
        });
        rounded(shares, slack)
    }

    /// Returns bounds on the errors of the edge functions, of their sum, and of `t` multiplied by it, for
    /// directions with components up to `longest`.
    #[inline(always)]
    fn errors(&self, longest: f64) -> Errors {
        let (first, size) = (self.first, self.size);
        Errors {
            // The rows have components up to `longest`, `first` plus `size`, and twice `size`.
            weight: DETERMINANT_ERROR * (2.0 * longest * ((first + size) * size)),
            sum: DETERMINANT_ERROR * (longest * (size * size)),
            distance: DETERMINANT_ERROR * (first * (size * size)),
        }
    }
}

/// Factor from the error bounds of a weight and of the sum, added up and divided by the sum, to an error bound of the
/// weight of a hit in units of the sum, `u` or `v`. Derived: these are at most 1, and the bound of the sum is at least
/// five epsilon of it; half of that covers the two roundings of the quotient, that of an interval's end, and the error
/// of the sum in the denominator.
pub const WEIGHT_SLACK: f64 = 1.5;

/// Relative error of a 3x3 determinant as in [`DETERMINANT_ERROR`], in the sum of the absolute values of its six
/// products. Derived: seven roundings of each, of half an epsilon.
const PERMANENT_ERROR: f64 = 4.0 * f64::EPSILON;

/// Error bounds of the terms of a verdict.
#[derive(Debug, Clone, Copy)]
pub struct Errors {
    /// Error bound of each edge function.
    pub weight: f64,
    /// Error bound of their sum.
    pub sum: f64,
    /// Error bound of the distance multiplied by the sum.
    pub distance: f64,
}

/// Returns the larger of two numbers, in one instruction; `f64::max` takes four, because it handles NaN.
#[inline(always)]
fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// Returns the smaller of two numbers.
#[inline(always)]
fn smaller(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// Returns the largest component by absolute value.
#[inline(always)]
fn largest(v: Vec3) -> f64 {
    larger(larger(v[0].abs(), v[1].abs()), v[2].abs())
}

/// The terms of the verdict on a triangle that depend only on the ray's origin, for directions with components
/// below 2.
#[derive(Debug, Clone, Copy)]
pub struct FromOrigin {
    /// Vectors whose products with the direction are the weights of the vertices.
    pub normals: [Vec3; 3],
    /// Vector whose product with the direction is the sum of the weights.
    pub normal: Vec3,
    /// Distance multiplied by the sum of the weights.
    pub distance: f64,
    /// Error bounds.
    pub errors: Errors,
}

impl FromOrigin {
    /// `t` and the weights are accurate if their sum is at least this multiple of the sum of error bounds.
    pub const WELL_CONDITIONED: f64 = WELL_CONDITIONED;

    /// Computes the terms from an origin and the vertices.
    #[inline(always)]
    pub fn new(o: [f32; 3], corners: [[f32; 3]; 3]) -> Self {
        let seen = Seen::new(widen(o), map(corners, widen));
        let normal = seen.normal();
        Self {
            normals: seen.normals(),
            normal,
            distance: dot(seen.corners[0], normal),
            errors: seen.errors(2.0),
        }
    }
}

/// Decides on the line `o + t d` and the closed triangle `v`. A line in the triangle's plane misses it; a triangle
/// without area is missed by every line. `d` need not be of unit length.
///
/// Only a `t` inside the closed interval `span` matters: if f64 proves that `t` lies outside it, the answer is a
/// miss without further computation. This is the case for the triangle from which a scattered ray starts, whose
/// `t` is all rounding error.
#[inline(always)]
pub fn verdict_within(
    o: [f32; 3],
    d: [f32; 3],
    v: [[f32; 3]; 3],
    span: [f32; 2],
) -> Option<Verdict> {
    let direction = widen(d);
    let seen = Seen::new(widen(o), map(v, widen));
    let errors = seen.errors(largest(direction));
    let mut w = map(seen.normals(), |normal| dot(direction, normal));
    // Reject by the signs of the edge functions where they are certain.
    let most = larger(larger(w[0], w[1]), w[2]);
    let least = smaller(smaller(w[0], w[1]), w[2]);
    if most > errors.weight && least < -errors.weight {
        return None;
    }
    let unsure = most >= -errors.weight && least <= errors.weight;

    // Compute the distance if the sum of the weights is accurate enough.
    let normal = seen.normal();
    let sum = dot(direction, normal);
    let errors_of_both = errors.sum + errors.weight;
    if sum.abs() > WELL_CONDITIONED * errors_of_both {
        let inverse = 1.0 / sum;
        let t = dot(seen.corners[0], normal) * inverse;
        // 1 / (sum - error) is at most 1 + 2^-22 times 1 / sum.
        let slack = (errors.distance + t.abs() * errors.sum) * inverse.abs() * (1.0 + 2e-6)
            + 2.0 * f64::EPSILON * t.abs();
        #[expect(clippy::cast_possible_truncation, reason = "rounding is the point")]
        let (low, high) = ((t - slack) as f32, (t + slack) as f32);
        // Leave out what the span excludes before its signs are settled: of the triangles around a vertex most are.
        if high < span[0] || low > span[1] {
            return None;
        }
        if unsure && !settle_signs(o, d, v, &mut w, errors.weight) {
            return None;
        }
        // Accept the numbers only if the whole error interval of each rounds to one f32.
        let t = low + 0.0; // -0.0 becomes 0.0
        let shares = [w[1] * inverse, w[2] * inverse];
        let slack = errors_of_both * inverse.abs() * WEIGHT_SLACK;
        if low == high
            && let Some([u, v]) = rounded(shares, [slack; 2])
                .or_else(|| seen.rounded(direction, errors.sum, inverse, shares))
        {
            return Some(Verdict { t, u, v });
        }
    } else if unsure && !settle_signs(o, d, v, &mut w, errors.weight) {
        return None;
    }
    exact_verdict(o, d, v)
}

/// Rounds both shares if all numbers in the error interval of each round to the same f32. A share of 0 is exactly 0:
/// others have a sign, which is certain.
#[inline(always)]
fn rounded(shares: [f64; 2], slack: [f64; 2]) -> Option<[f32; 2]> {
    #[expect(clippy::cast_possible_truncation, reason = "rounding is the point")]
    let ends = [0, 1].map(|i: usize| {
        let (x, slack) = (shares[i], if shares[i] == 0.0 { 0.0 } else { slack[i] });
        [(x - slack) as f32 + 0.0, (x + slack) as f32 + 0.0]
    });
    let sure = ends[0][0] == ends[0][1] && ends[1][0] == ends[1][1];
    sure.then_some([ends[0][0], ends[1][0]])
}

/// Replaces each edge function whose sign f64 cannot determine by a number with the exact sign, which differs from it
/// by at most the error bound, or by zero. Returns whether the ray still hits.
#[cold]
fn settle_signs(
    o: [f32; 3],
    d: [f32; 3],
    v: [[f32; 3]; 3],
    weights: &mut [f64; 3],
    error: f64,
) -> bool {
    #[cfg(test)]
    tests::SETTLED.with(|count| count.set(count.get() + 1));
    let unsure = weights.map(|w| w.abs() <= error);
    let signs = edge_signs(o, d, v, unsure);
    for ((w, sign), unsure) in weights.iter_mut().zip(signs).zip(unsure) {
        if unsure {
            *w = f64::from(sign) * error;
        }
    }
    let has = |side: f64| weights.iter().any(|w| w * side > 0.0);
    has(1.0) != has(-1.0)
}

/// Decides in exact arithmetic.
#[cold]
fn exact_verdict(o: [f32; 3], d: [f32; 3], v: [[f32; 3]; 3]) -> Option<Verdict> {
    #[cfg(test)]
    tests::EXACT.with(|count| count.set(count.get() + 1));
    let hit = intersect(o, d, v)?;
    Some(Verdict {
        t: hit.t + 0.0,
        u: hit.weights[0],
        v: hit.weights[1],
    })
}

/// Returns the verdict on a ray without limits.
pub fn verdict(o: [f32; 3], d: [f32; 3], v: [[f32; 3]; 3]) -> Option<Verdict> {
    verdict_within(o, d, v, [f32::NEG_INFINITY, f32::INFINITY])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exact::tests::ANY_SIZE;
    use halfspace_oracle::cases::Random;
    use proptest::prelude::*;
    use std::cell::Cell;

    thread_local! {
        /// Number of verdicts that this thread decided in exact arithmetic.
        pub static EXACT: Cell<u32> = const { Cell::new(0) };
        /// Number of verdicts for which signs of weights were settled.
        pub static SETTLED: Cell<u32> = const { Cell::new(0) };
    }

    fn agrees_with_exact(o: [f32; 3], d: [f32; 3], v: [[f32; 3]; 3]) {
        let fast = verdict(o, d, v);
        let slow = exact_verdict(o, d, v);
        let bits = |h: Verdict| [h.t, h.u, h.v].map(f32::to_bits);
        assert_eq!(
            fast.map(bits),
            slow.map(bits),
            "{fast:?} {slow:?} o {o:?} d {d:?} v {v:?}"
        );
        let sound = |x: f32| x.is_sign_positive() && x <= 1.0;
        assert!(fast.is_none_or(|h| sound(h.u) && sound(h.v)), "{fast:?}");
    }

    /// Generates coordinates of few bits, which meet edges, vertices and planes exactly, and others of any
    /// exponent.
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
            // Aimed at a point of the edge a b, where f64 often cannot determine the sign.
            let d = std::array::from_fn(|k| a[k] + s * (b[k] - a[k]) - o[k]);
            prop_assume!(d.iter().all(|x: &f32| x.is_finite()));
            agrees_with_exact(o, d, [a, b, c]);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]
        /// Triangles at distances up to millions of times their size, and seen from close to their plane.
        #[test]
        fn small_triangles_far_away_are_decided_exactly(
            centre in point(), o in point(), sides in [-1.0f32..1.0, -1.0f32..1.0, -1.0f32..1.0, -1.0f32..1.0, -1.0f32..1.0, -1.0f32..1.0],
            shrink in 0i32..40, (s, t) in (-0.1f32..1.1, -0.1f32..1.1)
        ) {
            let size = 2.0f32.powi(-shrink);
            let corner = |i: usize| std::array::from_fn(|k| centre[k] + size * sides[3 * i + k]);
            let (a, b, c) = (centre, corner(0), corner(1));
            let d = std::array::from_fn(|k| {
                a[k] * (1.0 - s) * (1.0 - t) + b[k] * s + c[k] * t * (1.0 - s) - o[k]
            });
            prop_assume!(d.iter().chain(&b).chain(&c).all(|x: &f32| x.is_finite()));
            agrees_with_exact(o, d, [a, b, c]);
        }
    }

    /// Errors must grow only linearly with the distance: each pixel of a picture may show one triangle, or several.
    #[test]
    fn f64_decides_on_triangles_of_a_pixel_and_on_most_of_a_hundredth() {
        for (size, most) in [(1e-3, 100), (1e-5, 5)] {
            let mut random = Random(11);
            let before = EXACT.get();
            let mut hits = 0;
            for _ in 0..20_000 {
                let o = random.point(-1.0, 1.0);
                let v: [[f32; 3]; 3] = std::array::from_fn(|_| random.point(-size, size));
                let [s, t, _] = random.point(0.0, 0.5);
                let d = std::array::from_fn(|k| {
                    v[0][k] * (1.0 - s - t) + v[1][k] * s + v[2][k] * t - o[k]
                });
                hits += u32::from(verdict(o, d, v).is_some());
            }
            let exact = EXACT.get() - before;
            assert!(hits > 15_000 && most * exact < hits, "{exact} of {hits}");
        }
    }

    /// Rays through vertices and edges of a terrain, from above and aslant, which have weights of 0, need no integers of
    /// any size.
    #[test]
    fn rays_through_vertices_need_only_short_integers() {
        let height = |x: f32, y: f32| 3.0 * (0.1 * x).sin() * (0.07 * y).cos();
        let mut random = Random(12);
        let (before, any_size) = (EXACT.get(), ANY_SIZE.get());
        let mut hits = [0_u32; 2];
        for i in 0..20_000_u16 {
            let [x, y] = [i % 199, i / 199].map(f32::from);
            let v = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]
                .map(|[i, j]: [f32; 2]| [x + i, y + j, height(x + i, y + j)]);
            let at = if i % 2 == 0 {
                v[0]
            } else {
                [x + 0.5, y + 0.5, 0.0]
            };
            hits[0] += u32::from(verdict([at[0], at[1], 50.0], [0.0, 0.0, -1.0], v).is_some());
            // Aim at a vertex that few bits describe.
            let [o, a] = [random.point(-50.0, 50.0), random.point(-9.0, 9.0)];
            let o = o.map(|x| x.round() / 4.0);
            let v = [a.map(|x| x.round() / 8.0), v[1], v[2]];
            let d = std::array::from_fn(|k| v[0][k] - o[k]);
            hits[1] += u32::from(verdict(o, d, v).is_some());
        }
        assert_eq!(hits[0], 20_000);
        assert!(hits[1] > 19_900, "{hits:?}");
        let exact = EXACT.get() - before;
        assert!(exact < 2_000, "{exact}");
        assert_eq!(ANY_SIZE.get() - any_size, 0);
    }

    /// Of six triangles around a vertex, all at one distance, only the first needs the signs of its weights.
    #[test]
    fn triangles_that_cannot_precede_a_hit_need_no_signs() {
        let rim = [
            [1.0, 0.0],
            [0.0, 1.0],
            [-1.0, 1.0],
            [-1.0, 0.0],
            [0.0, -1.0],
            [1.0, -1.0],
        ];
        let rim = rim.map(|[x, y]: [f32; 2]| [x, y, 0.1 * x - 0.3 * y]);
        let before = SETTLED.get();
        let mut end = f32::INFINITY;
        for i in 0..6 {
            let fan = [[0.0, 0.0, 0.25], rim[i], rim[(i + 1) % 6]];
            let found = verdict_within([0.0, 0.0, 9.0], [0.0, 0.0, -1.0], fan, [0.0, end]);
            assert_eq!(found.map(|hit| hit.t), (i == 0).then_some(8.75));
            end = 8.75_f32.next_down();
        }
        assert_eq!(SETTLED.get() - before, 1);
    }

    #[test]
    fn a_span_leaves_out_what_it_excludes_and_nothing_else() {
        // The ray starts very close to the triangle: t is tiny and hard to round.
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
        // Two triangles of one quad: each ray through the diagonal must hit at least one of them.
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
