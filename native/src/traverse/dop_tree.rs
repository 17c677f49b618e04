// SPDX-License-Identifier: GPL-3.0-or-later
//! Hierarchies of slabs: each node lies between two parallel planes for each of `D` fixed normals, and
//! rays take nodes from a heap, the nearest first (Kay and Kajiya 1986). Three normals are boxes.
//!
//! Distances are `bound * inv - n.o * inv`, moved outwards by a bound on their error, so a node is
//! passed by only when the ray certainly misses it or certainly reaches it too late. The bound of
//! an axis is the frame's; with the sum of a normal's components at most 3, that of an oblique
//! slab is at most 30 u times the frame's span: 9 for `n.o`, 9 for `n.d` over the way to any point of
//! the scene, 12 for the products, the reciprocal and the sums.

use super::batch;
use super::blocks::Blocks;
use super::bound::{keep_max, keep_min};
use super::box_tree::Slabs;
use super::frame::{Frame, FrameRay};
use super::nested::{Look, Nested, Place};
use super::query::{Best, Counters, Query};
use super::ray::{Hit, Ray};
use crate::build::insertion::{Child, Grown};
use crate::build::leaves::Leaves;
use crate::build::object::Object;
use crate::error::{Error, Result};
use crate::geom::Aabb;
use crate::scene::Triangles;
use fearless_simd::Simd;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Normals of the slabs: the axes, the diagonals of the cube, the diagonals of its faces. Products
/// with their components are exact.
pub const NORMALS: [[f32; 3]; 13] = [
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [1.0, 1.0, 1.0],
    [-1.0, 1.0, 1.0],
    [1.0, -1.0, 1.0],
    [1.0, 1.0, -1.0],
    [0.0, 1.0, 1.0],
    [0.0, 1.0, -1.0],
    [1.0, 0.0, 1.0],
    [1.0, 0.0, -1.0],
    [1.0, 1.0, 0.0],
    [1.0, -1.0, 0.0],
];

/// Set in `count` when the link leads to inner nodes; the rest is then their number.
const INNER: u32 = 1 << 31;

/// A node.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Node<const D: usize> {
    low: [f32; D],
    high: [f32; D],
    /// The first of the children, which stand side by side, or where a leaf's data begins.
    link: u32,
    /// How many triangles a leaf holds, or how many children there are.
    count: u32,
}

/// A hierarchy of slabs over a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct DopTree<const D: usize> {
    nodes: Vec<Node<D>>,
}

impl<const D: usize> Node<D> {
    const EMPTY: Self = Self {
        low: [f32::INFINITY; D],
        high: [f32::NEG_INFINITY; D],
        link: 0,
        count: 0,
    };

    fn bounds(&self) -> Aabb {
        Aabb {
            min: [self.low[0], self.low[1], self.low[2]],
            max: [self.high[0], self.high[1], self.high[2]],
        }
    }

    /// Makes room for a point.
    fn grow(&mut self, p: [f32; 3]) {
        for (k, n) in NORMALS.iter().enumerate().take(D) {
            let (low, high) = height(*n, p);
            self.low[k] = self.low[k].min(low);
            self.high[k] = self.high[k].max(high);
        }
    }

    fn join(&mut self, other: &Self) {
        for k in 0..D {
            self.low[k] = self.low[k].min(other.low[k]);
            self.high[k] = self.high[k].max(other.high[k]);
        }
    }

    /// Whether the other one's slabs lie inside these.
    fn holds(&self, other: &Self) -> bool {
        (0..D).all(|k| {
            other.low[k] > other.high[k]
                || (self.low[k] <= other.low[k] && other.high[k] <= self.high[k])
        })
    }
}

/// Floats between which `n . p` lies; for an axis the coordinate itself.
#[expect(clippy::cast_possible_truncation, reason = "moved outwards")]
pub(crate) fn height(n: [f32; 3], p: [f32; 3]) -> (f32, f32) {
    let terms = [0, 1, 2].map(|k| f64::from(n[k]) * f64::from(p[k]));
    let sum = terms[0] + terms[1] + terms[2];
    if n.iter().filter(|x| **x != 0.0).count() == 1 {
        // `+ 0.0` turns -0.0 into +0.0.
        return (sum as f32 + 0.0, sum as f32 + 0.0);
    }
    // The two roundings of the sum, and that to f32.
    let error = 2.0_f64.powi(-51) * terms.iter().map(|x| x.abs()).sum::<f64>();
    (
        ((sum - error) as f32).next_down(),
        ((sum + error) as f32).next_up(),
    )
}

