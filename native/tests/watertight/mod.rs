// SPDX-License-Identifier: GPL-3.0-or-later
//! Surfaces without gaps, after the description of the watertightness tests of Vulkan's conformance suite: a square split
//! at random into triangles, and a closed fan. Every structure, in each way of sending rays, finds the hit of exact
//! arithmetic for each ray, also through shared edges and vertices, and misses none.

use super::far_scenes::specs;
use super::{build, on_all_cores, same};
use halfspace::oracle::cases::{Random, ray};
use halfspace::oracle::exact_closest;
use halfspace::ray::{Hit, Order, Ray, Tracer};
use halfspace::scene::Triangles;
use std::sync::Arc;

/// A place from which whole surfaces are seen.
const EYE: [f32; 3] = [0.3, -0.4, 5.0];

/// Number of rays of one kind: four tiles.
const RAYS: usize = 256;

/// A surface over a part of the plane z = 0, seen from above without overlap.
struct Surface {
    vertices: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
}

impl Surface {
    /// The square from -1 to 1, split again and again at a random point of a random triangle, and at the middle of the
    /// shared edge of two. Corners of few bits make rays through edges and vertices exact.
    fn split(random: &mut Random, splits: usize) -> Self {
        let mut vertices: Vec<[f32; 3]> = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
            .map(|[x, y]| [x, y, 0.0])
            .into();
        let mut triangles = vec![[0, 1, 2], [0, 2, 3]];
        for i in 0..splits {
            let at = random.below(triangles.len());
            let [a, b, c] = triangles[at];
            let new = u32::try_from(vertices.len()).unwrap();
            let corner = |i: u32| vertices[i as usize];
            if i % 3 == 0 {
                // Split at the middle of an edge, if it is exact, with the triangle beyond it.
                let middle = [0, 1, 2].map(|k: usize| 0.5 * (corner(a)[k] + corner(b)[k]));
                let beyond = triangles.iter().position(|t| has_edge(t, [b, a]));
                let exact = (0..3).all(|k| middle[k] - corner(a)[k] == corner(b)[k] - middle[k]);
                let Some(beyond) = beyond.filter(|_| exact) else {
                    continue;
                };
                let d = triangles[beyond]
                    .into_iter()
                    .find(|v| ![a, b].contains(v))
                    .unwrap();
                vertices.push(middle);
                triangles[at] = [a, new, c];
                triangles[beyond] = [b, new, d];
                triangles.extend([[new, b, c], [new, a, d]]);
                continue;
            }
            let weights = [0; 3].map(|_| 0.1 + random.unit());
            let sum: f32 = weights.iter().sum();
            let fine = if i % 2 == 0 { 256.0 } else { 1e6 };
            let inside: [f32; 3] = std::array::from_fn(|k| {
                let x: f32 = (0..3)
                    .map(|j| weights[j] / sum * corner([a, b, c][j])[k])
                    .sum();
                (x * fine).round() / fine
            });
            // Rounded, it must still be inside.
            let parts = [[a, b, new], [b, c, new], [c, a, new]];
            vertices.push(inside);
            if parts
                .iter()
                .any(|part| turn(part.map(|v| vertices[v as usize])) <= 0.0)
            {
                vertices.pop();
                continue;
            }
            triangles[at] = parts[0];
            triangles.extend(&parts[1..]);
        }
        Self {
            vertices,
            triangles,
        }
    }

    /// A closed fan around a vertex.
    fn fan(blades: u16) -> Self {
        let mut vertices = vec![[0.125, -0.25, 0.0]];
        for i in 0..blades {
            let (y, x) = (std::f32::consts::TAU * f32::from(i) / f32::from(blades)).sin_cos();
            vertices.push([x, y, 0.0]);
        }
        let blades = u32::from(blades);
        let triangles = (0..blades)
            .map(|i| [0, 1 + i, 1 + (i + 1) % blades])
            .collect();
        Self {
            vertices,
            triangles,
        }
    }

    /// Rays that all hit the surface: from above and from one place, at points inside, and exactly or nearly at vertices,
    /// at edges and at the same one again, in whole tiles.
    fn rays(&self, random: &mut Random) -> Vec<Ray> {
        let mut targets = Vec::new();
        for i in 0..RAYS {
            let corners = random
                .pick(&self.triangles)
                .map(|v| self.vertices[v as usize]);
            let mut weights = [0; 3].map(|_| random.unit());
            match i % 4 {
                0 => weights = [1.0, 0.0, 0.0],
                1 => weights = [0.5, 0.5, 0.0],
                2 => weights[2] = 0.0,
                _ => {}
            }
            let sum: f32 = weights.iter().sum::<f32>().max(1e-6);
            let at: [f32; 3] =
                std::array::from_fn(|k| (0..3).map(|j| weights[j] / sum * corners[j][k]).sum());
            // Rounding must not move it over the border.
            targets.push(if inside(at) {
                at
            } else {
                self.vertices[0].map(|x| 0.5 * x)
            });
        }
        let above = targets
            .iter()
            .map(|p| ray([p[0], p[1], 2.0], [0.0, 0.0, -1.0]));
        let aimed = targets
            .iter()
            .map(|p| ray(EYE, std::array::from_fn(|k| p[k] - EYE[k])));
        above.chain(aimed).collect()
    }

