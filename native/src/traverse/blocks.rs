// SPDX-License-Identifier: GPL-3.0-or-later
//! Leaves: triangles in blocks of up to eight, tested at once in f32.
//!
//! A block of `n` triangles is `1 + 10 n` words: the largest edge component `E` of the block; nine
//! rows of `n` floats (the three corners, each x y z); `n` triangle numbers. Rows are as long as the block has triangles, without padding: loads run over
//! the end of a row and the surplus lanes are ignored.
//!
//! The test is that of Möller and Trumbore 1997, with an error bound on each of its quantities. It
//! rejects a triangle only when the bound proves the miss; all others go to the exact verdict.

use super::frame::{Frame, FrameRay, U, keep_max, keep_min};
use super::keep::{Keep, write_lane};
use super::query::{Best, Counters, Query};
use super::ray::Ray;
use crate::geom::vec3::map;
use crate::scene::Triangles;
use fearless_simd::{Simd, SimdBase, SimdFloat, SimdMask, f32x8};

/// Triangles per block.
pub const LANES: usize = 8;

/// Words per triangle.
pub(super) const WORDS: usize = 10;

/// Words that the test may read from the beginning of any block, however few triangles it has: all
/// loads then lie provably inside, and are checked once per block.
pub(super) const SPAN: usize = 1 + WORDS * LANES + LANES;

// With |d| < 2 per component, |e| <= E, |o - v| <= S and all inputs of the test rounded once, the
// roundings of each quantity add up to less than (per component bounds, worst case of signs):
//   d x e2: 12 u E      s x e1: 8 u S E
//   det = e1 . (d x e2): 84 u E^2       u = s . (d x e2): 84 u S E
//   v = d . (s x e1): 84 u S E          t = e2 . (s x e1): 48 u S E^2
// A determinant within its error may come out with the wrong sign, and then all signs are wrong.
// But then the true weights of a hit, which add up to it, are as small, and so is t times it. Three
// times the determinant's error on the other bounds covers that case.
pub(super) const DET_ERROR: f32 = 96.0 * U;
pub(super) const UV_ERROR: f32 = 96.0 * U;
pub(super) const T_ERROR: f32 = 64.0 * U;

/// Absolute part of every bound, where products lost bits below the normal numbers.
pub(super) const UNDERFLOW: f32 = 1e-36;

/// All leaf triangles of a structure, in one array.
#[derive(Debug, Clone, Default)]
pub struct Blocks {
    words: Vec<f32>,
    /// The scale of the frame that corners are in, 1 for the scene's own; 0 as long as there are none.
    scale: f32,
    keep: Keep,
}

impl PartialEq for Blocks {
    /// Bit for bit: triangle numbers are stored as floats and may read as NaN.
    fn eq(&self, other: &Self) -> bool {
        let bits = |blocks: &Self| blocks.words.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        bits(self) == bits(other)
    }
}

impl Blocks {
    /// No blocks; call [`Self::seal`] when all are in.
    pub fn new() -> Self {
        Self::default()
    }

    /// Leaves that `fill` writes into `words` words: copies of the corners, or their numbers.
    pub fn filled(frame: &Frame, keep: Keep, words: usize, fill: impl FnOnce(&mut [f32])) -> Self {
        let mut blocks = Self {
            words: vec![0.0; words + SPAN],
            scale: frame.scale(),
            keep,
        };
        fill(&mut blocks.words[..words]);
        blocks
    }

    /// Appends the triangles of one leaf, in blocks; returns where they begin.
    ///
    /// # Panics
    /// When the array outgrows 2^32 words, which the builders' budgets exclude.
    pub fn push_leaf(&mut self, scene: &Triangles, frame: &Frame, ids: &[u32]) -> u32 {
        self.scale = frame.scale();
        let at = self.words.len();
        self.words.resize(at + Keep::Corners.words(ids.len()), 0.0);
        Keep::Corners.write(&mut self.words[at..], scene, frame, ids);
        u32::try_from(at).expect("leaf data is bounded by the budget")
    }

    /// Adds the words that loads may run over at the end.
    pub fn seal(&mut self) {
        self.words.resize(self.words.len() + SPAN, 0.0);
        self.words.shrink_to_fit();
    }

    /// Where triangle `index` of a leaf that begins at 0 is found; `index` is a multiple of
    /// [`LANES`], so that it begins a block.
    #[expect(clippy::cast_possible_truncation, reason = "bounded by the scene")]
    pub fn place(index: usize) -> u32 {
        (index / LANES * (1 + WORDS * LANES)) as u32
    }

