// SPDX-License-Identifier: GPL-3.0-or-later
//! Traversal of plane trees with few directions. A ray's origin and direction are projected onto all of them before
//! the traversal starts, and a step then costs what it costs in a kd-tree, also at an oblique plane (Kammaje and Mora
//! 2007; Budge et al. 2008).
//!
//! # Error bound
//!
//! Each projection is the dot product that [`halfspace_single::planes::dir`] computes at an oblique node, with the same
//! products, sums and roundings, and so is the distance `(offset - height) * inverse`. All distances are therefore
//! those of [`halfspace_single::planes::dir`] bit for bit, and the bound is the same: the height of a point `o + t d`
//! over a plane that meets the scene, `n . (o + t d) - c` with `|n| <= 1`, has an error of at most
//! [`FrameRay::oblique_pad`], and a distance one of this bound multiplied by the inverse of the speed along `n`. The
//! bound depends on the ray and the direction alone, not on the plane, so it is computed once with the projections.
//! Along the axes the bounds are [`FrameRay::slack`].

use fearless_simd::{Simd, SimdBase, SimdFloat, f32x8};
use halfspace_leaf::Job;
use halfspace_nodes::plane_tree::MAX_DEPTH;
use halfspace_nodes::projected_tree::{CODES, Projected, ProjectedTree};
use halfspace_ray::query::{Best, Counters, NoCount, Query};
use halfspace_ray::{FrameRay, Interval, RayRef};
use halfspace_single::planes::dir::{self, Crossing, oblique};
use halfspace_single::single_rays;
use halfspace_trace::batch::SingleTraversal;
use halfspace_trace::first_hit;
use halfspace_trace::stack::{Entry, NodeEntry, Stack};

/// Number of directions that are projected at once.
const LANES: usize = 8;

/// A ray along each direction of a tree, by the direction's code.
pub struct Projections {
    /// Height of the origin.
    height: [f32; CODES],
    /// Inverse of the speed, with the sign bit of the speed even where that is zero.
    inverse: [f32; CODES],
    /// Error bound of a distance to a plane.
    slack: [f32; CODES],
}

impl Projections {
    /// Memory for the projections of one ray.
    const BLANK: Self = Self {
        height: [0.0; CODES],
        inverse: [0.0; CODES],
        slack: [0.0; CODES],
    };

    /// Projects a ray onto the directions of a tree. The axes come first, and their projections are coordinates.
    #[inline(always)]
    fn fill<S: Simd>(&mut self, simd: S, frame: &FrameRay, tree: &ProjectedTree) {
        let (table, count) = tree.directions();
        let splat = |x: f32| f32x8::splat(simd, x);
        let [o, d] = [frame.o, frame.d].map(|v| v.map(splat));
        // The smallest normal number keeps the inverse finite for rays along a plane.
        let (least, pad) = (splat(f32::MIN_POSITIVE), splat(frame.oblique_pad));
        for first in (0..count).step_by(LANES) {
            let lanes = first..first + LANES;
            let n = [0, 1, 2].map(|k: usize| f32x8::from_slice(simd, &table[k][lanes.clone()]));
            let dot = |v: [f32x8<S>; 3]| n[0] * v[0] + n[1] * v[1] + n[2] * v[2];
            let speed = dot(d);
            let inverse = splat(1.0) / (speed + least.copysign(speed));
            dot(o).store_slice(&mut self.height[lanes.clone()]);
            inverse.store_slice(&mut self.inverse[lanes.clone()]);
            (pad * inverse.abs()).store_slice(&mut self.slack[lanes]);
        }
        // Replace the axes' by coordinates, which have smaller errors.
        self.height[..3].copy_from_slice(&frame.o);
        self.inverse[..3].copy_from_slice(&frame.inv);
        self.slack[..3].copy_from_slice(&frame.slack);
    }

    /// The crossing of the plane at `offset` along a direction. `PUBLISHED`: without error bound.
    #[inline(always)]
    fn crossing<const PUBLISHED: bool>(
        &self,
        direction: usize,
        offset: f32,
        children: u32,
        empty: u32,
    ) -> Crossing {
        // The remainder proves that the code is in range.
        let code = direction % CODES;
        let inverse = self.inverse[code];
        let distance = (offset - self.height[code]) * inverse;
        let slack = if PUBLISHED { 0.0 } else { self.slack[code] };
        Crossing {
            near: children ^ (inverse.to_bits() >> 31),
            empty,
            bounds: Interval::new(distance - slack, distance + slack),
        }
    }
}

/// The traversal of one tree, with error bounds or as published.
pub struct ProjectedTraversal<'a, const PUBLISHED: bool>(
    /// The nodes.
    pub &'a ProjectedTree,
);

/// Memory that rays use one after another.
pub struct Scratch {
    entries: [NodeEntry; MAX_DEPTH + 1],
    projections: Projections,
}

impl<const PUBLISHED: bool> SingleTraversal for ProjectedTraversal<'_, PUBLISHED> {
    type Scratch = Scratch;
    type Uncounted = NoCount;

    fn scratch(&self) -> Self::Scratch {
        Scratch {
            entries: [NodeEntry::blank(0); MAX_DEPTH + 1],
            projections: Projections::BLANK,
        }
    }

    #[inline(always)]
    fn cast<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        job: Job<'_>,
        ray: RayRef<'_>,
        scratch: &mut Self::Scratch,
        counters: &mut C,
    ) -> Best {
        let (tree, frame) = (self.0, ray.frame);
        let projections = &mut scratch.projections;
        projections.fill(simd, frame, tree);
        let mut best = Best::new(frame);
        let mut stack = Stack::new(&mut scratch.entries);
        let mut next = NodeEntry {
            node: tree.root(),
            interval: Interval::new(frame.t_min, frame.t_max),
        };
        loop {
            // Choose the children of an inner node, or test the triangles of a leaf.
            let crossing = match tree.node(next.node) {
                Projected::Along {
                    direction,
                    offset,
                    children,
                    empty,
                } => {
                    if direction < 3 {
                        counters.step_axis();
                    } else {
                        counters.step_oblique();
                    }
                    projections.crossing::<PUBLISHED>(direction, offset, children, empty)
                }
                Projected::Whole {
                    normal,
                    offset,
                    children,
                    empty,
                } => {
                    counters.step_oblique();
                    oblique(frame, normal, offset, children, empty)
                }
                Projected::Leaf(leaf) => {
                    counters.leaf(leaf.count);
                    let leave = next.interval.leave;
                    if first_hit::test::<PUBLISHED, S, Q, C>(
                        simd, leaf, job, ray, leave, &mut best, counters,
                    ) {
                        return best;
                    }
                    // Continue with the nearest node on the stack; with error bounds, only before the best hit.
                    let entry = if PUBLISHED {
                        stack.pop_entry().map(Entry::read)
                    } else {
                        let reach = best.reach;
                        stack.pop_within(reach).map(|entry| entry.within(reach))
                    };
                    match entry {
                        Some(entry) => next = entry,
                        None => return best,
                    }
                    continue;
                }
            };
            next = dir::step(next, |index| index, &crossing, &mut stack);
        }
    }
}

single_rays! {
    /// Single rays by their projections, with error bounds.
    fn projected(ProjectedTree) -> ProjectedTraversal<'a, false> {
        |kernel| ProjectedTraversal(&kernel.tree)
    }
}

single_rays! {
    /// The same as published, without error bounds.
    fn projected_published(ProjectedTree) -> ProjectedTraversal<'a, true> {
        |kernel| ProjectedTraversal(&kernel.tree)
    }
}
