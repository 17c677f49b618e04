// SPDX-License-Identifier: GPL-3.0-or-later
//! The triangles' normals as directions of planes.

use crate::bsp::random::generator;
use crate::bsp::{Source, Triangulated, Variant, add_distinct, build, draws, params, sweep_rows};
use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_geom::vec3::{cross, dot, sub, widen};
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;
use halfspace_structure::Built;
use halfspace_structure::row::StructureSpec;
use halfspace_structure::spec::Config;
use rand::distr::Distribution;
use rand::distr::weighted::WeightedIndex;
use rand::seq::index;
use rayon::prelude::*;
use std::sync::Arc;

/// A normal whose component along an axis exceeds this is replaced by the axis.
const AXIS: f64 = 1.0 - 1e-12;

/// Unit normals of all triangles of a scene, oriented into one half space (Hoobergs 2019, section 3.2), and the
/// triangles' areas.
#[derive(Debug)]
pub struct Normals {
    normals: Vec<[f32; 3]>,
    areas: Vec<f32>,
    parallel: bool,
}

impl Normals {
    /// Computes the normals of a scene, in its frame.
    pub fn new(scene: &Triangles, frame: &Frame) -> Self {
        let count = u32::try_from(scene.len()).expect("bounded by the scene");
        // Compute normal and area of each triangle; both are zero if the normal cannot be normalized.
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
        // Oblique planes are useless if every normal is an axis.
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

    /// Returns whether every triangle is parallel to two axes.
    pub fn all_parallel_to_axes(&self) -> bool {
        self.parallel
    }

    /// Returns the normal of a triangle, or `None` if the triangle is too small to have one.
    pub fn get(&self, id: u32) -> Option<[f32; 3]> {
        let n = self.normals[id as usize];
        (n != [0.0; 3]).then_some(n)
    }

    /// Returns the size in bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.normals) + size_of_val(&*self.areas)
    }

    /// Returns the area of a triangle in the structure's frame; 0 without a normal.
    pub fn area(&self, id: u32) -> f32 {
        self.areas[id as usize]
    }
}

/// Returns a unit vector or its opposite, whichever has a positive first nonzero coordinate; vectors close to an
/// axis become exactly that axis.
pub fn oriented(n: [f64; 3]) -> [f32; 3] {
    if let Some(k) = (0..3).find(|&k| n[k].abs() > AXIS) {
        return std::array::from_fn(|i| f32::from(u8::from(i == k)));
    }
    // Make the first nonzero coordinate positive.
    let first = n.iter().find(|x| **x != 0.0).copied().unwrap_or(1.0);
    #[expect(clippy::cast_possible_truncation, reason = "planes have f32 normals")]
    let turned = n.map(|x| (x * first.signum()) as f32 + 0.0);
    turned
}

/// How triangles are drawn whose normals become directions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Draw {
    /// Uniformly, until the normals of K are distinct.
    Distinct,
    /// In proportion to their area.
    ByArea,
    /// K triangles uniformly, whatever their normals (Hoobergs 2019, section 3.4.1).
    Thesis,
}

impl Draw {
    /// Reads the draw of a row that has the parameter.
    pub fn of(config: &Config) -> Self {
        config.pick(
            "draw",
            [("distinct", Self::Distinct), ("thesis", Self::Thesis)],
        )
    }
}

/// Directions from the normals of random triangles of the node.
pub struct Arbitrary {
    /// Normals of all triangles.
    pub normals: Arc<Normals>,
    /// Seed of the random choices.
    pub seed: u64,
    /// How triangles are drawn.
    pub draw: Draw,
}

impl Source for Arbitrary {
    fn bytes(&self) -> usize {
        self.normals.bytes()
    }

    fn directions(&self, node: &Triangulated<'_>, k: usize, out: &mut Vec<[f32; 3]>) {
        let wanted = k.saturating_sub(out.len());
        if self.draw == Draw::Thesis {
            self.as_published(node, wanted, out);
            return;
        }
        // Draw three times as many normals, since neighbouring triangles share planes, and walls are parallel to
        // the axes.
        let draws = 3 * wanted;
        let n = node.ids.count();
        let add = |i: usize, out: &mut Vec<_>| {
            if let Some(normal) = self.normals.get(node.ids.get(i)) {
                add_distinct(out, normal);
            }
        };
        // Use all triangles of a small node, in order.
        if n <= draws {
            for i in 0..n {
                if out.len() < k {
                    add(i, out);
                }
            }
            return;
        }
        let mut random = generator(self.seed, node.key);
        // Draw with replacement, with the areas as weights.
        if self.draw == Draw::ByArea {
            let areas = (0..n).map(|i| self.normals.area(node.ids.get(i)));
            if let Ok(weights) = WeightedIndex::new(areas) {
                for _ in 0..draws {
                    if out.len() < k {
                        add(weights.sample(&mut random), out);
                    }
                }
                return;
            }
        }
        // Draw uniformly, without replacement; also if no triangle has an area.
        for i in index::sample(&mut random, n, draws) {
            if out.len() < k {
                add(i, out);
            }
        }
    }
}

