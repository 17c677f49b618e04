// SPDX-License-Identifier: GPL-3.0-or-later
//! Bounding interval hierarchies whose two planes may be oblique: along the axes, the diagonals of the cube
//! or those of its faces.
//!
//! Wächter and Keller 2006 call oblique planes undesirable, for they doubt that dot products can be trusted
//! as coordinates are. Here their heights are rounded outwards when the tree is built, and each
//! distance moves outwards by a bound on its error when it is walked, which [`super::dop_tree`] derives;
//! so nothing is lost by them, and what they save or cost is a question of time alone.

use super::batch;
use super::blocks::Blocks;
use super::bound::{keep_max, keep_min};
use super::dop_tree::{NORMALS, Planes};
use super::frame::FrameRay;
use super::nested::{Look, Nested, Place};
use super::pending::{Pending, next};
use super::query::{Best, Counters, Query};
use super::ray::{Hit, Ray};
use crate::build::leaves::Leaves;
use crate::build::plane_tree::MAX_DEPTH;
use crate::build::slanted_tree::{self, DIRECTIONS, SlantedTree};
use crate::error::{Error, Result};
use crate::geom::Aabb;
use crate::scene::Triangles;
use fearless_simd::Simd;

/// Instead of a direction: a leaf.
const LEAF: u32 = 15;

/// Set for a node with one child.
const ALONE: u32 = 16;

/// Bits below the link. Above them is the first of the children, which stand side by side, or a leaf's
/// number of triangles.
const LOW_BITS: u32 = 5;

/// No tree has more nodes.
const MOST: usize = 1 << (32 - LOW_BITS);

/// A node: twelve bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Node {
    word: u32,
    /// Bits of two floats; the first is where a leaf's data begins.
    planes: [u32; 2],
}

/// A node, decoded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// A leaf.
    Leaf {
        /// Where its data begins.
        first: u32,
        /// How many triangles it holds.
        count: usize,
    },
    /// An inner node.
    Inner {
        /// A place in [`NORMALS`].
        direction: usize,
        /// Whether it has one child, which lies between the planes. Otherwise the child below ends at the
        /// first plane and the child above, the next one, begins at the second.
        alone: bool,
        /// Heights of the planes.
        planes: [f32; 2],
        /// The child, or the one below.
        link: u32,
    },
}

impl Node {
    const EMPTY: Self = Self {
        word: LEAF,
        planes: [0; 2],
    };

    fn inner(direction: usize, alone: bool, link: usize, planes: [f32; 2]) -> Self {
        let low = u32::try_from(direction).expect("one of thirteen");
        let alone = if alone { ALONE } else { 0 };
        Self {
            word: u32::try_from(link).expect("checked by the layout") << LOW_BITS | low | alone,
            planes: planes.map(f32::to_bits),
        }
    }

    #[inline(always)]
    fn kind(&self) -> Kind {
        let link = self.word >> LOW_BITS;
        if self.word & LEAF == LEAF {
            return Kind::Leaf {
                first: self.planes[0],
                count: link as usize,
            };
        }
        Kind::Inner {
            direction: (self.word & LEAF) as usize,
            alone: self.word & ALONE != 0,
            planes: self.planes.map(f32::from_bits),
            link,
        }
    }
}

/// A hierarchy over a scene.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SlantTree {
    nodes: Vec<Node>,
}

impl SlantTree {
    /// Lays out a tree, its leaves in `leaves`.
    ///
    /// # Errors
    /// [`Error::Memory`] when the tree is more than links can name.
    pub fn new(tree: &SlantedTree, leaves: &mut Leaves) -> Result<Self> {
        if tree.items.len() >= MOST || tree.ids.len() >= 1 << 27 {
            return Err(Error::Memory(format!(
                "the tree would have {} nodes and {} triangles; at most 2^27 are possible",
                tree.items.len(),
                tree.ids.len()
            )));
        }
        let mut nodes = Vec::with_capacity(tree.items.len());
        nodes.push(Node::EMPTY);
        let mut open = vec![(0, 0)];
        let mut next = 0;
        // Items come in preorder, and so do their leaves' triangles.
        while let Some((place, from)) = open.pop() {
            let link = nodes.len();
            nodes[place] = match tree.items[from].kind {
                slanted_tree::Kind::Leaf { count } => {
                    let first = leaves.push(next, count);
                    let count = u32::try_from(count).expect("checked above");
                    next += count;
                    Node {
                        word: count << LOW_BITS | LEAF,
                        planes: [first, 0],
                    }
                }
                slanted_tree::Kind::Only { direction, planes } => {
                    nodes.push(Node::EMPTY);
                    open.push((link, from + 1));
                    Node::inner(direction, true, link, planes)
                }
                slanted_tree::Kind::Pair {
                    direction,
                    planes,
                    above,
                } => {
                    nodes.extend([Node::EMPTY; 2]);
                    open.push((link + 1, from + above));
                    open.push((link, from + 1));
                    Node::inner(direction, false, link, planes)
                }
            };
        }
        Ok(Self { nodes })
    }

