// SPDX-License-Identifier: GPL-3.0-or-later
//! How a vector becomes a place on an image, with the orientations of Blender.

use std::f32::consts::{FRAC_1_PI, TAU};

use crate::math::vector::{Vec3, vec3};

/// From the vector of a texture node to a place on its image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Projection {
    /// The first two components.
    Flat,
    /// Longitude and latitude around the middle of the unit cube.
    Sphere,
    /// Longitude around, and height in, the unit cube.
    Tube,
    /// An equirectangular map of all directions.
    Panorama,
    /// A photograph of a ball that mirrors all directions, seen along +Y.
    MirrorBall,
    /// Along each axis, chosen by a normal. The width of the blends between two sides, 0 to 1.
    Box(f32),
}

impl Projection {
    /// The projections by their names, boxes without blends.
    pub const NAMED: &'static [(&'static str, Self)] = &[
        ("flat", Self::Flat),
        ("sphere", Self::Sphere),
        ("tube", Self::Tube),
        ("panorama", Self::Panorama),
        ("mirror_ball", Self::MirrorBall),
        ("box", Self::Box(0.0)),
    ];

    /// Returns what an image shows for a vector. `normal`: returns the normal in the space of the box. `at`: returns
    /// the colour at (u, v).
    #[inline]
    pub fn look_up(
        self,
        p: Vec3,
        normal: impl FnOnce() -> Vec3,
        at: impl Fn([f32; 2]) -> [f32; 4],
    ) -> [f32; 4] {
        match self {
            Self::Flat => at([p.x, p.y]),
            Self::Sphere => at(on_sphere(centred(p))),
            Self::Tube => at(on_tube(centred(p))),
            Self::Panorama => at(direction_to_uv(p)),
            Self::MirrorBall => at(on_mirror_ball(p)),
            Self::Box(blend) => in_box(p, normal(), blend, at),
        }
    }
}

/// From the unit cube to that around the origin.
#[inline(always)]
fn centred(p: Vec3) -> Vec3 {
    (p - Vec3::splat(0.5)) * 2.0
}

/// Longitude of a vector, 0 to 1.
#[inline(always)]
fn longitude(p: Vec3) -> f32 {
    0.5 * (1.0 - p.x.atan2(p.y) * FRAC_1_PI)
}

fn on_sphere(p: Vec3) -> [f32; 2] {
    let length = p.length();
    if length == 0.0 {
        return [0.0; 2];
    }
    let around = if p.x == 0.0 && p.y == 0.0 {
        0.0
    } else {
        longitude(p)
    };
    [
        around,
        1.0 - (p.z / length).clamp(-1.0, 1.0).acos() * FRAC_1_PI,
    ]
}

fn on_tube(p: Vec3) -> [f32; 2] {
    if p.x == 0.0 && p.y == 0.0 {
        return [0.0; 2];
    }
    [longitude(p), 0.5 * (p.z + 1.0)]
}

/// Maps a direction to its position in an equirectangular image, with Blender's orientation.
pub fn direction_to_uv(d: Vec3) -> [f32; 2] {
    if d == Vec3::ZERO {
        return [0.0; 2];
    }
    [
        0.5 - d.y.atan2(d.x) / TAU,
        0.5 + d.z.atan2(d.x.hypot(d.y)) * FRAC_1_PI,
    ]
}

/// The normal of the ball halves the angle between the direction and that towards the camera.
fn on_mirror_ball(d: Vec3) -> [f32; 2] {
    let half = d.normalized_or(Vec3::ZERO) - vec3(0.0, 1.0, 0.0);
    let normal = half.normalized_or(half);
    [0.5 * (normal.x + 1.0), 0.5 * (normal.z + 1.0)]
}

/// Colour of the sides of a box, blended by the normal.
fn in_box(p: Vec3, normal: Vec3, blend: f32, at: impl Fn([f32; 2]) -> [f32; 4]) -> [f32; 4] {
    let [x, y, z] = shares(normal, blend.clamp(0.0, 1.0));
    // Turn the sides that would be mirrored.
    let turned = |backward: bool, t: f32| if backward { 1.0 - t } else { t };
    let sides = [
        (x, [turned(normal.x < 0.0, p.y), p.z]),
        (y, [turned(normal.y > 0.0, p.x), p.z]),
        (z, [turned(normal.z > 0.0, p.y), p.x]),
    ];
    let mut sum = [0.0; 4];
    for (share, uv) in sides {
        if share > 0.0 {
            let side = at(uv);
            for k in 0..4 {
                sum[k] += share * side[k];
            }
        }
    }
    sum
}

