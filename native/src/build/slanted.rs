// SPDX-License-Identifier: GPL-3.0-or-later
//! Partitions of objects between two parallel planes along any of thirteen directions, by the surface area
//! heuristic on the convex regions that the planes leave.
//!
//! A region is what the planes on a node's path have left of the scene's box, so two planes along a
//! diagonal are priced like two along an axis: by the surface of the part below the one and of the
//! part above the other ([`super::profile`]). Regions price planes and decide nothing else: the planes
//! themselves are heights of triangles, rounded outwards.

use super::cell::{Cell, ConvexCell, Direction, Plane};
use super::cost::Costs;
use super::object::{self, TASK};
use super::plane_tree::{MAX_DEPTH, Shape};
use super::profile::Profile;
use super::{Monitor, footprint};
use crate::error::Result;
use crate::scene::Triangles;
use crate::traverse::dop_tree::{NORMALS, height};
use crate::traverse::frame::Frame;
use rayon::prelude::*;

/// Bins of centres per direction.
const BINS: usize = 16;

/// How many directions there are.
pub const DIRECTIONS: usize = NORMALS.len();

/// A direction, by its place in [`NORMALS`].
pub fn direction(k: usize) -> Direction {
    if k < 3 {
        Direction::Axis(k)
    } else {
        Direction::Oblique(NORMALS[k])
    }
}

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

/// What a node is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// A leaf.
    Leaf {
        /// How many triangles it holds.
        count: usize,
    },
    /// An inner node with one child, the next.
    Only {
        /// A place in [`NORMALS`].
        direction: usize,
        /// Where the child begins and where it ends.
        planes: [f32; 2],
    },
    /// An inner node; the child below is the next.
    Pair {
        /// A place in [`NORMALS`].
        direction: usize,
        /// Where the child below ends and where the child above begins.
        planes: [f32; 2],
        /// How many items ahead the child above is.
        above: usize,
    },
}

/// A node in preorder.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Item {
    /// What it is.
    pub kind: Kind,
    /// The surface of its region.
    area: f64,
}

/// A tree in preorder.
#[derive(Debug, Clone)]
pub struct SlantedTree {
    /// Nodes, the root first; never empty.
    pub items: Vec<Item>,
    /// Triangle numbers of the leaves, one leaf after another.
    pub ids: Vec<u32>,
}

impl SlantedTree {
    /// Its shape.
    pub fn shape(&self) -> Shape {
        let mut shape = Shape::default();
        let whole = self.items[0].area;
        let mut depth_sum = 0;
        // Where the subtrees end in which the item lies that is looked at.
        let mut depths = vec![0];
        for item in &self.items {
            let depth = depths.pop().expect("every item has its place");
            let share = if whole > 0.0 { item.area / whole } else { 0.0 };
            let mut step = |direction: usize| {
                let oblique = direction >= 3;
                shape.nodes_axis += usize::from(!oblique);
                shape.nodes_oblique += usize::from(oblique);
                shape.sah_cost += if oblique { 5.0 } else { 1.0 } * share;
            };
            match item.kind {
                Kind::Leaf { count } => {
                    shape.leaves += 1;
                    shape.leaves_empty += usize::from(count == 0);
                    shape.references += count;
                    shape.leaf_max = shape.leaf_max.max(count);
                    shape.depth_max = shape.depth_max.max(depth);
                    shape.sah_cost += 80.0 * share * count as f64;
                    depth_sum += depth;
                }
                Kind::Only { direction, .. } => {
                    step(direction);
                    depths.push(depth + 1);
                }
                Kind::Pair { direction, .. } => {
                    step(direction);
                    depths.extend([depth + 1; 2]);
                }
            }
        }
        shape.depth_mean = depth_sum as f64 / shape.leaves.max(1) as f64;
        shape
    }
}

/// A triangle, as the builder moves it about.
#[derive(Debug, Clone, Copy)]
struct Piece {
    /// In the frame of the walk.
    corners: [[f32; 3]; 3],
    id: u32,
}

impl Piece {
    /// Lowest and highest height along a direction, rounded; the same wherever they are asked for.
    #[inline(always)]
    fn reach(&self, k: usize) -> (f32, f32) {
        let [a, b, c] = self.corners.map(|p| direction(k).height(p));
        (a.min(b).min(c), a.max(b).max(c))
    }

