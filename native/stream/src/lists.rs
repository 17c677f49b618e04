// SPDX-License-Identifier: GPL-3.0-or-later
//! The lists of rays of a stream, and its stack of nodes to visit.

use crate::ray_state::Line;

/// Number of lanes that vectors read and write beyond the end of a list.
pub const ROOM: usize = 16;

/// Reciprocal of the share of rays that must have ended for lists to be shortened (estimated from the two costs).
const SHARE: usize = 8;

/// A stack entry: a node or a leaf, to be visited by the rays that meet it.
#[derive(Clone, Copy)]
pub struct Entry<P> {
    /// The node or leaf.
    pub node: P,
    /// Start of its list of rays.
    pub first: u32,
    /// Length of the list.
    pub rays: u32,
}

/// The rays of one octant of directions, and their traversal.
pub struct Stream<P> {
    /// The octant: bit `k` is set for rays that descend along axis `k`.
    pub octant: usize,
    /// Number of rays at the root.
    rays: usize,
    /// Indices of rays: first the list of the root, then those of the stack entries, the next one last. Vectors
    /// read and write beyond the end of the lists in use.
    pub lists: Vec<u32>,
    /// For each entry of the lists the distances at which the ray enters and leaves the node; empty for trees
    /// whose lists have no intervals.
    pub enter: Vec<f32>,
    pub leave: Vec<f32>,
    /// The stack, the next entry last; entries from `size` on are unused.
    entries: Vec<Entry<P>>,
    size: usize,
}

impl<P: Copy> Stream<P> {
    /// A stream without rays.
    pub fn new(octant: usize) -> Self {
        Self {
            octant,
            rays: 0,
            lists: Vec::new(),
            enter: Vec::new(),
            leave: Vec::new(),
            entries: Vec::new(),
            size: 0,
        }
    }

    /// Adds a ray. `intervals`: whether the lists have intervals.
    #[inline(always)]
    pub fn put(&mut self, ray: usize, line: &Line, intervals: bool) {
        self.make_room(self.rays + 1, intervals);
        self.lists[self.rays] = small(ray);
        if intervals {
            self.enter[self.rays] = line.start;
            self.leave[self.rays] = line.reach();
        }
        self.rays += 1;
    }

    /// Makes room for lists that end before `end`, and for vectors beyond the last.
    #[inline(always)]
    pub fn make_room(&mut self, end: usize, intervals: bool) {
        if self.lists.len() < end + ROOM {
            self.grow(2 * (end + ROOM), intervals);
        }
    }

    #[cold]
    fn grow(&mut self, length: usize, intervals: bool) {
        self.lists.resize(length, 0);
        if intervals {
            self.enter.resize(length, 0.0);
            self.leave.resize(length, 0.0);
        }
    }

    /// Pushes the root, if there are rays; returns whether there are.
    pub fn begin(&mut self, root: P) -> bool {
        let rays = small(std::mem::take(&mut self.rays));
        let root = Entry {
            node: root,
            first: 0,
            rays,
        };
        self.push(root, rays > 0);
        rays > 0
    }

    /// Removes all indices of rays from the lists, for a batch that may have fewer rays.
    pub fn forget(&mut self) {
        self.lists.fill(0);
    }

    /// Pushes a stack entry if `live`, without a branch.
    #[inline(always)]
    pub fn push(&mut self, entry: Entry<P>, live: bool) {
        if self.size == self.entries.len() {
            self.entries.resize(2 * self.size + ROOM, entry);
        }
        self.entries[self.size] = entry;
        self.size += usize::from(live);
    }

    /// Pops the next stack entry.
    #[inline(always)]
    pub fn pop(&mut self) -> Option<Entry<P>> {
        self.size = self.size.checked_sub(1)?;
        Some(self.entries[self.size])
    }

    /// Removes the rays that have ended from the list of an entry that was popped.
    #[inline(always)]
    pub fn drop_ended(&mut self, own: &mut Entry<P>, ended: &Ended, intervals: bool) {
        let (first, end) = (own.first as usize, (own.first + own.rays) as usize);
        let mut to = first;
        for at in first..end {
            let ray = self.lists[at];
            self.lists[to] = ray;
            if intervals {
                self.enter[to] = self.enter[at];
                self.leave[to] = self.leave[at];
            }
            to += usize::from(!ended.contains(ray as usize));
        }
        own.rays = small(to - first);
    }

    /// The stack, the next entry last.
    #[inline(always)]
    pub fn stack(&self) -> &[Entry<P>] {
        &self.entries[..self.size]
    }

    /// The list of a stack entry.
    #[inline(always)]
    pub fn list(&self, own: &Entry<P>) -> &[u32] {
        &self.lists[own.first as usize..(own.first + own.rays) as usize]
    }

    /// The distances at which the rays of a list enter and leave its node, if lists have intervals.
    #[inline(always)]
    pub fn intervals(&self, own: &Entry<P>) -> (&[f32], &[f32]) {
        let range = own.first as usize..(own.first + own.rays) as usize;
        (&self.enter[range.clone()], &self.leave[range])
    }
}

/// The any-hit rays of a part that have ended.
#[derive(Default)]
pub struct Ended {
    /// One bit per ray.
    flags: Vec<u64>,
    /// Their number, and that of all rays of the part.
    count: usize,
    rays: usize,
}

impl Ended {
    /// Forgets all, for a part of this number of rays.
    pub fn clear(&mut self, rays: usize) {
        self.flags.clear();
        self.flags.resize(rays.div_ceil(64), 0);
        (self.count, self.rays) = (0, rays);
    }

    /// Adds a ray.
    #[inline(always)]
    pub fn add(&mut self, ray: usize) {
        self.flags[ray / 64] |= 1 << (ray % 64);
        self.count += 1;
    }

    /// Whether enough rays have ended that lists are shortened before their nodes are visited. A look at each ray of a
    /// list costs a few cycles; a ray that has ended costs its node a test of eight boxes.
    #[inline(always)]
    pub fn is_worth_dropping(&self) -> bool {
        SHARE * self.count > self.rays
    }

    /// Whether a ray has ended.
    #[inline(always)]
    fn contains(&self, ray: usize) -> bool {
        self.flags[ray / 64] >> (ray % 64) & 1 == 1
    }
}

/// Narrows an index of a ray or a position in lists. Both fit: each level of a tree adds at most eight entries
/// for each of 8192 rays.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "see above")]
pub fn small(x: usize) -> u32 {
    x as u32
}
