// SPDX-License-Identifier: GPL-3.0-or-later
//! The nearest triangle and overlaps by comparisons of integers alone: no f64, no error bounds, no tree, and other
//! formulas than those of the room `nearest`.
//!
//! All coordinates are integers in units of 2^-150, half of the smallest f32, in which the midpoints of neighbouring f32
//! are integers, too.

use halfspace_scene::Triangles;
use num_bigint::BigInt;
use std::cmp::Ordering;

/// A point in units of 2^-150.
type Point = [BigInt; 3];

/// The nearest triangle of a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExactNearest {
    /// Distance, rounded once; infinite if there is no triangle.
    pub distance: f32,
    /// Index of the triangle, the smallest at that exact distance; `u32::MAX` if there is none.
    pub triangle: u32,
    /// Closest point, each coordinate rounded once; NaN if there is no triangle.
    pub point: [f32; 3],
}

/// The closest point of a triangle: all numbers are quotients.
struct Closest {
    /// Numerator of the squared distance, whose denominator is the square of `divisor`.
    squared: BigInt,
    /// Numerators of the point.
    point: Point,
    /// Denominator of the point, positive.
    divisor: BigInt,
}

/// Returns the nearest of all finite triangles at most at `limit` from a point. The cost is O(n), for small inputs.
pub fn exact_nearest(scene: &Triangles, point: [f32; 3], limit: f32) -> ExactNearest {
    let none = ExactNearest {
        distance: f32::INFINITY,
        triangle: u32::MAX,
        point: [f32::NAN; 3],
    };
    if limit < 0.0 {
        return none;
    }
    let own = widen(point);
    let mut best: Option<(u32, Closest)> = None;
    for id in 0..u32::try_from(scene.len()).expect("at most 2^29") {
        let corners = scene.corners(id);
        if !corners.as_flattened().iter().all(|x| x.is_finite()) {
            continue;
        }
        let one = closest(&own, &corners.map(widen));
        if best.as_ref().is_none_or(|(_, best)| less(&one, best)) {
            best = Some((id, one));
        }
    }
    let within = |one: &Closest| {
        let reach = count(limit.to_bits()) * &one.divisor;
        limit == f32::INFINITY || one.squared <= &reach * &reach
    };
    let Some((triangle, one)) = best.filter(|(_, one)| within(one)) else {
        return none;
    };
    // Compare the square of a length with that of the distance.
    let distance = rounded(|length| {
        let length = length * &one.divisor;
        (&length * &length).cmp(&one.squared)
    });
    if distance == f32::INFINITY {
        return none;
    }
    let coordinate = |x: &BigInt| {
        let size = BigInt::from(x.magnitude().clone());
        let value = rounded(|length| (length * &one.divisor).cmp(&size));
        if *x < BigInt::ZERO {
            0.0 - value
        } else {
            value
        }
    };
    ExactNearest {
        distance,
        triangle,
        point: one.point.each_ref().map(coordinate),
    }
}

/// Returns whether two closed triangles of finite vertices have a point in common: no direction separates them.
pub fn exact_overlap(a: [[f32; 3]; 3], b: [[f32; 3]; 3]) -> bool {
    let (a, b) = (a.map(widen), b.map(widen));
    !directions(&a, &b).iter().any(|n| separates(n, &a, &b))
}

/// Returns a point in units of 2^-150.
fn widen(p: [f32; 3]) -> Point {
    p.map(|x| {
        let size = count(x.abs().to_bits());
        if x < 0.0 { -size } else { size }
    })
}

/// Returns the positive f32 of these bits in units of 2^-150; infinity counts as 2^128.
fn count(bits: u32) -> BigInt {
    let (exponent, fraction) = (bits >> 23, bits & 0x7f_ffff);
    match exponent {
        0 => BigInt::from(fraction) << 1,
        _ => BigInt::from(fraction | 0x80_0000) << exponent,
    }
}

/// Returns the f32 nearest to a positive number, of two the one with an even last bit. `order` compares an integer in
/// units of 2^-150 with the number.
fn rounded(order: impl Fn(&BigInt) -> Ordering) -> f32 {
    // Search the largest f32 that does not exceed the number.
    let (mut low, mut high) = (0, f32::INFINITY.to_bits() + 1);
    while high - low > 1 {
        let middle = low.midpoint(high);
        if order(&count(middle)) == Ordering::Greater {
            high = middle;
        } else {
            low = middle;
        }
    }
    if high > f32::INFINITY.to_bits() {
        return f32::INFINITY;
    }
    // Compare the middle between it and the next with the number.
    let middle: BigInt = (count(low) + count(high)) >> 1;
    let up = match order(&middle) {
        Ordering::Less => true,
        Ordering::Equal => low % 2 == 1,
        Ordering::Greater => false,
    };
    f32::from_bits(if up { high } else { low })
}

