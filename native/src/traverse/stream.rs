// SPDX-License-Identifier: GPL-3.0-or-later
//! Streams of rays: thousands of rays that have nothing in common walk a tree of boxes, eight to a node, together. Each
//! node is visited once for all those that meet it, with a list of them, and parts that list among its children (Tsakok
//! 2009, Faster incoherent rays: multi-BVH ray stream tracing; Barringer and Akenine-Möller 2014, Dynamic ray stream
//! traversal, where each ray keeps an order of its own).
//!
//! A single ray waits for its own arithmetic, and the processor cannot guess whether it goes on with a node or a leaf. Of a
//! list each ray's step is independent of the next one's, and what is asked is the same for all of it: all boxes of
//! the node against one ray after another, or all triangles of the leaf. What a visit itself takes is shared, though most
//! lists are short: with a few thousand rays, three in the middle.
//!
//! The rays of one octant of directions make a stream, as they visit the children of any node in one order
//! ([`super::box_flight`]). The streams take turns visit by visit, so that what one needs next has time to arrive while the
//! others work.

use super::batch::Batch;
use super::blocks::LANES;
use super::box_flight::rank;
use super::box_packet::slabs;
use super::box_tree::{BoxTree, INNER, Slabs, Wide};
use super::candidates::Edges;
use super::late::Late;
use super::packet::{MOST, Packet, Sixteen};
use super::ray::Hit;
use crate::geom::vec3::map;
use fearless_simd::{
    Bytes, Simd, SimdBase, SimdMask, dispatch, f32x8, f32x16, mask32x16, u8x16, u32x16, u64x2,
};
use prefetch_index::prefetch_index;

mod course;

use course::{Course, Line};

/// Children of a node.
const CHILDREN: usize = 8;

/// Octants of directions.
const OCTANTS: usize = 8;

/// Rays of a list whose masks are dealt out at once.
const GROUP: usize = 16;

/// So many rays of a list are asked for ahead.
const AHEAD: usize = 4;

/// Rays that walk together at most. The more there are, the longer lists are, and the less of what rays have with them
/// stays in the caches: 4096 take up to 5 % longer, 16,384 about as long.
pub const STREAM: usize = 8192;

/// For each octant and each mask of children, the same mask with the children in the order in which they wait, the farthest
/// lowest: child `c` has the bit [`rank`].
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

/// A child of a node, to be visited by those rays that meet it.
#[derive(Clone, Copy)]
struct Waiting {
    link: u32,
    count: u32,
    /// Where its list begins, and how long it is.
    first: u32,
    rays: u32,
    /// The sides of its box through which these rays enter it.
    near: [f32; 3],
}

/// The rays of one octant.
struct Stream {
    octant: usize,
    /// How many rays set out.
    rays: usize,
    /// Lists of places among the rays that walk together, of those first that set out, then of what waits, the next one
    /// last. More is read and written than is in them.
    lists: Vec<u32>,
    /// What waits, the next one last.
    waiting: Vec<Waiting>,
}

impl Stream {
    /// Before the first ray.
    fn new(octant: usize) -> Self {
        Self {
            octant,
            rays: 0,
            lists: Vec::new(),
            waiting: Vec::new(),
        }
    }

    /// One more ray.
    #[inline(always)]
    fn put(&mut self, place: usize) {
        if self.rays == self.lists.len() {
            self.lists.resize(2 * self.rays + GROUP, 0);
        }
        self.lists[self.rays] = small(place);
        self.rays += 1;
    }

    /// The rays set out from the root, if there are any; says whether there are.
    fn begin(&mut self) -> bool {
        let rays = small(std::mem::take(&mut self.rays));
        if rays > 0 {
            self.waiting.push(Waiting {
                link: 0,
                count: INNER,
                first: 0,
                rays,
                // What is not a number bounds nothing.
                near: [f32::NAN; 3],
            });
        }
        rays > 0
    }

