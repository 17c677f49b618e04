// SPDX-License-Identifier: GPL-3.0-or-later
//! Forms of beams: rays share their origin, so that a beam is a pyramid, or their direction, so that it is a prism,
//! a pyramid with its apex at infinity.
//!
//! Both are one projective form. A ray of an octant has a place `r` and speeds `m >= 0`, and reaches plane `k` at the
//! distance `(a[k] - r[k]) / m[k]`, where `a[k]` is the offset of the plane. Rays from a point have `r = 0` and their
//! own `m`; parallel rays have their own `r` and the same `m`. Three numbers of each ray, its `way`, are therefore
//! enough, and everything that distinguishes the two forms is in this file.

use crate::line::{Ahead, Line, Side};
use crate::rays::{Sorted, eight};
use fearless_simd::{Simd, SimdBase, SimdFloat, SimdMask, f32x8};
use halfspace_geom::bound::keep_min;
use halfspace_leaf::lanes::{Along, Seen};
use halfspace_nodes::octree_nodes::Octree;
use halfspace_ray::frame::Frame;

/// Tolerance of the height of a corner over a line, relative to the offsets. Derived: a height has a rounding error of
/// less than 8 units of f64 in the offsets; a polygon larger by this factor moves a ray by less than 1e-10 of the
/// scene's size, and leaves contain what is within 1e-6 of it.
const TOLERANCE: f64 = 1e-11;

/// Origin or direction that the rays of a beam share.
pub trait Form: Copy {
    /// The terms of the triangle test that are computed once for all rays.
    type Triangle;

    /// Largest component of `r`.
    const REACH: f32;

    /// `r` and `m` of rays with these ways. `number` makes a number of the type of ways.
    fn parts<T: Copy>(&self, way: [T; 3], number: impl Fn(f32) -> T) -> [[T; 3]; 2];

    /// The point from which the offsets of planes are measured, in the frame.
    fn middle(&self) -> [f64; 3];

    /// Factor from the frame's lengths to those of offsets, a power of two.
    fn scale(&self) -> f64;

    /// The common origin, from which a beam may begin inside the scene; `None` if all beams begin before it.
    fn origin(&self) -> Option<[f32; 3]>;

    /// Coefficients of the height over a line at the point `p`, `q` of the plane of polygons: those of `p` and `q`, and
    /// the constant. A height above 0 means that the plane of the lower axis comes later.
    fn coefficients(&self, line: &Line) -> [f64; 3];

    /// Heights up to this count as on the line.
    fn tolerance(&self, line: &Line) -> f64;

    /// Whether no ray crosses either plane of a line, whatever its way.
    fn is_along(&self, line: &Line) -> bool;

    /// Whether all rays on the side `old` are on the side `new` too; if not, all those of `new` are on `old`. `None` if
    /// neither is known. Exact: two sides of one line contain each other.
    fn contains(&self, new: &Side, old: &Side) -> Option<bool>;

    /// The points `p`, `q` of eight rays in the plane of polygons, in which all beams are convex.
    fn places<S: Simd>(&self, simd: S, way: [f32x8<S>; 3]) -> [f32x8<S>; 2];

    /// Prepares a triangle with these vertices in the frame, for rays of the octant whose signs are `sign`.
    fn face(&self, sign: [f32; 3], corners: [[f32; 3]; 3]) -> Self::Triangle;

    /// The mask of those of eight sorted rays, from index `at` on, that may hit a triangle before their best hits.
    fn candidates<S: Simd>(simd: S, triangle: &Self::Triangle, rays: &Sorted, at: usize) -> u64;

    /// The mask of those of eight sorted rays, from index `at` on, that begin behind one of these planes.
    fn late<S: Simd>(&self, simd: S, rays: &Sorted, at: usize, planes: [Ahead; 3]) -> u64;

    /// Largest distance, in the frame and from its own origin, of a hit that could be better for a sorted ray.
    fn reach(rays: &Sorted, i: usize) -> f32;

    /// Cuts the reach of a sorted ray at this distance from its own origin.
    fn cut(&self, rays: &mut Sorted, i: usize, far: f32);

    /// The distance from its own origin at which a sorted ray has crossed these planes.
    fn enter(&self, rays: &Sorted, i: usize, near: [Ahead; 3]) -> f32;

    /// The point, in offsets, where a ray at the point `p`, `q` of the plane of polygons crosses the plane across an axis
    /// with this offset; for drawing.
    fn crossing(&self, place: [f64; 2], axis: usize, offset: f64) -> [f64; 3];
}

/// Rays from one point, in the frame. Points of the plane of polygons are directions whose components `[p, q, 1 - p -
/// q]` add up to 1.
#[derive(Debug, Clone, Copy)]
pub struct Eye(pub [f32; 3]);

