// SPDX-License-Identifier: GPL-3.0-or-later
//! The rays of a batch with a common origin, sorted by octant and by bin.

use crate::raster::{Extent, Raster};
use fearless_simd::{Simd, SimdBase, f32x8};
use halfspace_ray::Ray;
use halfspace_ray::frame::Frame;

/// Rays per vector.
pub const LANES: usize = 8;

/// Number of octants.
const OCTANTS: usize = 8;

/// Octant of rays that are traced singly.
const SINGLE: u8 = 8;

/// One number per ray.
type Row = Vec<f32>;

/// Sorted rays. The rows are longer than the rays by one vector, so that loads may read past the end.
#[derive(Default)]
pub struct Sorted {
    /// Speeds along the axes in the order of the octant: absolute components of the direction in the frame.
    pub speeds: [Row; 3],
    /// Largest distance, in the frame, of a hit that could be better; negative infinity for rays that have ended.
    pub reach: Row,
    /// Indices in the batch.
    pub ids: Vec<u32>,
    /// The octants with rays.
    pub groups: Vec<Group>,
    /// Indices of the rays that are traced singly.
    pub rest: Vec<u32>,
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

/// The rays in the order of the batch.
struct Given {
    speeds: [Row; 3],
    reach: Row,
    octant: Vec<u8>,
}

impl Sorted {
    /// Sorts the rays from origin `o`; the others, and those that need the frame's slow path or that may hit something
    /// behind their origin, are left for single rays.
    #[inline(always)]
    pub fn new<S: Simd>(simd: S, frame: &Frame, rays: &[Ray], o: [f32; 3]) -> Self {
        let mut sorted = Self::default();
        let mut extents = [Extent::NOTHING; OCTANTS];
        let given = sorted.prepare(simd, frame, rays, o, &mut extents);
        // Number the bins of all octants, one octant after the other, and count their rays.
        let mut numbers = [usize::MAX; OCTANTS];
        for (octant, extent) in extents.iter().enumerate() {
            if extent.count != 0 {
                numbers[octant] = sorted.groups.len();
                sorted.groups.push(Group {
                    signs: u32::try_from(octant).expect("below 8"),
                    extent: *extent,
                    raster: Raster::new(extent),
                });
            }
        }
        sorted.distribute(simd, &given, &numbers);
        sorted
    }

    /// Converts the rays to the frame, and finds their octants.
    #[inline(always)]
    fn prepare<S: Simd>(
        &mut self,
        simd: S,
        frame: &Frame,
        rays: &[Ray],
        o: [f32; 3],
        extents: &mut [Extent; OCTANTS],
    ) -> Given {
        let room = rays.len().next_multiple_of(LANES);
        let mut given = Given {
            speeds: [(); 3].map(|()| vec![1.0; room]),
            reach: vec![f32::NEG_INFINITY; room],
            octant: vec![SINGLE; room],
        };
        let bits = |v: [f32; 3]| v.map(f32::to_bits);
        let own = bits(o);
        for (i, ray) in (0_u32..).zip(rays) {
            let at = i as usize;
            let size = ray.d.map(f32::abs);
            let longest = size[0].max(size[1]).max(size[2]);
            // Infinity and NaN multiplied by zero are NaN.
            let finite = ray.d[0] * 0.0 + ray.d[1] * 0.0 + ray.d[2] * 0.0 == 0.0;
            let plain = finite & (longest > 2.0 * f32::MIN_POSITIVE) & (longest < 1e38);
            let ahead = (ray.t_min >= 0.0) & (ray.t_min <= ray.t_max);
            if !(plain & ahead & (bits(ray.o) == own)) {
                self.rest.push(i);
                continue;
            }
            // Divide by the power of two of the longest component; the reciprocal has the opposite exponent.
            let unit = f32::from_bits(longest.to_bits() & 0x7f80_0000);
            let inverse = f32::from_bits(0x7f00_0000 - unit.to_bits());
            let mut octant = 0;
            for (k, size) in size.into_iter().enumerate() {
                given.speeds[k][at] = size * inverse;
                octant |= u8::from(ray.d[k].is_sign_negative()) << k;
            }
            given.octant[at] = octant;
            given.reach[at] = if ray.t_max == f32::INFINITY {
                f32::INFINITY
            } else {
                frame.interval(ray, unit)[1]
            };
        }
        for block in (0..room).step_by(LANES) {
            let [p, q] = given.places(simd, block);
            let own = &given.octant[block..block + LANES];
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
        given
    }

    /// Moves the rays to their bins.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "at most 2^32 rays")]
    fn distribute<S: Simd>(&mut self, simd: S, given: &Given, numbers: &[usize; OCTANTS]) {
        let room = given.octant.len();
        let mut bins = vec![0_u32; room];
        for block in (0..room).step_by(LANES) {
            let [p, q] = given.places(simd, block);
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
        self.speeds = [(); 3].map(|()| vec![1.0; total + LANES]);
        self.reach = vec![f32::NEG_INFINITY; total + LANES];
        self.ids = vec![0; total + LANES];
        for i in (0..room).rev() {
            let octant = usize::from(given.octant[i]);
            if octant < OCTANTS {
                let first = &mut self.groups[numbers[octant]].raster.first[bins[i] as usize];
                *first -= 1;
                let to = *first as usize;
                for k in 0..3 {
                    self.speeds[k][to] = given.speeds[k][i];
                }
                self.reach[to] = given.reach[i];
                self.ids[to] = i as u32;
            }
        }
    }

    /// The speeds of eight rays from index `at` on.
    #[inline(always)]
    pub fn load<S: Simd>(&self, simd: S, at: usize) -> [f32x8<S>; 3] {
        load(simd, &self.speeds, at)
    }

    /// The speeds of a ray.
    #[inline(always)]
    pub fn speed(&self, i: usize) -> [f32; 3] {
        [self.speeds[0][i], self.speeds[1][i], self.speeds[2][i]]
    }
}

#[inline(always)]
fn load<S: Simd>(simd: S, rows: &[Row; 3], at: usize) -> [f32x8<S>; 3] {
    [
        f32x8::from_slice(simd, &rows[0][at..at + LANES]),
        f32x8::from_slice(simd, &rows[1][at..at + LANES]),
        f32x8::from_slice(simd, &rows[2][at..at + LANES]),
    ]
}

impl Given {
    /// The coordinates `p` and `q` of eight rays in the plane of directions.
    #[inline(always)]
    fn places<S: Simd>(&self, simd: S, block: usize) -> [[f32; LANES]; 2] {
        let [x, y, z] = load(simd, &self.speeds, block);
        let inverse = f32x8::splat(simd, 1.0) / (x + y + z);
        let (mut p, mut q) = ([0.0; LANES], [0.0; LANES]);
        (x * inverse).store_slice(&mut p);
        (y * inverse).store_slice(&mut q);
        [p, q]
    }
}
