// SPDX-License-Identifier: GPL-3.0-or-later
//! Partitions of objects between two parallel planes along any of thirteen directions, by the surface area
//! heuristic on the convex regions that the planes leave.
//!
//! A region is what the planes on a node's path have left of the scene's box, so two planes along a
//! diagonal are priced like two along an axis: by the surface of the part below the one and of the
//! part above the other ([`super::profile`]). Regions price planes and decide nothing else: the planes
//! themselves are heights of triangles, rounded outwards.

use super::cell::{Cell, ConvexCell, Plane};
use super::cost::Costs;
use super::object::{self, TASK};
use super::plane_tree::MAX_DEPTH;
use super::slanted_split::{Best, Piece, Room};
use super::slanted_tree::{Item, Kind, SlantedTree, direction};
use super::{Monitor, footprint};
use crate::error::Result;
use crate::scene::Triangles;
use crate::traverse::frame::Frame;
use rayon::prelude::*;

/// How nodes are parted.
pub struct Policy {
    /// Prices.
    pub costs: Costs,
    /// Price of a step through a node with oblique planes.
    pub oblique_step: f32,
    /// Leaves hold at most this many triangles, unless all centres coincide.
    pub leaf_max: usize,
    /// A node cuts off empty space where less than this share of the surface is left.
    pub empty: f32,
    /// The first so many directions are tried.
    pub directions: usize,
}

impl Policy {
    /// How the pieces of a node are parted; `None` where they are to stay together in a leaf.
    fn choose(&self, pieces: &[Piece], cell: &ConvexCell, room: &mut Room) -> Option<Best> {
        let count = pieces.len();
        let best = self.best(pieces, cell, room);
        let worth = best.is_some_and(|best| best.cost < self.costs.leaf(count as f32));
        if count < 2 || (!worth && count <= self.leaf_max) {
            None
        } else {
            best.or_else(|| Self::widest(pieces))
        }
    }
}

/// Halving reaches single triangles in so many levels.
fn levels(count: usize) -> usize {
    count.next_power_of_two().ilog2() as usize
}

/// Floats between which all pieces lie along a direction.
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
/// [`crate::error::Error::Cancelled`] and [`crate::error::Error::Memory`] when the monitor says so.
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
    let root = Node {
        cell: ConvexCell::from_box(bounds, bounds.magnitude()),
        depth: 0,
        work: 1.0,
    };
    let mut items = Vec::with_capacity(pieces.len() / 2 + 1);
    builder.grow(&mut pieces, root, (&mut items, &mut Room::default()))?;
    Ok(SlantedTree {
        items,
        ids: pieces.iter().map(|piece| piece.id).collect(),
    })
}

/// A node that is about to be parted.
struct Node {
    cell: ConvexCell,
    depth: usize,
    /// Its share of the whole work.
    work: f64,
}

struct Builder<'a> {
    policy: &'a Policy,
    monitor: &'a Monitor,
    /// Nodes of at least this many triangles are built on two threads.
    parallel: usize,
}

impl Builder<'_> {
    /// Appends a subtree. The depth of the recursion is that of the tree.
    fn grow(
        &self,
        pieces: &mut [Piece],
        mut node: Node,
        (items, room): (&mut Vec<Item>, &mut Room),
    ) -> Result<()> {
        self.monitor.check()?;
        let first = items.len();
        let levels = levels(pieces.len());
        self.cut_off(pieces, &mut node, (items, room));
        let count = pieces.len();
        let area = node.cell.area();
        let Some(best) = self.policy.choose(pieces, &node.cell, room) else {
            items.push(Item {
                kind: Kind::Leaf { count },
                area,
            });
            return self.done(count, items.len() - first, node.work);
        };
        let k = best.direction;
        let mut split = object::part_by(pieces, |piece: &Piece| piece.centre(k) <= best.at);
        if split == 0 || split == count || MAX_DEPTH - node.depth <= levels {
            split = median(pieces, k);
        }
        let (below, above) = pieces.split_at_mut(split);
        let planes = [around(below, k).1, around(above, k).0];
        let place = items.len();
        items.push(Item {
            kind: Kind::Leaf { count: 0 },
            area,
        });
        let cut = |offset| {
            node.cell.split(Plane {
                direction: direction(k),
                offset,
            })
        };
        let child = |cell: ConvexCell, part: usize| Node {
            cell,
            depth: node.depth + 1,
            work: node.work * part as f64 / count as f64,
        };
        let children = (
            child(cut(planes[0]).0, split),
            child(cut(planes[1]).1, count - split),
        );
        let next = if count >= self.parallel {
            let mut own = Room::default();
            object::grow_both(
                (items, true),
                |items| self.grow(below, children.0, (items, room)),
                |items| self.grow(above, children.1, (items, &mut own)),
            )?
        } else {
            self.grow(below, children.0, (items, room))?;
            let next = items.len();
            self.grow(above, children.1, (items, room))?;
            next
        };
        items[place].kind = Kind::Pair {
            direction: k,
            planes,
            above: next - place,
        };
        if count >= TASK {
            return Ok(());
        }
        self.done(0, place + 1 - first, 0.0)
    }

    /// Appends nodes with one child, while there is emptiness around the pieces that is worth cutting off.
    fn cut_off(
        &self,
        pieces: &[Piece],
        node: &mut Node,
        (items, room): (&mut Vec<Item>, &mut Room),
    ) {
        let levels = levels(pieces.len());
        while node.depth + levels + 1 < MAX_DEPTH {
            let Some(k) = self.policy.cut(pieces, &node.cell, room) else {
                break;
            };
            let planes = around(pieces, k);
            items.push(Item {
                kind: Kind::Only {
                    direction: k,
                    planes: [planes.0, planes.1],
                },
                area: node.cell.area(),
            });
            let at = |offset| Plane {
                direction: direction(k),
                offset,
            };
            node.cell = node.cell.split(at(planes.0)).1.split(at(planes.1)).0;
            node.depth += 1;
        }
    }

    /// Tells of a leaf, or of the items of an inner node.
    fn done(&self, count: usize, items: usize, work: f64) -> Result<()> {
        if count > 0 {
            self.monitor.advance(work);
        }
        self.monitor.take(footprint::boxes::<Item>(items))
    }
}

/// Moves the half with the smaller centres to the front, equal ones by number.
fn median(pieces: &mut [Piece], k: usize) -> usize {
    let half = pieces.len() / 2;
    pieces.select_nth_unstable_by(half, |a, b| {
        a.centre(k).total_cmp(&b.centre(k)).then(a.id.cmp(&b.id))
    });
    half
}
