// SPDX-License-Identifier: GPL-3.0-or-later
//! Interval hierarchies of `W` children to a node: along one axis, each child lies between two planes
//! of its own. With two children these are four planes in twenty bytes.

use super::batch;
use super::blocks::Blocks;
use super::bound::{keep_max, keep_max_each, keep_min, keep_min_each};
use super::box_tree::Slabs;
use super::frame::FrameRay;
use super::nested::{Look, Nested, Place};
use super::pending::{Pending, make_room, next};
use super::query::{Best, Counters, Query};
use super::ray::{Hit, Ray};
use crate::build::leaves::Leaves;
use crate::build::object_tree::{Kind, ObjectTree};
use crate::build::plane_tree::MAX_DEPTH;
use crate::build::tighten::{Sides, Tighten};
use crate::error::{Error, Result};
use crate::geom::Aabb;
use crate::scene::Triangles;
use fearless_simd::{Simd, SimdFloat, SimdMask, f32x4, f32x8};

/// More children than this no node has.
const WIDEST: usize = 8;

/// Instead of an axis: a leaf.
const LEAF: u32 = 3;

/// Bits below the link: the axis, and above it the number of children less one.
const LOW_BITS: u32 = 5;

/// No tree has more nodes, no leaf more triangles.
const MOST: usize = 1 << (32 - LOW_BITS);

/// A node. Above the low bits of `word` is the first of the children, which stand side by side, or a
/// leaf's number of triangles.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Node<const W: usize> {
    word: u32,
    /// Rows: where each child begins, where it ends; of an only child, what is left of the region. The first number holds the bits of where a
    /// leaf's data begins.
    planes: [[f32; W]; 2],
}

/// A wide interval hierarchy over a scene.
#[derive(Debug, Clone)]
pub struct WideSlabs<const W: usize> {
    nodes: Vec<Node<W>>,
}

impl<const W: usize> PartialEq for WideSlabs<W> {
    /// Bit for bit: where a leaf's data begins is stored as a float and may read as NaN.
    fn eq(&self, other: &Self) -> bool {
        let same = |(a, b): (&Node<W>, &Node<W>)| {
            a.word == b.word
                && a.planes.map(|row| row.map(f32::to_bits))
                    == b.planes.map(|row| row.map(f32::to_bits))
        };
        self.nodes.len() == other.nodes.len() && self.nodes.iter().zip(&other.nodes).all(same)
    }
}

impl<const W: usize> Node<W> {
    const BLANK: Self = Self {
        word: LEAF,
        planes: [[f32::MAX; W], [f32::MIN; W]],
    };

    fn new(link: usize, children: usize, low: usize) -> Self {
        let word = |x: usize| u32::try_from(x).expect("checked by the layout");
        Self {
            word: word(link) << LOW_BITS | word(children - 1) << 2 | word(low),
            ..Self::BLANK
        }
    }

    #[inline(always)]
    fn link(&self) -> u32 {
        self.word >> LOW_BITS
    }

    /// What is left of a region for a child.
    fn part(&self, lane: usize, axis: usize, region: &Aabb) -> Aabb {
        let mut part = *region;
        part.min[axis] = self.planes[0][lane];
        part.max[axis] = self.planes[1][lane];
        part
    }

    #[inline(always)]
    fn children(&self) -> u32 {
        (self.word >> 2 & 7) + 1
    }
}

