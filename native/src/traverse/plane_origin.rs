// SPDX-License-Identifier: GPL-3.0-or-later
//! What the walks have in common that call that child near which holds the ray's origin (Jansen 1986;
//! Arvo 1988; Sung and Shirley 1992; the TA-A of Havran et al. 1997).
//!
//! All of them rest on one fact: a plane behind the origin is not crossed, and the ray stays on the
//! origin's side of it. As published they fail where the origin lies in the plane: which child holds
//! it is then a matter of taste, and the wrong one loses hits. Here the origin counts as lying in
//! every plane that is not farther away than the error of a coordinate, and for those planes the
//! near child is the one that the ray leaves, as if it came from far behind its origin.

use super::bound::{keep_max, keep_min};
use super::frame::FrameRay;
use super::pending::{self, Pending};
use crate::build::plane_tree::MAX_DEPTH;

/// Children still to visit, the next one last.
pub type Stack = [Pending; MAX_DEPTH + 1];

/// A stack with nothing on it.
pub const STACK: Stack = [Pending {
    node: 0,
    enter: 0.0,
    leave: 0.0,
}; MAX_DEPTH + 1];

/// How near a plane must be, per axis, for the origin to count as lying in it.
#[inline(always)]
pub fn around(ray: &FrameRay) -> [f32; 3] {
    // What is met before the origin but rounds to it lies within the padding, unless directions are
    // extremely long; and rays may begin behind their origin. Those go by the direction alone.
    if ray.t_min < -1e-30 {
        [f32::INFINITY; 3]
    } else {
        ray.pad
    }
}

/// The two ends of the split in order, as far as they can be told apart: what is before the plane
/// ends at the second value, what is behind it begins at the first.
#[inline(always)]
pub fn ends(distance: f32, slack: f32) -> (f32, f32) {
    (distance - slack, distance + slack)
}

/// Goes on where both children are on the way: near first, far waits. Of the two an empty one is not
/// visited. NaN distances leave the interval as it is.
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

/// The next child to visit. As published every one is; the allowance for rounding is what `reach`
/// needs to tell that nothing in a child can be nearer than the best hit.
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

/// Goes on where both children are on the way, as published.
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
