// SPDX-License-Identifier: GPL-3.0-or-later
//! Rays chosen to expose errors.

use crate::cases::Random;
use halfspace_ray::Ray;
use halfspace_scene::Triangles;

/// Returns a ray from `t = 0` to infinity.
pub fn ray(o: [f32; 3], d: [f32; 3]) -> Ray {
    Ray {
        o,
        d,
        t_min: 0.0,
        t_max: f32::INFINITY,
    }
}

/// Returns rays aimed at vertices and edge points of the scene's triangles, from its vertices and from elsewhere:
/// rounding errors lose such rays first.
pub fn aimed(scene: &Triangles, count: usize, random: &mut Random) -> Vec<Ray> {
    let bounds = scene.bounds();
    let live = scene.live();
    let mut rays = Vec::new();
    for i in 0..count {
        let v = scene.corners(live[random.below(live.len())]);
        let w = scene.corners(live[random.below(live.len())]);
        let s = [0.0, 0.5, 1.0, random.unit()][random.below(4)];
        // Aim at a point of an edge, often one of its ends or its middle.
        let target: [f32; 3] = std::array::from_fn(|k| v[0][k] + s * (v[1][k] - v[0][k]));
        // Start at a vertex or edge of another triangle, or anywhere around the scene.
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

/// Returns rays along axes and diagonals of the unit grid of `n` cells per axis: in its walls, along its edges and
/// through its corners, with all signs of zero.
pub fn lattice_rays(n: usize, random: &mut Random, count: usize) -> Vec<Ray> {
    let mut rays = Vec::new();
    let steps = [0.0, -0.0, 1.0, -1.0, 0.5, 1e-20, -1e-38];
    for _ in 0..count {
        // Make three of four coordinates multiples of one half.
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

/// Returns rays with random origins and directions around the cube from -1 to 1.
pub fn everywhere(count: usize, random: &mut Random) -> Vec<Ray> {
    let one = |_| ray(random.point(-2.0, 2.0), random.point(-1.0, 1.0));
    (0..count).map(one).collect()
}

/// Returns rays from `origin`, one to each target.
pub fn towards(origin: [f32; 3], targets: impl IntoIterator<Item = [f32; 3]>) -> Vec<Ray> {
    let one = |p: [f32; 3]| ray(origin, std::array::from_fn(|k| p[k] - origin[k]));
    targets.into_iter().map(one).collect()
}

/// Returns rays from points near the centre of a closed shape, half of them to its vertices and edge midpoints, the
/// others in random directions. All of them must hit the shape.
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
        // Aim at a vertex, at the middle of an edge, or anywhere.
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

/// Returns the rays of a pinhole view from `eye` along +x, `width` by `height` pixels, in tiles of 8x8; the image
/// is `2 extent` wide at distance 1.
pub fn view(eye: [f32; 3], width: usize, height: usize, extent: f32) -> Vec<Ray> {
    let mut rays = Vec::new();
    for tile in 0..width.div_ceil(8) * height.div_ceil(8) {
        let corner = [tile % width.div_ceil(8) * 8, tile / width.div_ceil(8) * 8];
        // Skip pixels of incomplete tiles beyond the image.
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