impl<const D: usize> DopTree<D> {
    /// Lays out a grown tree, its leaves in `leaves` and their triangles' numbers in `ids`. Subtrees of
    /// at most `leaf_size` objects become leaves.
    ///
    /// # Errors
    /// [`Error::Memory`] when the tree is more than links can name.
    pub fn new(
        grown: &Grown,
        (scene, frame, objects): (&Triangles, &Frame, &[Object]),
        leaf_size: usize,
        (leaves, ids): (&mut Leaves, &mut Vec<u32>),
    ) -> Result<Self> {
        if objects.len() >= 1 << 28 {
            return Err(Error::Memory(format!(
                "the tree would hold {} triangles; fewer than 2^28 are possible",
                objects.len()
            )));
        }
        let mut nodes = vec![Node::EMPTY];
        let mut open = vec![(0, Child::Node(0), objects.len())];
        let mut members = Vec::new();
        while let Some((place, child, count)) = open.pop() {
            match child {
                Child::Node(from) if count > leaf_size => {
                    let link = nodes.len();
                    let before = open.len();
                    for (child, count) in grown.children(from) {
                        open.push((nodes.len(), child, count));
                        nodes.push(Node::EMPTY);
                    }
                    open[before..].reverse();
                    nodes[place].link = low(link);
                    nodes[place].count = INNER | low(nodes.len() - link);
                }
                _ => {
                    members.clear();
                    grown.objects(child, &mut members);
                    nodes[place].link = leaves.push(low(ids.len()), members.len());
                    nodes[place].count = low(members.len());
                    for &member in &members {
                        let id = objects[member].id;
                        ids.push(id);
                        for p in scene.corners(id) {
                            nodes[place].grow(frame.point(p));
                        }
                    }
                }
            }
        }
        // Children come after their parents.
        for place in (0..nodes.len()).rev() {
            let Node { link, count, .. } = nodes[place];
            if count & INNER != 0 {
                for child in link..link + (count & !INNER) {
                    let child = nodes[child as usize];
                    nodes[place].join(&child);
                }
            }
        }
        nodes.shrink_to_fit();
        Ok(Self { nodes })
    }
}

fn low(x: usize) -> u32 {
    u32::try_from(x).expect("fewer than 2^29 nodes")
}

impl<const D: usize> Nested for DopTree<D> {
    fn top(&self) -> Place {
        (0, 0)
    }

    /// A place is the number of the node.
    fn look(&self, (place, _): Place, _: &Aabb, children: &mut Vec<(Place, Aabb)>) -> Look {
        let Node { link, count, .. } = self.nodes[place as usize];
        if count & INNER == 0 {
            return Look::Leaf {
                first: link,
                count: count as usize,
            };
        }
        let below = link..link + (count & !INNER);
        children.extend(below.map(|i| ((i, 0), self.nodes[i as usize].bounds())));
        Look::Boxes
    }

    fn bytes(&self) -> usize {
        size_of_val(&*self.nodes)
    }

    fn nests(&self, (place, _): Place) -> bool {
        let node = &self.nodes[place as usize];
        let below = if node.count & INNER == 0 {
            0..0
        } else {
            node.link..node.link + (node.count & !INNER)
        };
        below
            .into_iter()
            .all(|i| node.holds(&self.nodes[i as usize]))
    }

    fn holds(&self, (place, _): Place, corners: [[f32; 3]; 3]) -> bool {
        let node = &self.nodes[place as usize];
        corners.iter().all(|p| {
            NORMALS.iter().take(D).enumerate().all(|(k, n)| {
                let height: f64 = (0..3).map(|k| f64::from(n[k]) * f64::from(p[k])).sum();
                f64::from(node.low[k]) <= height && height <= f64::from(node.high[k])
            })
        })
    }
}

/// What slab tests need of a ray: a plane `n . x = p` lies at `p * inv + near` or a little later, and at
/// `p * inv + far` or a little sooner.
pub(super) struct Planes<const D: usize> {
    inv: [f32; D],
    near: [f32; D],
    far: [f32; D],
    /// Whether the ray enters through the high plane.
    flip: [bool; D],
}

