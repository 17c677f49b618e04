// SPDX-License-Identifier: GPL-3.0-or-later
//! Trees of boxes, laid out `W` children to a node: the boxes of all children come with one fetch and
//! are tested at once (Wald, Benthin and Boulos 2008; Dammertz, Hanika and Keller 2008).
//!
//! The walk visits the nearest box first and keeps the others on a stack, farthest deepest.
//! Distances are `bound * inv - o * inv`, moved outwards by the frame's `slack`: that covers the
//! roundings of the products, of their difference and of the reciprocal, so a box is passed by
//! only when the ray certainly misses it or certainly reaches it too late.

use super::batch;
use super::blocks::Blocks;
use super::bound::{keep_max, keep_max_each, keep_min, keep_min_each};
use super::frame::FrameRay;
use super::nested::{Look, Nested, Place};
use super::pending::{Waits, make_room};
use super::query::{Best, Counters, Query};
use super::ray::{Hit, Ray};
use crate::build::leaves::Leaves;
use crate::build::object_tree::{Kind, ObjectTree};
use crate::build::plane_tree::MAX_DEPTH;
use crate::error::Result;
use crate::geom::Aabb;
use crate::scene::Triangles;
use fearless_simd::{Simd, SimdFloat, SimdMask, f32x4, f32x8};
use prefetch_index::prefetch_index;

/// More children than this no node has.
const WIDEST: usize = 8;

/// Instead of a count: the link leads to an inner node.
pub(super) const INNER: u32 = u32::MAX;

/// A node: 32 bytes a child.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(64))]
pub(super) struct Wide<const W: usize> {
    /// Rows: lowest x, y, z, highest x, y, z of each child's box.
    pub(super) bounds: [[f32; W]; 6],
    /// An inner child's place, or where a leaf's blocks begin.
    pub(super) link: [u32; W],
    /// A leaf's number of triangles, or [`INNER`].
    pub(super) count: [u32; W],
}

impl<const W: usize> Wide<W> {
    /// Asks for the node, so that it is in the caches when it is stepped through.
    #[inline(always)]
    pub(super) fn fetch_ahead(&self) {
        // A cache line holds sixteen numbers.
        for row in (0..6).step_by(16 / W) {
            prefetch_index(self.bounds[row].as_slice(), 0);
        }
        prefetch_index(self.link.as_slice(), 0);
    }
}

/// A tree of boxes over a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct BoxTree<const W: usize> {
    pub(super) nodes: Vec<Wide<W>>,
}

impl<const W: usize> BoxTree<W> {
    /// A node without children.
    pub(super) const BLANK: Wide<W> = Wide {
        bounds: [
            [f32::MAX; W],
            [f32::MAX; W],
            [f32::MAX; W],
            [f32::MIN; W],
            [f32::MIN; W],
            [f32::MIN; W],
        ],
        link: [0; W],
        count: [0; W],
    };

    /// Lays out a tree of objects, its leaves in `leaves`. A node takes the place of up to `W - 1` binary ones: while it has
    /// room, its largest inner child is replaced by that child's own children.
    ///
    /// # Errors
    /// [`crate::error::Error::Memory`] when the leaf data is more than links can name.
    pub fn new(binary: &ObjectTree, leaves: &mut Leaves) -> Result<Self> {
        binary.check_size()?;
        let firsts = binary.firsts();
        let mut nodes = vec![Self::BLANK];
        // Nodes to fill, the next one last: their own place and their children's places in `binary`.
        let mut open = vec![(0, Self::children(binary, 0))];
        while let Some((place, children)) = open.pop() {
            let mut node = Self::BLANK;
            let mut inner = Vec::with_capacity(W);
            for (lane, &child) in children.iter().enumerate() {
                let bounds = binary.items[child].bounds;
                for k in 0..3 {
                    node.bounds[k][lane] = bounds.min[k];
                    node.bounds[3 + k][lane] = bounds.max[k];
                }
                (node.link[lane], node.count[lane]) = match binary.kind(child) {
                    Kind::Leaf { count } => {
                        let number = u32::try_from(count).expect("bounded by the scene");
                        (leaves.push(firsts[child], count), number)
                    }
                    Kind::Inner { .. } => {
                        let own = nodes.len();
                        inner.push((own, Self::children(binary, child)));
                        nodes.push(Self::BLANK);
                        (u32::try_from(own).expect("bounded by the scene"), INNER)
                    }
                };
            }
            nodes[place] = node;
            open.extend(inner.into_iter().rev());
        }
        nodes.shrink_to_fit();
        Ok(Self { nodes })
    }

