// SPDX-License-Identifier: GPL-3.0-or-later
//! Visits to nodes that cut the intervals of rays, by several rays together, one to a lane. Streams and packets share
//! them: each kind of nodes has one [`Cut`] without branches, and each way of sending rays one [`Visitor`].

pub mod cells;
mod few_boxes;
mod octants;
mod planes;
mod slabs;
mod slanted;
pub mod wide_planes;
mod wide_slabs;

use fearless_simd::{Simd, SimdBase, SimdFloat, f32x8};
use halfspace_geom::bound::{keep_max, keep_max_each, keep_min, keep_min_each};
use halfspace_leaf::Leaf;
use halfspace_leaf::blocks::Blocks;
use halfspace_ray::Interval;
use halfspace_ray::query::Counters;

/// Passes each kind of nodes without kernels of its own to a macro that defines the kernels of a way of sending rays.
#[macro_export]
macro_rules! kernels_of_all_nodes {
    ($make:ident) => {
        $make! {
            /// through nodes of four boxes.
            fn boxes4, shadow_boxes4(BoxTree<4>)
        }

        $make! {
            /// through nodes of two boxes.
            fn boxes2, shadow_boxes2(BoxTree<2>)
        }

        $make! {
            /// through nodes of eight boxes that are turned together.
            fn turned_boxes, shadow_turned_boxes(halfspace_nodes::obb_tree::ObbTree)
        }

        $make! {
            /// through wide nodes of split planes.
            fn wide_planes, shadow_wide_planes(halfspace_nodes::wide_tree::WideTree)
        }

        $make! {
            /// through intervals, two planes to a node.
            fn intervals, shadow_intervals(
                halfspace_nodes::slab_tree::SlabTree<halfspace_nodes::slab_node::Double>
            )
        }

        $make! {
            /// through the boxes that intervals leave.
            fn slab_boxes, shadow_slab_boxes(halfspace_nodes::slab_boxes::SlabBoxes)
        }

        $make! {
            /// through intervals, one plane to a node.
            fn single_intervals, shadow_single_intervals(
                halfspace_nodes::slab_tree::SlabTree<halfspace_nodes::slab_node::Single>
            )
        }

        $make! {
            /// through nodes of two intervals.
            fn intervals2, shadow_intervals2(halfspace_nodes::slab_wide::WideSlabs<2>)
        }

        $make! {
            /// through nodes of four intervals.
            fn intervals4, shadow_intervals4(halfspace_nodes::slab_wide::WideSlabs<4>)
        }

        $make! {
            /// through nodes of eight intervals.
            fn intervals8, shadow_intervals8(halfspace_nodes::slab_wide::WideSlabs<8>)
        }

        $make! {
            /// through intervals along any of thirteen directions.
            fn slanted, shadow_slanted(halfspace_nodes::slant_tree::SlantTree)
        }

        $make! {
            /// through the cells of uniform grids.
            fn cells, shadow_cells(halfspace_nodes::grid::Grid)
        }

        $make! {
            /// through octrees.
            fn octants, shadow_octants(halfspace_nodes::octree_nodes::Octree)
        }
    };
}
pub use kernels_of_all_nodes;

/// Number of rays that are cut at once.
pub const LANES: usize = 8;

/// Column of [`Lanes::axis`]: the reciprocal direction.
pub const INV: usize = 0;
/// Column of the terms added for planes of entry ([`halfspace_trace::slabs::Slabs`]).
pub const NEAR: usize = 1;
/// Column of the terms added for planes of exit.
pub const FAR: usize = 2;
/// Column of the reach.
pub const REACH: usize = 3;

/// The intervals of eight rays in a region.
#[derive(Clone, Copy)]
pub struct Inside<S: Simd> {
    /// Where each enters.
    pub enter: f32x8<S>,
    /// Where each leaves.
    pub leave: f32x8<S>,
}

/// Eight rays of one octant of directions in a node.
pub trait Lanes<S: Simd> {
    /// The intervals in the node, as they were when its parent was visited.
    fn inside(&self) -> Inside<S>;

    /// The coefficients of the rays for planes across an axis, one vector per column ([`INV`] to [`REACH`]).
    fn axis(&self, axis: usize) -> [f32x8<S>; 4];

    /// The origins, and the error bounds of their heights over oblique planes.
    fn origins(&self) -> [f32x8<S>; 4];

    /// The directions.
    fn directions(&self) -> [f32x8<S>; 3];

    /// The reach of each ray.
    #[inline(always)]
    fn reach(&self) -> f32x8<S> {
        self.axis(0)[REACH]
    }

