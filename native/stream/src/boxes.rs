// SPDX-License-Identifier: GPL-3.0-or-later
//! Streams through nodes of eight boxes. The children of a node lie in slots named by its corners, so the rays of
//! one octant share an order, the one of [`halfspace_single::steps::boxes`]. At a turned node each ray is turned as
//! [`halfspace_single::objects::obb`] does it.

use crate::blockers::gather;
use crate::lists::{Entry, Stream, small};
use crate::ray_state::{Line, RayState};
use crate::{OCTANTS, Steps};
use fearless_simd::{
    Bytes, Simd, SimdBase, SimdMask, f32x8, f32x16, mask32x8, mask32x16, u8x16, u32x8, u32x16,
    u64x2,
};
use halfspace_leaf::Leaf;
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::Tree;
use halfspace_nodes::box_corners::rank;
use halfspace_nodes::box_tree::{BoxTree, INNER, Wide};
use halfspace_nodes::obb_tree::{Boxes, Inner, ObbTree};
use halfspace_ray::Interval;
use halfspace_ray::query::Counters;
use halfspace_single::objects::obb::Turned;

/// Number of children of a node.
const CHILDREN: usize = 8;

/// Number of rays of a list whose masks are distributed at once.
const GROUP: usize = 16;

/// Length of lists that take eight lanes.
const FEW: usize = 8;

/// For each octant and each mask of children, the same mask in stack order, the farthest child in the lowest
/// bit: child `c` has bit [`rank`].
static RANKED: [[u8; 1 << CHILDREN]; OCTANTS] = ranked();

const fn ranked() -> [[u8; 1 << CHILDREN]; OCTANTS] {
    let mut table = [[0; 1 << CHILDREN]; OCTANTS];
    let mut octant = 0;
    while octant < OCTANTS {
        let mut mask = 0;
        while mask < 1 << CHILDREN {
            let mut child = 0;
            while child < CHILDREN {
                table[octant][mask] |= ((mask >> child & 1) << rank(octant, child)) as u8;
                child += 1;
            }
            mask += 1;
        }
        octant += 1;
    }
    table
}

/// A child of a node.
#[derive(Clone, Copy)]
pub struct Child {
    /// Link and count, as in the node.
    link: u32,
    count: u32,
    /// Sides of its box through which the rays enter; NaN, which bounds nothing, for a turned box.
    near: [f32; 3],
}

impl Child {
    /// The root of a tree: NaN bounds nothing, so all rays enter it.
    fn root(count: u32) -> Self {
        Self {
            link: 0,
            count,
            near: [f32::NAN; 3],
        }
    }

    /// The index of an inner node.
    #[inline(always)]
    pub fn index(&self) -> usize {
        self.link as usize
    }
}

impl Steps for BoxTree<CHILDREN> {
    type Node = Child;
    type Scratch<S: Simd> = Vec<u8x16<S>>;
    const INTERVALS: bool = false;

    fn root(&self) -> Child {
        Child::root(INNER)
    }

    #[inline(always)]
    fn leaf(&self, child: &Child) -> Option<Leaf> {
        (child.count != INNER).then_some(Leaf {
            first: child.link,
            count: child.count as usize,
        })
    }

    #[inline(always)]
    fn fetch_ahead(&self, child: &Child, blocks: &Blocks) {
        BoxTree::fetch_ahead(self, child.link, child.count, blocks);
    }

    #[inline(always)]
    fn enters(child: &Child, line: &Line) -> bool {
        line.enters(child.near)
    }

    #[inline(always)]
    fn count<C: Counters>(&self, _: &Child, counters: &mut C) {
        counters.step_boxes();
    }

    #[inline(always)]
    fn visit<S: Simd>(
        &self,
        simd: S,
        stream: &mut Stream<Child>,
        own: Entry<Child>,
        states: &[RayState],
        masks: &mut Vec<u8x16<S>>,
    ) {
        let order = Corners(stream.octant);
        let node = &self.nodes[own.node.index()];
        visit(simd, node, order, stream, own, states, masks);
    }

    fn bytes(&self) -> usize {
        size_of_val(&*self.nodes)
    }
}

impl Steps for ObbTree {
    type Node = Child;
    type Scratch<S: Simd> = Vec<u8x16<S>>;
    const INTERVALS: bool = false;
    const INDICES: bool = true;

    fn root(&self) -> Child {
        Child::root(self.root)
    }

