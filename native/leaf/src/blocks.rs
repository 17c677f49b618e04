// SPDX-License-Identifier: GPL-3.0-or-later
//! Leaf storage: triangles in blocks of up to eight, which the f32 test processes at once.
//!
//! A block of `n` triangles is `1 + 10 n` words: the largest edge component `E` of the block; nine rows of `n`
//! floats (the three vertices, x y z each); `n` triangle ids. Rows have no padding: vector loads read past the
//! end of a row and the surplus lanes are ignored.
//!
//! Triangles that [`crate::candidates`] cannot reject are decided by the exact test ([`halfspace_geom::verdict`]).

use crate::candidates::{Candidates, Edges, ProvenHits};
use crate::keep::{Keep, write_lane};
use crate::{Block, Job, Leaf};
use fearless_simd::Simd;
use halfspace_geom::bound::{keep_max, keep_min};
use halfspace_geom::vec3::map;
use halfspace_ray::frame::{Frame, ToFrame};
use halfspace_ray::query::{Best, Counters, LeafTest, Query};
use halfspace_ray::{BoundedRay, RayRef};
use halfspace_scene::Triangles;
use prefetch_index::prefetch_index;

/// Triangles per block.
pub const LANES: usize = 8;

/// Words per triangle: nine coordinates and an id.
pub const WORDS: usize = 10;

/// Words that the test may read from the start of a block, for any number of triangles: all loads lie inside one slice
/// of this length, whose bounds are checked once per block.
pub const SPAN: usize = 1 + WORDS * LANES + LANES;

/// Words in a cache line.
const LINE: usize = 16;

/// The leaf triangles of a structure, in one array of 32-bit words.
#[derive(Debug, Clone, Default)]
pub struct Blocks {
    words: Vec<f32>,
    /// The map to the frame in which the vertices are stored.
    to_frame: ToFrame,
    keep: Keep,
}

impl PartialEq for Blocks {
    /// Compares bit patterns: ids are stored as floats and may read as NaN.
    fn eq(&self, other: &Self) -> bool {
        let bits = |blocks: &Self| blocks.words.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        bits(self) == bits(other)
    }
}

impl Blocks {
    /// Makes an empty array. Call [`Self::seal`] after the last leaf.
    pub fn new() -> Self {
        Self::default()
    }

    /// Makes a sealed array of `words` zero words, which `fill` overwrites in the layout given by `keep`.
    pub fn filled(frame: &Frame, keep: Keep, words: usize, fill: impl FnOnce(&mut [f32])) -> Self {
        let mut blocks = Self {
            words: vec![0.0; words + SPAN],
            to_frame: *frame.map(),
            keep,
        };
        fill(&mut blocks.words[..words]);
        blocks
    }

    /// Appends the triangles of one leaf, in blocks; returns the leaf's word offset.
    ///
    /// # Panics
    /// If the array exceeds 2^32 words, which the builders' budgets exclude.
    pub fn push_leaf(&mut self, scene: &Triangles, frame: &Frame, ids: &[u32]) -> u32 {
        self.to_frame = *frame.map();
        let at = self.words.len();
        self.words.resize(at + Keep::Corners.words(ids.len()), 0.0);
        Keep::Corners.write(&mut self.words[at..], scene, frame, ids);
        u32::try_from(at).expect("leaf data is bounded by the budget")
    }

    /// Appends the words that loads may read past the last block.
    pub fn seal(&mut self) {
        self.words.resize(self.words.len() + SPAN, 0.0);
        self.words.shrink_to_fit();
    }

    /// Returns the word offset of triangle `index` within its leaf; `index` is a multiple of [`LANES`], so a block
    /// starts there.
    #[expect(clippy::cast_possible_truncation, reason = "bounded by the scene")]
    pub fn offset(index: usize) -> u32 {
        (index / LANES * (1 + WORDS * LANES)) as u32
    }

    /// Returns the map to the frame in which the vertices are stored.
    #[inline(always)]
    pub fn to_frame(&self) -> &ToFrame {
        &self.to_frame
    }

    /// Returns the size of the words in bytes.
    pub fn bytes(&self) -> usize {
        self.words.len() * size_of::<f32>()
    }

    /// Prefetches the first block of the leaf at word offset `first`. The number of cache lines is constant, although
    /// small leaves need fewer: a loop without a branch costs less.
    #[inline(always)]
    pub fn fetch_ahead(&self, first: u32) {
        for line in 0..SPAN.div_ceil(LINE) {
            prefetch_index(&self.words, first as usize + LINE * line);
        }
    }

    /// Returns the ids of the `count` triangles of the leaf at word offset `first`.
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

