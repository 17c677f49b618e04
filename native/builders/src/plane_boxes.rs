// SPDX-License-Identifier: GPL-3.0-or-later
//! Box trees derived from plane trees: boxes around the objects that the planes separate.
//!
//! One box excludes the empty space of a cell for which planes need a chain of splits. Boxes also fill nodes of eight
//! children well, while three levels of planes leave most of eight slots empty. Boxes around the nodes of a plane tree
//! are known from hardware, where they replace the planes (Woop, Marmitt and Slusallek 2006, B-KD trees for hardware
//! accelerated ray tracing of dynamic scenes).
//!
//! The box tree has its own leaves: it splits objects further than the planes do, and a box need not contain all
//! objects of a cell ([`crate::plane_objects`]).

use crate::plane_objects;
use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_leaf::blocks::Blocks;
use halfspace_leaf::keep::Keep;
use halfspace_leaf::leaves::Leaves;
use halfspace_nodes::box_tree::BoxTree;
use halfspace_nodes::nested::Nested;
use halfspace_nodes::plane_tree::PlaneTree;
use halfspace_ray::FramedScene;

/// The box tree of a plane tree, and its leaves.
#[derive(Debug)]
pub struct PlaneBoxes {
    /// Nodes of eight boxes, see [`BoxTree::by_corners`].
    pub tree: BoxTree<8>,
    /// The triangles of the leaves.
    pub blocks: Blocks,
}

impl PlaneBoxes {
    /// Builds the box tree of a plane tree.
    ///
    /// # Errors
    /// [`halfspace_base::error::Error::Cancelled`] if the monitor is cancelled,
    /// [`halfspace_base::error::Error::Memory`] above its limit.
    pub fn new(planes: &PlaneTree, framed: FramedScene<'_>, monitor: &Monitor) -> Result<Self> {
        // Build a binary tree of boxes, then its layout with eight children per node, then the leaves.
        let binary = plane_objects::build(planes, framed, monitor)?;
        let mut leaves = Leaves::new(Keep::Corners);
        let tree = BoxTree::new(&binary, &mut leaves)?;
        monitor.take(tree.bytes() + leaves.bytes())?;
        monitor.check()?;
        let tree = tree.by_corners();
        monitor.check()?;
        let blocks = leaves.write(framed.scene, framed.frame, &binary.ids);
        monitor.advance(1.0 - plane_objects::SHARE);
        Ok(Self { tree, blocks })
    }

    /// Returns the size in bytes.
    pub fn bytes(&self) -> usize {
        self.tree.bytes() + self.blocks.bytes()
    }
}
