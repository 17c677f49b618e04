// SPDX-License-Identifier: GPL-3.0-or-later
//! A beam: its polygon, the lines that bound it, and the node that it is in.

use crate::form::Form;
use crate::line::{Ahead, Line, Side};
use crate::polygon::Polygon;

/// Largest number of lines. Lines that no longer touch the polygon are dropped; one that finds no place is left out, and
/// rays beyond it may then be tested in the leaves of two beams.
const SIDES: usize = 16;

/// Number of lines from which on those that no longer touch the polygon are looked for.
const MANY: usize = 10;

/// The face through which a beam enters a node.
#[derive(Debug, Clone, Copy)]
pub enum Entry {
    /// None: the beam begins inside.
    Inside,
    /// The face in this plane.
    Face(Ahead),
}

/// The lines that bound a beam.
#[derive(Debug, Clone, Copy)]
pub struct Sides {
    sides: [Side; SIDES],
    count: usize,
}

/// A beam in a node.
#[derive(Debug, Clone, Copy)]
pub struct Beam {
    /// The polygon, a little larger than the beam.
    pub polygon: Polygon,
    /// Lines that decide which rays belong to the beam.
    pub sides: Sides,
    /// The node.
    pub node: u32,
    /// Lowest corner of the node on the grid of the smallest cells, counted in the direction of the rays.
    pub low: [u32; 3],
    /// How the beam enters the node.
    pub entry: Entry,
    /// Estimated number of open rays per area of the polygon.
    pub density: f64,
    /// Index of the ray that the beam's work is counted for.
    pub payer: u32,
}

/// The corners of a polygon compared with a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Position {
    /// All rays are on one side: the plane of the first argument comes first, or the other one.
    Whole(bool),
    /// There may be rays on both sides.
    Across,
}

impl Sides {
    /// No line.
    pub fn none() -> Self {
        Self {
            sides: [Side::default(); SIDES],
            count: 0,
        }
    }

    /// The lines.
    #[inline(always)]
    pub fn all(&self) -> &[Side] {
        &self.sides[..self.count]
    }

    #[inline(always)]
    fn push<F: Form>(&mut self, form: &F, side: Side, polygon: &Polygon) {
        // Of two sides of which one contains the other, keep the inner one.
        for old in &mut self.sides[..self.count] {
            if let Some(contains) = form.contains(&side, old) {
                if !contains {
                    *old = side;
                }
                return;
            }
        }
        if self.count >= MANY {
            self.drop_far(form, polygon);
        }
        if self.count < SIDES {
            self.sides[self.count] = side;
            self.count += 1;
        }
    }

    /// Drops the lines that are certainly farther from all rays in the polygon than its rounding.
    #[inline(always)]
    pub fn drop_far<F: Form>(&mut self, form: &F, polygon: &Polygon) {
        let mut kept = 0;
        for i in 0..self.count {
            let side = self.sides[i];
            let heights = polygon.heights(form.coefficients(&side.line));
            let margin = 2.0 * form.tolerance(&side.line);
            let inside = if side.lower_first {
                heights.most < -margin
            } else {
                heights.least > margin
            };
            if !inside {
                self.sides[kept] = side;
                kept += 1;
            }
        }
        self.count = kept;
    }
}

impl Beam {
    /// Sets the density from the number of open rays.
    #[inline(always)]
    pub fn estimate(&mut self, rays: u32, densest: f64) {
        let area = self.polygon.area().max(f64::MIN_POSITIVE);
        self.density = (f64::from(rays) / area).min(densest);
    }

    /// Compares the beam with the line of two planes.
    #[inline(always)]
    pub fn compare<F: Form>(&self, form: &F, one: Ahead, other: Ahead) -> Position {
        let (line, in_order) = Line::new(one, other);
        if form.is_along(&line) {
            return Position::Whole(!in_order);
        }
        let heights = self.polygon.heights(form.coefficients(&line));
        let margin = 2.0 * form.tolerance(&line);
        if heights.most < -margin {
            Position::Whole(in_order)
        } else if heights.least > margin {
            Position::Whole(!in_order)
        } else {
            Position::Across
        }
    }

    /// The part of the beam on one side of a line; `None` if certainly no ray lies there.
    ///
    /// The polygon is cut a little outside the line, so that it contains all rays of the part in spite of rounding.
    #[inline(always)]
    pub fn part<F: Form>(&self, form: &F, side: Side) -> Option<Self> {
        let heights = self.polygon.heights(form.coefficients(&side.line));
        let tolerance = form.tolerance(&side.line);
        let mut part = *self;
        if side.lower_first {
            if heights.least > tolerance {
                return None;
            }
            if heights.most > tolerance {
                part.polygon = self.polygon.below(&heights, tolerance);
            }
        } else {
            if heights.most < -tolerance {
                return None;
            }
            if heights.least < -tolerance {
                part.polygon = self.polygon.above(&heights, -tolerance);
            }
        }
        part.sides.push(form, side, &part.polygon);
        Some(part)
    }
}
