// SPDX-License-Identifier: GPL-3.0-or-later
//! The frame in which traversals run in f32, and the conversion of rays to it with their error bounds.
//!
//! A scene far from the origin is translated to it by an exact subtraction ([`ToFrame`]). A scene whose largest
//! coordinate is then far from 1 is scaled by a power of two, which changes no bit of a mantissa; a ray's direction is
//! scaled so that its largest component lies in [1, 2). In this frame products of three coordinates neither overflow
//! nor underflow, and the bounds below hold. `u` is the unit roundoff of f32, 2^-24.

pub use crate::frame_ray::FrameRay;
use crate::ray::{Hit, Ray};
pub use crate::to_frame::ToFrame;
use crate::to_frame::{self, power_of_two};
use fearless_simd::{Simd, SimdFloat};
use halfspace_geom::bound::{keep_max, keep_min};
use halfspace_geom::vec3::{Vec3, dot, map, widen};
use halfspace_geom::{Aabb, transform};
use halfspace_scene::MeshInstance;

/// Unit roundoff of f32, 2^-24.
pub const U: f32 = 1.0 / 16_777_216.0;

/// Factor by which distances are extended before they prune: 1 + 2^-20. Derived: it covers three roundings of `t`, and
/// the scale of the frame.
pub const PRUNE: f32 = 1.0 + 1.0 / 1_048_576.0;

/// [`FrameRay::pad`] per unit of coordinate. Derived: a plane distance `(p - o) / d` has a relative error of about 3 u,
/// and the point at this distance an error of less than 5 u multiplied by `|o| + |p|`; the rest covers the rounding of
/// the bound itself.
pub const AXIS_PAD: f32 = 8.0 * U;

/// [`FrameRay::oblique_pad`] per unit of the span. Derived: 8 sqrt(3) 2 u for a height `n . (o + t d) - c` with
/// `|n| <= 1`, rounded up.
pub const OBLIQUE_PAD: f32 = 28.0 * U;

/// Error bound of products that may have lost a subnormal part; larger than the smallest normal float.
const TINY: f32 = 1e-37;

/// Returns the smallest positive float multiplied by the factor `to_frame`, plus 1e-37 for rounding.
///
/// Rounds the sum to f32, not the product: that is subnormal for most rays, and some processors take a hundred cycles
/// to produce a subnormal number.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "TINY covers the rounding")]
pub fn last_place(to_frame: f64) -> f32 {
    (f64::from(f32::from_bits(1)) * to_frame + f64::from(TINY)) as f32
}

/// Returns [`last_place`] for one ray per lane. The product takes two factors with `TINY` added in between, so that no
/// intermediate result is subnormal.
#[inline(always)]
pub fn last_places<S: Simd, V: SimdFloat<S, Element = f32>>(simd: S, to_frame: V) -> V {
    const FIRST: f32 = 1.0 / (1_u128 << 75) as f32;
    const SECOND: f32 = 1.0 / (1_u128 << 74) as f32;
    let lifted = to_frame.mul_add(V::splat(simd, FIRST), V::splat(simd, TINY / SECOND));
    lifted * V::splat(simd, SECOND)
}

/// The coordinates of a tree: those of the scene, translated and multiplied by a power of two where that is needed.
#[derive(Debug, Clone, Copy)]
pub struct Frame {
    /// The map from scene coordinates.
    to_frame: ToFrame,
    /// Box of the scene, in this frame.
    bounds: Aabb,
    /// Largest absolute coordinate of `bounds`.
    magnitude: f32,
    /// Middle of `bounds`, and half the length of its diagonal.
    middle: Vec3,
    radius: f64,
    /// Scale of all error bounds: 1 or 0.
    robust: f32,
}

impl Frame {
    /// Makes the frame of a scene with these bounds.
    pub fn new(bounds: Aabb) -> Self {
        let to_frame = ToFrame::new(&bounds);
        let bounds = to_frame.bounds(&bounds);
        let [min, max] = [widen(bounds.min), widen(bounds.max)];
        let half = [0, 1, 2].map(|k: usize| 0.5 * (max[k] - min[k]));
        Self {
            to_frame,
            bounds,
            magnitude: bounds.magnitude(),
            middle: [0, 1, 2].map(|k| 0.5 * (min[k] + max[k])),
            radius: dot(half, half).sqrt(),
            robust: 1.0,
        }
    }