    /// The surface, pushed up and down at random in the second form: rays from above then meet slopes.
    fn scenes(&self, random: &mut Random) -> [Arc<Triangles>; 2] {
        let mut rough = self.vertices.clone();
        for p in &mut rough {
            p[2] = random.unit();
        }
        [self.vertices.clone(), rough]
            .map(|vertices| Arc::new(Triangles::new(vertices, self.triangles.clone()).unwrap()))
    }
}

/// Whether a point is certainly inside the surfaces.
fn inside(p: [f32; 3]) -> bool {
    p[0].hypot(p[1]) < 0.9
}

/// Twice the area of a triangle in the plane, above 0 if it runs to the left; exact in f64 for these coordinates.
fn turn([a, b, c]: [[f32; 3]; 3]) -> f64 {
    let side = |p: [f32; 3], k: usize| f64::from(p[k]) - f64::from(a[k]);
    side(b, 0) * side(c, 1) - side(b, 1) * side(c, 0)
}

/// Whether a triangle has a directed edge.
fn has_edge([a, b, c]: &[u32; 3], edge: [u32; 2]) -> bool {
    [[*a, *b], [*b, *c], [*c, *a]].contains(&edge)
}

/// Sends the rays in each way through every structure, and compares with exact arithmetic; none may miss.
fn holds(name: &str, scene: &Arc<Triangles>, rays: &[Ray]) {
    let exact: Vec<_> = rays.iter().map(|ray| exact_closest(scene, ray)).collect();
    assert!(exact.iter().all(|answer| answer.hit.is_hit()), "{name}");
    let shared = exact.iter().filter(|answer| answer.on_boundary).count();
    assert!(
        shared > rays.len() / 16,
        "{name}: {shared} rays through edges and vertices"
    );
    on_all_cores(specs(), |spec| {
        let structure = build(scene, &spec, 1);
        let check = |hits: &[Hit], way: &str| {
            for ((hit, exact), ray) in hits.iter().zip(&exact).zip(rays) {
                assert!(
                    same(hit, &exact.hit),
                    "{name}, {spec}, {way}: {ray:?} {hit:?} {exact:?}"
                );
            }
        };
        let mut hits = vec![Hit::MISS; rays.len()];
        structure.closest_ordered(rays, &mut hits, None, Order::Tiles);
        check(&hits, "tiles");
        structure.closest(rays, &mut hits, None);
        check(&hits, "batches");
        // Send some alone.
        for (hit, ray) in hits.iter_mut().zip(rays).step_by(5) {
            *hit = Hit::MISS;
            structure.closest(std::slice::from_ref(ray), std::slice::from_mut(hit), None);
        }
        check(&hits, "alone");
        let mut occluded = vec![false; rays.len()];
        structure.occluded(rays, &mut occluded, None);
        assert!(
            occluded.iter().all(|occluded| *occluded),
            "{name}, {spec}: any hits"
        );
    });
}

#[test]
fn a_square_split_at_random_lets_no_ray_through() {
    let mut random = Random(17);
    let square = Surface::split(&mut random, 120);
    assert!(square.triangles.len() > 150);
    let rays = square.rays(&mut random);
    let [flat, rough] = square.scenes(&mut random);
    holds("square", &flat, &rays);
    holds("rough square", &rough, &rays[..RAYS]);
}

#[test]
fn a_closed_fan_is_hit_once_by_each_ray() {
    let mut random = Random(19);
    for blades in [3, 7, 100] {
        let fan = Surface::fan(blades);
        // Of few blades the rim runs through the inside, so aim at what surrounds the middle.
        let mut rays = fan.rays(&mut random);
        let scene = &fan.scenes(&mut random)[0];
        rays.retain(|ray| exact_closest(scene, ray).hit.is_hit());
        assert!(rays.len() > RAYS, "{blades}: {}", rays.len());
        let whole = rays.len() / 64 * 64;
        holds(&format!("fan of {blades}"), scene, &rays[..whole]);
    }
}
