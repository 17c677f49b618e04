// SPDX-License-Identifier: GPL-3.0-or-later
//! Random scenes of three kinds of numbers, without a particular difficulty.

use crate::cases::rays::{everywhere, ray};
use crate::cases::shapes::cloud;
use crate::cases::{Draft, Random, Recipe, Size};

pub const CASES: &[Recipe] = &[
    Recipe {
        name: "random soup",
        summary: "triangles and rays anywhere in a cube",
        extremes: &["X60"],
        make: |size, random| {
            let corners = cloud(size.pick(500, 10_000), 0.15, random);
            (corners, everywhere(2 * size.rays(), random))
        },
    },
    Recipe {
        name: "random bits",
        summary: "coordinates and directions of any exponent",
        extremes: &["X60"],
        make: |size, random| numbers(size, Random::wild, random),
    },
    Recipe {
        name: "numbers of few bits",
        summary: "small whole numbers and eighths: every kind of coincidence",
        extremes: &["X60"],
        make: |size, random| {
            let few = |random: &mut Random| {
                let whole = random.below(17) as f32 - 8.0;
                random.pick(&[whole, whole / 8.0])
            };
            numbers(size, few, random)
        },
    },
];

/// Makes triangles and rays whose coordinates are drawn by `number`.
fn numbers(size: Size, number: fn(&mut Random) -> f32, random: &mut Random) -> Draft {
    let mut point = || [number(random), number(random), number(random)];
    let corners: Vec<_> = (0..3 * size.pick(200, 4000)).map(|_| point()).collect();
    let rays = (0..2 * size.rays()).map(|_| ray(point(), point()));
    (corners.clone(), rays.collect())
}
