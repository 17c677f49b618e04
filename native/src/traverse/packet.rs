// SPDX-License-Identifier: GPL-3.0-or-later
//! Packets of rays: 4, 8 or 16 that follow each other in a batch, one to a lane (Wald et al. 2001; Wald
//! 2004). They need not have anything in common; those whose directions have the same signs go together,
//! the near child of a plane across an axis being the same for all of them, and one that is left alone
//! is walked alone.
//!
//! Each ray has an interval of its own in each node. It takes part as long as that is not empty, so no
//! ray's answer depends on its company: what its own walk would visit, the packet visits with it.

use super::batch::Walk;
use super::blocks::{Blocks, LANES, SPAN};
use super::frame::{Frame, FrameRay, keep_min};
use super::lanes::Free;
use super::query::{Best, Closest, Counters};
use super::ray::{Hit, Ray};
use crate::scene::Triangles;
use fearless_simd::{Simd, SimdBase, SimdFloat, SimdMask, f32x4, f32x8, f32x16};

/// Rays of the largest packet.
pub const MOST: usize = 16;

/// Rays that are tested against one triangle at once.
const HALF: usize = 8;

/// A number for each ray.
pub type Row = [f32; MOST];

/// How many rays make a packet.
pub trait Width: Sync {
    /// The vector with as many lanes.
    type Vector<S: Simd>: SimdFloat<S, Element = f32>;
    /// Its lanes.
    const RAYS: usize;
}

/// Packets of 4.
pub struct Four;

/// Packets of 8.
pub struct Eight;

/// Packets of 16.
pub struct Sixteen;

impl Width for Four {
    type Vector<S: Simd> = f32x4<S>;
    const RAYS: usize = 4;
}

impl Width for Eight {
    type Vector<S: Simd> = f32x8<S>;
    const RAYS: usize = 8;
}

impl Width for Sixteen {
    type Vector<S: Simd> = f32x16<S>;
    const RAYS: usize = 16;
}

/// The part of a row that a packet of this width has.
#[inline(always)]
pub fn load<S: Simd, L: Width>(simd: S, row: &Row) -> L::Vector<S> {
    L::Vector::from_slice(simd, &row[..L::RAYS])
}

/// Writes it.
#[inline(always)]
pub fn store<S: Simd, L: Width>(vector: L::Vector<S>, row: &mut Row) {
    vector.store_slice(&mut row[..L::RAYS]);
}

/// The rays that take part where these are their intervals. One that is not a number ends nothing.
#[inline(always)]
pub fn live<S: Simd, L: Width>(enter: L::Vector<S>, leave: L::Vector<S>) -> u64 {
    enter.simd_le(leave).to_bitmask()
}

/// Up to 16 rays, and what each has found. Packets share one after another, as most of it is the same size
/// whatever they are.
#[derive(Default)]
pub struct Packet {
    /// The rays in the frame.
    pub frames: Vec<FrameRay<'static>>,
    best: Vec<Best>,
    /// Origins per axis.
    pub o: [Row; 3],
    /// Directions per axis.
    pub d: [Row; 3],
    /// How far each ray still has to look.
    pub reach: Row,
}

/// A few rays of a packet that go together.
#[derive(Clone, Copy)]
pub struct Group {
    /// A bit for each.
    pub lanes: u64,
    /// The first of them.
    pub lead: usize,
    /// Their sign bits, as in [`FrameRay::signs`].
    pub signs: u32,
}

impl Packet {
    /// Takes at least one ray and at most 16, and forgets all others. Returns those that enter the scene.
    #[inline(always)]
    pub fn fill(&mut self, frame: &Frame, rays: &[Ray]) -> u64 {
        self.frames.clear();
        self.best.clear();
        let mut entering = 0;
        for (i, ray) in rays.iter().enumerate().take(MOST) {
            let framed = frame.ray(ray);
            entering |= u64::from(framed.is_some()) << i;
            let framed = framed.unwrap_or(FrameRay::NOTHING);
            for k in 0..3 {
                self.o[k][i] = framed.o[k];
                self.d[k][i] = framed.d[k];
            }
            self.reach[i] = framed.t_max;
            self.best.push(Best::new(&framed));
            self.frames.push(framed);
        }
        entering
    }

    /// The rays among `left` that go with the first of them.
    #[inline(always)]
    pub fn group(&self, left: u64) -> Group {
        let lead = left.trailing_zeros() as usize;
        let signs = self.frames[lead].signs;
        let mut lanes = 0;
        for i in 0..self.frames.len() {
            lanes |= u64::from(self.frames[i].signs == signs) << i;
        }
        Group {
            lanes: lanes & left,
            lead,
            signs,
        }
    }