impl Arbitrary {
    /// Appends the normals of `wanted` triangles, or of all if there are fewer. One that is in `out` gives no further
    /// planes and is left out.
    fn as_published(&self, node: &Triangulated<'_>, wanted: usize, out: &mut Vec<[f32; 3]>) {
        let mut random = generator(self.seed, node.key);
        let n = node.ids.count();
        for i in index::sample(&mut random, n, wanted.min(n)) {
            if let Some(normal) = self.normals.get(node.ids.get(i))
                && !out.contains(&normal)
            {
                out.push(normal);
            }
        }
    }
}

sweep_rows!(
    "bsp-wn", [13, 14, 15], "normals", named "BSP_wn", along "the normals of some triangles of each node", k 6, grow,
    claims &["sweep-trees-*", "three-directions-are-kd", "one-normal", "long-builds"],
    params: draws::normals_usual, draws::normals_plus, draws::normals_kd
);

/// The registry's row: triangles drawn in proportion to their area.
pub const AREA: StructureSpec = StructureSpec {
    id: "bsp-wn-area-plus-kd",
    code: 20,
    label: "BSP, area normals + Kd",
    summary: "Planes along the axes and the normals of some triangles of each node, large ones likelier.",
    paper: "Our own, after Hoobergs 2019",
    params: const { &params::kd(params::k(3, 6)) }.slice(),
    literature: &[("BSP_wn+^Kd, by area", "")],
    claims: &["three-directions-are-kd", "long-builds"],
    build: |scene, config, monitor| grow_by_area(scene, config, monitor, Variant::PlusKd),
    ..PLUS_KD
};

fn grow(scene: &Triangles, config: &Config, monitor: &Monitor, variant: Variant) -> Result<Built> {
    build(scene, config, monitor, variant, |settings, normals| {
        Arbitrary {
            normals,
            seed: settings.seed,
            draw: Draw::of(config),
        }
    })
}

fn grow_by_area(
    scene: &Triangles,
    config: &Config,
    monitor: &Monitor,
    variant: Variant,
) -> Result<Built> {
    build(scene, config, monitor, variant, |settings, normals| {
        Arbitrary {
            normals,
            seed: settings.seed,
            draw: Draw::ByArea,
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use halfspace_builders::piece::{Piece, Whole};

    /// Sixty triangles in planes of three directions, a third each.
    fn scene() -> Triangles {
        let corners = (0..60_u8).flat_map(|i| {
            let at = f32::from(i);
            let flat = [[at, 0.0, 0.0], [at, 1.0, 0.25], [at, 0.0, 1.0]];
            flat.map(|[x, y, z]| match i % 3 {
                0 => [x, y, z],
                1 => [x + y, y, z],
                _ => [x + z, y, z],
            })
        });
        let indices = (0..60).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        Triangles::new(corners.collect(), indices).unwrap()
    }

    #[test]
    fn the_thesis_draws_triangles_and_not_normals() {
        let scene = scene();
        let frame = Frame::new(scene.bounds());
        let normals = Arc::new(Normals::new(&scene, &frame));
        let piece = |&id: &u32| Whole::new(id, scene.corners(id));
        let pieces: Vec<_> = scene.live().iter().map(piece).collect();
        // Counts the directions of forty nodes by their number, for two triangles each.
        let drawn = |draw| {
            let source = Arbitrary {
                normals: normals.clone(),
                seed: 5,
                draw,
            };
            let mut nodes = [0; 4];
            for key in 0..40 {
                let mut out = Vec::new();
                let node = Triangulated {
                    key,
                    ids: &&pieces[..],
                    monitor: &Monitor::new(),
                };
                source.directions(&node, 2, &mut out);
                assert!(out.iter().all(|n| normals.normals.contains(n)));
                nodes[out.len()] += 1;
            }
            nodes
        };
        // Two triangles have equal normals in a third of the nodes.
        let [none, one, two, more] = drawn(Draw::Thesis);
        assert!(
            none == 0 && more == 0 && one >= 4 && two >= 16,
            "{one} {two}"
        );
        let [_, one, two, _] = drawn(Draw::Distinct);
        assert!(two > 36, "{one} {two}");
    }
}
