// SPDX-License-Identifier: GPL-3.0-or-later
//! Ropes: links from the leaves of an axis-aligned tree to what lies across each of their six faces, so that a
//! ray need not go back to the root (MacDonald and Booth 1990).
//!
//! A rope leads to the smallest node that covers the face. A rope tree parts the face itself (Havran,
//! Bittner and Žára 1998): of the nodes below that one it keeps those whose planes cut the face, and of their
//! leaves those that touch it, so that a ray decides only what has to be decided.

use super::Monitor;
use super::plane_tree::{Node, PlaneTree};
use crate::error::{Error, Result};
use crate::geom::Aabb;

/// A link out of the scene.
pub const OUTSIDE: u32 = u32::MAX;

/// Links with this bit lead to a node of a rope tree, others to a node of the tree.
const PARTED: u32 = 1 << 31;

/// What lies across a face.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// The smallest node that covers it.
    Ropes,
    /// A tree of the leaves that touch it.
    RopeTrees,
}

/// A node of a rope tree.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Part {
    axis: u32,
    split: f32,
    /// Below and above.
    children: [u32; 2],
}

/// What a link leads to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Step {
    /// A plane to decide about.
    Plane {
        /// 0, 1 or 2.
        axis: usize,
        /// Height of the plane.
        split: f32,
        /// The links below and above.
        children: [u32; 2],
    },
    /// A leaf of the tree.
    Leaf {
        /// Where its blocks begin.
        first: u32,
        /// How many triangles it holds.
        count: usize,
    },
}

/// The links of all leaves of a tree.
#[derive(Debug, Clone, PartialEq)]
pub struct Ropes {
    /// For each node of the tree, a leaf's place among the leaves.
    places: Vec<u32>,
    /// Per leaf and axis the wall below and the wall above; infinitely far where the scene ends.
    walls: Vec<[[f32; 2]; 3]>,
    /// Per leaf and axis what lies below and above.
    links: Vec<[[u32; 2]; 3]>,
    parts: Vec<Part>,
}

/// A node on the way down: its box, and what lies across its faces.
#[derive(Clone, Copy)]
struct Pending {
    node: u32,
    cell: Aabb,
    across: [[u32; 2]; 3],
}

/// A face of a leaf. A leaf at the border of the scene ends beyond it: that a ray has crossed the wall there is
/// never certain, so a plane in that wall has to be decided about.
#[derive(Clone, Copy)]
struct Face<'a> {
    cell: &'a Aabb,
    axis: usize,
    /// 0 below, 1 above.
    side: usize,
}

impl Face<'_> {
    /// The children of a node across the face that the face touches; the same twice when only one does. A
    /// cell without thickness lies on the side that comes first.
    fn touched(&self, axis: usize, split: f32, children: u32) -> [u32; 2] {
        let (below, above) = (children, children + 1);
        if axis == self.axis {
            [children + u32::from(self.side == 0); 2]
        } else if split >= self.cell.max[axis] {
            [below; 2]
        } else if split <= self.cell.min[axis] {
            [above; 2]
        } else {
            [below, above]
        }
    }
}