    /// The node at a place, the root at 0.
    pub fn kind(&self, place: u32) -> Kind {
        self.nodes[place as usize].kind()
    }

    /// How many nodes there are.
    pub fn node_count(&self) -> usize {
        self.nodes.len()
    }
}

impl Nested for SlantTree {
    fn top(&self) -> Place {
        (0, 0)
    }

    /// A place is the number of the node. Regions are boxes, and oblique planes cut nothing off them: see
    /// [`crate::regions`] for what they leave.
    fn look(&self, (place, _): Place, region: &Aabb, children: &mut Vec<(Place, Aabb)>) -> Look {
        let (direction, alone, planes, link) = match self.kind(place) {
            Kind::Leaf { first, count } => return Look::Leaf { first, count },
            Kind::Inner {
                direction,
                alone,
                planes,
                link,
            } => (direction, alone, planes, link),
        };
        if direction >= 3 {
            children.extend((link..link + 2 - u32::from(alone)).map(|i| ((i, 0), *region)));
            return Look::Boxes;
        }
        let (mut below, mut above) = (*region, *region);
        if alone {
            (below.min[direction], below.max[direction]) = (planes[0], planes[1]);
            children.push(((link, 0), below));
        } else {
            below.max[direction] = planes[0];
            above.min[direction] = planes[1];
            children.extend([((link, 0), below), ((link + 1, 0), above)]);
        }
        Look::Slabs { axis: direction }
    }

    fn bytes(&self) -> usize {
        size_of_val(&*self.nodes)
    }

    fn holds(&self, _: Place, _: [[f32; 3]; 3]) -> bool {
        true
    }
}

/// The walk over one tree.
pub struct Walk<'a>(pub &'a SlantTree);

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
        let nodes = &self.0.nodes[..];
        let slabs = Planes::<DIRECTIONS>::new(frame);
        let mut best = Best::new(frame);
        let mut waiting = 0;
        let mut node = nodes[0];
        let (mut enter, mut leave) = (frame.t_min, frame.t_max);
        loop {
            match node.kind() {
                Kind::Inner {
                    direction,
                    alone,
                    planes,
                    link,
                } => {
                    if direction < 3 {
                        counters.step_axis();
                    } else {
                        counters.step_oblique();
                    }
                    // An only child is entered at the plane where the near one of two is left.
                    let side = usize::from(slabs.flip(direction));
                    let (near, far) = if alone {
                        (planes[side ^ 1], planes[side])
                    } else {
                        (planes[side], planes[side ^ 1])
                    };
                    let ends = keep_min(slabs.latest(direction, near), leave);
                    let begins = keep_max(slabs.soonest(direction, far), enter);
                    if alone {
                        (enter, leave) = (begins, ends);
                        if enter <= leave {
                            node = nodes[link as usize];
                            continue;
                        }
                    } else {
                        let far = link as usize + (side ^ 1);
                        if enter <= ends {
                            if begins <= leave {
                                stack[waiting] = Pending {
                                    node: u32::try_from(far).expect("a link"),
                                    enter: begins,
                                    leave,
                                };
                                waiting += 1;
                            }
                            leave = ends;
                            node = nodes[link as usize + side];
                            continue;
                        }
                        if begins <= leave {
                            enter = begins;
                            node = nodes[far];
                            continue;
                        }
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

/// Whether a triangle lies between all of these planes: direction, height, and whether it lies above.
pub fn between(planes: &[(usize, f32, bool)], corners: [[f32; 3]; 3]) -> bool {
    planes.iter().all(|&(k, plane, above)| {
        corners.iter().all(|p| {
            let n = NORMALS[k];
            let height: f64 = (0..3).map(|i| f64::from(n[i]) * f64::from(p[i])).sum();
            if above {
                height >= f64::from(plane)
            } else {
                height <= f64::from(plane)
            }
        })
    })
}
