// SPDX-License-Identifier: GPL-3.0-or-later
//! Children that wait on a stack while a ray goes on with a nearer one.
//!
//! A stack is a slice and the number of those on it that wait: walks use one stack for all their rays.

use super::bound::keep_min;

/// A child that waits.
pub trait Waits: Copy {
    /// Where the ray enters it.
    fn enter(&self) -> f32;
}

/// A child still to visit, and the interval of the ray inside it.
#[derive(Debug, Clone, Copy, Default)]
pub struct Pending<A = u32> {
    /// The child.
    pub node: A,
    /// Where the ray enters it.
    pub enter: f32,
    /// Where the ray leaves it.
    pub leave: f32,
}

impl<A: Copy> Waits for Pending<A> {
    #[inline(always)]
    fn enter(&self) -> f32 {
        self.enter
    }
}

impl<A> Pending<A> {
    /// The child, and what is left of its interval for a ray that goes no farther than `reach`.
    #[inline(always)]
    pub fn within(self, reach: f32) -> (A, f32, f32) {
        (self.node, self.enter, keep_min(reach, self.leave))
    }
}

/// Takes the last of those that wait which begins no farther away than `reach`, and drops what lies
/// on top of it.
#[inline(always)]
pub fn next<P: Waits>(stack: &[P], waiting: &mut usize, reach: f32) -> Option<P> {
    while *waiting != 0 {
        *waiting -= 1;
        let next = stack[*waiting];
        if next.enter() <= reach {
            return Some(next);
        }
    }
    None
}

/// The place for one more that is entered at `enter`, among those from `base` on, of which the nearest
/// is on top; those nearer than it move up.
#[inline(always)]
pub fn make_room<P: Waits>(stack: &mut [P], base: usize, waiting: &mut usize, enter: f32) -> usize {
    let mut at = *waiting;
    while at > base && stack[at - 1].enter() < enter {
        stack[at] = stack[at - 1];
        at -= 1;
    }
    *waiting += 1;
    at
}