impl Form for Eye {
    type Triangle = Seen;
    const REACH: f32 = 0.0;

    #[inline(always)]
    fn parts<T: Copy>(&self, way: [T; 3], number: impl Fn(f32) -> T) -> [[T; 3]; 2] {
        [[number(0.0); 3], way]
    }

    #[inline(always)]
    fn middle(&self) -> [f64; 3] {
        self.0.map(f64::from)
    }

    #[inline(always)]
    fn scale(&self) -> f64 {
        1.0
    }

    #[inline(always)]
    fn origin(&self) -> Option<[f32; 3]> {
        Some(self.0)
    }

    #[inline(always)]
    fn coefficients(&self, line: &Line) -> [f64; 3] {
        let ([x, y], [a, b]) = (line.axes(), line.ahead());
        let mut by = [0.0; 3];
        by[y] += a;
        by[x] -= b;
        [by[0] - by[2], by[1] - by[2], by[2]]
    }

    #[inline(always)]
    fn tolerance(&self, line: &Line) -> f64 {
        let [a, b] = line.ahead();
        TOLERANCE * (a.abs() + b.abs())
    }

    #[inline(always)]
    fn is_along(&self, _: &Line) -> bool {
        false
    }

    #[inline(always)]
    fn contains(&self, new: &Side, old: &Side) -> Option<bool> {
        if new.lower_first != old.lower_first || new.line.axes() != old.line.axes() {
            return None;
        }
        // A ray crosses the plane of the lower axis first if the quotient of its speeds, upper by lower, is at most that of
        // the offsets. Quotients of different f32 remain different in f64.
        let quotient = |side: &Side| {
            let [a, b] = side.line.ahead();
            let endless = f64::INFINITY.copysign(b + 0.0);
            (a >= 0.0).then_some(if a > 0.0 { b / a } else { endless })
        };
        let (new_quotient, old_quotient) = (quotient(new)?, quotient(old)?);
        Some(if new.lower_first {
            new_quotient >= old_quotient
        } else {
            new_quotient <= old_quotient
        })
    }

    #[inline(always)]
    fn places<S: Simd>(&self, simd: S, [x, y, z]: [f32x8<S>; 3]) -> [f32x8<S>; 2] {
        let inverse = f32x8::splat(simd, 1.0) / (x + y + z);
        [x * inverse, y * inverse]
    }

    #[inline(always)]
    fn face(&self, sign: [f32; 3], corners: [[f32; 3]; 3]) -> Seen {
        // Ways are absolute components of directions.
        let turn = |p: [f32; 3]| [p[0] * sign[0], p[1] * sign[1], p[2] * sign[2]];
        Seen::new(turn(self.0), corners.map(turn))
    }

    #[inline(always)]
    fn candidates<S: Simd>(simd: S, triangle: &Seen, rays: &Sorted, at: usize) -> u64 {
        let reach = eight(simd, &rays.reach, at);
        triangle.candidates(simd, rays.load(simd, at), reach)
    }

    #[inline(always)]
    fn late<S: Simd>(&self, _: S, _: &Sorted, _: usize, _: [Ahead; 3]) -> u64 {
        0
    }

    #[inline(always)]
    fn reach(rays: &Sorted, i: usize) -> f32 {
        rays.reach[i]
    }

    #[inline(always)]
    fn cut(&self, rays: &mut Sorted, i: usize, far: f32) {
        rays.reach[i] = keep_min(far, rays.reach[i]);
    }

    #[inline(always)]
    fn enter(&self, rays: &Sorted, i: usize, near: [Ahead; 3]) -> f32 {
        let mut enter = 0.0_f32;
        for (plane, speed) in near.into_iter().zip(rays.way(i)) {
            if plane.offset > 0.0 && speed > 0.0 {
                enter = enter.max(plane.offset / speed);
            }
        }
        enter
    }

    fn crossing(&self, [p, q]: [f64; 2], axis: usize, offset: f64) -> [f64; 3] {
        let m = [p, q, 1.0 - p - q];
        m.map(|speed| speed * (offset / m[axis]))
    }
}