    /// The up to `W` descendants that become the children of the node at `place`.
    fn children(binary: &ObjectTree, place: usize) -> Vec<usize> {
        let mut children = vec![place];
        while children.len() < W {
            let inner = (children.iter().enumerate()).filter_map(|(i, &child)| {
                let Kind::Inner { children, .. } = binary.kind(child) else {
                    return None;
                };
                Some((i, children, binary.items[child].bounds.area()))
            });
            let Some((i, [below, above], _)) = inner.reduce(|a, b| if b.2 > a.2 { b } else { a })
            else {
                break;
            };
            children[i] = below;
            children.insert(i + 1, above);
        }
        children
    }

    /// Asks for the child with this link and this count, so that it is in the caches when its turn comes.
    #[inline(always)]
    pub(super) fn fetch_ahead(&self, (link, count): (u32, u32), blocks: &Blocks) {
        if count == INNER {
            self.nodes[link as usize].fetch_ahead();
        } else {
            blocks.fetch_ahead(link);
        }
    }
}

impl<const W: usize> Nested for BoxTree<W> {
    fn top(&self) -> Place {
        (0, INNER)
    }

    /// A place is link and count, as nodes state them.
    fn look(&self, (link, count): Place, _: &Aabb, children: &mut Vec<(Place, Aabb)>) -> Look {
        if count != INNER {
            let count = count as usize;
            return Look::Leaf { first: link, count };
        }
        let node = &self.nodes[link as usize];
        for lane in 0..W {
            let bounds = Aabb {
                min: [0, 1, 2].map(|k| node.bounds[k][lane]),
                max: [3, 4, 5].map(|k| node.bounds[k][lane]),
            };
            if !bounds.is_empty() {
                children.push(((node.link[lane], node.count[lane]), bounds));
            }
        }
        Look::Boxes
    }

    fn bytes(&self) -> usize {
        size_of_val(&*self.nodes)
    }
}

/// What slab tests need of a ray: a plane `x_k = p` lies at `p * inv + near` or a little later, and at
/// `p * inv + far` or a little sooner.
#[derive(Debug, Clone, Copy)]
pub struct Slabs {
    /// Reciprocal direction.
    pub inv: [f32; 3],
    /// To add for a plane through which the ray enters.
    pub near: [f32; 3],
    /// To add for a plane through which it leaves.
    pub far: [f32; 3],
    /// Which row of a node's bounds holds the planes of entry; the other one is 3 away.
    entry: [usize; 3],
}

impl Slabs {
    /// Of a ray.
    #[inline(always)]
    pub fn new(ray: &FrameRay) -> Self {
        let mut slabs = Self {
            inv: ray.inv,
            near: [0.0; 3],
            far: [0.0; 3],
            entry: [0; 3],
        };
        for k in 0..3 {
            let shift = ray.o[k] * ray.inv[k];
            // Where a product with any coordinate might overflow, the axis decides nothing.
            if (ray.span * ray.inv[k]).is_finite() && (ray.slack[k] + shift.abs()).is_finite() {
                slabs.near[k] = -shift - ray.slack[k];
                slabs.far[k] = -shift + ray.slack[k];
            } else {
                slabs.inv[k] = 0.0;
                slabs.near[k] = f32::NEG_INFINITY;
                slabs.far[k] = f32::INFINITY;
            }
            slabs.entry[k] = if ray.negative[k] == 1 { 3 + k } else { k };
        }
        slabs
    }

    /// Which of two rows, lowest and highest planes, holds those of entry.
    #[inline(always)]
    pub fn entry_row(&self, axis: usize) -> usize {
        usize::from(self.entry[axis] >= 3)
    }

    /// Where the ray enters a box that it may hit something in before `reach`.
    #[inline(always)]
    pub fn meet(&self, bounds: &Aabb, (start, reach): (f32, f32)) -> Option<f32> {
        let (mut enter, mut leave) = (start, reach);
        for k in 0..3 {
            let (near, far) = if self.entry[k] < 3 {
                (bounds.min[k], bounds.max[k])
            } else {
                (bounds.max[k], bounds.min[k])
            };
            enter = keep_max(near * self.inv[k] + self.near[k], enter);
            leave = keep_min(far * self.inv[k] + self.far[k], leave);
        }
        (enter <= leave).then_some(enter)
    }

