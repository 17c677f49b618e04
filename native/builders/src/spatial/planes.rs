// SPDX-License-Identifier: GPL-3.0-or-later
//! The planes that are tried at a node: those between bins of equal width, along each axis.

use crate::binned::SurfaceArea;
use crate::object::Object;
use crate::sides::CHUNK;
use crate::spatial::parts::Cutter;
use halfspace_geom::Aabb;
use rayon::prelude::*;

/// Number of bins between planes that are tried (chosen).
const BINS: usize = 16;

/// A plane that cuts objects.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// Cost of the two sides as leaves, in units of area times triangle tests.
    pub cost: f64,
    /// The axis that it is perpendicular to.
    pub axis: usize,
    /// Its height along the axis.
    pub at: f32,
}

/// The inputs of a search.
#[derive(Clone, Copy)]
pub struct Search<'a> {
    /// Cuts the objects.
    pub cutter: Cutter<'a>,
    /// Costs of leaves.
    pub policy: &'a SurfaceArea,
    /// Largest number of references that a plane may add.
    pub room: usize,
}

impl Search<'_> {
    /// Returns the plane with the cheapest sides; `bounds` is the box around the objects.
    pub fn best(self, objects: &[Object], bounds: &Aabb) -> Option<Plane> {
        let mut best: Option<Plane> = None;
        for axis in 0..3 {
            // Cuts closer to each other would cut off rounding errors.
            if bounds.extent(axis) <= BINS as f64 * f64::from(self.cutter.little()) {
                continue;
            }
            let ruler = Ruler::new(bounds, axis);
            let bins = if objects.len() < 2 * CHUNK {
                self.bins(objects, ruler)
            } else {
                let lists = objects.par_chunks(CHUNK);
                lists
                    .map(|objects| self.bins(objects, ruler))
                    .reduce(|| [Bin::EMPTY; BINS], joined)
            };
            self.sweep(objects.len(), &bins, ruler, &mut best);
        }
        best
    }

    /// Sorts objects into bins, cut at the planes between them.
    fn bins(self, objects: &[Object], ruler: Ruler) -> [Bin; BINS] {
        let axis = ruler.axis;
        let mut bins = [Bin::EMPTY; BINS];
        for object in objects {
            let first = ruler.bin(object.bounds.min[axis]);
            let last = ruler.bin(object.bounds.max[axis]).max(first);
            bins[first].begin += 1;
            bins[last].end += 1;
            // Most objects lie in one bin whole.
            if first == last {
                bins[first].bounds = bins[first].bounds.union(&object.bounds);
                continue;
            }
            for (i, bin) in bins.iter_mut().enumerate().take(last + 1).skip(first) {
                let mut cell = object.bounds;
                if i > first {
                    cell.min[axis] = ruler.height(i);
                }
                if i < last {
                    cell.max[axis] = ruler.height(i + 1);
                }
                if let Some(part) = self.cutter.about(object, &cell) {
                    bin.bounds = bin.bounds.union(&part);
                }
            }
        }
        bins
    }

    /// Tries the planes between the bins of `count` objects.
    fn sweep(self, count: usize, bins: &[Bin; BINS], ruler: Ruler, best: &mut Option<Plane>) {
        // Accumulate boxes and numbers from above, then sweep from below.
        let mut above = [Side::EMPTY; BINS];
        let mut side = Side::EMPTY;
        for i in (1..BINS).rev() {
            side = side.with(&bins[i], bins[i].end);
            above[i] = side;
        }
        let mut below = Side::EMPTY;
        for i in 1..BINS {
            below = below.with(&bins[i - 1], bins[i - 1].begin);
            let above = above[i];
            let references = below.count + above.count;
            if below.count == 0 || above.count == 0 || references > count + self.room {
                continue;
            }
            let cost = below.cost(self.policy) + above.cost(self.policy);
            if best.is_none_or(|b| cost < b.cost) {
                let (axis, at) = (ruler.axis, ruler.height(i));
                *best = Some(Plane { cost, axis, at });
            }
        }
    }
}

/// The objects between two planes.
#[derive(Clone, Copy)]
struct Bin {
    /// Box around the parts of objects in the bin.
    bounds: Aabb,
    /// Number of objects that begin here.
    begin: usize,
    /// Number of objects that end here.
    end: usize,
}

impl Bin {
    /// Bin without objects.
    const EMPTY: Self = Self {
        bounds: Aabb::EMPTY,
        begin: 0,
        end: 0,
    };
}

/// Adds the bins of two sets of objects.
fn joined(mut a: [Bin; BINS], b: [Bin; BINS]) -> [Bin; BINS] {
    for (a, b) in a.iter_mut().zip(&b) {
        a.bounds = a.bounds.union(&b.bounds);
        a.begin += b.begin;
        a.end += b.end;
    }
    a
}

/// The objects and parts on one side of a plane.
#[derive(Clone, Copy)]
struct Side {
    bounds: Aabb,
    count: usize,
}

impl Side {
    /// A side without objects.
    const EMPTY: Self = Self {
        bounds: Aabb::EMPTY,
        count: 0,
    };

    /// Returns the side with one more bin, which adds this number of objects.
    fn with(self, bin: &Bin, count: usize) -> Self {
        Self {
            bounds: self.bounds.union(&bin.bounds),
            count: self.count + count,
        }
    }

    /// Returns the cost of a leaf of these objects, in units of area.
    fn cost(&self, policy: &SurfaceArea) -> f64 {
        self.bounds.area() * policy.leaf(self.count)
    }
}

/// The planes between the bins along an axis.
#[derive(Clone, Copy)]
struct Ruler {
    axis: usize,
    low: f32,
    /// Width of a bin.
    width: f32,
}

impl Ruler {
    /// Divides a box along an axis.
    fn new(bounds: &Aabb, axis: usize) -> Self {
        let low = bounds.min[axis];
        Self {
            axis,
            low,
            width: (bounds.max[axis] - low) / BINS as f32,
        }
    }

    /// Returns the lower end of a bin.
    #[expect(clippy::cast_precision_loss, reason = "a small number")]
    fn height(self, bin: usize) -> f32 {
        // Adding 0.0 turns -0.0 to 0.0, as in the bounds of triangles.
        self.low + self.width * bin as f32 + 0.0
    }

    /// Returns the bin of a height, up to rounding.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "saturates, and is clamped"
    )]
    fn bin(self, at: f32) -> usize {
        (((at - self.low) / self.width) as usize).min(BINS - 1)
    }
}
