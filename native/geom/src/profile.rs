// SPDX-License-Identifier: GPL-3.0-or-later
//! The surface areas of both parts of a convex cell as functions of the height of a cut.
//!
//! Along a direction the surface area below a cut is a sum over the cell's edges, each of which adds a quadratic
//! polynomial of the part of it that lies below. A sweep therefore evaluates all heights without cutting the cell
//! or computing the face of the cut. [`crate::polytope`] derives the coefficients.

use fearless_simd::{Simd, SimdBase, f32x8};

/// The term that one edge adds to the area below a cut and subtracts from the area above it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EdgeTerm {
    /// Height of the edge's lower end above the profile's lowest height.
    pub start: f32,
    /// Extent of the edge along the direction.
    pub reach: f32,
    /// Linear and quadratic coefficient for the part below.
    pub below: [f32; 2],
    /// Linear and quadratic coefficient for the part above.
    pub above: [f32; 2],
}

/// The surface areas of both parts of a cell, divided by that of the cell, as functions of the height of the cut.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Profile {
    /// Lowest height of the cell.
    pub low: f32,
    /// Highest height of the cell.
    pub high: f32,
    /// Cuts nearer than this to either end are not tried.
    pub margin: f32,
    /// Whether planes at the two ends may be worth their cost for triangles that lie in them.
    pub walls: bool,
    /// Constant terms of the shares: the share below a cut at the low end; and the share above a cut at the high
    /// end for prisms, at the low end for cells with edge terms.
    pub constant: [f32; 2],
    /// Share gained below, and lost above, per unit of height.
    pub slope: f32,
    /// Terms of the edges, for cells that are not prisms along the direction.
    pub edges: Vec<EdgeTerm>,
    /// Heights of the vertices of a polytope, computed by its extent for its division.
    pub heights: Vec<f64>,
    /// Buffer for the tangents of a polytope's faces.
    pub tangents: Vec<[[f64; 2]; 3]>,
}

impl Profile {
    /// Returns lower bounds on the shares of the parts from height `at` to the low and to the high end. A part
    /// contains the whole cell scaled towards a point of that end by the part's share of the height, and of two
    /// nested convex bodies the inner has the smaller surface: the share is at least the square of the height's
    /// share.
    pub fn least_shares(&self, at: f32) -> [f32; 2] {
        let extent = self.high - self.low;
        // Subtract 1e-5 for rounding here and in the shares themselves, and the margin, which is several times the
        // rounding of heights.
        let least = |part: f32| {
            let part = ((part - self.margin) / extent - 1e-5).clamp(0.0, 1.0);
            if part > 0.0 { part * part } else { 0.0 }
        };
        [least(at - self.low), least(self.high - at)]
    }

    /// Makes this the profile of a prism between its ends: a part of height zero has the share `end` (the end
    /// face, twice), and its lateral surface grows by `slope` per unit of height.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "shares need no more than f32"
    )]
    pub fn linear(&mut self, end: f64, slope: f64) {
        self.constant = [end as f32; 2];
        self.slope = slope as f32;
        self.edges.clear();
    }

    /// Returns the shares of the parts below and above height `at`. They sum to more than 1, because the face of
    /// the cut belongs to both.
    pub fn shares(&self, at: f32) -> (f32, f32) {
        let mut below = self.constant[0] + self.slope * (at - self.low);
        let mut above = self.constant[1] + self.slope * (self.high - at);
        // Add the quadratic term of each edge, up to the edge's upper end.
        let height = at - self.low;
        for edge in &self.edges {
            let x = (height - edge.start).min(edge.reach).max(0.0);
            below += x * (edge.below[0] + edge.below[1] * x);
            above -= x * (edge.above[0] + edge.above[1] * x);
        }
        (below.max(0.0), above.max(0.0))
    }

    /// Returns the shares for eight heights at once, bit for bit as [`Self::shares`].
    #[inline(always)]
    pub fn shares_x8<S: Simd>(&self, simd: S, at: f32x8<S>) -> (f32x8<S>, f32x8<S>) {
        let low = f32x8::splat(simd, self.low);
        let slope = f32x8::splat(simd, self.slope);
        let zero = f32x8::splat(simd, 0.0);
        // Same operations in the same order as the scalar version.
        let height = at - low;
        let mut below = f32x8::splat(simd, self.constant[0]) + slope * height;
        let mut above =
            f32x8::splat(simd, self.constant[1]) + slope * (f32x8::splat(simd, self.high) - at);
        for edge in &self.edges {
            let x = (height - f32x8::splat(simd, edge.start))
                .min(f32x8::splat(simd, edge.reach))
                .max(zero);
            let term = |c: [f32; 2]| x * (f32x8::splat(simd, c[0]) + f32x8::splat(simd, c[1]) * x);
            below += term(edge.below);
            above -= term(edge.above);
        }
        (below.max(zero), above.max(zero))
    }
}