    #[inline(always)]
    fn leaf(&self, child: &Child) -> Option<Leaf> {
        (self.inner(child.link, child.count).is_none()).then_some(Leaf {
            first: child.link,
            count: child.count as usize,
        })
    }

    #[inline(always)]
    fn fetch_ahead(&self, child: &Child, blocks: &Blocks) {
        Boxes::fetch_ahead(self, child.link, child.count, blocks);
    }

    #[inline(always)]
    fn enters(child: &Child, line: &Line) -> bool {
        line.enters(child.near)
    }

    #[inline(always)]
    fn count<C: Counters>(&self, child: &Child, counters: &mut C) {
        match self.inner(child.link, child.count) {
            Some(Inner { rotation: None, .. }) => counters.step_boxes(),
            _ => counters.step_oblique(),
        }
    }

    #[inline(always)]
    fn visit<S: Simd>(
        &self,
        simd: S,
        stream: &mut Stream<Child>,
        own: Entry<Child>,
        states: &[RayState],
        masks: &mut Vec<u8x16<S>>,
    ) {
        let order = Corners(stream.octant);
        let Some(Inner { node, rotation }) = self.inner(own.node.link, own.node.count) else {
            return;
        };
        let Some(rotation) = rotation else {
            visit(simd, node, order, stream, own, states, masks);
            return;
        };
        if ends_before(stream, &own, states) {
            return;
        }
        let parent = Parent { node, turned: true };
        spread(
            simd,
            parent,
            order,
            stream,
            own,
            masks,
            #[inline(always)]
            |ray| {
                let state = &states[ray as usize];
                let ([o_x, o_y, o_z, pad], [d_x, d_y, d_z, _]) = (state.origin, state.direction);
                let line = [[o_x, o_y, o_z], [d_x, d_y, d_z]];
                let turned = Turned::new(simd, rotation, line, pad);
                let within = Interval::new(state.line.start, state.line.reach());
                turned.test(simd, &node.bounds, within, &mut [0.0; CHILDREN])
            },
        );
    }

    fn bytes(&self) -> usize {
        Tree::bytes(self)
    }
}

/// The order in which the children of a node are visited.
pub trait Order: Copy {
    /// Turns a mask of children into one of their positions on the stack; the highest position is visited first.
    fn positions(self, children: u64) -> u64;

    /// The child at a position.
    fn child(self, position: usize) -> usize;

    /// Removes the lowest position of a mask and returns its child.
    #[inline(always)]
    fn take(self, left: &mut u64) -> Option<usize> {
        if *left == 0 {
            return None;
        }
        let child = self.child(left.trailing_zeros() as usize % CHILDREN);
        *left &= *left - 1;
        Some(child)
    }
}

/// The child at the corner that rays of an octant come from first.
#[derive(Clone, Copy)]
pub struct Corners(pub usize);

impl Order for Corners {
    #[inline(always)]
    fn positions(self, children: u64) -> u64 {
        u64::from(RANKED[self.0 % OCTANTS][children as usize % (1 << CHILDREN)])
    }

    #[inline(always)]
    fn child(self, position: usize) -> usize {
        rank(self.0 % OCTANTS, position) % CHILDREN
    }
}

/// An inner node whose boxes rays are tested against.
#[derive(Clone, Copy)]
struct Parent<'a> {
    node: &'a Wide<CHILDREN>,
    /// Whether its boxes lie along other directions than the axes.
    turned: bool,
}

impl Parent<'_> {
    /// A child for rays of an octant.
    #[inline(always)]
    fn child(&self, octant: usize, child: usize) -> Child {
        let node = self.node;
        let side = |k: usize| {
            if self.turned {
                f32::NAN
            } else {
                node.bounds[k + 3 * (octant >> k & 1)][child]
            }
        };
        Child {
            link: node.link[child],
            count: node.count[child],
            near: [side(0), side(1), side(2)],
        }
    }
}

/// Visits an inner node of boxes along the axes, whose children are visited in this order.
#[inline(always)]
pub fn visit<S: Simd>(
    simd: S,
    node: &Wide<CHILDREN>,
    order: impl Order,
    stream: &mut Stream<Child>,
    own: Entry<Child>,
    states: &[RayState],
    masks: &mut Vec<u8x16<S>>,
) {
    if ends_before(stream, &own, states) {
        return;
    }
    let sides = Sides::new(simd, node, stream.octant);
    let parent = Parent {
        node,
        turned: false,
    };
    spread(
        simd,
        parent,
        order,
        stream,
        own,
        masks,
        #[inline(always)]
        |ray| (states[ray as usize].line).meets(simd, &sides.near, &sides.far),
    );
}

