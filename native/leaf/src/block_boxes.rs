// SPDX-License-Identifier: GPL-3.0-or-later
//! One block of a leaf's triangles and the bounding box of each triangle, one triangle per SIMD lane.

use crate::blocks::{Blocks, LANES, SPAN, WORDS};
use fearless_simd::{Simd, SimdBase, f32x8};

/// Up to eight triangles of a leaf and their bounding boxes. Only the first `n` lanes are defined.
pub struct BlockBoxes<'a, S: Simd> {
    words: &'a [f32; SPAN],
    /// Number of triangles, at most [`LANES`].
    pub n: usize,
    /// Lower ends of the boxes, per axis.
    pub low: [f32x8<S>; 3],
    /// Upper ends of the boxes, per axis.
    pub high: [f32x8<S>; 3],
    /// Word offset of the leaf's next block.
    pub next: usize,
}

impl<'a, S: Simd> BlockBoxes<'a, S> {
    /// Loads the block at word offset `at` of a leaf that has `left` triangles from there on.
    #[inline(always)]
    pub fn new(simd: S, blocks: &'a Blocks, at: usize, left: usize) -> Self {
        let n = left.min(LANES);
        // Load the nine rows of coordinates: three vertices, x y z each. A row has `n` words, so loads overlap.
        let words = blocks.block_words(at);
        let row = |r: usize| f32x8::from_slice(simd, &words[1 + r * n..1 + r * n + LANES]);
        let (x, y, z) = (
            [row(0), row(3), row(6)],
            [row(1), row(4), row(7)],
            [row(2), row(5), row(8)],
        );
        // Bound each triangle.
        Self {
            words,
            n,
            low: [
                x[0].min(x[1]).min(x[2]),
                y[0].min(y[1]).min(y[2]),
                z[0].min(z[1]).min(z[2]),
            ],
            high: [
                x[0].max(x[1]).max(x[2]),
                y[0].max(y[1]).max(y[2]),
                z[0].max(z[1]).max(z[2]),
            ],
            next: at + 1 + WORDS * n,
        }
    }

    /// Returns the id and the vertices of the triangle in `lane`, which must be less than `n`.
    #[inline(always)]
    pub fn triangle(&self, lane: usize) -> (u32, [[f32; 3]; 3]) {
        let at = |r: usize| self.words[1 + r * self.n + lane];
        let corners = [
            [at(0), at(1), at(2)],
            [at(3), at(4), at(5)],
            [at(6), at(7), at(8)],
        ];
        (at(9).to_bits(), corners)
    }
}
