// SPDX-License-Identifier: GPL-3.0-or-later
//! Ray streams: thousands of unrelated rays traverse a tree of boxes, eight children per node, together. Each
//! node is visited once for all rays that meet it, with a list of them, and distributes that list over its
//! children (Tsakok 2009, Faster incoherent rays: multi-BVH ray stream tracing; Barringer and Akenine-Möller
//! 2014, Dynamic ray stream traversal, where each ray keeps its own order).
//!
//! A single ray waits for its own arithmetic, and the processor cannot predict whether a node or a leaf comes
//! next. In a list, the steps of consecutive rays are independent, and the work is the same for all: all boxes
//! of the node against one ray after another, or all triangles of the leaf. The cost of the visit itself is
//! shared, though most lists are short: with a few thousand rays, three in the median.
//!
//! The rays of one octant of directions form a stream, because they visit the children of any node in one order
//! ([`crate::flight::boxes`]). The streams take turns, one visit each, so that prefetched data arrives while the
//! others work.

pub mod kernel;
use crate::batch::Launch;
use crate::flight::late::Late;
use crate::packet::boxes::slabs;
use crate::packet::{MOST, Packet, Sixteen};
use crate::slabs::Slabs;
use fearless_simd::{
    Bytes, Simd, SimdBase, SimdMask, dispatch, f32x8, f32x16, mask32x16, u8x16, u32x16, u64x2,
};
use halfspace_geom::vec3::map;
use halfspace_leaf::blocks::LANES;
use halfspace_leaf::candidates::Edges;
use halfspace_nodes::box_corners::rank;
use halfspace_nodes::box_tree::{BoxTree, INNER, Wide};
use halfspace_ray::{Hit, RayRef};
use prefetch_index::prefetch_index;

mod course;

use course::{Course, Line};

/// Number of children of a node.
const CHILDREN: usize = 8;

/// Number of octants of directions.
const OCTANTS: usize = 8;

/// Number of rays of a list whose masks are distributed at once.
const GROUP: usize = 16;

/// Number of rays of a list that are prefetched.
const AHEAD: usize = 4;

/// Largest number of rays that traverse the tree together. More rays give longer lists, but the rays' state
/// then exceeds the caches. Measured: 4096 take up to 5 % longer, 16,384 about as long.
pub const STREAM: usize = 8192;

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

/// A stack entry: a child of a node, to be visited by the rays that meet it.
#[derive(Clone, Copy)]
struct Waiting {
    /// Link and count of the child, as in its node.
    link: u32,
    count: u32,
    /// Start and length of its list of rays.
    first: u32,
    rays: u32,
    /// Sides of its box through which these rays enter.
    near: [f32; 3],
}

/// The rays of one octant, and their traversal.
struct Stream {
    octant: usize,
    /// Number of rays at the root.
    rays: usize,
    /// Indices of rays: first the list of the root, then those of the stack entries, the next one last. Vectors
    /// read and write beyond the end of the lists in use.
    lists: Vec<u32>,
    /// The stack, the next entry last.
    waiting: Vec<Waiting>,
}

impl Stream {
    /// A stream without rays.
    fn new(octant: usize) -> Self {
        Self {
            octant,
            rays: 0,
            lists: Vec::new(),
            waiting: Vec::new(),
        }
    }

    /// Adds a ray.
    #[inline(always)]
    fn put(&mut self, place: usize) {
        if self.rays == self.lists.len() {
            self.lists.resize(2 * self.rays + GROUP, 0);
        }
        self.lists[self.rays] = small(place);
        self.rays += 1;
    }

    /// Pushes the root, if there are rays; returns whether there are.
    fn begin(&mut self) -> bool {
        let rays = small(std::mem::take(&mut self.rays));
        if rays > 0 {
            self.waiting.push(Waiting {
                link: 0,
                count: INNER,
                first: 0,
                rays,
                // NaN bounds nothing: all rays enter the root.
                near: [f32::NAN; 3],
            });
        }
        rays > 0
    }

