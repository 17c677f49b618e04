// SPDX-License-Identifier: GPL-3.0-or-later
//! Spatial subdivisions as nested boxes, for the traversal by shafts.

use crate::shaft::Shaft;
use fearless_simd::{Simd, SimdBase, f32x8};
use halfspace_geom::Aabb;
use halfspace_leaf::Leaf;
use halfspace_nodes::octree_nodes::Octree;
use halfspace_nodes::plane_tree::{Node, PlaneTree};

/// A tree whose nodes have bounding boxes.
pub trait ShaftTree: Sync {
    /// A node and its box.
    type Cell: Copy;

    /// Number of inner nodes and triangle blocks that a beam may visit per ray; beyond it, its rays are traced
    /// singly.
    const STEPS_PER_RAY: u32;

    /// The root, for a scene with these bounds.
    fn root_cell(&self, bounds: Aabb) -> Self::Cell;

    /// Visits a node. Returns a leaf; pushes those children of an inner node whose boxes the shaft meets.
    fn step<S: Simd>(
        &self,
        simd: S,
        cell: Self::Cell,
        shaft: &Shaft,
        stack: &mut Vec<Self::Cell>,
    ) -> Option<Leaf>;
}

/// A node of an octree.
#[derive(Clone, Copy)]
pub struct OctantCell {
    /// Number of the node.
    node: u32,
    /// Smallest corner of its cube.
    low: [f32; 3],
}

impl ShaftTree for Octree {
    type Cell = OctantCell;

    /// Measured on rooms and on leaves: half and twice this value both save less.
    const STEPS_PER_RAY: u32 = 2;

    fn root_cell(&self, _: Aabb) -> OctantCell {
        OctantCell {
            node: 0,
            low: self.cube().corner,
        }
    }

    #[inline(always)]
    fn step<S: Simd>(
        &self,
        simd: S,
        OctantCell { node: index, low }: OctantCell,
        shaft: &Shaft,
        stack: &mut Vec<Self::Cell>,
    ) -> Option<Leaf> {
        let node = self.node(index);
        if !node.is_inner() {
            return Some(node.blocks());
        }
        // Test the cubes of all eight octants at once.
        let half = self.cube().edge(node.level() + 1);
        let lows = [
            octants(simd, low[0], half, 1),
            octants(simd, low[1], half, 2),
            octants(simd, low[2], half, 4),
        ];
        let edge = f32x8::splat(simd, half);
        let highs = [lows[0] + edge, lows[1] + edge, lows[2] + edge];
        let met = shaft.meets(simd, &lows, &highs) & !u64::from(node.empty_octants());
        // Push the octants that the shaft meets.
        for octant in 0..8_u32 {
            if met >> octant & 1 == 0 {
                continue;
            }
            let mut child = low;
            for (k, x) in child.iter_mut().enumerate() {
                if octant >> k & 1 == 1 {
                    *x += half;
                }
            }
            stack.push(OctantCell {
                node: node.children() + octant,
                low: child,
            });
        }
        None
    }
}

/// One coordinate of the smallest corners of eight octants.
#[inline(always)]
fn octants<S: Simd>(simd: S, low: f32, half: f32, bit: usize) -> f32x8<S> {
    let mut lows = [low; 8];
    for (octant, x) in lows.iter_mut().enumerate() {
        if octant & bit != 0 {
            *x = low + half;
        }
    }
    f32x8::from_slice(simd, &lows)
}

/// A node of a tree of split planes.
#[derive(Clone, Copy)]
pub struct PlaneCell {
    /// Number of the node.
    node: u32,
    /// A box around its cell; oblique planes do not shrink the box.
    bounds: Aabb,
}

impl ShaftTree for PlaneTree {
    type Cell = PlaneCell;

    /// Derived: three times the value of octrees, since an octant corresponds to three planes.
    const STEPS_PER_RAY: u32 = 6;

    fn root_cell(&self, bounds: Aabb) -> PlaneCell {
        PlaneCell {
            node: self.root(),
            bounds,
        }
    }

    /// Tests the boxes of both children. They occupy eight lanes, of which two are needed; the box of the node
    /// itself was tested at its parent.
    #[inline(always)]
    fn step<S: Simd>(
        &self,
        simd: S,
        cell: PlaneCell,
        shaft: &Shaft,
        stack: &mut Vec<Self::Cell>,
    ) -> Option<Leaf> {
        let (children, empty, parts) = match self.node(cell.node) {
            Node::Leaf { first, count } => return Some(Leaf { first, count }),
            Node::Axis {
                axis,
                split,
                children,
                empty,
                ..
            } => {
                let mut parts = [cell.bounds; 2];
                parts[0].max[axis] = split;
                parts[1].min[axis] = split;
                (children, empty, parts)
            }
            Node::Oblique {
                children, empty, ..
            } => (children, empty, [cell.bounds; 2]),
        };
        // Repeat the two boxes over the lanes and test them.
        let row = |side: usize, k: usize, high: bool| {
            let part = &parts[side];
            if high { part.max[k] } else { part.min[k] }
        };
        let spread = |k: usize, high: bool| {
            let (below, above) = (row(0, k, high), row(1, k, high));
            let all = [below, above, below, above, below, above, below, above];
            f32x8::from_slice(simd, &all)
        };
        let lows = [spread(0, false), spread(1, false), spread(2, false)];
        let highs = [spread(0, true), spread(1, true), spread(2, true)];
        let met = shaft.meets(simd, &lows, &highs) & !u64::from(empty);
        for (side, bounds) in (0..2_u32).zip(parts) {
            if met >> side & 1 == 1 {
                let node = children + side;
                stack.push(PlaneCell { node, bounds });
            }
        }
        None
    }
}
