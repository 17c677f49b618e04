// SPDX-License-Identifier: GPL-3.0-or-later
//! The leaf data of object trees: their size is known before any is written, so layouts first say
//! which leaves there are, and all are then written at once, in parallel.

use crate::scene::Triangles;
use crate::traverse::blocks::Blocks;
use crate::traverse::frame::Frame;
use crate::traverse::keep::Keep;

/// More leaves than this are written in parallel.
const TASK: usize = 4096;

/// A leaf: where its data begins, and where in the tree its numbers do.
#[derive(Debug, Clone, Copy)]
struct Leaf {
    at: usize,
    first: usize,
    count: usize,
}

/// The leaves of a tree, in the order in which their data is to lie.
#[derive(Debug)]
pub struct Leaves {
    keep: Keep,
    leaves: Vec<Leaf>,
    words: usize,
}

impl Leaves {
    /// No leaves yet.
    pub fn new(keep: Keep) -> Self {
        Self {
            keep,
            leaves: Vec::new(),
            words: 0,
        }
    }

    /// Takes in a leaf, by where its `count` numbers begin in the tree; returns where its data begins.
    ///
    /// # Panics
    /// When there are more than 2^32 words, which the layouts' limits exclude.
    pub fn push(&mut self, first: u32, count: usize) -> u32 {
        let first = first as usize;
        let at = self.words;
        self.words += self.keep.words(count);
        self.leaves.push(Leaf { at, first, count });
        u32::try_from(at).expect("checked by the layout")
    }

    /// Size of what [`Self::write`] makes.
    pub fn bytes(&self) -> usize {
        self.words * size_of::<f32>()
    }

    /// Writes all leaves; `ids` are the tree's numbers.
    pub fn write(&self, scene: &Triangles, frame: &Frame, ids: &[u32]) -> Blocks {
        Blocks::filled(frame, self.keep, self.words, |words| {
            self.fill(words, 0, &self.leaves, (scene, frame, ids));
        })
    }

    /// Writes leaves whose data begins at `start`.
    fn fill(
        &self,
        words: &mut [f32],
        start: usize,
        leaves: &[Leaf],
        (scene, frame, ids): (&Triangles, &Frame, &[u32]),
    ) {
        if leaves.len() > TASK {
            let (before, after) = leaves.split_at(leaves.len() / 2);
            let middle = after[0].at;
            let (left, right) = words.split_at_mut(middle - start);
            rayon::join(
                || self.fill(left, start, before, (scene, frame, ids)),
                || self.fill(right, middle, after, (scene, frame, ids)),
            );
            return;
        }
        for leaf in leaves {
            let at = leaf.at - start;
            let ids = &ids[leaf.first..leaf.first + leaf.count];
            let words = &mut words[at..at + self.keep.words(leaf.count)];
            self.keep.write(words, scene, frame, ids);
        }
    }
}
