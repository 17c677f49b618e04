// SPDX-License-Identifier: GPL-3.0-or-later
//! Ray streams: thousands of unrelated rays traverse a tree together. Each node is visited once for all rays that
//! meet it, with a list of them, and distributes that list over its children (Tsakok 2009, Faster incoherent rays:
//! multi-BVH ray stream tracing; Barringer and Akenine-Möller 2014, Dynamic ray stream traversal, where each ray
//! keeps its own order).
//!
//! A single ray waits for its own arithmetic, and the processor cannot predict whether a node or a leaf comes
//! next. In a list, the steps of consecutive rays are independent, and the work is the same for all: all boxes
//! of the node against one ray after another, one plane against eight rays at once, or all triangles of the leaf.
//! The cost of the visit itself is shared, though most lists are short: with a few thousand rays, three in the
//! median.
//!
//! The rays of one octant of directions form a stream, because they visit the children of most nodes in one order.
//! The streams take turns, one visit each, so that prefetched data arrives while the others work.
//!
//! [`Steps`] is what trees of different nodes have to provide. Rays through boxes need no more than a list of their
//! indices ([`boxes`]); through planes each entry of a list has the ray's interval, too ([`intervals`]).

pub mod kernel;
pub mod order;

mod blockers;
mod boxes;
pub mod flight;
mod intervals;
mod lists;
mod prepare;
mod ray_state;
mod slab_boxes;
mod traversal;

use fearless_simd::Simd;
use halfspace_leaf::Leaf;
use halfspace_leaf::blocks::Blocks;
use halfspace_ray::query::Counters;
use halfspace_trace::batch::{Launch, USUAL};
use lists::{Entry, Stream};
use ray_state::{Line, RayState};
use std::ops::Deref;

/// A launch of rays that take turns.
pub struct Run<'a>(pub Launch<'a>);

impl<'a> Deref for Run<'a> {
    type Target = Launch<'a>;

    #[inline(always)]
    fn deref(&self) -> &Launch<'a> {
        &self.0
    }
}

/// Number of octants of directions.
pub const OCTANTS: usize = 8;

/// Number of rays of a list that are prefetched.
const AHEAD: usize = 4;

/// Largest number of rays that traverse the tree together. More rays give longer lists, but the rays' state
/// then exceeds the caches. Measured: 4096 take up to 5 % longer, 16,384 about as long.
pub const STREAM: usize = USUAL;

/// A tree that streams of rays traverse: the visits to its nodes.
pub trait Steps: Sync {
    /// A node or a leaf, as stack entries hold it.
    type Node: Copy;

    /// Working memory that visits share one after another.
    type Scratch<S: Simd>: Default;

    /// Whether each entry of a list has the ray's interval in the node.
    const INTERVALS: bool;

    /// Whether leaves may keep indices in place of corners.
    const INDICES: bool = Self::INTERVALS;

    /// The root.
    fn root(&self) -> Self::Node;

    /// The leaf of a node, `None` for an inner node.
    fn leaf(&self, node: &Self::Node) -> Option<Leaf>;

    /// Prefetches what a visit reads.
    fn fetch_ahead(&self, node: &Self::Node, blocks: &Blocks);

    /// Whether a ray of a list without intervals enters the node before its best hit.
    #[inline(always)]
    fn enters(node: &Self::Node, line: &Line) -> bool {
        let _ = (node, line);
        true
    }

    /// Counts the visit to an inner node.
    fn count<C: Counters>(&self, node: &Self::Node, counters: &mut C);

    /// Visits an inner node, whose entry was the last of the stack: pushes the children that any of its rays
    /// meets, the nearest last.
    fn visit<S: Simd>(
        &self,
        simd: S,
        stream: &mut Stream<Self::Node>,
        own: Entry<Self::Node>,
        states: &[RayState],
        scratch: &mut Self::Scratch<S>,
    );

    /// Size of the nodes in bytes.
    fn bytes(&self) -> usize;
}
