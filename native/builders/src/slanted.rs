// SPDX-License-Identifier: GPL-3.0-or-later
//! Partitions of objects between two parallel planes along any of thirteen directions, by the surface area
//! heuristic on the convex regions that the planes leave.
//!
//! A region is the part of the scene's box inside all planes on a node's path, so two planes along a diagonal cost
//! the same way as two along an axis: by the surface areas of the part below the one and the part above the other
//! ([`halfspace_geom::profile`]). Regions only determine costs: the planes themselves are heights of triangles, rounded
//! outwards.

use crate::object::{self, TASK};
use crate::slanted_split::{Best, Piece, Room};
use halfspace_base::error::Result;
use halfspace_base::{Monitor, footprint};
use halfspace_geom::cell::{Cell, ConvexCell, Plane};
use halfspace_nodes::cost::Costs;
use halfspace_nodes::plane_tree::MAX_DEPTH;
use halfspace_nodes::slanted_tree::{Item, ItemKind, SlantedTree, direction};
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;
use rayon::prelude::*;

/// Parameters of the partition of nodes.
pub struct Policy {
    /// Costs of the operations of a traversal.
    pub costs: Costs,
    /// Cost of a step through a node with oblique planes.
    pub oblique_step: f32,
    /// Largest number of triangles in a leaf, unless all centres coincide.
    pub leaf_max: usize,
    /// A node cuts off empty space if less than this share of its surface area is left.
    pub empty: f32,
    /// Number of directions that are tried, from the first on.
    pub directions: usize,
}

impl Policy {
    /// Returns the partition of a node's pieces; `None` for a leaf.
    fn choose(&self, pieces: &[Piece], cell: &ConvexCell, room: &mut Room) -> Option<Best> {
        let count = pieces.len();
        let best = self.best(pieces, cell, room);
        // Split if that is cheaper than a leaf, or if the leaf would be too large.
        let worth = best.is_some_and(|best| best.cost < self.costs.leaf(count as f32));
        if count < 2 || (!worth && count <= self.leaf_max) {
            None
        } else {
            best.or_else(|| Self::widest(pieces))
        }
    }
}

/// Returns the number of levels in which halving reaches single triangles.
fn levels(count: usize) -> usize {
    count.next_power_of_two().ilog2() as usize
}

/// Returns heights between which all pieces lie along a direction, rounded outwards.
fn around(pieces: &[Piece], k: usize) -> (f32, f32) {
    pieces
        .iter()
        .map(|piece| piece.bounds(k))
        .fold((f32::INFINITY, f32::NEG_INFINITY), |all, b| {
            (all.0.min(b.0), all.1.max(b.1))
        })
}

/// Builds a tree over the live triangles of `scene`, in the frame `frame`, in the current rayon pool.
///
/// # Errors
/// [`halfspace_base::error::Error::Cancelled`] and [`halfspace_base::error::Error::Memory`] as the monitor returns
/// them.
pub fn build(
    scene: &Triangles,
    frame: &Frame,
    policy: &Policy,
    monitor: &Monitor,
) -> Result<SlantedTree> {
    let piece = |&id: &u32| Piece {
        corners: scene.corners(id).map(|p| frame.point(p)),
        id,
    };
    let mut pieces: Vec<Piece> = scene.live().par_iter().map(piece).collect();
    let builder = Builder {
        policy,
        monitor,
        parallel: object::parallel_from(pieces.len()),
    };
    let bounds = frame.bounds();
    // The region of the root is the scene's box.
    let root = OpenNode {
        cell: ConvexCell::from_box(bounds, bounds.magnitude()),
        depth: 0,
        work: 1.0,
    };
    // Partition the pieces in index, then read off their numbers in the order of the leaves.
    let mut items = Vec::with_capacity(pieces.len() / 2 + 1);
    builder.grow(&mut pieces, root, &mut items, &mut Room::default())?;
    Ok(SlantedTree {
        items,
        ids: pieces.iter().map(|piece| piece.id).collect(),
    })
}

/// A node that is still to be built.
struct OpenNode {
    cell: ConvexCell,
    depth: usize,
    /// Share of the whole work.
    work: f64,
}

