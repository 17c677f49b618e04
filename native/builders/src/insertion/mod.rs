// SPDX-License-Identifier: GPL-3.0-or-later
//! Box hierarchies built by insertion (Goldsmith and Salmon 1987): each object is inserted where it adds least to the
//! expected number of box tests of a ray.
//!
//! A ray that meets a node tests all its children, so a node costs its surface area multiplied by their number. An
//! object may become another child of a node, at the cost of that node's area, or the sibling of an object in a
//! new node, at twice the new node's area; each ancestor that grows costs the growth multiplied by its number of
//! children. The search follows the child that grows least or, as branch and bound, every child whose lower bound
//! is below the best cost so far.

mod block;

pub use block::WIDEST;

use crate::object::Object;
use block::{Block, surface_of};
use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_geom::Aabb;
use halfspace_nodes::dop_tree::{Child, Hierarchy};
use halfspace_nodes::plane_tree::MAX_DEPTH;
use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

/// Flag of a link to an object instead of a node.
const OBJECT: u32 = 1 << 31;

/// Marks the end of a chain of objects.
const END: u32 = u32::MAX;

/// Number of objects between two checks of the monitor.
const STRIDE: usize = 1024;

/// Search strategy for the position of an object.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Search {
    /// Descend into the child that grows least.
    Greedy,
    /// Descend into all children whose lower bound does not exclude them.
    BranchAndBound,
}

/// Parameters of the insertion.
#[derive(Debug, Clone, Copy)]
pub struct Growth {
    /// Search strategy.
    pub search: Search,
    /// Largest number of children of a node, from 2 on; [`usize::MAX`] for any number.
    pub children: usize,
    /// Order in which objects are inserted.
    pub order: Order,
}

/// Order in which objects are inserted. The tree depends on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// The order of the scene.
    Given,
    /// A random order with this seed.
    Shuffled(u64),
}

/// A tree built by insertion; node 0 is the root.
#[derive(Debug)]
pub struct Grown {
    /// Blocks of children. A node is named by its first block.
    blocks: Vec<Block>,
    /// Number of children of the node that begins at each block.
    counts: Vec<u32>,
    /// The next object in each object's chain, or [`END`].
    next: Vec<u32>,
}

/// A child's block and its lane there.
#[derive(Debug, Clone, Copy)]
struct Slot {
    block: usize,
    lane: usize,
}

/// Position of a new object at a node.
#[derive(Debug, Clone, Copy)]
enum Position {
    /// As another child.
    Child,
    /// In a new node, together with the object in this slot.
    Pair(Slot),
    /// In the chain of this slot.
    Chain(Slot),
}

/// A node that the search has reached.
#[derive(Debug, Clone, Copy)]
struct Reached {
    node: usize,
    bounds: Aabb,
    depth: usize,
    /// Index of the parent's entry, and the slot of this node in the parent.
    from: (usize, Slot),
}

/// An entry of the priority queue, ordered by cost, then the latest first. The latest lie deepest: for objects as
/// large as their nodes every position costs the same, and this order finds a free one below without visiting all
/// nodes above.
#[derive(Debug, Clone, Copy, PartialEq)]
struct QueueEntry(f32, usize);

impl Eq for QueueEntry {}

impl PartialOrd for QueueEntry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for QueueEntry {
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.total_cmp(&other.0).then(other.1.cmp(&self.1))
    }
}

/// Buffers of the search, reused between objects.
#[derive(Default)]
struct Scratch {
    reached: Vec<Reached>,
    queue: BinaryHeap<Reverse<QueueEntry>>,
}

/// Builds a tree over `objects` by insertion. Their numbers only determine a random order.
///
/// # Errors
/// [`halfspace_base::error::Error::Cancelled`] and [`halfspace_base::error::Error::Memory`] as the monitor returns
/// them.
pub fn grow(objects: &[Object], growth: &Growth, monitor: &Monitor) -> Result<Grown> {
    let mut order: Vec<_> = (0..objects.len()).collect();
    if let Order::Shuffled(seed) = growth.order {
        order.sort_by_cached_key(|&i| (shuffled(seed, objects[i].id), i));
    }
    // Insert the objects in this order: the result depends on it.
    let mut tree = Grown::new(objects.len());
    let mut bounds = Aabb::EMPTY;
    let mut scratch = Scratch::default();
    let mut room = 0;
    for part in order.chunks(STRIDE) {
        monitor.check()?;
        for &i in part {
            tree.insert(i, &objects[i].bounds, &bounds, growth, &mut scratch);
            bounds = bounds.union(&objects[i].bounds);
        }
        // Report the memory of the nodes that this part of the objects made.
        let made = tree.blocks.capacity() - room;
        monitor.take(made * size_of::<Block>())?;
        room += made;
        monitor.advance(part.len() as f64 / objects.len() as f64);
    }
    Ok(tree)
}

