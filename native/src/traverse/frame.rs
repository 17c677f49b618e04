// SPDX-License-Identifier: GPL-3.0-or-later
//! The frame in which f32 walks run, and the ray in it, with its error bounds.
//!
//! A scene whose largest coordinate lies far from 1 is scaled by a power of two, which changes no
//! bit of a mantissa; a ray's direction is scaled so that its largest component lies in [1, 2).
//! In this frame products of three coordinates neither overflow nor vanish, and the bounds below
//! hold. `u` is the unit roundoff of f32, 2^-24.

use super::bound::{keep_max, keep_min};
pub use super::frame_ray::FrameRay;
use super::place::Place;
use super::ray::{Hit, Ray};
use crate::geom::Aabb;
use crate::geom::transform;
use crate::geom::vec3::{Vec3, dot, map, widen};
use fearless_simd::{Simd, SimdFloat};

/// Unit roundoff of f32.
pub const U: f32 = 1.0 / 16_777_216.0;

/// Relative slack for pruning by the best hit: three roundings of `t` and the scale of the frame.
pub(super) const PRUNE: f32 = 1.0 + 1.0 / 1_048_576.0;

/// The padding of [`FrameRay::pad`], per unit of coordinate: a plane distance `(p - o) / d` is off by hardly more than
/// 3 u, the point that it stands for by less than 5 u of `|o| + |p|`; the rest is room for the additions.
pub const AXIS_PAD: f32 = 8.0 * U;

/// That of [`FrameRay::oblique_pad`], per unit of the span: 8 sqrt(3) 2 u for a height `n . (o + t d) - c` with
/// `|n| <= 1`, rounded up.
pub const OBLIQUE_PAD: f32 = 28.0 * U;

/// Added where products may have lost a subnormal part.
const TINY: f32 = 1e-37;

/// The smallest float above zero, in a unit of so many frame units, and what rounding may add.
///
/// The sum is rounded, not the product: that is below the normal numbers of f32 for most rays, and some processors take
/// a hundred cycles to make such a number.
#[inline(always)]
#[expect(
    clippy::cast_possible_truncation,
    reason = "rounded to f32, and TINY is more than that"
)]
pub(super) fn last_place(to_frame: f64) -> f32 {
    (f64::from(f32::from_bits(1)) * to_frame + f64::from(TINY)) as f32
}

/// The same for rays in lanes: by two factors, and `TINY` between them, so that nothing is below the normal numbers.
#[inline(always)]
pub(super) fn last_places<S: Simd, V: SimdFloat<S, Element = f32>>(simd: S, to_frame: V) -> V {
    const FIRST: f32 = 1.0 / (1_u128 << 75) as f32;
    const SECOND: f32 = 1.0 / (1_u128 << 74) as f32;
    let lifted = to_frame.mul_add(V::splat(simd, FIRST), V::splat(simd, TINY / SECOND));
    lifted * V::splat(simd, SECOND)
}

/// A power-of-two scale and the scene's box after it.
#[derive(Debug, Clone, Copy)]
pub struct Frame {
    scale: f32,
    bounds: Aabb,
    magnitude: f32,
    robust: f32,
}

impl Frame {
    /// The frame of a scene with these bounds. Scenes between 2^-30 and 2^40 are left alone.
    pub fn new(bounds: Aabb) -> Self {
        let magnitude = bounds.magnitude();
        let ordinary =
            magnitude == 0.0 || (2.0_f32.powi(-30)..=2.0_f32.powi(40)).contains(&magnitude);
        let scale = if ordinary {
            1.0
        } else {
            (1.0 / power_of_two(magnitude)).min(2.0_f32.powi(126))
        };
        let scaled = |p: [f32; 3]| p.map(|x| x * scale);
        let bounds = if bounds.is_empty() {
            bounds
        } else {
            Aabb {
                min: scaled(bounds.min),
                max: scaled(bounds.max),
            }
        };
        Self {
            scale,
            bounds,
            magnitude: bounds.magnitude(),
            robust: 1.0,
        }
    }