/// The inputs of a build.
struct Builder<'a> {
    policy: &'a Policy,
    monitor: &'a Monitor,
    /// Number of triangles from which nodes are built on two threads.
    parallel: usize,
}

impl Builder<'_> {
    /// Appends a subtree. The depth of the recursion is that of the tree.
    fn grow(
        &self,
        pieces: &mut [Piece],
        mut node: OpenNode,
        items: &mut Vec<Item>,
        room: &mut Room,
    ) -> Result<()> {
        self.monitor.check()?;
        let first = items.len();
        let levels = levels(pieces.len());
        // Cut off empty space before the partition.
        self.cut_off(pieces, &mut node, items, room);
        let count = pieces.len();
        let area = node.cell.area();
        let Some(best) = self.policy.choose(pieces, &node.cell, room) else {
            items.push(Item {
                kind: ItemKind::Leaf { count },
                area,
            });
            return self.done(count, items.len() - first, node.work);
        };
        // Partition by the best plane, or at the median near the depth limit.
        let k = best.direction;
        let mut split = object::partition_by(pieces, |piece: &Piece| piece.centre(k) <= best.at);
        if split == 0 || split == count || MAX_DEPTH - node.depth <= levels {
            split = median(pieces, k);
        }
        let (below, above) = pieces.split_at_mut(split);
        let planes = [around(below, k).1, around(above, k).0];
        // Reserve the node's item; the distance to the child above is known last.
        let index = items.len();
        items.push(Item {
            kind: ItemKind::Leaf { count: 0 },
            area,
        });
        // Cut the region of each child from that of the node.
        let cut = |offset| {
            node.cell.split(Plane {
                direction: direction(k),
                offset,
            })
        };
        let child = |cell: ConvexCell, part: usize| OpenNode {
            cell,
            depth: node.depth + 1,
            work: node.work * part as f64 / count as f64,
        };
        // Give each child its region and its share of the work.
        let children = (
            child(cut(planes[0]).0, split),
            child(cut(planes[1]).1, count - split),
        );
        // Build the children of a large node in parallel.
        let next = if count >= self.parallel {
            let mut own = Room::default();
            object::grow_both(
                items,
                true,
                |items| self.grow(below, children.0, items, room),
                |items| self.grow(above, children.1, items, &mut own),
            )?
        } else {
            self.grow(below, children.0, items, room)?;
            let next = items.len();
            self.grow(above, children.1, items, room)?;
            next
        };
        // Complete the reserved item.
        items[index].kind = ItemKind::Pair {
            direction: k,
            planes,
            above: next - index,
        };
        // The few nodes of large subtrees are not counted.
        if count >= TASK {
            return Ok(());
        }
        self.done(0, index + 1 - first, 0.0)
    }

    /// Appends nodes with one child while enough empty space surrounds the pieces.
    fn cut_off(
        &self,
        pieces: &[Piece],
        node: &mut OpenNode,
        items: &mut Vec<Item>,
        room: &mut Room,
    ) {
        let levels = levels(pieces.len());
        // Keep enough levels for halving down to single triangles.
        while node.depth + levels + 1 < MAX_DEPTH {
            let Some(k) = self.policy.cut(pieces, &node.cell, room) else {
                break;
            };
            let planes = around(pieces, k);
            items.push(Item {
                kind: ItemKind::Only {
                    direction: k,
                    planes: [planes.0, planes.1],
                },
                area: node.cell.area(),
            });
            let at = |offset| Plane {
                direction: direction(k),
                offset,
            };
            // The region shrinks to the part between both planes.
            node.cell = node.cell.split(at(planes.0)).1.split(at(planes.1)).0;
            node.depth += 1;
        }
    }

    /// Reports a leaf of `count` triangles, or the memory of an inner node's items.
    fn done(&self, count: usize, items: usize, work: f64) -> Result<()> {
        if count > 0 {
            self.monitor.advance(work);
        }
        self.monitor.take(footprint::boxes::<Item>(items))
    }
}

/// Moves the half with the smaller centres to the front, equal ones by number; returns its size.
fn median(pieces: &mut [Piece], k: usize) -> usize {
    let half = pieces.len() / 2;
    pieces.select_nth_unstable_by(half, |a, b| {
        a.centre(k).total_cmp(&b.centre(k)).then(a.id.cmp(&b.id))
    });
    half
}
