// SPDX-License-Identifier: GPL-3.0-or-later
//! Steps shared by the traversals whose near child is the one that holds the ray's origin (Jansen 1986; Arvo
//! 1988; Sung and Shirley 1992; the TA-A of Havran et al. 1997).
//!
//! All of them rely on one fact: a plane behind the origin is not crossed, and the ray stays on the origin's
//! side of it. As published they fail if the origin lies in the plane, because it then belongs to both children
//! and the choice of the wrong one loses hits. Here the origin counts as lying in every plane within the error
//! of a coordinate, and for those planes the near child is the one that the ray leaves, as if it came from far
//! behind its origin.

use crate::pending::{self, Pending};
use halfspace_geom::bound::{keep_max, keep_min};
use halfspace_nodes::plane_tree::MAX_DEPTH;
use halfspace_ray::FrameRay;

/// The stack, at most one entry per level; the last entry is visited next.
pub type Stack = [Pending; MAX_DEPTH + 1];

/// An empty stack.
pub const STACK: Stack = [Pending {
    node: 0,
    enter: 0.0,
    leave: 0.0,
}; MAX_DEPTH + 1];

/// Per axis, the largest distance between plane and origin at which the origin counts as lying in the plane.
#[inline(always)]
pub fn around(ray: &FrameRay) -> [f32; 3] {
    // A hit before the origin that rounds to it lies within the padding, unless the direction is extremely
    // long. A ray may also start behind its origin: for such a ray the direction alone gives the near child.
    if ray.t_min < -1e-30 {
        [f32::INFINITY; 3]
    } else {
        ray.pad
    }
}

/// The interval of possible distances to the plane: the far child begins at the first value, the near child
/// ends at the second.
#[inline(always)]
pub fn ends(distance: f32, slack: f32) -> (f32, f32) {
    (distance - slack, distance + slack)
}

/// The child to visit next and its interval, if the ray meets both children: the near one, with the far one
/// pushed. An empty child is skipped. NaN distances leave the interval unchanged.
#[inline(always)]
pub fn both(
    (near, empty): (u32, u32),
    (low, high): (f32, f32),
    (enter, leave): (f32, f32),
    (stack, waiting): (&mut Stack, &mut usize),
) -> (u32, f32, f32) {
    let far = Pending {
        node: near ^ 1,
        enter: keep_max(low, enter),
        leave,
    };
    if empty >> (near & 1) & 1 == 1 {
        return (far.node, far.enter, far.leave);
    }
    if empty == 0 {
        stack[*waiting] = far;
        *waiting += 1;
    }
    (near, enter, keep_min(high, leave))
}

/// Pops the next node to visit and its interval. As published every entry is visited; with error bounds,
/// entries that start beyond `reach` are dropped, since nothing in them can precede the best hit.
#[inline(always)]
pub fn next<const PUBLISHED: bool>(
    stack: &Stack,
    waiting: &mut usize,
    reach: f32,
) -> Option<(u32, f32, f32)> {
    if PUBLISHED {
        *waiting = waiting.checked_sub(1)?;
        let next = stack[*waiting];
        return Some((next.node, next.enter, next.leave));
    }
    pending::next(stack, waiting, reach).map(|next| next.within(reach))
}

/// The step of [`both`] as published, without error bounds: the two intervals meet at `distance`.
#[inline(always)]
pub fn both_published(
    near: u32,
    distance: f32,
    (enter, leave): (f32, f32),
    (stack, waiting): (&mut Stack, &mut usize),
) -> (u32, f32, f32) {
    stack[*waiting] = Pending {
        node: near ^ 1,
        enter: distance,
        leave,
    };
    *waiting += 1;
    (near, enter, distance)
}
