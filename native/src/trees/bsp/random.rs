// SPDX-License-Identifier: GPL-3.0-or-later
//! Random directions, and the generator that all random choices of a build come from.

use super::normals::oriented;
use super::{Source, add_distinct};
use crate::build::piece::Piece;
use crate::build::space::Node;
use rand::rngs::Xoshiro256PlusPlus;
use rand::{RngExt, SeedableRng};

/// The generator of a node: it depends on nothing but the seed and the node's place in the tree.
pub fn generator(seed: u64, key: u64) -> Xoshiro256PlusPlus {
    Xoshiro256PlusPlus::seed_from_u64(seed.rotate_left(32) ^ key)
}

/// A direction, all equally likely (Marsaglia 1972): no sine, so the same on every machine.
pub fn direction(random: &mut impl RngExt) -> [f32; 3] {
    loop {
        let [x, y]: [f64; 2] = std::array::from_fn(|_| random.random_range(-1.0..1.0));
        let s = x * x + y * y;
        if s < 1.0 {
            let c = 2.0 * (1.0 - s).sqrt();
            return oriented([x * c, y * c, 1.0 - 2.0 * s]);
        }
    }
}

/// Directions drawn afresh at every node.
pub struct Uniform {
    /// What random choices depend on.
    pub seed: u64,
}

impl Source for Uniform {
    fn directions<P: Piece>(&self, node: &Node<'_, P>, k: usize, out: &mut Vec<[f32; 3]>) {
        let mut random = generator(self.seed, node.key);
        while out.len() < k {
            add_distinct(out, direction(&mut random));
        }
    }
}