    /// Whether corners are in another frame than the scene's.
    #[inline(always)]
    fn scaled(&self) -> bool {
        self.scale != 1.0
    }

    /// Size in bytes.
    pub fn bytes(&self) -> usize {
        self.words.len() * size_of::<f32>()
    }

    /// Reads a little of a leaf that begins at `first`, all over its first block, so that it comes into the
    /// caches; the number means nothing.
    #[inline(always)]
    pub fn touch(&self, first: u32) -> f32 {
        let block = self.block_words(first as usize);
        (block[0] + block[16]) + (block[32] + block[48]) + (block[64] + block[80])
    }

    /// The triangle numbers of the leaf of `count` triangles that begins at `first`.
    pub fn ids(&self, first: u32, count: usize) -> Vec<u32> {
        let mut at = first as usize;
        if self.keep == Keep::Indices {
            let words = self.words[at..at + 4 * count].chunks(4);
            return words.map(|triangle| triangle[3].to_bits()).collect();
        }
        let mut ids = Vec::with_capacity(count);
        while ids.len() < count {
            let n = (count - ids.len()).min(LANES);
            let row = at + 1 + 9 * n;
            ids.extend(self.words[row..row + n].iter().map(|x| x.to_bits()));
            at += 1 + WORDS * n;
        }
        ids
    }

    /// The triangles of a leaf of blocks, number and corners in the frame, one after another.
    #[inline(always)]
    pub fn each(&self, (first, count): (u32, usize), mut see: impl FnMut(u32, [[f32; 3]; 3])) {
        let mut at = first as usize;
        let mut left = count;
        while left > 0 {
            let n = left.min(LANES);
            let block: &[f32; SPAN] = self.words[at..]
                .first_chunk()
                .expect("sealed: no block is the last");
            for lane in 0..n {
                let at = |r: usize| block[1 + r * n + lane];
                let corners = [
                    [at(0), at(1), at(2)],
                    [at(3), at(4), at(5)],
                    [at(6), at(7), at(8)],
                ];
                see(block[1 + 9 * n + lane].to_bits(), corners);
            }
            at += 1 + WORDS * n;
            left -= n;
        }
    }

    /// The block of `n` triangles at a place, and the place of the next.
    #[inline(always)]
    pub(super) fn block(&self, at: u32, n: usize) -> (&[f32; SPAN], u32) {
        let block = self.words[at as usize..]
            .first_chunk()
            .expect("sealed: no block is the last");
        #[expect(clippy::cast_possible_truncation, reason = "at most 81")]
        (block, at + (1 + WORDS * n) as u32)
    }

    /// The corners of the triangle whose words begin at `from` and are `n` apart.
    #[inline(always)]
    pub(super) fn corners_at(&self, from: usize, n: usize) -> [[f32; 3]; 3] {
        let words = self.block_words(from);
        let corner = |k: usize| [words[k * n], words[(k + 1) * n], words[(k + 2) * n]];
        [corner(0), corner(3), corner(6)]
    }

    /// The number of that triangle.
    #[inline(always)]
    pub(super) fn id_at(&self, from: usize, n: usize) -> u32 {
        self.block_words(from)[9 * n].to_bits()
    }

    /// The words of the block that begins at `at`, and some behind it.
    #[inline(always)]
    pub(super) fn block_words(&self, at: usize) -> &[f32; SPAN] {
        self.words[at..]
            .first_chunk()
            .expect("sealed: no block is the last")
    }

    /// A triangle's corners in the scene's frame, of which those in this frame are at hand.
    #[inline(always)]
    pub fn scene_corners(
        &self,
        scene: &Triangles,
        id: u32,
        corners: [[f32; 3]; 3],
    ) -> [[f32; 3]; 3] {
        if self.scaled() {
            scene.corners(id)
        } else {
            corners
        }
    }

