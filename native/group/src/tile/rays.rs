// SPDX-License-Identifier: GPL-3.0-or-later
//! The rays of a tile with the bounds that hold for all of them, and their best hits.

use crate::tile::{Deferred, LANES, Pyramid, Row, StoredTriangle, load, splat};
use fearless_simd::{Select, Simd, SimdBase, SimdMask, f32x16, mask32x16};
use halfspace_geom::verdict::verdict_within;
use halfspace_leaf::Job;
use halfspace_nodes::projected_tree::CODES;
use halfspace_ray::frame::PRUNE;
use halfspace_ray::{Hit, HitKey, Interval, Ray};

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
    /// The common origin, in the frame.
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
    pub deferred: Deferred<R>,
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
    pub inside: Interval,
    /// The pyramid that contains all directions; `None` if they spread too far.
    pub pyramid: Option<Pyramid<R>>,
    /// Scale from distances `t` of the caller's rays to distances in the frame, a power of two.
    pub to_frame: f32,
    /// Error bound of subnormal distances, in the frame.
    pub last_place: f32,
    /// Mask of the numbered directions of a tree onto which the rays have been projected.
    pub known: u32,
    /// By direction: smallest and largest speed along it, and the height of the origin.
    pub projections: [[f32; 3]; CODES],
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
            deferred: Deferred::none(),
            pad: [0.0; 3],
            oblique_pad: 0.0,
            blur: [0.0; 2],
            pace: [[Pace {
                least: f32::MAX,
                most: f32::INFINITY,
            }; 2]; 3],
            up: [true; 3],
            inside: Interval::new(0.0, f32::NEG_INFINITY),
            pyramid: None,
            to_frame: 1.0,
            last_place: 0.0,
            known: 0,
            projections: [[0.0; 3]; CODES],
        }
    }

    /// Deactivates some rays of a row.
    #[inline(always)]
    pub fn deactivate<S: Simd>(&mut self, simd: S, row: usize, lanes: u16) {
        self.active[row] &= !lanes;
        let lanes = mask32x16::from_bitmask(simd, u64::from(lanes));
        let reach: f32x16<S> =
            lanes.select(splat(simd, f32::NEG_INFINITY), load(simd, &self.reach[row]));
        reach.store_slice(&mut self.reach[row]);
    }

    /// Whether at least half of `rays` are active; below that, a tile saves little.
    #[inline(always)]
    pub fn is_half_active(&self, rays: usize) -> bool {
        let active: u32 = self.active.iter().map(|row| row.count_ones()).sum();
        2 * active as usize >= rays
    }

    /// Applies the exact verdict to one ray's candidate and takes the hit if it precedes the best one.
    #[inline(never)]
    pub fn offer(
        &mut self,
        ray: &Ray,
        row: usize,
        lane: usize,
        triangle: StoredTriangle,
        job: Job<'_>,
    ) {
        let id = triangle.id;
        let best = HitKey::new(self.t[row][lane], self.id[row][lane]);
        let corners = triangle.scene_corners(job);
        let span = [ray.t_min, best.last_before(id)];
        let Some(found) = verdict_within(ray.o, ray.d, corners, span) else {
            return;
        };
        if !ray.reaches(found.t) || !HitKey::new(found.t, id).precedes(best) {
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
        self.inside.enter <= self.inside.leave
    }

    /// Leaves all active rays in `rest`. The traversals that continue them need to search only up to the tile's hits.
    pub fn give_up(&mut self) {
        for row in 0..R {
            self.rest[row] |= self.active[row];
        }
    }

    /// Largest `reach`, cut at `leave`, in units of the directions that end on the pyramid's base.
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
