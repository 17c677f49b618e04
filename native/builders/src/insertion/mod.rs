// SPDX-License-Identifier: GPL-3.0-or-later
//! Box hierarchies built by insertion (Goldsmith and Salmon 1987): each object is inserted where it adds least to the
//! expected number of box tests of a ray.
//!
//! A ray that meets a node tests all its children, so a node costs its surface area multiplied by their number. An
//! object may become another child of a node, at the cost of that node's area, or the sibling of an object in a
//! new node, at twice the new node's area; each ancestor that grows costs the growth multiplied by its number of
//! children. The search follows the child that grows least or, as branch and bound, every child whose lower bound
//! is below the best cost so far.

use crate::object::Object;
use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_geom::Aabb;
use halfspace_nodes::dop_tree::{Child, Hierarchy};
use halfspace_nodes::plane_tree::MAX_DEPTH;
use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

/// Largest number of children of a node.
pub const WIDEST: usize = 8;

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
    /// Largest number of children of a node, 2 to [`WIDEST`].
    pub children: usize,
    /// Seed of the random order in which objects are inserted.
    pub seed: u64,
}

/// A node, with the boxes of its children as structure of arrays.
#[derive(Debug, Clone)]
struct Node {
    low: [[f32; WIDEST]; 3],
    high: [[f32; WIDEST]; 3],
    link: [u32; WIDEST],
    /// Number of objects in the subtree of each child.
    objects: [u32; WIDEST],
    len: usize,
}

/// A tree built by insertion; node 0 is the root.
#[derive(Debug)]
pub struct Grown {
    nodes: Vec<Node>,
    /// The next object in each object's chain, or [`END`].
    next: Vec<u32>,
}

impl Node {
    /// Node without children.
    const EMPTY: Self = Self {
        low: [[f32::INFINITY; WIDEST]; 3],
        high: [[f32::NEG_INFINITY; WIDEST]; 3],
        link: [0; WIDEST],
        objects: [0; WIDEST],
        len: 0,
    };

    /// Returns the box of a child.
    fn bounds(&self, lane: usize) -> Aabb {
        Aabb {
            min: [0, 1, 2].map(|k| self.low[k][lane]),
            max: [0, 1, 2].map(|k| self.high[k][lane]),
        }
    }

    /// Extends the box of a child by an object.
    fn grow(&mut self, lane: usize, object: &Aabb) {
        for k in 0..3 {
            self.low[k][lane] = self.low[k][lane].min(object.min[k]);
            self.high[k][lane] = self.high[k][lane].max(object.max[k]);
        }
        self.objects[lane] += 1;
    }

    /// Appends a child.
    fn push(&mut self, link: u32, bounds: &Aabb, objects: u32) {
        let lane = self.len;
        self.len += 1;
        self.grow(lane, bounds);
        self.link[lane] = link;
        self.objects[lane] = objects;
    }

    /// Returns half the surface areas of the children's boxes without and with the object; NaN for missing
    /// children.
    fn surfaces(&self, object: &Aabb) -> ([f32; WIDEST], [f32; WIDEST]) {
        let (mut old, mut new) = ([0.0; WIDEST], [0.0; WIDEST]);
        for lane in 0..WIDEST {
            // Area of the child's box.
            let side = |k: usize| self.high[k][lane] - self.low[k][lane];
            old[lane] = surface([side(0), side(1), side(2)]);
            // Area of the box with the object. Written with comparisons, which compile to single instructions.
            let side = |k: usize| {
                let (low, high) = (self.low[k][lane], self.high[k][lane]);
                let low = if object.min[k] < low {
                    object.min[k]
                } else {
                    low
                };
                let high = if object.max[k] > high {
                    object.max[k]
                } else {
                    high
                };
                high - low
            };
            new[lane] = surface([side(0), side(1), side(2)]);
        }
        (old, new)
    }
}

/// Returns half of a box's surface area, from its side lengths.
fn surface([x, y, z]: [f32; 3]) -> f32 {
    x * y + y * z + z * x
}

/// Returns half of a box's surface area; 0 for an empty box.
fn surface_of(bounds: &Aabb) -> f32 {
    if bounds.is_empty() {
        return 0.0;
    }
    surface([0, 1, 2].map(|k| bounds.max[k] - bounds.min[k]))
}

/// Position of a new object at a node.
#[derive(Debug, Clone, Copy)]
enum Position {
    /// As another child.
    Child,
    /// In a new node, together with the object in this lane.
    Pair(usize),
    /// In the chain of this lane.
    Chain(usize),
}

