// SPDX-License-Identifier: GPL-3.0-or-later
//! Round hairs seen through the few flat sides of their tubes.
//!
//! The corners of a tube lie on the circle around a hair, and their normals are the directions from its axis. So the
//! interpolated normal, before it is normalized, is the position across the hair in units of the circle's radius. A ray
//! sees the tube between two edges of its polygon, and meets the hair at the place between them: the normal there is
//! that of a round hair of this breadth. Then hairs with three sides have the same distribution of normals as round
//! ones from any direction.

use crate::math::vector::Vec3;
use std::f32::consts::TAU;

/// Largest number of sides of a tube.
const MOST_SIDES: f32 = 256.0;

/// Factor on the circle's radius at which rays leave, so that rounding does not put them inside (chosen).
const OUTSIDE: f32 = 1.001;

/// A point of a round hair.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Round {
    /// Unit normal, towards the viewer.
    pub normal: Vec3,
    /// Vector from the point on the tube's side to the circle around all sides, where rays leave the hair.
    pub lift: Vec3,
}

/// Returns the point of the hair that a ray along `d` sees from outside at a point of a triangle with these `corners`,
/// their unit `normals` and these barycentric `weights`; `None` if the ray is along the hair, or the triangle's normals
/// are not those of a tube.
#[inline(never)]
pub fn round(corners: [Vec3; 3], normals: [Vec3; 3], weights: [f32; 3], d: Vec3) -> Option<Round> {
    // Two corners on one side of the polygon have the normals that are farthest apart; the third has one of theirs.
    let pairs = [(0, 1), (1, 2), (2, 0)];
    let apart = pairs.map(|(a, b)| (normals[a] - normals[b]).length2());
    let most = apart.into_iter().fold(0.0, f32::max);
    let widest = (0..3).find(|&k| apart[k] == most)?;
    let (a, b) = pairs[widest];
    let (first, second) = (normals[a], normals[b]);
    let axis = first.cross(second).normalized_or(Vec3::ZERO);
    let across = (d - axis * axis.dot(d)).normalized_or(Vec3::ZERO);
    let sides = (TAU / first.dot(second).clamp(-1.0, 1.0).acos()).round();
    if axis == Vec3::ZERO || across == Vec3::ZERO || !(3.0..=MOST_SIDES).contains(&sides) {
        return None;
    }
    // Find the edges of the polygon as seen along the ray: each is the corner nearest to that side.
    let side = axis.cross(across);
    let angle = first.dot(across).atan2(first.dot(side));
    let step = TAU / sides;
    let edge = |from: f32| (from - step * (from / step).round()).cos();
    let (right, left) = (edge(angle), edge(0.5 * TAU - angle));
    // Place the point between them on a half circle.
    let at = normals[0] * weights[0] + normals[1] * weights[1] + normals[2] * weights[2];
    let share = (2.0 * at.dot(side) - right + left) / (right + left);
    let share = share.clamp(-1.0, 1.0);
    let normal = side * share - across * (1.0 - share * share).sqrt();
    // The circle's radius is the distance of two corners relative to that of their normals.
    let radius = (pairs.iter().zip(apart))
        .filter(|&(_, squared)| squared > 0.5 * most)
        .map(|(&(a, b), squared)| {
            let chord = corners[a] - corners[b];
            ((chord - axis * axis.dot(chord)).length2() / squared).sqrt()
        })
        .fold(0.0, f32::max);
    Some(Round {
        normal: normal.normalized_or(-across),
        lift: (normal * OUTSIDE - at) * radius,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::Stream;
    use crate::math::vector::vec3;

    /// The triangles of a straight tube along z whose circle has this radius, with their normals.
    fn tube(sides: usize, turn: f32, radius: f32) -> Vec<[[Vec3; 3]; 2]> {
        let corner = |k: usize, z: f32| {
            let (sin, cos) = ((k % sides) as f32 * TAU / sides as f32 + turn).sin_cos();
            [vec3(radius * cos, radius * sin, z), vec3(cos, sin, 0.0)]
        };
        let triangle = |all: [[Vec3; 2]; 3]| [all.map(|c| c[0]), all.map(|c| c[1])];
        (0..sides)
            .flat_map(|k| {
                let [a, b] = [corner(k, 0.0), corner(k + 1, 0.0)];
                let [c, d] = [corner(k + 1, 1.0), corner(k, 1.0)];
                [triangle([a, b, c]), triangle([a, c, d])]
            })
            .collect()
    }

    #[test]
    fn tubes_of_any_number_of_sides_have_the_normals_of_round_hairs() {
        let mut random = Stream::new(5);
        for sides in [3, 4, 5, 8, 13] {
            let (mut seen, mut first, mut squared) = (0.0_f64, 0.0_f64, 0.0_f64);
            for _ in 0..4000 {
                let d = vec3(0.6, 0.0, 0.8);
                let turn = TAU * random.number();
                for [corners, normals] in tube(sides, turn, 0.5) {
                    let [u, v] = [random.number(), random.number()];
                    let (u, v) = if u + v > 1.0 {
                        (1.0 - u, 1.0 - v)
                    } else {
                        (u, v)
                    };
                    let flat = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
                    let breadth = f64::from(-flat.dot(d));
                    if breadth <= 0.0 {
                        continue;
                    }
                    let weights = [1.0 - u - v, u, v];
                    let found = round(corners, normals, weights, d).unwrap();
                    assert!(found.normal.dot(d) <= 1e-6 && found.normal.z.abs() < 1e-5);
                    // Rays begin on the circle.
                    let point =
                        corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2];
                    let begin = point + found.lift;
                    assert!(
                        (begin.x.hypot(begin.y) - 0.5 * OUTSIDE).abs() < 1e-5,
                        "{begin:?}"
                    );
                    // Weigh by what the viewer sees of the side.
                    seen += breadth;
                    first += breadth * f64::from(-found.normal.x);
                    squared += breadth * f64::from(found.normal.y).powi(2);
                }
            }
            // A round hair has a mean cosine of π/4 in its cross-section, and places across it that are all alike.
            let (first, squared) = (first / seen, squared / seen);
            assert!(
                (first - std::f64::consts::FRAC_PI_4).abs() < 0.01,
                "{sides}: {first}"
            );
            assert!((squared - 1.0 / 3.0).abs() < 0.01, "{sides}: {squared}");
        }
    }

    #[test]
    fn rays_along_a_hair_see_no_round_normal() {
        let [corners, normals] = tube(5, 0.1, 1.0)[0];
        assert_eq!(round(corners, normals, [0.3; 3], vec3(0.0, 0.0, 1.0)), None);
        assert_eq!(
            round(corners, [normals[0]; 3], [0.3; 3], vec3(1.0, 0.0, 0.0)),
            None
        );
    }
}
