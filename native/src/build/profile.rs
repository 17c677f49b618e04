// SPDX-License-Identifier: GPL-3.0-or-later
//! How the surface of a convex cell divides when a plane cuts it at a given height.
//!
//! Along a direction the surface below a cut is a sum over the cell's edges, each of which adds a
//! quadratic polynomial of how much of it lies below. So all heights of a sweep are priced
//! without ever cutting the cell, and the face of the cut is never built. See
//! [`super::polytope`] for where the coefficients come from.

use fearless_simd::{Simd, SimdBase, f32x8};

/// What one edge adds to the surface below a cut, and takes from the surface above it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EdgeTerm {
    /// Where the edge begins, above the profile's lowest height.
    pub start: f32,
    /// How far it reaches along the direction.
    pub reach: f32,
    /// Linear and quadratic coefficient for the part below.
    pub below: [f32; 2],
    /// The same for the part above.
    pub above: [f32; 2],
}

/// The surface of both parts of a cell, as shares of the whole, over the height of the cut.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Profile {
    /// Lowest height of the cell.
    pub low: f32,
    /// Highest height of the cell.
    pub high: f32,
    /// Cuts nearer than this to either end are not tried.
    pub margin: f32,
    /// Whether the two ends are worth a plane for the triangles that lie in them.
    pub walls: bool,
    /// Share below a cut at the low end, and share above a cut there.
    pub constant: [f32; 2],
    /// Share gained below, and lost above, per unit of height.
    pub slope: f32,
    /// For cells that are no boxes along the direction: what the edges add.
    pub edges: Vec<EdgeTerm>,
    /// Heights of the vertices of a polytope, between its two steps.
    pub heights: Vec<f64>,
    /// Room for what its faces add to the edges.
    pub tangents: Vec<[[f64; 2]; 3]>,
}

impl Profile {
    /// The least share of the surface that a part of the cell can have which reaches from height `at`
    /// to one of the cell's ends, first the low one. The part holds the whole cell shrunk towards a point of that
    /// end by its share of the height, and of two convex bodies the inner has the smaller surface: so its share is
    /// at least the square of the height's.
    pub fn least_shares(&self, at: f32) -> [f32; 2] {
        let extent = self.high - self.low;
        // One part in 10^5 for rounding here and in the shares themselves, and the margin, which is
        // several times the rounding of heights.
        let least = |part: f32| {
            let part = ((part - self.margin) / extent - 1e-5).clamp(0.0, 1.0);
            if part > 0.0 { part * part } else { 0.0 }
        };
        [least(at - self.low), least(self.high - at)]
    }

    /// Makes this the profile of a prism between the ends that are set: both ends have the share
    /// `end` (the end face, twice), and the mantle grows by `slope` per unit of height.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "shares need no more than f32"
    )]
    pub fn linear(&mut self, end: f64, slope: f64) {
        self.constant = [end as f32; 2];
        self.slope = slope as f32;
        self.edges.clear();
    }

    /// The shares of the parts below and above height `at`; more than 1 together, as the cut counts
    /// for both.
    pub fn shares(&self, at: f32) -> (f32, f32) {
        let mut below = self.constant[0] + self.slope * (at - self.low);
        let mut above = self.constant[1] + self.slope * (self.high - at);
        let height = at - self.low;
        for edge in &self.edges {
            let x = (height - edge.start).min(edge.reach).max(0.0);
            below += x * (edge.below[0] + edge.below[1] * x);
            above -= x * (edge.above[0] + edge.above[1] * x);
        }
        (below.max(0.0), above.max(0.0))
    }

    /// The same for eight heights at once, bit for bit.
    #[inline(always)]
    pub fn shares_x8<S: Simd>(&self, simd: S, at: f32x8<S>) -> (f32x8<S>, f32x8<S>) {
        let low = f32x8::splat(simd, self.low);
        let slope = f32x8::splat(simd, self.slope);
        let zero = f32x8::splat(simd, 0.0);
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