impl<const D: usize> Planes<D> {
    #[inline(always)]
    pub(super) fn new(ray: &FrameRay) -> Self {
        let slabs = Slabs::new(ray);
        let mut planes = Self {
            inv: [0.0; D],
            near: [f32::NEG_INFINITY; D],
            far: [f32::INFINITY; D],
            flip: [false; D],
        };
        for k in 0..3 {
            planes.inv[k] = slabs.inv[k];
            planes.near[k] = slabs.near[k];
            planes.far[k] = slabs.far[k];
            planes.flip[k] = slabs.entry_row(k) == 1;
        }
        for (k, n) in NORMALS.iter().enumerate().take(D).skip(3) {
            let dot = |v: [f32; 3]| n[0] * v[0] + n[1] * v[1] + n[2] * v[2];
            let speed = dot(ray.d);
            let inv = 1.0 / (speed + f32::MIN_POSITIVE.copysign(speed));
            let shift = dot(ray.o) * inv;
            // The frame's bound is for normals of unit length and 28 u; these need 30 u.
            let slack = 2.0 * ray.oblique_pad * inv.abs();
            // Where a product might overflow, the slab decides nothing.
            if (4.0 * ray.span * inv).is_finite() && (slack + shift.abs()).is_finite() {
                planes.inv[k] = inv;
                planes.near[k] = -shift - slack;
                planes.far[k] = -shift + slack;
            }
            planes.flip[k] = speed.is_sign_negative();
        }
        planes
    }

    /// Whether the ray goes downwards along a direction.
    #[inline(always)]
    pub(super) fn flip(&self, k: usize) -> bool {
        self.flip[k]
    }

    /// When the ray meets a plane at the soonest.
    #[inline(always)]
    pub(super) fn soonest(&self, k: usize, plane: f32) -> f32 {
        plane * self.inv[k] + self.near[k]
    }

    /// When it meets it at the latest.
    #[inline(always)]
    pub(super) fn latest(&self, k: usize, plane: f32) -> f32 {
        plane * self.inv[k] + self.far[k]
    }

    /// Where the ray enters a node that it may hit something in before `reach`.
    #[inline(always)]
    fn meet(&self, node: &Node<D>, (start, reach): (f32, f32)) -> Option<f32> {
        let (mut enter, mut leave) = (start, reach);
        for k in 0..D {
            let (low, high) = (node.low[k], node.high[k]);
            let (near, far) = if self.flip[k] {
                (high, low)
            } else {
                (low, high)
            };
            enter = keep_max(near * self.inv[k] + self.near[k], enter);
            leave = keep_min(far * self.inv[k] + self.far[k], leave);
        }
        (enter <= leave).then_some(enter)
    }
}

/// A node on the heap; the nearest is the greatest, of equal ones the first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pending {
    enter: f32,
    node: u32,
}

impl Eq for Pending {}

impl PartialOrd for Pending {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Pending {
    fn cmp(&self, other: &Self) -> Ordering {
        other
            .enter
            .total_cmp(&self.enter)
            .then(other.node.cmp(&self.node))
    }
}

/// The walk over one tree.
pub struct Walk<'a, const D: usize>(pub &'a DopTree<D>);

impl<const D: usize> batch::Walk for Walk<'_, D> {
    type Scratch = BinaryHeap<Pending>;

    fn scratch(&self) -> Self::Scratch {
        BinaryHeap::new()
    }

    #[inline(always)]
    fn cast<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        (scene, blocks): (&Triangles, &Blocks),
        (ray, frame): (&Ray, &FrameRay),
        heap: &mut Self::Scratch,
        counters: &mut C,
    ) -> Hit {
        let planes = Planes::<D>::new(frame);
        let mut best = Best::new(frame);
        heap.clear();
        heap.push(Pending {
            enter: frame.t_min,
            node: 0,
        });
        while let Some(Pending { enter, node }) = heap.pop() {
            if enter > best.reach {
                break;
            }
            let Node { link, count, .. } = self.0.nodes[node as usize];
            if count & INNER == 0 {
                let count = count as usize;
                counters.leaf(count);
                if blocks.test_any::<S, Q, C>(
                    simd,
                    (link, count),
                    scene,
                    (ray, frame, frame.t_max),
                    &mut best,
                    counters,
                ) {
                    break;
                }
                continue;
            }
            counters.step_axis();
            let first = link as usize;
            let children = &self.0.nodes[first..first + (count & !INNER) as usize];
            for (node, child) in (link..).zip(children) {
                if let Some(enter) = planes.meet(child, (frame.t_min, best.reach)) {
                    heap.push(Pending { enter, node });
                }
            }
        }
        best.hit()
    }
}

#[cfg(test)]
mod tests;
