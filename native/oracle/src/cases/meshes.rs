// SPDX-License-Identifier: GPL-3.0-or-later
//! Surfaces with shared edges and vertices, where errors show as gaps.

use crate::cases::rays::{everywhere, from_inside, ray, towards};
use crate::cases::shapes::{bumpy_sphere, icosphere, nudged, placed};
use crate::cases::{Draft, Random, Recipe, Size};

pub const CASES: &[Recipe] = &[
    Recipe {
        name: "fan",
        summary: "all triangles share a corner, and rays go through it",
        extremes: &["X15"],
        make: fan,
    },
    Recipe {
        name: "sphere from inside",
        summary: "a closed sphere, rays aimed at its corners and edge midpoints",
        extremes: &["X16"],
        make: |size, random| sphere(size, 0.0, random),
    },
    Recipe {
        name: "sphere at 10^3",
        summary: "the same with radius 100, a thousand units from the origin",
        extremes: &["X17"],
        make: |size, random| sphere(size, 1e3, random),
    },
    Recipe {
        name: "sphere at 10^5",
        summary: "the same at a hundred thousand",
        extremes: &["X17"],
        make: |size, random| sphere(size, 1e5, random),
    },
    Recipe {
        name: "sphere at 10^7",
        summary: "the same at ten million, where floats are one unit apart",
        extremes: &["X17"],
        make: |size, random| sphere(size, 1e7, random),
    },
    Recipe {
        name: "bumpy sphere",
        summary: "a closed surface that turns in and out, seen from inside",
        extremes: &["X16"],
        make: |size, random| {
            let corners = bumpy_sphere(size.pick(2, 5));
            let rays = from_inside(&corners, [0.0; 3], 0.3, size.rays(), random);
            (corners, rays)
        },
    },
    Recipe {
        name: "diagonal of a quad",
        summary: "two triangles, rays at random points of the edge they share",
        extremes: &["X18"],
        make: diagonal,
    },
    Recipe {
        name: "T-junctions",
        summary: "edges split on one side only, by a corner off by rounding",
        extremes: &["X19"],
        make: t_junctions,
    },
    Recipe {
        name: "checker",
        summary: "quads one float apart, and rays through the gaps",
        extremes: &["X59"],
        make: checker,
    },
    Recipe {
        name: "nested shells",
        summary: "spheres one float inside each other",
        extremes: &[],
        make: shells,
    },
];

fn fan(size: Size, random: &mut Random) -> Draft {
    let count = size.pick(300, 100_000);
    let step = std::f32::consts::TAU / count as f32;
    // The rim is a wavy circle.
    let rim = |i: usize| {
        let angle = (i % count) as f32 * step;
        [angle.cos(), angle.sin(), 0.1 * (5.0 * angle).sin()]
    };
    let top = [0.0, 0.0, 0.5];
    let corners = (0..count).flat_map(|i| [top, rim(i), rim(i + 1)]).collect();
    let origins: Vec<_> = (0..200).map(|_| random.point(-1.0, 2.0)).collect();
    let rays = origins.into_iter().flat_map(|o| towards(o, [top]));
    (corners, rays.collect())
}

fn sphere(size: Size, offset: f32, random: &mut Random) -> Draft {
    let radius = if offset == 0.0 { 1.0 } else { 100.0 };
    let centre = [offset, -offset, 0.5 * offset];
    let corners = placed(&icosphere(size.pick(2, 5)), radius, centre);
    let rays = from_inside(&corners, centre, 0.3 * radius, size.rays(), random);
    (corners, rays)
}

fn diagonal(size: Size, random: &mut Random) -> Draft {
    let quad = [
        [0.1_f32, 0.2, 0.3],
        [1.3, 0.1, 0.2],
        [1.1, 1.4, 0.5],
        [-0.2, 1.2, 0.4],
    ];
    let corners = [0, 1, 2, 0, 2, 3].map(|i| quad[i]).to_vec();
    let mut rays = Vec::new();
    for _ in 0..size.rays() {
        let (s, o) = (random.unit(), random.point(-3.0, 5.0));
        // Aim at a point of the shared edge, rounded.
        let target = std::array::from_fn(|k| quad[0][k] + s * (quad[2][k] - quad[0][k]));
        rays.extend(towards(o, [target]));
    }
    (corners, rays)
}

fn t_junctions(size: Size, random: &mut Random) -> Draft {
    let mut corners = Vec::new();
    let mut targets = Vec::new();
    for _ in 0..size.pick(60, 3000) {
        let [a, b, c, d] = [0; 4].map(|_| random.point(-1.0, 1.0));
        let s = random.unit();
        let middle = std::array::from_fn(|k| a[k] + s * (b[k] - a[k]));
        // One triangle on this side of the edge, two on the other.
        corners.extend([a, b, c, a, middle, d, middle, b, d]);
        targets.extend([middle, std::array::from_fn(|k| 0.5 * (a[k] + middle[k]))]);
    }
    let origin = random.point(-3.0, 3.0);
    let mut rays = towards(origin, targets);
    rays.extend(everywhere(size.rays(), random));
    (corners, rays)
}

fn checker(size: Size, random: &mut Random) -> Draft {
    let n = size.pick(12, 100);
    // Consecutive intervals with a gap of one float.
    let mut lines = vec![(0.0, 0.0)];
    for i in 0..n {
        let low = if i == 0 { 1.0 } else { nudged(lines[i].1, 1) };
        lines.push((low, low + 0.125));
    }
    let lines = &lines[1..];
    let mut corners = Vec::new();
    let mut rays = Vec::new();
    for &(x, x1) in lines {
        for &(y, y1) in lines {
            let quad = [[x, y, 0.0], [x1, y, 0.0], [x1, y1, 0.0], [x, y1, 0.0]];
            corners.extend([0, 1, 2, 0, 2, 3].map(|i| quad[i]));
        }
        // On the rim, and at an angle through the gap.
        let y = lines[random.below(n)].0;
        rays.push(ray([x1, y + 0.01, 1.0], [0.0, 0.0, -1.0]));
        rays.push(ray([x1 - 1.0, y + 0.01, 1.0], [1.0 + 6e-8, 0.0, -1.0]));
        rays.push(ray([x1 - 1.0, y - 1.0, 1.0], [1.0, 1.0, -1.0]));
    }
    (corners, rays)
}

fn shells(size: Size, random: &mut Random) -> Draft {
    let sphere = icosphere(size.pick(1, 3));
    let shell = |i: i32| sphere.iter().map(move |p| p.map(|x| nudged(x, i)));
    let corners: Vec<_> = (0..10).flat_map(shell).collect();
    let rays = from_inside(&corners, [0.0; 3], 0.5, size.rays() / 2, random);
    (corners, rays)
}
