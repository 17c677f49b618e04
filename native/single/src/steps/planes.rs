// SPDX-License-Identifier: GPL-3.0-or-later
//! Traversal of plane trees by wide nodes, three binary levels at a time.
//!
//! One pass computes the crossings of all planes of a node, three minima and maxima the intervals of its
//! children, and a table indexed by the directions' signs their order. No step has a branch, so a ray waits
//! only for its own arithmetic; several rays, each advanced by one step in turn, fill the latency.
//!
//! Each distance has the frame's error bound, as in [`crate::planes::dir`]: a child is skipped only if the ray
//! certainly misses it or certainly reaches it beyond its best hit.

use crate::steps::{Steps, topmost};
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdMask, f32x8, mask32x8, u8x32};
use halfspace_geom::bound::{keep_max_each, keep_min, keep_min_each};
use halfspace_leaf::Job;
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::next::Next;
use halfspace_nodes::plane_tree::MAX_DEPTH;
use halfspace_nodes::wide_tree::{Info, Line, OVER, PLANES, WideTree};
use halfspace_ray::query::{Best, Counters, Query};
use halfspace_ray::{FrameRay, Interval, RayRef};
use halfspace_trace::slabs::Slabs;
use halfspace_trace::stack::NodeEntry;

/// Number of children of a node.
const CHILDREN: usize = 8;

/// Length of the stack. Derived: each node on a path leaves at most seven children on it, and loads and stores
/// take eight entries.
const STACK: usize = MAX_DEPTH.div_ceil(3) * (CHILDREN - 1) + 2 * CHILDREN;

/// Visiting order of a node's children, given the side from which the ray enters each plane.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
struct Signs {
    /// Byte indices that permute the children by entry distance, the farthest first.
    order: [u8; 4 * CHILDREN],
    /// Per level, the mask of children on the near side of their plane there.
    near: [u8; 3],
}

/// The orders for all combinations of signs; bit `i` of the index is set if the ray descends through plane `i`.
static SIGNS: [Signs; 1 << PLANES] = signs();

/// Computes [`SIGNS`].
const fn signs() -> [Signs; 1 << PLANES] {
    let mut table = [Signs {
        order: [0; 4 * CHILDREN],
        near: [0; 3],
    }; 1 << PLANES];
    let mut signs = 0;
    while signs < table.len() {
        let mut rank = 0;
        while rank < CHILDREN {
            // The near child of a plane is the upper one for a descending ray.
            let top = (signs ^ rank >> 2) & 1;
            let middle = (signs >> (1 + top) ^ rank >> 1) & 1;
            let low = (signs >> (3 + 2 * top + middle) ^ rank) & 1;
            let child = 4 * top + 2 * middle + low;
            let mut byte = 0;
            while byte < 4 {
                table[signs].order[4 * (CHILDREN - 1 - rank) + byte] = (4 * child + byte) as u8;
                byte += 1;
            }
            let mut level = 0;
            while level < 3 {
                if rank >> (2 - level) & 1 == 0 {
                    table[signs].near[level] |= 1 << child;
                }
                level += 1;
            }
            rank += 1;
        }
        signs += 1;
    }
    table
}

/// Byte indices that copy to each child the number of its plane on one level, whose planes begin at `first` and
/// have `children` children below each.
const fn spread(first: u8, children: u8) -> [u8; 32] {
    let mut places = [0; 32];
    let mut byte = 0;
    while byte < 32 {
        let lane = byte as u8 / 4;
        places[byte] = 4 * (first + lane / children) + byte as u8 % 4;
        byte += 1;
    }
    places
}

/// [`spread`] for the three levels.
static SPREAD: [[u8; 32]; 3] = [spread(0, 8), spread(1, 4), spread(3, 2)];

/// The state of one ray's traversal.
pub struct State {
    /// Per axis the coefficients of plane crossings: factor, and the addends of lower and upper bound.
    inv: [f32; 3],
    near: [f32; 3],
    far: [f32; 3],
    /// Per axis a mask of all seven planes if the ray descends along it, else 0.
    down: [u32; 3],
    /// The node to visit next, and the ray's interval in it.
    next: NodeEntry,
    /// Number of stack entries in use.
    size: usize,
    /// The stack: nodes and the ray's intervals in them. The bottom entry is a word that ends the traversal.
    child: [f32; STACK],
    enter: [f32; STACK],
    leave: [f32; STACK],
}

