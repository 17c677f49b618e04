// SPDX-License-Identifier: GPL-3.0-or-later
//! Rays in the planes of triangles or at tiny angles to them; triangles whose planes are bad splits for oblique trees.

use crate::cases::rays::{everywhere, lattice_rays, ray};
use crate::cases::shapes::{cloud, nudged};
use crate::cases::{Draft, Random, Recipe, Size};

/// The cases of this file.
pub const CASES: &[Recipe] = &[
    Recipe {
        name: "grazing",
        summary: "rays that meet a triangle's plane at angles of 2^-10 to 2^-40",
        extremes: &["X26", "X28"],
        make: grazing,
    },
    Recipe {
        name: "in the plane",
        summary: "rays exactly in the oblique plane of a triangle, with neighbours on both sides",
        extremes: &["X27", "X29"],
        make: in_the_plane,
    },
    Recipe {
        name: "cut corners",
        summary: "planes at 45 degrees through the corners and edges of cells, and one float off",
        extremes: &["X30", "X31", "X32"],
        make: cut_corners,
    },
    Recipe {
        name: "nearly parallel",
        summary: "hundreds of planes that differ by a hundredth of a degree",
        extremes: &["X33"],
        make: nearly_parallel,
    },
    Recipe {
        name: "one normal",
        summary: "all triangles parallel: every sampled normal is the same plane again",
        extremes: &["X34", "X36"],
        make: one_normal,
    },
    Recipe {
        name: "twin normals",
        summary: "normals that deviate from an axis by 1e-6, to both sides",
        extremes: &["X35"],
        make: twin_normals,
    },
];

/// Makes rays at a tiny angle to the plane of the triangle that they cross.
fn grazing(size: Size, random: &mut Random) -> Draft {
    let corners = cloud(size.pick(200, 8000), 0.4, random);
    let mut rays = Vec::new();
    for _ in 0..2 * size.rays() {
        let at = 3 * random.below(corners.len() / 3);
        let [a, b, c] = [corners[at], corners[at + 1], corners[at + 2]];
        let lift = 2.0_f32.powi(-i32::try_from(10 + random.below(31)).expect("small"));
        let (s, t) = (random.unit(), random.unit());
        // Start next to the triangle in its plane, and aim across it, slightly out of the plane.
        let o = std::array::from_fn(|k| 2.0 * a[k] - b[k] + 0.3 * s * (c[k] - a[k]));
        let target: [f32; 3] =
            std::array::from_fn(|k| a[k] + t * (b[k] - a[k]) + s * (c[k] - a[k]));
        let mut d: [f32; 3] = std::array::from_fn(|k| target[k] - o[k]);
        d[random.below(3)] += lift;
        rays.push(ray(o, d));
    }
    (corners, rays)
}

/// Makes triangles in planes x + y + z = c, and rays in and near these planes.
fn in_the_plane(size: Size, random: &mut Random) -> Draft {
    let mut corners = Vec::new();
    let mut rays = Vec::new();
    // Choose lattice points of a plane: their differences are exact, and so is the plane.
    let point = |c: f32, random: &mut Random| {
        let (x, y) = (random.below(9) as f32 - 4.0, random.below(9) as f32 - 4.0);
        [x, y, c - x - y]
    };
    for _ in 0..size.pick(150, 5000) {
        let c = random.below(7) as f32 - 3.0;
        corners.extend([point(c, random), point(c, random), point(c, random)]);
    }
    for _ in 0..2 * size.rays() {
        let c = random.below(7) as f32 - 3.0;
        let (o, target) = (point(c, random), point(c, random));
        let mut d: [f32; 3] = std::array::from_fn(|k| target[k] - o[k]);
        if random.below(3) == 0 {
            // Turn the direction slightly out of the plane, to either side.
            d[0] = nudged(d[0], random.pick(&[-1, 1]));
        }
        rays.push(ray(o, d));
    }
    (corners, rays)
}

/// Makes triangles that cut corners and edges off the cells of a lattice.
fn cut_corners(size: Size, random: &mut Random) -> Draft {
    let mut corners = Vec::new();
    let n = size.pick(4, 12);
    for i in 0..n * n * n {
        let [x, y, z] = [i % n, i / n % n, i / n / n].map(|x| x as f32);
        // Sometimes move the corner by one float.
        let up = nudged(x + 1.0, random.pick(&[-1, 0, 0, 0, 1]));
        // Add a triangle through three corners of the cell, and one along the diagonal of a face.
        corners.extend([[up, y, z], [x, y + 1.0, z], [x, y, z + 1.0]]);
        corners.extend([[x, y, z], [up, y + 1.0, z], [up, y + 1.0, z + 1.0]]);
        if i % 3 == 0 {
            corners.extend([[x, y, z], [up, y, z], [x, y + 1.0, z]]);
        }
    }
    let mut rays = lattice_rays(n, random, size.rays());
    for _ in 0..size.rays() {
        let o = std::array::from_fn(|_| random.below(2 * n + 2) as f32 / 2.0 - 0.5);
        rays.push(ray(
            o,
            std::array::from_fn(|_| random.pick(&[1.0, -1.0, 0.0])),
        ));
    }
    (corners, rays)
}

/// Makes triangles that are each rotated by a hundredth of a degree further.
fn nearly_parallel(size: Size, random: &mut Random) -> Draft {
    let mut corners = Vec::new();
    let count = size.pick(200, 2000);
    for i in 0..count {
        // Rotate each triangle by a further hundredth of a degree.
        let (sin, cos) = (i as f32 * 1.745e-4).sin_cos();
        let lift = 0.01 * random.unit();
        let turned = |x: f32, y: f32| [x * cos, y, x * sin + lift];
        corners.extend([turned(-1.0, -1.0), turned(1.0, -1.0), turned(0.0, 1.0)]);
    }
    (corners, everywhere(size.rays(), random))
}

/// Makes triangles with one common normal.
fn one_normal(size: Size, random: &mut Random) -> Draft {
    let mut corners = Vec::new();
    for _ in 0..size.pick(200, 5000) {
        // Span each triangle by multiples of two vectors, from a lattice point: exactly parallel, often coplanar.
        let base = random.point(-1.0, 1.0).map(|x| (8.0 * x).round() / 8.0);
        let step = 0.125 * (1 + random.below(4)) as f32;
        let along = |x: f32, y: f32| {
            [
                base[0] + x * step,
                base[1] + y * step,
                base[2] + (x + 2.0 * y) * step,
            ]
        };
        corners.extend([along(0.0, 0.0), along(1.0, 0.0), along(0.0, 1.0)]);
    }
    (corners, everywhere(size.rays(), random))
}

/// Makes triangles whose normals deviate slightly from the y axis, alternately to both sides.
fn twin_normals(size: Size, random: &mut Random) -> Draft {
    let mut corners = Vec::new();
    for i in 0..size.pick(200, 5000) {
        // Tilt the normals slightly, alternately to both sides.
        let tilt = [1e-6, -1e-6][i % 2];
        let [x, y, z] = random.point(-1.0, 1.0);
        corners.extend([[x, y, z], [x + 0.3, y + 0.3 * tilt, z], [x, y, z + 0.3]]);
    }
    (corners, everywhere(size.rays(), random))
}
