// SPDX-License-Identifier: GPL-3.0-or-later
//! Generated scenes and rays that are hard to get right, small enough for every test run: for the
//! contract tests, the benchmarks and whoever wants to see a structure fail.

use crate::scene::Triangles;
use crate::traverse::Ray;
use std::sync::Arc;

/// A small generator of well-spread numbers (splitmix64; Steele, Lea and Flood 2014).
pub struct Random(pub u64);

impl Random {
    /// The next 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / 16_777_216.0
    }

    /// A point of a cube.
    pub fn point(&mut self, low: f32, high: f32) -> [f32; 3] {
        std::array::from_fn(|_| low + (high - low) * self.unit())
    }

    /// A number below `n`.
    #[expect(clippy::cast_possible_truncation, reason = "less than n")]
    pub fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }
}

/// A named scene and its rays.
pub struct Case {
    /// What is hard about it.
    pub name: &'static str,
    /// Its triangles.
    pub scene: Arc<Triangles>,
    /// Rays that look for trouble.
    pub rays: Vec<Ray>,
}

/// A ray without limits.
pub fn ray(o: [f32; 3], d: [f32; 3]) -> Ray {
    Ray {
        o,
        d,
        t_min: 0.0,
        t_max: f32::INFINITY,
    }
}

/// Triangles of three corners each, none shared.
///
/// # Panics
/// When there are more than 2^29 of them.
pub fn soup(corners: Vec<[f32; 3]>) -> Arc<Triangles> {
    let count = u32::try_from(corners.len() / 3).unwrap();
    let indices = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    Arc::new(Triangles::new(corners, indices).unwrap())
}

/// The twelve triangles of a box.
pub fn box_triangles(min: [f32; 3], max: [f32; 3]) -> Vec<[f32; 3]> {
    let corner = |i: usize| -> [f32; 3] {
        std::array::from_fn(|k| if i >> k & 1 == 1 { max[k] } else { min[k] })
    };
    let mut out = Vec::new();
    for face in [
        [0, 1, 3, 2],
        [4, 6, 7, 5],
        [0, 4, 5, 1],
        [2, 3, 7, 6],
        [0, 2, 6, 4],
        [1, 5, 7, 3],
    ] {
        for [a, b, c] in [[0, 1, 2], [0, 2, 3]] {
            out.extend([face[a], face[b], face[c]].map(corner));
        }
    }
    out
}

/// Boxes that touch, on an integer grid; turned by an angle, when one is given.
pub fn grid(n: usize, turn: f32) -> Vec<[f32; 3]> {
    let mut corners = Vec::new();
    for i in 0..n * n * n {
        let at = [i % n, i / n % n, i / n / n].map(|x| x as f32);
        corners.extend(box_triangles(at, at.map(|x| x + 1.0)));
    }
    let (sin, cos) = turn.sin_cos();
    if turn != 0.0 {
        for p in &mut corners {
            *p = [
                cos * p[0] - sin * p[1],
                sin * p[0] + cos * p[1],
                p[2] + 0.3 * p[0],
            ];
        }
    }
    corners
}

/// Rays aimed at corners and edge points of the scene's triangles, from its corners and from
/// elsewhere: the rays that rounding loses first.
pub fn aimed(scene: &Triangles, count: usize, random: &mut Random) -> Vec<Ray> {
    let bounds = scene.bounds();
    let live = scene.live();
    let mut rays = Vec::new();
    for i in 0..count {
        let v = scene.corners(live[random.below(live.len())]);
        let w = scene.corners(live[random.below(live.len())]);
        let s = [0.0, 0.5, 1.0, random.unit()][random.below(4)];
        let target: [f32; 3] = std::array::from_fn(|k| v[0][k] + s * (v[1][k] - v[0][k]));
        let origin: [f32; 3] = match i % 4 {
            0 => w[0],
            1 => std::array::from_fn(|k| 0.5 * (w[0][k] + w[1][k])),
            _ => std::array::from_fn(|k| {
                let size = bounds.max[k] - bounds.min[k];
                bounds.min[k] - size + 3.0 * size * random.unit()
            }),
        };
        rays.push(ray(origin, std::array::from_fn(|k| target[k] - origin[k])));
    }
    rays
}

/// Rays along axes and diagonals of a unit grid, in its walls, along its edges, through its corners,
/// with all signs of zero.
pub fn lattice_rays(n: usize, random: &mut Random, count: usize) -> Vec<Ray> {
    let mut rays = Vec::new();
    let steps = [0.0, -0.0, 1.0, -1.0, 0.5, 1e-20, -1e-38];
    for _ in 0..count {
        let place = |random: &mut Random| {
            let whole = random.below(2 * n + 5) as f32 / 2.0 - 1.0;
            if random.below(4) == 0 {
                whole + random.unit()
            } else {
                whole
            }
        };
        let o = [place(random), place(random), place(random)];
        let d = std::array::from_fn(|_| steps[random.below(steps.len())]);
        rays.push(ray(o, d));
    }
    rays
}