impl State {
    /// Pops the nearest entry that starts within `reach` as the next node.
    #[inline(always)]
    fn pop(&mut self, reach: f32) {
        let top = topmost(&self.enter, self.size, reach);
        self.size = top;
        self.next = NodeEntry {
            node: self.child[top].to_bits(),
            interval: Interval::new(self.enter[top], keep_min(reach, self.leave[top])),
        };
    }
}

/// The traversal of one tree.
pub struct PlaneSteps<'a>(pub &'a WideTree);

impl Steps for PlaneSteps<'_> {
    type State = State;

    fn blank(&self) -> State {
        State {
            inv: [0.0; 3],
            near: [0.0; 3],
            far: [0.0; 3],
            down: [0; 3],
            next: NodeEntry::blank(OVER),
            size: 0,
            child: [f32::from_bits(OVER); STACK],
            enter: [f32::NEG_INFINITY; STACK],
            leave: [0.0; STACK],
        }
    }

    #[inline(always)]
    fn start(&self, ray: &FrameRay, state: &mut State) {
        let slabs = Slabs::new(ray);
        (state.inv, state.near, state.far) = (slabs.inv, slabs.near, slabs.far);
        let down = |k: usize| ray.negative[k] * 0x7f;
        state.down = [down(0), down(1), down(2)];
        state.next = NodeEntry {
            node: self.0.root(),
            interval: Interval::new(ray.t_min, ray.t_max),
        };
        state.size = 1;
    }

    #[inline(always)]
    fn next(&self, state: &State) -> Next {
        Next::of(state.next.node)
    }

    #[inline(always)]
    fn plain<S: Simd>(&self, simd: S, state: &mut State, reach: f32) {
        let line = self.0.line(state.next.node);
        let crossings = axis(simd, line, state);
        push(simd, line, &crossings, state);
        state.pop(reach);
    }

    #[inline(always)]
    fn general<S: Simd>(&self, simd: S, ray: &FrameRay, state: &mut State, reach: f32) {
        let lines = self.0.lines(state.next.node);
        let crossings = oblique(simd, lines, ray);
        push(simd, &lines[0], &crossings, state);
        state.pop(reach);
    }

    fn bytes(&self) -> usize {
        self.0.bytes()
    }

    #[inline(always)]
    fn fetch_plain(&self, state: &State) {
        self.0.fetch_ahead::<1>(state.next.node);
    }

    #[inline(always)]
    fn fetch_general(&self, state: &State) {
        self.0.fetch_ahead::<3>(state.next.node);
    }

    #[inline(always)]
    fn fetch_leaf(&self, blocks: &Blocks, state: &State) {
        blocks.fetch_ahead(self.0.leaf(state.next.node).first);
    }

    #[inline(always)]
    fn leaf<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        job: Job<'_>,
        ray: RayRef<'_>,
        state: &mut State,
        best: &mut Best,
        counters: &mut C,
    ) {
        let leaf = self.0.leaf(state.next.node);
        counters.leaf(leaf.count);
        let leave = state.next.interval.leave;
        if job.test::<S, Q, C>(simd, leaf, ray, leave, best, counters) {
            state.next.node = OVER;
        } else {
            state.pop(best.reach);
        }
    }
}

/// The crossings of a ray with the planes of a node, one per lane.
struct Crossings<S: Simd> {
    /// Bit `i` is set if the ray descends through plane `i`.
    signs: u32,
    /// Mask of the children that contain triangles.
    used: u32,
    /// Bounds of the distances where the ray crosses the planes.
    low: f32x8<S>,
    high: f32x8<S>,
}

