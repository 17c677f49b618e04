// SPDX-License-Identifier: GPL-3.0-or-later
//! Which of two triangles is nearer to a point, whether a triangle is within a distance, and the rounded answer.
//!
//! f64 decides where its error bounds allow, integers decide the rest. Triangles that share the closest vertex or edge
//! are the most common case of equal distances, and are recognised without integers.

use crate::exact::{Unit, order};
use crate::feature::{Feature, Seen, ends};
use crate::number::{Bounded, Number};
use crate::span::Span;
use halfspace_geom::vec3::{Vec3, map, widen};
use std::cmp::Ordering;

/// A triangle and the interval of its squared distance from the point of a query.
#[derive(Debug, Clone, Copy)]
pub struct Candidate {
    /// Its index.
    pub id: u32,
    /// Its vertices.
    pub corners: [[f32; 3]; 3],
    /// Interval that contains its squared distance.
    pub span: Span,
}

/// The closest point of a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Closest {
    /// Its distance, correctly rounded; infinite if it exceeds the largest f32.
    pub distance: f32,
    /// The point, each coordinate correctly rounded.
    pub point: [f32; 3],
}

impl Candidate {
    /// Makes a candidate for a query at `point`.
    #[inline]
    pub fn new(point: [f32; 3], id: u32, corners: [[f32; 3]; 3]) -> Self {
        Self {
            id,
            corners,
            span: Span::new(point, corners),
        }
    }

    /// Returns the order of two candidates: by exact distance from `point`, then by index.
    #[inline]
    pub fn order(&self, other: &Self, point: [f32; 3]) -> Ordering {
        if self.span.high < other.span.low {
            return Ordering::Less;
        }
        if other.span.high < self.span.low {
            return Ordering::Greater;
        }
        exact_order(point, self.corners, other.corners).then(self.id.cmp(&other.id))
    }

    /// Returns whether the exact distance from `point` is at most `radius`.
    #[inline]
    pub fn is_within(&self, radius: f32, point: [f32; 3]) -> bool {
        // The square of an f32 is exact.
        let square = f64::from(radius) * f64::from(radius);
        if radius < 0.0 || self.span.low > square {
            return false;
        }
        self.span.high <= square || is_exactly_within(radius, point, self.corners)
    }

    /// Returns the closest point and its distance from `point`.
    #[inline]
    pub fn closest(&self, point: [f32; 3]) -> Closest {
        let distance = distance(self.span);
        match (distance, closest_point(point, self.corners)) {
            (Some(distance), Some(point)) => Closest { distance, point },
            (distance, found) => exact_closest(point, self.corners, distance, found),
        }
    }
}

/// Returns the f32 to which the roots of all numbers of an interval round, or `None` if there are several.
#[expect(clippy::cast_possible_truncation, reason = "rounding is the point")]
fn distance(span: Span) -> Option<f32> {
    let few = 4.0 * f64::EPSILON;
    let low = (span.low.sqrt() * (1.0 - few)) as f32;
    let high = (span.high.sqrt() * (1.0 + few)) as f32;
    (low == high).then_some(low)
}

/// Returns a triangle relative to a point, with error bounds.
fn bounded(point: [f32; 3], corners: [[f32; 3]; 3]) -> Seen<Bounded> {
    let (point, [a, b, c]) = (widen(point), map(corners, widen));
    let minus = |p: Vec3, q: Vec3| [0, 1, 2].map(|k: usize| Bounded::difference(p[k], q[k]));
    Seen {
        corners: [minus(a, point), minus(b, point), minus(c, point)],
        sides: [minus(c, b), minus(a, c), minus(b, a)],
    }
}

/// Returns the closest point, each coordinate correctly rounded, or `None` if f64 cannot decide.
fn closest_point(point: [f32; 3], corners: [[f32; 3]; 3]) -> Option<[f32; 3]> {
    let seen = bounded(point, corners);
    let feature = seen.feature()?;
    if let Feature::Vertex(k) = feature {
        return Some(corners[k].map(|x| x + 0.0)); // -0.0 becomes 0.0
    }
    let (offset, divisor) = seen.offset(feature);
    let divisor = divisor.expect("only vertices have none");
    let mut found = [0.0; 3];
    for k in 0..3 {
        let own = Bounded::exact(f64::from(point[k]));
        found[k] = own.plus(&offset[k].over(divisor)?).to_f32()?;
    }
    Some(found)
}

/// Returns the part that is certainly the closest, by the coordinates of its vertices in ascending order.
fn shared(point: [f32; 3], corners: [[f32; 3]; 3]) -> Option<[[u32; 3]; 2]> {
    let bits = |k: usize| corners[k].map(|x| (x + 0.0).to_bits());
    match bounded(point, corners).feature()? {
        Feature::Vertex(k) => Some([bits(k), bits(k)]),
        Feature::Edge(k) => {
            let (i, j) = ends(k);
            let mut both = [bits(i), bits(j)];
            both.sort_unstable();
            Some(both)
        }
        Feature::Face => None,
    }
}

/// Returns the order of two triangles by their exact distance from a point.
#[cold]
fn exact_order(point: [f32; 3], a: [[f32; 3]; 3], b: [[f32; 3]; 3]) -> Ordering {
    if let Some(part) = shared(point, a)
        && shared(point, b) == Some(part)
    {
        return Ordering::Equal;
    }
    let numbers = [point].into_iter().chain(a).chain(b).flatten();
    let unit = Unit::of(numbers);
    let squared = |corners| {
        let seen = unit.seen(point, corners);
        let feature = seen.feature().expect("integers are certain");
        seen.squared(feature)
    };
    order(&squared(a), &squared(b))
}

/// Returns whether the exact distance is at most `radius`, which is not negative.
#[cold]
fn is_exactly_within(radius: f32, point: [f32; 3], corners: [[f32; 3]; 3]) -> bool {
    if radius == f32::INFINITY {
        return true;
    }
    let numbers = [point].into_iter().chain(corners).flatten();
    let unit = Unit::of(numbers.chain([radius]));
    let seen = unit.seen(point, corners);
    let squared = seen.squared(seen.feature().expect("integers are certain"));
    let radius = unit.count(radius);
    let limit = crate::feature::Fraction {
        numerator: &radius * &radius,
        denominator: None,
    };
    order(&squared, &limit) != Ordering::Greater
}

/// Computes in integers what f64 could not: `None` among the distance and the point.
#[cold]
fn exact_closest(
    point: [f32; 3],
    corners: [[f32; 3]; 3],
    distance: Option<f32>,
    found: Option<[f32; 3]>,
) -> Closest {
    let unit = Unit::of([point].into_iter().chain(corners).flatten());
    let seen = unit.seen(point, corners);
    let feature = seen.feature().expect("integers are certain");
    let place = || {
        let (offset, divisor) = seen.offset(feature);
        let own = unit.point(point);
        let one = 1.into();
        let divisor = divisor.as_ref().unwrap_or(&one);
        [0, 1, 2].map(|k: usize| {
            let numerator = &own[k] * divisor + &offset[k];
            unit.rounded(&numerator, divisor.magnitude())
        })
    };
    Closest {
        distance: distance.unwrap_or_else(|| unit.root(&seen.squared(feature))),
        point: found.unwrap_or_else(place),
    }
}
