// SPDX-License-Identifier: GPL-3.0-or-later
//! Bounding volume hierarchies of oriented boxes with eight children per node. The boxes of all children of a node
//! share one rotation, so a ray is rotated once per node (DOBB-BVH, arXiv 2506.22849).
//!
//! A node has the layout of those of [`BoxTree`], but its bounds are heights along the three rows of its rotation. The
//! count of an inner child holds the number of that child's rotation, so the traversal can fetch both together.
//!
//! Heights of vertices are computed in f64 and rounded outwards ([`outwards`]). A product of two f32 is exact in f64;
//! two additions of terms whose absolute values sum to at most `sqrt(3) M` have an error of at most
//! `2 sqrt(3) 2^-53 M < 2^-51 M`, where `M` is the scene's largest coordinate. The bounds hold for the rows as stored,
//! which need neither be exactly orthogonal nor exactly of unit length: see [`Rotation::is_sound`].

use crate::box_tree::{self, BoxTree, Wide};
use crate::cells::{Cells, NodeId, NodeView, OBLIQUE, SLAB};
use crate::plane_tree::MAX_DEPTH;
use crate::shape::{Measure, Shape};
use crate::tree::{Body, Tree, same};
use halfspace_geom::Aabb;
use halfspace_geom::cell::{Direction, Plane, PlaneSide};
use halfspace_geom::region::Region;
use halfspace_geom::vec3::{Vec3, dot, widen};
use halfspace_leaf::blocks::Blocks;
use std::collections::{BTreeSet, HashMap};

/// Children per node.
pub const WIDTH: usize = 8;

/// A node whose bounds are heights along the rows of its rotation.
pub type Node = Wide<WIDTH>;

/// Flag of the count of an inner child; the other bits are the number of its rotation.
pub const INNER: u32 = 1 << 31;

/// Largest squared length of a row (chosen): the error bounds hold for far longer rows.
const LONGEST: f64 = 1.0 + 1.0 / (1 << 20) as f64;

/// A rotation in f32, about orthonormal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rotation {
    /// Component `k` of the three rows, and a zero that fills the vector.
    pub columns: [[f32; 4]; 3],
}

impl Rotation {
    /// The rotation of axis-aligned nodes, number 0 in every tree.
    pub const AXES: Self = Self::new([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);

    /// Makes the rotation with these rows.
    pub const fn new([a, b, c]: [[f32; 3]; 3]) -> Self {
        Self {
            columns: [
                [a[0], b[0], c[0], 0.0],
                [a[1], b[1], c[1], 0.0],
                [a[2], b[2], c[2], 0.0],
            ],
        }
    }

    /// Returns row `k`: the direction along which the boxes have their `k`-th extent.
    pub fn row(&self, k: usize) -> [f32; 3] {
        [0, 1, 2].map(|i: usize| self.columns[i][k])
    }

    /// Returns whether each row is short enough for the error bounds of heights: its squared length is at most 1 +
    /// 2^-20. The bounds are independent of the angles between rows.
    pub fn is_sound(&self) -> bool {
        (0..3).all(|k| {
            let row = widen(self.row(k));
            dot(row, row) <= LONGEST
        })
    }

    /// Returns the bits of all entries, row by row.
    fn bits(&self) -> [u32; 9] {
        let rows = [self.row(0), self.row(1), self.row(2)];
        std::array::from_fn(|i| rows[i / 3][i % 3].to_bits())
    }
}

/// An inner node of `W` boxes.
#[derive(Debug, Clone, Copy)]
pub struct Inner<'a, const W: usize> {
    /// The node.
    pub node: &'a Wide<W>,
    /// The rotation along whose rows its boxes lie; `None` for the axes.
    pub rotation: Option<&'a Rotation>,
}

/// A tree of boxes, along the axes or turned, which groups of rays traverse alike.
pub trait Boxes<const W: usize>: Sync {
    /// Returns the count of the link to node 0, the root.
    fn root(&self) -> u32;

    /// Returns the inner node with this link and count, `None` for a leaf.
    fn inner(&self, link: u32, count: u32) -> Option<Inner<'_, W>>;

    /// Prefetches the node or the leaf that a link and a count refer to.
    fn fetch_ahead(&self, link: u32, count: u32, blocks: &Blocks);
}

impl<const W: usize> Boxes<W> for BoxTree<W> {
    #[inline(always)]
    fn root(&self) -> u32 {
        box_tree::INNER
    }

