// SPDX-License-Identifier: GPL-3.0-or-later
//! The kind of a node, in the two highest bits of the word that links to it.

/// The kind of a ray's next step: the two highest bits of the word that links to a node. It is a number because
/// rays are queued by it without a branch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Next(pub usize);

/// Number of kinds of [`Next`].
pub const KINDS: usize = 4;

impl Next {
    /// A step through a plain node.
    pub const PLAIN: Self = Self(0);
    /// A step through a node of the tree's second kind, if it has one.
    pub const GENERAL: Self = Self(1);
    /// The triangles of a leaf are to be tested.
    pub const LEAF: Self = Self(2);
    /// The traversal has ended.
    pub const OVER: Self = Self(3);

    /// Returns the kind as the two highest bits of a word.
    pub const fn word(self) -> u32 {
        (self.0 as u32) << 30
    }

    /// Returns the kind in the two highest bits of a word.
    #[inline(always)]
    pub const fn of(word: u32) -> Self {
        Self((word >> 30) as usize)
    }
}
