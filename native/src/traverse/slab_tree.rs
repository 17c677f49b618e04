// SPDX-License-Identifier: GPL-3.0-or-later
//! Bounding interval hierarchies: at each node parallel planes say where the child below ends and
//! where the child above begins (Wächter and Keller 2006).
//!
//! The walk is that of a kd-tree with the split plane pulled apart: near child, far child, both or,
//! between the two, neither. A fifth case are nodes with one child. Planes are coordinates of
//! triangles and therefore exact; each distance is moved outwards by the frame's `slack` for it,
//! so no child is passed by that the ray might hit in.

use super::batch;
use super::blocks::Blocks;
use super::frame::FrameRay;
use super::nested::{Look, Nested, Place};
use super::pending::{Pending, next};
use super::query::{Best, Counters, Query};
use super::ray::{Hit, Ray};
use super::slab_node::{Kind, MOST, SlabNode};
use crate::build::leaves::Leaves;
use crate::build::object_tree::{self, ObjectTree};
use crate::build::plane_tree::MAX_DEPTH;
use crate::build::tighten::{Sides, Tighten};
use crate::error::{Error, Result};
use crate::geom::Aabb;
use crate::scene::Triangles;
use fearless_simd::Simd;

/// A bounding interval hierarchy over a scene.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SlabTree<N> {
    pub(super) nodes: Vec<N>,
}

impl<N: SlabNode> SlabTree<N> {
    /// Lays out a binary tree over a scene of these bounds, its leaves in `leaves`. Where `tighten`
    /// says so, a node first cuts off empty space: with an `only` child or, where such nodes are not
    /// wanted, with an empty leaf on the other side.
    ///
    /// # Errors
    /// [`Error::Memory`] when the tree is more than links can name.
    pub fn new(
        binary: &ObjectTree,
        bounds: Aabb,
        (tighten, only): (Tighten, bool),
        leaves: &mut Leaves,
    ) -> Result<Self> {
        binary.check_size()?;
        let firsts = binary.firsts();
        let heights = binary.heights();
        let sides = if only { N::ONLY } else { Sides::One };
        let mut nodes = Vec::with_capacity(binary.items.len() + binary.items.len() / 2);
        nodes.push(N::EMPTY);
        // Nodes to fill: their own place, that in `binary`, where its triangles end, region and depth.
        let mut open = vec![(0, 0, binary.ids.len(), bounds, 0)];
        while let Some((place, from, end, region, depth)) = open.pop() {
            let link = nodes.len();
            if link + 2 > MOST {
                return Err(Error::Memory(format!("the tree would have {MOST} nodes")));
            }
            let item = &binary.items[from].bounds;
            let cut = if depth + usize::from(heights[from]) < MAX_DEPTH {
                tighten.cut(sides, &region, item)
            } else {
                None
            };
            if let Some(cut) = cut {
                let (axis, child) = (cut.axis, (from, end, cut.inside, depth + 1));
                nodes[place] = if only {
                    nodes.push(N::EMPTY);
                    open.push((link, child.0, child.1, child.2, child.3));
                    N::only(link, &cut)
                } else {
                    nodes.extend([N::EMPTY; 2]);
                    open.push((link + cut.full, child.0, child.1, child.2, child.3));
                    let mut children = [(*item, 0); 2];
                    // Where the empty side would begin or end, no ray comes.
                    (children[0].0.max[axis], children[1].0.min[axis]) = if cut.full == 0 {
                        (cut.inside.max[axis], f32::MAX)
                    } else {
                        (f32::MIN, cut.inside.min[axis])
                    };
                    N::pair(axis, link, &region, children)
                };
                continue;
            }
            nodes[place] = match binary.kind(from) {
                object_tree::Kind::Leaf { count } => {
                    N::leaf(leaves.push(firsts[from], count), count)
                }
                object_tree::Kind::Inner {
                    axis,
                    children: [below, above],
                } => {
                    nodes.extend([N::EMPTY; 2]);
                    let middle = firsts[above] as usize;
                    let children = [
                        (binary.items[below].bounds, middle - firsts[from] as usize),
                        (binary.items[above].bounds, end - middle),
                    ];
                    let node = N::pair(axis, link, &region, children);
                    let [low, high] = node.parts(axis, &region);
                    open.push((link + 1, above, end, high, depth + 1));
                    open.push((link, below, middle, low, depth + 1));
                    node
                }
            };
        }
        nodes.shrink_to_fit();
        Ok(Self { nodes })
    }
}

impl<N: SlabNode> Nested for SlabTree<N> {
    fn top(&self) -> Place {
        (0, 0)
    }

    /// A place is the number of the node.
    fn look(&self, (place, _): Place, region: &Aabb, children: &mut Vec<(Place, Aabb)>) -> Look {
        let node = self.nodes[place as usize];
        match node.kind() {
            Kind::Leaf { first, count } => Look::Leaf { first, count },
            Kind::Only { axis, link } => {
                children.push(((link, 0), node.parts(axis, region)[0]));
                Look::Slabs { axis }
            }
            Kind::Pair { axis, link } => {
                let [below, above] = node.parts(axis, region);
                children.extend([((link, 0), below), ((link + 1, 0), above)]);
                Look::Slabs { axis }
            }
        }
    }

    fn bytes(&self) -> usize {
        size_of_val(&*self.nodes)
    }
}

/// The walk over one tree.
pub struct Walk<'a, N>(pub &'a SlabTree<N>);

impl<N: SlabNode> batch::Walk for Walk<'_, N> {
    type Scratch = [Pending; MAX_DEPTH + 1];

    fn scratch(&self) -> Self::Scratch {
        [Pending::default(); MAX_DEPTH + 1]
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
        let nodes = &self.0.nodes[..];
        let mut best = Best::new(frame);
        let mut waiting = 0;
        let mut node = nodes[0];
        let (mut enter, mut leave) = (frame.t_min, frame.t_max);
        loop {
            match node.kind() {
                Kind::Pair { axis, link } => {
                    counters.step_axis();
                    let (ends, begins) = node.intervals(axis, frame, (enter, leave));
                    let side = frame.negative[axis];
                    let far = link + (side ^ 1);
                    if enter <= ends {
                        if begins <= leave {
                            stack[waiting] = Pending {
                                node: far,
                                enter: begins,
                                leave,
                            };
                            waiting += 1;
                        }
                        leave = ends;
                        node = nodes[(link + side) as usize];
                        continue;
                    }
                    if begins <= leave {
                        enter = begins;
                        node = nodes[far as usize];
                        continue;
                    }
                }
                Kind::Only { axis, link } => {
                    counters.step_axis();
                    (leave, enter) = node.intervals(axis, frame, (enter, leave));
                    if enter <= leave {
                        node = nodes[link as usize];
                        continue;
                    }
                }
                Kind::Leaf { first, count } => {
                    counters.leaf(count);
                    if blocks.test_any::<S, Q, C>(
                        simd,
                        (first, count),
                        scene,
                        (ray, frame, leave),
                        &mut best,
                        counters,
                    ) {
                        return best.hit();
                    }
                }
            }
            let Some(child) = next(stack, &mut waiting, best.reach) else {
                return best.hit();
            };
            let place;
            (place, enter, leave) = child.within(best.reach);
            node = nodes[place as usize];
        }
    }
}
