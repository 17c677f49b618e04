// SPDX-License-Identifier: GPL-3.0-or-later
//! Tiles of rays with a common origin, and what a tree needs to know of them all at once: the range of
//! their directions, and the pyramid that holds them.
//!
//! A tile is a set of rays and nothing else: there is no camera here. Distances to planes are
//! intervals over the tile (the ranges of MLRTA, Reshetov et al. 2005), measured from the origin,
//! so directions of both signs are no exception. Rays that start elsewhere, or are odd in another way,
//! are left to a walk of single rays.

use super::batch::Walk;
use super::blocks::Blocks;
use super::frame::{Frame, PRUNE, TINY};
use super::query::{Closest, Counters};
use super::ray::{Hit, Ray};
use crate::geom::vec3::map;
use crate::geom::verdict::verdict_within;
use crate::scene::Triangles;
use fearless_simd::{Select, Simd, SimdBase, SimdMask, f32x16, mask32x16};

/// Rays side by side.
pub const LANES: usize = 16;

/// One number for each ray of a row.
pub type Row = [f32; LANES];

/// Tiles need origins and directions of ordinary size, so that nothing overflows.
const ORDINARY: f32 = 1_152_921_504_606_846_976.0;

/// Steps and triangles per ray after which the rays of a tile go on singly.
pub const BUDGET: usize = 12;

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
    /// How far from the origin a plane must be to be told from it, per axis.
    pub pad: [f32; 3],
    /// Bound on the error of the height of the origin over an oblique plane that meets the scene.
    pub oblique_pad: f32,
    /// Per axis how long rays take downwards and upwards.
    pub pace: [[Pace; 2]; 3],
    /// Per axis whether most rays go up.
    pub up: [bool; 3],
    /// The part of all rays inside the scene's box.
    pub inside: (f32, f32),
    /// Directions that hold all others between them.
    pub corners: Option<[[f32; 3]; 4]>,
    /// A distance in the scene's units times this is one in the frame.
    pub to_frame: f32,
    /// Added to distances in the frame for the rounding of the smallest ones.
    pub last_place: f32,
}

