// SPDX-License-Identifier: GPL-3.0-or-later
//! Bounding interval hierarchies: at each node two parallel planes, one where the child below ends
//! and one where the child above begins (Wächter and Keller 2006). Twelve bytes a node.
//!
//! The walk is that of a kd-tree with the split plane pulled apart: near child, far child, both or,
//! between the two, neither. Planes are coordinates of triangles and therefore exact; each distance
//! is moved outwards by the frame's `slack` for it, so no child is passed by that the ray might
//! hit in.

use super::batch;
use super::blocks::Blocks;
use super::frame::{Frame, FrameRay, keep_max, keep_min};
use super::nested::{Look, Nested, Place};
use super::query::{Best, Counters, Query};
use super::ray::{Hit, Ray};
use crate::build::object_tree::{Kind, ObjectTree};
use crate::build::plane_tree::MAX_DEPTH;
use crate::error::Result;
use crate::geom::Aabb;
use crate::scene::Triangles;
use crate::traverse::box_tree::check_size;
use fearless_simd::Simd;

/// Instead of an axis: a leaf.
const LEAF: u32 = 3;

/// Bits below the link.
const LOW_BITS: u32 = 2;

/// A node. The low bits of `link` are the axis, above them is the first of two children that stand
/// side by side; for a leaf, its number of triangles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Node {
    link: u32,
    /// Bits of two floats: where the child below ends, where the child above begins. The first is
    /// where a leaf's blocks begin.
    planes: [u32; 2],
}

/// A bounding interval hierarchy over a scene.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SlabTree {
    nodes: Vec<Node>,
}

impl SlabTree {
    /// Lays out a binary tree, its leaves' triangles in `blocks`.
    ///
    /// # Errors
    /// [`crate::error::Error::Memory`] when the tree is more than links can name.
    pub fn new(
        binary: &ObjectTree,
        scene: &Triangles,
        frame: &Frame,
        blocks: &mut Blocks,
    ) -> Result<Self> {
        check_size(binary)?;
        let firsts = binary.firsts();
        let mut nodes = Vec::with_capacity(binary.items.len());
        let blank = Node {
            link: LEAF,
            planes: [0; 2],
        };
        nodes.push(blank);
        // Nodes to fill: their own place and that in `binary`.
        let mut open = vec![(0, 0)];
        while let Some((place, from)) = open.pop() {
            nodes[place] = match binary.kind(from) {
                Kind::Leaf { count } => {
                    let first = firsts[from] as usize;
                    let ids = &binary.ids[first..first + count];
                    Node {
                        link: low(count) << LOW_BITS | LEAF,
                        planes: [blocks.push_leaf(scene, frame, ids), 0],
                    }
                }
                Kind::Inner {
                    axis,
                    children: [below, above],
                } => {
                    let first = nodes.len();
                    nodes.extend([blank; 2]);
                    open.extend([(first + 1, above), (first, below)]);
                    let planes = [
                        binary.items[below].bounds.max[axis],
                        binary.items[above].bounds.min[axis],
                    ];
                    Node {
                        link: low(first) << LOW_BITS | low(axis),
                        planes: planes.map(f32::to_bits),
                    }
                }
            };
        }
        blocks.seal();
        Ok(Self { nodes })
    }
}

fn low(x: usize) -> u32 {
    u32::try_from(x).expect("fewer than 2^29 nodes")
}

impl Nested for SlabTree {
    fn top(&self) -> Place {
        (0, 0)
    }

    /// A place is the number of the node.
    fn look(&self, (node, _): Place, region: &Aabb, children: &mut Vec<(Place, Aabb)>) -> Look {
        let Node { link, planes } = self.nodes[node as usize];
        let axis = link & LEAF;
        let link = link >> LOW_BITS;
        if axis == LEAF {
            return Look::Leaf {
                first: planes[0],
                count: link as usize,
            };
        }
        let axis = axis as usize;
        let (mut below, mut above) = (*region, *region);
        below.max[axis] = f32::from_bits(planes[0]);
        above.min[axis] = f32::from_bits(planes[1]);
        children.extend([((link, 0), below), ((link + 1, 0), above)]);
        Look::Slabs { axis }
    }

    fn bytes(&self) -> usize {
        size_of_val(&*self.nodes)
    }
}

/// A child still to visit, and the interval of the ray inside it.
#[derive(Clone, Copy, Default)]
pub struct Pending {
    node: u32,
    enter: f32,
    leave: f32,
}

/// The walk over one tree.
pub struct Walk<'a>(pub &'a SlabTree);

impl batch::Walk for Walk<'_> {
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
        let mut best = Best::new(frame);
        let mut waiting = 0;
        let mut node = self.0.nodes[0];
        let (mut enter, mut leave) = (frame.t_min, frame.t_max);
        loop {
            let axis = (node.link & LEAF) as usize;
            let link = node.link >> LOW_BITS;
            if axis < 3 {
                counters.step_axis();
                let side = frame.negative[axis];
                let distance = |side: u32| {
                    let plane = f32::from_bits(node.planes[side as usize & 1]);
                    (plane - frame.o[axis]) * frame.inv[axis]
                };
                // NaN leaves the whole interval to the child.
                let ends = keep_min(distance(side) + frame.slack[axis], leave);
                let begins = keep_max(distance(side ^ 1) - frame.slack[axis], enter);
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
                    node = self.0.nodes[(link + side) as usize];
                    continue;
                }
                if begins <= leave {
                    enter = begins;
                    node = self.0.nodes[far as usize];
                    continue;
                }
            } else {
                let count = link as usize;
                counters.leaf(count);
                if blocks.test::<S, Q, C>(
                    simd,
                    (node.planes[0], count),
                    scene,
                    (ray, frame, leave),
                    &mut best,
                    counters,
                ) {
                    return best.hit();
                }
            }
            loop {
                if waiting == 0 {
                    return best.hit();
                }
                waiting -= 1;
                let next = stack[waiting];
                if next.enter <= best.reach {
                    node = self.0.nodes[next.node as usize];
                    (enter, leave) = (next.enter, keep_min(best.reach, next.leave));
                    break;
                }
            }
        }
    }
}
