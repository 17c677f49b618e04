// SPDX-License-Identifier: GPL-3.0-or-later
//! The rays of a batch with a common origin or direction, sorted by octant and by bin.

use crate::form::{Form, Parallel};
use crate::raster::{Extent, Raster};
use fearless_simd::{Simd, SimdBase, f32x8};
use halfspace_ray::Ray;
use halfspace_ray::frame::Frame;

/// Rays per vector.
pub const LANES: usize = 8;

/// Number of octants.
const OCTANTS: usize = 8;

/// Octant of rays that are in no beam.
const NO_BEAM: u8 = 8;

/// One number per ray.
type Row = Vec<f32>;

/// Sorted rays. The rows are longer than the rays by one vector, so that loads may read past the end.
#[derive(Default)]
pub struct Sorted {
    /// Ways of the rays ([`Form`]), in the order of their octant: of rays from a point the absolute components of the
    /// direction in the frame, of parallel rays their places.
    pub ways: [Row; 3],
    /// Largest distance along the beam of a hit that could be better; negative infinity for rays that have ended.
    pub reach: Row,
    /// Indices in the batch.
    pub ids: Vec<u32>,
    /// The octants with rays.
    pub groups: Vec<Group>,
    /// The numbers that only parallel rays have.
    pub own: Own,
}

/// Data of each of the parallel rays that search for nearest hits; else empty.
#[derive(Default)]
pub struct Own {
    /// Origins in the frame.
    pub origins: [Row; 3],
    /// Largest distance, in the frame, of a hit that could be better.
    pub reach: Row,
    /// Distance along the beam at which the ray begins.
    pub start: Row,
}

/// The rays of one octant.
pub struct Group {
    /// Bit `k` is set for rays that descend along axis `k`.
    pub signs: u32,
    /// Extent of the rays.
    pub extent: Extent,
    /// Their bins.
    pub raster: Raster,
}

/// Rays in the order of the batch.
pub struct Given {
    ids: Vec<u32>,
    ways: [Row; 3],
    reach: Row,
    octant: Vec<u8>,
    own: Own,
    /// Indices of the rays that are not of this origin or direction, or that are traced singly.
    pub rest: Vec<u32>,
}

impl Given {
    /// Room for the rays with these indices.
    fn new(ids: &[u32]) -> Self {
        let room = ids.len().next_multiple_of(LANES);
        Self {
            ids: ids.to_vec(),
            ways: [(); 3].map(|()| vec![1.0; room]),
            reach: vec![f32::NEG_INFINITY; room],
            octant: vec![NO_BEAM; room],
            own: Own::default(),
            rest: Vec::new(),
        }
    }

    /// Those of some rays that begin at `o`; the others, and those that need the frame's slow path or that may hit
    /// something behind their origin, are left for single rays.
    #[inline(always)]
    pub fn from_point(frame: &Frame, rays: &[Ray], ids: &[u32], o: [f32; 3]) -> Self {
        let mut given = Self::new(ids);
        let bits = |v: [f32; 3]| v.map(f32::to_bits);
        let own = bits(o);
        for (at, &id) in ids.iter().enumerate() {
            let ray = &rays[id as usize];
            let size = ray.d.map(f32::abs);
            let longest = size[0].max(size[1]).max(size[2]);
            // Infinity and NaN multiplied by zero are NaN.
            let finite = ray.d[0] * 0.0 + ray.d[1] * 0.0 + ray.d[2] * 0.0 == 0.0;
            let plain = finite & (longest > 2.0 * f32::MIN_POSITIVE) & (longest < 1e38);
            let ahead = (ray.t_min >= 0.0) & (ray.t_min <= ray.t_max);
            if !(plain & ahead & (bits(ray.o) == own)) {
                given.rest.push(id);
                continue;
            }
            // Divide by the power of two of the longest component; the reciprocal has the opposite exponent.
            let unit = f32::from_bits(longest.to_bits() & 0x7f80_0000);
            let inverse = f32::from_bits(0x7f00_0000 - unit.to_bits());
            let mut octant = 0;
            for (k, size) in size.into_iter().enumerate() {
                given.ways[k][at] = size * inverse;
                octant |= u8::from(ray.d[k].is_sign_negative()) << k;
            }
            given.octant[at] = octant;
            given.reach[at] = if ray.t_max == f32::INFINITY {
                f32::INFINITY
            } else {
                frame.interval(ray, unit)[1]
            };
        }
        given
    }

    /// Those of some rays that have direction `d`, and whose origin the frame does not round. Rays that certainly miss
    /// the root are in no beam, and not left either.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "below 8")]
    pub fn along(frame: &Frame, rays: &[Ray], ids: &[u32], form: &Parallel, d: [f32; 3]) -> Self {
        let mut given = Self::new(ids);
        let room = given.reach.len();
        if !form.reversed {
            given.own = Own {
                origins: [(); 3].map(|()| vec![0.0; room]),
                reach: vec![f32::NEG_INFINITY; room],
                start: vec![f32::INFINITY; room],
            };
        }
        let bits = |v: [f32; 3]| v.map(f32::to_bits);
        let own = bits(d);
        for (at, &id) in ids.iter().enumerate() {
            let ray = &rays[id as usize];
            let o = frame.point(ray.o);
            let exact = o.iter().all(|x| x.is_finite()) && frame.map().is_exact(o);
            if !(bits(ray.d) == own && exact && ray.t_min <= ray.t_max) {
                given.rest.push(id);
                continue;
            }
            let Some(placed) = form.place(o) else {
                continue;
            };
            given.octant[at] = form.signs as u8;
            let interval = frame.interval(ray, form.unit());
            let [start, end] = form.interval(placed.origin, interval);
            given.reach[at] = end;
            for k in 0..3 {
                given.ways[k][at] = placed.way[k];
            }
            if !form.reversed {
                for (row, x) in given.own.origins.iter_mut().zip(o) {
                    row[at] = x;
                }
                given.own.reach[at] = interval[1];
                given.own.start[at] = start;
            }
        }
        given
    }