    /// Visits a node: pushes the children that any of its rays meets, the nearest last.
    #[inline(always)]
    fn node<S: Simd>(
        &mut self,
        simd: S,
        node: &Wide<CHILDREN>,
        courses: &[Course],
        own: Waiting,
        masks: &mut Vec<u8x16<S>>,
    ) {
        let octant = self.octant % OCTANTS;
        // Select the sides of entry and exit, which are common to the octant.
        let zero = f32x8::splat(simd, 0.0);
        let (mut near, mut far) = ([zero; 3], [zero; 3]);
        for k in 0..3 {
            let back = octant >> k & 1;
            near[k] = f32x8::from_slice(simd, &node.bounds[k + 3 * back]);
            far[k] = f32x8::from_slice(simd, &node.bounds[k + 3 * (1 - back)]);
        }
        let (first, rays) = (own.first as usize, own.rays as usize);
        if rays == 1 {
            let line = &courses[self.lists[first] as usize].line;
            if !line.enters(own.near) {
                return;
            }
            let mut left = self.ranked(line.meets(simd, &near, &far));
            while let Some(child) = self.take(&mut left) {
                // All children share the parent's list.
                self.wait(node, child, (own.first, 1));
            }
        } else if rays <= GROUP {
            // Keep the masks in registers: a vector load of bytes just stored one by one would stall.
            let list = &self.lists[first..][..rays];
            let (own, some) = met(simd, list, courses, (&near, &far));
            self.part(
                simd,
                node,
                (first, rays),
                (std::slice::from_ref(&own), some),
            );
        } else {
            let list = &self.lists[first..][..rays];
            masks.resize(rays.div_ceil(GROUP), u8x16::splat(simd, 0));
            let mut some = 0;
            for (masks, group) in masks.iter_mut().zip(list.chunks(GROUP)) {
                let (own, met) = met(simd, group, courses, (&near, &far));
                *masks = own;
                some |= met;
            }
            self.part(simd, node, (first, rays), (masks, some));
        }
    }

    /// Converts a mask of children to stack order, the farthest child in the lowest bit.
    #[inline(always)]
    fn ranked(&self, mask: u64) -> u8 {
        RANKED[self.octant % OCTANTS][mask as usize % (1 << CHILDREN)]
    }

    /// Removes the farthest child of a mask in stack order and returns it.
    #[inline(always)]
    fn take(&self, left: &mut u8) -> Option<usize> {
        if *left == 0 {
            return None;
        }
        let child = rank(self.octant % OCTANTS, left.trailing_zeros() as usize) % CHILDREN;
        *left &= *left - 1;
        Some(child)
    }

    /// Pushes a child with its list of rays.
    #[inline(always)]
    fn wait(&mut self, node: &Wide<CHILDREN>, child: usize, (first, rays): (u32, u32)) {
        // A ray whose bounds are NaN on every axis meets missing children, too.
        if node.count[child] == 0 {
            return;
        }
        let side = |k: usize| node.bounds[k + 3 * (self.octant >> k & 1)][child];
        self.waiting.push(Waiting {
            link: node.link[child],
            count: node.count[child],
            first,
            rays,
            near: [side(0), side(1), side(2)],
        });
    }

    /// Distributes a list over the children that its rays meet: `masks` has one byte per ray, `some` is their
    /// union.
    #[inline(always)]
    fn part<S: Simd>(
        &mut self,
        simd: S,
        node: &Wide<CHILDREN>,
        (first, rays): (usize, usize),
        (masks, some): (&[u8x16<S>], u64),
    ) {
        let mut left = self.ranked(some);
        // The lists of all stack entries lie below.
        let mut top = first + rays;
        // Make room for all lists, and for a full vector beyond the last.
        let most = top + left.count_ones() as usize * rays + GROUP;
        if self.lists.len() < most {
            self.lists.resize(2 * most, 0);
        }
        // Write each child's list by compressing the parent's under the child's bit, then push the child.
        while let Some(child) = self.take(&mut left) {
            let bit = u8x16::splat(simd, 1 << child);
            let begins = top;
            for (group, masks) in masks.iter().enumerate() {
                let lanes = (*masks & bit).simd_eq(bit).to_bitmask();
                let live = mask32x16::from_bitmask(simd, lanes);
                let from = first + GROUP * group;
                let own = u32x16::from_slice(simd, &self.lists[from..from + GROUP]);
                let own: f32x16<S> = own.bitcast();
                let own: u32x16<S> = own.compress(live).bitcast();
                own.store_slice(&mut self.lists[top..top + GROUP]);
                top += lanes.count_ones() as usize;
            }
            self.wait(node, child, (small(begins), small(top - begins)));
        }
    }