impl Ropes {
    /// Links the leaves of a tree with axis-aligned planes over a scene with this box.
    ///
    /// # Errors
    /// [`Error::Cancelled`] and [`Error::Memory`] when the monitor says so; [`Error::Memory`] for rope trees of
    /// more nodes than links can name.
    pub fn new(tree: &PlaneTree, bounds: Aabb, kind: Kind, monitor: &Monitor) -> Result<Self> {
        let nodes = tree.places();
        let leaves = nodes / 2;
        monitor.take(nodes * size_of::<u32>() + leaves * 2 * size_of::<[[f32; 2]; 3]>())?;
        let mut ropes = Self {
            places: vec![OUTSIDE; nodes],
            walls: Vec::with_capacity(leaves),
            links: Vec::with_capacity(leaves),
            parts: Vec::new(),
        };
        let mut gathered = 0;
        let mut waiting = vec![Pending {
            node: tree.root(),
            cell: bounds,
            across: [[OUTSIDE; 2]; 3],
        }];
        while let Some(Pending { node, cell, across }) = waiting.pop() {
            let (axis, split, children) = match tree.node(node) {
                Node::Axis {
                    axis,
                    split,
                    children,
                    ..
                } => (axis, split, children),
                Node::Oblique { .. } => unreachable!("ropes are for axis-aligned trees"),
                Node::Leaf { .. } => {
                    monitor.check()?;
                    #[expect(clippy::cast_possible_truncation, reason = "fewer than 2^27 nodes")]
                    let place = ropes.links.len() as u32;
                    ropes.places[node as usize] = place;
                    let mut cell = cell;
                    for (k, [below, above]) in across.into_iter().enumerate() {
                        if below == OUTSIDE {
                            cell.min[k] = f32::NEG_INFINITY;
                        }
                        if above == OUTSIDE {
                            cell.max[k] = f32::INFINITY;
                        }
                    }
                    let mut links = across;
                    for (axis, ends) in links.iter_mut().enumerate() {
                        for (side, link) in ends.iter_mut().enumerate() {
                            if *link == OUTSIDE {
                                continue;
                            }
                            let cell = &cell;
                            let face = Face { cell, axis, side };
                            *link = match kind {
                                Kind::Ropes => covering(tree, face, *link),
                                Kind::RopeTrees => {
                                    let before = ropes.parts.len();
                                    let link = ropes.part(tree, face, *link)?;
                                    let more = ropes.parts.len() - before;
                                    // A vector that grows keeps room ahead, and copies.
                                    monitor.charge(&mut gathered, more * 3 * size_of::<Part>())?;
                                    link
                                }
                            };
                        }
                    }
                    ropes
                        .walls
                        .push([0, 1, 2].map(|k| [cell.min[k], cell.max[k]]));
                    ropes.links.push(links);
                    continue;
                }
            };
            let half = |side: usize| {
                let (mut cell, mut across) = (cell, across);
                across[axis][1 - side] = children + u32::from(side == 0);
                if side == 0 {
                    cell.max[axis] = split;
                } else {
                    cell.min[axis] = split;
                }
                let node = children + u32::from(side == 1);
                Pending { node, cell, across }
            };
            waiting.extend([half(1), half(0)]);
        }
        monitor.take(gathered)?;
        ropes.parts.shrink_to_fit();
        Ok(ropes)
    }

    /// The rope tree of the part of a face that a node covers.
    fn part(&mut self, tree: &PlaneTree, face: Face<'_>, node: u32) -> Result<u32> {
        let Node::Axis {
            axis,
            split,
            children,
            ..
        } = tree.node(node)
        else {
            return Ok(node);
        };
        let [below, above] = face.touched(axis, split, children);
        if below == above {
            return self.part(tree, face, below);
        }
        let children = [self.part(tree, face, below)?, self.part(tree, face, above)?];
        let place = self.parts.len();
        if place >= (PARTED - 1) as usize {
            return Err(Error::Memory(
                "the rope trees would have more than 2^31 nodes".to_owned(),
            ));
        }
        #[expect(clippy::cast_possible_truncation, reason = "checked and an axis")]
        let (link, axis) = (place as u32 | PARTED, axis as u32);
        self.parts.push(Part {
            axis,
            split,
            children,
        });
        Ok(link)
    }

    /// What a link leads to.
    #[inline(always)]
    pub fn step(&self, tree: &PlaneTree, link: u32) -> Step {
        if link & PARTED != 0 {
            let part = self.parts[(link & !PARTED) as usize];
            return Step::Plane {
                axis: part.axis as usize % 3,
                split: part.split,
                children: part.children,
            };
        }
        match tree.node(link) {
            Node::Axis {
                axis,
                split,
                children,
                ..
            } => Step::Plane {
                axis,
                split,
                children: [children, children + 1],
            },
            Node::Oblique { .. } => unreachable!("ropes are for axis-aligned trees"),
            Node::Leaf { first, count } => Step::Leaf { first, count },
        }
    }

    /// The walls of a leaf, named by its node, per axis below and above; infinitely far where the scene ends.
    #[inline(always)]
    pub fn walls(&self, leaf: u32) -> &[[f32; 2]; 3] {
        &self.walls[self.places[leaf as usize] as usize]
    }

    /// Its links, per axis below and above; [`OUTSIDE`] where the scene ends.
    #[inline(always)]
    pub fn links(&self, leaf: u32) -> &[[u32; 2]; 3] {
        &self.links[self.places[leaf as usize] as usize]
    }

    /// How many links there are, those out of the scene left out.
    pub fn count(&self) -> usize {
        let all = self.links.as_flattened().as_flattened();
        all.iter().filter(|link| **link != OUTSIDE).count()
    }

    /// Size in bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.places)
            + size_of_val(&*self.walls)
            + size_of_val(&*self.links)
            + size_of_val(&*self.parts)
    }
}

/// The smallest node below this one that covers the face.
fn covering(tree: &PlaneTree, face: Face<'_>, mut node: u32) -> u32 {
    while let Node::Axis {
        axis,
        split,
        children,
        ..
    } = tree.node(node)
    {
        let [below, above] = face.touched(axis, split, children);
        if below != above {
            break;
        }
        node = below;
    }
    node
}
