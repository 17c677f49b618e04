// SPDX-License-Identifier: GPL-3.0-or-later
//! Rays that start, lie or end in the split planes of trees.

use crate::cases::rays::{lattice_rays, ray};
use crate::cases::shapes::{grid, nudged};
use crate::cases::{Draft, Random, Recipe, Size};

/// The cases of this file.
pub const CASES: &[Recipe] = &[
    Recipe {
        name: "touching boxes",
        summary: "every wall twice, on a lattice; rays in walls, along edges, through corners",
        extremes: &["X04", "X05", "X06", "X10", "X12", "X41"],
        make: |size, random| {
            let n = size.pick(5, 12);
            (grid(n, 0.0), lattice_rays(n, random, 5 * size.rays()))
        },
    },
    Recipe {
        name: "turned boxes",
        summary: "the same, rotated and sheared: most planes are perpendicular to no axis",
        extremes: &["X28"],
        make: |size, _| (grid(size.pick(4, 12), 0.7), vec![]),
    },
    Recipe {
        name: "signs of zero",
        summary: "axis rays with all signs of the zero components, in and between walls",
        extremes: &["X05", "X06", "X07"],
        make: signs_of_zero,
    },
    Recipe {
        name: "coplanar",
        summary: "overlapping axis-aligned triangles in one plane",
        extremes: &["X12", "X13"],
        make: coplanar,
    },
    Recipe {
        name: "identical",
        summary: "one triangle many times: the smallest number wins, the depth stays bounded",
        extremes: &["X14"],
        make: |size, random| {
            let one = [[0.0; 3], [2.0, 0.0, 1.0], [0.0, 2.0, 1.0]];
            let corners = one.repeat(size.pick(100, 1000));
            (corners, lattice_rays(2, random, size.rays() / 4))
        },
    },
    Recipe {
        name: "walls one float apart",
        summary: "no split fits between; gaps of one float between neighbours",
        extremes: &["X23", "X39", "X40"],
        make: walls,
    },
    Recipe {
        name: "ends of the interval",
        summary: "t_min and t_max at the hit, one float before and one beyond",
        extremes: &["X10", "X11"],
        make: interval_ends,
    },
    Recipe {
        name: "behind the origin",
        summary: "intervals that begin before the ray does: the farthest behind is the nearest hit",
        extremes: &["X11"],
        make: behind,
    },
];

/// Makes rays along axes with all signs of their zero components.
fn signs_of_zero(size: Size, random: &mut Random) -> Draft {
    let mut rays = Vec::new();
    for _ in 0..size.rays() / 8 {
        let axis = random.below(3);
        let mut o: [f32; 3] = std::array::from_fn(|_| random.below(9) as f32 / 2.0 - 0.5);
        // Start in a wall, between walls, or outside.
        o[axis] = random.pick(&[-1.0, 0.0, 1.0, 1.5, 4.0]);
        // Add all combinations of signs, those of zeros included.
        for signs in 0..8 {
            let d = std::array::from_fn(|k| {
                let size = if k == axis { 1.0 } else { 0.0_f32 };
                if signs >> k & 1 == 1 { -size } else { size }
            });
            rays.push(ray(o, d));
        }
    }
    (grid(3, 0.0), rays)
}

/// Makes overlapping triangles in two planes z = const, and rays from, to and in these planes.
fn coplanar(size: Size, random: &mut Random) -> Draft {
    let mut corners = Vec::new();
    for i in 0..size.pick(150, 1000) {
        let (x, y) = (random.below(8) as f32, random.below(8) as f32);
        let z = [1.0, 1.0, 1.0, 2.0][i % 4];
        corners.extend([[x, y, z], [x + 3.0, y, z], [x, y + 3.0, z]]);
    }
    let lattice = lattice_rays(8, random, size.rays());
    // Add rays from a plane, to a plane, and in a plane.
    let from = |r: &mut Random| {
        let o = [
            8.0 * r.unit(),
            8.0 * r.unit(),
            r.pick(&[1.0, 0.0, 2.0, 3.0]),
        ];
        ray(o, [r.unit() - 0.5, 0.0, r.pick(&[1.0, -1.0, 0.0, -0.0])])
    };
    let rays = lattice.into_iter();
    let own: Vec<_> = (0..size.rays()).map(|_| from(random)).collect();
    (corners, rays.chain(own).collect())
}

/// Makes parallel walls at distances of one float, three at each position.
fn walls(size: Size, random: &mut Random) -> Draft {
    let mut corners = Vec::new();
    let mut x = 1.0_f32;
    for i in 0..size.pick(60, 3000) {
        corners.extend([[x, 0.0, 0.0], [x, 4.0, 0.0], [x, 0.0, 4.0]]);
        // Move every third wall one float farther.
        if i % 3 == 0 {
            x = nudged(x, 1);
        }
    }
    let mut rays = lattice_rays(3, random, size.rays() / 2);
    for _ in 0..size.rays() / 2 {
        // Start in or between walls, and go along them or at a tiny angle to them.
        let start = nudged(1.0, i32::try_from(random.below(25)).expect("small"));
        let o = [start, random.unit(), random.unit()];
        rays.push(ray(o, [random.pick(&[0.0, 1e-7, -1e-7, 1e-30]), 1.0, 0.5]));
    }
    (corners, rays)
}

/// Makes rays whose intervals begin before their origins.
fn behind(size: Size, random: &mut Random) -> Draft {
    let n = size.pick(4, 12);
    let mut rays = lattice_rays(n, random, size.rays());
    for limited in &mut rays {
        // Scale the direction, and begin the interval before the origin.
        let length = random.pick(&[1.0, 2.5, 1e-3, 1e3]);
        limited.d = limited.d.map(|x| x * length);
        limited.t_min = random.pick(&[-1.0, -0.4, -100.0, f32::NEG_INFINITY]);
        limited.t_max = random.pick(&[0.0, 1.0, nudged(1.0, 1), -0.2, f32::INFINITY]);
    }
    (grid(n, 0.0), rays)
}

/// Makes rays whose intervals begin or end at a hit, or one float off.
fn interval_ends(size: Size, random: &mut Random) -> Draft {
    let n = 4;
    let mut rays = Vec::new();
    for _ in 0..size.rays() {
        let axis = random.below(3);
        let mut o = random.point(0.0, n as f32);
        o[axis] = -1.0;
        // Cross the walls perpendicularly, so that hits have exact distances.
        let mut d = [0.0; 3];
        d[axis] = 1.0;
        // Begin and end the interval at a wall, or one float off.
        let wall = (random.below(n + 1) + 1) as f32;
        let (one, other) = (random.pick(&[-1, 0, 1]), random.pick(&[-1, 0, 1]));
        let mut limited = ray(o, d);
        limited.t_min = random.pick(&[0.0, nudged(wall, one), nudged(wall - 0.5, one)]);
        limited.t_max = random.pick(&[f32::INFINITY, nudged(wall, other)]);
        rays.push(limited);
    }
    (grid(n, 0.0), rays)
}