    #[inline(always)]
    fn inner(&self, link: u32, count: u32) -> Option<Inner<'_, W>> {
        (count == box_tree::INNER).then(|| Inner {
            node: &self.nodes[link as usize],
            rotation: None,
        })
    }

    #[inline(always)]
    fn fetch_ahead(&self, link: u32, count: u32, blocks: &Blocks) {
        BoxTree::fetch_ahead(self, link, count, blocks);
    }
}

impl Boxes<WIDTH> for ObbTree {
    #[inline(always)]
    fn root(&self) -> u32 {
        self.root
    }

    #[inline(always)]
    fn inner(&self, link: u32, count: u32) -> Option<Inner<'_, WIDTH>> {
        (count & INNER != 0).then(|| Inner {
            node: &self.nodes[link as usize],
            rotation: (count != INNER).then(|| self.rotation(count)),
        })
    }

    #[inline(always)]
    fn fetch_ahead(&self, link: u32, count: u32, blocks: &Blocks) {
        if count & INNER == 0 {
            blocks.fetch_ahead(link);
        } else {
            self.nodes[link as usize].fetch_ahead();
        }
    }
}

/// The rotation of one node, and its children's bounds along the rows.
#[derive(Debug, Clone)]
pub struct Turn {
    /// Index of the node.
    pub node: u32,
    /// Its rotation.
    pub rotation: Rotation,
    /// As [`Wide::bounds`]: lower and upper heights per lane, exchanged for empty slots.
    pub bounds: [[f32; WIDTH]; 6],
}

/// A hierarchy of oriented boxes over a scene. Node 0 is the root.
#[derive(Debug, Clone, PartialEq)]
pub struct ObbTree {
    /// The nodes.
    pub nodes: Vec<Node>,
    /// The distinct rotations; the first is [`Rotation::AXES`].
    pub rotations: Vec<Rotation>,
    /// The count of the link to node 0, which no node stores.
    pub root: u32,
}

/// Rounds an interval of heights outwards to f32. `low` and `high` are f64 sums of three products of a row and a point
/// whose absolute coordinates are at most `magnitude`.
#[expect(clippy::cast_possible_truncation, reason = "moved outwards")]
pub fn outwards(low: f64, high: f64, magnitude: f32) -> [f32; 2] {
    let error = 2.0_f64.powi(-51) * f64::from(magnitude);
    // The step to the next float covers the rounding to f32 and that of this sum.
    [
        ((low - error) as f32).next_down(),
        ((high + error) as f32).next_up(),
    ]
}

impl ObbTree {
    /// Replaces the boxes of some nodes of a tree of axis-aligned boxes by oriented ones, one [`Turn`] per node.
    ///
    /// # Panics
    /// For 2^31 different rotations, which the number of nodes excludes.
    pub fn new(boxes: BoxTree<WIDTH>, turns: &[Turn]) -> Self {
        let mut nodes = boxes.nodes;
        let mut rotations = vec![Rotation::AXES];
        let mut numbers = HashMap::from([(Rotation::AXES.bits(), 0)]);
        let mut number_of = vec![0_u32; nodes.len()];
        // Store each rotation once: many nodes of regular scenes have equal ones.
        for turn in turns {
            let number = *numbers.entry(turn.rotation.bits()).or_insert_with(|| {
                rotations.push(turn.rotation);
                u32::try_from(rotations.len() - 1).expect("fewer than nodes")
            });
            number_of[turn.node as usize] = number;
            nodes[turn.node as usize].bounds = turn.bounds;
        }
        // Write the number of each node's rotation into the link to the node.
        for node in &mut nodes {
            for (count, &link) in node.count.iter_mut().zip(&node.link) {
                if *count == box_tree::INNER {
                    *count = INNER | number_of[link as usize];
                }
            }
        }
        rotations.shrink_to_fit();
        Self {
            nodes,
            rotations,
            root: INNER | number_of[0],
        }
    }

    /// Returns the rotation of the inner node with this count in its link.
    #[inline(always)]
    pub fn rotation(&self, count: u32) -> &Rotation {
        &self.rotations[(count & !INNER) as usize]
    }

    /// Measures the tree. The share of a node is the surface of its box along its parent's rows divided by that of the
    /// scene's box, at most 1.
    pub fn shape(&self, bounds: Aabb) -> Shape {
        let mut measure = Measure::default();
        let whole = bounds.area();
        // Visit the nodes; the share of a child is known from its parent.
        let mut open = vec![(0, self.root, 0, 1.0)];
        while let Some((link, count, depth, share)) = open.pop() {
            if count & INNER == 0 {
                measure.leaf(count as usize, depth, share);
                continue;
            }
            if count == INNER {
                measure.axis(share);
            } else {
                measure.oblique(share);
            }
            // Weight each child by its surface area.
            let children = self.children(link).map(|child| {
                let area = self.box_of(child).area();
                let share = if whole > 0.0 {
                    (area / whole).min(1.0)
                } else {
                    0.0
                };
                (child.link, child.count, depth + 1, share)
            });
            open.extend(children);
        }
        measure.finish()
    }

