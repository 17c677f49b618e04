// SPDX-License-Identifier: GPL-3.0-or-later
//! Tiles of rays with a common origin, with the bounds that a traversal needs of all of them: the range of
//! their directions, and the pyramid that contains them.
//!
//! A tile is a set of rays and does not depend on a camera. Distances to planes are intervals over the tile
//! (the ranges of MLRTA, Reshetov et al. 2005), measured from the origin, so directions of both signs need no
//! special case. Rays with another origin and irregular rays are left to single-ray traversals.

pub mod boxes;
pub mod kernel;
pub mod leaf;
pub mod nearest;
pub mod planes;
pub mod shadow;
pub mod verdict;
pub mod walk;

use fearless_simd::{Select, Simd, SimdBase, SimdMask, f32x16, mask32x16};
use halfspace_geom::verdict::verdict_within;
use halfspace_ray::frame::{Frame, PRUNE, last_place};
use halfspace_ray::{Hit, Ray};

mod backoff;
mod held;
mod pyramid;
mod row;
pub use backoff::{Backoff, Lately};
pub use held::Held;
pub use pyramid::Pyramid;
pub use row::{LANES, Numbers, Row, alike, bits, load, splat};

/// Range of regular numbers: coordinates of origins lie below its end, largest components of directions inside
/// it. Derived: a product or a quotient of two such numbers stays between 1e-36 and 1e36, with room for a few
/// additions before it overflows.
pub const ORDINARY: std::ops::Range<f32> = 1e-18..1e18;

/// The index of the ray in this lane of this row. A row is a square of 4 by 4 pixels among the 8 by 8 of 64
/// consecutive rays, which keeps its rays close together.
#[inline(always)]
pub const fn place(row: usize, lane: usize) -> usize {
    row / 4 * 64 + (row % 4 / 2 * 4 + lane / 4) * 8 + row % 2 * 4 + lane % 4
}

/// The row and lane of a ray; inverse of [`place`].
#[inline(always)]
pub const fn seat(ray: usize) -> (usize, usize) {
    let (x, y) = (ray % 8, ray / 8 % 8);
    (ray / 64 * 4 + y / 4 * 2 + x / 4, y % 4 * 4 + x % 4)
}

/// Bounds on the distance that the rays of a tile travel per unit of height along an axis, in one direction.
#[derive(Debug, Clone, Copy)]
pub struct Pace {
    /// That of the fastest ray; the largest float if no ray goes this way.
    pub least: f32,
    /// That of the slowest ray; infinite if some ray does not go this way.
    pub most: f32,
}

/// A tile of up to `16 R` rays and their best hits so far.
pub struct Tile<const R: usize> {
    /// The common origin.
    pub o: [f32; 3],
    /// Directions in the frame, per row and axis.
    pub d: [[Row; 3]; R],
    /// Masks of the active rays of each row.
    pub active: [u16; R],
    /// Masks of the other rays, which are traced outside the tile.
    pub rest: [u16; R],
    /// Distance beyond which no hit of the ray is needed, in the frame.
    pub reach: [Row; R],
    /// Largest `reach` of each row.
    pub row_reach: [f32; R],
    /// Largest `reach` of the tile.
    pub far: f32,
    /// The rays' `t_min`, in the scene's units.
    pub t_min: [Row; R],
    /// Distances of the best hits, or the rays' `t_max` if there is none yet, in the scene's units.
    pub t: [Row; R],
    /// Barycentric weights of the second vertices.
    pub u: [Row; R],
    /// Barycentric weights of the third vertices.
    pub v: [Row; R],
    /// Numbers of the triangles hit.
    pub id: [[u32; LANES]; R],
    /// Certain hits whose exact distances are not computed yet.
    pub held: Held<R>,
    /// Error bounds of the origin's distance to planes across each axis.
    pub pad: [f32; 3],
    /// Error bound of the origin's height above oblique planes that meet the scene.
    pub oblique_pad: f32,
    /// Largest distance between the common origin and the rays' lines, in the scene's units, and the largest
    /// change of direction it causes, in the frame.
    pub blur: [f32; 2],
    /// Paces per axis, descending and ascending.
    pub pace: [[Pace; 2]; 3],
    /// Whether most rays ascend, per axis.
    pub up: [bool; 3],
    /// Interval of distances in which the tile's rays are inside the scene's box.
    pub inside: (f32, f32),
    /// The pyramid that contains all directions; `None` if they spread too far.
    pub pyramid: Option<Pyramid<R>>,
    /// Scale from distances `t` of the caller's rays to distances in the frame, a power of two.
    pub to_frame: f32,
    /// Error bound of subnormal distances, in the frame.
    pub last_place: f32,
}

impl<const R: usize> Tile<R> {
    /// A tile without rays.
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

    /// Loads at least one ray and at most `16 R`, and resets all other state. Compiled once for all trees.
    #[inline(never)]
    pub fn fill<S: Simd>(&mut self, simd: S, frame: &Frame, rays: &[Ray]) {
        simd.vectorize(
            #[inline(always)]
            || self.filled(simd, frame, rays),
        );
    }

    /// Sets origin and scale for directions whose largest component is about `longest`.
    #[inline(always)]
    fn aim(&mut self, o: [f32; 3], longest: f32) {
        let unit = f32::from_bits(longest.to_bits() & 0x7f80_0000);
        self.o = o;
        self.to_frame = unit;
        self.last_place = last_place(f64::from(unit));
    }

    /// Removes all rays. State without a meaning for an empty tile is left as it is.
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

    /// Loads rays: rows of a full tile as vectors, others ray by ray. Rays with the first one's origin become
    /// active.
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

