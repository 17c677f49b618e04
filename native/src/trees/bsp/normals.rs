// SPDX-License-Identifier: GPL-3.0-or-later
//! The triangles' normals as directions for planes.

use super::{Source, add_distinct};
use crate::build::piece::Piece;
use crate::build::space::Node;
use crate::geom::vec3::{cross, dot, sub, widen};
use crate::scene::Triangles;
use crate::traverse::frame::Frame;
use crate::trees::bsp::random::generator;
use rand::distr::Distribution;
use rand::distr::weighted::WeightedIndex;
use rand::seq::index;
use rayon::prelude::*;
use std::sync::Arc;

/// A normal this close to an axis is the axis.
const AXIS: f64 = 1.0 - 1e-12;

/// Unit normals of all triangles of a scene, turned into one half space (Hoobergs 2019, section 3.2), and
/// the triangles' areas.
#[derive(Debug)]
pub struct Normals {
    normals: Vec<[f32; 3]>,
    areas: Vec<f32>,
    parallel: bool,
}

impl Normals {
    /// The normals of a scene, in its frame.
    pub fn new(scene: &Triangles, frame: &Frame) -> Self {
        let count = u32::try_from(scene.len()).expect("bounded by the scene");
        let (normals, areas): (Vec<_>, Vec<_>) = (0..count)
            .into_par_iter()
            .map(|id| {
                let [a, b, c] = scene.corners(id).map(|p| widen(frame.point(p)));
                let n = cross(sub(b, a), sub(c, a));
                let length = dot(n, n).sqrt();
                if !length.is_normal() {
                    return ([0.0; 3], 0.0);
                }
                #[expect(clippy::cast_possible_truncation, reason = "planes have f32 normals")]
                let area = (0.5 * length) as f32;
                (oriented(n.map(|x| x / length)), area)
            })
            .unzip();
        let parallel = scene.live().iter().all(|&id| {
            let n = normals[id as usize];
            n.iter().filter(|x| **x != 0.0).count() <= 1
        });
        Self {
            normals,
            areas,
            parallel,
        }
    }

    /// Whether every triangle is parallel to two axes.
    pub fn all_parallel_to_axes(&self) -> bool {
        self.parallel
    }

    /// The normal of a triangle, unless it is too small to have one.
    pub fn get(&self, id: u32) -> Option<[f32; 3]> {
        let n = self.normals[id as usize];
        (n != [0.0; 3]).then_some(n)
    }

    /// The area of a triangle.
    pub fn area(&self, id: u32) -> f32 {
        self.areas[id as usize]
    }
}

/// A unit vector or its opposite, whichever lies in the half space of the first positive coordinate;
/// axes exactly.
pub fn oriented(n: [f64; 3]) -> [f32; 3] {
    if let Some(k) = (0..3).find(|&k| n[k].abs() > AXIS) {
        return std::array::from_fn(|i| f32::from(u8::from(i == k)));
    }
    let first = n.iter().find(|x| **x != 0.0).copied().unwrap_or(1.0);
    #[expect(clippy::cast_possible_truncation, reason = "planes have f32 normals")]
    let turned = n.map(|x| (x * first.signum()) as f32 + 0.0);
    turned
}

/// Normals of some triangles of the node, all equally likely, or each in proportion to its area.
pub struct Arbitrary {
    /// All normals.
    pub normals: Arc<Normals>,
    /// What random choices depend on.
    pub seed: u64,
    /// Whether large triangles are likelier.
    pub by_area: bool,
}

impl Source for Arbitrary {
    fn directions<P: Piece>(&self, node: &Node<'_, P>, k: usize, out: &mut Vec<[f32; 3]>) {
        let wanted = k.saturating_sub(out.len());
        // Neighbouring triangles share planes, and walls are parallel to axes that are tried anyway.
        let draws = 3 * wanted;
        let n = node.pieces.len();
        let add = |i: usize, out: &mut Vec<_>| {
            if let Some(normal) = self.normals.get(node.pieces[i].id()) {
                add_distinct(out, normal);
            }
        };
        if n <= draws {
            for i in 0..n {
                if out.len() < k {
                    add(i, out);
                }
            }
            return;
        }
        let mut random = generator(self.seed, node.key);
        if self.by_area {
            let areas = node.pieces.iter().map(|p| self.normals.area(p.id()));
            if let Ok(weights) = WeightedIndex::new(areas) {
                for _ in 0..draws {
                    if out.len() < k {
                        add(weights.sample(&mut random), out);
                    }
                }
                return;
            }
        }
        for i in index::sample(&mut random, n, draws) {
            if out.len() < k {
                add(i, out);
            }
        }
    }
}
