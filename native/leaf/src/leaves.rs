// SPDX-License-Identifier: GPL-3.0-or-later
//! The leaf data of object trees. Its size is known before any is written, so layouts first register their leaves,
//! and all are then written at once, in parallel.

use crate::blocks::Blocks;
use crate::keep::Keep;
use halfspace_ray::FramedScene;
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;

/// More leaves than this are written in parallel.
const TASK: usize = 4096;

/// A leaf: offset of its data in words, and index of its first triangle number in the tree.
#[derive(Debug, Clone, Copy)]
struct Leaf {
    at: usize,
    first: usize,
    count: usize,
}

/// The leaves of a tree, in the order of their data.
#[derive(Debug)]
pub struct Leaves {
    keep: Keep,
    leaves: Vec<Leaf>,
    words: usize,
}

impl Leaves {
    /// Makes an empty list.
    pub fn new(keep: Keep) -> Self {
        Self {
            keep,
            leaves: Vec::new(),
            words: 0,
        }
    }

    /// Adds a leaf with `count` triangle numbers from `first` on; returns the offset of its data in words.
    ///
    /// # Panics
    /// If there are more than 2^32 words, which the layouts' limits exclude.
    pub fn push(&mut self, first: u32, count: usize) -> u32 {
        let first = first as usize;
        let at = self.words;
        self.words += self.keep.words(count);
        self.leaves.push(Leaf { at, first, count });
        u32::try_from(at).expect("checked by the layout")
    }

    /// Returns the bytes that [`Self::write`] will need.
    pub fn bytes(&self) -> usize {
        self.words * size_of::<f32>()
    }

    /// Writes all leaves; `ids` are the tree's triangle numbers.
    pub fn write(&self, scene: &Triangles, frame: &Frame, ids: &[u32]) -> Blocks {
        Blocks::filled(frame, self.keep, self.words, |words| {
            self.fill(words, 0, &self.leaves, FramedScene { scene, frame }, ids);
        })
    }

    /// Writes the leaves whose data begins at word `start`, in parallel if there are many.
    fn fill(
        &self,
        words: &mut [f32],
        start: usize,
        leaves: &[Leaf],
        framed: FramedScene<'_>,
        ids: &[u32],
    ) {
        if leaves.len() > TASK {
            // Halve the leaves and their words for two threads.
            let (before, after) = leaves.split_at(leaves.len() / 2);
            let middle = after[0].at;
            let (left, right) = words.split_at_mut(middle - start);
            rayon::join(
                || self.fill(left, start, before, framed, ids),
                || self.fill(right, middle, after, framed, ids),
            );
            return;
        }
        for leaf in leaves {
            let at = leaf.at - start;
            let ids = &ids[leaf.first..leaf.first + leaf.count];
            let words = &mut words[at..at + self.keep.words(leaf.count)];
            self.keep.write(words, framed.scene, framed.frame, ids);
        }
    }
}
