// SPDX-License-Identifier: GPL-3.0-or-later
//! Trees that divide space, as a shaft sees them: boxes within boxes.

use super::shaft::Shaft;
use crate::build::octree_nodes::Octree;
use crate::build::plane_tree::{Node, PlaneTree};
use crate::geom::Aabb;
use fearless_simd::{Simd, SimdBase, f32x8};

/// A tree whose nodes lie in boxes.
pub trait ShaftTree: Sync {
    /// A node and its box.
    type Place: Copy;

    /// A beam may visit this many inner nodes and blocks of triangles per ray; then its rays go on singly.
    const STEPS_PER_RAY: u32;

    /// The root, in a scene of these bounds.
    fn top(&self, bounds: Aabb) -> Self::Place;

    /// For a leaf, where its triangles begin and how many they are. For an inner node, nothing; its children in
    /// whose boxes a segment of the shaft may be are appended to `waiting`.
    fn step<S: Simd>(
        &self,
        simd: S,
        place: Self::Place,
        shaft: &Shaft,
        waiting: &mut Vec<Self::Place>,
    ) -> Option<(u32, usize)>;
}

impl ShaftTree for Octree {
    /// The number of the node, and its lowest corner.
    type Place = (u32, [f32; 3]);

    /// Measured: half and twice as many save less on rooms and on leaves.
    const STEPS_PER_RAY: u32 = 2;

    fn top(&self, _: Aabb) -> Self::Place {
        (0, self.cube().corner)
    }

    #[inline(always)]
    fn step<S: Simd>(
        &self,
        simd: S,
        (index, low): Self::Place,
        shaft: &Shaft,
        waiting: &mut Vec<Self::Place>,
    ) -> Option<(u32, usize)> {
        let node = self.node(index);
        if !node.is_inner() {
            return Some(node.blocks());
        }
        let half = self.cube().edge(node.level() + 1);
        let lows = [
            octants(simd, low[0], half, 1),
            octants(simd, low[1], half, 2),
            octants(simd, low[2], half, 4),
        ];
        let edge = f32x8::splat(simd, half);
        let highs = [lows[0] + edge, lows[1] + edge, lows[2] + edge];
        let met = shaft.meets(simd, &lows, &highs) & !u64::from(node.empty_octants());
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
            waiting.push((node.children() + octant, child));
        }
        None
    }
}

/// A coordinate of the lower corners of eight octants.
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

impl ShaftTree for PlaneTree {
    /// The number of the node, and a box around its cell: oblique planes cut nothing off it.
    type Place = (u32, Aabb);

    /// Three planes divide as one octant's do.
    const STEPS_PER_RAY: u32 = 6;

    fn top(&self, bounds: Aabb) -> Self::Place {
        (self.root(), bounds)
    }

    /// Boxes were met when they were cut off their parents'; their lanes are a waste for two of them, but a
    /// plane parts them along one axis alone.
    #[inline(always)]
    fn step<S: Simd>(
        &self,
        simd: S,
        (index, cell): Self::Place,
        shaft: &Shaft,
        waiting: &mut Vec<Self::Place>,
    ) -> Option<(u32, usize)> {
        let (children, empty, parts) = match self.node(index) {
            Node::Leaf { first, count } => return Some((first, count)),
            Node::Axis {
                axis,
                split,
                children,
                empty,
                ..
            } => {
                let mut parts = [cell; 2];
                parts[0].max[axis] = split;
                parts[1].min[axis] = split;
                (children, empty, parts)
            }
            Node::Oblique {
                children, empty, ..
            } => (children, empty, [cell; 2]),
        };
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
        for (side, part) in (0..2_u32).zip(parts) {
            if met >> side & 1 == 1 {
                waiting.push((children + side, part));
            }
        }
        None
    }
}
