// SPDX-License-Identifier: GPL-3.0-or-later
//! Tiles of rays with a common origin, and what a tree needs to know of them all at once: the range of
//! their directions, and the pyramid that holds them.
//!
//! A tile is a set of rays and nothing else: there is no camera here. Distances to planes are
//! intervals over the tile (the ranges of MLRTA, Reshetov et al. 2005), measured from the origin,
//! so directions of both signs are no exception. Rays that start elsewhere, or are odd in another way,
//! are left to a walk of single rays.

use super::frame::{Frame, PRUNE, last_place};
use super::ray::{Hit, Ray};
use crate::geom::verdict::verdict_within;
use fearless_simd::{Select, Simd, SimdBase, SimdMask, f32x16, mask32x16};

mod backoff;
mod held;
mod pyramid;
mod row;
pub use backoff::{Backoff, Lately};
pub use held::Held;
pub use pyramid::Pyramid;
pub use row::{LANES, Numbers, Row, alike, bits, load, splat};

/// Origins nearer than the upper end, and directions whose longest component is between both, are ordinary: a product or
/// a quotient of two stays inside 1e-36 to 1e36, with room for a few additions before it overflows.
pub(super) const ORDINARY: std::ops::Range<f32> = 1e-18..1e18;

/// The ray that sits in this lane of this row: a row is a square of 4 by 4 of the 8 by 8 pixels that 64
/// rays in a row stand for, so that its rays stay together.
#[inline(always)]
pub const fn place(row: usize, lane: usize) -> usize {
    row / 4 * 64 + (row % 4 / 2 * 4 + lane / 4) * 8 + row % 2 * 4 + lane % 4
}

/// The row and lane where a ray sits.
#[inline(always)]
pub const fn seat(ray: usize) -> (usize, usize) {
    let (x, y) = (ray % 8, ray / 8 % 8);
    (ray / 64 * 4 + y / 4 * 2 + x / 4, y % 4 * 4 + x % 4)
}

/// How long rays of a tile take for a unit of height along an axis, in one direction.
#[derive(Debug, Clone, Copy)]
pub struct Pace {
    /// The quickest; the largest float if none goes there.
    pub least: f32,
    /// The slowest; infinite if some do not go there at all.
    pub most: f32,
}

/// A tile of up to `16 R` rays and their best hits so far.
pub struct Tile<const R: usize> {
    /// The common origin.
    pub o: [f32; 3],
    /// Directions in the frame, per row the axes.
    pub d: [[Row; 3]; R],
    /// The rays of each row that take part.
    pub active: [u16; R],
    /// The others, which need walks of their own.
    pub rest: [u16; R],
    /// How far each ray still has to look, in the frame.
    pub reach: [Row; R],
    /// The farthest of each row.
    pub row_reach: [f32; R],
    /// The farthest of all.
    pub far: f32,
    /// No hit counts before this, in the scene's units.
    pub t_min: [Row; R],
    /// The best hits, or how far the rays go, in the scene's units.
    pub t: [Row; R],
    pub(super) u: [Row; R],
    pub(super) v: [Row; R],
    /// The triangles hit, bit patterns of their numbers.
    pub(super) id: [[u32; LANES]; R],
    /// Hits that are certain, but not worked out yet.
    pub(super) held: Held<R>,
    /// How far from the origin a plane must be to be told from it, per axis.
    pub pad: [f32; 3],
    /// Bound on the error of the height of the origin over an oblique plane that meets the scene.
    pub oblique_pad: f32,
    /// How far off their common origin the lines of the rays may pass, in the scene's units and, as far as that
    /// turns their directions, in the frame.
    pub blur: [f32; 2],
    /// Per axis how long rays take downwards and upwards.
    pub pace: [[Pace; 2]; 3],
    /// Per axis whether most rays go up.
    pub up: [bool; 3],
    /// The part of all rays inside the scene's box.
    pub inside: (f32, f32),
    /// What holds all directions between it.
    pub pyramid: Option<Pyramid<R>>,
    /// A distance in the scene's units times this is one in the frame.
    pub to_frame: f32,
    /// Added to distances in the frame for the rounding of the smallest ones.
    pub last_place: f32,
}

