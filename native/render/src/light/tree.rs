// SPDX-License-Identifier: GPL-3.0-or-later
//! A binary tree over lights, which chooses one of a million in about twenty steps: at each node, each child is
//! taken with probability proportional to its estimated contribution.
//!
//! After Conty Estevez and Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree Splitting", with their
//! cones and cost, without splitting. The same tree finds the lights that a ray can hit.

use crate::light::Receiver;
use crate::light::division;
use crate::light::emission::Emission;
use crate::math::vector::{Vec3, vec3};

/// Bounding sphere of a light or of a node's lights, with their total intensity.
#[derive(Debug, Clone, Copy)]
pub struct BoundingSphere {
    /// Centre of the sphere.
    pub centre: Vec3,
    /// Radius of the sphere.
    pub radius: f32,
    /// Intensity: irradiance at distance 1.
    pub brightness: f32,
    /// Directions into which the lights shine.
    pub emission: Emission,
    /// The light; `u32::MAX` for inner nodes.
    pub light: u32,
}

impl BoundingSphere {
    /// Estimates the irradiance from the sphere: intensity over the squared distance of the centre (inside, over
    /// the squared radius), multiplied by the largest cosines of any point of the sphere, at the receiver and at the
    /// light. Zero only where no light can arrive.
    #[inline]
    pub fn importance(&self, receiver: Receiver) -> f32 {
        let to_centre = self.centre - receiver.point;
        let d2 = to_centre.length2();
        let r2 = self.radius * self.radius;
        if d2 <= r2 || d2 == 0.0 {
            return self.brightness / r2.max(1e-12);
        }
        let (distance, wide2) = (d2.sqrt(), r2 / d2);
        let wide = (1.0 - wide2).max(0.0).sqrt();
        let emitted = (self.emission).towards(to_centre * (-1.0 / distance), [wide2.sqrt(), wide]);
        let cosine = if receiver.normal == Vec3::ZERO {
            1.0
        } else {
            // The largest cosine is cos(angle to the centre - angular radius), or 1 within the radius.
            let c = receiver.normal.dot(to_centre) / distance;
            let s2 = (1.0 - c * c).max(0.0);
            if c >= wide {
                1.0
            } else {
                (c * wide + (s2 * wide2).sqrt()).max(0.0)
            }
        };
        self.brightness * emitted * cosine / d2
    }
}

/// A node; the first child follows its parent.
#[derive(Debug, Clone, Copy)]
struct Node {
    sphere: BoundingSphere,
    parent: u32,
    /// The second child; 0 = a leaf.
    second: u32,
}

/// A binary tree over lights.
#[derive(Debug, Clone, Default)]
pub struct LightTree {
    /// In depth-first order.
    nodes: Vec<Node>,
    /// The leaf of each light; `u32::MAX` if the light is not in the tree.
    leaves: Vec<u32>,
}

impl LightTree {
    /// Builds the tree over these lights. `count`: number of lights of the scene, bound of their indices.
    pub fn new(mut spheres: Vec<BoundingSphere>, count: usize) -> Self {
        let mut tree = Self {
            nodes: Vec::with_capacity(2 * spheres.len()),
            leaves: vec![u32::MAX; count],
        };
        if spheres.is_empty() {
            return tree;
        }
        // Ranges to be built with their depths, and the parent whose second child they become; `u32::MAX` for first
        // children.
        let mut pending = vec![(0..spheres.len(), 0, u32::MAX)];
        // Nodes are numbered in depth-first order, so a first child directly follows its parent.
        while let Some((range, depth, second_of)) = pending.pop() {
            // Append the node, and enter it as its parent's second child if it is one.
            let number = tree.nodes.len() as u32;
            let parent = if second_of == u32::MAX {
                number.wrapping_sub(1)
            } else {
                tree.nodes[second_of as usize].second = number;
                second_of
            };
            // Bound the lights of the node.
            let lights = &mut spheres[range.clone()];
            let sphere = bounding_sphere(lights);
            tree.nodes.push(Node {
                sphere,
                parent: if number == 0 { u32::MAX } else { parent },
                second: 0,
            });
            // A single light is a leaf.
            if lights.len() == 1 {
                tree.leaves[sphere.light as usize] = number;
                continue;
            }
            // Divide by cost, or halve where that is impossible, gains little, or the tree is deep.
            let by_cost = if depth < DEEP && lights.len() > FEW {
                division::by_cost(lights)
            } else {
                None
            };
            let middle = range.start + by_cost.unwrap_or_else(|| division::halve(lights));
            // Push the second part first, so that the first one directly follows its parent.
            pending.push((middle..range.end, depth + 1, number));
            pending.push((range.start..middle, depth + 1, u32::MAX));
        }
        tree
    }

