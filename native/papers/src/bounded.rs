// SPDX-License-Identifier: GPL-3.0-or-later
//! With error bounds and exact verdicts: the answers are those of all other kernels.

use crate::origin::{Arvo, OriginTraversal, Sung, TaA};
use crate::projected::ProjectedTraversal;
use crate::rope::RopeTraversal;
use crate::seq::RestartTraversal;
use crate::ta_b::TaBTraversal;
use crate::ta_b_poly::HeightTraversal;
use halfspace_nodes::axis_tree::SharedAxisTree;
use halfspace_nodes::plane_tree::PlaneTree;
use halfspace_nodes::projected_tree::ProjectedTree;
use halfspace_nodes::ropes::Ropes;
use halfspace_single::planes::dir::PlaneTraversal;
use halfspace_single::{Scalar, single_rays};
use std::sync::Arc;

single_rays! {
    /// Single rays by plane distances in the order of the direction.
    fn dir(PlaneTree) -> PlaneTraversal<&'a PlaneTree>, with Scalar {
        |kernel| PlaneTraversal(&*kernel.tree)
    }
}

single_rays! {
    /// Single rays by TA-B.
    fn ta_b(SharedAxisTree) -> TaBTraversal<'a>, with Scalar {
        |kernel| TaBTraversal(kernel.tree.borrowed())
    }
}

single_rays! {
    /// Single rays by the heights of entry and exit points over planes of any direction.
    fn ta_b_poly(PlaneTree) -> HeightTraversal<'a>, with Scalar {
        |kernel| HeightTraversal(&kernel.tree)
    }
}

single_rays! {
    /// Single rays by TA-A.
    fn ta_a(SharedAxisTree) -> OriginTraversal<'a, TaA, false>, with Scalar {
        |kernel| OriginTraversal::new(kernel.tree.borrowed())
    }
}

single_rays! {
    /// Single rays by the algorithm of Sung and Shirley.
    fn sung(SharedAxisTree) -> OriginTraversal<'a, Sung, false>, with Scalar {
        |kernel| OriginTraversal::new(kernel.tree.borrowed())
    }
}

single_rays! {
    /// Single rays by Arvo's algorithm.
    fn arvo(SharedAxisTree) -> OriginTraversal<'a, Arvo, false>, with Scalar {
        |kernel| OriginTraversal::new(kernel.tree.borrowed())
    }
}

single_rays! {
    /// Single rays that find each leaf from the root.
    fn seq(SharedAxisTree) -> RestartTraversal<'a>, with Scalar {
        |kernel| RestartTraversal(kernel.tree.borrowed())
    }
}

single_rays! {
    /// Single rays from leaf to leaf along ropes.
    fn rope(SharedAxisTree, ropes: Arc<Ropes>) -> RopeTraversal<'a, false>, with Scalar {
        |kernel| RopeTraversal { tree: kernel.tree.borrowed(), ropes: &kernel.ropes }
    }
}

single_rays! {
    /// Single rays by their projections onto the tree's directions.
    fn projected(ProjectedTree) -> ProjectedTraversal<'a, false>, with Scalar {
        |kernel| ProjectedTraversal(&kernel.tree)
    }
}
