// SPDX-License-Identifier: GPL-3.0-or-later
//! Hierarchies over triangles, octrees and grids whose leaves test one triangle at a time. Their traversals are those of
//! [`halfspace_single`]; only the leaf tests differ.

use halfspace_nodes::box_tree::BoxTree;
use halfspace_nodes::dop_tree::DopTree;
use halfspace_nodes::grid::Grid;
use halfspace_nodes::octree_nodes::Octree;
use halfspace_nodes::slab_boxes::SlabBoxes;
use halfspace_nodes::slab_node::{Double, Single};
use halfspace_nodes::slab_tree::SlabTree;
use halfspace_nodes::slab_wide::WideSlabs;
use halfspace_nodes::slant_tree::SlantTree;
use halfspace_single::grid::GridTraversal;
use halfspace_single::objects::boxes::BoxTraversal;
use halfspace_single::objects::dops::DopTraversal;
use halfspace_single::objects::intervals::IntervalTraversal;
use halfspace_single::objects::slab_boxes::SlabBoxTraversal;
use halfspace_single::octants::glassner::Location;
use halfspace_single::octants::net::Links;
use halfspace_single::octants::param::OctreeTraversal;
use halfspace_single::octants::samet::Ascent;
use halfspace_single::octants::step::NeighbourTraversal;
use halfspace_single::{Published, Scalar, single_rays};
use halfspace_trace::kernel::SingleRays;
use std::sync::Arc;

/// Defines functions that make kernels of traversals. With `robust` the exact verdict decides hits, otherwise the published
/// f32 test.
macro_rules! either {
    ($(
        $(#[$doc:meta])*
        fn $name:ident($tree:ty) -> $traversal:ty { |$kernel:ident| $make:expr }
    )*) => {$(
        $(#[$doc])*
        pub fn $name(
            tree: &Arc<$tree>,
            leaves: &Arc<halfspace_leaf::blocks::Blocks>,
            robust: bool,
        ) -> Arc<dyn SingleRays> {
            single_rays! {
                fn bounded($tree) -> $traversal, with Scalar { |$kernel| $make }
            }
            single_rays! {
                fn published($tree) -> $traversal, with Published { |$kernel| $make }
            }
            if robust { bounded(tree, leaves) } else { published(tree, leaves) }
        }
    )*};
}

either! {
    /// Single rays through nodes of two boxes, the nearest first.
    fn boxes2(BoxTree<2>) -> BoxTraversal<'a, 2> { |kernel| BoxTraversal(&kernel.tree) }

    /// Single rays through nodes of eight boxes, the nearest first.
    fn boxes8(BoxTree<8>) -> BoxTraversal<'a, 8> { |kernel| BoxTraversal(&kernel.tree) }

    /// Single rays through intervals, two planes to a node.
    fn slabs(SlabTree<Double>) -> IntervalTraversal<'a, SlabTree<Double>> {
        |kernel| IntervalTraversal(&*kernel.tree)
    }

    /// Single rays through intervals, one plane to a node.
    fn single_slabs(SlabTree<Single>) -> IntervalTraversal<'a, SlabTree<Single>> {
        |kernel| IntervalTraversal(&*kernel.tree)
    }

    /// Single rays through nodes of two intervals.
    fn wide_slabs2(WideSlabs<2>) -> IntervalTraversal<'a, WideSlabs<2>> {
        |kernel| IntervalTraversal(&*kernel.tree)
    }

    /// Single rays through the boxes that intervals leave.
    fn slab_boxes(SlabBoxes) -> SlabBoxTraversal<'a, Double> {
        |kernel| SlabBoxTraversal::new(&kernel.tree.tree, kernel.tree.bounds)
    }

    /// Single rays through intervals along any of thirteen directions.
    fn slanted(SlantTree) -> IntervalTraversal<'a, SlantTree> {
        |kernel| IntervalTraversal(&*kernel.tree)
    }

    /// Single rays through nodes bounded by three slabs, by a priority queue.
    fn dops3(DopTree<3>) -> DopTraversal<'a, 3> { |kernel| DopTraversal(&kernel.tree) }

    /// Single rays through nodes bounded by seven slabs, by a priority queue.
    fn dops7(DopTree<7>) -> DopTraversal<'a, 7> { |kernel| DopTraversal(&kernel.tree) }

    /// Single rays from cell to cell of a grid.
    fn grid(Grid) -> GridTraversal<'a> { |kernel| GridTraversal(&kernel.tree) }
}

single_rays! {
    /// Single rays through an octree from the root down.
    fn param(Octree) -> OctreeTraversal<'a>, with Scalar {
        |kernel| OctreeTraversal(&kernel.tree)
    }
}

single_rays! {
    /// Single rays from leaf to leaf of an octree, each located from the root.
    fn glassner(Octree) -> NeighbourTraversal<'a, Location>, with Scalar {
        |kernel| NeighbourTraversal(&kernel.tree, Location)
    }
}

single_rays! {
    /// Single rays from leaf to leaf of an octree by the common ancestor.
    fn samet(Octree) -> NeighbourTraversal<'a, Ascent>, with Scalar {
        |kernel| NeighbourTraversal(&kernel.tree, Ascent)
    }
}

single_rays! {
    /// Single rays from leaf to leaf of an octree by stored links.
    fn net(Octree) -> NeighbourTraversal<'a, Links>, with Scalar {
        |kernel| NeighbourTraversal(&kernel.tree, Links)
    }
}
