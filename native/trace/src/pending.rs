// SPDX-License-Identifier: GPL-3.0-or-later
//! Stack entries: nodes still to visit while a ray continues in a nearer one.
//!
//! A stack is a slice and the number of its entries in use; one slice serves all rays of a thread.

use halfspace_geom::bound::keep_min;

/// A stack entry with an entry distance.
pub trait Waits: Copy {
    /// Distance where the ray enters the node.
    fn enter(&self) -> f32;
}

/// A node still to visit, with the ray's interval in it.
#[derive(Debug, Clone, Copy, Default)]
pub struct Pending<A = u32> {
    /// The node.
    pub node: A,
    /// Distance where the ray enters the node.
    pub enter: f32,
    /// Distance where the ray leaves the node.
    pub leave: f32,
}

impl<A: Copy> Waits for Pending<A> {
    #[inline(always)]
    fn enter(&self) -> f32 {
        self.enter
    }
}

impl<A> Pending<A> {
    /// The node, and its interval cut at `reach`, the distance beyond which no hit is needed.
    #[inline(always)]
    pub fn within(self, reach: f32) -> (A, f32, f32) {
        (self.node, self.enter, keep_min(reach, self.leave))
    }
}

/// Pops entries until one starts within `reach`; `None` if the stack runs empty.
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

/// Makes room for one more entry with entry distance `enter` and returns its index. Entries from `base` on are
/// sorted with the nearest on top; those nearer than the new one move up.
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
