// SPDX-License-Identifier: GPL-3.0-or-later
//! Streams of rays: thousands of rays that have nothing in common walk a tree of boxes, eight to a node, together. Each
//! node is visited once for all those that meet it, with a list of them, and parts that list among its children (Tsakok
//! 2009, Faster incoherent rays: multi-BVH ray stream tracing; Barringer and Akenine-Möller 2014, Dynamic ray stream
//! traversal, whose streams are ordered by octants as these are).
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
use super::blocks::{LANES, SPAN};
use super::bound::{keep_max, keep_max_each, keep_min_each};
use super::box_packet::slabs;
use super::box_tree::{BoxTree, INNER, Slabs, Wide};
use super::candidates::{Candidates, Edges};
use super::frame::FrameRay;
use super::late::Late;
use super::packet::{MOST, Packet, Sixteen};
use super::query::{Best, Closest, NoCountLate};
use super::ray::Hit;
use crate::geom::vec3::map;
use fearless_simd::{
    Bytes, Simd, SimdBase, SimdFloat, SimdMask, dispatch, f32x8, f32x16, mask32x16, u8x16, u32x16,
    u64x2,
};
use prefetch_index::prefetch_index;

/// Children of a node.
const CHILDREN: usize = 8;

/// Octants of directions.
const OCTANTS: usize = 8;

/// Rays of a list whose masks are dealt out at once.
const GROUP: usize = 16;

/// So many rays of a list are asked for ahead.
const AHEAD: usize = 4;

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

/// The place in the order of visits, the last one 0, of the child at a corner of a node; and the other way round.
#[inline(always)]
const fn rank(octant: usize, child: usize) -> usize {
    (CHILDREN - 1) ^ child ^ octant
}

/// What slab tests need of a ray, as [`Slabs`] says it.
struct Line {
    inv: [f32; 3],
    near: [f32; 3],
    far: [f32; 3],
    start: f32,
    /// That of the ray's best hit: it is asked for with the rest.
    reach: f32,
}

impl Line {
    #[inline(always)]
    fn new(ray: &FrameRay, inv: [f32; 3], near: [f32; 3], far: [f32; 3]) -> Self {
        Self {
            inv,
            near,
            far,
            start: ray.t_min,
            reach: ray.t_max,
        }
    }

    /// A bit for each box that the ray may hit something in. `near` and `far` are the sides of entry and of leaving.
    #[inline(always)]
    fn meets<S: Simd>(&self, simd: S, near: &[f32x8<S>; 3], far: &[f32x8<S>; 3]) -> u64 {
        let mut enter = f32x8::splat(simd, self.start);
        let mut leave = f32x8::splat(simd, self.reach);
        for k in 0..3 {
            let inv = f32x8::splat(simd, self.inv[k]);
            let soon = near[k].mul_add(inv, f32x8::splat(simd, self.near[k]));
            let late = far[k].mul_add(inv, f32x8::splat(simd, self.far[k]));
            // What is not a number bounds nothing.
            enter = keep_max_each(soon, enter);
            leave = keep_min_each(late, leave);
        }
        enter.simd_le(leave).to_bitmask()
    }

    /// Whether the ray enters a box, of which it may hit something, before its best hit. `near` are the sides of entry.
    #[inline(always)]
    fn enters(&self, near: [f32; 3]) -> bool {
        let mut enter = self.start;
        for k in 0..3 {
            enter = keep_max(near[k] * self.inv[k] + self.near[k], enter);
        }
        enter <= self.reach
    }
}

/// A ray on its way, with what its walk needs of a [`FrameRay`], which is larger: thousands of rays are in use at once.
/// A step through a node reads one line of the caches.
#[repr(C, align(64))]
struct Course {
    line: Line,
    span: f32,
    last_place: f32,
    to_frame: f64,
    o: [f32; 3],
    d: [f32; 3],
    best: Best,
}

impl Course {
    /// Of a ray of the scene.
    #[inline(always)]
    fn new(ray: &FrameRay, line: Line) -> Self {
        debug_assert!(ray.place.is_none() && ray.shift == 0.0, "of the scene");
        Self {
            line,
            o: ray.o,
            d: ray.d,
            span: ray.span,
            last_place: ray.last_place,
            to_frame: ray.to_frame,
            best: Best::new(ray),
        }
    }

