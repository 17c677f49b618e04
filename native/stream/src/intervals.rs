// SPDX-License-Identifier: GPL-3.0-or-later
//! Lists whose entries have the ray's interval in the node, for nodes that cut intervals: eight rays at a time, one to
//! a lane.

use crate::Steps;
use crate::lists::{Entry, Stream, small};
use crate::ray_state::RayState;
use fearless_simd::{Simd, SimdBase, SimdCombine, SimdMask, f32x4, f32x8, mask32x8, u32x8};
use halfspace_geom::bound::keep_min;
use halfspace_group::visits::{Cut, CutOne, Inside, LANES, Lanes, Nodes, OneRay, Visitor};
use halfspace_leaf::Leaf;
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::box_tree::BoxTree;
use halfspace_nodes::grid::Grid;
use halfspace_nodes::octree_nodes::Octree;
use halfspace_nodes::plane_tree::PlaneTree;
use halfspace_nodes::slab_node::SlabNode;
use halfspace_nodes::slab_tree::SlabTree;
use halfspace_nodes::slab_wide::WideSlabs;
use halfspace_nodes::slant_tree::SlantTree;
use halfspace_nodes::wide_tree::WideTree;
use halfspace_ray::Interval;
use halfspace_ray::query::Counters;

/// Lists of at most this many rays are cut ray by ray at a single plane.
const FEW: u32 = 3;

/// Up to eight rays of a list. The lanes beyond its end hold any rays, whose results are ignored.
pub struct Group<'a, S: Simd> {
    simd: S,
    states: &'a [RayState],
    rays: [u32; LANES],
    inside: Inside<S>,
}

impl<S: Simd> Lanes<S> for Group<'_, S> {
    #[inline(always)]
    fn inside(&self) -> Inside<S> {
        self.inside
    }

    #[inline(always)]
    fn axis(&self, axis: usize) -> [f32x8<S>; 4] {
        self.columns(
            #[inline(always)]
            |state| &state.line.axes[axis],
        )
    }

    #[inline(always)]
    fn origins(&self) -> [f32x8<S>; 4] {
        self.columns(
            #[inline(always)]
            |state| &state.origin,
        )
    }

    #[inline(always)]
    fn directions(&self) -> [f32x8<S>; 3] {
        let [x, y, z, _] = self.columns(
            #[inline(always)]
            |state| &state.direction,
        );
        [x, y, z]
    }
}

impl<S: Simd> Group<'_, S> {
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

/// Implements the visits of streams for trees whose nodes cut intervals.
macro_rules! by_intervals {
    ($([$($of:tt)*] $tree:ty;)*) => {
        $(
            impl<$($of)*> Steps for $tree {
                type Node = <Self as Nodes>::Node;
                type Scratch<S: Simd> = ();
                const INTERVALS: bool = true;

                fn root(&self) -> <Self as Nodes>::Node {
                    Nodes::root(self)
                }

                #[inline(always)]
                fn leaf(&self, node: &<Self as Nodes>::Node) -> Option<Leaf> {
                    Nodes::leaf(self, node)
                }

                #[inline(always)]
                fn fetch_ahead(&self, node: &<Self as Nodes>::Node, blocks: &Blocks) {
                    Nodes::fetch_ahead(self, node, blocks);
                }

                #[inline(always)]
                fn count<C: Counters>(&self, node: &<Self as Nodes>::Node, counters: &mut C) {
                    Nodes::count(self, node, counters);
                }

                #[inline(always)]
                fn visit<S: Simd>(
                    &self,
                    simd: S,
                    stream: &mut Stream<<Self as Nodes>::Node>,
                    own: Entry<<Self as Nodes>::Node>,
                    states: &[RayState],
                    (): &mut (),
                ) {
                    let mut visit = Visit {
                        stream,
                        own,
                        states,
                    };
                    Nodes::visit(self, simd, &own.node, &mut visit);
                }

                fn bytes(&self) -> usize {
                    Nodes::bytes(self)
                }
            }
        )*
    };
}

by_intervals! {
    [] PlaneTree;
    [] WideTree;
    [] BoxTree<2>;
    [] BoxTree<4>;
    [N: SlabNode] SlabTree<N>;
    [const W: usize] WideSlabs<W>;
    [] SlantTree;
    [] Grid;
    [] Octree;
}