    /// Where the ray enters and leaves the boxes of the lanes of `V`; it misses those that it leaves before it enters,
    /// or enters beyond `reach`.
    #[inline(always)]
    pub fn meet_all<S: Simd, V: SimdFloat<S, Element = f32>, const W: usize>(
        &self,
        simd: S,
        bounds: &[[f32; W]; 6],
        (start, reach): (f32, f32),
    ) -> (V, V) {
        let splat = |x: f32| V::splat(simd, x);
        let mut enter = splat(start);
        let mut leave = splat(reach);
        for k in 0..3 {
            let row = self.entry[k];
            let near = V::from_slice(simd, &bounds[row]);
            let far = V::from_slice(simd, &bounds[(row + 3) % 6]);
            let inv = splat(self.inv[k]);
            enter = keep_max_each(near.mul_add(inv, splat(self.near[k])), enter);
            leave = keep_min_each(far.mul_add(inv, splat(self.far[k])), leave);
        }
        (enter, leave)
    }

    /// Where the ray enters the boxes of the lanes of `V`, and a bit for each that it may hit before
    /// `reach`.
    #[inline(always)]
    fn test<S: Simd, V: SimdFloat<S, Element = f32>, const W: usize>(
        &self,
        simd: S,
        bounds: &[[f32; W]; 6],
        range: (f32, f32),
        enters: &mut [f32; W],
    ) -> u64 {
        let (enter, leave): (V, V) = self.meet_all(simd, bounds, range);
        enter.store_slice(enters);
        enter.simd_le(leave).to_bitmask()
    }

    /// The same for two boxes, for which no vector is that short.
    #[inline(always)]
    fn test_few<const W: usize>(
        &self,
        bounds: &[[f32; W]; 6],
        (start, reach): (f32, f32),
        enters: &mut [f32; W],
    ) -> u64 {
        *enters = [start; W];
        let mut leaves = [reach; W];
        for k in 0..3 {
            let (near, far) = (&bounds[self.entry[k]], &bounds[(self.entry[k] + 3) % 6]);
            for lane in 0..W {
                let enter = near[lane] * self.inv[k] + self.near[k];
                let leave = far[lane] * self.inv[k] + self.far[k];
                enters[lane] = keep_max(enter, enters[lane]);
                leaves[lane] = keep_min(leave, leaves[lane]);
            }
        }
        (0..W).fold(0, |mask, lane| {
            mask | u64::from(enters[lane] <= leaves[lane]) << lane
        })
    }
}

/// A box still to visit.
#[derive(Debug, Clone, Copy, Default)]
pub struct Pending {
    pub(super) enter: f32,
    pub(super) link: u32,
    pub(super) count: u32,
}

impl Waits for Pending {
    #[inline(always)]
    fn enter(&self) -> f32 {
        self.enter
    }
}

/// The walk over one tree.
pub struct Walk<'a, const W: usize>(pub &'a BoxTree<W>);

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
        loop {
            // Test all children, and put those that may be hit on the stack, the nearest on top.
            counters.step_axis();
            let mut enters = [0.0; W];
            let range = (frame.t_min, best.reach);
            let mut hits = match W {
                8 => slabs.test::<S, f32x8<S>, W>(simd, &node.bounds, range, &mut enters),
                4 => slabs.test::<S, f32x4<S>, W>(simd, &node.bounds, range, &mut enters),
                _ => slabs.test_few(&node.bounds, range, &mut enters),
            };
            let child = |lane: usize| Pending {
                enter: enters[lane],
                link: node.link[lane],
                count: node.count[lane],
            };
            let mut ahead = None;
            let base = waiting;
            let first = hits.trailing_zeros() as usize % W;
            if hits & hits.wrapping_sub(1) == 0 {
                // Most often one is met, or none, and there is nothing to put in order. It is a box: a ray that meets
                // places without one meets all places.
                ahead = (hits != 0).then(|| child(first));
                hits = 0;
            }
            while hits != 0 {
                let lane = hits.trailing_zeros() as usize % W;
                hits &= hits - 1;
                // A ray of which no axis decides anything meets places without a box, too.
                if node.count[lane] == 0 {
                    continue;
                }
                let waits = child(lane);
                self.0.fetch_ahead((waits.link, waits.count), blocks);
                let at = make_room(stack, base, &mut waiting, enters[lane]);
                stack[at] = waits;
            }

            // Go on with the nearest box; leaves are tested until an inner node comes up.
            node = loop {
                let next = match ahead.take() {
                    Some(next) => next,
                    None if waiting == 0 => return best.hit(),
                    None => {
                        waiting -= 1;
                        stack[waiting]
                    }
                };
                if next.enter > best.reach {
                    continue;
                }
                if next.count == INNER {
                    break &self.0.nodes[next.link as usize];
                }
                let count = next.count as usize;
                counters.leaf(count);
                if blocks.test::<S, Q, C>(
                    simd,
                    (next.link, count),
                    scene,
                    (ray, frame, frame.t_max),
                    &mut best,
                    counters,
                ) {
                    return best.hit();
                }
            };
        }
    }
}
