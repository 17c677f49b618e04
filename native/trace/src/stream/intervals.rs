// SPDX-License-Identifier: GPL-3.0-or-later
//! Lists whose entries have the ray's interval in the node, for nodes that cut intervals: eight rays at a time, one to
//! a lane.

use crate::stream::lists::{Entry, Stream, small};
use crate::stream::ray_state::{FAR, INV, NEAR, REACH, RayState};
use fearless_simd::{
    Simd, SimdBase, SimdCombine, SimdFloat, SimdMask, f32x4, f32x8, mask32x8, u32x8,
};
use halfspace_geom::bound::{keep_max, keep_max_each, keep_min, keep_min_each};

/// Number of rays of a list that are cut at once.
pub const LANES: usize = 8;

/// Lists of at most this many rays are cut ray by ray at a single plane.
const FEW: u32 = 3;

/// A slab between two planes across an axis, or one plane where both are equal: the near child of a node ends at the
/// one, and the far child begins at the other.
#[derive(Clone, Copy)]
pub struct Gap {
    pub axis: usize,
    pub ends: f32,
    pub begins: f32,
}

/// The intervals of eight rays in a region.
#[derive(Clone, Copy)]
pub struct Inside<S: Simd> {
    pub enter: f32x8<S>,
    pub leave: f32x8<S>,
}

/// Up to eight rays of a list. The lanes beyond its end hold any rays, whose results are ignored.
pub struct Group<'a, S: Simd> {
    simd: S,
    states: &'a [RayState],
    rays: [u32; LANES],
    /// The intervals in the node, as they were when its parent was visited.
    pub inside: Inside<S>,
}

impl<S: Simd> Group<'_, S> {
    /// The rows of an axis of all rays ([`crate::stream::ray_state::Line::axes`]), one vector per column.
    #[inline(always)]
    pub fn axis(&self, axis: usize) -> [f32x8<S>; 4] {
        self.columns(
            #[inline(always)]
            |state| &state.line.axes[axis],
        )
    }

    /// The origins of all rays, and the error bounds of their heights over oblique planes.
    #[inline(always)]
    pub fn origins(&self) -> [f32x8<S>; 4] {
        self.columns(
            #[inline(always)]
            |state| &state.origin,
        )
    }

    /// The directions of all rays; the fourth vector is zero.
    #[inline(always)]
    pub fn directions(&self) -> [f32x8<S>; 4] {
        self.columns(
            #[inline(always)]
            |state| &state.direction,
        )
    }

    /// The reach of each ray.
    #[inline(always)]
    pub fn reach(&self) -> f32x8<S> {
        self.axis(0)[REACH]
    }

    /// The intervals, cut at each ray's best hit; `rows` are those of any axis.
    #[inline(always)]
    pub fn within(&self, rows: &[f32x8<S>; 4]) -> Inside<S> {
        Inside {
            enter: self.inside.enter,
            leave: keep_min_each(self.inside.leave, rows[REACH]),
        }
    }

    /// Transposes a row of four numbers of each ray.
    #[inline(always)]
    fn columns(&self, row: impl Fn(&RayState) -> &[f32; 4]) -> [f32x8<S>; 4] {
        let quad = |i: usize| {
            let state = &self.states[self.rays[i] as usize];
            f32x4::from_slice(self.simd, row(state))
        };
        let low = transpose([quad(0), quad(1), quad(2), quad(3)]);
        let high = transpose([quad(4), quad(5), quad(6), quad(7)]);
        [
            low[0].combine(high[0]),
            low[1].combine(high[1]),
            low[2].combine(high[2]),
            low[3].combine(high[3]),
        ]
    }
}

/// The columns of a matrix of four rows.
#[inline(always)]
fn transpose<S: Simd>([a, b, c, d]: [f32x4<S>; 4]) -> [f32x4<S>; 4] {
    let (even, odd) = ((a.zip_low(c), a.zip_high(c)), (b.zip_low(d), b.zip_high(d)));
    [
        even.0.zip_low(odd.0),
        even.0.zip_high(odd.0),
        even.1.zip_low(odd.1),
        even.1.zip_high(odd.1),
    ]
}

