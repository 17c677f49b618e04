// SPDX-License-Identifier: GPL-3.0-or-later
//! The raster of the rays of one octant: rows of bins in the plane of directions. Rays are stored bin by bin, so the
//! rays of a polygon in one row are consecutive, whatever their order in the batch and their number per pixel.

use crate::polygon::Polygon;
use fearless_simd::{Simd, SimdBase, f32x8};
use std::ops::Range;

/// Average number of rays in a bin (chosen: rays beyond the end of a span are tested in vain).
const RAYS_PER_BIN: f64 = 2.0;

/// Width of a bin relative to its height: rows of several rays fill vectors better.
const SHAPE: f64 = 0.5;

/// Largest number of rows or columns.
const MOST: f64 = 16_384.0;

/// Bounds of rays in the plane of directions: of `p`, `q`, `p + q` and `p - q`.
#[derive(Debug, Clone, Copy)]
pub struct Extent {
    /// Smallest values.
    pub low: [f32; 4],
    /// Largest values.
    pub high: [f32; 4],
    /// Number of rays.
    pub count: usize,
}

impl Extent {
    /// The extent of no rays.
    pub const NOTHING: Self = Self {
        low: [f32::INFINITY; 4],
        high: [f32::NEG_INFINITY; 4],
        count: 0,
    };

    /// Adds eight rays.
    #[inline(always)]
    pub fn add_all<S: Simd>(&mut self, simd: S, p: &[f32; 8], q: &[f32; 8]) {
        let [p, q] = [p, q].map(|row| f32x8::from_slice(simd, row));
        for (i, x) in [p, q, p + q, p - q].into_iter().enumerate() {
            self.low[i] = self.low[i].min(x.reduce_min());
            self.high[i] = self.high[i].max(x.reduce_max());
        }
        self.count += 8;
    }

    /// Adds a ray.
    #[inline(always)]
    pub fn add(&mut self, [p, q]: [f32; 2]) {
        for (i, x) in [p, q, p + q, p - q].into_iter().enumerate() {
            self.low[i] = self.low[i].min(x);
            self.high[i] = self.high[i].max(x);
        }
        self.count += 1;
    }

    /// The octagon around the rays, larger by the rounding of their coordinates.
    pub fn polygon(&self) -> Polygon {
        // Derived: p and q have errors below 4 u, their sum and difference below 10 u.
        let pad = 1e-6;
        let low = self.low.map(|x| f64::from(x) - pad);
        let high = self.high.map(|x| f64::from(x) + pad);
        let mut polygon = Polygon::rectangle([[low[0], low[1]], [high[0], high[1]]]);
        for (i, line) in [(2, [1.0, 1.0, 0.0]), (3, [1.0, -1.0, 0.0])] {
            polygon = polygon.below(&polygon.heights(line), high[i]);
            polygon = polygon.above(&polygon.heights(line), low[i]);
        }
        polygon
    }
}

/// Rows of bins.
#[derive(Debug, Clone, Default)]
pub struct Raster {
    origin: [f32; 2],
    /// Bins per unit.
    scale: [f32; 2],
    columns: u32,
    rows: u32,
    /// Error bound of a ray's position, in bins.
    pad: [f64; 2],
    /// Number of the first ray of each bin, and the number behind the last ray.
    pub first: Vec<u32>,
}