    /// Returns the same frame with error bounds on or off. Without them traversals run as published, which measures how
    /// often rounding makes them fail.
    pub fn with_robust(mut self, robust: bool) -> Self {
        self.robust = f32::from(u8::from(robust));
        self
    }

    /// Returns the scale of all error bounds: 1, or 0 for traversals as published.
    #[inline(always)]
    pub fn robust(&self) -> f32 {
        self.robust
    }

    /// Returns the map from scene coordinates.
    #[inline(always)]
    pub fn map(&self) -> &ToFrame {
        &self.to_frame
    }

    /// Converts a point of the scene to this frame; vertices are not rounded.
    #[inline(always)]
    pub fn point(&self, p: [f32; 3]) -> [f32; 3] {
        self.to_frame.point(p)
    }

    /// Returns the power of two by which coordinates are scaled.
    #[inline(always)]
    pub fn scale(&self) -> f32 {
        self.to_frame.scale()
    }

    /// Returns whether distances in the frame are those of the scene.
    #[inline(always)]
    pub fn is_unscaled(&self) -> bool {
        self.to_frame.is_unscaled()
    }

    /// Converts a point of this frame to the scene.
    pub fn to_scene(&self, p: [f32; 3]) -> [f32; 3] {
        self.to_frame.to_scene(p)
    }

    /// Returns the scene's box in this frame.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// Returns [`FrameRay::pad`] and [`FrameRay::oblique_pad`] for all rays from origin `o` of this
    /// frame, which must be exact ([`ToFrame::is_exact`]): per axis the distance beyond which a plane provably lies on one
    /// side of the origin, and the error bound of the origin's height over an oblique plane that meets the scene.
    pub fn pads(&self, o: [f32; 3]) -> ([f32; 3], f32) {
        let far = o[0].abs().max(o[1].abs()).max(o[2].abs());
        let pad = map(o, |x| self.robust * AXIS_PAD * (x.abs() + self.magnitude));
        (pad, self.robust * OBLIQUE_PAD * (far + self.magnitude))
    }

    /// Returns the power of two by which a ray's direction is divided, or `None` if the ray needs the slow path: a
    /// scaled frame, an origin that the frame rounds, a component that is not finite, a direction near the ends of the
    /// range.
    #[inline(always)]
    pub fn unit_of(&self, ray: &Ray) -> Option<f32> {
        let longest = ray.d[0].abs().max(ray.d[1].abs()).max(ray.d[2].abs());
        // Infinity and NaN multiplied by zero are NaN, which makes the sum differ from 0.
        let zeros = [
            ray.o[0] * 0.0 + ray.d[0] * 0.0,
            ray.o[1] * 0.0 + ray.d[1] * 0.0,
            ray.o[2] * 0.0 + ray.d[2] * 0.0,
        ];
        let finite = zeros[0] + zeros[1] + zeros[2] == 0.0;
        let plain = longest > 2.0 * f32::MIN_POSITIVE && longest < 1e38;
        // Clear sign and mantissa: what is left is the power of two.
        (finite && plain && self.is_unscaled() && self.to_frame.is_exact(self.point(ray.o)))
            .then(|| f32::from_bits(longest.to_bits() & 0x7f80_0000))
    }

    /// Returns a ray's interval in this frame, widened by its rounding errors; `unit` comes from [`Self::unit_of`].
    #[inline(always)]
    pub fn interval(&self, ray: &Ray, unit: f32) -> [f32; 2] {
        let limits = self.limits(unit);
        [limits.lower(ray.t_min), limits.reach(ray.t_max)]
    }

