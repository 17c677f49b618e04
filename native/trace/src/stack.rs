// SPDX-License-Identifier: GPL-3.0-or-later
//! Stacks of nodes still to visit while a ray continues in a nearer one.

use halfspace_geom::bound::keep_min;
use halfspace_ray::Interval;
use halfspace_ray::query::Query;

/// A stack entry with an entry distance.
pub trait Entry: Copy {
    /// Distance where the ray enters the node.
    fn enter(&self) -> f32;

    /// Copies the entry out of memory with the loads that match the stores of [`Stack::push`].
    #[inline(always)]
    fn read(&self) -> Self {
        *self
    }
}

/// A node still to visit, with the ray's interval in it.
#[derive(Debug, Clone, Copy)]
pub struct NodeEntry<A = u32> {
    /// The node.
    pub node: A,
    /// The ray's interval in the node.
    pub interval: Interval,
}

impl<A: Copy> Entry for NodeEntry<A> {
    #[inline(always)]
    fn enter(&self) -> f32 {
        self.interval.enter
    }

    /// Reads the fields one by one. A load of the whole entry takes bytes of two stores, for which the processor waits
    /// until both have reached the cache.
    #[inline(always)]
    fn read(&self) -> Self {
        let Interval { enter, leave } = self.interval;
        Self {
            node: self.node,
            interval: Interval { enter, leave },
        }
    }
}

impl<A> NodeEntry<A> {
    /// An entry that fills unused memory.
    #[inline(always)]
    pub const fn blank(node: A) -> Self {
        Self {
            node,
            interval: Interval {
                enter: 0.0,
                leave: 0.0,
            },
        }
    }

    /// The same with its interval cut at `reach`, the distance beyond which no hit is needed.
    #[inline(always)]
    pub fn within(self, reach: f32) -> Self {
        Self {
            interval: Interval::new(self.interval.enter, keep_min(reach, self.interval.leave)),
            ..self
        }
    }
}

/// A stack in memory that all rays of a thread use one after another.
pub struct Stack<'a, E> {
    entries: &'a mut [E],
    size: usize,
}

impl<'a, E: Copy> Stack<'a, E> {
    /// An empty stack in this memory.
    #[inline(always)]
    pub fn new(entries: &'a mut [E]) -> Self {
        Self { entries, size: 0 }
    }

    /// Number of entries.
    #[inline(always)]
    pub fn size(&self) -> usize {
        self.size
    }

    /// Adds an entry on top.
    #[inline(always)]
    pub fn push(&mut self, entry: E) {
        self.entries[self.size] = entry;
        self.size += 1;
    }

    /// Removes the entry on top and copies it; `None` if the stack is empty.
    #[inline(always)]
    pub fn pop(&mut self) -> Option<E> {
        self.pop_entry().copied()
    }

    /// Removes the entry on top; `None` if the stack is empty.
    #[inline(always)]
    pub fn pop_entry(&mut self) -> Option<&E> {
        self.size = self.size.checked_sub(1)?;
        Some(&self.entries[self.size])
    }
}

impl<E: Entry> Stack<'_, E> {
    /// Pops entries until one starts within `reach`; `None` if the stack runs empty.
    #[inline(always)]
    pub fn pop_within(&mut self, reach: f32) -> Option<E> {
        pop_within(self.entries, &mut self.size, reach)
    }

    /// Adds an entry among those from index `base` on, which are sorted with the nearest on top. Any-hit queries add it
    /// on top: sorting takes longer than what the order saves them.
    #[inline(always)]
    pub fn insert<Q: Query>(&mut self, base: usize, entry: E) {
        if Q::ANY {
            return self.push(entry);
        }
        let at = make_room(self.entries, base, &mut self.size, entry.enter());
        self.entries[at] = entry;
    }
}

/// [`Stack::pop_within`] for the first `size` of some entries.
#[inline(always)]
pub fn pop_within<E: Entry>(entries: &[E], size: &mut usize, reach: f32) -> Option<E> {
    while *size != 0 {
        *size -= 1;
        let next = &entries[*size];
        if next.enter() <= reach {
            return Some(next.read());
        }
    }
    None
}

/// Makes room for one more entry with entry distance `enter` and returns its index. Entries from `base` on are
/// sorted with the nearest on top; those nearer than the new one move up.
#[inline(always)]
pub fn make_room<E: Entry>(entries: &mut [E], base: usize, size: &mut usize, enter: f32) -> usize {
    let mut at = *size;
    while at > base && entries[at - 1].enter() < enter {
        entries[at] = entries[at - 1];
        at -= 1;
    }
    *size += 1;
    at
}
