// SPDX-License-Identifier: GPL-3.0-or-later
//! A ray in the frame of a scene, and what is certain of distances along it.

use super::frame::PRUNE;
use super::place::{InMesh, Place};
use super::ray::{Hit, Ray};

/// A ray in the frame of the scene, with what every walk needs of it.
#[derive(Debug, Clone, Copy)]
pub struct FrameRay<'a> {
    /// Origin.
    pub o: [f32; 3],
    /// Direction, largest component in [1, 2).
    pub d: [f32; 3],
    /// Reciprocal direction, its sign that of `d`, a negative zero included; finite but for rays
    /// from very far away.
    pub inv: [f32; 3],
    /// Bound on the error of a distance `(p - o) * inv` to a plane of the scene, per axis.
    pub slack: [f32; 3],
    /// Bound on the error of a coordinate `o + t d` inside the scene, per axis.
    pub pad: [f32; 3],
    /// 0 where the direction is zero and coordinates are the scene's own, so that a triangle whose
    /// corners have the origin's coordinate certainly lies in one plane with the ray; 1 elsewhere.
    pub still: [f32; 3],
    /// 1 where the direction's sign bit is set.
    pub negative: [u32; 3],
    /// The same as bits 0, 1 and 2 of each byte.
    pub signs: u32,
    /// Where the ray enters the scene's box, or where it begins.
    pub t_min: f32,
    /// Where the ray leaves the scene's box, or where it ends.
    pub t_max: f32,
    /// Largest distance along an axis between the origin and any point of the scene.
    pub span: f32,
    /// Bound on the error of a height `n . (o + t d) - c` over an oblique plane that meets the
    /// scene, for `|n| <= 1`: 8 sqrt(3) 2 u times the span.
    pub oblique_pad: f32,
    /// What the corners of triangles and the origin together may be off by, per coordinate, because the
    /// ray was brought into an instance's space; 0 for rays of the scene.
    pub blur: f32,
    /// The same for the direction.
    pub drift: f32,
    /// Added to the numbers of triangles: an instance's place among those of all.
    pub first: u32,
    /// The best hit that was found elsewhere.
    pub known: Hit,
    /// The instance whose space the ray is in.
    pub place: Option<&'a InMesh>,
    pub(super) to_frame: f64,
    /// How far along the ray its origin was moved, in the frame's units.
    pub(super) shift: f64,
    /// Bound on the rounding of a subnormal `t`, and of the frame, in the frame's units. A distance of
    /// a millionth of the scene may be all rounding when the direction is long enough.
    pub(super) last_place: f32,
}

impl FrameRay<'static> {
    /// A ray that is over before it begins.
    pub const NOTHING: Self = Self {
        o: [0.0; 3],
        d: [1.0; 3],
        inv: [1.0; 3],
        slack: [0.0; 3],
        pad: [0.0; 3],
        still: [1.0; 3],
        negative: [0; 3],
        signs: 0,
        t_min: 1.0,
        t_max: 0.0,
        span: 0.0,
        oblique_pad: 0.0,
        blur: 0.0,
        drift: 0.0,
        first: 0,
        known: Hit::MISS,
        place: None,
        to_frame: 1.0,
        shift: 0.0,
        last_place: 0.0,
    };
}

impl<'a> FrameRay<'a> {
    /// A ray about which nothing is certain in an instance's space, to put triangles to the verdict with.
    pub fn blind(place: &'a Place, known: Hit) -> Self {
        Self {
            first: place.first,
            known,
            place: Some(&place.in_mesh),
            ..FrameRay::NOTHING
        }
    }

    /// A distance in the frame that nothing at `t` or nearer can exceed, rounding included.
    #[inline(always)]
    pub fn reach(&self, t: f32) -> f32 {
        self.slackened(t, PRUNE) + self.last_place
    }

    /// What a distance in the frame is taken times in the scene; a power of two.
    #[inline(always)]
    pub fn to_scene(&self) -> f64 {
        1.0 / self.to_frame
    }

    /// The distances in the frame between which a hit certainly lies in the ray's own interval, and its `t` in the
    /// range of floats: both excluded, and NaN where nothing is certain, as of rays in an instance's space.
    #[inline(always)]
    pub fn certain(&self, ray: &Ray) -> [f32; 2] {
        if self.place.is_some() {
            return [f32::NAN; 2];
        }
        // Written so that what is not a number stays.
        let from = self.reach(ray.t_min);
        let to = self.lower(if ray.t_max > f32::MAX {
            f32::MAX
        } else {
            ray.t_max
        });
        [if from < 0.0 { 0.0 } else { from }, to]
    }

    /// A distance in the frame that nothing can fall below which is farther than what lies no farther than
    /// `high` there, after the distances of both in the scene are rounded.
    #[inline(always)]
    pub fn beyond(&self, high: f32) -> f32 {
        high * (PRUNE * PRUNE) + 2.0 * self.last_place
    }

    /// A distance in the frame that nothing at `t` or farther can fall below.
    #[inline(always)]
    pub(super) fn lower(&self, t: f32) -> f32 {
        self.slackened(t, 2.0 - PRUNE) - self.last_place
    }

    /// `t` in the frame's units, `factor` times as far for distances ahead, and moved by as much for those
    /// behind.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "the slack covers the rounding; what the shift rounds is added to it"
    )]
    fn slackened(&self, t: f32, factor: f32) -> f32 {
        let scaled = f64::from(t) * self.to_frame;
        let towards = if scaled >= 0.0 { factor } else { 2.0 - factor };
        if self.shift == 0.0 {
            return scaled as f32 * towards;
        }
        let room = f64::from(factor - 1.0) * self.shift;
        (scaled * f64::from(towards) - self.shift + room) as f32
    }
}
