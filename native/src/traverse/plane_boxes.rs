// SPDX-License-Identifier: GPL-3.0-or-later
//! Trees of split planes as trees of boxes, around what the planes part.
//!
//! The empty space in a cell, which planes close off by a chain of cuts, a box leaves out at once, and eight boxes to a node
//! make good use of its places, where three levels of planes leave most of them empty. That a tree of planes gains from
//! boxes around its nodes is known from hardware (Woop, Marmitt and Slusallek 2006, B-KD trees for hardware accelerated
//! ray tracing of dynamic scenes), where they replace the planes.
//!
//! Boxes part on where planes end, and one need not hold all that a cell does ([`crate::build::plane_objects`]): so they
//! have leaves of their own.

use super::blocks::Blocks;
use super::box_tree::BoxTree;
use super::frame::Frame;
use super::keep::Keep;
use super::nested::Nested;
use crate::build::leaves::Leaves;
use crate::build::plane_tree::PlaneTree;
use crate::build::{Monitor, plane_objects};
use crate::error::Result;
use crate::scene::Triangles;

/// The boxes of a tree of planes, and their leaves.
#[derive(Debug)]
pub struct PlaneBoxes {
    /// Eight boxes to a node, [`BoxTree::by_corners`].
    pub tree: BoxTree<8>,
    /// The triangles.
    pub blocks: Blocks,
}

impl PlaneBoxes {
    /// Of a tree over `scene`.
    ///
    /// # Errors
    /// [`crate::error::Error::Cancelled`] and [`crate::error::Error::Memory`] when the monitor says so.
    pub fn new(
        planes: &PlaneTree,
        (scene, frame): (&Triangles, &Frame),
        monitor: &Monitor,
    ) -> Result<Self> {
        let binary = plane_objects::build(planes, (scene, frame), monitor)?;
        let mut leaves = Leaves::new(Keep::Corners);
        let tree = BoxTree::new(&binary, &mut leaves)?;
        monitor.take(tree.bytes() + leaves.bytes())?;
        monitor.check()?;
        let tree = tree.by_corners();
        monitor.check()?;
        let blocks = leaves.write(scene, frame, &binary.ids);
        monitor.advance(1.0 - plane_objects::SHARE);
        Ok(Self { tree, blocks })
    }

    /// Size in bytes.
    pub fn bytes(&self) -> usize {
        self.tree.bytes() + self.blocks.bytes()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::oracle::cases::{Random, soup};
    use crate::structure::{Layout, Structure};
    use crate::traverse::nested::Look;
    use std::collections::BTreeSet;

    #[test]
    fn each_leaf_stands_once_in_the_boxes_and_all_they_take_counts() {
        let mut random = Random(31);
        let corners: Vec<_> = (0..6000).map(|_| random.point(-1.0, 1.0)).collect();
        let structure = Structure::of(&soup(corners), "kd");
        let own = structure.built();
        let Layout::Plane(planes, _) = &own.layout else {
            panic!("a tree of planes")
        };
        let scene = (&**structure.scene(), &own.frame);
        let made = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            (pool.unwrap()).install(|| PlaneBoxes::new(planes, scene, &Monitor::new()).unwrap())
        };
        let (boxes, others) = (made(1), made(3));
        assert!(boxes.tree == others.tree && boxes.blocks == others.blocks);

        let (mut leaves, mut ids) = (BTreeSet::new(), BTreeSet::new());
        let mut open = vec![(boxes.tree.top(), crate::geom::Aabb::EMPTY)];
        while let Some((place, bounds)) = open.pop() {
            if let Look::Leaf { first, count } = boxes.tree.look(place, &bounds, &mut open) {
                assert!(leaves.insert(first), "twice");
                ids.extend(boxes.blocks.ids(first, count));
            }
        }
        assert!(ids.into_iter().eq(structure.scene().live().iter().copied()));

        let monitor = Monitor::new();
        PlaneBoxes::new(planes, scene, &monitor).unwrap();
        assert!((monitor.told() - 1.0).abs() < 1e-6);

        let limited = Monitor::new();
        limited.limit_memory(boxes.bytes() as u64);
        assert!(PlaneBoxes::new(planes, scene, &limited).is_err());
        limited.limit_memory(4 * boxes.bytes() as u64);
        assert!(PlaneBoxes::new(planes, scene, &limited).is_ok());
    }

    /// No answer would change without, only the time that rays take.
    #[test]
    fn all_rays_of_auto_go_through_boxes_whatever_the_planes_are() {
        let mut random = Random(13);
        let corners: Vec<_> = (0..900).map(|_| random.point(-1.0, 1.0)).collect();
        for id in ["kd", "rbsp", "bsp-random", "bsp-wn", "bsp-ize"] {
            let structure = Structure::of(&soup(corners.clone()), id);
            assert!(structure.shape().nodes_oblique > 0 || id == "kd", "{id}");
            let boxes = structure.boxes().expect(id);
            let (flown, _) = structure.flown().expect(id);
            assert!(std::ptr::eq(flown, &boxes.tree), "{id}");
            assert!(structure.walked().is_none(), "{id}");
        }
    }
}
