// SPDX-License-Identifier: GPL-3.0-or-later
//! A ray in the frame of a scene, and bounds on distances along it.

use crate::frame::PRUNE;
use crate::ray::{Hit, Ray};
use halfspace_scene::MeshInstance;
use halfspace_scene::instance::MeshToScene;

/// A ray in the frame of the scene, with the error bounds that traversals need.
#[derive(Debug, Clone, Copy)]
pub struct FrameRay<'a> {
    /// Origin.
    pub o: [f32; 3],
    /// Direction, largest component in [1, 2).
    pub d: [f32; 3],
    /// Reciprocal direction, with the sign bit of `d` even where that is zero; finite except for rays from very far
    /// away.
    pub inv: [f32; 3],
    /// Error bound of a distance `(p - o) * inv` to a plane of the scene, per axis.
    pub slack: [f32; 3],
    /// Error bound of a coordinate `o + t d` inside the scene, per axis.
    pub pad: [f32; 3],
    /// 0 on axes where the direction is zero and frame coordinates equal scene coordinates: a triangle whose vertices
    /// all have the origin's coordinate there is provably coplanar with the ray. 1 on other axes.
    pub still: [f32; 3],
    /// 1 where the direction's sign bit is set, per axis.
    pub negative: [u32; 3],
    /// [`Self::negative`] as bits 0, 1 and 2 of each byte.
    pub signs: u32,
    /// Distance at which the ray enters the scene's box, or begins inside it.
    pub t_min: f32,
    /// Distance at which the ray leaves the scene's box, or ends inside it.
    pub t_max: f32,
    /// Largest distance along an axis between the origin and any point of the scene.
    pub span: f32,
    /// Error bound of a height `n . (o + t d) - c` over an oblique plane that meets the scene, for `|n| <= 1`:
    /// 8 sqrt(3) 2 u multiplied by the span.
    pub oblique_pad: f32,
    /// Bound on the joint error of a triangle's vertices and the origin, per coordinate, that comes from the
    /// transform to an instance's space, or from rounding a far origin in the frame; 0 if the origin is exact.
    pub blur: f32,
    /// Error bound of the direction that comes from the transform to an instance's space.
    pub drift: f32,
    /// Added to triangle ids: the id of the instance's first triangle.
    pub first: u32,
    /// The best hit found before this traversal.
    pub known: Hit,
    /// The instance whose space the ray is in; `None` for the scene's.
    pub instance: Option<&'a MeshToScene>,
    /// Factor from scene to frame distances, a power of two.
    pub to_frame: f64,
    /// Distance by which the origin was moved along the ray, in frame units.
    pub shift: f64,
    /// Bound on the rounding of a subnormal `t`, and of the frame, in frame units. If the direction is long
    /// enough, the rounding error of `t` reaches a millionth of the scene.
    pub last_place: f32,
}

impl FrameRay<'static> {
    /// A ray with an empty interval.
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
        instance: None,
        to_frame: 1.0,
        shift: 0.0,
        last_place: 0.0,
    };
}

impl<'a> FrameRay<'a> {
    /// Makes a ray in an instance's space for exact verdicts alone: it has no coordinates and no error bounds.
    pub fn exact_only(instance: &'a MeshInstance, known: Hit) -> Self {
        Self {
            first: instance.first,
            known,
            instance: Some(&instance.to_scene),
            blur: f32::INFINITY,
            ..FrameRay::NOTHING
        }
    }

    /// Returns whether origin or direction have errors of their own: all rays in an instance's space have.
    #[inline(always)]
    pub fn is_blurred(&self) -> bool {
        self.blur != 0.0
    }

    /// Returns an upper bound, rounding included, on the frame distance of anything at scene distance `t` or nearer.
    #[inline(always)]
    pub fn reach(&self, t: f32) -> f32 {
        self.slackened(t, PRUNE) + self.last_place
    }

    /// Returns the factor from frame to scene distances, a power of two.
    #[inline(always)]
    pub fn to_scene(&self) -> f64 {
        1.0 / self.to_frame
    }

    /// Returns the open interval of frame distances in which a hit provably lies in the ray's own interval and has a
    /// finite `t`. Both ends are NaN if nothing can be proven, as for blurred rays.
    #[inline(always)]
    pub fn certain(&self, ray: &Ray) -> [f32; 2] {
        if self.is_blurred() {
            return [f32::NAN; 2];
        }
        // Written as comparisons, because `min` and `max` would drop NaN.
        let from = self.reach(ray.t_min);
        let to = self.lower(if ray.t_max > f32::MAX {
            f32::MAX
        } else {
            ray.t_max
        });
        [if from < 0.0 { 0.0 } else { from }, to]
    }

    /// Returns the frame distance beyond which every hit is farther than one at frame distance `high` or nearer, even
    /// after both distances are rounded in the scene.
    #[inline(always)]
    pub fn beyond(&self, high: f32) -> f32 {
        high * (PRUNE * PRUNE) + 2.0 * self.last_place
    }

    /// Returns a lower bound, rounding included, on the frame distance of anything at scene distance `t` or farther.
    #[inline(always)]
    pub fn lower(&self, t: f32) -> f32 {
        self.slackened(t, 2.0 - PRUNE) - self.last_place
    }

    /// Converts `t` to frame units, with slack: positive distances are multiplied by `factor`, negative ones by
    /// `2 - factor`, so that both move in the same direction. The shift of the origin is subtracted with slack
    /// for its own rounding.
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
