// SPDX-License-Identifier: GPL-3.0-or-later
//! The record of a traversal by beams of polygons, for drawing them.

/// What becomes of a beam in a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BeamAction {
    /// It ends: none of its rays is open.
    Ended,
    /// Few rays are left, which go on singly.
    Singles,
    /// The whole beam goes on to one child or to one neighbour.
    HandedOn,
    /// The planes of the faces through which it leaves a leaf clip it; the parts go on to the neighbours behind them.
    Clipped,
    /// The planes in the middle of an inner node split it among the children.
    Split,
    /// It leaves the root; the node is the leaf that it comes from.
    Left,
}

/// A beam in a node.
#[derive(Debug, Clone, Copy)]
pub struct BeamStep {
    /// The step that the beam comes from; `None` for beams that begin.
    pub parent: Option<u32>,
    /// The node.
    pub node: u32,
    /// Its level; the root has level 0.
    pub level: u32,
    /// Its lowest and its highest corner.
    pub corners: [[f64; 3]; 2],
    /// The axis and the side, 0 lower or 1 upper, of the face through which the beam enters the node, or leaves the
    /// root; `None` for a beam that begins inside.
    pub face: Option<[usize; 2]>,
    /// End of its polygon in [`BeamPath::vertices`]; it begins where that of the step before ends.
    pub vertices_end: usize,
    /// End of its rays in [`BeamPath::rays`].
    pub rays_end: usize,
    /// Whether its rays were tested against the triangles of a leaf.
    pub tested: bool,
    /// What becomes of it.
    pub action: BeamAction,
}

/// The steps of the beams of a batch, in the order of the traversal.
#[derive(Debug, Clone, Default)]
pub struct BeamPath {
    /// The steps.
    pub steps: Vec<BeamStep>,
    /// The corners of their polygons, which lie in the faces that the beams cross; none for beams that begin inside.
    pub vertices: Vec<[f64; 3]>,
    /// The open rays of the steps, by their numbers in the batch.
    pub rays: Vec<u32>,
}