    /// Returns a frame ray in which only the fields are set that [`FrameRay::reach`] and [`FrameRay::lower`] read.
    #[inline(always)]
    pub fn limits_of(&self, ray: &Ray) -> FrameRay<'static> {
        match self.unit_of(ray) {
            Some(unit) => self.limits(unit),
            None => self.ray(ray).unwrap_or(FrameRay::NOTHING),
        }
    }

    /// As [`Self::limits_of`], for a ray whose direction is divided by `unit`.
    #[inline(always)]
    fn limits(&self, unit: f32) -> FrameRay<'static> {
        let mut out = FrameRay {
            to_frame: f64::from(unit) * f64::from(self.scale()),
            ..FrameRay::NOTHING
        };
        out.last_place = last_place(out.to_frame);
        out
    }

    /// Converts a ray to this frame and clips it to the scene's bounding box. Returns `None` if the ray
    /// provably misses the box, if its direction is zero, or if a component is not finite.
    #[inline(always)]
    pub fn ray(&self, ray: &Ray) -> Option<FrameRay<'static>> {
        let longest = ray.d[0].abs().max(ray.d[1].abs()).max(ray.d[2].abs());
        // Infinity and NaN multiplied by zero are NaN.
        let finite = (0..3).map(|k| ray.o[k] * 0.0 + ray.d[k] * 0.0).sum::<f32>() == 0.0;
        if longest == 0.0 || !finite {
            return None;
        }
        let unit = power_of_two(longest);
        // Multiply by the reciprocal, which is exact unless it overflows: that of a power of two is one too.
        let d = if unit > f32::MIN_POSITIVE {
            let inverse = 1.0 / unit;
            map(ray.d, |x| x * inverse)
        } else {
            map(ray.d, |x| x / unit)
        };
        // Convert the origin, and fill in the error bounds.
        let mut out = FrameRay {
            o: self.point(ray.o),
            d,
            to_frame: f64::from(unit) * f64::from(self.scale()),
            ..FrameRay::NOTHING
        };
        // An origin far outside the scene may be rounded by the translation: this blurs the ray.
        let blur = to_frame::rounding(&self.to_frame, ray.o, out.o);
        out.blur = blur[0].max(blur[1]).max(blur[2]);
        // Equal coordinates prove coplanarity only if the frame does not round them.
        if self.is_unscaled() && out.blur == 0.0 {
            out.still = map(ray.d, |d| f32::from(u8::from(d != 0.0)));
        }
        self.complete(ray, out, blur)
    }

    /// Converts a ray of the scene to the space of an instance of this frame's mesh; `known` is the ray's best hit so
    /// far.
    ///
    /// The ray is transformed in f64 and its direction is not normalized, so `t` is the same in both spaces. The
    /// traversal must find the triangles that the ray hits in the scene, where their vertices are rounded; transformed
    /// back, these vertices are within [`MeshInstance::corner_error`] of the mesh's own. This distance, the errors of
    /// the transform and the rounding of the ray to f32 add up to `blur`, by which every error bound of the traversal
    /// grows.
    #[inline]
    pub fn placed<'a>(&self, ray: &Ray, instance: &'a MeshInstance, known: Hit) -> Placed<'a> {
        // Transform origin and direction to the mesh with error bounds, and scale the direction by a power of two.
        let scale = f64::from(self.scale());
        let origin = widen(self.to_frame.origin());
        let back = |x: f32, k: usize| f64::from(x) - instance.to_scene.transform.offset[k];
        let from = [back(ray.o[0], 0), back(ray.o[1], 1), back(ray.o[2], 2)];
        let (o, o_error) = instance.inverse.vector(from);
        let (d, d_error) = instance.inverse.vector(widen(ray.d));
        let unit = transform::power_of_two(d[0].abs().max(d[1].abs()).max(d[2].abs()));
        if unit == 0.0 {
            return Placed::ExactOnly;
        }
        // The reciprocal of a power of two is exact.
        let inverse = 1.0 / unit;
        let d = map(d, |x| x * inverse);
        let d_error = map(d_error, |x| x * inverse);

        // Move a far origin along the ray to near the mesh, so that rounding to f32 loses little.
        let to_middle = map([0, 1, 2], |k: usize| {
            self.middle[k] - (o[k] - origin[k]) * scale
        });
        let length = dot(d, d);
        let ahead = (dot(to_middle, d) - 1.25 * self.radius * length.sqrt()) / length;
        let shift = if ahead > 0.0 { ahead } else { 0.0 };

        let mut out = FrameRay {
            to_frame: unit * scale,
            shift,
            first: instance.first,
            known,
            instance: Some(&instance.to_scene),
            ..FrameRay::NOTHING
        };
        // Round origin and direction to f32, and bound their errors.
        let (mut origin_error, mut direction_error) = ([0.0; 3], [0.0; 3]);
        let (mut far, mut drift) = (0.0_f64, 0.0_f64);
        for k in 0..3 {
            let start = (o[k] - origin[k]) * scale;
            let moved = start + shift * d[k];
            out.o[k] = moved as f32;
            out.d[k] = d[k] as f32;
            // Add the errors of the transform, of the shift and of the rounding.
            let rounding = 4.0 * f64::EPSILON * (start.abs() + (shift * d[k]).abs());
            origin_error[k] = o_error[k] * scale
                + shift * d_error[k]
                + rounding
                + f64::from(U) * moved.abs()
                + f64::MIN_POSITIVE
                + f64::from(f32::from_bits(1));
            direction_error[k] =
                d_error[k] + f64::from(U) * d[k].abs() + f64::from(f32::from_bits(1));
            far = far.max(moved.abs() + instance.corner_error[k] * scale + origin_error[k]);
            drift = drift.max(direction_error[k]);
        }
        // The largest component of the direction is at least 1 - drift, so no point of the mesh is farther
        // along the ray than this.
        let farthest = 1.02 * (far + f64::from(self.magnitude));
        if !(drift < 0.01 && farthest < 1e37) {
            return Placed::ExactOnly;
        }
        // Add up the errors of a coordinate at any distance: origin, vertices, and direction times distance.
        let mut blur = [0.0; 3];
        for k in 0..3 {
            let corner = instance.corner_error[k] * scale;
            let coordinate = origin_error[k] + corner + farthest * direction_error[k];
            blur[k] = up(coordinate);
            // Bound the errors of edges and of offsets of vertices from the origin.
            out.blur = out.blur.max(up(origin_error[k] + 2.0 * corner));
        }
        out.drift = up(drift);
        match self.complete(ray, out, blur) {
            Some(ray) => Placed::Traverse(ray),
            None => Placed::Miss,
        }
    }

    /// Fills in the error bounds of a ray, and clips it to the scene's box. Points of the ray in the scene have errors
    /// of at most `blur` per axis before they are rounded. Returns `None` if no part of the ray is left.
    #[inline(always)]
    fn complete<'a>(
        &self,
        ray: &Ray,
        mut out: FrameRay<'a>,
        blur: [f32; 3],
    ) -> Option<FrameRay<'a>> {
        let (o, d) = (out.o, out.d);
        // Bound the distance to any point of the scene, and the errors that depend on it.
        let far = o[0].abs().max(o[1].abs()).max(o[2].abs());
        let span = far + self.magnitude;
        let blurred = blur[0].max(blur[1]).max(blur[2]);
        out.span = span;
        out.oblique_pad = self.robust * (OBLIQUE_PAD * span + 2.0 * blurred);
        out.last_place = last_place(out.to_frame);
        let (mut near, mut exit) = (f32::NEG_INFINITY, f32::INFINITY);
        // A component of the direction below `parallel` times the padding moves the ray by less than u times the
        // padding over any distance up to `span`, so it counts as parallel to the planes of its axis. If this product
        // underflows, 1 / 0 makes distances infinite or NaN, and traversals then skip nothing.
        let parallel = U / span;
        for k in 0..3 {
            // Bound the error of a coordinate, and from it that of a distance.
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
            // Clip to the slab of this axis, moved outwards.
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
        // Intersect with the ray's own interval and the known hit.
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

/// The result of converting a ray to an instance's space.
pub enum Placed<'a> {
    /// The ray provably misses the mesh.
    Miss,
    /// The ray must traverse the mesh's tree.
    Traverse(FrameRay<'a>),
    /// The error bounds do not hold: every triangle needs the exact verdict.
    ExactOnly,
}

/// Rounds an upper bound up to f32.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "rounded upwards")]
fn up(x: f64) -> f32 {
    (x * (1.0 + 1e-6)) as f32 + f32::MIN_POSITIVE
}