    /// What leaves need of the ray. `scene`: whether coordinates are the scene's own.
    #[inline(always)]
    fn ray(&self, scene: bool) -> FrameRay<'static> {
        FrameRay {
            o: self.o,
            d: self.d,
            still: map(self.d, |d| f32::from(u8::from(d != 0.0 || !scene))),
            t_min: self.line.start,
            t_max: self.line.reach,
            span: self.span,
            to_frame: self.to_frame,
            last_place: self.last_place,
            ..FrameRay::NOTHING
        }
    }

    /// Tests a block of `n` triangles.
    #[inline(always)]
    fn test<S: Simd>(
        &mut self,
        simd: S,
        (batch, place): (&Batch<'_>, usize),
        (block, n): (&[f32; SPAN], usize),
        edges: &Edges<S>,
    ) {
        let ray = self.ray(batch.frame.is_scene());
        let mut open = Candidates::new(simd, edges, &ray, self.line.reach);
        if open.any() {
            open.refine::<Closest, NoCountLate>(simd, edges, &ray);
            batch.blocks.settle::<S, Closest, _>(
                simd,
                open,
                (block, n, batch.scene),
                (&batch.rays[place], &ray),
                &mut self.best,
                &mut NoCountLate,
            );
            self.line.reach = self.best.reach;
        }
    }

    /// Asks for all of it.
    #[inline(always)]
    fn fetch_ahead(&self) {
        prefetch_index(std::slice::from_ref(&self.line), 0);
        prefetch_index(self.o.as_slice(), 0);
        // The best hit lies behind, and a line of the caches is sixteen numbers long.
        prefetch_index(self.o.as_slice(), 16);
    }
}

/// A child of a node, to be visited by those rays that meet it.
#[derive(Clone, Copy)]
struct Waiting {
    link: u32,
    count: u32,
    /// Its node and its lane there.
    node: u32,
    lane: u32,
    /// Where its list begins, and how long it is.
    first: u32,
    rays: u32,
}

/// The rays of one octant.
struct Stream {
    octant: usize,
    /// Lists of places in the batch, those of what is visited sooner above; more is read and written than is in them.
    lists: Vec<u32>,
    /// What waits, the next one last.
    waiting: Vec<Waiting>,
}

impl Stream {
    /// Before the first ray, with room for so many in its lists.
    fn new(octant: usize, room: usize) -> Self {
        Self {
            octant,
            lists: Vec::with_capacity(room),
            waiting: Vec::new(),
        }
    }

    /// All rays set out from the root.
    fn begin(&mut self) {
        let rays = small(self.lists.len());
        self.waiting.push(Waiting {
            link: 0,
            count: INNER,
            node: 0,
            lane: 0,
            first: 0,
            rays,
        });
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
        let (first, end) = (own.first as usize, (own.first + own.rays) as usize);
        let child = |at: usize, list: (u32, u32)| Waiting {
            link: node.link[at],
            count: node.count[at],
            node: own.link,
            lane: at as u32,
            first: list.0,
            rays: list.1,
        };
        if own.rays == 1 {
            // All its children have the same list.
            let line = &courses[self.lists[first] as usize].line;
            let met = line.meets(simd, &near, &far) as usize;
            let mut left = RANKED[octant][met % (1 << CHILDREN)];
            while left != 0 {
                let at = rank(octant, left.trailing_zeros() as usize) % CHILDREN;
                left &= left - 1;
                if node.count[at] != 0 {
                    self.waiting.push(child(at, (own.first, 1)));
                }
            }
            return;
        }
        let mut some = 0;
        masks.clear();
        for group in self.lists[first..end].chunks(GROUP) {
            // Eight bits a ray, gathered in registers: bytes would have to reach memory before they are read as vectors.
            let mut words = [0; 2];
            for (word, rays) in words.iter_mut().zip(group.chunks(8)) {
                for (i, &ray) in rays.iter().enumerate() {
                    *word |= courses[ray as usize].line.meets(simd, &near, &far) << (8 * i);
                }
                some |= *word;
            }
            masks.push(u64x2::from_slice(simd, &words).bitcast());
        }
        some |= some >> 32;
        some |= some >> 16;
        some |= some >> 8;
        // What waits has its lists below.
        let mut top = end;
        let mut left = RANKED[octant][some as usize % (1 << CHILDREN)];
        // Room for all, and for what is written beyond the last.
        let most = top + left.count_ones() as usize * (end - first) + GROUP;
        if self.lists.len() < most {
            self.lists.resize(2 * most, 0);
        }
        while left != 0 {
            let at = rank(octant, left.trailing_zeros() as usize) % CHILDREN;
            left &= left - 1;
            // A ray of which no axis decides anything meets places without a box, too.
            if node.count[at] == 0 {
                continue;
            }
            let bit = u8x16::splat(simd, 1 << at);
            let begins = top;
            for (group, masks) in masks.iter().enumerate() {
                let lanes = (*masks & bit).simd_eq(bit).to_bitmask();
                let from = first + GROUP * group;
                let rays: f32x16<S> =
                    u32x16::from_slice(simd, &self.lists[from..from + GROUP]).bitcast();
                let rays: u32x16<S> = rays
                    .compress(mask32x16::from_bitmask(simd, lanes))
                    .bitcast();
                rays.store_slice(&mut self.lists[top..top + GROUP]);
                top += lanes.count_ones() as usize;
            }
            let list = (small(begins), small(top - begins));
            self.waiting.push(child(at, list));
        }
    }