impl<const R: usize> Tile<R> {
    /// Of at least one ray and at most `16 R`.
    #[inline(always)]
    pub fn new<S: Simd>(simd: S, frame: &Frame, rays: &[Ray]) -> Self {
        let first = &rays[0];
        let longest = largest(first.d);
        let unit = f32::from_bits(longest.to_bits() & 0x7f80_0000);
        let mut tile = Self {
            o: first.o,
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
            pad: [0.0; 3],
            oblique_pad: 0.0,
            pace: [[Pace {
                least: f32::MAX,
                most: f32::INFINITY,
            }; 2]; 3],
            up: [true; 3],
            inside: (0.0, f32::NEG_INFINITY),
            corners: None,
            to_frame: unit,
            last_place: f32::from_bits(1) * unit + TINY,
        };
        for (i, ray) in rays.iter().enumerate() {
            let (row, lane) = (i / LANES, i % LANES);
            for k in 0..3 {
                tile.d[row][k][lane] = ray.d[k];
            }
            tile.t_min[row][lane] = ray.t_min;
            tile.t[row][lane] = ray.t_max;
            let same = (0..3).all(|k| ray.o[k].to_bits() == first.o[k].to_bits());
            tile.active[row] |= u16::from(same) << lane;
            tile.rest[row] |= 1 << lane;
        }
        let ordinary = frame.is_scene()
            && first.o.iter().all(|x| x.abs() < ORDINARY)
            && (ORDINARY.recip()..ORDINARY).contains(&unit);
        if !ordinary {
            tile.active = [0; R];
            return tile;
        }
        (tile.pad, tile.oblique_pad) = frame.pads(first.o);
        let ranges = tile.ranges(simd, unit);
        for row in 0..R {
            tile.rest[row] &= !tile.active[row];
        }
        if let Some(ranges) = ranges {
            tile.enter(simd, frame, ranges);
            tile.corners = tile.pyramid(simd, ranges);
        }
        tile
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

    /// Four directions between which all others lie: in the plane at height 1 along the axis along
    /// which all rays go, a parallelogram with the sides of the tile.
    #[inline(always)]
    fn pyramid<S: Simd>(&self, simd: S, ranges: [(f32, f32); 3]) -> Option<[[f32; 3]; 4]> {
        // Slopes stay below 8, and are off by less than 2^-20.
        let advance = |k: usize| ranges[k].0.max(-ranges[k].1);
        let axis = (0..3).fold(0, |a, b| if advance(b) > advance(a) { b } else { a });
        if advance(axis) < 0.25 {
            return None;
        }
        let [i, j] = [(axis + 1) % 3, (axis + 2) % 3];
        let slope = |ray: usize| {
            let d = |k: usize| self.d[ray / LANES][k][ray % LANES];
            [d(i) / d(axis), d(j) / d(axis)]
        };
        let first =
            (0..R * LANES).find(|&ray| self.active[ray / LANES] >> (ray % LANES) & 1 == 1)?;
        let origin = slope(first);
        let side = |ray: usize| {
            let s = slope(ray);
            [s[0] - origin[0], s[1] - origin[1]]
        };
        let (mut e1, mut e2) = ([1.0, 0.0], [0.0, 1.0]);
        let mut area: f32 = 1.0;
        if self.active.iter().all(|&row| row == u16::MAX) {
            // The ends of the first row of pixels and of the first column.
            let (right, down) = (side(R * LANES - 57), side(56));
            let (w, h) = (length(right), length(down));
            let cross = right[0] * down[1] - right[1] * down[0];
            if cross.abs() > 0.1 * w * h && w < 16.0 * h && h < 16.0 * w {
                (e1, e2, area) = (right, down, cross);
            }
        }
        let inverse = splat(simd, 1.0 / area);
        let mut low = [splat(simd, f32::INFINITY); 2];
        let mut high = [splat(simd, f32::NEG_INFINITY); 2];
        for row in 0..R {
            let active = mask32x16::from_bitmask(simd, u64::from(self.active[row]));
            let d = &self.d[row];
            let advance: f32x16<S> = active.select(load(simd, &d[axis]), splat(simd, 1.0));
            let x = load(simd, &d[i]) / advance - splat(simd, origin[0]);
            let y = load(simd, &d[j]) / advance - splat(simd, origin[1]);
            let parts = [
                (x * splat(simd, e2[1]) - y * splat(simd, e2[0])) * inverse,
                (y * splat(simd, e1[0]) - x * splat(simd, e1[1])) * inverse,
            ];
            for n in 0..2 {
                let below: f32x16<S> = active.select(parts[n], splat(simd, f32::INFINITY));
                let above: f32x16<S> = active.select(parts[n], splat(simd, f32::NEG_INFINITY));
                low[n] = low[n].min(below);
                high[n] = high[n].max(above);
            }
        }
        // Roundings of slopes, of the parts above and of the corners below move the sides by less
        // than 2^-18 in all, and by less than 10^-4 of the tile.
        let others = [length(e2), length(e1)];
        let ends = [
            (low[0].reduce_min(), high[0].reduce_max()),
            (low[1].reduce_min(), high[1].reduce_max()),
        ];
        let widened = |n: usize| {
            let (low, high): (f32, f32) = ends[n];
            let pad = 4e-6 * others[n] / area.abs() + 1e-4 * (1.0 + low.abs() + high.abs());
            [low - pad, high + pad]
        };
        let range = [widened(0), widened(1)];
        let sign = 1.0_f32.copysign(ranges[axis].0 + ranges[axis].1);
        let mut steepest = 0.0_f32;
        let mut corner = |a: usize, b: usize| {
            let at = |n: usize| origin[n] + range[0][a] * e1[n] + range[1][b] * e2[n];
            let mut corner = [0.0; 3];
            (corner[axis], corner[i], corner[j]) = (sign, sign * at(0), sign * at(1));
            steepest = steepest.max(at(0).abs()).max(at(1).abs());
            corner
        };
        let corners = [corner(0, 0), corner(1, 0), corner(0, 1), corner(1, 1)];
        // Error bounds want components below 2.
        let scale = match steepest {
            x if x < 1.75 => 1.0,
            x if x < 7.0 => 0.25,
            x if x < 28.0 => 0.0625,
            _ => return None,
        };
        let scaled = |n: usize| map(corners[n], |x| x * scale);
        Some([scaled(0), scaled(1), scaled(2), scaled(3)])
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
        let inside = ray.t_min <= found.t && found.t <= best && found.t < f32::INFINITY;
        // The number of no triangle is larger than all others.
        if !inside || (found.t == best && id > self.id[row][lane]) {
            return;
        }
        self.t[row][lane] = found.t;
        self.u[row][lane] = found.u;
        self.v[row][lane] = found.v;
        self.id[row][lane] = id;
        let reach = found.t * (self.to_frame * PRUNE) + self.last_place;
        self.reach[row][lane] = reach.min(self.reach[row][lane]);
    }

    /// Leaves all rays to walks of their own, which need look no farther than the tile did.
    pub fn give_up(&mut self) {
        for row in 0..R {
            self.rest[row] |= self.active[row];
        }
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

/// Hands on the hits of a tile that has been walked; the rays that it left out are walked singly, by
/// `single`.
#[inline(always)]
pub fn finish<S: Simd, W: Walk, C: Counters, const R: usize>(
    simd: S,
    tile: &Tile<R>,
    (single, triangles): (&W, (&Triangles, &Blocks)),
    (frame, rays): (&Frame, &[Ray]),
    write: &mut impl FnMut(usize, Hit),
    counters: &mut [C],
) {
    for (i, _) in rays.iter().enumerate() {
        write(i, tile.hit(i / LANES, i % LANES));
    }
    if tile.rest == [0; R] {
        return;
    }
    let mut scratch = single.scratch();
    for (i, ray) in rays.iter().enumerate() {
        let (row, lane) = (i / LANES, i % LANES);
        if tile.rest[row] >> lane & 1 == 0 {
            continue;
        }
        // The same hit again, or a better one.
        let found = tile.hit(row, lane);
        let t_max = if found.is_hit() { found.t } else { ray.t_max };
        let ray = Ray { t_max, ..*ray };
        let hit = match frame.ray(&ray) {
            Some(framed) => single.cast::<S, Closest, C>(
                simd,
                triangles,
                (&ray, &framed),
                &mut scratch,
                &mut counters[i],
            ),
            None => Hit::MISS,
        };
        write(i, hit);
    }
}

/// The same number for all.
#[inline(always)]
pub fn splat<S: Simd>(simd: S, x: f32) -> f32x16<S> {
    f32x16::splat(simd, x)
}

/// A row as a vector.
#[inline(always)]
pub fn load<S: Simd>(simd: S, row: &Row) -> f32x16<S> {
    f32x16::from_slice(simd, row)
}

#[inline(always)]
fn length(a: [f32; 2]) -> f32 {
    (a[0] * a[0] + a[1] * a[1]).sqrt()
}

/// The lanes of a mask.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "there are 16 lanes")]
pub fn bits<S: Simd>(mask: mask32x16<S>) -> u16 {
    mask.to_bitmask() as u16
}

#[inline(always)]
fn largest(a: [f32; 3]) -> f32 {
    a[0].abs().max(a[1].abs()).max(a[2].abs())
}
