// SPDX-License-Identifier: GPL-3.0-or-later
//! Cells at halves of halves, as octrees have: rays along their edges and through their corners, also as pixels of
//! views.

use crate::cases::rays::{ray, view};
use crate::cases::shapes::{box_triangles, grid};
use crate::cases::{Draft, Random, Recipe, Size};

/// The cases of this file.
pub const CASES: &[Recipe] = &[
    Recipe {
        name: "octants",
        summary: "boxes on halves, quarters, ... 2^-10; rays along cell edges and main diagonals",
        extremes: &["X41", "X44", "X48"],
        make: octants,
    },
    Recipe {
        name: "touching the root",
        summary: "rays from outside that meet the root only in a corner or along an edge",
        extremes: &["X42", "X52"],
        make: touching,
    },
    Recipe {
        name: "view on the lattice",
        summary: "pixel rays exactly through the edges of cells, from a cell's corner",
        extremes: &["X45", "X46"],
        make: |size, _| {
            let n = size.pick(24, 256);
            let mut rays = view([-4.0, 2.0, 2.0], n, n, 1.0);
            rays.extend(view([2.0; 3], n, n, 1.0));
            rays.extend(view([2.0; 3], 1, 37, 0.5));
            rays.extend(view([2.0; 3], 1, 1, 0.5));
            (grid(4, 0.0), rays)
        },
    },
    Recipe {
        name: "wide view",
        summary: "150 degrees wide, so that the dominant axis changes; cells behind the camera",
        extremes: &["X47"],
        make: |size, _| {
            let n = size.pick(24, 256);
            (
                grid(size.pick(4, 12), 0.3),
                view([1.7, 1.3, 2.1], n, n, 3.732),
            )
        },
    },
];

/// Makes boxes in ever smaller octants towards two corners of the unit cube, and some elsewhere.
fn octants(size: Size, random: &mut Random) -> Draft {
    let mut corners = Vec::new();
    for level in 0..10 {
        let s = 2.0_f32.powi(-level);
        for _ in 0..size.pick(2, 40) {
            let cells = random.pick(&[1, 2, 1 << level]);
            // Place boxes in random cells of this level.
            let at = [0; 3].map(|_| random.below(cells) as f32 * s);
            corners.extend(box_triangles(at, at.map(|x| x + 0.5 * s)));
        }
        corners.extend(box_triangles([0.5 * s; 3], [s; 3]));
    }
    let mut rays = Vec::new();
    for _ in 0..2 * size.rays() {
        // Start at a lattice point of a random level, and aim along edges or diagonals.
        let level = i32::try_from(random.below(10)).expect("small");
        let s = 2.0_f32.powi(-level);
        let cells = 2 << level;
        let o = [0; 3].map(|_| (random.below(cells + 2) as f32 - 1.0) * s);
        rays.push(ray(
            o,
            [0; 3].map(|_| random.pick(&[0.0, -0.0, 1.0, -1.0, 0.5])),
        ));
    }
    (corners, rays)
}

/// Makes rays that touch the scene's box only in a corner or along an edge.
fn touching(size: Size, random: &mut Random) -> Draft {
    let corners = grid(2, 0.0);
    let mut rays = Vec::new();
    for _ in 0..size.rays() {
        let corner = [0; 3].map(|_| random.pick(&[0.0_f32, 2.0]));
        // Choose a direction at random; if it points outwards on one axis and inwards on another, the ray only touches.
        let d = [0; 3].map(|_| random.pick(&[1.0, -1.0, 0.5, -0.0, 0.0]));
        let back = random.pick(&[0.0, 1.0, 4.0]);
        rays.push(ray(std::array::from_fn(|k| corner[k] - back * d[k]), d));
    }
    (corners, rays)
}