    /// Visits a leaf.
    #[inline(always)]
    fn leaf<S: Simd>(
        &self,
        simd: S,
        (batch, tree): (&Batch<'_>, &BoxTree<CHILDREN>),
        courses: &mut [Course],
        own: Waiting,
    ) {
        let bounds = &tree.nodes[own.node as usize].bounds;
        let side = |k: usize| bounds[k + 3 * (self.octant >> k & 1)][own.lane as usize % CHILDREN];
        let near = [side(0), side(1), side(2)];
        let list = &self.lists[own.first as usize..(own.first + own.rays) as usize];
        let (mut at, mut left) = (own.link, own.count as usize);
        while left > 0 {
            let n = left.min(LANES);
            let (block, next) = batch.blocks.block(at, n);
            let edges = Edges::new(simd, block, n);
            for (i, &place) in list.iter().enumerate() {
                if let Some(&later) = list.get(i + AHEAD) {
                    courses[later as usize].fetch_ahead();
                    prefetch_index(batch.rays, later as usize);
                }
                let course = &mut courses[place as usize];
                if course.line.enters(near) {
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
                prefetch_index(batch.rays, place as usize);
            }
        }
    }
}

/// Lists are no longer than the batch.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "batches are small")]
fn small(x: usize) -> u32 {
    x as u32
}

impl<'a> Batch<'a> {
    /// Walks the rays in streams to their nearest hits through a tree whose children are [`BoxTree::by_corners`], and
    /// hands each answer to `write` with the ray's place, in no particular order.
    pub fn streams(&self, tree: &BoxTree<CHILDREN>, mut write: impl FnMut(usize, Hit)) {
        dispatch!(self.level, simd => self.streaming(simd, tree, &mut write));
    }

    #[inline(always)]
    fn streaming<S: Simd>(
        &self,
        simd: S,
        tree: &BoxTree<CHILDREN>,
        write: &mut impl FnMut(usize, Hit),
    ) {
        let room = 2 * self.rays.len();
        let mut streams: Vec<_> = (0..OCTANTS).map(|i| Stream::new(i, room)).collect();
        let mut courses = self.set_out(simd, &mut streams);
        streams.retain(|stream| !stream.lists.is_empty());
        streams.iter_mut().for_each(Stream::begin);
        let mut masks = Vec::new();
        while !streams.is_empty() {
            let mut over = false;
            for stream in &mut streams {
                let Some(next) = stream.waiting.pop() else {
                    over = true;
                    continue;
                };
                if next.count == INNER {
                    let node = &tree.nodes[next.link as usize];
                    stream.node(simd, node, &courses, next, &mut masks);
                } else {
                    stream.leaf(simd, (self, tree), &mut courses, next);
                }
                stream.fetch_ahead((self, tree), &courses);
            }
            if over {
                streams.retain(|stream| !stream.waiting.is_empty());
            }
        }
        let mut late = Late::new();
        for (place, course) in courses.iter_mut().enumerate() {
            let ray = course.ray(self.frame.is_scene());
            match course.best.held() {
                Some(held) if self.frame.is_scene() => {
                    late.push(simd, (place, self.rays), &ray, held, write);
                }
                _ => write(place, course.best.answer((&self.rays[place], &ray))),
            }
        }
        late.settle(simd, self.rays, write);
    }

    /// Brings the rays into the frame, sixteen at once, and puts those that meet the scene on the list of their octant.
    #[inline(always)]
    fn set_out<S: Simd>(&self, simd: S, streams: &mut [Stream]) -> Vec<Course> {
        let mut courses = Vec::with_capacity(self.rays.len());
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
            for lane in 0..rays.len().min(MOST) {
                let place = first + lane;
                let course = match packet.framed(lane) {
                    Some(ray) => (there >> lane & 1 == 1).then(|| {
                        let row = |of: usize| map([0, 1, 2], |k: usize| rows[k][of][lane]);
                        let line = Line::new(&ray, row(0), row(1), row(2));
                        (ray.signs, Course::new(&ray, line))
                    }),
                    // It is odd in some way.
                    None => self.framed(place).map(|ray| {
                        let Slabs { inv, near, far, .. } = Slabs::new(&ray);
                        let line = Line::new(&ray, inv, near, far);
                        (ray.signs, Course::new(&ray, line))
                    }),
                };
                courses.push(match course {
                    Some((signs, course)) => {
                        streams[signs as usize % OCTANTS].lists.push(small(place));
                        course
                    }
                    None => {
                        let ray = FrameRay::NOTHING;
                        Course::new(&ray, Line::new(&ray, [0.0; 3], [0.0; 3], [0.0; 3]))
                    }
                });
            }
        }
        courses
    }
}

#[cfg(test)]
mod tests;
