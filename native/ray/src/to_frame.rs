// SPDX-License-Identifier: GPL-3.0-or-later
//! The map from scene coordinates to frame coordinates: a translation that rounds no vertex, and a scale.

use crate::frame::U;
use halfspace_geom::Aabb;
use halfspace_geom::vec3::map;

/// Distance of the scene from the origin along an axis, in largest extents of the scene, from which on the frame is
/// translated along this axis. Chosen: nearer scenes keep their coordinates, and their error bounds are at most
/// about twenty times those of a scene at the origin, which no structure notices. At least 4 is needed below.
const FAR: f32 = 16.0;

/// The map from scene to frame coordinates.
///
/// Error bounds of a traversal are proportional to the largest coordinate of its frame. Along an axis on which the
/// scene is far from the origin, the frame's origin therefore lies at the middle of the scene. This changes no bit of
/// a vertex: the coordinates of all vertices and of the middle differ by less than a factor of 2, so that their
/// differences are exact (Sterbenz 1974, theorem 4.3.1).
#[derive(Debug, Clone, Copy)]
pub struct ToFrame {
    /// Point of the scene at the frame's origin; +0 along axes without a translation.
    origin: [f32; 3],
    /// [`Self::origin`], but -0 along axes without a translation: adding it keeps the sign of zero.
    back: [f32; 3],
    /// Largest distance from `origin`, per axis, at which the differences of all coordinates are exact.
    exact: [f32; 3],
    /// Factor from scene to frame coordinates, a power of two.
    scale: f32,
}

impl Default for ToFrame {
    /// The identity.
    fn default() -> Self {
        Self {
            origin: [0.0; 3],
            back: [-0.0; 3],
            exact: [f32::INFINITY; 3],
            scale: 1.0,
        }
    }
}

impl ToFrame {
    /// Makes the map for a scene with these bounds. The scale is 1 for empty scenes and if the largest absolute
    /// coordinate after the translation is from 2^-30 to 2^40.
    pub fn new(bounds: &Aabb) -> Self {
        let mut out = Self::default();
        if bounds.is_empty() {
            return out;
        }
        // Translate along the axes on which the scene is far from the origin.
        let extent = (0..3).fold(0.0_f32, |most, k| most.max(bounds.max[k] - bounds.min[k]));
        for k in 0..3 {
            let nearest = bounds.min[k].max(-bounds.max[k]);
            if nearest > FAR * extent {
                let middle = bounds.min[k] + 0.5 * (bounds.max[k] - bounds.min[k]);
                out.origin[k] = middle;
                out.back[k] = middle;
                out.exact[k] = 0.5 * middle.abs();
            }
        }
        // Scale only scenes whose products of three coordinates may overflow or underflow.
        let magnitude = out.bounds(bounds).magnitude();
        let ordinary =
            magnitude == 0.0 || (2.0_f32.powi(-30)..=2.0_f32.powi(40)).contains(&magnitude);
        if !ordinary {
            out.scale = (1.0 / power_of_two(magnitude)).min(2.0_f32.powi(126));
        }
        out
    }

    /// Converts a point of the scene to the frame.
    #[inline(always)]
    pub fn point(&self, p: [f32; 3]) -> [f32; 3] {
        [
            (p[0] - self.origin[0]) * self.scale,
            (p[1] - self.origin[1]) * self.scale,
            (p[2] - self.origin[2]) * self.scale,
        ]
    }

    /// Converts a point of the frame to the scene; exact for vertices, unless the scale is so small that it rounds.
    #[inline(always)]
    pub fn to_scene(&self, p: [f32; 3]) -> [f32; 3] {
        [
            p[0] / self.scale + self.back[0],
            p[1] / self.scale + self.back[1],
            p[2] / self.scale + self.back[2],
        ]
    }

    /// Converts a vertex from an unscaled frame ([`Self::is_unscaled`]) to the scene; exact.
    #[inline(always)]
    pub fn vertex_to_scene(&self, p: [f32; 3]) -> [f32; 3] {
        [
            p[0] + self.back[0],
            p[1] + self.back[1],
            p[2] + self.back[2],
        ]
    }

    /// Converts a box around points of the scene to the frame.
    pub fn bounds(&self, bounds: &Aabb) -> Aabb {
        if bounds.is_empty() {
            return *bounds;
        }
        Aabb {
            min: self.point(bounds.min),
            max: self.point(bounds.max),
        }
    }

    /// Returns the point of the scene at the frame's origin.
    #[inline(always)]
    pub fn origin(&self) -> [f32; 3] {
        self.origin
    }

    /// Returns, per axis of an unscaled frame, the largest absolute frame coordinate up to which [`Self::point`] is
    /// exact for every point; infinity on axes without a translation.
    #[inline(always)]
    pub fn exact(&self) -> [f32; 3] {
        self.exact
    }

    /// Returns whether a point of an unscaled frame ([`Self::is_unscaled`]) is certainly not rounded. NaN is not.
    #[inline(always)]
    pub fn is_exact(&self, p: [f32; 3]) -> bool {
        p[0].abs() <= self.exact[0] && p[1].abs() <= self.exact[1] && p[2].abs() <= self.exact[2]
    }