impl<const W: usize> WideSlabs<W> {
    /// Lays out a binary tree over a scene of these bounds, its leaves in `leaves`. A child that was
    /// parted along the same axis as its parent gives way to its own children while there is room, the
    /// largest first. Where `tighten` says so, a node with one child first cuts off empty space.
    ///
    /// # Errors
    /// [`Error::Memory`] when the tree is more than links can name.
    pub fn new(
        binary: &ObjectTree,
        bounds: Aabb,
        tighten: Tighten,
        leaves: &mut Leaves,
    ) -> Result<Self> {
        binary.check_size()?;
        let firsts = binary.firsts();
        let heights = binary.heights();
        let mut nodes = Vec::with_capacity(binary.items.len());
        nodes.push(Node::BLANK);
        // Nodes to fill: their own place, that in `binary`, region and depth.
        let mut open = vec![(0, 0, bounds, 0)];
        while let Some((place, from, region, depth)) = open.pop() {
            let link = nodes.len();
            if link + W > MOST || binary.ids.len() >= MOST {
                return Err(Error::Memory(format!(
                    "the tree would have {MOST} nodes or triangles"
                )));
            }
            let room = depth + usize::from(heights[from]) < MAX_DEPTH;
            let cut = tighten.cut(Sides::Both, &region, &binary.items[from].bounds);
            if let Some(cut) = cut.filter(|_| room) {
                let mut node = Node::new(link, 1, cut.axis);
                node.planes[0][0] = cut.inside.min[cut.axis];
                node.planes[1][0] = cut.inside.max[cut.axis];
                nodes.push(Node::BLANK);
                nodes[place] = node;
                open.push((link, from, cut.inside, depth + 1));
                continue;
            }
            nodes[place] = match binary.kind(from) {
                Kind::Leaf { count } => {
                    let mut node = Node::new(count, 1, LEAF as usize);
                    node.planes[0][0] = f32::from_bits(leaves.push(firsts[from], count));
                    node
                }
                Kind::Inner { axis, .. } => {
                    let children = Self::children(binary, from, axis);
                    let mut node = Node::new(link, children.len(), axis);
                    for (lane, &child) in children.iter().enumerate() {
                        let bounds = &binary.items[child].bounds;
                        node.planes[0][lane] = bounds.min[axis];
                        node.planes[1][lane] = bounds.max[axis];
                        nodes.push(Node::BLANK);
                    }
                    let below = (0..children.len()).rev().map(|lane| {
                        let part = node.part(lane, axis, &region);
                        (link + lane, children[lane], part, depth + 1)
                    });
                    open.extend(below);
                    node
                }
            };
        }
        nodes.shrink_to_fit();
        Ok(Self { nodes })
    }

    /// The up to `W` descendants, all parted from one another along `axis`, that become the children of
    /// the node at `place`.
    fn children(binary: &ObjectTree, place: usize, axis: usize) -> Vec<usize> {
        let mut children = vec![place];
        while children.len() < W {
            let largest = (0..children.len())
                .filter_map(|i| match binary.kind(children[i]) {
                    Kind::Inner {
                        axis: own,
                        children: below,
                    } if own == axis => Some((i, below, binary.items[children[i]].bounds.area())),
                    _ => None,
                })
                .reduce(|a, b| if b.2 > a.2 { b } else { a });
            let Some((i, [below, above], _)) = largest else {
                break;
            };
            children[i] = below;
            children.insert(i + 1, above);
        }
        children
    }
}

impl<const W: usize> Nested for WideSlabs<W> {
    fn top(&self) -> Place {
        (0, 0)
    }

    /// A place is the number of the node.
    fn look(&self, (place, _): Place, region: &Aabb, children: &mut Vec<(Place, Aabb)>) -> Look {
        let node = &self.nodes[place as usize];
        let axis = (node.word & LEAF) as usize;
        if axis == 3 {
            return Look::Leaf {
                first: node.planes[0][0].to_bits(),
                count: node.link() as usize,
            };
        }
        for lane in 0..node.children() {
            let part = node.part(lane as usize, axis, region);
            children.push(((node.link() + lane, 0), part));
        }
        Look::Slabs { axis }
    }

    fn bytes(&self) -> usize {
        size_of_val(&*self.nodes)
    }
}

