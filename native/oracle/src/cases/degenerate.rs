// SPDX-License-Identifier: GPL-3.0-or-later
//! Degenerate scenes: no or few triangles, triangles in one plane, without area, or with coordinates that are not
//! finite.

use crate::cases::rays::{everywhere, lattice_rays};
use crate::cases::shapes::{cloud, grid};
use crate::cases::{Draft, Random, Recipe, Size};

/// The cases of this file.
pub const CASES: &[Recipe] = &[
    Recipe {
        name: "nothing",
        summary: "no triangle at all",
        extremes: &["X01"],
        make: |_, random| (vec![], everywhere(20, random)),
    },
    Recipe {
        name: "one triangle",
        summary: "fewer triangles than any leaf holds",
        extremes: &["X01", "X37"],
        make: |size, random| {
            let corners = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
            (corners, everywhere(size.rays(), random))
        },
    },
    Recipe {
        name: "no area",
        summary: "all triangles are lines or points",
        extremes: &["X01", "X03"],
        make: |_, random| {
            let mut corners = vec![[1.0; 3]; 30];
            corners.extend((0..30_u8).map(|i| [f32::from(i); 3]));
            (corners, everywhere(20, random))
        },
    },
    Recipe {
        name: "four triangles",
        summary: "fewer triangles than candidate directions",
        extremes: &["X37"],
        make: |size, random| (cloud(4, 0.9, random), everywhere(size.rays(), random)),
    },
    Recipe {
        name: "flat",
        summary: "all in the plane z = 0: a root cell without thickness",
        extremes: &["X02"],
        make: flat,
    },
    Recipe {
        name: "broken numbers",
        summary: "NaN and infinite corners among good ones; intervals that run backwards",
        extremes: &["X55"],
        make: broken,
    },
    Recipe {
        name: "one point",
        summary: "many triangles around one point, which no plane and no octant separates",
        extremes: &["X03", "X43"],
        make: one_point,
    },
];

/// Makes a lattice of triangles in the plane z = 0.
fn flat(size: Size, random: &mut Random) -> Draft {
    let corners = grid(size.pick(3, 8), 0.3);
    let corners = corners.into_iter().map(|p| [p[0], p[1], 0.0]).collect();
    (corners, lattice_rays(3, random, size.rays()))
}

/// Makes a scene and rays of which some have invalid numbers.
fn broken(size: Size, random: &mut Random) -> Draft {
    let mut corners = cloud(size.pick(100, 2000), 0.2, random);
    // Replace one coordinate of every seventh vertex.
    for corner in corners.iter_mut().step_by(7) {
        corner[random.below(3)] = random.pick(&[f32::NAN, f32::INFINITY, f32::NEG_INFINITY]);
    }
    let mut rays = everywhere(size.rays(), random);
    // Give every third ray an empty, infinite or negative interval.
    for ray in rays.iter_mut().step_by(3) {
        (ray.t_min, ray.t_max) = random.pick(&[
            (2.0, 1.0),
            (f32::INFINITY, f32::INFINITY),
            (f32::NEG_INFINITY, f32::INFINITY),
            (-1.0, 0.5),
            (f32::INFINITY, f32::NEG_INFINITY),
        ]);
    }
    (corners, rays)
}

/// Makes tiny triangles around one point, among larger ones.
fn one_point(size: Size, random: &mut Random) -> Draft {
    let mut corners = cloud(40, 0.05, random);
    for _ in 0..size.pick(60, 1000) {
        // Each triangle has a vertex at (1/4, 1/4, 1/4), and a millionth of the scene's size.
        let a = random.point(-1.0, 1.0);
        let b = random.point(-1.0, 1.0);
        corners.extend([
            [0.25; 3],
            a.map(|x| 0.25 + 1e-6 * x),
            b.map(|x| 0.25 + 1e-6 * x),
        ]);
    }
    (corners, everywhere(size.rays(), random))
}