    /// The same frame, with walks that allow for rounding, or, for measuring how often that fails,
    /// with walks that do not.
    pub fn with_robust(mut self, robust: bool) -> Self {
        self.robust = f32::from(u8::from(robust));
        self
    }

    /// What allowances for rounding are taken times: 1, or 0 for walks as published.
    #[inline(always)]
    pub(super) fn robust(&self) -> f32 {
        self.robust
    }

    /// A point in this frame.
    #[inline(always)]
    pub fn point(&self, p: [f32; 3]) -> [f32; 3] {
        [p[0] * self.scale, p[1] * self.scale, p[2] * self.scale]
    }

    /// The power of two by which coordinates are scaled.
    #[inline(always)]
    pub fn scale(&self) -> f32 {
        self.scale
    }

    /// Whether coordinates are the scene's own, bit for bit.
    #[inline(always)]
    pub fn is_scene(&self) -> bool {
        self.scale == 1.0
    }

    /// A point of this frame in the scene's own coordinates.
    pub fn to_scene(&self, p: [f32; 3]) -> [f32; 3] {
        p.map(|x| x / self.scale)
    }

    /// The scene's box in this frame.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// How far a plane must be from an origin to be told from it, per axis, and the bound on the error
    /// of the origin's height over an oblique plane that meets the scene: [`FrameRay::pad`] and
    /// [`FrameRay::oblique_pad`] for all rays from there, in a frame that [`Self::is_scene`].
    pub fn pads(&self, o: [f32; 3]) -> ([f32; 3], f32) {
        let far = o[0].abs().max(o[1].abs()).max(o[2].abs());
        let pad = map(o, |x| self.robust * AXIS_PAD * (x.abs() + self.magnitude));
        (pad, self.robust * OBLIQUE_PAD * (far + self.magnitude))
    }

    /// The power of two by which a ray's direction is divided; `None` for what wants more care: a
    /// scaled frame, a number that is not finite, a direction near the ends of the range.
    #[inline(always)]
    pub fn unit_of(&self, ray: &Ray) -> Option<f32> {
        let longest = ray.d[0].abs().max(ray.d[1].abs()).max(ray.d[2].abs());
        let zeros = [
            ray.o[0] * 0.0 + ray.d[0] * 0.0,
            ray.o[1] * 0.0 + ray.d[1] * 0.0,
            ray.o[2] * 0.0 + ray.d[2] * 0.0,
        ];
        let finite = zeros[0] + zeros[1] + zeros[2] == 0.0;
        let plain = longest > 2.0 * f32::MIN_POSITIVE && longest < 1e38;
        (finite && plain && self.is_scene())
            .then(|| f32::from_bits(longest.to_bits() & 0x7f80_0000))
    }

    /// A ray's interval in this frame, widened by its rounding.
    #[inline(always)]
    pub fn interval(&self, ray: &Ray, unit: f32) -> [f32; 2] {
        let limits = self.limits(unit);
        [limits.lower(ray.t_min), limits.reach(ray.t_max)]
    }

