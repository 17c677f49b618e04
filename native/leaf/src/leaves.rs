// SPDX-License-Identifier: GPL-3.0-or-later
//! The leaf data of object trees: layouts first register all leaves, which determines the size of the data, and then
//! write them in parallel.

use crate::blocks::Blocks;
use crate::keep::Keep;
use halfspace_ray::FramedScene;
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;

/// Largest number of leaves that one task writes (chosen).
const TASK: usize = 4096;

/// A registered leaf.
#[derive(Debug, Clone, Copy)]
struct Registered {
    /// Offset of its data in words.
    at: usize,
    /// Index of its first triangle number among those of the tree.
    first: usize,
    /// Number of triangles.
    count: usize,
}

/// The leaves of a tree, in the order of their data.
#[derive(Debug)]
pub struct Leaves {
    keep: Keep,
    leaves: Vec<Registered>,
    /// Number of words of all leaves.
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

    /// Registers a leaf with `count` triangle numbers from index `first` on; returns the offset of its data in words.
    ///
    /// # Panics
    /// If there are more than 2^32 words, which the layouts' limits exclude.
    pub fn push(&mut self, first: u32, count: usize) -> u32 {
        let first = first as usize;
        let at = self.words;
        self.words += self.keep.words(count);
        self.leaves.push(Registered { at, first, count });
        u32::try_from(at).expect("checked by the layout")
    }

    /// Returns the bytes that [`Self::write`] will need.
    pub fn bytes(&self) -> usize {
        self.words * size_of::<f32>()
    }

    /// Writes all leaves, in the frame `frame`; `ids` are the tree's triangle numbers.
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
        leaves: &[Registered],
        framed: FramedScene<'_>,
        ids: &[u32],
    ) {
        if leaves.len() > TASK {
            // Divide the leaves and their words between two tasks.
            let (before, after) = leaves.split_at(leaves.len() / 2);
            let middle = after[0].at;
            let (left, right) = words.split_at_mut(middle - start);
            rayon::join(
                || self.fill(left, start, before, framed, ids),
                || self.fill(right, middle, after, framed, ids),
            );
            return;
        }
        // Write each leaf to its words.
        for leaf in leaves {
            let at = leaf.at - start;
            let ids = &ids[leaf.first..leaf.first + leaf.count];
            let words = &mut words[at..at + self.keep.words(leaf.count)];
            self.keep.write(words, framed.scene, framed.frame, ids);
        }
    }
}
