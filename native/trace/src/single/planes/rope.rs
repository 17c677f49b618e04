// SPDX-License-Identifier: GPL-3.0-or-later
//! Stackless traversal of axis-aligned plane trees along ropes, from leaf to leaf (MacDonald and Booth 1990;
//! Havran, Bittner and Žára 1998).
//!
//! The ray leaves a leaf through the wall it reaches first; the rope there links to the subtree behind the
//! wall, and the crossing distance locates the next leaf in it. The published form locates it by the crossing
//! point, and rounding may then skip a leaf that the ray enters near an edge only. Here each decision is taken
//! only if it is certain: the ray reaches all other walls, and each plane behind the wall, certainly later, or
//! has certainly crossed it. Then the leaf found is the one the ray is in. At the first uncertain decision, the
//! rest of the ray is traced from the root by distances ([`crate::single::planes::dir`]), starting at the last certain
//! crossing. This is rare except for rays along walls.
//!
//! Termination: each rope crosses a wall in the ray's direction, and all cells on one side of a plane precede
//! those on the other, so no leaf is visited twice.

use crate::batch;
use crate::single::planes::dir as plane_dir;
use crate::single::single_rays;
use fearless_simd::Simd;
use halfspace_geom::bound::{keep_max, keep_min};
use halfspace_geom::vec3::map;
use halfspace_leaf::{Job, Leaf};
use halfspace_nodes::plane_tree::PlaneTree;
use halfspace_nodes::ropes::{OUTSIDE, Ropes, Step};
use halfspace_ray::query::{Best, Counters, Query};
use halfspace_ray::{FrameRay, Hit, RayRef};
use std::sync::Arc;

/// The traversal of one tree, as published or with certain steps only.
///
/// # Panics
/// On a tree with oblique planes; the registry offers this traversal for axis-aligned trees only.
pub struct Walk<'a, const PUBLISHED: bool>(pub &'a PlaneTree, pub &'a Ropes);

/// The distance where a ray crosses a plane: as computed, and its lower and upper bound.
#[derive(Clone, Copy)]
struct Moment {
    about: f32,
    low: f32,
    high: f32,
}

impl Moment {
    #[inline(always)]
    fn new(frame: &FrameRay, axis: usize, plane: f32) -> Self {
        let about = (plane - frame.o[axis]) * frame.inv[axis];
        Self {
            about,
            low: about - frame.slack[axis],
            high: about + frame.slack[axis],
        }
    }
}

/// The crossing from one leaf to the next.
#[derive(Clone, Copy)]
struct Crossing {
    /// Axis of the wall; [`START`] for the ray's start.
    axis: usize,
    moment: Moment,
}

/// Stands for the axis at the ray's start, which crosses no wall.
const START: usize = 3;

impl<const PUBLISHED: bool> Walk<'_, PUBLISHED> {
    /// The leaf below `link` that the ray enters at `crossing`: its link, and first block and number of
    /// triangles. `None` if that leaf is not certain.
    #[inline(always)]
    fn leaf<C: Counters>(
        &self,
        frame: &FrameRay,
        mut link: u32,
        crossing: Crossing,
        counters: &mut C,
    ) -> Option<(u32, Leaf)> {
        let Crossing {
            axis: across,
            moment,
        } = crossing;
        loop {
            let (axis, split, children) = match self.1.step(self.0, link) {
                Step::Plane {
                    axis,
                    split,
                    children,
                } => (axis, split, children),
                Step::Leaf { first, count } => return Some((link, Leaf { first, count })),
            };
            counters.step_axis();
            // Go to the near side of planes parallel to the wall, else to the side that the crossing lies on.
            let near = frame.negative[axis] as usize % 2;
            link = if axis == across {
                children[near]
            } else if PUBLISHED {
                let point = frame.o[axis] + moment.about * frame.d[axis];
                children[usize::from(point > split)]
            } else {
                let plane = Moment::new(frame, axis, split);
                if plane.low > moment.high {
                    children[near]
                } else if plane.high < moment.low {
                    children[1 - near]
                } else {
                    return None;
                }
            };
        }
    }

    /// Traces the rest of a ray, from distance `from` on, from the root.
    #[inline(always)]
    fn rest<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        triangles: Job<'_>,
        RayRef { ray, frame }: RayRef<'_>,
        (best, from): (&Best, f32),
        stack: &mut plane_dir::Stack<u32>,
        counters: &mut C,
    ) -> Hit {
        if from > best.reach {
            return best.hit();
        }
        let mut rest = *frame;
        rest.t_min = keep_max(from, frame.t_min);
        rest.t_max = keep_min(best.reach, frame.t_max);
        rest.known = best.hit();
        let walk = plane_dir::Walk(self.0);
        batch::Walk::cast::<S, Q, C>(
            &walk,
            simd,
            triangles,
            RayRef { ray, frame: &rest },
            stack,
            counters,
        )
    }
}