    /// What [`FrameRay::reach`] needs of a ray, and nothing else.
    #[inline(always)]
    pub fn limits_of(&self, ray: &Ray) -> FrameRay<'static> {
        match self.unit_of(ray) {
            Some(unit) => self.limits(unit),
            None => self.ray(ray).unwrap_or(FrameRay::NOTHING),
        }
    }

    /// The same, by the power of two that the ray's direction is divided by.
    #[inline(always)]
    fn limits(&self, unit: f32) -> FrameRay<'static> {
        let mut out = FrameRay {
            to_frame: f64::from(unit) * f64::from(self.scale),
            ..FrameRay::NOTHING
        };
        out.last_place = last_place(out.to_frame);
        out
    }

    /// The ray in this frame, cut to the scene's box; `None` when it certainly misses the box, when
    /// its direction is zero, or when a number of it is not finite.
    #[inline(always)]
    pub fn ray(&self, ray: &Ray) -> Option<FrameRay<'static>> {
        let longest = ray.d[0].abs().max(ray.d[1].abs()).max(ray.d[2].abs());
        // Infinity and NaN times zero is NaN.
        let finite = (0..3).map(|k| ray.o[k] * 0.0 + ray.d[k] * 0.0).sum::<f32>() == 0.0;
        if longest == 0.0 || !finite {
            return None;
        }
        let unit = power_of_two(longest);
        // The reciprocal of a power of two is one, unless it overflows.
        let d = if unit > f32::MIN_POSITIVE {
            let inverse = 1.0 / unit;
            map(ray.d, |x| x * inverse)
        } else {
            map(ray.d, |x| x / unit)
        };
        let mut out = FrameRay {
            o: self.point(ray.o),
            d,
            to_frame: f64::from(unit) * f64::from(self.scale),
            ..FrameRay::NOTHING
        };
        if self.is_scene() {
            out.still = map(ray.d, |d| f32::from(u8::from(d != 0.0)));
        }
        self.complete(ray, out, [0.0; 3])
    }

    /// A ray of the scene in the space of an instance of this frame's mesh, with `known` the best hit that
    /// it has already.
    ///
    /// The line is that of the scene brought back in f64, so `t` means the same. What the walk asks is
    /// whether it meets a triangle *as it stands in the scene*, rounded there; brought back too, that
    /// one's corners are within [`Place::corner_error`] of the mesh's own. That, the errors of the map
    /// and the rounding of the ray to f32 make up `blur`, by which every bound of the walk grows.
    #[inline]
    pub fn placed<'a>(&self, ray: &Ray, place: &'a Place, known: Hit) -> Placed<'a> {
        let scale = f64::from(self.scale);
        let back = |x: f32, k: usize| f64::from(x) - place.in_mesh.transform.offset[k];
        let from = [back(ray.o[0], 0), back(ray.o[1], 1), back(ray.o[2], 2)];
        let (o, o_error) = place.inverse.vector(from);
        let (d, d_error) = place.inverse.vector(widen(ray.d));
        let unit = transform::power_of_two(d[0].abs().max(d[1].abs()).max(d[2].abs()));
        if unit == 0.0 {
            return Placed::Blind;
        }
        let d = map(d, |x| x / unit);
        let d_error = map(d_error, |x| x / unit);

        // An origin far away is brought to where the ray comes near: what f32 rounds is then small.
        let bounds = self.bounds;
        let end = |k: usize| (f64::from(bounds.min[k]), f64::from(bounds.max[k]));
        let middle = |k: usize| 0.5 * (end(k).0 + end(k).1);
        let half = |k: usize| 0.5 * (end(k).1 - end(k).0);
        let size = |v: Vec3| dot(v, v).sqrt();
        let way = map([0, 1, 2], |k: usize| middle(k) - o[k] * scale);
        let ahead = dot(way, d) / dot(d, d) - 1.25 * size([half(0), half(1), half(2)]) / size(d);
        let shift = if ahead > 0.0 { ahead } else { 0.0 };

        let mut out = FrameRay {
            to_frame: unit * scale,
            shift,
            first: place.first,
            known,
            place: Some(&place.in_mesh),
            ..FrameRay::NOTHING
        };
        let (mut origin_error, mut speed_error) = ([0.0; 3], [0.0; 3]);
        let (mut far, mut doubt) = (0.0_f64, 0.0_f64);
        for k in 0..3 {
            let start = o[k] * scale;
            let moved = start + shift * d[k];
            out.o[k] = moved as f32;
            out.d[k] = d[k] as f32;
            let rounding = 4.0 * f64::EPSILON * (start.abs() + (shift * d[k]).abs());
            origin_error[k] = o_error[k] * scale
                + shift * d_error[k]
                + rounding
                + f64::from(U) * moved.abs()
                + f64::MIN_POSITIVE
                + f64::from(f32::from_bits(1));
            speed_error[k] = d_error[k] + f64::from(U) * d[k].abs() + f64::from(f32::from_bits(1));
            far = far.max(moved.abs() + place.corner_error[k] * scale + origin_error[k]);
            doubt = doubt.max(speed_error[k]);
        }
        // The largest component of the direction is at least 1 - doubt, so that no point of the mesh is
        // farther along the ray than this.
        let farthest = 1.02 * (far + f64::from(self.magnitude));
        if !(doubt < 0.01 && farthest < 1e37) {
            return Placed::Blind;
        }
        let mut blur = [0.0; 3];
        for k in 0..3 {
            let corner = place.corner_error[k] * scale;
            let coordinate = origin_error[k] + corner + farthest * speed_error[k];
            blur[k] = up(coordinate);
            // Of offsets from the origin and of edges.
            out.blur = out.blur.max(up(origin_error[k] + 2.0 * corner));
        }
        out.drift = up(doubt);
        match self.complete(ray, out, blur) {
            Some(ray) => Placed::Walk(ray),
            None => Placed::Miss,
        }
    }

    /// Fills in the bounds of a ray whose coordinates, anywhere in the scene, are off by at most `blur`
    /// before they are rounded, and cuts it to the scene's box.
    #[inline(always)]
    fn complete<'a>(
        &self,
        ray: &Ray,
        mut out: FrameRay<'a>,
        blur: [f32; 3],
    ) -> Option<FrameRay<'a>> {
        let (o, d) = (out.o, out.d);
        let far = o[0].abs().max(o[1].abs()).max(o[2].abs());
        let sum = far + self.magnitude;
        let blurred = blur[0].max(blur[1]).max(blur[2]);
        out.span = sum;
        out.oblique_pad = self.robust * (OBLIQUE_PAD * sum + 2.0 * blurred);
        out.last_place = last_place(out.to_frame);
        let mut near = f32::NEG_INFINITY;
        let mut exit = f32::INFINITY;
        // Over any distance up to `span` a slower direction moves by less than u times the padding: it
        // counts as parallel. Where this underflows, 1 / 0 makes the distances infinite or NaN, and
        // the walks then skip nothing.
        let parallel = U / sum;
        for k in 0..3 {
            let pad = AXIS_PAD * (o[k].abs() + self.magnitude) + blur[k];
            let slowest = parallel * pad;
            let dk = if d[k].abs() < slowest {
                slowest.copysign(d[k])
            } else {
                d[k]
            };
            out.inv[k] = 1.0 / dk;
            let slack = pad * out.inv[k].abs();
            out.pad[k] = self.robust * pad;
            out.slack[k] = self.robust * slack;
            out.negative[k] = u32::from(d[k].is_sign_negative());
            let low = (self.bounds.min[k] - o[k]) * out.inv[k];
            let high = (self.bounds.max[k] - o[k]) * out.inv[k];
            let (enter, leave) = if out.negative[k] == 1 {
                (high, low)
            } else {
                (low, high)
            };
            near = keep_max(enter - slack, near);
            exit = keep_min(leave + slack, exit);
        }
        out.signs = (out.negative[0] | out.negative[1] << 1 | out.negative[2] << 2) * 0x0101_0101;
        out.t_min = keep_max(out.lower(ray.t_min), near);
        out.t_max = keep_min(out.reach(keep_min(out.known.t, ray.t_max)), exit);
        if out.t_min > out.t_max || ray.t_min > ray.t_max {
            None
        } else {
            Some(out)
        }
    }
}

/// What becomes of a ray in an instance's space.
pub enum Placed<'a> {
    /// It certainly misses the mesh.
    Miss,
    /// It is to walk the mesh's tree.
    Walk(FrameRay<'a>),
    /// Nothing is certain about it: every triangle has to be put to the verdict.
    Blind,
}

/// A bound as f32, rounded upwards.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "rounded upwards")]
fn up(x: f64) -> f32 {
    (x * (1.0 + 1e-6)) as f32 + f32::MIN_POSITIVE
}

/// The largest power of two not above `x`, which is positive and finite.
#[inline(always)]
fn power_of_two(x: f32) -> f32 {
    if x.is_normal() {
        f32::from_bits(x.to_bits() & 0x7f80_0000)
    } else {
        // Subnormal: the highest set bit.
        f32::from_bits(1 << (31 - x.to_bits().leading_zeros()))
    }
}