/// Rays of one direction. Points of the plane of polygons are those where rays cross a plane through the middle of the
/// root, across the axis along which they run most, along its other two axes.
///
/// The ways are rounded to multiples of 2^-24 of [`Self::scale`], the speeds to multiples of 2^-23, so that the
/// comparison of two planes is exact in f64. Derived: this moves a ray by less than 2 u of the root's side, and leaves
/// contain what is within 40 u of the scene's largest coordinate, which is more than an eighth of that side.
#[derive(Debug, Clone, Copy)]
pub struct Parallel {
    /// Direction, divided by a power of two so that its largest component lies in [1, 2).
    direction: [f32; 3],
    /// That power of two.
    unit: f32,
    /// Absolute components of the direction, rounded.
    speeds: [f32; 3],
    /// Middle of the root.
    middle: [f64; 3],
    scale: f64,
    /// The axes of `p` and `q`, and the one along which rays run most.
    axes: [usize; 3],
    /// Bit `k` is set if beams descend along axis `k`.
    pub signs: u32,
    /// Whether beams run against the rays, from the last point to the first.
    pub reversed: bool,
}

/// A ray among parallel ones.
#[derive(Debug, Clone, Copy)]
pub struct Placed {
    /// Its way.
    pub way: [f32; 3],
    /// Distance of its origin from the plane of polygons, along the beam.
    pub origin: f64,
}

impl Parallel {
    /// For rays of direction `d` through a tree; `None` if the frame changes distances, or for a direction near the ends
    /// of the range.
    #[expect(clippy::cast_possible_truncation, reason = "rounds to f32")]
    pub fn new(tree: &Octree, frame: &Frame, d: [f32; 3], reversed: bool) -> Option<Self> {
        let longest = d.iter().fold(0.0_f32, |most, x| most.max(x.abs()));
        let plain = longest > 2.0 * f32::MIN_POSITIVE && longest < 1e38;
        if !(plain && d.iter().all(|x| x.is_finite()) && frame.is_unscaled()) {
            return None;
        }
        // Divide by the power of two of the longest component; the reciprocal has the opposite exponent.
        let unit = f32::from_bits(longest.to_bits() & 0x7f80_0000);
        let direction = d.map(|x| x * f32::from_bits(0x7f00_0000 - unit.to_bits()));
        let most = (0..3).find(|k| d[*k].abs() == longest)?;
        let cube = tree.cube();
        let half = 0.5 * f64::from(cube.side);
        let fine = f64::from(1 << 23);
        let signs = (0..3).map(|k| u32::from(d[k].is_sign_negative() != reversed) << k);
        Some(Self {
            direction,
            unit,
            speeds: direction.map(|x| ((f64::from(x.abs()) * fine).round() / fine) as f32),
            middle: cube.corner.map(|x| f64::from(x) + half),
            scale: 0.25 / half,
            axes: [(most + 1) % 3, (most + 2) % 3, most],
            signs: signs.sum(),
            reversed,
        })
    }

    /// The power of two by which the direction is divided.
    pub fn unit(&self) -> f32 {
        self.unit
    }

    /// The place of a ray by its origin in the frame; `None` if the ray certainly misses the root.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "few bits")]
    pub fn place(&self, o: [f32; 3]) -> Option<Placed> {
        let from = [0, 1, 2].map(|k: usize| {
            let sign = if self.signs >> k & 1 == 1 { -1.0 } else { 1.0 };
            sign * self.scale * (f64::from(o[k]) - self.middle[k])
        });
        let speed = |k: usize| f64::from(self.direction[k].abs());
        let most = self.axes[2];
        let origin = from[most] / speed(most);
        // Round to the grid on which comparisons are exact.
        let mut way = [0.0; 3];
        for k in [self.axes[0], self.axes[1]] {
            let fine = f64::from(1 << 24);
            let across = ((from[k] - origin * speed(k)) * fine).round() / fine;
            // Points of the root are less than half of this away.
            if across.is_nan() || across.abs() > f64::from(Self::REACH) {
                return None;
            }
            way[k] = across as f32;
        }
        Some(Placed { way, origin })
    }

    /// Converts an interval of distances from the origin of a ray to distances along the beam from the plane of
    /// polygons.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "rounds to f32")]
    pub fn interval(&self, origin: f64, [low, high]: [f32; 2]) -> [f32; 2] {
        let [low, high] = [low, high].map(|x| f64::from(x) * self.scale);
        if self.reversed {
            [(origin - high) as f32, (origin - low) as f32]
        } else {
            [(origin + low) as f32, (origin + high) as f32]
        }
    }

    /// Distance of the origin of a sorted ray from the plane of polygons.
    #[inline(always)]
    fn origin_of(&self, rays: &Sorted, i: usize) -> f64 {
        let most = self.axes[2];
        let sign = if self.signs >> most & 1 == 1 {
            -1.0
        } else {
            1.0
        };
        let from = f64::from(rays.own.origins[most][i]) - self.middle[most];
        sign * self.scale * from / f64::from(self.direction[most].abs())
    }
}

impl Form for Parallel {
    type Triangle = Along;
    const REACH: f32 = 1.0;

