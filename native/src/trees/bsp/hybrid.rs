// SPDX-License-Identifier: GPL-3.0-or-later
//! Few normals first, many random directions only where they found nothing: the tree that Hoobergs 2019
//! names as future work.

use super::normals::Arbitrary;
use super::random::{direction, generator};
use super::{Source, add_distinct};
use crate::build::piece::Piece;
use crate::build::space::Node;

/// Random directions of a second attempt.
const MORE: usize = 16;

/// Normals, and random directions for nodes that would otherwise be leaves.
pub struct Hybrid(pub Arbitrary);

impl Source for Hybrid {
    fn directions<P: Piece>(&self, node: &Node<'_, P>, k: usize, out: &mut Vec<[f32; 3]>) {
        self.0.directions(node, k, out);
    }

    fn more<P: Piece>(&self, node: &Node<'_, P>, out: &mut Vec<[f32; 3]>) {
        // Other numbers than the first attempt's.
        let mut random = generator(!self.0.seed, node.key);
        for _ in 0..MORE {
            add_distinct(out, direction(&mut random));
        }
    }
}
