// SPDX-License-Identifier: GPL-3.0-or-later
//! Stackless traversal of axis-aligned plane trees along ropes, from leaf to leaf (MacDonald and Booth 1990;
//! Havran, Bittner and Žára 1998).
//!
//! The ray leaves a leaf through the wall it reaches first; the rope there links to the subtree behind the
//! wall, and the crossing distance locates the next leaf in it. The published form locates it by the crossing
//! point, and rounding may then skip a leaf that the ray enters near an edge only. Here each decision is taken
//! only if it is certain: the ray reaches all other walls, and each plane behind the wall, certainly later, or
//! has certainly crossed it. Then the leaf found is the one the ray is in. At the first uncertain decision, the
//! rest of the ray is traced from the root by distances ([`halfspace_single::planes::dir`]), starting at the last
//! certain crossing. This is rare except for rays along walls.
//!
//! Termination: each rope crosses a wall in the ray's direction, and all cells on one side of a plane precede
//! those on the other, so no leaf is visited twice.

use fearless_simd::Simd;
use halfspace_geom::bound::{keep_max, keep_min};
use halfspace_geom::vec3::map;
use halfspace_leaf::{Job, Leaf};
use halfspace_nodes::axis_tree::{AxisTree, SharedAxisTree};
use halfspace_nodes::ropes::{OUTSIDE, Ropes, Step};
use halfspace_ray::query::{Best, Counters, NoCount, Query};
use halfspace_ray::{FrameRay, RayRef};
use halfspace_single::planes::dir::{Entries, PlaneTraversal};
use halfspace_single::single_rays;
use halfspace_trace::batch::SingleTraversal;
use std::sync::Arc;

/// The traversal of one tree, as published or with certain steps only.
pub struct RopeTraversal<'a, const PUBLISHED: bool> {
    /// The tree.
    pub tree: AxisTree<'a>,
    /// Its links.
    pub ropes: &'a Ropes,
}

/// The distance where a ray crosses a plane: as computed, and its lower and upper bound.
#[derive(Clone, Copy)]
struct Distance {
    about: f32,
    low: f32,
    high: f32,
}

impl Distance {
    /// The distance to a plane across `axis`, with its error bound.
    #[inline(always)]
    fn new(frame: &FrameRay, axis: usize, plane: f32) -> Self {
        let about = (plane - frame.o[axis]) * frame.inv[axis];
        Self {
            about,
            low: about - frame.slack[axis],
            high: about + frame.slack[axis],
        }
    }

    /// A distance that is exactly known.
    #[inline(always)]
    fn exact(about: f32) -> Self {
        Self {
            about,
            low: about,
            high: about,
        }
    }
}

/// The crossing from one leaf to the next.
#[derive(Clone, Copy)]
struct Crossing {
    /// Axis of the wall; [`START`] for the ray's start.
    axis: usize,
    distance: Distance,
}

/// Stands for the axis at the ray's start, which crosses no wall.
const START: usize = 3;

/// A leaf, and its number among the ends of ropes.
struct LinkedLeaf {
    link: u32,
    leaf: Leaf,
}

impl<const PUBLISHED: bool> RopeTraversal<'_, PUBLISHED> {
    /// The leaf below `link` that the ray enters at `crossing`; `None` if that leaf is not certain.
    #[inline(always)]
    fn leaf<C: Counters>(
        &self,
        frame: &FrameRay,
        mut link: u32,
        crossing: Crossing,
        counters: &mut C,
    ) -> Option<LinkedLeaf> {
        let at = crossing.distance;
        loop {
            let (axis, split, children) = match self.ropes.step(self.tree, link) {
                Step::Plane {
                    axis,
                    split,
                    children,
                } => (axis, split, children),
                Step::Leaf { first, count } => {
                    let leaf = Leaf { first, count };
                    return Some(LinkedLeaf { link, leaf });
                }
            };
            counters.step_axis();
            // Go to the near side of planes parallel to the wall, else to the side that the crossing lies on.
            let near = frame.negative[axis] as usize % 2;
            link = if axis == crossing.axis {
                children[near]
            } else if PUBLISHED {
                let point = frame.o[axis] + at.about * frame.d[axis];
                children[usize::from(point > split)]
            } else {
                let plane = Distance::new(frame, axis, split);
                if plane.low > at.high {
                    children[near]
                } else if plane.high < at.low {
                    children[1 - near]
                } else {
                    return None;
                }
            };
        }
    }

    /// The distances to the walls of a leaf that lie ahead, one per axis.
    #[inline(always)]
    fn walls(&self, frame: &FrameRay, link: u32) -> [Distance; 3] {
        let walls = self.ropes.walls(link);
        map([0, 1, 2], |k: usize| {
            Distance::new(frame, k, walls[k][1 - frame.negative[k] as usize % 2])
        })
    }
}