    /// Visits a leaf: tests each ray of the list against its triangles, block by block.
    #[inline(always)]
    fn leaf<S: Simd>(&self, simd: S, batch: &Launch<'_>, courses: &mut [Course], own: Waiting) {
        let list = &self.lists[own.first as usize..(own.first + own.rays) as usize];
        let (mut at, mut left) = (own.link, own.count as usize);
        while left > 0 {
            let n = left.min(LANES);
            let (block, next) = batch.blocks.block(at, n);
            let edges = Edges::new(simd, block, n);
            // Prefetch later rays in the first pass, and skip rays that have a nearer hit by now.
            for (i, &place) in list.iter().enumerate() {
                if let (true, Some(&later)) = (at == own.link, list.get(i + AHEAD)) {
                    courses[later as usize].fetch_ahead();
                }
                let course = &mut courses[place as usize];
                if course.line.enters(own.near) {
                    course.test(simd, (batch, place as usize), (block, n), &edges);
                }
            }
            (at, left) = (next, left - n);
        }
    }

    /// Prefetches the data of the next visit.
    #[inline(always)]
    fn fetch_ahead(&self, (batch, tree): (&Launch<'_>, &BoxTree<CHILDREN>), courses: &[Course]) {
        let Some(next) = self.waiting.last() else {
            return;
        };
        let first = next.first as usize;
        let list = &self.lists[first..first + AHEAD.min(next.rays as usize)];
        tree.fetch_ahead((next.link, next.count), batch.blocks);
        for &place in list {
            if next.count == INNER {
                prefetch_index(std::slice::from_ref(&courses[place as usize].line), 0);
            } else {
                courses[place as usize].fetch_ahead();
            }
        }
    }
}

/// Tests at most sixteen rays against eight boxes. Returns one mask of boxes per ray, as bytes, and their
/// union.
#[inline(always)]
fn met<S: Simd>(
    simd: S,
    list: &[u32],
    courses: &[Course],
    (near, far): (&[f32x8<S>; 3], &[f32x8<S>; 3]),
) -> (u8x16<S>, u64) {
    let mut words = [0_u64; 2];
    for (word, rays) in words.iter_mut().zip(list.chunks(8)) {
        for (i, &ray) in rays.iter().enumerate() {
            *word |= courses[ray as usize].line.meets(simd, near, far) << (8 * i);
        }
    }
    let mut some = words[0] | words[1];
    some |= some >> 32;
    some |= some >> 16;
    some |= some >> 8;
    // Little-endian words put the first ray into the vector's lowest byte on every machine.
    let words = words.map(u64::to_le);
    (u64x2::from_slice(simd, &words).bitcast(), some & 0xff)
}

/// Narrows an index of a ray or a position in lists. Both fit: each level of a tree adds at most eight entries
/// for each of 8192 rays.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "see above")]
fn small(x: usize) -> u32 {
    x as u32
}

impl Launch<'_> {
    /// Finds the nearest hits of the rays, which must be those of the scene, in streams through a tree whose
    /// children are in the order of [`BoxTree::by_corners`] and whose leaves are blocks. Calls `write` with
    /// each ray's index and hit, in no particular order.
    pub fn streams(&self, tree: &BoxTree<CHILDREN>, mut write: impl FnMut(usize, Hit)) {
        debug_assert!(self.placed.is_none(), "rays of instances go one by one");
        dispatch!(self.level, simd => self.streaming(simd, tree, &mut write));
    }