impl Slabs {
    /// Where the ray enters and leaves the intervals of the lanes of `V` along an axis, and a bit for
    /// each that it may hit something in.
    #[inline(always)]
    fn between<S: Simd, V: SimdFloat<S, Element = f32>, const W: usize>(
        &self,
        simd: S,
        (planes, axis): (&[[f32; W]; 2], usize),
        (enter, leave): (f32, f32),
        (enters, leaves): (&mut [f32; W], &mut [f32; W]),
    ) -> u64 {
        let splat = |x: f32| V::splat(simd, x);
        let row = self.entry_row(axis);
        let (near, far) = (
            V::from_slice(simd, &planes[row]),
            V::from_slice(simd, &planes[row ^ 1]),
        );
        let inv = splat(self.inv[axis]);
        let enter = keep_max_each(near.mul_add(inv, splat(self.near[axis])), splat(enter));
        let leave = keep_min_each(far.mul_add(inv, splat(self.far[axis])), splat(leave));
        enter.store_slice(enters);
        leave.store_slice(leaves);
        enter.simd_le(leave).to_bitmask()
    }

    /// The same for two children, for which no vector is that short.
    #[inline(always)]
    fn between_few<const W: usize>(
        &self,
        (planes, axis): (&[[f32; W]; 2], usize),
        (enter, leave): (f32, f32),
        (enters, leaves): (&mut [f32; W], &mut [f32; W]),
    ) -> u64 {
        let row = self.entry_row(axis);
        let mut mask = 0;
        for lane in 0..W {
            enters[lane] = keep_max(planes[row][lane] * self.inv[axis] + self.near[axis], enter);
            leaves[lane] = keep_min(
                planes[row ^ 1][lane] * self.inv[axis] + self.far[axis],
                leave,
            );
            mask |= u64::from(enters[lane] <= leaves[lane]) << lane;
        }
        mask
    }
}

/// The walk over one tree.
pub struct Walk<'a, const W: usize>(pub &'a WideSlabs<W>);

impl<const W: usize> batch::Walk for Walk<'_, W> {
    type Scratch = Vec<Pending>;

    fn scratch(&self) -> Self::Scratch {
        // Each level leaves at most all children but one behind, and the lowest all of them.
        vec![Pending::default(); (MAX_DEPTH + 1) * (W - 1) + 2 * WIDEST]
    }

    #[inline(always)]
    fn cast<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        (scene, blocks): (&Triangles, &Blocks),
        (ray, frame): (&Ray, &FrameRay),
        stack: &mut Self::Scratch,
        counters: &mut C,
    ) -> Hit {
        let slabs = Slabs::new(frame);
        let mut best = Best::new(frame);
        let mut waiting = 0;
        let mut node = &self.0.nodes[0];
        let (mut enter, mut leave) = (frame.t_min, frame.t_max);
        loop {
            let axis = (node.word & LEAF) as usize;
            if axis < 3 {
                counters.step_axis();
                let (mut enters, mut leaves) = ([0.0; W], [0.0; W]);
                let (planes, range) = ((&node.planes, axis), (enter, leave));
                let out = (&mut enters, &mut leaves);
                let mut hits = match W {
                    8 => slabs.between::<S, f32x8<S>, W>(simd, planes, range, out),
                    4 => slabs.between::<S, f32x4<S>, W>(simd, planes, range, out),
                    _ => slabs.between_few(planes, range, out),
                };
                hits &= (1 << node.children()) - 1;
                // Those that may be hit go on the stack, the nearest on top.
                let base = waiting;
                while hits != 0 {
                    let lane = hits.trailing_zeros() as usize % W;
                    hits &= hits - 1;
                    let at = make_room(stack, base, &mut waiting, enters[lane]);
                    #[expect(clippy::cast_possible_truncation, reason = "at most 8")]
                    let node = node.link() + lane as u32;
                    stack[at] = Pending {
                        node,
                        enter: enters[lane],
                        leave: leaves[lane],
                    };
                }
            } else {
                let count = node.link() as usize;
                counters.leaf(count);
                if blocks.test_any::<S, Q, C>(
                    simd,
                    (node.planes[0][0].to_bits(), count),
                    scene,
                    (ray, frame, leave),
                    &mut best,
                    counters,
                ) {
                    return best.hit();
                }
            }
            let Some(child) = next(stack, &mut waiting, best.reach) else {
                return best.hit();
            };
            let place;
            (place, enter, leave) = child.within(best.reach);
            node = &self.0.nodes[place as usize];
        }
    }
}