    /// Estimates the irradiance from all lights together.
    pub fn importance(&self, receiver: Receiver) -> f32 {
        self.estimate(|sphere| sphere.importance(receiver))
    }

    /// Returns the importance of the sphere around all lights; 0 without lights.
    pub fn estimate(&self, importance: impl Fn(&BoundingSphere) -> f32) -> f32 {
        self.nodes
            .first()
            .map_or(0.0, |root| importance(&root.sphere))
    }

    /// Chooses a light. `choice`: random number in [0, 1). Returns the light and the probability of choosing it.
    pub fn choose(&self, receiver: Receiver, choice: f32) -> Option<(usize, f32)> {
        self.choose_by(|sphere| sphere.importance(receiver), choice)
    }

    /// Chooses a light like [`Self::choose`], by any estimate of what the lights in a sphere contribute.
    #[inline]
    pub fn choose_by(
        &self,
        importance: impl Fn(&BoundingSphere) -> f32,
        choice: f32,
    ) -> Option<(usize, f32)> {
        let mut number = 0;
        let mut left = choice;
        // Descend, rescaling the random number to the chosen child's share.
        let mut probability = 1.0;
        loop {
            let node = self.nodes.get(number)?;
            if node.second == 0 {
                return Some((node.sphere.light as usize, probability));
            }
            let share = self.share_of_first(number, &importance)?;
            if left < share {
                left /= share;
                probability *= share;
                number += 1;
            } else {
                left = (left - share) / (1.0 - share);
                probability *= 1.0 - share;
                number = node.second as usize;
            }
            left = left.min(ONE_MINUS);
        }
    }

    /// Returns the probability with which [`Self::choose`] chooses a light.
    pub fn probability(&self, receiver: Receiver, light: usize) -> f32 {
        let mut number = match self.leaves.get(light) {
            Some(&leaf) if leaf != u32::MAX => leaf,
            _ => return 0.0,
        };
        // Multiply the shares from the leaf up to the root.
        let mut probability = 1.0;
        loop {
            // Choosing this node needed the parent's share for its side.
            let parent = self.nodes[number as usize].parent;
            if parent == u32::MAX {
                return probability;
            }
            let importance = |sphere: &BoundingSphere| sphere.importance(receiver);
            let Some(share) = self.share_of_first(parent as usize, importance) else {
                return 0.0;
            };
            probability *= if number == parent + 1 {
                share
            } else {
                1.0 - share
            };
            number = parent;
        }
    }

    /// Returns the probability of a node's first child; `None` if neither child can contribute.
    #[inline]
    fn share_of_first(
        &self,
        number: usize,
        importance: impl Fn(&BoundingSphere) -> f32,
    ) -> Option<f32> {
        let second = self.nodes[number].second as usize;
        let a = importance(&self.nodes[number + 1].sphere);
        let b = importance(&self.nodes[second].sphere);
        let sum = a + b;
        (sum > 0.0 && sum.is_finite()).then(|| a / sum)
    }

    /// Calls `f` with every light whose bounding sphere the ray may touch. `direction` must have unit length.
    pub fn along(&self, origin: Vec3, direction: Vec3, mut f: impl FnMut(usize)) {
        // From the depth DEEP on halving by number adds at most 32 levels, so the stack cannot overflow.
        let mut stack = [0_u32; 64];
        let mut count = usize::from(!self.nodes.is_empty());
        while count > 0 {
            count -= 1;
            let number = stack[count];
            let node = &self.nodes[number as usize];
            // Find the point of the ray that is closest to the centre.
            let to_centre = node.sphere.centre - origin;
            let closest = to_centre - direction * to_centre.dot(direction).max(0.0);
            // Enlarge the radius by more than the rounding of the distance.
            let reach = node.sphere.radius * 1.0001 + to_centre.length() * 1e-5;
            if closest.length2() > reach * reach {
                continue;
            }
            if node.second == 0 {
                f(node.sphere.light as usize);
            } else {
                stack[count] = node.second;
                stack[count + 1] = number + 1;
                count += 2;
            }
        }
    }
}

/// Nodes of at most this number of lights are halved by number, since their costs would take most of the time of large
/// trees (chosen).
const FEW: usize = 4;

/// Depth from which on nodes are halved by number.
const DEEP: u32 = 30;