    /// Returns the power of two by which coordinates are scaled.
    #[inline(always)]
    pub fn scale(&self) -> f32 {
        self.scale
    }

    /// Returns whether distances in the frame are those of the scene.
    #[inline(always)]
    pub fn is_unscaled(&self) -> bool {
        self.scale == 1.0
    }
}

/// Returns the largest power of two not above `x`, which is positive and finite.
#[inline(always)]
pub(crate) fn power_of_two(x: f32) -> f32 {
    if x.is_normal() {
        f32::from_bits(x.to_bits() & 0x7f80_0000)
    } else {
        // Keep the highest set bit of a subnormal number.
        f32::from_bits(1 << (31 - x.to_bits().leading_zeros()))
    }
}

/// Returns bounds on the rounding errors of a point converted by [`ToFrame::point`]: zero if it is exact.
#[inline(always)]
pub(crate) fn rounding(to_frame: &ToFrame, p: [f32; 3], converted: [f32; 3]) -> [f32; 3] {
    let offset = [
        p[0] - to_frame.origin[0],
        p[1] - to_frame.origin[1],
        p[2] - to_frame.origin[2],
    ];
    if to_frame.is_exact(offset) {
        return [0.0; 3];
    }
    // Half a unit in the last place, rounded up; 2 u also covers the subtraction of a subnormal point.
    map(converted, |x| 2.0 * U * x.abs() + f32::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn around(middle: [f32; 3], half: f32) -> Aabb {
        Aabb {
            min: middle.map(|x| x - half),
            max: middle.map(|x| x + half),
        }
    }

    #[test]
    fn near_scenes_keep_their_coordinates() {
        for (middle, half) in [
            ([0.0; 3], 1.0),
            ([5.0, -3.0, 0.0], 1.0),
            ([3e4, 0.0, 1.0], 1e3),
        ] {
            let map = ToFrame::new(&around(middle, half));
            assert_eq!((map.origin(), map.scale()), ([0.0; 3], 1.0));
            for x in [-0.0_f32, 0.0, 1.5, -1e-40, f32::MAX] {
                let p = [x, -x, 2.0];
                assert_eq!(map.point(p).map(f32::to_bits), p.map(f32::to_bits));
                assert_eq!(
                    map.vertex_to_scene(p).map(f32::to_bits),
                    p.map(f32::to_bits)
                );
                assert!(map.is_exact(p));
            }
        }
        // A point, and no scene at all.
        assert_eq!(
            ToFrame::new(&around([0.0; 3], 0.0)).exact(),
            [f32::INFINITY; 3]
        );
        assert_eq!(ToFrame::new(&Aabb::EMPTY).origin(), [0.0; 3]);
    }

    #[test]
    fn the_scale_is_that_of_the_extent() {
        assert_eq!(ToFrame::new(&around([1e17; 3], 1e12)).scale(), 1.0);
        assert!(ToFrame::new(&around([1e-9; 3], 1e-14)).scale() > 1e13);
        assert!(ToFrame::new(&around([0.0; 3], 1e17)).scale() < 1e-16);
    }

    /// Returns numbers from -1 to 1, the same in each run.
    fn numbers() -> impl FnMut() -> f32 {
        let mut state = 7_u32;
        move || {
            // Advance a linear congruential generator (Knuth 1997, section 3.3.4, table 1).
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / 8_388_608.0 - 1.0
        }
    }

    #[test]
    fn vertices_are_never_rounded() {
        let (mut number, mut translated) = (numbers(), 0);
        for i in 0..20_000 {
            let middle = [1e6 * number(), 1e3 * number(), number()];
            let half = 2.0_f32.powi(5 - i % 30);
            let map = ToFrame::new(&around(middle, half));
            let p: [f32; 3] = std::array::from_fn(|k| middle[k] + half * number());
            let converted = map.point(p);
            for k in 0..3 {
                let exact = (f64::from(p[k]) - f64::from(map.origin()[k])) * f64::from(map.scale());
                assert_eq!(f64::from(converted[k]), exact, "{middle:?} {half} {p:?}");
            }
            assert_eq!(
                map.to_scene(converted).map(f32::to_bits),
                p.map(f32::to_bits)
            );
            assert_eq!(rounding(&map, p, converted), [0.0; 3]);
            translated += usize::from(map.origin() != [0.0; 3]);
        }
        assert!(translated > 10_000, "{translated}");
    }

    #[test]
    fn the_rounding_of_other_points_is_bounded() {
        let (mut number, mut rounded) = (numbers(), 0);
        for i in 0..20_000 {
            let map = ToFrame::new(&around([1e6 * number(), 1e3 * number(), number()], 0.01));
            let far = 10.0_f32.powi(i % 30 - 10);
            let p = [0; 3].map(|_| far * number());
            let converted = map.point(p);
            let bound = rounding(&map, p, converted);
            for k in 0..3 {
                let exact = f64::from(p[k]) - f64::from(map.origin()[k]);
                let error = (f64::from(converted[k]) - exact).abs();
                assert!(error <= f64::from(bound[k]), "{p:?}: {error} {bound:?}");
                rounded += usize::from(error > 0.0);
            }
        }
        assert!(rounded > 5_000, "{rounded}");
    }
}
