// SPDX-License-Identifier: GPL-3.0-or-later
//! Axis-aligned trees walked from leaf to leaf along ropes (MacDonald and Booth 1990; Havran, Bittner and
//! Žára 1998), without a stack and without the root.
//!
//! In a leaf the ray leaves by the wall that it comes to first; the rope there leads to what lies behind, and the
//! moment of leaving tells in which part of that. As published, with the point of leaving for that
//! moment, rounding may lead the walk past a leaf that the ray only just enters, near an edge. Here
//! each decision is taken only when it is certain: when the ray comes to all other walls, and to each plane behind
//! the wall, certainly later, or has certainly crossed it. Then the walk is in the one leaf that
//! the ray is in. Where a decision is not certain, the rest of the ray goes from the root, by distances
//! ([`super::plane_dir`]), from the last moment that was. That is rare but for rays along walls.
//!
//! Each rope leads across a wall in the ray's direction, and cells on one side of a plane all come before
//! those on the other: no leaf comes twice, and the walk ends.

use super::batch;
use super::blocks::Blocks;
use super::bound::{keep_max, keep_min};
use super::frame::FrameRay;
use super::plane_dir;
use super::query::{Best, Counters, Query};
use super::ray::{Hit, Ray};
use crate::build::plane_tree::PlaneTree;
use crate::build::ropes::{OUTSIDE, Ropes, Step};
use crate::geom::vec3::map;
use crate::scene::Triangles;
use fearless_simd::Simd;

/// The walk over one tree, as published or with certain steps only.
///
/// # Panics
/// On a tree with oblique planes; the registry offers this walk for axis-aligned trees only.
pub struct Walk<'a, const PUBLISHED: bool>(pub &'a PlaneTree, pub &'a Ropes);

/// When a ray comes to a plane: about, not sooner, not later.
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

/// The way from one leaf to the next.
#[derive(Clone, Copy)]
struct Crossing {
    /// The wall's axis; none at the start.
    axis: usize,
    moment: Moment,
}

/// No wall.
const START: usize = 3;

impl<const PUBLISHED: bool> Walk<'_, PUBLISHED> {
    /// The leaf below a link that the ray is in when it crosses a wall, and where that leaf's triangles are;
    /// `None` when that is not certain.
    #[inline(always)]
    fn leaf<C: Counters>(
        &self,
        frame: &FrameRay,
        mut link: u32,
        crossing: Crossing,
        counters: &mut C,
    ) -> Option<(u32, (u32, usize))> {
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
                Step::Leaf { first, count } => return Some((link, (first, count))),
            };
            counters.step_axis();
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

    /// Walks the rest of a ray from the root.
    #[inline(always)]
    fn rest<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        triangles: (&Triangles, &Blocks),
        (ray, frame): (&Ray, &FrameRay),
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
        batch::Walk::cast::<S, Q, C>(&walk, simd, triangles, (ray, &rest), stack, counters)
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
        (scene, blocks): (&Triangles, &Blocks),
        (ray, frame): (&Ray, &FrameRay),
        stack: &mut Self::Scratch,
        counters: &mut C,
    ) -> Hit {
        let triangles = (scene, blocks);
        let mut best = Best::new(frame);
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
                    (ray, frame),
                    so_far,
                    stack,
                    counters,
                );
            };
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
            counters.leaf(leaf.1);
            let leave = keep_min(next.high, frame.t_max);
            let ends =
                blocks.test::<S, Q, C>(simd, leaf, scene, (ray, frame, leave), &mut best, counters);
            if ends || PUBLISHED && best.hit().is_hit() {
                return best.hit();
            }
            // What is not a number is not certain.
            let certain = (0..3).all(|k| k == axis || moments[k].low > next.high);
            if !PUBLISHED && !certain {
                let low = moments.map(|moment| keep_max(moment.low, f32::NEG_INFINITY));
                from = keep_max(keep_min(low[0], keep_min(low[1], low[2])), from);
                let so_far = (&best, from);
                return self.rest::<S, Q, C>(
                    simd,
                    triangles,
                    (ray, frame),
                    so_far,
                    stack,
                    counters,
                );
            }
            from = next.low;
            link = self.1.links(node)[axis][1 - frame.negative[axis] as usize % 2];
            if from > best.reach || from > frame.t_max || link == OUTSIDE {
                return best.hit();
            }
            crossing = Crossing { axis, moment: next };
        }
    }
}