/// The largest f32 below 1.
const ONE_MINUS: f32 = 1.0 - f32::EPSILON / 2.0;

/// Returns a sphere around the bounding box of `spheres`, with the sum of their intensities, which shines wherever one of
/// them does.
fn bounding_sphere(spheres: &[BoundingSphere]) -> BoundingSphere {
    if let [one] = spheres {
        return *one;
    }
    let [low, high] = bounds(spheres, true);
    let brightness: f64 = spheres.iter().map(|b| f64::from(b.brightness)).sum();
    BoundingSphere {
        centre: (low + high) * 0.5,
        radius: (high - low).length() * 0.5,
        brightness: brightness as f32,
        emission: division::emission(spheres),
        light: u32::MAX,
    }
}

/// Returns the bounding box of the spheres, or of their centres if not `whole`.
pub(super) fn bounds(spheres: &[BoundingSphere], whole: bool) -> [Vec3; 2] {
    // Extend the box by each sphere.
    let mut out = [Vec3::splat(f32::INFINITY), Vec3::splat(f32::NEG_INFINITY)];
    for sphere in spheres {
        let r = Vec3::splat(if whole { sphere.radius } else { 0.0 });
        let (a, b) = (sphere.centre - r, sphere.centre + r);
        out[0] = vec3(out[0].x.min(a.x), out[0].y.min(a.y), out[0].z.min(a.z));
        out[1] = vec3(out[1].x.max(b.x), out[1].y.max(b.y), out[1].z.max(b.z));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spheres(n: u32) -> Vec<BoundingSphere> {
        (0..n)
            .map(|i| {
                let t = i as f32;
                BoundingSphere {
                    centre: vec3((t * 0.7).sin() * 9.0, (t * 1.3).cos() * 7.0, t * 0.01),
                    radius: 0.01 * (1.0 + (t * 2.1).sin()),
                    brightness: 1.0 + (t * 0.3).cos(),
                    emission: Emission::ALL,
                    light: i,
                }
            })
            .collect()
    }

    #[test]
    fn probabilities_sum_to_one_and_match_the_choices() {
        let tree = LightTree::new(spheres(300), 300);
        for normal in [Vec3::ZERO, vec3(0.0, 0.0, 1.0), vec3(1.0, 0.0, 0.0)] {
            let receiver = Receiver {
                point: vec3(0.5, -2.0, 1.0),
                normal,
                sets: u32::MAX,
                each: false,
                bounce: 0,
            };
            let all: f32 = (0..300).map(|i| tree.probability(receiver, i)).sum();
            // Below the horizon a node's bound can be positive although no child contributes; such choices are
            // lost.
            let lost = normal != Vec3::ZERO;
            assert!(all < 1.0 + 1e-4 && (lost || all > 1.0 - 1e-4), "{all}");
            for k in 0..1000 {
                let Some((light, p)) = tree.choose(receiver, k as f32 / 1000.0) else {
                    assert!(lost, "a light is there");
                    continue;
                };
                let q = tree.probability(receiver, light);
                assert!((p - q).abs() <= 1e-5 * p, "{p} {q}");
            }
        }
    }

    #[test]
    fn lights_above_the_horizon_have_a_positive_probability() {
        let lights = spheres(200);
        let tree = LightTree::new(lights.clone(), 200);
        let receiver = Receiver {
            point: vec3(0.0, 0.0, 0.5),
            normal: vec3(0.0, 0.6, 0.8),
            sets: u32::MAX,
            each: false,
            bounce: 0,
        };
        for light in &lights {
            let highest = light.centre + receiver.normal * light.radius;
            if (highest - receiver.point).dot(receiver.normal) > 1e-3 && light.brightness > 1e-3 {
                assert!(tree.probability(receiver, light.light as usize) > 0.0);
            }
        }
    }

    #[test]
    fn every_sphere_that_a_ray_touches_is_found() {
        let lights = spheres(500);
        let tree = LightTree::new(lights.clone(), 500);
        for k in 0..50 {
            let t = k as f32;
            let origin = vec3(t.sin(), t.cos(), -1.0);
            let target = lights[k * 7].centre + vec3(0.0, 0.0, lights[k * 7].radius * 0.9);
            let direction = (target - origin).normalized();
            let mut found = Vec::new();
            tree.along(origin, direction, |light| found.push(light));
            assert!(found.contains(&(k * 7)));
            assert!(found.len() < 250, "{}", found.len());
        }
        LightTree::default().along(Vec3::ZERO, vec3(1.0, 0.0, 0.0), |_| panic!("none there"));
    }
}