    /// Where each ray of a group enters the scene; the others nowhere.
    #[inline(always)]
    pub fn enter(&self, group: Group) -> Row {
        let mut enter = [f32::INFINITY; MOST];
        for (i, frame) in self.frames.iter().enumerate().take(MOST) {
            if group.lanes >> i & 1 == 1 {
                enter[i] = frame.t_min;
            }
        }
        enter
    }

    /// Tests the triangles of a leaf against the rays of `lanes`, which leave its cell at `leave`. Where
    /// there are more rays than triangles, rays stand side by side, otherwise triangles do.
    #[inline(always)]
    pub fn leaf<S: Simd, C: Counters>(
        &mut self,
        simd: S,
        (scene, blocks, rays): (&Triangles, &Blocks, &[Ray]),
        leaf: (u32, usize),
        (lanes, leave): (u64, &Row),
        counters: &mut [C],
    ) {
        for half in [0, HALF] {
            let mut open = lanes >> half & 0xff;
            if open.count_ones() as usize > leaf.1 {
                let lanes = (half, open, leave);
                self.side_by_side(simd, (scene, blocks, rays), leaf, lanes, counters);
                continue;
            }
            while open != 0 {
                let i = (half + open.trailing_zeros() as usize) % MOST;
                open &= open - 1;
                let ray = (&rays[i], &self.frames[i], leave[i]);
                let best = &mut self.best[i];
                blocks.test::<S, Closest, C>(simd, leaf, scene, ray, best, &mut counters[i]);
                self.reach[i] = keep_min(self.best[i].reach, self.reach[i]);
            }
        }
    }

    /// Each triangle against eight rays.
    // Vectors in closures are slow, so there is none here.
    #[inline(always)]
    fn side_by_side<S: Simd, C: Counters>(
        &mut self,
        simd: S,
        (scene, blocks, rays): (&Triangles, &Blocks, &[Ray]),
        (first, count): (u32, usize),
        (half, lanes, leave): (usize, u64, &Row),
        counters: &mut [C],
    ) {
        let mut each = lanes;
        while each != 0 {
            counters[half + each.trailing_zeros() as usize].tests(count);
            each &= each - 1;
        }
        let (o, d) = (eight(simd, &self.o, half), eight(simd, &self.d, half));
        let leave = f32x8::from_slice(simd, &leave[half..half + HALF]);
        let (mut at, mut left) = (first, count);
        while left > 0 {
            let n = left.min(LANES);
            let (block, next) = blocks.block(at, n);
            for lane in 0..n {
                let corners = corners(block, n, lane);
                let reach = f32x8::from_slice(simd, &self.reach[half..half + HALF]).min(leave);
                let mut open = Free::new(corners).candidates(simd, o, d, reach) & lanes;
                while open != 0 {
                    let i = (half + open.trailing_zeros() as usize) % MOST;
                    open &= open - 1;
                    let id = block[1 + 9 * n + lane].to_bits();
                    let corners = || blocks.scene_corners(scene, id, corners);
                    let ray = (&rays[i], &self.frames[i]);
                    let best = &mut self.best[i];
                    best.offer::<Closest, C>(ray, id, corners, &mut counters[i]);
                    self.reach[i] = keep_min(best.reach, self.reach[i]);
                }
            }
            at = next;
            left -= n;
        }
    }

    /// Walks a ray alone.
    #[inline(always)]
    pub fn alone<S: Simd, W: Walk, C: Counters>(
        &mut self,
        simd: S,
        (walk, scratch): (&W, &mut W::Scratch),
        (scene, blocks, rays): (&Triangles, &Blocks, &[Ray]),
        i: usize,
        counters: &mut [C],
    ) {
        let ray = (&rays[i], &self.frames[i]);
        let triangles = (scene, blocks);
        let hit = walk.cast::<S, Closest, C>(simd, triangles, ray, scratch, &mut counters[i]);
        self.best[i] = Best::known(hit);
    }

    /// Hands on what the rays have found.
    #[inline(always)]
    pub fn finish(&self, write: &mut impl FnMut(usize, Hit)) {
        for (i, best) in self.best.iter().enumerate() {
            write(i, best.hit());
        }
    }
}

/// Eight of the rays.
#[inline(always)]
fn eight<S: Simd>(simd: S, rows: &[Row; 3], half: usize) -> [f32x8<S>; 3] {
    [
        f32x8::from_slice(simd, &rows[0][half..half + HALF]),
        f32x8::from_slice(simd, &rows[1][half..half + HALF]),
        f32x8::from_slice(simd, &rows[2][half..half + HALF]),
    ]
}

/// The corners of one of the `n` triangles of a block.
#[inline(always)]
fn corners(block: &[f32; SPAN], n: usize, lane: usize) -> [[f32; 3]; 3] {
    let corner = |row: usize| {
        let at = 1 + row * n + lane;
        [block[at], block[at + n], block[at + 2 * n]]
    };
    [corner(0), corner(3), corner(6)]
}
