// SPDX-License-Identifier: GPL-3.0-or-later
//! Directions of extreme length and with extremely small components.

use crate::cases::rays::{everywhere, ray};
use crate::cases::shapes::{cloud, grid};
use crate::cases::{Draft, Random, Recipe, Size};

/// The cases of this file.
pub const CASES: &[Recipe] = &[
    Recipe {
        name: "slow components",
        summary: "one component of the direction between 2^-149 and 2^-20",
        extremes: &["X08"],
        make: slow,
    },
    Recipe {
        name: "long and short directions",
        summary: "directions from subnormal to nearly overflowing",
        extremes: &["X09"],
        make: lengths,
    },
    Recipe {
        name: "turning signs",
        summary: "every ray with all eight combinations of signs of its direction",
        extremes: &["X07"],
        make: turning,
    },
];

/// Makes rays with one or two tiny components of the direction.
fn slow(size: Size, random: &mut Random) -> Draft {
    let mut corners = grid(3, 0.0);
    corners.extend(cloud(size.pick(100, 4000), 0.3, random));
    let mut rays = Vec::new();
    for _ in 0..2 * size.rays() {
        let mut d = random.point(-1.0, 1.0);
        // Make one or two components tiny.
        for _ in 0..1 + random.below(2) {
            let power = random.pick(&[-149, -140, -126, -100, -80, -60, -40, -24, -20]);
            d[random.below(3)] = random.pick(&[1.0, -1.0]) * 2.0_f32.powi(power);
        }
        // Start anywhere, on the lattice, or at a vertex.
        let o = match random.below(3) {
            0 => random.point(-1.0, 3.0),
            1 => random.point(0.0, 4.0).map(f32::floor),
            _ => random.pick(&corners),
        };
        rays.push(ray(o, d));
    }
    (corners, rays)
}

/// Makes rays whose directions have extreme lengths.
fn lengths(size: Size, random: &mut Random) -> Draft {
    let corners = cloud(size.pick(300, 8000), 0.2, random);
    let mut rays = everywhere(size.rays(), random);
    for ray in &mut rays {
        // Scale the direction, and sometimes end the interval at the tip of the original direction.
        let scale = 2.0_f32.powi(random.pick(&[-140, -126, -100, -60, -20, 20, 60, 100, 126]));
        ray.d = ray.d.map(|x| x * scale);
        if random.below(3) == 0 {
            ray.t_max = 1.0 / scale;
        }
    }
    (corners, rays)
}

/// Makes groups of eight rays whose directions differ in signs alone.
fn turning(size: Size, random: &mut Random) -> Draft {
    let corners = cloud(size.pick(200, 8000), 0.3, random);
    let mut rays = Vec::new();
    for base in everywhere(size.rays() / 8, random) {
        // Flip the signs of the direction in all eight ways.
        for signs in 0..8 {
            let d = std::array::from_fn(|k| {
                if signs >> k & 1 == 1 {
                    -base.d[k]
                } else {
                    base.d[k]
                }
            });
            rays.push(ray(base.o, d));
        }
    }
    (corners, rays)
}
