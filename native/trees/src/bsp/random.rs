// SPDX-License-Identifier: GPL-3.0-or-later
//! Random directions, and the random generator of all choices of a build.

use crate::bsp::normals::oriented;
use crate::bsp::{Source, Triangulated, Variant, add_distinct, build, params, sweep_rows};
use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_scene::Triangles;
use halfspace_structure::Built;
use halfspace_structure::row::StructureSpec;
use halfspace_structure::spec::Config;
use rand::rngs::Xoshiro256PlusPlus;
use rand::{RngExt, SeedableRng};

/// Returns the generator of a node, which depends only on the seed and the node's path from the root.
pub fn generator(seed: u64, key: u64) -> Xoshiro256PlusPlus {
    Xoshiro256PlusPlus::seed_from_u64(seed.rotate_left(32) ^ key)
}

/// Returns a uniformly distributed direction (Marsaglia 1972). The method needs no sine, so the result is the same
/// on every machine.
pub fn direction(random: &mut impl RngExt) -> [f32; 3] {
    loop {
        let [x, y]: [f64; 2] = std::array::from_fn(|_| random.random_range(-1.0..1.0));
        // Map a point of the unit disc to the sphere; reject points outside the disc.
        let s = x * x + y * y;
        if s < 1.0 {
            let c = 2.0 * (1.0 - s).sqrt();
            return oriented([x * c, y * c, 1.0 - 2.0 * s]);
        }
    }
}

/// Random directions, drawn independently at every node.
pub struct Uniform {
    /// Seed of the random choices.
    pub seed: u64,
}

impl Source for Uniform {
    fn directions(&self, node: &Triangulated<'_>, k: usize, out: &mut Vec<[f32; 3]>) {
        let mut random = generator(self.seed, node.key);
        while out.len() < k {
            add_distinct(out, direction(&mut random));
        }
    }
}

sweep_rows!("bsp-random", [10, 11, 12], "random", named "BSP_random", along "random directions, new at every node", k 10, grow,
    claims &["sweep-trees-*", "three-directions-are-kd", "long-builds"]);

fn grow(scene: &Triangles, config: &Config, monitor: &Monitor, variant: Variant) -> Result<Built> {
    build(scene, config, monitor, variant, |settings, _| {
        let seed = settings.seed;
        Uniform { seed }
    })
}