    /// Visits a node: the children that any of its rays meet wait, the nearest one last.
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
                // All children have the same list.
                self.wait(node, child, (own.first, 1));
            }
        } else if rays <= GROUP {
            // In registers: what has just been written in parts is long in coming back as a whole.
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

    /// Children in the order in which they wait, the farthest lowest.
    #[inline(always)]
    fn ranked(&self, mask: u64) -> u8 {
        RANKED[self.octant % OCTANTS][mask as usize % (1 << CHILDREN)]
    }

    /// Takes the farthest of the children.
    #[inline(always)]
    fn take(&self, left: &mut u8) -> Option<usize> {
        if *left == 0 {
            return None;
        }
        let child = rank(self.octant % OCTANTS, left.trailing_zeros() as usize) % CHILDREN;
        *left &= *left - 1;
        Some(child)
    }

    /// A child waits for the rays of a list.
    #[inline(always)]
    fn wait(&mut self, node: &Wide<CHILDREN>, child: usize, (first, rays): (u32, u32)) {
        // A ray of which no axis decides anything meets places without a box, too.
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

    /// Parts a list among the children that its rays meet, `masks` for each, `some` of them any.
    #[inline(always)]
    fn part<S: Simd>(
        &mut self,
        simd: S,
        node: &Wide<CHILDREN>,
        (first, rays): (usize, usize),
        (masks, some): (&[u8x16<S>], u64),
    ) {
        let mut left = self.ranked(some);
        // All that waits has its lists below.
        let mut top = first + rays;
        // Room for all, and for what is written beyond the last.
        let most = top + left.count_ones() as usize * rays + GROUP;
        if self.lists.len() < most {
            self.lists.resize(2 * most, 0);
        }
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

    /// Visits a leaf.
    #[inline(always)]
    fn leaf<S: Simd>(&self, simd: S, batch: &Batch<'_>, courses: &mut [Course], own: Waiting) {
        let list = &self.lists[own.first as usize..(own.first + own.rays) as usize];
        let (mut at, mut left) = (own.link, own.count as usize);
        while left > 0 {
            let n = left.min(LANES);
            let (block, next) = batch.blocks.block(at, n);
            let edges = Edges::new(simd, block, n);
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

    /// Asks for what the next visit needs.
    #[inline(always)]
    fn fetch_ahead(&self, (batch, tree): (&Batch<'_>, &BoxTree<CHILDREN>), courses: &[Course]) {
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

/// Which of eight boxes each of up to sixteen rays meets, a byte for each, and any of them.
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
    // The first ray is the lowest byte of the vector, too.
    let words = words.map(u64::to_le);
    (u64x2::from_slice(simd, &words).bitcast(), some & 0xff)
}

/// Places among the rays that walk together, or in their lists: of those each level of a tree has at most eight for each
/// of 8192 rays.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "see above")]
fn small(x: usize) -> u32 {
    x as u32
}

impl Batch<'_> {
    /// Walks the rays, of the scene and not of an instance, in streams to their nearest hits through a tree whose children
    /// are [`BoxTree::by_corners`] and whose leaves are blocks, and hands each answer to `write` with the ray's place, in
    /// no particular order.
    pub fn streams(&self, tree: &BoxTree<CHILDREN>, mut write: impl FnMut(usize, Hit)) {
        debug_assert!(self.placed.is_none(), "rays of instances go one by one");
        dispatch!(self.level, simd => self.streaming(simd, tree, &mut write));
    }

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
        let mut late = Late::new();
        for (part, rays) in self.rays.chunks(STREAM).enumerate() {
            let own = Batch { rays, ..*self };
            let mut write = |place: usize, hit: Hit| write(STREAM * part + place, hit);
            own.set_out(simd, &mut streams, &mut courses);
            let mut open = streams
                .iter_mut()
                .map(Stream::begin)
                .filter(|&any| any)
                .count();
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
            for (place, course) in courses.iter_mut().enumerate() {
                let ray = course.ray();
                match course.best.held() {
                    Some(held) if self.frame.is_scene() => {
                        late.push(simd, (place, rays), &ray, held, &mut write);
                    }
                    _ => write(place, course.best.answer((&rays[place], &ray))),
                }
            }
            late.settle(simd, rays, &mut write);
        }
    }

    /// Brings the rays into the frame, sixteen at once, and puts those that meet the scene on the list of their octant.
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
            for (lane, own) in rays.iter().enumerate().take(MOST) {
                let place = first + lane;
                let still = map(own.d, |d| f32::from(u8::from(d != 0.0 || !scene)));
                let course = match packet.framed(lane) {
                    Some(ray) => (there >> lane & 1 == 1).then(|| {
                        let row = |of: usize| map([0, 1, 2], |k: usize| rows[k][of][lane]);
                        let line = Line::new(&ray, row(0), row(1), row(2));
                        (ray.signs, Course::new(&ray, line, ray.certain(own), still))
                    }),
                    // It is odd in some way.
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
