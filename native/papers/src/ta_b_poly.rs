// SPDX-License-Identifier: GPL-3.0-or-later
//! TA-B extended to planes of any direction: the ray's entry and exit *points* in the current cell are kept,
//! and their heights above a plane decide which children are visited. A decision takes two dot products, where
//! distances take two dot products, a division and a comparison with the direction. A division is needed only
//! if both children are visited; the crossing then follows from the two heights by linear interpolation.
//!
//! The height of a point of the scene is off by less than the frame's `oblique_pad`: the coordinates of a point
//! `o + t d` by at most `u (|o| + 2 |p|)`, the product with a normal by `3 u |p|`, the difference by `2 u |p|`
//! more, each times `sqrt(3)`, which is less than half of that pad; if the coordinates are inexact from the
//! start, the pad includes that. The true height is linear between entry and exit, so a child is skipped only
//! if both ends are certainly on the other side. If both are visited, their intervals overlap by the shift that
//! [`PADS`] pads may cause in the crossing.

use fearless_simd::Simd;
use halfspace_geom::bound::{keep_max, keep_min};
use halfspace_geom::vec3::map;
use halfspace_leaf::{Job, Leaf};
use halfspace_nodes::plane_tree::{MAX_DEPTH, Node, PlaneTree};
use halfspace_ray::query::{Best, Counters, NoCount, Query};
use halfspace_ray::{FrameRay, RayRef};
use halfspace_single::single_rays;
use halfspace_trace::batch::SingleTraversal;
use halfspace_trace::stack::{Entry, Stack};

/// Number of pads by which the heights of both ends are moved for the crossing. Derived: one each for the
/// errors of the two heights, and two for the roundings of the quotient, of the interval's length and of the
/// result. The latter are at most 11 u times the frame ray's span, while a pad moves a crossing by 28 u of it
/// divided by the speed towards the plane, which is less than `2 sqrt(3)`.
const PADS: f32 = 4.0;

/// Rays with spans below this cannot overflow in `o + t d` and its products; derived from the range of f32.
const FAR: f32 = 1e36;

/// The segment of the ray in a cell: its end points and its interval.
#[derive(Clone, Copy, Default)]
struct Segment {
    entry: [f32; 3],
    exit: [f32; 3],
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

/// A plane as a segment meets it.
struct Heights {
    /// Heights of entry and exit above the plane.
    entry: f32,
    exit: f32,
    /// Error bound of both.
    pad: f32,
    /// Number of the child below; the one above is the next node.
    children: u32,
    /// Bits of the empty children.
    empty: u32,
}

/// The traversal of one tree.
pub struct HeightTraversal<'a>(pub &'a PlaneTree);

impl SingleTraversal for HeightTraversal<'_> {
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
        let mut node = tree.root();
        let mut segment = Segment {
            entry: point(frame, frame.t_min),
            exit: point(frame, frame.t_max),
            enter: frame.t_min,
            leave: frame.t_max,
        };
        // If a coordinate along the ray may overflow, infinite pads make every height uncertain.
        let wild = if frame.span < FAR { 0.0 } else { f32::INFINITY };
        let pads = map(frame.pad, |pad| pad + wild);
        let oblique_pad = frame.oblique_pad + wild;
        loop {
            // Compute the heights of both ends above the node's plane, or test the leaf.
            let plane = match tree.node(node) {
                Node::Axis {
                    axis,
                    split,
                    children,
                    empty,
                    ..
                } => {
                    counters.step_axis();
                    Heights {
                        entry: along(segment.entry, axis) - split,
                        exit: along(segment.exit, axis) - split,
                        pad: pads[axis],
                        children,
                        empty,
                    }
                }
                Node::Oblique {
                    normal,
                    offset,
                    children,
                    empty,
                } => {
                    counters.step_oblique();
                    let height = |p: [f32; 3]| {
                        normal[0] * p[0] + normal[1] * p[1] + normal[2] * p[2] - offset
                    };
                    Heights {
                        entry: height(segment.entry),
                        exit: height(segment.exit),
                        pad: oblique_pad,
                        children,
                        empty,
                    }
                }
                Node::Leaf { first, count } => {
                    counters.leaf(count);
                    let (leaf, leave) = (Leaf { first, count }, segment.leave);
                    if job.test::<S, Q, C>(simd, leaf, ray, leave, &mut best, counters) {
                        return best;
                    }
                    match stack.pop_within(best.reach) {
                        Some(entry) => SegmentEntry { node, segment } = entry,
                        None => return best,
                    }
                    continue;
                }
            };
            node = step(&plane, frame, &mut segment, &mut stack);
        }
    }
}

/// Returns the child to visit next and cuts the segment to the part in it; pushes the other child if both are visited.
#[inline(always)]
fn step(
    plane: &Heights,
    frame: &FrameRay,
    segment: &mut Segment,
    stack: &mut Stack<'_, SegmentEntry>,
) -> u32 {
    let &Heights {
        entry,
        exit,
        pad,
        children,
        empty,
    } = plane;
    if entry < -pad && exit < -pad {
        return children;
    }
    if entry > pad && exit > pad {
        return children + 1;
    }
    // Choose the near child by the sign of the change in height. If the heights are equal the sign is
    // arbitrary, and the crossing below infinite or NaN: both children get the whole interval.
    let near = children + u32::from(exit < entry);
    let from = if exit < entry { entry } else { -entry };
    // Interpolate the crossing, moved outwards by the error of the heights. The absolute value keeps a
    // difference of -0.0 from exchanging the two bounds.
    let way = (exit - entry).abs();
    let per_height = (segment.leave - segment.enter) / way;
    let early = segment.enter + (from - PADS * pad) * per_height;
    let late = segment.enter + (from + PADS * pad) * per_height;
    // Ignore bounds that are NaN.
    let enter = keep_max(early, segment.enter);
    let leave = keep_min(late, segment.leave);
    let far = Segment {
        entry: point(frame, enter),
        enter,
        ..*segment
    };
    if empty >> (near & 1) & 1 == 1 {
        *segment = far;
        return near ^ 1;
    }
    if empty == 0 {
        stack.push(SegmentEntry {
            node: near ^ 1,
            segment: far,
        });
    }
    segment.exit = point(frame, leave);
    segment.leave = leave;
    near
}

/// A coordinate of a point, selected without an index, which would force the segment into memory.
#[inline(always)]
fn along([x, y, z]: [f32; 3], axis: usize) -> f32 {
    match axis {
        0 => x,
        1 => y,
        _ => z,
    }
}

/// The ray's point at `t`.
#[inline(always)]
fn point(frame: &FrameRay, t: f32) -> [f32; 3] {
    [
        frame.o[0] + t * frame.d[0],
        frame.o[1] + t * frame.d[1],
        frame.o[2] + t * frame.d[2],
    ]
}

single_rays! {
    /// Single rays by the heights of entry and exit points over planes of any direction.
    fn ta_b_poly(PlaneTree) -> HeightTraversal<'a> {
        |kernel| HeightTraversal(&kernel.tree)
    }
}