    #[inline(always)]
    fn parts<T: Copy>(&self, way: [T; 3], number: impl Fn(f32) -> T) -> [[T; 3]; 2] {
        let [x, y, z] = self.speeds;
        [way, [number(x), number(y), number(z)]]
    }

    #[inline(always)]
    fn middle(&self) -> [f64; 3] {
        self.middle
    }

    #[inline(always)]
    fn scale(&self) -> f64 {
        self.scale
    }

    #[inline(always)]
    fn origin(&self) -> Option<[f32; 3]> {
        None
    }

    #[inline(always)]
    fn coefficients(&self, line: &Line) -> [f64; 3] {
        let ([x, y], [a, b]) = (line.axes(), line.ahead());
        let m = self.speeds.map(f64::from);
        let mut by = [0.0; 3];
        by[x] = -m[y];
        by[y] = m[x];
        [by[self.axes[0]], by[self.axes[1]], a * m[y] - b * m[x]]
    }

    #[inline(always)]
    fn tolerance(&self, line: &Line) -> f64 {
        let [x, y] = line.axes();
        TOLERANCE * (f64::from(self.speeds[x]) + f64::from(self.speeds[y]))
    }

    #[inline(always)]
    fn is_along(&self, line: &Line) -> bool {
        line.axes().iter().all(|k| self.speeds[*k] == 0.0)
    }

    #[inline(always)]
    fn contains(&self, new: &Side, old: &Side) -> Option<bool> {
        if new.lower_first != old.lower_first || new.line.axes() != old.line.axes() {
            return None;
        }
        // Lines of the same axes are parallel, and their heights differ by a constant, which f64 holds exactly.
        let height = |side: &Side| {
            let ([x, y], [a, b]) = (side.line.axes(), side.line.ahead());
            a * f64::from(self.speeds[y]) - b * f64::from(self.speeds[x])
        };
        let (new_height, old_height) = (height(new), height(old));
        Some(if new.lower_first {
            new_height <= old_height
        } else {
            new_height >= old_height
        })
    }

    #[inline(always)]
    fn places<S: Simd>(&self, _: S, way: [f32x8<S>; 3]) -> [f32x8<S>; 2] {
        [way[self.axes[0]], way[self.axes[1]]]
    }

    #[inline(always)]
    fn face(&self, _: [f32; 3], corners: [[f32; 3]; 3]) -> Along {
        Along::new(self.direction, corners)
    }

    #[inline(always)]
    fn candidates<S: Simd>(simd: S, triangle: &Along, rays: &Sorted, at: usize) -> u64 {
        let own = &rays.own;
        let origins = [0, 1, 2].map(|k: usize| eight(simd, &own.origins[k], at));
        triangle.candidates(simd, origins, eight(simd, &own.reach, at))
    }

    #[inline(always)]
    fn late<S: Simd>(&self, simd: S, rays: &Sorted, at: usize, planes: [Ahead; 3]) -> u64 {
        let start = eight(simd, &rays.own.start, at);
        let [r, m] = self.parts(rays.load(simd, at), |x| f32x8::splat(simd, x));
        let mut late = 0;
        for k in 0..3 {
            let offset = f32x8::splat(simd, planes[k].offset);
            late |= start.mul_add(m[k], r[k]).simd_gt(offset).to_bitmask();
        }
        late
    }

    #[inline(always)]
    fn reach(rays: &Sorted, i: usize) -> f32 {
        rays.own.reach[i]
    }

    #[inline(always)]
    fn cut(&self, rays: &mut Sorted, i: usize, far: f32) {
        let [_, end] = self.interval(self.origin_of(rays, i), [far; 2]);
        rays.own.reach[i] = keep_min(far, rays.own.reach[i]);
        rays.reach[i] = keep_min(end, rays.reach[i]);
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "rounds to f32")]
    fn enter(&self, rays: &Sorted, i: usize, near: [Ahead; 3]) -> f32 {
        let mut enter = f64::NEG_INFINITY;
        for (k, plane) in near.into_iter().enumerate() {
            let (r, m) = (rays.way(i)[k], self.speeds[k]);
            if m > 0.0 {
                enter = enter.max((f64::from(plane.offset) - f64::from(r)) / f64::from(m));
            }
        }
        ((enter - self.origin_of(rays, i)) / self.scale) as f32
    }

    fn crossing(&self, [p, q]: [f64; 2], axis: usize, offset: f64) -> [f64; 3] {
        let (mut r, m) = ([0.0; 3], self.speeds.map(f64::from));
        (r[self.axes[0]], r[self.axes[1]]) = (p, q);
        let t = (offset - r[axis]) / m[axis];
        std::array::from_fn(|k| r[k] + t * m[k])
    }
}
