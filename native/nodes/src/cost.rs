// SPDX-License-Identifier: GPL-3.0-or-later
//! The surface area heuristic (MacDonald and Booth 1990): the expected cost of a split.

use fearless_simd::{Select, Simd, SimdBase, SimdFloat, f32x8};

/// Costs of the operations of a traversal, in arbitrary but common units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Costs {
    /// One traversal step through a node with an axis-aligned plane.
    pub step: f32,
    /// Visiting a leaf that holds triangles.
    pub leaf: f32,
    /// One triangle test.
    pub triangle: f32,
    /// Number of triangles tested at once; a partly filled block costs as much as a full one.
    pub block: f32,
    /// Factor on the cost of a split that leaves one child empty (Wald and Havran 2006, section 3.3); 1 for no
    /// bonus.
    pub empty: f32,
}

impl Costs {
    /// Fitted to leaves with SIMD tests of eight triangles: a step is a mispredicted branch, a block of eight
    /// triangles costs as much as four steps.
    pub const BLOCKS: Self = Self {
        step: 10.0,
        leaf: 5.0,
        triangle: 5.0,
        block: 8.0,
        empty: 0.9,
    };

    /// Fitted to plane trees with their default traversal. With half this step cost scattered rays are no faster,
    /// camera rays in tiles up to a fifth slower, and trees larger (measured).
    pub const PLANES: Self = Self {
        step: 20.0,
        ..Self::BLOCKS
    };

    /// Fitted to nodes of eight boxes: up to seven steps of the binary tree share the cost of one node.
    pub const BOXES: Self = Self {
        step: 8.0,
        ..Self::BLOCKS
    };

    /// Costs of Hoobergs's kd-tree: a triangle costs 80 steps, as in pbrt, but without pbrt's bonus for empty
    /// children, which halves the cost.
    pub const THESIS: Self = Self {
        step: 1.0,
        leaf: 0.0,
        triangle: 80.0,
        block: 1.0,
        empty: 1.0,
    };

    /// Cost of a step through an oblique plane, in the units of [`Self::THESIS`].
    pub const THESIS_OBLIQUE: f32 = 5.0;

    /// Returns the cost of a leaf of `n` triangles.
    #[inline(always)]
    pub fn leaf(&self, n: f32) -> f32 {
        if n == 0.0 {
            return 0.0;
        }
        self.leaf + self.triangle * self.block * (n / self.block).ceil()
    }

    /// Returns the costs of eight leaves at once, bit for bit as [`Self::leaf()`].
    #[inline(always)]
    pub fn leaf_x8<S: Simd>(&self, simd: S, n: f32x8<S>) -> f32x8<S> {
        let blocks = if self.block == 1.0 {
            n
        } else {
            (n / f32x8::splat(simd, self.block)).ceil()
        };
        let full =
            f32x8::splat(simd, self.leaf) + f32x8::splat(simd, self.triangle * self.block) * blocks;
        let zero = f32x8::splat(simd, 0.0);
        n.simd_eq(zero).select(zero, full)
    }

    /// Returns the cost of a split, from the shares of the parent's surface area and the triangle counts of both
    /// children.
    #[inline(always)]
    pub fn split(&self, shares: [f32; 2], counts: [f32; 2]) -> f32 {
        let ([share_left, share_right], [left, right]) = (shares, counts);
        let cost = self.step + (share_left * self.leaf(left) + share_right * self.leaf(right));
        if left == 0.0 || right == 0.0 {
            cost * self.empty
        } else {
            cost
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_paid_for_whole() {
        let leaf = |n: f32| Costs::BLOCKS.leaf(n);
        assert_eq!(
            [leaf(0.0), leaf(1.0), leaf(8.0), leaf(9.0)],
            [0.0, 45.0, 45.0, 85.0]
        );
        assert_eq!(Costs::THESIS.leaf(3.0), 240.0);
    }

    #[test]
    fn emptiness_earns_its_bonus() {
        let cost = Costs::BLOCKS.split([0.5, 0.7], [0.0, 4.0]);
        assert_eq!(cost, (10.0 + 0.7 * 45.0) * 0.9);
        assert_eq!(
            Costs::THESIS.split([0.5, 0.7], [1.0, 2.0]),
            1.0 + 0.5 * 80.0 + 0.7 * 160.0
        );
    }
}