/// The shares of the sides across each axis, which add up to 1: one side where the normal is near its axis, two in the
/// strips between two axes, three around the middle.
fn shares(normal: Vec3, blend: f32) -> [f32; 3] {
    let total = normal.x.abs() + normal.y.abs() + normal.z.abs();
    let n = [normal.x, normal.y, normal.z].map(|x| x.abs() / total);
    let limit = 0.5 * (1.0 + blend);
    // One side.
    for k in 0..3 {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        if n[k] > limit * (n[k] + n[i]) && n[k] > limit * (n[k] + n[j]) {
            return std::array::from_fn(|axis| f32::from(u8::from(axis == k)));
        }
    }
    if blend <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    // Two sides, where the third is small next to both.
    for (first, second, third) in [(0, 1, 2), (1, 2, 0), (0, 2, 1)] {
        if n[third] < (1.0 - limit) * (n[first] + n[second]) {
            let share = n[first] / (n[first] + n[second]);
            let share = ((share - 0.5 * (1.0 - blend)) / blend).clamp(0.0, 1.0);
            let mut found = [0.0; 3];
            (found[first], found[second]) = (share, 1.0 - share);
            return found;
        }
    }
    n.map(|x| ((2.0 - limit) * x + (limit - 1.0)) / (2.0 * limit - 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sides_of_a_box_share_all_of_it() {
        for blend in [0.0, 0.1, 0.5, 1.0] {
            for i in 0..1000_u16 {
                let t = f32::from(i) * 0.618_034;
                let normal = vec3(t.sin(), (3.0 * t).cos(), (7.0 * t).sin());
                let found = shares(normal, blend);
                let sum: f32 = found.iter().sum();
                assert!((sum - 1.0).abs() < 1e-5, "{normal:?} {blend}: {found:?}");
                assert!(
                    found.iter().all(|&x| x >= -1e-6),
                    "{normal:?} {blend}: {found:?}"
                );
            }
        }
        assert_eq!(shares(vec3(0.0, -3.0, 0.1), 0.2), [0.0, 1.0, 0.0]);
        let [x, y, z] = shares(vec3(1.0, -1.0, 0.1), 0.2);
        assert!((x - 0.5).abs() < 1e-6 && (y - 0.5).abs() < 1e-6 && z == 0.0);
    }

    #[test]
    fn each_side_of_a_box_is_upright_and_not_mirrored() {
        let shown = |normal: Vec3| {
            let uv = |uv: [f32; 2]| [uv[0], uv[1], 0.0, 1.0];
            let [u, v, ..] = Projection::Box(0.0).look_up(vec3(0.2, 0.3, 0.4), || normal, uv);
            [u, v]
        };
        assert_eq!(shown(vec3(1.0, 0.0, 0.0)), [0.3, 0.4]);
        assert_eq!(shown(vec3(-1.0, 0.0, 0.0)), [0.7, 0.4]);
        assert_eq!(shown(vec3(0.0, 1.0, 0.0)), [0.8, 0.4]);
        assert_eq!(shown(vec3(0.0, -1.0, 0.0)), [0.2, 0.4]);
        assert_eq!(shown(vec3(0.0, 0.0, 1.0)), [0.7, 0.2]);
        assert_eq!(shown(vec3(0.0, 0.0, -1.0)), [0.3, 0.2]);
    }

    #[test]
    fn balls_and_tubes_are_wrapped_around_the_vertical_axis() {
        let uv = |projection: Projection, p: Vec3| {
            let found = projection.look_up(p, || Vec3::ZERO, |uv| [uv[0], uv[1], 0.0, 1.0]);
            [found[0], found[1]]
        };
        let middle = Vec3::splat(0.5);
        assert_eq!(uv(Projection::Sphere, middle), [0.0; 2]);
        assert_eq!(uv(Projection::Sphere, vec3(0.5, 0.5, 0.9)), [0.0, 1.0]);
        assert_eq!(uv(Projection::Sphere, vec3(0.5, 0.9, 0.5)), [0.5, 0.5]);
        assert_eq!(uv(Projection::Sphere, vec3(0.9, 0.5, 0.5)), [0.25, 0.5]);
        assert_eq!(uv(Projection::Tube, vec3(0.9, 0.5, 0.75)), [0.25, 0.75]);
        assert_eq!(uv(Projection::Tube, middle), [0.0; 2]);
        // The camera looks along +Y at the middle, which mirrors it; the rim shows what is behind the ball.
        let ball = |x, y, z| uv(Projection::MirrorBall, vec3(x, y, z));
        assert_eq!(ball(0.0, -3.0, 0.0), [0.5, 0.5]);
        let [u, v] = ball(2.0, 0.0, 0.0);
        assert!((u - 0.5 - 0.125_f32.sqrt()).abs() < 1e-6 && v == 0.5);
        assert_eq!(ball(0.0, 0.0, 0.0), [0.5, 0.5]);
    }
}