impl Raster {
    /// Bins for the rays in an extent.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "at most MOST"
    )]
    pub fn new(extent: &Extent) -> Self {
        let size = |k: usize| f64::from(extent.high[k] - extent.low[k]).max(1e-6);
        let bins = extent.count as f64 / RAYS_PER_BIN;
        let rows = (bins * SHAPE * size(1) / size(0))
            .sqrt()
            .clamp(1.0, MOST)
            .floor();
        let columns = (bins / rows).clamp(1.0, MOST).floor();
        let per_unit = [columns / size(0), rows / size(1)];
        Self {
            origin: [extent.low[0], extent.low[1]],
            scale: per_unit.map(|x| x as f32),
            columns: columns as u32,
            rows: rows as u32,
            pad: per_unit.map(|x| 1e-6 * x + 5e-3),
            first: vec![0; columns as usize * rows as usize + 1],
        }
    }

    /// The bin of a ray.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "saturates"
    )]
    pub fn bin(&self, [p, q]: [f32; 2]) -> u32 {
        let column = ((p - self.origin[0]) * self.scale[0]) as u32;
        let row = ((q - self.origin[1]) * self.scale[1]) as u32;
        row.min(self.rows - 1) * self.columns + column.min(self.columns - 1)
    }

    /// Adds the rows of a polygon to `spans`, as ranges of rays that contain all of its rays and few others; returns
    /// their number of rays. `edges` is memory for one entry per row.
    #[inline(always)]
    pub fn scan(
        &self,
        polygon: &Polygon,
        edges: &mut Vec<[f64; 2]>,
        spans: &mut Vec<Range<u32>>,
    ) -> usize {
        spans.clear();
        let place = |[p, q]: [f64; 2]| {
            [
                (p - f64::from(self.origin[0])) * f64::from(self.scale[0]),
                (q - f64::from(self.origin[1])) * f64::from(self.scale[1]),
            ]
        };
        // Find the rows that the polygon meets.
        let (mut bottom, mut top) = (f64::INFINITY, f64::NEG_INFINITY);
        for corner in polygon.corners() {
            let [_, y] = place(*corner);
            bottom = bottom.min(y);
            top = top.max(y);
        }
        if !(bottom - self.pad[1] <= f64::from(self.rows) && top + self.pad[1] >= 0.0) {
            return 0;
        }
        let rows = self.row(bottom - self.pad[1])..=self.row(top + self.pad[1]);
        let begin = *rows.start();
        edges.clear();
        edges.resize(rows.clone().count(), [f64::INFINITY, f64::NEG_INFINITY]);
        // Clip each edge to the band of each row that it meets.
        let Some(mut from) = polygon.corners().last().map(|corner| place(*corner)) else {
            return 0;
        };
        for corner in polygon.corners() {
            let to = place(*corner);
            self.clip_edge([from, to], begin, edges);
            from = to;
        }
        self.collect(begin, edges, spans)
    }

    /// The row at a height.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the raster"
    )]
    fn row(&self, y: f64) -> usize {
        y.clamp(0.0, f64::from(self.rows - 1)) as usize
    }

    /// Widens the rows from `begin` on by those parts of an edge, in bins, that lie in them.
    #[inline(always)]
    fn clip_edge(&self, [from, to]: [[f64; 2]; 2], begin: usize, edges: &mut [[f64; 2]]) {
        let [low, high] = if from[1] <= to[1] {
            [from, to]
        } else {
            [to, from]
        };
        let rise = high[1] - low[1];
        let slope = if rise > 0.0 {
            (high[0] - low[0]) / rise
        } else {
            0.0
        };
        let (left, right) = (low[0].min(high[0]), low[0].max(high[0]));
        let last = self.rows as usize - 1;
        for r in self.row(low[1] - self.pad[1])..=self.row(high[1] + self.pad[1]) {
            // The band is larger by the error of a ray's position; the outer ones have no outer border.
            let floor = if r == 0 {
                f64::NEG_INFINITY
            } else {
                r as f64 - self.pad[1]
            };
            let ceiling = if r == last {
                f64::INFINITY
            } else {
                (r + 1) as f64 + self.pad[1]
            };
            let (y0, y1) = (low[1].max(floor), high[1].min(ceiling));
            if y0 > y1 {
                continue;
            }
            let x0 = if y0 > low[1] {
                low[0] + (y0 - low[1]) * slope
            } else {
                low[0]
            };
            let x1 = if y1 < high[1] {
                low[0] + (y1 - low[1]) * slope
            } else {
                high[0]
            };
            let edge = &mut edges[r - begin];
            edge[0] = edge[0].min(x0.min(x1).max(left));
            edge[1] = edge[1].max(x0.max(x1).min(right));
        }
    }

    /// Converts the rows from `begin` on to ranges of rays; returns their number of rays.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the raster"
    )]
    fn collect(&self, begin: usize, edges: &[[f64; 2]], spans: &mut Vec<Range<u32>>) -> usize {
        let mut count = 0;
        let end = f64::from(self.columns - 1);
        for (r, [left, right]) in (begin..).zip(edges) {
            let (left, right) = (left - self.pad[0], right + self.pad[0]);
            if !(left <= end + 1.0 && right >= 0.0) {
                continue;
            }
            let start = r * self.columns as usize;
            let bin = |x: f64| start + x.clamp(0.0, end) as usize;
            let span = self.first[bin(left)]..self.first[bin(right) + 1];
            if !span.is_empty() {
                count += span.len();
                spans.push(span);
            }
        }
        count
    }
}