/// All cases.
pub fn cases() -> Vec<Case> {
    let mut random = Random(7);
    let mut cases = Vec::new();
    let mut add = |name, corners: Vec<[f32; 3]>, extra: Vec<Ray>, random: &mut Random| {
        let scene = soup(corners);
        let mut rays = extra;
        if !scene.live().is_empty() {
            rays.extend(aimed(&scene, 1500, random));
        }
        cases.push(Case { name, scene, rays });
    };

    let r = &mut random;
    let everywhere = |r: &mut Random, n: usize| -> Vec<Ray> {
        (0..n)
            .map(|_| ray(r.point(-2.0, 2.0), r.point(-1.0, 1.0)))
            .collect()
    };
    add("nothing", vec![], everywhere(r, 20), r);
    add(
        "one triangle",
        vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        everywhere(r, 200),
        r,
    );
    add(
        "degenerate only",
        vec![[0.0; 3], [1.0; 3], [2.0; 3]],
        everywhere(r, 20),
        r,
    );

    let mut random_soup = Vec::new();
    for _ in 0..600 {
        let centre = r.point(-1.0, 1.0);
        for _ in 0..3 {
            let offset = r.point(-0.15, 0.15);
            random_soup.push(std::array::from_fn(|k| centre[k] + offset[k]));
        }
    }
    add("random soup", random_soup.clone(), everywhere(r, 1500), r);
    for (name, scale) in [
        ("soup at 2^60", 2.0_f32.powi(60)),
        ("soup at 2^-100", 2.0_f32.powi(-100)),
    ] {
        let scaled = random_soup.iter().map(|p| p.map(|x| x * scale)).collect();
        add(name, scaled, vec![], r);
    }
    let moved = random_soup.iter().map(|p| p.map(|x| x + 1000.0)).collect();
    add("soup far from the origin", moved, vec![], r);

    add("touching boxes", grid(5, 0.0), lattice_rays(5, r, 4000), r);
    add("turned boxes", grid(4, 0.7), vec![], r);

    // All in one plane, the root cell without thickness.
    let flat = grid(3, 0.3)
        .into_iter()
        .map(|p| [p[0], p[1], 0.0])
        .collect();
    add("flat", flat, lattice_rays(3, r, 500), r);

    // Walls one float apart, and many on top of each other.
    let mut walls = Vec::new();
    let mut x = 1.0_f32;
    for i in 0..60 {
        walls.extend([[x, 0.0, 0.0], [x, 4.0, 0.0], [x, 0.0, 4.0]]);
        if i % 3 == 0 {
            x = f32::from_bits(x.to_bits() + 1);
        }
    }
    add("walls one float apart", walls, lattice_rays(3, r, 500), r);

    // Needles, from long and thin to subnormal.
    let mut needles = Vec::new();
    for i in 0..300 {
        let thin = 2.0_f32.powi(-(i % 150));
        let p = r.point(-1.0, 1.0);
        needles.extend([p, [p[0] + 1.0, p[1], p[2] + 0.1], [p[0], p[1] + thin, p[2]]]);
    }
    add("needles", needles, everywhere(r, 500), r);

    // A fan: all triangles share a corner.
    let mut fan = Vec::new();
    for i in 0..400 {
        let (a, b) = (i as f32 * 0.015_708, (i + 1) as f32 * 0.015_708);
        fan.extend([
            [0.0, 0.0, 0.5],
            [a.cos(), a.sin(), 0.0],
            [b.cos(), b.sin(), 0.0],
        ]);
    }
    let centre = (0..200).map(|_| {
        let o = r.point(-1.0, 2.0);
        ray(o, [-o[0], -o[1], 0.5 - o[2]])
    });
    let centre = centre.collect();
    add("fan", fan, centre, r);

    // One giant among the tiny.
    let mut giant = vec![
        [-2.0e12, -1.0e12, 0.0],
        [2.0e12, -1.0e12, 0.0],
        [0.0, 2.0e12, 1.0],
    ];
    giant.extend(random_soup.iter().take(300).map(|p| p.map(|x| x * 1e-3)));
    add("giant and tiny", giant, everywhere(r, 300), r);

    // Halving again and again towards one corner: the deepest tree there is.
    let mut chain = Vec::new();
    for i in 0..140 {
        let s = 2.0_f32.powi(-i);
        chain.extend([[s, 0.0, 0.0], [s, s, 0.0], [s, 0.0, s]]);
    }
    add("chain", chain, everywhere(r, 300), r);
    cases
}