impl<const R: usize> Tile<R> {
    /// Without rays.
    #[inline(always)]
    pub fn none() -> Self {
        Self {
            o: [0.0; 3],
            d: [[[0.0; LANES]; 3]; R],
            active: [0; R],
            rest: [0; R],
            reach: [[f32::NEG_INFINITY; LANES]; R],
            row_reach: [f32::NEG_INFINITY; R],
            far: f32::NEG_INFINITY,
            t_min: [[0.0; LANES]; R],
            t: [[f32::NEG_INFINITY; LANES]; R],
            u: [[0.0; LANES]; R],
            v: [[0.0; LANES]; R],
            id: [[Hit::NONE; LANES]; R],
            held: Held::none(),
            pad: [0.0; 3],
            oblique_pad: 0.0,
            blur: [0.0; 2],
            pace: [[Pace {
                least: f32::MAX,
                most: f32::INFINITY,
            }; 2]; 3],
            up: [true; 3],
            inside: (0.0, f32::NEG_INFINITY),
            pyramid: None,
            to_frame: 1.0,
            last_place: 0.0,
        }
    }

    /// Takes in at least one ray and at most `16 R`, and forgets all others. One function for all trees.
    #[inline(never)]
    pub fn fill<S: Simd>(&mut self, simd: S, frame: &Frame, rays: &[Ray]) {
        simd.vectorize(
            #[inline(always)]
            || self.filled(simd, frame, rays),
        );
    }

    /// For rays from this origin whose directions are about this long.
    #[inline(always)]
    fn aim(&mut self, o: [f32; 3], longest: f32) {
        let unit = f32::from_bits(longest.to_bits() & 0x7f80_0000);
        self.o = o;
        self.to_frame = unit;
        self.last_place = last_place(f64::from(unit));
    }

    /// Forgets the rays. Numbers that are of no meaning without rays stay.
    #[inline(always)]
    fn clear(&mut self) {
        self.active = [0; R];
        self.rest = [0; R];
        self.reach = [[f32::NEG_INFINITY; LANES]; R];
        self.row_reach = [f32::NEG_INFINITY; R];
        self.far = f32::NEG_INFINITY;
        self.id = [[Hit::NONE; LANES]; R];
        self.held.clear();
        self.blur = [0.0; 2];
        self.inside = (0.0, f32::NEG_INFINITY);
        self.pyramid = None;
    }

    #[inline(always)]
    fn filled<S: Simd>(&mut self, simd: S, frame: &Frame, rays: &[Ray]) {
        let first = &rays[0];
        self.clear();
        self.aim(first.o, largest(first.d));
        if rays.len() == R * LANES {
            for row in 0..R {
                let own = Numbers::of_row(simd, rays, row);
                let same = alike(own.o[0], splat(simd, first.o[0]))
                    & alike(own.o[1], splat(simd, first.o[1]))
                    & alike(own.o[2], splat(simd, first.o[2]));
                self.active[row] = same;
                self.rest[row] = u16::MAX;
                for k in 0..3 {
                    own.d[k].store_slice(&mut self.d[row][k]);
                }
                own.t_min.store_slice(&mut self.t_min[row]);
                own.t_max.store_slice(&mut self.t[row]);
            }
        } else {
            for (i, ray) in rays.iter().enumerate() {
                let (row, lane) = seat(i);
                let same = (0..3).all(|k| ray.o[k].to_bits() == first.o[k].to_bits());
                self.active[row] |= u16::from(same) << lane;
                self.rest[row] |= 1 << lane;
                for k in 0..3 {
                    self.d[row][k][lane] = ray.d[k];
                }
                self.t_min[row][lane] = ray.t_min;
                self.t[row][lane] = ray.t_max;
            }
        }
        if self.is_ordinary(frame) && self.is_worth_it(rays.len()) {
            self.begin(simd, frame);
        } else {
            self.active = [0; R];
        }
    }

    /// Of directions from a common origin, the longest component of which is given; the `active` of all that are
    /// `there` take part, as far as the ends of the directions.
    #[inline(always)]
    pub(super) fn turned(
        o: [f32; 3],
        longest: f32,
        d: [[Row; 3]; R],
        (active, there): ([u16; R], [u16; R]),
    ) -> Self {
        let mut tile = Self::none();
        tile.aim(o, longest);
        tile.d = d;
        tile.active = active;
        tile.rest = there;
        tile.t = [[1.0 + 1e-6; LANES]; R];
        tile
    }