/// Whether the only ray of a node has its best hit before it.
#[inline(always)]
fn ends_before(stream: &Stream<Child>, own: &Entry<Child>, states: &[RayState]) -> bool {
    let first = || stream.lists[own.first as usize] as usize;
    own.rays == 1 && !states[first()].line.enters(own.node.near)
}

/// Spreads the rays of a node over its children; `meets` returns the mask of the children that a ray meets.
#[inline(always)]
fn spread<S: Simd>(
    simd: S,
    node: Parent<'_>,
    order: impl Order,
    stream: &mut Stream<Child>,
    own: Entry<Child>,
    masks: &mut Vec<u8x16<S>>,
    meets: impl Fn(u32) -> u64,
) {
    let list = stream.list(&own);
    if own.rays == 1 {
        let mut left = order.positions(meets(list[0]));
        while let Some(child) = order.take(&mut left) {
            // All children share the parent's list.
            push(stream, node, child, own.first, 1);
        }
    } else if own.rays as usize <= FEW {
        let mut word = 0;
        for (i, &ray) in list.iter().enumerate().take(FEW) {
            word |= meets(ray) << (8 * i);
        }
        distribute_few(simd, stream, node, order, own, word);
    } else if own.rays as usize <= GROUP {
        // Keep the masks in registers: a vector load of bytes just stored one by one would stall.
        let Met { masks, some } = met(simd, list, &meets);
        let masks = std::slice::from_ref(&masks);
        distribute(simd, stream, node, order, own, masks, some);
    } else {
        masks.resize(list.len().div_ceil(GROUP), u8x16::splat(simd, 0));
        let mut some = 0;
        for (masks, group) in masks.iter_mut().zip(list.chunks(GROUP)) {
            let met = met(simd, group, &meets);
            *masks = met.masks;
            some |= met.some;
        }
        distribute(simd, stream, node, order, own, masks, some);
    }
}

/// The union of the eight bytes of a word.
#[inline(always)]
fn union(mut bytes: u64) -> u64 {
    bytes |= bytes >> 32;
    bytes |= bytes >> 16;
    bytes |= bytes >> 8;
    bytes & 0xff
}

/// Makes room for the lists of these many children of a node behind its own of `rays` rays from `first`, the last one:
/// those of all stack entries lie below. Returns where they begin.
#[inline(always)]
fn room_behind(stream: &mut Stream<Child>, first: usize, rays: usize, children: usize) -> usize {
    let behind = first + rays;
    stream.make_room(behind + children * rays, false);
    behind
}

/// Distributes a list of at most eight rays over the children that they meet: byte `i` of `word` is the mask of ray
/// `i`. Without AVX-512 sixteen lanes take more than twice the time of eight to compress, and most lists are short.
#[inline(always)]
fn distribute_few<S: Simd>(
    simd: S,
    stream: &mut Stream<Child>,
    node: Parent<'_>,
    order: impl Order,
    own: Entry<Child>,
    word: u64,
) {
    let mut left = order.positions(union(word));
    let (first, rays) = (own.first as usize, own.rays as usize);
    let mut top = room_behind(stream, first, rays, left.count_ones() as usize);
    let list = u32x8::from_slice(simd, &stream.lists[first..first + FEW]);
    // Write each child's list by compressing the parent's under the child's bit, then push the child.
    while let Some(child) = order.take(&mut left) {
        let lanes = gather(word >> child);
        let live = mask32x8::from_bitmask(simd, lanes);
        list.compress(live)
            .store_slice(&mut stream.lists[top..top + FEW]);
        let begins = top;
        top += lanes.count_ones() as usize;
        push(stream, node, child, small(begins), small(top - begins));
    }
}

/// The sides of entry and exit of all boxes of a node, which are common to an octant.
struct Sides<S: Simd> {
    near: [f32x8<S>; 3],
    far: [f32x8<S>; 3],
}

impl<S: Simd> Sides<S> {
    #[inline(always)]
    fn new(simd: S, node: &Wide<CHILDREN>, octant: usize) -> Self {
        let octant = octant % OCTANTS;
        let zero = f32x8::splat(simd, 0.0);
        let (mut near, mut far) = ([zero; 3], [zero; 3]);
        for k in 0..3 {
            let back = octant >> k & 1;
            near[k] = f32x8::from_slice(simd, &node.bounds[k + 3 * back]);
            far[k] = f32x8::from_slice(simd, &node.bounds[k + 3 * (1 - back)]);
        }
        Self { near, far }
    }
}