/// The crossings with a node whose planes are all axis-aligned.
#[inline(always)]
fn axis<S: Simd>(simd: S, line: &Line, state: &State) -> Crossings<S> {
    let info = Info(line.first[PLANES].to_bits());
    let (y, z) = (info.along_y(), info.along_z());
    let mask = |bits: u32| mask32x8::from_bitmask(simd, u64::from(bits));
    let (in_y, in_z) = (mask(y), mask(z));
    // Select for each plane the ray's coefficients along its axis, and compute all crossings.
    let of = |v: [f32; 3]| {
        let xy: f32x8<S> = in_y.select(f32x8::splat(simd, v[1]), f32x8::splat(simd, v[0]));
        let all: f32x8<S> = in_z.select(f32x8::splat(simd, v[2]), xy);
        all
    };
    let inv = of(state.inv);
    let heights = f32x8::from_slice(simd, &line.first);
    // Select per plane whether the ray descends along the plane's axis.
    let down = state.down;
    Crossings {
        signs: down[0] ^ (y & (down[0] ^ down[1])) ^ (z & (down[0] ^ down[2])),
        used: info.used(),
        low: heights.mul_add(inv, of(state.near)),
        high: heights.mul_add(inv, of(state.far)),
    }
}

/// The crossings with a node with planes of any direction.
#[inline(always)]
fn oblique<S: Simd>(simd: S, lines: &[Line; 3], frame: &FrameRay) -> Crossings<S> {
    let splat = |x: f32| f32x8::splat(simd, x);
    let load = |row: &[f32; 8]| f32x8::from_slice(simd, row);
    let (x, y, z) = (
        load(&lines[1].first),
        load(&lines[1].second),
        load(&lines[2].first),
    );
    // Compute all crossings by dot products. The smallest normal number keeps the reciprocals finite.
    let along = |v: [f32; 3]| x.mul_add(splat(v[0]), y.mul_add(splat(v[1]), z * splat(v[2])));
    let speed = along(frame.d);
    let inv = splat(1.0) / (speed + splat(f32::MIN_POSITIVE).copysign(speed));
    let height = f32x8::from_slice(simd, &lines[0].first) - along(frame.o);
    let slack = splat(frame.oblique_pad) * inv.abs();
    Crossings {
        signs: inv.simd_lt(splat(0.0)).to_bitmask() as u32 & 0x7f,
        used: Info(lines[0].first[PLANES].to_bits()).used(),
        low: height.mul_sub(inv, slack),
        high: height.mul_add(inv, slack),
    }
}

/// Pushes the children that the ray meets within its interval, the nearest on top. NaN bounds are ignored.
#[inline(always)]
fn push<S: Simd>(simd: S, line: &Line, crossings: &Crossings<S>, state: &mut State) {
    let splat = |x: f32| f32x8::splat(simd, x);
    let mask = |bits: u32| mask32x8::from_bitmask(simd, u64::from(bits));
    let table = &SIGNS[crossings.signs as usize & 0x7f];
    // Start with the node's interval; children without triangles get an empty one, whatever the planes' bounds are.
    let Interval { enter, leave } = state.next.interval;
    let used = mask(crossings.used);
    let mut enters: f32x8<S> = used.select(splat(enter), splat(f32::INFINITY));
    let mut leaves: f32x8<S> = used.select(splat(leave), splat(f32::NEG_INFINITY));
    // On each level, the near child ends at its plane and the far child begins there.
    for (places, near) in SPREAD.iter().zip(&table.near) {
        let near = mask(u32::from(*near));
        let places = u8x32::from_slice(simd, places);
        let low = crossings.low.swizzle_dyn(places);
        let high = crossings.high.swizzle_dyn(places);
        leaves = near.select(keep_min_each(high, leaves), leaves);
        enters = near.select(enters, keep_max_each(low, enters));
    }
    // Sort the children from far to near and push those with an interval that is not empty.
    let order = u8x32::from_slice(simd, &table.order);
    let children = f32x8::from_slice(simd, &line.second).swizzle_dyn(order);
    let (enters, leaves) = (enters.swizzle_dyn(order), leaves.swizzle_dyn(order));
    let live = enters.simd_le(leaves);
    let top = state.size..state.size + CHILDREN;
    let rows = [
        &mut state.child[top.clone()],
        &mut state.enter[top.clone()],
        &mut state.leave[top],
    ];
    for (row, values) in rows.into_iter().zip([children, enters, leaves]) {
        values.compress(live).store_slice(row);
    }
    state.size += live.to_bitmask().count_ones() as usize;
}
