// SPDX-License-Identifier: GPL-3.0-or-later
//! What a tree of split planes answers when it is built: which directions at this node?

use crate::build::cell::{Cell, Direction, Plane};
use crate::build::piece::Piece;
use crate::geom::Aabb;

/// The one thing that tells plane trees apart.
pub trait PlanePolicy: Sync {
    /// Boxes if all planes are axis-aligned, convex polytopes otherwise.
    type Cell: Cell;
    /// What a node keeps of its triangles.
    type Piece: Piece;
    /// The cell of the whole scene.
    fn root(&self, bounds: Aabb) -> Self::Cell;
    /// The directions to sweep at a node, into the empty `out`. Of equally cheap planes the earlier
    /// direction's wins.
    fn directions(&self, node: &Node<'_, Self::Piece>, out: &mut Vec<Direction>);
    /// Single planes to try beside the sweeps, into the empty `out`.
    fn planes(&self, _: &Node<'_, Self::Piece>, _: &mut Vec<Plane>) {}
    /// Directions to sweep in addition, added to `out`, asked only where the cheapest plane of [`Self::directions`] costs
    /// more than [`super::Params::enough`].
    fn further(&self, _: &Node<'_, Self::Piece>, _: &mut Vec<Direction>) {}
    /// Directions, into the empty `out`, for a node that would otherwise become a leaf.
    fn more(&self, _: &Node<'_, Self::Piece>, _: &mut Vec<Direction>) {}
    /// Directions, into the empty `out`, for a node that is too large for a leaf and that those of
    /// [`Self::directions`] do not part.
    fn last_resort(&self, _: &Node<'_, Self::Piece>, _: &mut Vec<Direction>) {}
}

/// What a policy is told about a node.
#[derive(Debug, Clone, Copy)]
pub struct Node<'a, P> {
    /// The node's triangles.
    pub pieces: &'a [P],
    /// The root has depth 0.
    pub depth: usize,
    /// A number that is the node's own, whatever is built before it: what its random choices
    /// depend on.
    pub key: u64,
}