impl<const PUBLISHED: bool> batch::Walk for Walk<'_, PUBLISHED> {
    type Scratch = plane_dir::Stack<u32>;

    fn scratch(&self) -> Self::Scratch {
        batch::Walk::scratch(&plane_dir::Walk(self.0))
    }

    #[inline(always)]
    fn cast<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        Job { scene, blocks }: Job<'_>,
        RayRef { ray, frame }: RayRef<'_>,
        stack: &mut Self::Scratch,
        counters: &mut C,
    ) -> Hit {
        let triangles = Job { scene, blocks };
        let mut best = Best::new(frame);
        // Begin at the root, with a start that is exactly known.
        let start = Moment {
            about: frame.t_min,
            low: frame.t_min,
            high: frame.t_min,
        };
        let mut from = frame.t_min;
        let mut link = self.0.root();
        let mut crossing = Crossing {
            axis: START,
            moment: start,
        };
        loop {
            let Some((node, leaf)) = self.leaf(frame, link, crossing, counters) else {
                let so_far = (&best, from);
                return self.rest::<S, Q, C>(
                    simd,
                    triangles,
                    RayRef { ray, frame },
                    so_far,
                    stack,
                    counters,
                );
            };
            // Find the wall ahead that the ray reaches first.
            let walls = self.1.walls(node);
            let ahead = map([0, 1, 2], |k: usize| {
                walls[k][1 - frame.negative[k] as usize % 2]
            });
            let moments = map([0, 1, 2], |k: usize| Moment::new(frame, k, ahead[k]));
            let mut axis = 0;
            if moments[1].about < moments[axis].about {
                axis = 1;
            }
            if moments[2].about < moments[axis].about {
                axis = 2;
            }
            let next = moments[axis];
            // Test the leaf's triangles up to that wall.
            counters.leaf(leaf.count);
            let leave = keep_min(next.high, frame.t_max);
            let ends = Job { scene, blocks }.test::<S, Q, C>(
                simd,
                leaf,
                RayRef { ray, frame },
                leave,
                &mut best,
                counters,
            );
            if ends || PUBLISHED && best.hit().is_hit() {
                return best.hit();
            }
            // A NaN bound fails this comparison and makes the step uncertain.
            let certain = (0..3).all(|k| k == axis || moments[k].low > next.high);
            if !PUBLISHED && !certain {
                // No wall ahead is crossed before the smallest lower bound: continue there.
                let low = moments.map(|moment| keep_max(moment.low, f32::NEG_INFINITY));
                from = keep_max(keep_min(low[0], keep_min(low[1], low[2])), from);
                let so_far = (&best, from);
                return self.rest::<S, Q, C>(
                    simd,
                    triangles,
                    RayRef { ray, frame },
                    so_far,
                    stack,
                    counters,
                );
            }
            // Follow the rope across the wall, until the ray ends or leaves the scene.
            from = next.low;
            link = self.1.links(node)[axis][1 - frame.negative[axis] as usize % 2];
            if from > best.reach || from > frame.t_max || link == OUTSIDE {
                return best.hit();
            }
            crossing = Crossing { axis, moment: next };
        }
    }
}

single_rays! {
    /// Single rays from leaf to leaf by links, with error bounds.
    fn rope(PlaneTree, ropes: Arc<Ropes>) -> Walk<'a, false> {
        |kernel| Walk(&kernel.tree, &kernel.ropes)
    }
}

single_rays! {
    /// The same as published, without error bounds.
    fn rope_published(PlaneTree, ropes: Arc<Ropes>) -> Walk<'a, true> {
        |kernel| Walk(&kernel.tree, &kernel.ropes)
    }
}