/// The part of a ray from distance `from` on that may hold a better hit than its best one so far; `None` if there is
/// no such part.
#[inline(always)]
fn rest_of<'a>(
    RayRef { ray, frame }: RayRef<'a>,
    from: f32,
    best: &mut Best,
) -> Option<FrameRay<'a>> {
    if from > best.reach {
        return None;
    }
    let mut rest = *frame;
    rest.t_min = keep_max(from, frame.t_min);
    rest.t_max = keep_min(best.reach, frame.t_max);
    rest.known = best.answer(RayRef { ray, frame });
    Some(rest)
}

/// The axis of the smallest distance; of equal ones the first.
#[inline(always)]
fn nearest(distances: &[Distance; 3]) -> usize {
    let mut axis = 0;
    if distances[1].about < distances[axis].about {
        axis = 1;
    }
    if distances[2].about < distances[axis].about {
        axis = 2;
    }
    axis
}

impl<const PUBLISHED: bool> SingleTraversal for RopeTraversal<'_, PUBLISHED> {
    type Scratch = Entries<u32>;
    type Uncounted = NoCount;

    fn scratch(&self) -> Self::Scratch {
        PlaneTraversal(self.tree.tree()).scratch()
    }

    #[inline(always)]
    fn cast<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        job: Job<'_>,
        ray: RayRef<'_>,
        entries: &mut Self::Scratch,
        counters: &mut C,
    ) -> Best {
        let frame = ray.frame;
        let mut best = Best::new(frame);
        let mut from = frame.t_min;
        let mut link = self.tree.root();
        let mut crossing = Crossing {
            axis: START,
            distance: Distance::exact(frame.t_min),
        };
        while let Some(found) = self.leaf(frame, link, crossing, counters) {
            // Find the wall ahead that the ray reaches first, and test the leaf's triangles up to it.
            let ahead = self.walls(frame, found.link);
            let axis = nearest(&ahead);
            let next = ahead[axis];
            counters.leaf(found.leaf.count);
            let leave = keep_min(next.high, frame.t_max);
            let ends = job.test::<S, Q, C>(simd, found.leaf, ray, leave, &mut best, counters);
            if ends || PUBLISHED && best.is_found_before(leave) {
                return best;
            }
            // A NaN bound fails this comparison and makes the step uncertain.
            let certain = (0..3).all(|k| k == axis || ahead[k].low > next.high);
            if !PUBLISHED && !certain {
                // No wall ahead is crossed before the smallest lower bound: continue there.
                let low = ahead.map(|wall| keep_max(wall.low, f32::NEG_INFINITY));
                from = keep_max(keep_min(low[0], keep_min(low[1], low[2])), from);
                break;
            }
            // Follow the rope across the wall, until the ray ends or leaves the scene.
            from = next.low;
            link = self.ropes.links(found.link)[axis][1 - frame.negative[axis] as usize % 2];
            if from > best.reach || from > frame.t_max || link == OUTSIDE {
                return best;
            }
            crossing = Crossing {
                axis,
                distance: next,
            };
        }
        // Trace the rest of the ray from the root, after an uncertain step.
        let Some(rest) = rest_of(ray, from, &mut best) else {
            return best;
        };
        let rest = RayRef {
            ray: ray.ray,
            frame: &rest,
        };
        PlaneTraversal(self.tree.tree()).cast::<S, Q, C>(simd, job, rest, entries, counters)
    }
}

single_rays! {
    /// Single rays from leaf to leaf along ropes, with error bounds.
    fn rope(SharedAxisTree, ropes: Arc<Ropes>) -> RopeTraversal<'a, false> {
        |kernel| RopeTraversal { tree: kernel.tree.borrowed(), ropes: &kernel.ropes }
    }
}

single_rays! {
    /// The same as published, without error bounds.
    fn rope_published(SharedAxisTree, ropes: Arc<Ropes>) -> RopeTraversal<'a, true> {
        |kernel| RopeTraversal { tree: kernel.tree.borrowed(), ropes: &kernel.ropes }
    }
}
