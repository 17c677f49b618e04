// SPDX-License-Identifier: GPL-3.0-or-later
//! The policy of the build loop for trees along a source's directions.

use super::{AXES, Source, Triangulated, Variant, params, random};
use halfspace_builders::piece::Piece;
use halfspace_builders::space::{Node, PlanePolicy};
use halfspace_geom::Aabb;
use halfspace_geom::cell::{ConvexCell, Direction};
use std::marker::PhantomData;
use std::sync::Arc;

/// The policy of the build loop: the axes as the variant requires, then the source's directions.
pub struct Policy<P> {
    /// The source of directions.
    pub source: Arc<dyn Source>,
    /// Treatment of the axes.
    pub variant: Variant,
    /// K at large nodes.
    pub k: usize,
    /// K at small nodes.
    pub k_small: usize,
    /// Nodes above this depth try only the axes.
    pub axes_depth: usize,
    /// The type of pieces.
    pub pieces: PhantomData<P>,
}

/// The node without the type of its pieces.
fn triangulated<'a, P: Piece>(node: &'a Node<'_, P>) -> Triangulated<'a> {
    Triangulated {
        key: node.key,
        ids: &node.pieces,
        monitor: node.monitor,
    }
}

impl<P: Piece> Policy<P> {
    /// Appends the source's directions that are not in `known`.
    fn sources(&self, node: &Node<'_, P>, mut known: Vec<[f32; 3]>, out: &mut Vec<Direction>) {
        let first = known.len();
        // Small nodes try fewer directions.
        let k = if node.pieces.len() <= params::SMALL {
            self.k_small
        } else {
            self.k
        };
        self.source.directions(&triangulated(node), k, &mut known);
        self.emit(&known[first..], out);
    }

    /// Appends vectors as directions; the variant with cheap axis nodes marks the axes as such.
    fn emit(&self, vectors: &[[f32; 3]], out: &mut Vec<Direction>) {
        out.extend(vectors.iter().map(|&n| {
            match self.variant {
                Variant::PlusKd => AXES
                    .iter()
                    .position(|axis| *axis == n)
                    .map_or(Direction::Oblique(n), Direction::Axis),
                _ => Direction::Oblique(n),
            }
        }));
    }
}

impl<P: Piece> PlanePolicy for Policy<P> {
    type Cell = ConvexCell;
    type Piece = P;

    fn bytes(&self) -> usize {
        self.source.bytes()
    }

    fn root(&self, bounds: Aabb) -> ConvexCell {
        ConvexCell::from_box(bounds, bounds.magnitude())
    }

    fn directions(&self, node: &Node<'_, P>, out: &mut Vec<Direction>) {
        // Try the axes first; `further` adds the others if these are not enough.
        if self.variant != Variant::Plain || node.depth < self.axes_depth {
            self.emit(&AXES, out);
        } else {
            self.sources(node, Vec::with_capacity(self.k), out);
        }
    }

    fn further(&self, node: &Node<'_, P>, out: &mut Vec<Direction>) {
        if self.variant != Variant::Plain && node.depth >= self.axes_depth {
            self.sources(node, AXES.to_vec(), out);
        }
    }

    fn more(&self, node: &Node<'_, P>, out: &mut Vec<Direction>) {
        let mut vectors = Vec::new();
        self.source.more(&triangulated(node), &mut vectors);
        self.emit(&vectors, out);
    }

    fn last_resort(&self, node: &Node<'_, P>, out: &mut Vec<Direction>) {
        self.emit(&anything(node), out);
    }
}

/// Returns directions for a node that nothing else splits: the axes and 16 random ones.
pub fn anything<P>(node: &Node<'_, P>) -> Vec<[f32; 3]> {
    let mut random = random::generator(0, node.key);
    let mut vectors = AXES.to_vec();
    vectors.extend((0..16).map(|_| random::direction(&mut random)));
    vectors
}