    /// Traces part by part, each of at most [`STREAM`] rays.
    #[inline(always)]
    fn streaming<S: Simd>(
        &self,
        simd: S,
        tree: &BoxTree<CHILDREN>,
        write: &mut impl FnMut(usize, Hit),
    ) {
        let mut streams: [_; OCTANTS] = std::array::from_fn(Stream::new);
        let mut courses = Vec::with_capacity(self.rays.len().min(STREAM));
        let mut masks = Vec::new();
        let mut late = Late::default();
        for (part, rays) in self.rays.chunks(STREAM).enumerate() {
            let own = Launch { rays, ..*self };
            let mut write = |place: usize, hit: Hit| write(STREAM * part + place, hit);
            own.set_out(simd, &mut streams, &mut courses);
            let mut open = streams
                .iter_mut()
                .map(Stream::begin)
                .filter(|&any| any)
                .count();
            // Let the streams take turns until all stacks are empty.
            while open > 0 {
                for stream in &mut streams {
                    let Some(next) = stream.waiting.pop() else {
                        continue;
                    };
                    if next.count == INNER {
                        let node = &tree.nodes[next.link as usize];
                        stream.node(simd, node, &courses, next, &mut masks);
                    } else {
                        stream.leaf(simd, &own, &mut courses, next);
                    }
                    stream.fetch_ahead((&own, tree), &courses);
                    open -= usize::from(stream.waiting.is_empty());
                }
            }
            // Decide the deferred hits, many at once in f64 where the frame allows it.
            for (place, course) in courses.iter_mut().enumerate() {
                let ray = course.ray();
                match course.best.held() {
                    Some(held) if self.frame.is_scene() => {
                        late.push(simd, (place, rays), &ray, held, &mut write);
                    }
                    _ => write(
                        place,
                        course.best.answer(RayRef {
                            ray: &rays[place],
                            frame: &ray,
                        }),
                    ),
                }
            }
            late.settle(simd, rays, &mut write);
        }
    }

    /// Scales the rays into the frame, sixteen at once, and adds those that meet the scene to the stream of
    /// their octant.
    #[inline(always)]
    fn set_out<S: Simd>(
        &self,
        simd: S,
        streams: &mut [Stream; OCTANTS],
        courses: &mut Vec<Course>,
    ) {
        courses.clear();
        let scene = self.frame.is_scene();
        let mut packet = Packet::default();
        // Fill a packet with sixteen rays, and compute their slab coefficients.
        for (chunk, rays) in self.rays.chunks(MOST).enumerate() {
            let first = MOST * chunk;
            packet.count = rays.len();
            for (i, place) in packet.places.iter_mut().enumerate().take(rays.len()) {
                *place = first + i;
            }
            let there = packet.fill(simd, self.frame, self.rays, None);
            let mut rows = [[[0.0; MOST]; 3]; 3];
            for (rows, slabs) in rows.iter_mut().zip(slabs::<S, Sixteen>(simd, &packet)) {
                for (row, slab) in rows.iter_mut().zip(slabs) {
                    slab.store_slice(row);
                }
            }
            // Store the state of each ray; irregular ones are framed by themselves.
            for (lane, own) in rays.iter().enumerate().take(MOST) {
                let place = first + lane;
                let still = map(own.d, |d| f32::from(u8::from(d != 0.0 || !scene)));
                let course = match packet.framed(lane) {
                    Some(ray) => (there >> lane & 1 == 1).then(|| {
                        let row = |of: usize| map([0, 1, 2], |k: usize| rows[k][of][lane]);
                        let line = Line::new(&ray, row(0), row(1), row(2));
                        (ray.signs, Course::new(&ray, line, ray.certain(own), still))
                    }),
                    // An irregular ray.
                    None => self.framed(place).map(|ray| {
                        let Slabs { inv, near, far, .. } = Slabs::new(&ray);
                        let line = Line::new(&ray, inv, near, far);
                        (ray.signs, Course::new(&ray, line, ray.certain(own), still))
                    }),
                };
                courses.push(match course {
                    Some((signs, course)) => {
                        streams[signs as usize % OCTANTS].put(place);
                        course
                    }
                    None => Course::nothing(),
                });
            }
        }
    }
}

#[cfg(test)]
mod tests;
