// SPDX-License-Identifier: GPL-3.0-or-later
//! Properties that make real scenes numerically stiff: sizes, distances and thicknesses that differ by orders of
//! magnitude.

use crate::cases::rays::{everywhere, from_inside, ray};
use crate::cases::shapes::{box_triangles, bumpy_sphere, icosphere, placed};
use crate::cases::{Draft, Random, Recipe, Size};

pub const CASES: &[Recipe] = &[
    Recipe {
        name: "teapot in a stadium",
        summary: "a fine object in a hall a million times its size",
        extremes: &["X21"],
        make: teapot,
    },
    Recipe {
        name: "city far from the origin",
        summary: "buildings in metres, kilometres from the origin, standing wall to wall",
        extremes: &["X24"],
        make: city,
    },
    Recipe {
        name: "needles of aspect 10^7",
        summary: "a thousand units long, a ten-thousandth wide, in all directions",
        extremes: &["X20"],
        make: long_needles,
    },
    Recipe {
        name: "fractal",
        summary: "triangles of sizes 10^3 to 10^-6 around one another",
        extremes: &["X21", "X56"],
        make: fractal,
    },
    Recipe {
        name: "fighting walls",
        summary: "overlapping walls in one oblique plane: every hit is a tie or a near tie",
        extremes: &["X14"],
        make: fighting,
    },
    Recipe {
        name: "hair-thin glass",
        summary: "closed panes a few floats thick",
        extremes: &["X20", "X23"],
        make: glass,
    },
    Recipe {
        name: "scaled instances",
        summary: "one shape scaled by 10^-4 and 10^4, turned and mirrored",
        extremes: &["X21"],
        make: instances,
    },
];

fn teapot(size: Size, random: &mut Random) -> Draft {
    let pot = placed(&bumpy_sphere(size.pick(2, 4)), 0.1, [3.0, 1.0, 0.1]);
    let mut corners = box_triangles([-1e5; 3], [1e5; 3]);
    corners.extend(&pot);
    let mut rays = from_inside(&pot, [3.0, 1.0, 0.1], 0.02, size.rays() / 2, random);
    for _ in 0..size.rays() {
        // From the seats of the stadium.
        let o = random.point(-1e5, 1e5);
        let target = random.pick(&pot);
        rays.push(ray(o, std::array::from_fn(|k| target[k] - o[k])));
    }
    (corners, rays)
}

fn city(size: Size, random: &mut Random) -> Draft {
    let at = [4213.7_f32, -7818.3, 12.0];
    let n = size.pick(6, 30);
    let mut corners = Vec::new();
    for i in 0..n * n {
        let (x, y) = (at[0] + 10.0 * (i % n) as f32, at[1] + 10.0 * (i / n) as f32);
        // Each building is a multiple of three metres high.
        let top = at[2] + 3.0 * (1 + random.below(12)) as f32;
        corners.extend(box_triangles([x, y, at[2]], [x + 10.0, y + 10.0, top]));
    }
    let mut rays = Vec::new();
    let width = 10.0 * n as f32;
    for _ in 0..size.rays() {
        // Rays from above and between the buildings, level or downwards.
        let [x, y, z] = random.point(0.0, 1.0);
        let o = [at[0] + width * x, at[1] + width * y, at[2] + 50.0 * z];
        let down = random.pick(&[0.0, -0.1, -1.0]);
        rays.push(ray(
            o,
            [random.unit() - 0.5, random.pick(&[0.0, 1.0]), down],
        ));
    }
    (corners, rays)
}

fn long_needles(size: Size, random: &mut Random) -> Draft {
    let mut corners = Vec::new();
    for _ in 0..size.pick(200, 8000) {
        let a = random.point(-500.0, 500.0);
        let d = random.point(-1000.0, 1000.0);
        let w = random.point(-1e-4, 1e-4);
        let b = std::array::from_fn(|k| a[k] + d[k]);
        corners.extend([a, b, std::array::from_fn(|k| a[k] + w[k])]);
    }
    let rays = everywhere(size.rays(), random);
    // Scale the origins of the rays to the scene.
    let wide = |r: &halfspace_ray::ray::Ray| ray(r.o.map(|x| 500.0 * x), r.d);
    (corners, rays.iter().map(wide).collect())
}

fn fractal(size: Size, random: &mut Random) -> Draft {
    let mut corners = Vec::new();
    let sphere = icosphere(size.pick(0, 2));
    let mut centre = [0.0_f32; 3];
    for power in (-6..=3).rev() {
        let scale = 10.0_f32.powi(power);
        corners.extend(placed(&sphere, scale, centre));
        // The next sphere lies next to the surface, inside.
        let to = random.pick(&sphere);
        centre = std::array::from_fn(|k| centre[k] + 0.9 * scale * to[k]);
    }
    let rays = from_inside(&corners, centre, 1e-6, size.rays(), random);
    (corners, rays)
}

fn fighting(size: Size, random: &mut Random) -> Draft {
    let mut corners = Vec::new();
    for _ in 0..size.pick(100, 2000) {
        let mut point = || {
            let (x, y) = (random.below(65) as f32 / 8.0, random.below(65) as f32 / 8.0);
            // The plane 2 x + 3 y - z = 1, without rounding; sometimes one float off.
            let z = 2.0 * x + 3.0 * y - 1.0;
            [x, y, if random.below(8) == 0 { z.next_up() } else { z }]
        };
        corners.extend([point(), point(), point()]);
    }
    let mut rays = Vec::new();
    for _ in 0..size.rays() {
        let o = random.point(-10.0, 40.0);
        // Aim at a random point of the common plane.
        let (x, y) = (8.0 * random.unit(), 8.0 * random.unit());
        let target = [x, y, 2.0 * x + 3.0 * y - 1.0];
        rays.push(ray(o, std::array::from_fn(|k| target[k] - o[k])));
    }
    (corners, rays)
}

fn glass(size: Size, random: &mut Random) -> Draft {
    let mut corners = Vec::new();
    for i in 0..size.pick(30, 800) {
        let axis = i % 3;
        let low = random.point(-1.0, 1.0);
        let mut high = low.map(|x| x + 0.5);
        // The pane is one to four floats thick.
        high[axis] = f32::from_bits(low[axis].to_bits() + 1 + u32::try_from(i % 4).expect("small"));
        let (mut min, mut max) = (low, high);
        (min[axis], max[axis]) = (low[axis].min(high[axis]), low[axis].max(high[axis]));
        corners.extend(box_triangles(min, max));
    }
    (corners, everywhere(size.rays(), random))
}

fn instances(size: Size, random: &mut Random) -> Draft {
    let shape = bumpy_sphere(size.pick(1, 3));
    let mut corners = Vec::new();
    for scale in [1e-4, 1e4, 1.0] {
        for (i, mirror) in [1.0, -1.0].into_iter().enumerate() {
            // Mirror, rotate and scale the shape.
            let (sin, cos) = (0.7 + i as f32).sin_cos();
            let turned = shape.iter().map(|p| {
                let [x, y, z] = [mirror * p[0], p[1], p[2]];
                [cos * x - sin * z, y, sin * x + cos * z].map(|x| scale * x)
            });
            let offset = random.point(-scale, scale);
            corners.extend(placed(&turned.collect::<Vec<_>>(), 1.0, offset));
        }
    }
    let mut rays = everywhere(size.rays(), random);
    // Scale the origins of the rays to one of the instances.
    for ray in &mut rays {
        let scale = random.pick(&[1e-4, 1.0, 1e4]);
        ray.o = ray.o.map(|x| x * scale);
    }
    (corners, rays)
}