    /// Tests the leaf of `count` triangles that begins at `first`, for hits not beyond `leave`, where
    /// the ray leaves the leaf's cell; says whether the walk may end. A hit farther away lies in
    /// another leaf too. Leaves are blocks.
    #[inline(always)]
    pub fn test<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        leaf: (u32, usize),
        scene: &Triangles,
        ray: (&Ray, &FrameRay, f32),
        best: &mut Best,
        counters: &mut C,
    ) -> bool {
        self.test_kind::<S, Q, C, false>(simd, leaf, scene, ray, best, counters)
    }

    /// The same for leaves of either kind.
    #[inline(always)]
    pub fn test_any<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        leaf: (u32, usize),
        scene: &Triangles,
        ray: (&Ray, &FrameRay, f32),
        best: &mut Best,
        counters: &mut C,
    ) -> bool {
        self.test_kind::<S, Q, C, true>(simd, leaf, scene, ray, best, counters)
    }

    #[inline(always)]
    fn test_kind<S: Simd, Q: Query, C: Counters, const ANY: bool>(
        &self,
        simd: S,
        (first, count): (u32, usize),
        scene: &Triangles,
        (ray, frame, leave): (&Ray, &FrameRay, f32),
        best: &mut Best,
        counters: &mut C,
    ) -> bool {
        if C::REPLAY {
            return best.take::<Q>(frame, counters.replay());
        }
        counters.visit(first, count);
        let indices = ANY && self.keep == Keep::Indices;
        let mut at = first as usize;
        let mut left = count;
        let mut fetched = [0.0; SPAN];
        while left > 0 {
            let n = left.min(LANES);
            counters.tests(n);
            let block = if indices {
                self.fetch(scene, &self.words[at..at + 4 * n], &mut fetched);
                &fetched
            } else {
                self.words[at..]
                    .first_chunk()
                    .expect("sealed: no block is the last")
            };
            let mut open = Candidates::new(simd, block, n, frame, keep_min(leave, best.reach));
            while let Some(lane) = open.next::<Q>() {
                let id = block[1 + 9 * n + lane].to_bits();
                // The corners are at hand, unless the frame had to scale them.
                let corners = || {
                    if self.scaled() {
                        return scene.corners(id);
                    }
                    let at = |r: usize| block[1 + r * n + lane];
                    [
                        [at(0), at(1), at(2)],
                        [at(3), at(4), at(5)],
                        [at(6), at(7), at(8)],
                    ]
                };
                if best.offer::<Q, C>((ray, frame), id, corners, counters) {
                    return true;
                }
                open.drop_beyond(simd, best.reach);
            }
            at += if indices { 4 * n } else { 1 + WORDS * n };
            left -= n;
        }
        false
    }

    /// Makes a block of triangles of which only indices are stored.
    #[inline(always)]
    fn fetch(&self, scene: &Triangles, words: &[f32], block: &mut [f32; SPAN]) {
        let vertices = scene.vertices();
        let n = words.len() / 4;
        let mut size = 0.0;
        for lane in 0..n.min(LANES) {
            let triangle = &words[4 * lane..4 * lane + 4];
            let corners = map([0, 1, 2], |i| {
                let p = vertices[triangle[i].to_bits() as usize];
                map(p, |x| x * self.scale)
            });
            let own = write_lane(block, (lane, n), triangle[3].to_bits(), corners);
            size = keep_max(own, size);
        }
        block[0] = size;
    }
}

/// The triangles of one block that the ray may hit, the nearest first.
struct Candidates<S: Simd> {
    lanes: u64,
    det: f32x8<S>,
    t: f32x8<S>,
    det_error: f32,
    t_error: f32,
}