impl<P: Copy> Stream<P> {
    /// Distributes a list over the children of a node: `cut` computes the intervals of eight rays in each child, empty
    /// ones where a ray misses it. Pushes the children that some ray meets and that exist, in this order.
    #[inline(always)]
    pub fn distribute<S: Simd, const N: usize>(
        &mut self,
        simd: S,
        own: Entry<P>,
        states: &[RayState],
        children: [Option<P>; N],
        mut cut: impl FnMut(&Group<'_, S>) -> [Inside<S>; N],
    ) {
        let (first, rays) = (own.first as usize, own.rays as usize);
        // Give each child room for all rays. The first child's list replaces the parent's, whose entries are loaded
        // before they are overwritten.
        let room = rays.next_multiple_of(LANES);
        self.make_room(first + N * room, true);
        let mut counts = [0; N];
        for from in (0..rays).step_by(LANES) {
            let at = first + from..first + from + LANES;
            let indices = u32x8::from_slice(simd, &self.lists[at.clone()]);
            let group = Group {
                simd,
                states,
                rays: self.lists[at.clone()].try_into().expect("eight"),
                inside: Inside {
                    enter: f32x8::from_slice(simd, &self.enter[at.clone()]),
                    leave: f32x8::from_slice(simd, &self.leave[at]),
                },
            };
            let valid = u64::MAX >> (64 - (rays - from).min(LANES));
            // Append the rays that meet a child to its list.
            let parts = cut(&group);
            for (child, part) in parts.iter().enumerate() {
                let lanes = part.enter.simd_le(part.leave).to_bitmask() & valid;
                let live = mask32x8::from_bitmask(simd, lanes);
                let to = first + child * room + counts[child];
                let to = to..to + LANES;
                (indices.compress(live)).store_slice(&mut self.lists[to.clone()]);
                (part.enter.compress(live)).store_slice(&mut self.enter[to.clone()]);
                (part.leave.compress(live)).store_slice(&mut self.leave[to]);
                counts[child] += lanes.count_ones() as usize;
            }
        }
        for (child, node) in children.into_iter().enumerate() {
            let begins = first + child * room;
            self.push_list(node, own.node, begins..begins + counts[child]);
        }
    }

    /// Distributes a list over the two children of a node that a plane, or two parallel ones, separate. `children`: the
    /// far and the near one.
    #[inline(always)]
    pub fn halve<S: Simd>(
        &mut self,
        simd: S,
        own: Entry<P>,
        states: &[RayState],
        children: [Option<P>; 2],
        gap: Gap,
    ) {
        if own.rays <= FEW {
            self.halve_few(own, states, children, gap);
            return;
        }
        self.distribute(
            simd,
            own,
            states,
            children,
            #[inline(always)]
            |group| {
                let rows = group.axis(gap.axis % 3);
                let Inside { enter, leave } = group.within(&rows);
                // A plane at infinity, or a distance that is NaN, cuts off nothing.
                let [begins, ends] = [gap.begins, gap.ends].map(|plane| f32x8::splat(simd, plane));
                let soon = keep_max_each(begins.mul_add(rows[INV], rows[NEAR]), enter);
                let late = keep_min_each(ends.mul_add(rows[INV], rows[FAR]), leave);
                [Inside { enter: soon, leave }, Inside { enter, leave: late }]
            },
        );
    }

    /// [`Self::halve`] for few rays, one after another: eight lanes would be mostly unused.
    #[inline(always)]
    fn halve_few(
        &mut self,
        own: Entry<P>,
        states: &[RayState],
        [far, near]: [Option<P>; 2],
        gap: Gap,
    ) {
        let (first, rays) = (own.first as usize, own.rays as usize);
        // The list of the far child replaces the parent's, that of the near one follows.
        let other = first + rays;
        self.make_room(other + rays, true);
        let (mut behind, mut before) = (first, other);
        for at in first..other {
            let ray = self.lists[at];
            let axis = &states[ray as usize].line.axes[gap.axis % 3];
            let (enter, leave) = (self.enter[at], keep_min(self.leave[at], axis[REACH]));
            let soon = keep_max(gap.begins * axis[INV] + axis[NEAR], enter);
            let late = keep_min(gap.ends * axis[INV] + axis[FAR], leave);
            // Append without a branch: an entry that is not counted is overwritten.
            (self.lists[behind], self.enter[behind], self.leave[behind]) = (ray, soon, leave);
            behind += usize::from(soon <= leave);
            (self.lists[before], self.enter[before], self.leave[before]) = (ray, enter, late);
            before += usize::from(enter <= late);
        }
        self.push_list(far, own.node, first..behind);
        self.push_list(near, own.node, other..before);
    }

    /// Pushes a child with its list, unless the list is empty or the child is missing; `any` is any node.
    #[inline(always)]
    fn push_list(&mut self, child: Option<P>, any: P, list: std::ops::Range<usize>) {
        let entry = Entry {
            node: child.unwrap_or(any),
            first: small(list.start),
            rays: small(list.len()),
        };
        self.push(entry, child.is_some() && !list.is_empty());
    }
}
