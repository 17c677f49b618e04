// SPDX-License-Identifier: GPL-3.0-or-later
//! Coordinates of extreme size, and of extremely different sizes.

use crate::cases::rays::{everywhere, ray};
use crate::cases::shapes::{cloud, placed};
use crate::cases::{Draft, Random, Recipe, Size};

pub const CASES: &[Recipe] = &[
    Recipe {
        name: "needles",
        summary: "slivers of height 1 to subnormal",
        extremes: &["X20"],
        make: needles,
    },
    Recipe {
        name: "giant and tiny",
        summary: "one triangle 2^41 large among small ones",
        extremes: &["X21", "X38"],
        make: giant,
    },
    Recipe {
        name: "huge among tiny",
        summary: "one triangle of size 1 among overlapping ones of 10^-8",
        extremes: &["X21", "X38"],
        make: huge,
    },
    Recipe {
        name: "soup at 2^60",
        summary: "products of three coordinates would overflow",
        extremes: &["X22"],
        make: |size, random| scaled(size, 60, random),
    },
    Recipe {
        name: "soup at 2^-120",
        summary: "products of coordinates would vanish",
        extremes: &["X22"],
        make: |size, random| scaled(size, -120, random),
    },
    Recipe {
        name: "mixed exponents",
        summary: "scenes of size 2^60, 1 and 2^-60 in one",
        extremes: &["X22"],
        make: |size, random| {
            let mut corners = Vec::new();
            for power in [60, 0, -60] {
                corners.extend(scaled(size, power, random).0);
            }
            let mut rays = everywhere(size.rays(), random);
            for ray in &mut rays {
                let scale = 2.0_f32.powi(random.pick(&[60, 0, -60]));
                ray.o = ray.o.map(|x| x * scale);
            }
            (corners, rays)
        },
    },
    Recipe {
        name: "far from the origin",
        summary: "unit features at 10^8, where floats are eight units apart",
        extremes: &["X24"],
        make: |size, random| {
            let mut corners = placed(&cloud(size.pick(200, 8000), 0.5, random), 40.0, [1e8; 3]);
            corners.extend(placed(
                &cloud(size.pick(200, 8000), 0.2, random),
                1.0,
                [1e3; 3],
            ));
            (corners, vec![])
        },
    },
    Recipe {
        name: "camera far away",
        summary: "rays from a million scene sizes away",
        extremes: &["X25"],
        make: far_camera,
    },
    Recipe {
        name: "sizes away",
        summary: "triangles seen from a tenth to 10^7 of their sizes away, where their weights need most digits",
        extremes: &["X24", "X25"],
        make: sizes_away,
    },
    Recipe {
        name: "chain",
        summary: "halving again and again towards one corner: the deepest tree there is",
        extremes: &["X56"],
        make: |size, random| {
            let mut corners = Vec::new();
            for i in 0..140 {
                let s = 2.0_f32.powi(-i);
                corners.extend([[s, 0.0, 0.0], [s, s, 0.0], [s, 0.0, s]]);
            }
            (corners, everywhere(size.rays(), random))
        },
    },
];

fn needles(size: Size, random: &mut Random) -> Draft {
    let mut corners = Vec::new();
    for i in 0..size.pick(300, 6000) {
        // Heights from 1 down to subnormal numbers.
        let thin = 2.0_f32.powi(-i32::try_from(i % 150).expect("small"));
        let p = random.point(-1.0, 1.0);
        corners.extend([p, [p[0] + 1.0, p[1], p[2] + 0.1], [p[0], p[1] + thin, p[2]]]);
        // Near zero, where coordinates represent the smallest heights.
        let x = random.unit();
        corners.extend([[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x, thin, 0.1 * thin]]);
    }
    (corners, everywhere(size.rays(), random))
}

fn giant(size: Size, random: &mut Random) -> Draft {
    let mut corners = vec![
        [-2.0e12, -1.0e12, 0.0],
        [2.0e12, -1.0e12, 0.0],
        [0.0, 2.0e12, 1.0],
    ];
    // Add two clouds of much smaller triangles.
    let tiny = cloud(size.pick(150, 8000), 0.1, random);
    corners.extend(placed(&tiny, 1e-3, [0.0; 3]));
    corners.extend(placed(&tiny, 2.0_f32.powi(-20), [0.5; 3]));
    (corners, everywhere(size.rays(), random))
}

fn huge(size: Size, random: &mut Random) -> Draft {
    let mut corners = vec![[-1.0, -1.0, -0.3], [1.0, -1.0, -0.31], [0.0, 1.0, -0.3]];
    corners.extend(placed(
        &cloud(size.pick(600, 20_000), 0.1, random),
        1e-7,
        [0.0; 3],
    ));
    // Look at the cloud from its own distance.
    let mut rays = everywhere(size.rays(), random);
    for ray in &mut rays {
        ray.o = ray.o.map(|x| x * 1e-7);
    }
    (corners, rays)
}

/// Makes a cloud scaled by a power of two.
fn scaled(size: Size, power: i32, random: &mut Random) -> Draft {
    let scale = 2.0_f32.powi(power);
    (
        placed(&cloud(size.pick(250, 8000), 0.15, random), scale, [0.0; 3]),
        vec![],
    )
}

fn sizes_away(size: Size, random: &mut Random) -> Draft {
    let (mut corners, mut rays) = (Vec::new(), Vec::new());
    // Put clusters of ever smaller triangles at places far from the origin in their units.
    let places: Vec<_> = (-1..8)
        .map(|power| (10.0_f32.powi(-power), random.point(-1.0, 1.0)))
        .collect();
    for (unit, at) in &places {
        corners.extend(placed(&cloud(size.pick(30, 800), 0.5, random), *unit, *at));
    }
    for i in 0..size.rays() {
        // Look at a cluster from as far in its units as another one lies, or from the origin's neighbourhood.
        let (unit, at) = random.pick(&places);
        let from = random.point(-1.0, 1.0);
        let away = if i % 2 == 0 {
            unit * random.pick(&places).0.recip()
        } else {
            1.0
        };
        let o: [f32; 3] =
            std::array::from_fn(|k| from[k] * away + if i % 2 == 0 { at[k] } else { 0.0 });
        let to = random.point(-unit, unit);
        rays.push(ray(o, std::array::from_fn(|k| at[k] + to[k] - o[k])));
    }
    (corners, rays)
}

fn far_camera(size: Size, random: &mut Random) -> Draft {
    let corners = cloud(size.pick(300, 8000), 0.2, random);
    let mut rays = Vec::new();
    for _ in 0..size.rays() {
        let direction = random.point(-1.0, 1.0);
        // Aim at a vertex from up to 10^30 away.
        let away = random.pick(&[1e3, 1e6, 1e12, 1e30]);
        let o = direction.map(|x| x * away);
        let target = random.pick(&corners);
        rays.push(ray(o, std::array::from_fn(|k| target[k] - o[k])));
    }
    (corners, rays)
}