fn minus(a: &Point, b: &Point) -> Point {
    [0, 1, 2].map(|k: usize| &a[k] - &b[k])
}

fn dot(a: &Point, b: &Point) -> BigInt {
    &a[0] * &b[0] + &a[1] * &b[1] + &a[2] * &b[2]
}

fn cross(a: &Point, b: &Point) -> Point {
    let minor = |i: usize, j: usize| &a[i] * &b[j] - &a[j] * &b[i];
    [minor(1, 2), minor(2, 0), minor(0, 1)]
}

/// Returns whether the first distance is the smaller one.
fn less(a: &Closest, b: &Closest) -> bool {
    let square = |x: &BigInt| x * x;
    &a.squared * square(&b.divisor) < &b.squared * square(&a.divisor)
}

/// Returns the closest point of a triangle: the closest of those of its vertices, edges and face.
fn closest(p: &Point, corners: &[Point; 3]) -> Closest {
    let [a, b, c] = corners;
    let one = BigInt::from(1);
    let at = |weights: [BigInt; 3], divisor: BigInt| {
        let point = [0, 1, 2]
            .map(|k: usize| &a[k] * &weights[0] + &b[k] * &weights[1] + &c[k] * &weights[2]);
        let away = [0, 1, 2].map(|k: usize| &p[k] * &divisor - &point[k]);
        Closest {
            squared: dot(&away, &away),
            point,
            divisor,
        }
    };
    let mut found: Vec<_> = (0..3)
        .map(|k| {
            at(
                [0, 1, 2].map(|i| BigInt::from(i32::from(i == k))),
                one.clone(),
            )
        })
        .collect();
    // The foot on each edge, if it lies inside.
    for (i, j) in [(0, 1), (1, 2), (2, 0)] {
        let edge = minus(&corners[j], &corners[i]);
        let (along, length) = (dot(&minus(p, &corners[i]), &edge), dot(&edge, &edge));
        if BigInt::ZERO < along && along < length {
            let mut weights = [BigInt::ZERO, BigInt::ZERO, BigInt::ZERO];
            weights[i] = &length - &along;
            weights[j] = along;
            found.push(at(weights, length));
        }
    }
    // The foot on the plane, if it lies inside: the solution of the normal equations (Cramer's rule).
    let (u, v, r) = (minus(b, a), minus(c, a), minus(p, a));
    let (uu, uv, vv, ru, rv) = (
        dot(&u, &u),
        dot(&u, &v),
        dot(&v, &v),
        dot(&r, &u),
        dot(&r, &v),
    );
    let divisor = &uu * &vv - &uv * &uv;
    let (second, third) = (&ru * &vv - &rv * &uv, &rv * &uu - &ru * &uv);
    let first = &divisor - &second - &third;
    if [&first, &second, &third]
        .iter()
        .all(|&weight| *weight > BigInt::ZERO)
    {
        found.push(at([first, second, third], divisor));
    }
    let nearer = |a: Closest, b: Closest| if less(&b, &a) { b } else { a };
    found.into_iter().reduce(nearer).expect("three vertices")
}

/// Returns directions of which one separates two triangles if they are apart, whatever their dimensions.
///
/// The difference of two convex sets does not contain the origin if they are apart. The normals of its faces are
/// products of two edges; if it is flat, those of its sides are products of such a product and an edge; if it is a line,
/// its direction and what is perpendicular to it; if it is a point, that point.
fn directions(a: &[Point; 3], b: &[Point; 3]) -> Vec<Point> {
    let edges = |t: &[Point; 3]| {
        [
            minus(&t[1], &t[0]),
            minus(&t[2], &t[1]),
            minus(&t[0], &t[2]),
        ]
    };
    let edges: Vec<_> = edges(a).into_iter().chain(edges(b)).collect();
    let away = minus(&b[0], &a[0]);
    let mut found = vec![away.clone()];
    for (i, one) in edges.iter().enumerate() {
        let across = cross(one, &away);
        found.extend([one.clone(), cross(&across, one)]);
        for other in &edges[..i] {
            let normal = cross(one, other);
            found.extend(edges.iter().map(|edge| cross(&normal, edge)));
            found.push(normal);
        }
    }
    found
}

/// Returns whether all points of one triangle lie strictly farther along a direction than those of the other.
fn separates(direction: &Point, a: &[Point; 3], b: &[Point; 3]) -> bool {
    let heights = |t: &[Point; 3]| {
        let mut all = t.each_ref().map(|p| dot(direction, p));
        all.sort_unstable();
        all
    };
    let (a, b) = (heights(a), heights(b));
    a[2] < b[0] || b[2] < a[0]
}