    /// Calls `see` with the id and the vertices, in the frame, of each triangle of a leaf stored as
    /// [`Keep::Corners`].
    #[inline(always)]
    pub fn each(&self, Leaf { first, count }: Leaf, mut see: impl FnMut(u32, [[f32; 3]; 3])) {
        let mut at = first as usize;
        let mut left = count;
        while left > 0 {
            let n = left.min(LANES);
            // Copy the vertices of each lane out of the block's rows.
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

    /// Returns the block of `n` triangles at word offset `at`, and the offset of the next block.
    #[inline(always)]
    pub fn block(&self, at: u32, n: usize) -> (&[f32; SPAN], u32) {
        let block = self.words[at as usize..]
            .first_chunk()
            .expect("sealed: no block is the last");
        #[expect(clippy::cast_possible_truncation, reason = "at most 81")]
        (block, at + (1 + WORDS * n) as u32)
    }

    /// As [`Self::block`], for leaves of either [`Keep`]: the vertices of triangles stored as indices are gathered in
    /// `buffer`.
    #[inline(always)]
    pub fn load<'a>(
        &'a self,
        scene: &Triangles,
        at: u32,
        n: usize,
        buffer: &'a mut [f32; SPAN],
    ) -> (&'a [f32; SPAN], u32) {
        if self.keep != Keep::Indices {
            return self.block(at, n);
        }
        let from = at as usize;
        self.gather(scene, &self.words[from..from + 4 * n], buffer);
        (buffer, Self::after_indices(at, n))
    }

    /// Returns what leaves store.
    pub(crate) fn keep(&self) -> Keep {
        self.keep
    }

    /// Whether leaves are stored as [`Keep::Indices`].
    #[inline(always)]
    pub fn has_indices(&self) -> bool {
        self.keep == Keep::Indices
    }

    /// Word offset behind `n` triangles stored as indices at word offset `at`.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "at most 32")]
    pub fn after_indices(at: u32, n: usize) -> u32 {
        at + (4 * n) as u32
    }

    /// The block of `n` triangles stored as indices at word offset `at`, gathered from the scene.
    #[inline(never)]
    pub fn gathered(&self, scene: &Triangles, at: u32, n: usize) -> [f32; SPAN] {
        let mut room = [0.0; SPAN];
        self.load(scene, at, n, &mut room);
        room
    }

    /// Returns the vertices, in the frame, of the triangle whose words begin at `from` and are `n` apart.
    #[inline(always)]
    pub fn corners_at(&self, from: usize, n: usize) -> [[f32; 3]; 3] {
        let words = self.block_words(from);
        let corner = |k: usize| [words[k * n], words[(k + 1) * n], words[(k + 2) * n]];
        [corner(0), corner(3), corner(6)]
    }

    /// Returns the id of the triangle whose words begin at `from` and are `n` apart.
    #[inline(always)]
    pub fn id_at(&self, from: usize, n: usize) -> u32 {
        self.block_words(from)[9 * n].to_bits()
    }

    /// Returns the words of the block at word offset `at`, and the words that loads may read past it.
    #[inline(always)]
    pub fn block_words(&self, at: usize) -> &[f32; SPAN] {
        self.words[at..]
            .first_chunk()
            .expect("sealed: no block is the last")
    }

    /// Returns the vertices of triangle `id` in the scene's space; `corners` are its vertices in the frame.
    #[inline(always)]
    pub fn scene_corners(
        &self,
        scene: &Triangles,
        id: u32,
        corners: [[f32; 3]; 3],
    ) -> [[f32; 3]; 3] {
        if self.to_frame.is_unscaled() {
            map(corners, |p| self.to_frame.vertex_to_scene(p))
        } else {
            scene.corners(id)
        }
    }

    /// Returns id and vertices, in the frame, of triangle `index` of a leaf of either [`Keep`].
    #[inline(always)]
    pub fn triangle(&self, scene: &Triangles, leaf: Leaf, index: usize) -> (u32, [[f32; 3]; 3]) {
        let first = leaf.first as usize;
        if self.keep == Keep::Indices {
            let words = &self.words[first + 4 * index..first + 4 * index + 4];
            let vertex = |i: usize| scene.vertices()[words[i].to_bits() as usize];
            let corners = map([0, 1, 2], |i| self.to_frame.point(vertex(i)));
            return (words[3].to_bits(), corners);
        }
        let block = index & !(LANES - 1);
        let from = first + Self::offset(block) as usize + 1 + (index - block);
        let n = (leaf.count - block).min(LANES);
        (self.id_at(from, n), self.corners_at(from, n))
    }

    /// Gathers the vertices of the triangles in `words`, stored as [`Keep::Indices`], into a block in the frame.
    #[inline(always)]
    fn gather(&self, scene: &Triangles, words: &[f32], block: &mut [f32; SPAN]) {
        let vertices = scene.vertices();
        let n = words.len() / 4;
        // Convert the vertices of each triangle to the frame, and write them to its lane.
        let mut size = 0.0;
        for lane in 0..n.min(LANES) {
            let triangle = &words[4 * lane..4 * lane + 4];
            let corners = map([0, 1, 2], |i| {
                self.to_frame
                    .point(vertices[triangle[i].to_bits() as usize])
            });
            let own = write_lane(block, lane, n, triangle[3].to_bits(), corners);
            size = keep_max(own, size);
        }
        block[0] = size;
    }
}

impl Block<'_> {
    /// Decides the candidates by the exact test, nearest first, or defers it; returns whether the traversal may end.
    #[inline(always)]
    pub fn settle<S: Simd, Q: Query, C: Counters>(
        self,
        simd: S,
        mut open: Candidates<S>,
        proven: &ProvenHits,
        ray: BoundedRay<'_>,
        best: &mut Best,
        counters: &mut C,
    ) -> bool {
        while let Some(lane) = open.next::<Q, C>(proven) {
            let id = self.words[1 + 9 * self.count + lane].to_bits();
            // Defer the exact test if f32 already proves the hit.
            let deferred = match proven.range(lane) {
                Some(range) => best.defer::<Q>(
                    ray,
                    id,
                    range,
                    #[inline(always)]
                    || self.scene_corners(lane),
                ),
                _ => None,
            };
            // Run it now if f32 proves nothing, or cannot order the two nearest triangles.
            let ends = match deferred {
                Some(ends) => ends,
                None => best.offer::<Q, C>(
                    ray.ray,
                    id,
                    #[inline(always)]
                    || self.scene_corners(lane),
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

    /// Returns the vertices, in the scene's space, of the triangle in `lane`.
    #[inline(always)]
    fn scene_corners(&self, lane: usize) -> [[f32; 3]; 3] {
        let at = |r: usize| self.words[1 + r * self.count + lane];
        let corners = [
            [at(0), at(1), at(2)],
            [at(3), at(4), at(5)],
            [at(6), at(7), at(8)],
        ];
        let Job { scene, blocks } = self.job;
        blocks.scene_corners(scene, at(9).to_bits(), corners)
    }
}

impl Job<'_> {
    /// Intersects a ray with the triangles of a leaf, and returns whether the traversal may end.
    ///
    /// `leave` is the frame distance at which the ray leaves the leaf's cell: hits beyond it are found in another leaf.
    /// The leaf is stored as [`Keep::Corners`].
    #[inline(always)]
    pub fn test<S: Simd, Q: Query, C: Counters>(
        self,
        simd: S,
        leaf: Leaf,
        ray: RayRef<'_>,
        leave: f32,
        best: &mut Best,
        counters: &mut C,
    ) -> bool {
        self.test_kind::<S, Q, C, false>(simd, leaf, ray, leave, best, counters)
    }

    /// [`Self::test`] for leaves of either [`Keep`].
    #[inline(always)]
    pub fn test_any<S: Simd, Q: Query, C: Counters>(
        self,
        simd: S,
        leaf: Leaf,
        ray: RayRef<'_>,
        leave: f32,
        best: &mut Best,
        counters: &mut C,
    ) -> bool {
        self.test_kind::<S, Q, C, true>(simd, leaf, ray, leave, best, counters)
    }

    /// [`Self::test`], or with `EITHER` [`Self::test_any`].
    #[inline(always)]
    fn test_kind<S: Simd, Q: Query, C: Counters, const EITHER: bool>(
        self,
        simd: S,
        Leaf { first, count }: Leaf,
        ray: RayRef<'_>,
        leave: f32,
        best: &mut Best,
        counters: &mut C,
    ) -> bool {
        let frame = ray.frame;
        // In a replay, return the recorded answer of this leaf instead of testing its triangles.
        if C::REPLAY {
            return best.take::<Q>(frame, counters.replay());
        }
        counters.visit(first, count);
        if Q::LEAF != LeafTest::Eight {
            let leaf = Leaf { first, count };
            return self.one_by_one::<Q, C, EITHER>(leaf, ray, leave, best, counters);
        }
        let indices = EITHER && self.blocks.keep == Keep::Indices;
        let mut at = first as usize;
        let mut left = count;
        let mut gathered = [0.0; SPAN];
        // Test the leaf block by block, each against the reach that the blocks before it left.
        while left > 0 {
            let n = left.min(LANES);
            counters.tests(n);
            let words = if indices {
                self.blocks.gather(
                    self.scene,
                    &self.blocks.words[at..at + 4 * n],
                    &mut gathered,
                );
                &gathered
            } else {
                self.blocks.words[at..]
                    .first_chunk()
                    .expect("sealed: no block is the last")
            };
            // Reject by the error bounds of the block's largest triangle; most blocks have no candidate left.
            let reach = keep_min(leave, best.reach);
            let mut open = Candidates::new(simd, &Edges::new(simd, words, n), frame, reach);
            if open.any() {
                // Compute the edges again, which is cheaper than keeping them in registers across the branch.
                let proven = open.refine::<Q, C>(simd, &Edges::new(simd, words, n), frame);
                let block = Block {
                    job: self,
                    words,
                    count: n,
                };
                let certain = frame.certain(ray.ray);
                let ray = BoundedRay { ray, certain };
                if block.settle::<S, Q, C>(simd, open, &proven, ray, best, counters) {
                    return true;
                }
            }
            at += if indices { 4 * n } else { 1 + WORDS * n };
            left -= n;
        }
        false
    }
}