    /// A tile of directions from a common origin that end at their points, at distance 1. `longest` is their
    /// largest component; of the rays `there` those in `active` take part.
    #[inline(always)]
    pub fn turned(
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

    /// Scales such a tile into the frame; returns the largest difference of its directions relative to the
    /// longest. `None` if they differ too much or are irregular.
    #[inline(always)]
    pub fn settle_in<S: Simd>(&mut self, simd: S, frame: &Frame) -> Option<f32> {
        if !self.is_ordinary(frame) {
            return None;
        }
        self.begin(simd, frame);
        let pyramid = self.pyramid.as_ref()?;
        // Measure the largest extent of the pyramid's base.
        let mut spread = 0.0_f32;
        for k in 0..3 {
            let at = |i: usize| pyramid.corners[i][k];
            let low = at(0).min(at(1)).min(at(2)).min(at(3));
            let high = at(0).max(at(1)).max(at(2)).max(at(3));
            spread = spread.max(high - low);
        }
        Some(spread)
    }

    /// Deactivates some rays of a row.
    #[inline(always)]
    pub fn stop<S: Simd>(&mut self, simd: S, row: usize, lanes: u16) {
        self.active[row] &= !lanes;
        let lanes = mask32x16::from_bitmask(simd, u64::from(lanes));
        let reach: f32x16<S> =
            lanes.select(splat(simd, f32::NEG_INFINITY), load(simd, &self.reach[row]));
        reach.store_slice(&mut self.reach[row]);
    }

    /// Whether at least half of `rays` are active; below that, a tile saves little.
    #[inline(always)]
    pub fn is_worth_it(&self, rays: usize) -> bool {
        let active: u32 = self.active.iter().map(|row| row.count_ones()).sum();
        2 * active as usize >= rays
    }

    /// Whether origin and scale are in the range where nothing overflows.
    #[inline(always)]
    fn is_ordinary(&self, frame: &Frame) -> bool {
        frame.is_scene()
            && self.o.iter().all(|x| x.abs() < ORDINARY.end)
            && ORDINARY.contains(&self.to_frame)
    }

    /// Scales the active rays into the frame, clips them to the scene's box and computes the pyramid.
    #[inline(always)]
    fn begin<S: Simd>(&mut self, simd: S, frame: &Frame) {
        (self.pad, self.oblique_pad) = frame.pads(self.o);
        let blur = self.blur[0];
        // A height changes by at most the blur times the sum of the normal's components, which is 1.74.
        for pad in &mut self.pad {
            *pad += 1.01 * blur;
        }
        self.oblique_pad += 2.0 * blur;
        // Scale the directions; rays that are irregular are left to others.
        let ranges = self.ranges(simd, self.to_frame);
        for row in 0..R {
            self.rest[row] &= !self.active[row];
        }
        if let Some(ranges) = ranges {
            self.enter(simd, frame, ranges);
            self.pyramid = Pyramid::new(simd, self, ranges);
        }
    }

    /// Scales directions into the frame and deactivates irregular rays. Returns the range of each direction
    /// component over the others, `None` if there are none.
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
            // Infinity or NaN multiplied by zero is NaN.
            let finite =
                (d[0] * splat(simd, 0.0) + d[1] * splat(simd, 0.0) + d[2] * splat(simd, 0.0))
                    .simd_eq(splat(simd, 0.0));
            let t_min = load(simd, &self.t_min[row]);
            let t_max = load(simd, &self.t[row]);
            // Keep rays of similar direction length and with a valid interval ahead of the origin.
            let fine = finite
                & longest.simd_ge(splat(simd, 0.5 * unit))
                & longest.simd_lt(splat(simd, 2.0 * unit))
                & t_min.simd_ge(splat(simd, 0.0))
                & t_max.simd_ge(t_min);
            self.active[row] &= bits(fine);
            let fine = mask32x16::from_bitmask(simd, u64::from(self.active[row]));
            // Scale the directions and reduce their range.
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

    /// Clips the rays to the scene's box and computes their paces.
    #[inline(always)]
    fn enter<S: Simd>(&mut self, simd: S, frame: &Frame, ranges: [(f32, f32); 3]) {
        let bounds = frame.bounds();
        let (mut enter, mut leave) = (0.0_f32, f32::INFINITY);
        // Bound the interval inside each slab by the fastest and the slowest ray.
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
            // Rays that do not all move to the same side may stay in the slab without end.
            leave = leave.min(if low > 0.0 {
                (ceiling + pad).max(0.0) * up.most
            } else if high < 0.0 {
                (pad - floor).max(0.0) * down.most
            } else {
                f32::INFINITY
            });
        }
        // Cut each ray's reach at that interval.
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

    /// Applies the exact verdict to one ray's candidate and takes the hit if it precedes the best one.
    #[inline(never)]
    pub fn offer(
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

    /// Whether any ray is inside the scene's box.
    #[inline(always)]
    pub fn is_inside(&self) -> bool {
        self.inside.0 <= self.inside.1
    }

    /// Leaves all active rays to other traversals, which need to search only up to the tile's hits.
    pub fn give_up(&mut self) {
        for row in 0..R {
            self.rest[row] |= self.active[row];
        }
    }

    /// Largest `reach` below `leave`, in units of the directions that end on the pyramid's base.
    #[inline(always)]
    pub fn stretched(&self, pyramid: &Pyramid<R>, leave: f32) -> f32 {
        let mut far = f32::NEG_INFINITY;
        for row in 0..R {
            far = far.max(self.row_reach[row].min(leave) * pyramid.stretch[row]);
        }
        far
    }

    /// The best hit of a ray so far.
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
