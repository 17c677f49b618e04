// SPDX-License-Identifier: GPL-3.0-or-later
//! A beam: its polygon, the lines that bound it, and the node that it is in.

use crate::form::Form;
use crate::line::{Ahead, Line, Side};
use crate::polygon::Polygon;

/// Largest number of lines. Of the lines of two axes, two bound a beam; only those of planes behind the origin are kept
/// next to them. The rays of a beam that has no place for another line go on singly.
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
    /// Number of times that the beam was split since its rays were counted.
    pub splits: u8,
    /// Whether a line found no place, so that its rays may be those of another part too.
    pub unbounded: bool,
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

    /// Whether no ray is on this side and on all others, by comparison with each.
    #[inline(always)]
    fn exclude<F: Form>(&self, form: &F, side: &Side) -> bool {
        let mut all = self.all().iter();
        all.any(|old| form.contains(&old.opposite(), side) == Some(true))
    }

    /// Adds a side; returns `false` if there is no place.
    #[inline(always)]
    fn push<F: Form>(&mut self, form: &F, side: Side, polygon: &Polygon) -> bool {
        // Of two sides of which one contains the other, keep the inner one.
        for old in &mut self.sides[..self.count] {
            if let Some(contains) = form.contains(&side, old) {
                if !contains {
                    *old = side;
                }
                return true;
            }
        }
        if self.count >= MANY {
            self.drop_far(form, polygon);
        }
        let room = self.count < SIDES;
        if room {
            self.sides[self.count] = side;
            self.count += 1;
        }
        room
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
    /// Sets the density from the counted number of open rays.
    #[inline(always)]
    pub fn estimate(&mut self, rays: u32, densest: f64) {
        self.splits = 0;
        let area = self.polygon.area().max(f64::MIN_POSITIVE);
        self.density = (f64::from(rays) / area).min(densest);
    }

    /// The beam, split once more since its rays were counted.
    #[inline(always)]
    pub fn split(self) -> Self {
        Self {
            splits: self.splits.saturating_add(1),
            ..self
        }
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
        // Where many lines pass through one point, as on a diagonal of the cells, parts without rays would multiply.
        if self.sides.exclude(form, &side) {
            return None;
        }
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
        part.unbounded |= !part.sides.push(form, side, &part.polygon);
        Some(part)
    }
}