    /// Brings such a tile into the frame; returns by how much its directions differ, in parts of the longest.
    /// `None` if they differ too much, or are odd.
    #[inline(always)]
    pub(super) fn settle_in<S: Simd>(&mut self, simd: S, frame: &Frame) -> Option<f32> {
        if !self.is_ordinary(frame) {
            return None;
        }
        self.begin(simd, frame);
        let pyramid = self.pyramid.as_ref()?;
        let mut spread = 0.0_f32;
        for k in 0..3 {
            let at = |i: usize| pyramid.corners[i][k];
            let low = at(0).min(at(1)).min(at(2)).min(at(3));
            let high = at(0).max(at(1)).max(at(2)).max(at(3));
            spread = spread.max(high - low);
        }
        Some(spread)
    }

    /// Ends some rays of a row.
    #[inline(always)]
    pub(super) fn stop<S: Simd>(&mut self, simd: S, row: usize, lanes: u16) {
        self.active[row] &= !lanes;
        let lanes = mask32x16::from_bitmask(simd, u64::from(lanes));
        let reach: f32x16<S> =
            lanes.select(splat(simd, f32::NEG_INFINITY), load(simd, &self.reach[row]));
        reach.store_slice(&mut self.reach[row]);
    }

    /// Whether at least half of so many rays take part: a walk for fewer spares little.
    #[inline(always)]
    pub(super) fn is_worth_it(&self, rays: usize) -> bool {
        let active: u32 = self.active.iter().map(|row| row.count_ones()).sum();
        2 * active as usize >= rays
    }

    /// Whether nothing overflows, as far as the origin and the scale tell.
    #[inline(always)]
    fn is_ordinary(&self, frame: &Frame) -> bool {
        frame.is_scene()
            && self.o.iter().all(|x| x.abs() < ORDINARY.end)
            && ORDINARY.contains(&self.to_frame)
    }

    /// Brings the active rays into the frame and to the scene's box.
    #[inline(always)]
    fn begin<S: Simd>(&mut self, simd: S, frame: &Frame) {
        (self.pad, self.oblique_pad) = frame.pads(self.o);
        let blur = self.blur[0];
        // A height changes by at most the sum of the normal's components times that, which is 1.74.
        for pad in &mut self.pad {
            *pad += 1.01 * blur;
        }
        self.oblique_pad += 2.0 * blur;
        let ranges = self.ranges(simd, self.to_frame);
        for row in 0..R {
            self.rest[row] &= !self.active[row];
        }
        if let Some(ranges) = ranges {
            self.enter(simd, frame, ranges);
            self.pyramid = Pyramid::new(simd, self, ranges);
        }
    }

    /// Brings directions into the frame, leaves out odd rays and returns the range of the directions
    /// of the others, if there are any.
    #[inline(always)]
    fn ranges<S: Simd>(&mut self, simd: S, unit: f32) -> Option<[(f32, f32); 3]> {
        let mut low = [splat(simd, f32::INFINITY); 3];
        let mut high = [splat(simd, f32::NEG_INFINITY); 3];
        let inverse = splat(simd, 1.0 / unit);
        for row in 0..R {
            if self.active[row] == 0 {
                continue;
            }
            let [x, y, z] = &self.d[row];
            let d = [load(simd, x), load(simd, y), load(simd, z)];
            let longest = d[0].abs().max(d[1].abs()).max(d[2].abs());
            // Infinity and NaN times zero is NaN.
            let finite =
                (d[0] * splat(simd, 0.0) + d[1] * splat(simd, 0.0) + d[2] * splat(simd, 0.0))
                    .simd_eq(splat(simd, 0.0));
            let t_min = load(simd, &self.t_min[row]);
            let t_max = load(simd, &self.t[row]);
            let fine = finite
                & longest.simd_ge(splat(simd, 0.5 * unit))
                & longest.simd_lt(splat(simd, 2.0 * unit))
                & t_min.simd_ge(splat(simd, 0.0))
                & t_max.simd_ge(t_min);
            self.active[row] &= bits(fine);
            let fine = mask32x16::from_bitmask(simd, u64::from(self.active[row]));
            for k in 0..3 {
                let d = d[k] * inverse;
                d.store_slice(&mut self.d[row][k]);
                let below: f32x16<S> = fine.select(d, splat(simd, f32::INFINITY));
                let above: f32x16<S> = fine.select(d, splat(simd, f32::NEG_INFINITY));
                low[k] = low[k].min(below);
                high[k] = high[k].max(above);
            }
        }
        let ranges = [
            (low[0].reduce_min(), high[0].reduce_max()),
            (low[1].reduce_min(), high[1].reduce_max()),
            (low[2].reduce_min(), high[2].reduce_max()),
        ];
        (ranges[0].0 <= ranges[0].1).then_some(ranges)
    }

