// SPDX-License-Identifier: GPL-3.0-or-later
//! As published: without error bounds, and with f32 alone deciding hits. Answers may be wrong, which can be measured.

use crate::origin::{Arvo, OriginTraversal, Sung, TaA};
use crate::projected::ProjectedTraversal;
use crate::rope::RopeTraversal;
use crate::seq_1985::PointTraversal;
use crate::ta_b_1997::PublishedTaB;
use crate::ta_b_poly::HeightTraversal;
use halfspace_geom::Aabb;
use halfspace_nodes::axis_tree::SharedAxisTree;
use halfspace_nodes::plane_tree::PlaneTree;
use halfspace_nodes::projected_tree::ProjectedTree;
use halfspace_nodes::ropes::Ropes;
use halfspace_single::planes::dir::PlaneTraversal;
use halfspace_single::{Published, single_rays};
use std::sync::Arc;

single_rays! {
    /// Single rays by plane distances in the order of the direction.
    fn dir(PlaneTree) -> PlaneTraversal<&'a PlaneTree>, with Published {
        |kernel| PlaneTraversal(&*kernel.tree)
    }
}

single_rays! {
    /// Single rays by TA-B.
    fn ta_b(SharedAxisTree) -> PublishedTaB<'a>, with Published {
        |kernel| PublishedTaB(kernel.tree.borrowed())
    }
}

single_rays! {
    /// Single rays by the heights of entry and exit points over planes of any direction.
    fn ta_b_poly(PlaneTree) -> HeightTraversal<'a>, with Published {
        |kernel| HeightTraversal(&kernel.tree)
    }
}

single_rays! {
    /// Single rays by TA-A.
    fn ta_a(SharedAxisTree) -> OriginTraversal<'a, TaA, true>, with Published {
        |kernel| OriginTraversal::new(kernel.tree.borrowed())
    }
}

single_rays! {
    /// Single rays by the algorithm of Sung and Shirley.
    fn sung(SharedAxisTree) -> OriginTraversal<'a, Sung, true>, with Published {
        |kernel| OriginTraversal::new(kernel.tree.borrowed())
    }
}

single_rays! {
    /// Single rays by Arvo's algorithm.
    fn arvo(SharedAxisTree) -> OriginTraversal<'a, Arvo, true>, with Published {
        |kernel| OriginTraversal::new(kernel.tree.borrowed())
    }
}

single_rays! {
    /// Single rays by point location.
    fn seq(SharedAxisTree, bounds: Aabb) -> PointTraversal<'a>, with Published {
        |kernel| PointTraversal { tree: kernel.tree.borrowed(), bounds: kernel.bounds }
    }
}

single_rays! {
    /// Single rays from leaf to leaf along ropes.
    fn rope(SharedAxisTree, ropes: Arc<Ropes>) -> RopeTraversal<'a, true>, with Published {
        |kernel| RopeTraversal { tree: kernel.tree.borrowed(), ropes: &kernel.ropes }
    }
}

single_rays! {
    /// Single rays by their projections onto the tree's directions.
    fn projected(ProjectedTree) -> ProjectedTraversal<'a, true>, with Published {
        |kernel| ProjectedTraversal(&kernel.tree)
    }
}