    /// Returns the children of a node, without empty slots.
    fn children(&self, node: u32) -> impl DoubleEndedIterator<Item = Child> + '_ {
        let stored = &self.nodes[node as usize];
        (0..WIDTH)
            .filter(|&lane| stored.count[lane] != 0)
            .map(move |lane| Child {
                node,
                lane,
                link: stored.link[lane],
                count: stored.count[lane],
            })
    }

    /// Returns the sides of the six planes of a child's box.
    fn walls(&self, child: Child, rotation: &Rotation) -> [PlaneSide; 6] {
        let aligned = *rotation == Rotation::AXES;
        std::array::from_fn(|row| {
            let k = row % 3;
            let direction = if aligned {
                Direction::Axis(k)
            } else {
                Direction::Oblique(rotation.row(k))
            };
            let offset = self.nodes[child.node as usize].bounds[row][child.lane];
            PlaneSide {
                plane: Plane { direction, offset },
                above: row < 3,
            }
        })
    }

    /// Returns the box of a child along the rows of its node's rotation.
    fn box_of(&self, child: Child) -> Aabb {
        let bounds = &self.nodes[child.node as usize].bounds;
        Aabb {
            min: [0, 1, 2].map(|k: usize| bounds[k][child.lane]),
            max: [3, 4, 5].map(|k: usize| bounds[k][child.lane]),
        }
    }
}

/// A child of a node.
#[derive(Debug, Clone, Copy)]
struct Child {
    /// The node that stores the child's box.
    node: u32,
    /// Lane of the child in that node.
    lane: usize,
    link: u32,
    count: u32,
}

/// A box along the rows of a rotation.
#[derive(Debug, Clone, Copy)]
struct OrientedBox {
    rotation: Rotation,
    bounds: Aabb,
}

/// Returns the part of a region on one side of a plane: the whole region if the plane does not cut it.
fn cut(region: &Region, PlaneSide { plane, above }: PlaneSide) -> Region {
    if let (Some(bounds), Direction::Axis(k)) = (region.bounds(), plane.direction)
        && !(bounds.min[k] <= plane.offset && plane.offset <= bounds.max[k])
    {
        return region.clone();
    }
    let [below, beyond] = region.split(plane);
    if above { beyond } else { below }
}

impl Tree for ObbTree {
    fn bytes(&self) -> usize {
        size_of_val(&*self.nodes) + size_of_val(&*self.rotations)
    }

    fn cells(&self) -> Option<&dyn Cells> {
        Some(self)
    }

    fn leaves(&self, see: &mut dyn FnMut(u32, usize)) {
        let mut open = vec![(0, self.root)];
        while let Some((link, count)) = open.pop() {
            if count & INNER == 0 {
                see(link, count as usize);
            } else {
                let children = self.children(link).rev();
                open.extend(children.map(|child| (child.link, child.count)));
            }
        }
    }

    /// Checks that each triangle lies in exactly one leaf and inside every box on its path.
    fn validate(&self, body: &Body<'_>, broken: &mut Vec<String>) {
        for (number, rotation) in self.rotations.iter().enumerate() {
            if !rotation.is_sound() {
                broken.push(format!("a row of rotation {number} is too long"));
            }
        }
        // Visit the nodes with the boxes on the path to each.
        let mut seen = BTreeSet::new();
        let (mut axis, mut oblique, mut leaves) = (0, 0, 0);
        let mut open = vec![((0, self.root), Vec::new())];
        while let Some(((link, count), path)) = open.pop() {
            if body.monitor.is_cancelled() {
                return;
            }
            if path.len() > MAX_DEPTH || axis + oblique > self.nodes.len() {
                broken.push(format!(
                    "node {link} lies too deep, or the links form a circle"
                ));
                return;
            }
            // Add the box of each child to its path.
            if count & INNER != 0 {
                if count == INNER {
                    axis += 1;
                } else {
                    oblique += 1;
                }
                let rotation = self.rotation(count);
                for child in self.children(link) {
                    let mut path = path.clone();
                    path.push(OrientedBox {
                        rotation: *rotation,
                        bounds: self.box_of(child),
                    });
                    open.push(((child.link, child.count), path));
                }
                continue;
            }
            leaves += 1;
            // Check the triangles of a leaf against all boxes on its path.
            for id in body.blocks.ids(link, count as usize) {
                if !seen.insert(id) {
                    broken.push(format!("triangle {id} lies in two leaves"));
                }
                let corners = body.scene.corners(id).map(|p| widen(body.frame.point(p)));
                if !path.iter().all(|around| around.contains(corners)) {
                    broken.push(format!(
                        "triangle {id} lies partly outside a box on its path"
                    ));
                }
            }
        }
        // Compare the counts with the structure's statistics.
        let shape = body.shape;
        let counted = (axis, oblique, leaves, seen.len());
        let stated = (
            shape.nodes_axis,
            shape.nodes_oblique,
            shape.leaves,
            shape.references,
        );
        if counted != stated {
            broken.push(format!(
                "axis-aligned nodes, turned nodes, leaves and references are {counted:?}, the statistics are {stated:?}"
            ));
        }
    }