/// A node that the search has reached.
#[derive(Debug, Clone, Copy)]
struct Reached {
    node: usize,
    bounds: Aabb,
    depth: usize,
    /// Index of the parent's entry, and the lane of this node in it.
    from: (usize, usize),
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

/// Builds a tree over `objects` by insertion. Their numbers only determine the random order.
///
/// # Errors
/// [`halfspace_base::error::Error::Cancelled`] and [`halfspace_base::error::Error::Memory`] as the monitor returns
/// them.
pub fn grow(objects: &[Object], growth: &Growth, monitor: &Monitor) -> Result<Grown> {
    let mut order: Vec<_> = (0..objects.len()).collect();
    order.sort_by_cached_key(|&i| (shuffled(growth.seed, objects[i].id), i));
    // Insert the objects in random order: the result depends on the order.
    let mut tree = Grown {
        nodes: vec![Node::EMPTY],
        next: vec![END; objects.len()],
    };
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
        let made = tree.nodes.capacity() - room;
        monitor.take(made * size_of::<Node>())?;
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
#[expect(clippy::cast_precision_loss, reason = "at most eight children")]
fn as_f32(children: usize) -> f32 {
    children as f32
}

impl Hierarchy for Grown {
    fn children(&self, node: usize) -> impl Iterator<Item = (Child, usize)> + '_ {
        let node = &self.nodes[node];
        (0..node.len).map(|lane| {
            let link = node.link[lane];
            let index = (link & !OBJECT) as usize;
            let child = if link & OBJECT == 0 {
                Child::Node(index)
            } else {
                Child::Objects(index)
            };
            (child, node.objects[lane] as usize)
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
            Position::Child => self.nodes[node].push(link, bounds, 1),
            Position::Pair(lane) => {
                // Replace the child by a new node of the child and the object.
                let new = u32::try_from(self.nodes.len()).expect("fewer nodes than objects");
                let mut pair = Node::EMPTY;
                let parent = &mut self.nodes[node];
                pair.push(
                    parent.link[lane],
                    &parent.bounds(lane),
                    parent.objects[lane],
                );
                pair.push(link, bounds, 1);
                parent.link[lane] = new;
                parent.grow(lane, bounds);
                self.nodes.push(pair);
            }
            Position::Chain(lane) => {
                let parent = &mut self.nodes[node];
                // Put the object at the head of the chain.
                self.next[object] = parent.link[lane] & !OBJECT;
                parent.link[lane] = link;
                parent.grow(lane, bounds);
            }
        }
        // Extend the boxes of all ancestors.
        while at != 0 {
            let (parent, lane) = scratch.reached[at].from;
            self.nodes[scratch.reached[parent].node].grow(lane, bounds);
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
            from: (0, 0),
        });
        // Start at the root, which inherits no cost.
        queue.push(Reverse(QueueEntry(0.0, 0)));
        let mut best = (f32::INFINITY, 0, Position::Chain(0));
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
            let (index, node) = (node, &self.nodes[node]);
            let grown = surface_of(&bounds.union(object));
            let inherited = inherited + as_f32(node.len) * (grown - surface_of(&bounds));
            // Evaluate the object as another child of this node.
            if node.len < growth.children {
                let cost = inherited + grown;
                if cost < best.0 {
                    best = (cost, at, Position::Child);
                }
            }
            let (old, new) = node.surfaces(object);
            // Find the inner child that grows least; of equal ones that with the fewest objects.
            let mut least: Option<(f32, u32, usize)> = None;
            for lane in 0..node.len {
                if node.link[lane] & OBJECT != 0 {
                    let cost = inherited + 2.0 * new[lane];
                    if cost < best.0 {
                        // At the depth limit there is no level left for a new node.
                        let position = if depth + 2 <= MAX_DEPTH {
                            Position::Pair(lane)
                        } else {
                            Position::Chain(lane)
                        };
                        best = (cost, at, position);
                    }
                    continue;
                }
                // Descend into inner children: all of them, or the one that grows least.
                let growth_here = new[lane] - old[lane];
                if growth.search == Search::BranchAndBound {
                    queue.push(Reverse(QueueEntry(inherited, reached.len())));
                    reached.push(self.child(index, at, lane, depth));
                } else if least.is_none_or(|(g, n, _)| {
                    growth_here < g || (growth_here == g && node.objects[lane] < n)
                }) {
                    least = Some((growth_here, node.objects[lane], lane));
                }
            }
            if let Some((_, _, lane)) = least {
                queue.push(Reverse(QueueEntry(inherited, reached.len())));
                reached.push(self.child(index, at, lane, depth));
            }
        }
        best
    }

    /// Returns the search entry of a child; `at` is the entry of its parent `node` at `depth`.
    fn child(&self, node: usize, at: usize, lane: usize, depth: usize) -> Reached {
        Reached {
            node: self.nodes[node].link[lane] as usize,
            bounds: self.nodes[node].bounds(lane),
            depth: depth + 1,
            from: (at, lane),
        }
    }
}

#[cfg(test)]
mod tests;