/// Returns a random key that depends on the seed and the object alone (Steele, Lea and Flood 2014).
fn shuffled(seed: u64, id: u32) -> u64 {
    let mut x = seed.wrapping_add((u64::from(id) + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ x >> 31
}

/// Returns a number of children as f32.
#[expect(clippy::cast_precision_loss, reason = "exact below 2^24 children")]
fn as_f32(children: u32) -> f32 {
    children as f32
}

impl Hierarchy for Grown {
    fn children(&self, node: usize) -> impl Iterator<Item = (Child, usize)> + '_ {
        self.slots(node).map(|Slot { block, lane }| {
            let block = &self.blocks[block];
            let link = block.link[lane];
            let index = (link & !OBJECT) as usize;
            let child = if link & OBJECT == 0 {
                Child::Node(index)
            } else {
                Child::Objects(index)
            };
            (child, block.objects[lane] as usize)
        })
    }

    /// Appends all objects at or below a child to `out`.
    fn objects(&self, child: Child, out: &mut Vec<usize>) {
        let mut open = vec![child];
        while let Some(child) = open.pop() {
            match child {
                Child::Node(node) => {
                    // Reverse the children, so that the stack visits them in order.
                    let before = open.len();
                    open.extend(self.children(node).map(|(child, _)| child));
                    open[before..].reverse();
                }
                Child::Objects(first) => {
                    out.push(first);
                    // Follow the chain.
                    let mut next = self.next[first];
                    while next != END {
                        out.push(next as usize);
                        next = self.next[next as usize];
                    }
                }
            }
        }
    }
}

impl Grown {
    /// A tree that has room for this number of objects.
    fn new(objects: usize) -> Self {
        Self {
            blocks: vec![Block::EMPTY],
            counts: vec![0],
            next: vec![END; objects],
        }
    }

    /// Returns the blocks of a node.
    fn blocks(&self, node: usize) -> impl Iterator<Item = usize> + '_ {
        std::iter::successors(Some(node), |&block| match self.blocks[block].next {
            0 => None,
            next => Some(next as usize),
        })
    }

    /// Returns the slots of a node's children.
    fn slots(&self, node: usize) -> impl Iterator<Item = Slot> + '_ {
        self.blocks(node)
            .flat_map(|block| (0..self.blocks[block].len).map(move |lane| Slot { block, lane }))
    }

    /// Appends an empty block; returns its index.
    fn extend(&mut self) -> usize {
        self.blocks.push(Block::EMPTY);
        self.counts.push(0);
        self.blocks.len() - 1
    }

    /// Appends a child to a node.
    fn push(&mut self, node: usize, link: u32, bounds: &Aabb, objects: u32) {
        let mut last = self.blocks(node).last().expect("a node has a block");
        if self.blocks[last].len == WIDEST {
            let next = self.extend();
            self.blocks[last].next = u32::try_from(next).expect("fewer blocks than objects");
            last = next;
        }
        self.blocks[last].push(link, bounds, objects);
        self.counts[node] += 1;
    }

    /// Inserts an object into a tree with the box `whole`.
    fn insert(
        &mut self,
        object: usize,
        bounds: &Aabb,
        whole: &Aabb,
        growth: &Growth,
        scratch: &mut Scratch,
    ) {
        let (_, mut at, position) = self.search(bounds, whole, growth, scratch);
        let link = OBJECT | u32::try_from(object).expect("checked by the layout");
        let node = scratch.reached[at].node;
        // Change the node that the search chose.
        match position {
            Position::Child => self.push(node, link, bounds, 1),
            Position::Pair(Slot { block, lane }) => {
                // Replace the child by a new node of the child and the object.
                let pair = self.extend();
                let own = &self.blocks[block];
                let (old, around, objects) = (own.link[lane], own.bounds(lane), own.objects[lane]);
                self.push(pair, old, &around, objects);
                self.push(pair, link, bounds, 1);
                let own = &mut self.blocks[block];
                own.link[lane] = u32::try_from(pair).expect("fewer blocks than objects");
                own.grow(lane, bounds);
            }
            Position::Chain(Slot { block, lane }) => {
                let own = &mut self.blocks[block];
                // Put the object at the head of the chain.
                self.next[object] = own.link[lane] & !OBJECT;
                own.link[lane] = link;
                own.grow(lane, bounds);
            }
        }
        // Extend the boxes of all ancestors.
        while at != 0 {
            let (parent, Slot { block, lane }) = scratch.reached[at].from;
            self.blocks[block].grow(lane, bounds);
            at = parent;
        }
    }

    /// Returns the cheapest position for an object that the search finds: its cost, the search entry of its node, and
    /// the position there.
    fn search(
        &self,
        object: &Aabb,
        whole: &Aabb,
        growth: &Growth,
        scratch: &mut Scratch,
    ) -> (f32, usize, Position) {
        let own = surface_of(object);
        let Scratch { reached, queue } = scratch;
        reached.clear();
        queue.clear();
        reached.push(Reached {
            node: 0,
            bounds: *whole,
            depth: 0,
            from: (0, Slot { block: 0, lane: 0 }),
        });
        // Start at the root, which inherits no cost.
        queue.push(Reverse(QueueEntry(0.0, 0)));
        let mut best = (f32::INFINITY, 0, Position::Child);
        // Visit nodes in ascending order of inherited cost.
        while let Some(Reverse(QueueEntry(inherited, at))) = queue.pop() {
            // Stop if no position below can be cheaper: each costs at least the object's own area.
            if inherited + own >= best.0 {
                break;
            }
            let Reached {
                node,
                bounds,
                depth,
                ..
            } = reached[at];
            // Add the growth of this node: a ray that meets it tests all its children.
            let count = self.counts[node];
            let grown = surface_of(&bounds.union(object));
            let inherited = inherited + as_f32(count) * (grown - surface_of(&bounds));
            // Evaluate the object as another child of this node.
            if (count as usize) < growth.children {
                let cost = inherited + grown;
                if cost < best.0 {
                    best = (cost, at, Position::Child);
                }
            }
            // Find the inner child that grows least; of equal ones that with the fewest objects.
            let mut least: Option<(f32, u32, Slot)> = None;
            for block in self.blocks(node) {
                let own = &self.blocks[block];
                let (old, new) = own.surfaces(object);
                for lane in 0..own.len {
                    let slot = Slot { block, lane };
                    if own.link[lane] & OBJECT != 0 {
                        let cost = inherited + 2.0 * new[lane];
                        if cost < best.0 {
                            // At the depth limit there is no level left for a new node.
                            let position = if depth + 2 <= MAX_DEPTH {
                                Position::Pair(slot)
                            } else {
                                Position::Chain(slot)
                            };
                            best = (cost, at, position);
                        }
                        continue;
                    }
                    // Descend into inner children: all of them, or the one that grows least.
                    let growth_here = new[lane] - old[lane];
                    if growth.search == Search::BranchAndBound {
                        queue.push(Reverse(QueueEntry(inherited, reached.len())));
                        reached.push(self.child(at, slot, depth));
                    } else if least.is_none_or(|(g, n, _)| {
                        growth_here < g || (growth_here == g && own.objects[lane] < n)
                    }) {
                        least = Some((growth_here, own.objects[lane], slot));
                    }
                }
            }
            if let Some((_, _, slot)) = least {
                queue.push(Reverse(QueueEntry(inherited, reached.len())));
                reached.push(self.child(at, slot, depth));
            }
        }
        best
    }

    /// Returns the search entry of a child; `at` is the entry of its parent at `depth`.
    fn child(&self, at: usize, slot: Slot, depth: usize) -> Reached {
        let block = &self.blocks[slot.block];
        Reached {
            node: block.link[slot.lane] as usize,
            bounds: block.bounds(slot.lane),
            depth: depth + 1,
            from: (at, slot),
        }
    }
}

#[cfg(test)]
mod tests;