impl<S: Simd> Candidates<S> {
    /// Rejects every triangle that the ray certainly misses between its start and `reach`.
    #[inline(always)]
    fn new(simd: S, block: &[f32; SPAN], n: usize, ray: &FrameRay, reach: f32) -> Self {
        let splat = |x: f32| f32x8::splat(simd, x);
        let row = |r: usize| f32x8::from_slice(simd, &block[1 + r * n..1 + r * n + LANES]);
        let size = block[0];
        let (dx, dy, dz) = (splat(ray.d[0]), splat(ray.d[1]), splat(ray.d[2]));
        let s = [
            splat(ray.o[0]) - row(0),
            splat(ray.o[1]) - row(1),
            splat(ray.o[2]) - row(2),
        ];
        let [sx, sy, sz] = s;
        let v = [row(0), row(1), row(2)];
        let a = [row(3) - v[0], row(4) - v[1], row(5) - v[2]];
        let b = [row(6) - v[0], row(7) - v[1], row(8) - v[2]];
        let ([ax, ay, az], [bx, by, bz]) = (a, b);

        // p = d x e2, q = s x e1
        let px = dy.mul_sub(bz, dz * by);
        let py = dz.mul_sub(bx, dx * bz);
        let pz = dx.mul_sub(by, dy * bx);
        let qx = sy.mul_sub(az, sz * ay);
        let qy = sz.mul_sub(ax, sx * az);
        let qz = sx.mul_sub(ay, sy * ax);
        let det = ax.mul_add(px, ay.mul_add(py, az * pz));
        let u = sx.mul_add(px, sy.mul_add(py, sz * pz));
        let v = dx.mul_add(qx, dy.mul_add(qy, dz * qz));
        let t = bx.mul_add(qx, by.mul_add(qy, bz * qz));

        // Turn everything so that the determinant is positive.
        let sign = splat(1.0).copysign(det);
        let (det, u, v, t) = (det * sign, u * sign, v * sign, t * sign);
        let least = u.min(v).min(det - u - v);

        // A corner of a triangle that is hit within reach, or behind the origin where the ray begins there, is
        // no farther than that, and its size.
        let farthest = keep_max(-ray.t_min, reach);
        // In an instance's space offsets and edges may be off by the blur; what the rows of a determinant
        // are off by adds up, times six for its products and times the size of the other rows.
        let (blur, drift) = (ray.blur, 6.0 * ray.drift);
        let size = size + blur;
        let span = keep_min((2.0 + drift) * farthest + size, ray.span) + blur;
        // Zero, or NaN where some product may have overflowed: NaN bounds reject nothing.
        let overflow = 0.0 * (64.0 * span * size * size.max(1.0));
        let floor = UNDERFLOW + overflow;
        let det_error = ((DET_ERROR + drift) * size + 24.0 * blur) * size + UNDERFLOW;
        let t_error = (T_ERROR * span * size + 6.0 * blur * (size + 2.0 * span)) * size + floor;
        let uv_error = 2.0 * ((UV_ERROR + drift) * span * size + 12.0 * blur * (span + size))
            + 3.0 * det_error
            + floor;
        let doubt = t_error + 3.0 * reach.abs() * det_error;
        let rejected =
            least.simd_lt(splat(-uv_error)) | t.simd_gt(det.mul_add(splat(reach), splat(doubt)));
        let mut lanes = !rejected.to_bitmask() & ((1 << n) - 1);
        if lanes != 0 {
            // The bounds above are those of the block's largest triangle; now each gets its own.
            let largest = |v: [f32x8<S>; 3]| v[0].abs().max(v[1].abs()).max(v[2].abs());
            let size = largest(a).max(largest(b)) + splat(blur);
            let span = largest(s) + splat(blur);
            let blurred = (span + size * splat(4.0)).mul_add(splat(24.0 * blur), splat(floor));
            let uv_error = size.mul_add(
                size * splat(3.0 * (DET_ERROR + drift)),
                size.mul_add(span * splat(2.0 * (UV_ERROR + drift)), blurred),
            );
            let behind = if ray.t_min >= -1e-30 {
                -doubt
            } else {
                f32::NEG_INFINITY
            };
            // Rays inside an axis-parallel wall: the verdict would say at length what equality of
            // coordinates says at once, that they miss it. Differences of floats vanish only then.
            let apart = |k: usize| {
                let offset = s[k].abs().max(a[k].abs()).max(b[k].abs());
                offset.max(splat(ray.still[k]))
            };
            let nearest = apart(0).min(apart(1)).min(apart(2));
            let in_wall = nearest.simd_eq(splat(0.0));
            let rejected = least.simd_lt(-uv_error) | t.simd_lt(splat(behind)) | in_wall;
            lanes &= !rejected.to_bitmask();
        }
        Self {
            lanes,
            det,
            t,
            det_error,
            t_error,
        }
    }

    /// Takes out the lane that seems nearest; any lane, when any hit will do.
    #[inline(always)]
    fn next<Q: Query>(&mut self) -> Option<usize> {
        if self.lanes == 0 {
            return None;
        }
        let mut lane = self.lanes.trailing_zeros() as usize;
        let mut others = self.lanes & (self.lanes - 1);
        if !Q::ANY && others != 0 {
            let mut distances = [0.0; LANES];
            (self.t / self.det).store_slice(&mut distances);
            while others != 0 {
                let other = others.trailing_zeros() as usize;
                if distances[other] < distances[lane] {
                    lane = other;
                }
                others &= others - 1;
            }
        }
        self.lanes &= !(1 << lane);
        Some(lane)
    }

    /// Drops the triangles that lie certainly beyond `reach`.
    #[inline(always)]
    fn drop_beyond(&mut self, simd: S, reach: f32) {
        if self.lanes != 0 {
            let doubt = f32x8::splat(simd, self.t_error + 3.0 * reach.abs() * self.det_error);
            let limit = self.det.mul_add(f32x8::splat(simd, reach), doubt);
            self.lanes &= !self.t.simd_gt(limit).to_bitmask();
        }
    }
}

#[cfg(test)]
mod tests;
