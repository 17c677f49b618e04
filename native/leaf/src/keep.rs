// SPDX-License-Identifier: GPL-3.0-or-later
//! The two layouts of leaf data: copies of the vertices, ready for the test, or indices alone.

use crate::blocks::{LANES, WORDS};
use halfspace_geom::bound::keep_max;
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;

/// The data that leaves store of their triangles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Keep {
    /// Vertices and id, in the blocks of [`crate::blocks`] that the f32 test loads.
    #[default]
    Corners,
    /// Three vertex indices and the id, four words: less than half the memory. Each test gathers the vertices from the
    /// scene.
    Indices,
}

impl Keep {
    /// Returns the number of 32-bit words of a leaf with `count` triangles.
    pub fn words(self, count: usize) -> usize {
        match self {
            Self::Corners => count.div_ceil(LANES) + WORDS * count,
            Self::Indices => 4 * count,
        }
    }

    /// Writes the triangles `ids` of one leaf into `words`, which must be zero, in the frame `frame`.
    pub fn write(self, words: &mut [f32], scene: &Triangles, frame: &Frame, ids: &[u32]) {
        match self {
            Self::Corners => {
                // Write blocks of eight; only the last one may be shorter.
                let blocks = words.chunks_mut(1 + WORDS * LANES);
                for (block, ids) in blocks.zip(ids.chunks(LANES)) {
                    for (lane, &id) in ids.iter().enumerate() {
                        let corners = scene.corners(id).map(|p| frame.point(p));
                        let size = write_lane(block, lane, ids.len(), id, corners);
                        block[0] = block[0].max(size);
                    }
                }
            }
            Self::Indices => {
                for (words, &id) in words.chunks_mut(4).zip(ids) {
                    // Store indices as bit patterns of floats.
                    let [a, b, c] = scene.indices()[id as usize];
                    words.copy_from_slice(&[a, b, c, id].map(f32::from_bits));
                }
            }
        }
    }
}

/// Writes triangle number `lane` of a block of `n` triangles, but not the header word; returns the triangle's largest
/// absolute edge component.
#[inline(always)]
pub fn write_lane(
    block: &mut [f32],
    lane: usize,
    n: usize,
    id: u32,
    [a, b, c]: [[f32; 3]; 3],
) -> f32 {
    let mut size = 0.0;
    for k in 0..3 {
        block[1 + k * n + lane] = a[k];
        block[1 + (3 + k) * n + lane] = b[k];
        block[1 + (6 + k) * n + lane] = c[k];
        size = keep_max((b[k] - a[k]).abs(), keep_max((c[k] - a[k]).abs(), size));
    }
    block[1 + 9 * n + lane] = f32::from_bits(id);
    size
}
