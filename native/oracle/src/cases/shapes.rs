// SPDX-License-Identifier: GPL-3.0-or-later
//! Shapes for scenes, as lists of vertices, three per triangle.

use crate::cases::Random;
use halfspace_scene::Triangles;
use std::sync::Arc;

/// Makes a scene of triangles with three vertices each, none shared.
///
/// # Panics
/// If there are more than 2^29 triangles.
pub fn soup(corners: Vec<[f32; 3]>) -> Arc<Triangles> {
    let count = u32::try_from(corners.len() / 3).unwrap();
    let indices = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    Arc::new(Triangles::new(corners, indices).unwrap())
}

/// Returns the twelve triangles of a box.
pub fn box_triangles(min: [f32; 3], max: [f32; 3]) -> Vec<[f32; 3]> {
    let corner = |i: usize| -> [f32; 3] {
        std::array::from_fn(|k| if i >> k & 1 == 1 { max[k] } else { min[k] })
    };
    let mut out = Vec::new();
    // Each face is a quadrilateral of vertex indices, divided into two triangles.
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

/// Returns `n`^3 adjacent unit cubes from the origin on; rotated by the angle `turn` in radians and sheared, unless it
/// is zero.
pub fn grid(n: usize, turn: f32) -> Vec<[f32; 3]> {
    let mut corners = Vec::new();
    for i in 0..n * n * n {
        let at = [i % n, i / n % n, i / n / n].map(|x| x as f32);
        corners.extend(box_triangles(at, at.map(|x| x + 1.0)));
    }
    // Rotate about z, and shear z along x.
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

/// Returns `count` random triangles with centres in the cube from -1 to 1; their vertices differ from the centre by at
/// most `size` per axis.
pub fn cloud(count: usize, size: f32, random: &mut Random) -> Vec<[f32; 3]> {
    let mut corners = Vec::new();
    for _ in 0..count {
        let centre = random.point(-1.0, 1.0);
        for _ in 0..3 {
            let offset = random.point(-size, size);
            corners.push(std::array::from_fn(|k| centre[k] + offset[k]));
        }
    }
    corners
}

/// Returns a closed unit sphere of `20 * 4^levels` triangles: an icosahedron whose triangles are divided into four,
/// `levels` times. Shared vertices are equal bit for bit.
pub fn icosphere(levels: usize) -> Vec<[f32; 3]> {
    const G: f32 = 1.618_034;
    const POINTS: [[f32; 3]; 12] = [
        [-1.0, G, 0.0],
        [1.0, G, 0.0],
        [-1.0, -G, 0.0],
        [1.0, -G, 0.0],
        [0.0, -1.0, G],
        [0.0, 1.0, G],
        [0.0, -1.0, -G],
        [0.0, 1.0, -G],
        [G, 0.0, -1.0],
        [G, 0.0, 1.0],
        [-G, 0.0, -1.0],
        [-G, 0.0, 1.0],
    ];
    const FACES: [[usize; 3]; 20] = [
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    // Project the vertices to the unit sphere, and divide the triangles.
    let mut corners: Vec<_> = FACES
        .as_flattened()
        .iter()
        .map(|&i| unit(POINTS[i]))
        .collect();
    for _ in 0..levels {
        corners = divide(&corners);
    }
    corners
}

/// Divides each triangle into four, with the new vertices on the unit sphere.
fn divide(corners: &[[f32; 3]]) -> Vec<[f32; 3]> {
    // Neighbours compute the same midpoint, because a sum of two numbers does not depend on their order.
    let middle = |a: [f32; 3], b: [f32; 3]| unit(std::array::from_fn(|k| a[k] + b[k]));
    let mut out = Vec::with_capacity(4 * corners.len());
    for &[a, b, c] in corners.as_chunks().0 {
        let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
        out.extend([a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca]);
    }
    out
}

/// Normalizes a vector.
fn unit(p: [f32; 3]) -> [f32; 3] {
    let length = (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt();
    p.map(|x| x / length)
}

/// Returns a closed sphere with bumps.
pub fn bumpy_sphere(levels: usize) -> Vec<[f32; 3]> {
    let mut corners = icosphere(levels);
    for p in &mut corners {
        let r = 1.0 + 0.2 * (7.0 * p[0]).sin() * (5.0 * p[1] + 3.0 * p[2]).cos();
        *p = p.map(|x| r * x);
    }
    corners
}

/// Returns the shape with each vertex multiplied by `scale` plus `offset`, rounded as f32 arithmetic does.
pub fn placed(corners: &[[f32; 3]], scale: f32, offset: [f32; 3]) -> Vec<[f32; 3]> {
    let place = |p: &[f32; 3]| std::array::from_fn(|k| p[k] * scale + offset[k]);
    corners.iter().map(place).collect()
}

/// Returns the float `steps` places farther from zero than `x`, or nearer to it for negative `steps`.
pub fn nudged(x: f32, steps: i32) -> f32 {
    f32::from_bits(x.to_bits().wrapping_add_signed(steps))
}