    #[inline(always)]
    fn centre(&self, k: usize) -> f32 {
        let (low, high) = self.reach(k);
        0.5 * low + 0.5 * high
    }

    /// Heights between which it certainly lies.
    fn bounds(&self, k: usize) -> (f32, f32) {
        let heights = self.corners.map(|p| height(NORMALS[k], p));
        heights
            .iter()
            .fold((f32::INFINITY, f32::NEG_INFINITY), |all, h| {
                (all.0.min(h.0), all.1.max(h.1))
            })
    }
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

/// What one thread uses again and again.
#[derive(Default)]
struct Room {
    profile: Profile,
    /// Lowest and highest heights of the pieces along a direction.
    reaches: Vec<(f32, f32)>,
}

/// The pieces whose centres fall between two heights.
#[derive(Clone, Copy)]
struct Bin {
    low: f32,
    high: f32,
    /// Their largest centre: parting at it agrees with the bins without computing them again.
    last: f32,
    count: usize,
}

impl Bin {
    const EMPTY: Self = Self {
        low: f32::INFINITY,
        high: f32::NEG_INFINITY,
        last: f32::NEG_INFINITY,
        count: 0,
    };

    fn union(&self, other: &Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
            last: self.last.max(other.last),
            count: self.count + other.count,
        }
    }
}