    /// The intervals, cut at each ray's best hit; `rows` are those of any axis.
    #[inline(always)]
    fn within(&self, rows: &[f32x8<S>; 4]) -> Inside<S> {
        let Inside { enter, leave } = self.inside();
        Inside {
            enter,
            leave: keep_min_each(leave, rows[REACH]),
        }
    }
}

/// Cuts the intervals of eight rays in a node into those in its children. A distance that is NaN cuts off nothing.
pub trait Cut<S: Simd, const N: usize> {
    /// The intervals in each child, empty where a ray misses it.
    fn cut<L: Lanes<S>>(&self, simd: S, lanes: &L) -> [Inside<S>; N];
}

/// One ray in a node: the rows whose columns are those of [`Lanes`].
pub struct OneRay<'a> {
    /// Terms of planes across each axis, see [`Lanes::axis`].
    pub axes: &'a [[f32; 4]; 3],
    /// The origin, and the error bound of its height over oblique planes.
    pub origin: [f32; 4],
    /// The direction.
    pub direction: [f32; 3],
}

/// Cuts the interval of one ray, as a [`Cut`] with two children cuts those of eight.
pub trait CutOne {
    /// The intervals in the far and the near child, empty where the ray misses it. `inside` ends at the best hit.
    fn cut_one(&self, ray: &OneRay<'_>, inside: Interval) -> [Interval; 2];
}

/// The rays that visit a node together, all of one octant, and their stack.
pub trait Visitor<P> {
    /// The octant: bit `k` is set for rays that descend along axis `k`.
    fn octant(&self) -> usize;

    /// Direction of the first ray, which decides the order of children where the octant does not.
    fn lead(&self) -> [f32; 3];

    /// Distributes the rays over the children: pushes those that exist and that some ray meets, in this order.
    fn distribute<S: Simd, const N: usize>(
        &mut self,
        simd: S,
        children: [Option<P>; N],
        cut: &impl Cut<S, N>,
    );

    /// [`Self::distribute`] for the far and the near child of a node, in this order.
    #[inline(always)]
    fn halve<S: Simd>(
        &mut self,
        simd: S,
        children: [Option<P>; 2],
        cut: &(impl Cut<S, 2> + CutOne),
    ) {
        self.distribute(simd, children, cut);
    }
}

/// A tree whose nodes cut the intervals of rays.
pub trait Nodes: Sync {
    /// A node or a leaf, as stack entries hold it.
    type Node: Copy;

    /// Largest number of children of a node.
    const CHILDREN: usize;

    /// The root.
    fn root(&self) -> Self::Node;

    /// The leaf at a node, `None` for an inner node.
    fn leaf(&self, node: &Self::Node) -> Option<Leaf>;

    /// Prefetches the memory that a visit reads.
    fn fetch_ahead(&self, node: &Self::Node, blocks: &Blocks);

    /// Counts the visit to an inner node.
    fn count<C: Counters>(&self, node: &Self::Node, counters: &mut C);

    /// Visits an inner node.
    fn visit<S: Simd>(&self, simd: S, node: &Self::Node, visitor: &mut impl Visitor<Self::Node>);

    /// Size of the nodes in bytes.
    fn bytes(&self) -> usize;
}

/// Two planes across an axis, which may be equal: the near child of a node ends at the plane `ends`, and the far child
/// begins at the plane `begins`.
#[derive(Clone, Copy)]
pub struct Gap {
    /// The axis.
    pub axis: usize,
    /// Where the near child ends.
    pub ends: f32,
    /// Where the far child begins.
    pub begins: f32,
}

impl<S: Simd> Cut<S, 2> for Gap {
    #[inline(always)]
    fn cut<L: Lanes<S>>(&self, simd: S, lanes: &L) -> [Inside<S>; 2] {
        let rows = lanes.axis(self.axis % 3);
        let Inside { enter, leave } = lanes.within(&rows);
        let [begins, ends] = [self.begins, self.ends].map(|plane| f32x8::splat(simd, plane));
        let soon = keep_max_each(begins.mul_add(rows[INV], rows[NEAR]), enter);
        let late = keep_min_each(ends.mul_add(rows[INV], rows[FAR]), leave);
        [Inside { enter: soon, leave }, Inside { enter, leave: late }]
    }
}

impl CutOne for Gap {
    #[inline(always)]
    fn cut_one(&self, ray: &OneRay<'_>, inside: Interval) -> [Interval; 2] {
        let axis = &ray.axes[self.axis % 3];
        let soon = keep_max(self.begins * axis[INV] + axis[NEAR], inside.enter);
        let late = keep_min(self.ends * axis[INV] + axis[FAR], inside.leave);
        [
            Interval::new(soon, inside.leave),
            Interval::new(inside.enter, late),
        ]
    }
}
