// SPDX-License-Identifier: GPL-3.0-or-later
//! Leaves: triangles in blocks of up to eight, tested at once in f32.
//!
//! A block of `n` triangles is `1 + 10 n` words: the largest edge component `E` of the block; nine
//! rows of `n` floats (the three corners, each x y z); `n` triangle numbers. Rows are as long as the block has triangles, without padding: loads run over
//! the end of a row and the surplus lanes are ignored.
//!
//! What [`super::candidates`] cannot rule out goes to the exact verdict.

use super::bound::{keep_max, keep_min};
use super::candidates::{Candidates, Edges, Surely};
use super::frame::{Frame, FrameRay};
use super::keep::{Keep, write_lane};
use super::query::{Best, Counters, Query};
use super::ray::Ray;
use crate::geom::vec3::map;
use crate::scene::Triangles;
use fearless_simd::Simd;
use prefetch_index::prefetch_index;

/// Triangles per block.
pub const LANES: usize = 8;

/// Words per triangle.
pub(super) const WORDS: usize = 10;

/// Words that the test may read from the beginning of any block, however few triangles it has: all
/// loads then lie provably inside, and are checked once per block.
pub(super) const SPAN: usize = 1 + WORDS * LANES + LANES;

/// Words in a cache line.
const LINE: usize = 16;

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

    /// Asks for the first block of a leaf that begins at `first`, so that it is in the caches by then. Always for as many
    /// lines, though few triangles take fewer: a loop without a branch costs less.
    #[inline(always)]
    pub fn fetch_ahead(&self, first: u32) {
        for line in 0..SPAN.div_ceil(LINE) {
            prefetch_index(&self.words, first as usize + LINE * line);
        }
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
            let reach = keep_min(leave, best.reach);
            let mut open = Candidates::new(simd, &Edges::new(simd, block, n), frame, reach);
            if open.any() {
                // Made anew, they need not be kept meanwhile.
                let surely = open.refine::<Q, C>(simd, &Edges::new(simd, block, n), frame);
                let ends = self.settle::<S, Q, C>(
                    simd,
                    (open, &surely),
                    (block, n, scene),
                    (ray, frame, frame.certain(ray)),
                    best,
                    counters,
                );
                if ends {
                    return true;
                }
            }
            at += if indices { 4 * n } else { 1 + WORDS * n };
            left -= n;
        }
        false
    }

    /// Puts the candidates of a block of `n` triangles to the verdict, the nearest first; says whether the
    /// walk may end.
    #[inline(always)]
    pub(super) fn settle<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        (mut open, surely): (Candidates<S>, &Surely),
        (block, n, scene): (&[f32; SPAN], usize, &Triangles),
        (ray, frame, certain): (&Ray, &FrameRay, [f32; 2]),
        best: &mut Best,
        counters: &mut C,
    ) -> bool {
        while let Some(lane) = open.next::<Q, C>(surely) {
            let id = block[1 + 9 * n + lane].to_bits();
            let held = match surely.range(lane) {
                Some(range) => best.hold::<Q>(
                    (ray, frame, certain),
                    id,
                    range,
                    #[inline(always)]
                    || self.corners_in(block, (lane, n), scene),
                ),
                _ => None,
            };
            let ends = match held {
                Some(ends) => ends,
                None => best.offer::<Q, C>(
                    (ray, frame),
                    id,
                    #[inline(always)]
                    || self.corners_in(block, (lane, n), scene),
                    counters,
                ),
            };
            if ends {
                return true;
            }
            open.drop_beyond(simd, best.reach);
        }
        false
    }

    /// The corners, in the scene's frame, of the triangle of a lane of a block of `n`.
    #[inline(always)]
    fn corners_in(
        &self,
        block: &[f32; SPAN],
        (lane, n): (usize, usize),
        scene: &Triangles,
    ) -> [[f32; 3]; 3] {
        let at = |r: usize| block[1 + r * n + lane];
        let corners = [
            [at(0), at(1), at(2)],
            [at(3), at(4), at(5)],
            [at(6), at(7), at(8)],
        ];
        self.scene_corners(scene, at(9).to_bits(), corners)
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