/// A partition and what it costs.
#[derive(Clone, Copy)]
struct Best {
    cost: f32,
    direction: usize,
    at: f32,
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
        let levels = pieces.len().next_power_of_two().ilog2() as usize;
        // Halving reaches single triangles in so many levels.
        while node.depth + levels + 1 < MAX_DEPTH {
            let Some(k) = self.cut(pieces, &node.cell, room) else {
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
        let count = pieces.len();
        let area = node.cell.area();
        let mut best = self.best(pieces, &node.cell, room);
        let worth = best.is_some_and(|best| best.cost < self.policy.costs.leaf(count as f32));
        if count < 2 || (!worth && count <= self.policy.leaf_max) {
            best = None;
        } else if best.is_none() {
            best = self.widest(pieces);
        }
        let Some(Best {
            direction: k, at, ..
        }) = best
        else {
            items.push(Item {
                kind: Kind::Leaf { count },
                area,
            });
            return self.done(count, items.len() - first, node.work);
        };
        let mut split = object::part_by(pieces, |piece: &Piece| piece.centre(k) <= at);
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

    /// Tells of a leaf, or of the items of an inner node.
    fn done(&self, count: usize, items: usize, work: f64) -> Result<()> {
        if count > 0 {
            self.monitor.advance(work);
        }
        self.monitor.take(footprint::boxes::<Item>(items))
    }

    /// The direction along which two planes around the pieces leave the least of the cell's surface, if
    /// that is worth a node.
    fn cut(&self, pieces: &[Piece], cell: &ConvexCell, room: &mut Room) -> Option<usize> {
        if self.policy.empty == 0.0 || pieces.is_empty() {
            return None;
        }
        let profile = &mut room.profile;
        let mut least = self.policy.empty;
        let mut best = None;
        for k in 0..self.policy.directions {
            if !cell.extent(direction(k), profile) {
                return None;
            }
            let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
            for piece in pieces {
                let reach = piece.reach(k);
                (low, high) = (low.min(reach.0), high.max(reach.1));
            }
            (low, high) = (low.max(profile.low), high.min(profile.high));
            // By Brunn and Minkowski the share that is left is at least the square of that of the height.
            let span = profile.high - profile.low;
            let bound = (high - low) / span;
            if span <= 0.0 || bound * bound >= least || bound > 0.95 {
                continue;
            }
            cell.divide(direction(k), profile);
            // What lies below the one and what lies above the other have the part between in common.
            let share = profile.shares(high).0 + profile.shares(low).1 - 1.0;
            if share < least {
                (least, best) = (share, Some(k));
            }
        }
        best
    }

    /// The cheapest partition.
    fn best(&self, pieces: &[Piece], cell: &ConvexCell, room: &mut Room) -> Option<Best> {
        let costs = &self.policy.costs;
        let mut best: Option<Best> = None;
        if pieces.len() < 2 {
            return None;
        }
        for k in 0..self.policy.directions {
            let Some(bins) = bins(pieces, k, &mut room.reaches) else {
                continue;
            };
            let profile = &mut room.profile;
            if !cell.extent(direction(k), profile) {
                return None;
            }
            let step = if k < 3 {
                costs.step
            } else {
                self.policy.oblique_step
            };
            let mut above = [Bin::EMPTY; BINS];
            above[BINS - 1] = bins[BINS - 1];
            for i in (0..BINS - 1).rev() {
                above[i] = bins[i].union(&above[i + 1]);
            }
            // First by bounds on the shares, which take no division of the surface.
            let mut divided = k < 3;
            if divided {
                cell.divide(direction(k), profile);
            }
            let mut below = Bin::EMPTY;
            for i in 1..BINS {
                let parts = bins[i - 1].count > 0;
                below = below.union(&bins[i - 1]);
                if !parts || above[i].count == 0 {
                    continue;
                }
                let (end, begin) = (
                    below.high.clamp(profile.low, profile.high),
                    above[i].low.clamp(profile.low, profile.high),
                );
                let leaves = [
                    costs.leaf(below.count as f32),
                    costs.leaf(above[i].count as f32),
                ];
                let cost = |shares: [f32; 2]| step + shares[0] * leaves[0] + shares[1] * leaves[1];
                let limit = best.map_or(f32::INFINITY, |best| best.cost);
                let least = [profile.least_shares(end)[0], profile.least_shares(begin)[1]];
                if cost(least) >= limit {
                    continue;
                }
                if !divided {
                    cell.divide(direction(k), profile);
                    divided = true;
                }
                let cost = cost([profile.shares(end).0, profile.shares(begin).1]);
                if cost < limit {
                    best = Some(Best {
                        cost,
                        direction: k,
                        at: below.last,
                    });
                }
            }
        }
        best
    }

    /// Where no partition has a price: the direction along which centres differ the most.
    fn widest(&self, pieces: &[Piece]) -> Option<Best> {
        let spread = |k: usize| {
            let centres = pieces.iter().map(|piece| piece.centre(k));
            let (low, high) = centres.fold((f32::INFINITY, f32::NEG_INFINITY), |all, x| {
                (all.0.min(x), all.1.max(x))
            });
            (low, high - low)
        };
        let spreads: Vec<_> = (0..3).map(spread).collect();
        let k = (1..3).fold(0, |a, b| if spreads[b].1 > spreads[a].1 { b } else { a });
        (spreads[k].1 > 0.0).then_some(Best {
            cost: 0.0,
            direction: k,
            at: spreads[k].0 + 0.5 * spreads[k].1,
        })
    }
}

/// Pieces in bins by their centres along a direction; `None` when these coincide.
fn bins(pieces: &[Piece], k: usize, reaches: &mut Vec<(f32, f32)>) -> Option<[Bin; BINS]> {
    reaches.clear();
    reaches.extend(pieces.iter().map(|piece| piece.reach(k)));
    let centre = |&(low, high): &(f32, f32)| 0.5 * low + 0.5 * high;
    let (mut first, mut last) = (f32::INFINITY, f32::NEG_INFINITY);
    for reach in &*reaches {
        let at = centre(reach);
        (first, last) = (first.min(at), last.max(at));
    }
    let scale = BINS as f32 / (last - first);
    if !scale.is_finite() {
        return None;
    }
    let mut bins = [Bin::EMPTY; BINS];
    for reach in &*reaches {
        let at = centre(reach);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "saturates, and is clamped"
        )]
        let i = ((at - first) * scale) as usize;
        let bin = &mut bins[i.min(BINS - 1)];
        *bin = bin.union(&Bin {
            low: reach.0,
            high: reach.1,
            last: at,
            count: 1,
        });
    }
    Some(bins)
}

/// Moves the half with the smaller centres to the front, equal ones by number.
fn median(pieces: &mut [Piece], k: usize) -> usize {
    let half = pieces.len() / 2;
    pieces.select_nth_unstable_by(half, |a, b| {
        a.centre(k).total_cmp(&b.centre(k)).then(a.id.cmp(&b.id))
    });
    half
}
