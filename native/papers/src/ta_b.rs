// SPDX-License-Identifier: GPL-3.0-or-later
//! The recursive ray traversal TA-B of Havran, Kopal, Bittner and Žára 1997, for axis-aligned trees.
//!
//! TA-B keeps the entry and exit *points* of the ray in the current cell instead of distances. Comparing one
//! coordinate of each with the split plane distinguishes all cases in two comparisons; a distance is computed
//! only if both children are visited.
//!
//! This form mirrors every axis along which the ray descends, so that the entry always has the smaller
//! coordinate, and moves the two points apart by the error of a coordinate. A child is thus skipped only if the
//! ray certainly does not enter it, still by two comparisons.
//!
//! For rays of the scene itself the distances alone would suffice: they are moved by the slack of the crossed
//! plane, which exceeds the error of every coordinate of the point. For rays in an instance's space it does
//! not, because their coordinates are inexact from the start.

use fearless_simd::Simd;
use halfspace_geom::bound::{keep_max, keep_min};
use halfspace_leaf::{Job, Leaf};
use halfspace_nodes::axis_tree::{AxisNode, AxisTree, SharedAxisTree};
use halfspace_nodes::plane_tree::{MAX_DEPTH, near_child};
use halfspace_ray::cases::{Turn, case};
use halfspace_ray::query::{Best, Counters, NoCount, Query};
use halfspace_ray::{FrameRay, RayRef};
use halfspace_single::single_rays;
use halfspace_trace::batch::SingleTraversal;
use halfspace_trace::stack::{Entry, Stack};

/// A segment of the ray: its interval, and its end points in mirrored coordinates, all moved outwards. The
/// fourth coordinate only fills the vector register.
#[derive(Clone, Copy, Default)]
struct Segment {
    entry: [f32; 4],
    exit: [f32; 4],
    enter: f32,
    leave: f32,
}

/// A stack entry: a node still to visit, and the segment of the ray in it.
#[derive(Clone, Copy, Default)]
pub struct SegmentEntry {
    node: u32,
    segment: Segment,
}

impl Entry for SegmentEntry {
    #[inline(always)]
    fn enter(&self) -> f32 {
        self.segment.enter
    }
}

/// The ray in mirrored coordinates, in which all its speeds are positive.
struct Mirrored {
    /// Absolute direction components.
    speed: [f32; 4],
    /// Mirrored origin minus its error bound.
    before: [f32; 4],
    /// Mirrored origin plus its error bound.
    after: [f32; 4],
    /// The sign bits of the mirrored axes.
    flip: [u32; 3],
}

impl Mirrored {
    /// Mirrors a ray.
    #[inline(always)]
    fn new(ray: &FrameRay) -> Self {
        let mut out = Self {
            speed: [0.0; 4],
            before: [0.0; 4],
            after: [0.0; 4],
            flip: [0; 3],
        };
        for k in 0..3 {
            out.flip[k] = ray.negative[k] << 31;
            let origin = f32::from_bits(ray.o[k].to_bits() ^ out.flip[k]);
            out.speed[k] = ray.d[k].abs();
            out.before[k] = origin - ray.pad[k];
            out.after[k] = origin + ray.pad[k];
        }
        out
    }

    /// The entry point of a segment that begins at `t`. It increases with `t`, rounding included.
    #[inline(always)]
    fn entry(&self, t: f32) -> [f32; 4] {
        let at = |k: usize| self.before[k] + t * self.speed[k];
        [at(0), at(1), at(2), at(3)]
    }

    /// The exit point of a segment that ends at `t`.
    #[inline(always)]
    fn exit(&self, t: f32) -> [f32; 4] {
        let at = |k: usize| self.after[k] + t * self.speed[k];
        [at(0), at(1), at(2), at(3)]
    }

    /// Cuts a segment at a plane at some distance to the part before the plane, and returns the part behind it. The
    /// crossing is moved outwards by `slack` for both.
    #[inline(always)]
    fn cut(&self, segment: &mut Segment, distance: f32, slack: f32) -> Segment {
        let enter = keep_max(distance - slack, segment.enter);
        let leave = keep_min(distance + slack, segment.leave);
        let behind = Segment {
            entry: self.entry(enter),
            enter,
            ..*segment
        };
        segment.exit = self.exit(leave);
        segment.leave = leave;
        behind
    }
}

/// The traversal of one tree.
pub struct TaBTraversal<'a>(pub AxisTree<'a>);

impl SingleTraversal for TaBTraversal<'_> {
    type Scratch = [SegmentEntry; MAX_DEPTH + 1];
    type Uncounted = NoCount;

    fn scratch(&self) -> Self::Scratch {
        [SegmentEntry::default(); MAX_DEPTH + 1]
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
        let mut best = Best::new(frame);
        let mut stack = Stack::new(scratch);
        let mirrored = Mirrored::new(frame);
        // Begin with the part of the ray inside the scene's box.
        let mut node = tree.root();
        let mut segment = Segment {
            entry: mirrored.entry(frame.t_min),
            exit: mirrored.exit(frame.t_max),
            enter: frame.t_min,
            leave: frame.t_max,
        };
        loop {
            match tree.node(node) {
                AxisNode::Axis {
                    axis,
                    split,
                    empty,
                    link,
                    ..
                } => {
                    counters.step_axis();
                    let near = near_child(link, frame.signs);
                    // Compare entry and exit with the mirrored plane.
                    let height = f32::from_bits(split.to_bits() ^ mirrored.flip[axis]);
                    // The case of visiting the near (0) or far (1) child only, for the counters.
                    let turn = |far: u32| match frame.negative[axis] ^ far {
                        0 => Turn::Below,
                        _ => Turn::Above,
                    };
                    let which = |turn| case(frame.o[axis], frame.d[axis], split, turn);
                    if segment.exit[axis] < height {
                        counters.case(|| which(turn(0)));
                        node = near; // N1 N2 N3 P5 and their mirror images: the plane is not reached
                    } else if segment.entry[axis] > height {
                        counters.case(|| which(turn(1)));
                        node = near ^ 1; // P1 P2 P3 N5: the plane is behind
                    } else {
                        // N4 P4, and every Z case: visit both, the far child later; skip an empty one.
                        counters.case(|| which(Turn::Both));
                        let distance = (split - frame.o[axis]) * frame.inv[axis];
                        let behind = mirrored.cut(&mut segment, distance, frame.slack[axis]);
                        if (empty >> (near & 1)) & 1 == 1 {
                            (node, segment) = (near ^ 1, behind);
                        } else {
                            if empty == 0 {
                                stack.push(SegmentEntry {
                                    node: near ^ 1,
                                    segment: behind,
                                });
                            }
                            node = near;
                        }
                    }
                    continue;
                }
                AxisNode::Leaf { first, count } => {
                    counters.leaf(count);
                    let (leaf, leave) = (Leaf { first, count }, segment.leave);
                    if job.test::<S, Q, C>(simd, leaf, ray, leave, &mut best, counters) {
                        return best;
                    }
                }
            }
            match stack.pop_within(best.reach) {
                Some(entry) => (node, segment) = (entry.node, entry.segment),
                None => return best,
            }
        }
    }
}

single_rays! {
    /// Single rays by TA-B, with error bounds.
    fn ta_b(SharedAxisTree) -> TaBTraversal<'a> {
        |kernel| TaBTraversal(kernel.tree.borrowed())
    }
}
