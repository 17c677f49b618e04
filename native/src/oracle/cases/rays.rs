// SPDX-License-Identifier: GPL-3.0-or-later
//! Rays that look for trouble.

use super::Random;
use crate::scene::Triangles;
use crate::traverse::Ray;

/// A ray without limits.
pub fn ray(o: [f32; 3], d: [f32; 3]) -> Ray {
    Ray {
        o,
        d,
        t_min: 0.0,
        t_max: f32::INFINITY,
    }
}

/// Rays aimed at corners and edge points of the scene's triangles, from its corners and from
/// elsewhere: the rays that rounding loses first.
pub fn aimed(scene: &Triangles, count: usize, random: &mut Random) -> Vec<Ray> {
    let bounds = scene.bounds();
    let live = scene.live();
    let mut rays = Vec::new();
    for i in 0..count {
        let v = scene.corners(live[random.below(live.len())]);
        let w = scene.corners(live[random.below(live.len())]);
        let s = [0.0, 0.5, 1.0, random.unit()][random.below(4)];
        let target: [f32; 3] = std::array::from_fn(|k| v[0][k] + s * (v[1][k] - v[0][k]));
        let origin: [f32; 3] = match i % 4 {
            0 => w[0],
            1 => std::array::from_fn(|k| 0.5 * (w[0][k] + w[1][k])),
            _ => std::array::from_fn(|k| {
                let size = bounds.max[k] - bounds.min[k];
                bounds.min[k] - size + 3.0 * size * random.unit()
            }),
        };
        rays.push(ray(origin, std::array::from_fn(|k| target[k] - origin[k])));
    }
    rays
}

/// Rays along axes and diagonals of a unit grid, in its walls, along its edges, through its corners,
/// with all signs of zero.
pub fn lattice_rays(n: usize, random: &mut Random, count: usize) -> Vec<Ray> {
    let mut rays = Vec::new();
    let steps = [0.0, -0.0, 1.0, -1.0, 0.5, 1e-20, -1e-38];
    for _ in 0..count {
        let place = |random: &mut Random| {
            let whole = random.below(2 * n + 5) as f32 / 2.0 - 1.0;
            if random.below(4) == 0 {
                whole + random.unit()
            } else {
                whole
            }
        };
        let o = [place(random), place(random), place(random)];
        let d = std::array::from_fn(|_| steps[random.below(steps.len())]);
        rays.push(ray(o, d));
    }
    rays
}

/// Rays from anywhere to anywhere around the cube from -1 to 1.
pub fn everywhere(count: usize, random: &mut Random) -> Vec<Ray> {
    let one = |_| ray(random.point(-2.0, 2.0), random.point(-1.0, 1.0));
    (0..count).map(one).collect()
}

/// Rays from a point to points.
pub fn towards(origin: [f32; 3], targets: impl IntoIterator<Item = [f32; 3]>) -> Vec<Ray> {
    let one = |p: [f32; 3]| ray(origin, std::array::from_fn(|k| p[k] - origin[k]));
    targets.into_iter().map(one).collect()
}

/// Rays from points near the middle of a closed shape to its corners and edge midpoints, one half,
/// and anywhere, the other: none may leave it.
pub fn from_inside(
    corners: &[[f32; 3]],
    centre: [f32; 3],
    radius: f32,
    count: usize,
    random: &mut Random,
) -> Vec<Ray> {
    let one = |i: usize| {
        let offset = random.point(-radius, radius);
        let origin: [f32; 3] = std::array::from_fn(|k| centre[k] + offset[k]);
        let target = match i % 4 {
            0 => random.pick(corners),
            1 => {
                let at = 3 * random.below(corners.len() / 3);
                let (a, b) = (corners[at], corners[at + 1]);
                std::array::from_fn(|k| 0.5 * a[k] + 0.5 * b[k])
            }
            _ => {
                let to = random.point(-1.0, 1.0);
                std::array::from_fn(|k| origin[k] + to[k])
            }
        };
        ray(origin, std::array::from_fn(|k| target[k] - origin[k]))
    };
    (0..count).map(one).collect()
}

/// The rays of a pinhole view from `eye` along +x, `width` by `height` pixels, tile after tile of
/// 8x8, the picture `2 extent` wide at distance 1.
pub fn view(eye: [f32; 3], width: usize, height: usize, extent: f32) -> Vec<Ray> {
    let mut rays = Vec::new();
    for tile in 0..width.div_ceil(8) * height.div_ceil(8) {
        let corner = [tile % width.div_ceil(8) * 8, tile / width.div_ceil(8) * 8];
        for pixel in 0..64 {
            let (x, y) = (corner[0] + pixel % 8, corner[1] + pixel / 8);
            if x < width && y < height {
                let across = |i: usize, n: usize| (2.0 * i as f32 + 1.0) / n as f32 - 1.0;
                let d = [1.0, extent * across(x, width), extent * across(y, height)];
                rays.push(ray(eye, d));
            }
        }
    }
    rays
}