    /// The points of eight rays in the plane of polygons.
    #[inline(always)]
    fn places<S: Simd, F: Form>(&self, simd: S, form: &F, block: usize) -> [[f32; LANES]; 2] {
        let way = [0, 1, 2].map(|k: usize| eight(simd, &self.ways[k], block));
        form.places(simd, way).map(|row| {
            let mut numbers = [0.0; LANES];
            row.store_slice(&mut numbers);
            numbers
        })
    }

    /// The extents of the rays of each octant.
    #[inline(always)]
    fn extents<S: Simd, F: Form>(&self, simd: S, form: &F) -> [Extent; OCTANTS] {
        let mut extents = [Extent::NOTHING; OCTANTS];
        for block in (0..self.octant.len()).step_by(LANES) {
            let [p, q] = self.places(simd, form, block);
            let own = &self.octant[block..block + LANES];
            // Add all rays at once if they are of one octant, as most neighbours are.
            if own.iter().all(|octant| *octant == own[0]) {
                if let Some(extent) = extents.get_mut(usize::from(own[0])) {
                    extent.add_all(simd, &p, &q);
                }
                continue;
            }
            for ((octant, p), q) in own.iter().zip(p).zip(q) {
                if let Some(extent) = extents.get_mut(usize::from(*octant)) {
                    extent.add([p, q]);
                }
            }
        }
        extents
    }
}

impl Sorted {
    /// Sorts the rays of one origin or direction.
    #[inline(always)]
    pub fn new<S: Simd, F: Form>(simd: S, form: &F, given: &Given) -> Self {
        let mut sorted = Self::default();
        // Number the bins of all octants, one octant after the other, and count their rays.
        let mut numbers = [usize::MAX; OCTANTS];
        for (octant, extent) in given.extents(simd, form).iter().enumerate() {
            if extent.count != 0 {
                numbers[octant] = sorted.groups.len();
                sorted.groups.push(Group {
                    signs: u32::try_from(octant).expect("below 8"),
                    extent: *extent,
                    raster: Raster::new(extent),
                });
            }
        }
        sorted.distribute(simd, form, given, &numbers);
        sorted
    }

    /// Moves the rays to their bins.
    #[inline(always)]
    fn distribute<S: Simd, F: Form>(
        &mut self,
        simd: S,
        form: &F,
        given: &Given,
        numbers: &[usize; OCTANTS],
    ) {
        let room = given.octant.len();
        let mut bins = vec![0_u32; room];
        for block in (0..room).step_by(LANES) {
            let [p, q] = given.places(simd, form, block);
            for (i, place) in (block..).zip(p.into_iter().zip(q)) {
                let octant = usize::from(given.octant[i]);
                if octant < OCTANTS {
                    let raster = &mut self.groups[numbers[octant]].raster;
                    bins[i] = raster.bin(place.into());
                    raster.first[bins[i] as usize] += 1;
                }
            }
        }
        // Turn counts into the index behind the last ray of each bin; filling the bins makes it that of the first.
        let mut sum = 0;
        for group in &mut self.groups {
            for count in &mut group.raster.first {
                sum += *count;
                *count = sum;
            }
        }
        let total = sum as usize;
        let length = total + LANES;
        let nearest = !given.own.reach.is_empty();
        self.ways = [(); 3].map(|()| vec![1.0; length]);
        self.reach = vec![f32::NEG_INFINITY; length];
        self.ids = vec![0; length];
        if nearest {
            self.own = Own {
                origins: [(); 3].map(|()| vec![0.0; length]),
                reach: vec![0.0; length],
                start: vec![0.0; length],
            };
        }
        for i in (0..room).rev() {
            let octant = usize::from(given.octant[i]);
            if octant >= OCTANTS {
                continue;
            }
            let first = &mut self.groups[numbers[octant]].raster.first[bins[i] as usize];
            *first -= 1;
            let to = *first as usize;
            for k in 0..3 {
                self.ways[k][to] = given.ways[k][i];
            }
            self.reach[to] = given.reach[i];
            self.ids[to] = given.ids[i];
            if nearest {
                for k in 0..3 {
                    self.own.origins[k][to] = given.own.origins[k][i];
                }
                self.own.reach[to] = given.own.reach[i];
                self.own.start[to] = given.own.start[i];
            }
        }
    }

    /// The ways of eight rays from index `at` on.
    #[inline(always)]
    pub fn load<S: Simd>(&self, simd: S, at: usize) -> [f32x8<S>; 3] {
        [0, 1, 2].map(
            #[inline(always)]
            |k: usize| eight(simd, &self.ways[k], at),
        )
    }

    /// The way of a ray.
    #[inline(always)]
    pub fn way(&self, i: usize) -> [f32; 3] {
        [self.ways[0][i], self.ways[1][i], self.ways[2][i]]
    }
}

/// The numbers of eight rays from index `at` on.
#[inline(always)]
pub fn eight<S: Simd>(simd: S, row: &[f32], at: usize) -> f32x8<S> {
    f32x8::from_slice(simd, &row[at..at + LANES])
}