/// Pushes a child with its list of rays.
#[inline(always)]
fn push(stream: &mut Stream<Child>, parent: Parent<'_>, child: usize, first: u32, rays: u32) {
    let node = parent.child(stream.octant, child);
    // A ray whose bounds are NaN on every axis meets missing children, too.
    stream.push(Entry { node, first, rays }, node.count != 0);
}

/// Distributes a list over the children that its rays meet: `masks` has one byte per ray, `some` is their
/// union.
#[inline(always)]
fn distribute<S: Simd>(
    simd: S,
    stream: &mut Stream<Child>,
    node: Parent<'_>,
    order: impl Order,
    own: Entry<Child>,
    masks: &[u8x16<S>],
    some: u64,
) {
    let mut left = order.positions(some);
    let (first, rays) = (own.first as usize, own.rays as usize);
    let mut top = room_behind(stream, first, rays, left.count_ones() as usize);
    // Write each child's list by compressing the parent's under the child's bit, then push the child.
    while let Some(child) = order.take(&mut left) {
        let bit = u8x16::splat(simd, 1 << child);
        let begins = top;
        for (group, masks) in masks.iter().enumerate() {
            let lanes = (*masks & bit).simd_eq(bit).to_bitmask();
            let live = mask32x16::from_bitmask(simd, lanes);
            let from = first + GROUP * group;
            let own = u32x16::from_slice(simd, &stream.lists[from..from + GROUP]);
            let own: f32x16<S> = own.bitcast();
            let own: u32x16<S> = own.compress(live).bitcast();
            own.store_slice(&mut stream.lists[top..top + GROUP]);
            top += lanes.count_ones() as usize;
        }
        push(stream, node, child, small(begins), small(top - begins));
    }
}

/// The boxes that up to sixteen rays meet.
struct Met<S: Simd> {
    /// One mask of boxes per ray.
    masks: u8x16<S>,
    /// Their union.
    some: u64,
}

/// Tests at most sixteen rays against eight boxes.
#[inline(always)]
fn met<S: Simd>(simd: S, list: &[u32], meets: &impl Fn(u32) -> u64) -> Met<S> {
    let mut words = [0_u64; 2];
    for (word, rays) in words.iter_mut().zip(list.chunks(8)) {
        for (i, &ray) in rays.iter().enumerate() {
            *word |= meets(ray) << (8 * i);
        }
    }
    let some = union(words[0] | words[1]);
    // Little-endian words put the first ray into the vector's lowest byte on every machine.
    let words = words.map(u64::to_le);
    Met {
        masks: u64x2::from_slice(simd, &words).bitcast(),
        some,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::{Level, dispatch};

    /// The hits do not depend on the order, only the speed does; so it is tested here.
    #[test]
    fn the_child_at_the_nearest_corner_is_visited_first() {
        let mut node = BoxTree::<CHILDREN>::BLANK;
        for child in 0..CHILDREN {
            for k in 0..3 {
                (node.bounds[k][child], node.bounds[3 + k][child]) = (-1.0, 1.0);
            }
            (node.link[child], node.count[child]) = (small(child), 1);
        }
        let tree = BoxTree { nodes: vec![node] };
        let state = || {
            let mut state = RayState::nothing();
            state.line.start = 0.0;
            state.line.set_reach(1.0);
            state
        };
        let states = [state(), state()];
        for octant in 0..OCTANTS {
            for rays in 1..3 {
                let mut stream = Stream::new(octant);
                for (ray, state) in states.iter().enumerate().take(rays) {
                    stream.put(ray, &state.line, false);
                }
                assert!(stream.begin(Steps::root(&tree)));
                let root = stream.pop().expect("it waits");
                dispatch!(Level::new(), simd => {
                    tree.visit(simd, &mut stream, root, &states, &mut Vec::new());
                });
                let links: Vec<_> = (stream.stack().iter())
                    .map(|next| next.node.link as usize)
                    .collect();
                // A ray that descends along an axis comes from its upper end.
                let far_to_near = [7, 6, 5, 4, 3, 2, 1, 0].map(|corner: usize| corner ^ octant);
                assert_eq!(links, far_to_near, "octant {octant}, {rays} rays");
                for next in stream.stack() {
                    let list = stream.list(next).iter();
                    assert!(list.map(|&ray| ray as usize).eq(0..rays));
                }
            }
        }
    }
}
