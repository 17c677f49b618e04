// SPDX-License-Identifier: GPL-3.0-or-later
//! Bounding boxes and slabs in limiting cases: touched at a corner, equal, overlapping, separate.

use crate::cases::rays::{everywhere, ray, towards};
use crate::cases::shapes::{cloud, nudged, placed};
use crate::cases::{Draft, Random, Recipe, Size};

pub const CASES: &[Recipe] = &[
    Recipe {
        name: "equal centres",
        summary: "boxes of all sizes around one centre: no order of centres",
        extremes: &["X38"],
        make: equal_centres,
    },
    Recipe {
        name: "gaps between groups",
        summary: "groups apart; rays in the gap, and exactly on its borders",
        extremes: &["X39", "X40"],
        make: gaps,
    },
    Recipe {
        name: "corners of boxes",
        summary: "rays that touch a box only in a corner or along an edge, where its triangle is",
        extremes: &["X51", "X52"],
        make: corners_of_boxes,
    },
    Recipe {
        name: "overlapping boxes",
        summary: "long aslant triangles whose boxes all overlap; equal keys, any order",
        extremes: &["X53", "X54"],
        make: overlapping,
    },
    Recipe {
        name: "shadows",
        summary: "from surface to surface: the receiver, and the light's own triangle, at both ends",
        extremes: &["X49", "X50"],
        make: shadows,
    },
];

fn equal_centres(size: Size, random: &mut Random) -> Draft {
    let mut corners = Vec::new();
    for i in 0..size.pick(200, 3000) {
        let r = if i % 2 == 0 { 1.0 } else { random.unit() };
        let (a, b) = (random.pick(&[-r, r]), random.pick(&[-r, r]));
        // The box of each triangle is centred exactly at the origin.
        corners.extend([[-r, a, -b], [r, -a, b], [a, r, -r]]);
    }
    (corners, everywhere(size.rays(), random))
}

fn gaps(size: Size, random: &mut Random) -> Draft {
    let group = |random: &mut Random| {
        let mut group = cloud(size.pick(60, 3000), 0.2, random);
        for p in &mut group {
            p[0] = p[0].clamp(-1.0, 1.0);
        }
        group
    };
    // Three groups with gaps between them.
    let mut corners = placed(&group(random), 1.0, [-2.0, 0.0, 0.0]);
    corners.extend(placed(&group(random), 1.0, [2.0, 0.0, 0.0]));
    corners.extend(placed(&group(random), 1.0, [4.0, 0.0, 0.0]));
    let mut rays = Vec::new();
    for _ in 0..size.rays() {
        // Start on the borders of the gaps, one float from them, or inside.
        let x = random.pick(&[
            -1.0,
            1.0,
            0.0,
            3.0,
            nudged(1.0, 1),
            nudged(1.0, -1),
            nudged(3.0, -1),
        ]);
        let o = [x, random.pick(&[-2.0, 2.0, 0.0]), random.unit()];
        rays.push(ray(
            o,
            [
                random.pick(&[0.0, -0.0, 1e-9, -1e-9]),
                random.unit() - 0.5,
                0.2,
            ],
        ));
    }
    (corners, rays)
}

fn corners_of_boxes(size: Size, random: &mut Random) -> Draft {
    let mut corners = Vec::new();
    let mut rays = Vec::new();
    // Near slab on one axis and far slab on another, as bits: two error bounds in use are too small for these.
    for [o0, p0, d0, o1, p1, d1] in [
        [
            0xbf20_c71d_u32,
            0x3f03_b1fa,
            0x3f6f_8c50,
            0xbf61_1ed3,
            0x3e81_181c,
            0x3f6d_4011,
        ],
        [
            0x3ebf_d875,
            0x3f62_9db4,
            0x3f00_1309,
            0xbe95_ab1a,
            0x3e72_1b76,
            0x3f04_a608,
        ],
    ] {
        let [o0, p0, d0, o1, p1, d1] = [o0, p0, d0, o1, p1, d1].map(f32::from_bits);
        // A triangle in the box that begins at p0 and ends at p1, thin where the ray passes.
        corners.extend([[p0, p1, -1.0], [p0, p1, 1.0], [p0 + 0.5, p1 - 0.5, 0.0]]);
        rays.push(ray([o0, o1, 0.0], [d0, d1, 0.0]));
        rays.push(ray([o0, o1, -0.5], [d0, d1, 1e-3]));
    }
    for _ in 0..size.pick(150, 6000) {
        let p = random.point(-1.0, 1.0).map(|x| {
            if random.below(2) == 0 {
                x
            } else {
                (4.0 * x).round() / 4.0
            }
        });
        let s = [0.25, 0.125][random.below(2)];
        corners.extend([p, [p[0] + s, p[1] + s, p[2]], [p[0], p[1] + s, p[2] + s]]);
        let o = random.point(-2.0, 2.0);
        rays.extend(towards(o, [p, [p[0] + s, p[1] + s, p[2]]]));
        // Along the edges of the box.
        rays.push(ray([p[0] - 1.0, p[1], p[2]], [1.0, 0.0, 0.0]));
        rays.push(ray([p[0], p[1] + s, p[2] - 1.0], [0.0, -0.0, 1.0]));
    }
    (corners, rays)
}

fn overlapping(size: Size, random: &mut Random) -> Draft {
    let mut corners = Vec::new();
    let count = size.pick(100, 3000);
    let mut one = Vec::new();
    for _ in 0..count {
        // Each triangle extends from one corner of the scene to the opposite one.
        let a = random.point(-1.0, -0.9);
        let b = random.point(0.9, 1.0);
        one.push([a, b, [b[0], a[1], random.unit()]]);
    }
    // The same triangles in order and in reverse: every hit is a tie.
    for triangle in one.iter().chain(one.iter().rev()) {
        corners.extend(triangle);
    }
    (corners, everywhere(size.rays(), random))
}

fn shadows(size: Size, random: &mut Random) -> Draft {
    let corners = cloud(size.pick(250, 8000), 0.3, random);
    let on_surface = |random: &mut Random| -> [f32; 3] {
        let at = 3 * random.below(corners.len() / 3);
        let (s, t) = (random.unit(), 0.5 * random.unit());
        std::array::from_fn(|k| {
            let [a, b, c] = [corners[at][k], corners[at + 1][k], corners[at + 2][k]];
            a + 0.5 * s * (b - a) + t * (c - a)
        })
    };
    let mut rays = Vec::new();
    for _ in 0..size.rays() {
        let (o, target) = (on_surface(random), on_surface(random));
        let mut shadow = ray(o, std::array::from_fn(|k| target[k] - o[k]));
        // Vary both ends of the ray interval around the surfaces.
        shadow.t_min = random.pick(&[0.0, 1e-5, 2.0_f32.powi(-20)]);
        shadow.t_max = random.pick(&[1.0, nudged(1.0, -1), nudged(1.0, 1), 1.0 - 1e-5, 0.0]);
        rays.push(shadow);
    }
    (corners, rays)
}