    /// Cuts the rays to the scene's box.
    #[inline(always)]
    fn enter<S: Simd>(&mut self, simd: S, frame: &Frame, ranges: [(f32, f32); 3]) {
        let bounds = frame.bounds();
        let (mut enter, mut leave) = (0.0_f32, f32::INFINITY);
        for (k, (low, high)) in ranges.into_iter().enumerate() {
            let pace = |slow: f32, fast: f32| Pace {
                least: if fast > 0.0 { 1.0 / fast } else { f32::MAX },
                most: if slow > 0.0 {
                    1.0 / slow
                } else {
                    f32::INFINITY
                },
            };
            self.pace[k] = [pace(-high, -low), pace(low, high)];
            self.up[k] = low + high > 0.0;
            let [down, up] = self.pace[k];
            let (floor, ceiling) = (bounds.min[k] - self.o[k], bounds.max[k] - self.o[k]);
            let pad = self.pad[k];
            enter = enter
                .max((floor - pad).max(0.0) * up.least)
                .max((-ceiling - pad).max(0.0) * down.least);
            // Rays that go neither up nor down, or both ways, may stay for ever.
            leave = leave.min(if low > 0.0 {
                (ceiling + pad).max(0.0) * up.most
            } else if high < 0.0 {
                (pad - floor).max(0.0) * down.most
            } else {
                f32::INFINITY
            });
        }
        let mut soonest = splat(simd, f32::INFINITY);
        for row in 0..R {
            let active = mask32x16::from_bitmask(simd, u64::from(self.active[row]));
            let t_max = load(simd, &self.t[row]);
            let reach = (t_max * splat(simd, self.to_frame * PRUNE) + splat(simd, self.last_place))
                .min(splat(simd, leave));
            let reach: f32x16<S> = active.select(reach, splat(simd, f32::NEG_INFINITY));
            reach.store_slice(&mut self.reach[row]);
            self.row_reach[row] = reach.reduce_max();
            self.far = self.far.max(self.row_reach[row]);
            let t_min = load(simd, &self.t_min[row]);
            let t_min: f32x16<S> = active.select(t_min, splat(simd, f32::INFINITY));
            soonest = soonest.min(t_min);
        }
        let soonest = soonest.reduce_min() * (self.to_frame * (2.0 - PRUNE)) - self.last_place;
        self.inside = (enter.max(soonest), leave.min(self.far));
    }

    /// Puts one ray's candidate to the verdict.
    #[inline(never)]
    pub(super) fn offer(
        &mut self,
        ray: &Ray,
        (row, lane): (usize, usize),
        (id, corners): (u32, [[f32; 3]; 3]),
    ) {
        let best = self.t[row][lane];
        let Some(found) = verdict_within(ray.o, ray.d, corners, [ray.t_min, best]) else {
            return;
        };
        if !ray.reaches(found.t) || !Hit::precedes((found.t, id), (best, self.id[row][lane])) {
            return;
        }
        self.t[row][lane] = found.t;
        self.u[row][lane] = found.u;
        self.v[row][lane] = found.v;
        self.id[row][lane] = id;
        let reach = found.t * (self.to_frame * PRUNE) + self.last_place;
        self.reach[row][lane] = reach.min(self.reach[row][lane]);
    }

    /// Whether there is something to walk.
    #[inline(always)]
    pub fn is_inside(&self) -> bool {
        self.inside.0 <= self.inside.1
    }

    /// Leaves all rays to walks of their own, which need look no farther than the tile did.
    pub fn give_up(&mut self) {
        for row in 0..R {
            self.rest[row] |= self.active[row];
        }
    }

    /// How far any ray still has to look before `leave`, in lengths of what lies in the pyramid.
    #[inline(always)]
    pub(super) fn stretched(&self, pyramid: &Pyramid<R>, leave: f32) -> f32 {
        let mut far = f32::NEG_INFINITY;
        for row in 0..R {
            far = far.max(self.row_reach[row].min(leave) * pyramid.stretch[row]);
        }
        far
    }

    /// The best hit of a ray.
    #[inline(always)]
    pub fn hit(&self, row: usize, lane: usize) -> Hit {
        let triangle = self.id[row][lane];
        if triangle == Hit::NONE {
            return Hit::MISS;
        }
        Hit {
            t: self.t[row][lane],
            triangle,
            u: self.u[row][lane],
            v: self.v[row][lane],
        }
    }
}

#[inline(always)]
fn largest(a: [f32; 3]) -> f32 {
    a[0].abs().max(a[1].abs()).max(a[2].abs())
}