/// The rays of a list that visit a node.
struct Visit<'a, P> {
    stream: &'a mut Stream<P>,
    own: Entry<P>,
    states: &'a [RayState],
}

impl<P: Copy> Visitor<P> for Visit<'_, P> {
    #[inline(always)]
    fn octant(&self) -> usize {
        self.stream.octant
    }

    #[inline(always)]
    fn lead(&self) -> [f32; 3] {
        let ray = self.stream.lists[self.own.first as usize];
        let [x, y, z, _] = self.states[ray as usize].direction;
        [x, y, z]
    }

    #[inline(always)]
    fn distribute<S: Simd, const N: usize>(
        &mut self,
        simd: S,
        children: [Option<P>; N],
        cut: &impl Cut<S, N>,
    ) {
        let &mut Self {
            ref mut stream,
            own,
            states,
        } = self;
        let (first, rays) = (own.first as usize, own.rays as usize);
        // Give each child room for all rays. The first child's list replaces the parent's, whose entries are loaded
        // before they are overwritten.
        let room = rays.next_multiple_of(LANES);
        stream.make_room(first + N * room, true);
        let mut counts = [0; N];
        for from in (0..rays).step_by(LANES) {
            let at = first + from..first + from + LANES;
            let indices = u32x8::from_slice(simd, &stream.lists[at.clone()]);
            let group = Group {
                simd,
                states,
                rays: stream.lists[at.clone()].try_into().expect("eight"),
                inside: Inside {
                    enter: f32x8::from_slice(simd, &stream.enter[at.clone()]),
                    leave: f32x8::from_slice(simd, &stream.leave[at]),
                },
            };
            let valid = u64::MAX >> (64 - (rays - from).min(LANES));
            // Append the rays that meet a child to its list.
            let parts = cut.cut(simd, &group);
            for (child, part) in parts.iter().enumerate() {
                let lanes = part.enter.simd_le(part.leave).to_bitmask() & valid;
                let live = mask32x8::from_bitmask(simd, lanes);
                let to = first + child * room + counts[child];
                let to = to..to + LANES;
                (indices.compress(live)).store_slice(&mut stream.lists[to.clone()]);
                (part.enter.compress(live)).store_slice(&mut stream.enter[to.clone()]);
                (part.leave.compress(live)).store_slice(&mut stream.leave[to]);
                counts[child] += lanes.count_ones() as usize;
            }
        }
        for (child, node) in children.into_iter().enumerate() {
            let begins = first + child * room;
            stream.push_list(node, own.node, begins..begins + counts[child]);
        }
    }

    #[inline(always)]
    fn halve<S: Simd>(
        &mut self,
        simd: S,
        children: [Option<P>; 2],
        cut: &(impl Cut<S, 2> + CutOne),
    ) {
        if self.own.rays <= FEW {
            self.stream.halve_few(self.own, self.states, children, cut);
        } else {
            self.distribute(simd, children, cut);
        }
    }
}

impl<P: Copy> Stream<P> {
    /// [`Visitor::halve`] for few rays, one after another: eight lanes would be mostly unused.
    #[inline(always)]
    fn halve_few(
        &mut self,
        own: Entry<P>,
        states: &[RayState],
        [far, near]: [Option<P>; 2],
        cut: &impl CutOne,
    ) {
        let (first, rays) = (own.first as usize, own.rays as usize);
        // The list of the far child replaces the parent's, that of the near one follows.
        let other = first + rays;
        self.make_room(other + rays, true);
        let (mut behind, mut before) = (first, other);
        for at in first..other {
            let ray = self.lists[at];
            let state = &states[ray as usize];
            let leave = keep_min(self.leave[at], state.line.reach());
            let [x, y, z, _] = state.direction;
            let one = OneRay {
                axes: &state.line.axes,
                origin: state.origin,
                direction: [x, y, z],
            };
            let [far, near] = cut.cut_one(&one, Interval::new(self.enter[at], leave));
            // Append without a branch: an entry that is not counted is overwritten.
            (self.lists[behind], self.enter[behind], self.leave[behind]) =
                (ray, far.enter, far.leave);
            behind += usize::from(far.enter <= far.leave);
            (self.lists[before], self.enter[before], self.leave[before]) =
                (ray, near.enter, near.leave);
            before += usize::from(near.enter <= near.leave);
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