    fn same(&self, other: &dyn Tree) -> bool {
        same(self, other)
    }
}

impl OrientedBox {
    /// Returns whether a triangle lies inside the box, in f64: its rounding errors are far less than the margin of
    /// oriented boxes, and 0 for axis-aligned ones.
    fn contains(&self, corners: [Vec3; 3]) -> bool {
        (0..3).all(|k| {
            let row = widen(self.rotation.row(k));
            corners.iter().all(|&p| {
                let height = dot(row, p);
                f64::from(self.bounds.min[k]) <= height && height <= f64::from(self.bounds.max[k])
            })
        })
    }
}

/// The first two words of a [`NodeId`] are the link and the count by which the parent refers to the node.
impl Cells for ObbTree {
    fn root(&self, bounds: Aabb) -> (NodeId, Region) {
        ([0, self.root, 0, 0], Region::of_scene(bounds))
    }

    fn node(&self, [link, count, ..]: NodeId, region: &Region) -> NodeView {
        if count & INNER == 0 {
            return NodeView::leaf(link, count as usize);
        }
        let rotation = self.rotation(count);
        let mut view = NodeView {
            // Draw children by their planes if their region is no box.
            boxes: count == INNER && region.bounds().is_some(),
            ..NodeView::default()
        };
        let kind = if count == INNER { SLAB } else { OBLIQUE };
        // Cut the region of each child by the walls of its box.
        for child in self.children(link) {
            let walls = self.walls(child, rotation);
            if !view.boxes {
                view.planes.extend(walls.map(|side| (side.plane, kind)));
            }
            let inside = walls
                .iter()
                .fold(region.clone(), |part, &wall| cut(&part, wall));
            view.children
                .push(([child.link, child.count, 0, 0], inside));
        }
        view
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The corners of a grid of large and small coordinates stay inside the rounded interval, by exact arithmetic: the
    /// row and the points have so few bits that f64 holds every height exactly.
    #[test]
    fn rounded_heights_enclose_exact_ones() {
        let row = [0.623_046_9_f32, -0.480_468_75, 0.617_187_5];
        for i in 0..4096_u16 {
            let p = [0, 4, 8]
                .map(|shift: u16| f32::from(i >> shift & 15) * 2.0_f32.powi(i32::from(shift) - 20));
            let exact = dot(widen(row), widen(p));
            let [low, high] = outwards(exact, exact, 16.0);
            assert!(f64::from(low) < exact && exact < f64::from(high), "{p:?}");
        }
    }

    #[test]
    fn rows_that_are_too_long_are_detected() {
        assert!(Rotation::AXES.is_sound());
        let long = Rotation::new([[1.0, 0.01, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
        assert!(!long.is_sound());
    }

    #[test]
    fn equal_rotations_are_stored_once() {
        let mut boxes = BoxTree::<WIDTH> {
            nodes: vec![BoxTree::<WIDTH>::BLANK; 3],
        };
        boxes.nodes[0].link[..2].copy_from_slice(&[1, 2]);
        boxes.nodes[0].count[..2].copy_from_slice(&[box_tree::INNER; 2]);
        let turn = |node| Turn {
            node,
            rotation: Rotation::new([[0.6, 0.8, 0.0], [-0.8, 0.6, 0.0], [0.0, 0.0, 1.0]]),
            bounds: BoxTree::<WIDTH>::BLANK.bounds,
        };
        let tree = ObbTree::new(boxes, &[turn(1), turn(2)]);
        assert_eq!(tree.rotations.len(), 2);
        assert_eq!(
            (tree.root, tree.nodes[0].count[..3].to_vec()),
            (INNER, vec![INNER | 1, INNER | 1, 0])
        );
    }
}
