// SPDX-License-Identifier: GPL-3.0-or-later
//! The tree over the instances, built like one of the trees over triangles.

use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_builders::binned::SurfaceArea;
use halfspace_builders::global::Global;
use halfspace_builders::middle::{At, Longest};
use halfspace_builders::object::{self, Object};
use halfspace_geom::Aabb;
use halfspace_nodes::cost::Costs;
use halfspace_nodes::object_tree::ObjectTree;

/// Costs of the upper tree: a leaf is a transform of the ray and a traversal of a mesh's tree (chosen).
const COSTS: Costs = Costs {
    step: 1.0,
    leaf: 10.0,
    triangle: 10.0,
    ..Costs::BLOCKS
};

/// How the nodes of the upper tree are partitioned. The answers do not depend on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Top {
    /// By the surface area heuristic, as `bvh-sah`.
    #[default]
    Sah,
    /// By the cells of a regular grid, as `bih`.
    Grid,
    /// In the middle of the longest side of the node's box.
    Middle,
    /// Half of the instances on either side, along the longest side of the node's box.
    Median,
}

impl Top {
    /// All ways with their names.
    pub const NAMED: [(&'static str, Self); 4] = [
        ("sah", Self::Sah),
        ("grid", Self::Grid),
        ("middle", Self::Middle),
        ("median", Self::Median),
    ];

    /// Returns the way of this name.
    pub fn of(name: &str) -> Option<Self> {
        let mut all = Self::NAMED.into_iter();
        all.find(|(known, _)| *known == name).map(|(_, top)| top)
    }

    /// Returns the name of the way.
    pub fn name(self) -> &'static str {
        let mut all = Self::NAMED.into_iter();
        all.find(|(_, top)| *top == self)
            .map_or("", |(name, _)| name)
    }

    /// Builds the tree over the boxes of instances within `bounds`. Each leaf is one instance, unless centres coincide.
    pub(super) fn build(
        self,
        boxes: Vec<Object>,
        bounds: Aabb,
        monitor: &Monitor,
    ) -> Result<ObjectTree> {
        let longest = |at| Longest { leaf_size: 1, at };
        match self {
            Self::Sah => {
                let policy = SurfaceArea {
                    costs: COSTS,
                    leaf_max: 1,
                };
                object::build_over(boxes, bounds, &policy, monitor)
            }
            Self::Grid => {
                let policy = Global {
                    leaf_size: 1,
                    ways: 2,
                };
                object::build_over(boxes, bounds, &policy, monitor)
            }
            Self::Middle => object::build_over(boxes, bounds, &longest(At::Middle), monitor),
            Self::Median => object::build_over(boxes, bounds, &longest(At::Median), monitor),
        }
    }
}
