// SPDX-License-Identifier: GPL-3.0-or-later
//! The last step of all hierarchies over triangles: from nodes, leaves and plan to a built structure.

use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::Tree;
use halfspace_nodes::shape::Shape;
use halfspace_ray::frame::Frame;
use halfspace_structure::spec::Config;
use halfspace_structure::{Built, Plan};
use std::sync::Arc;

/// A built hierarchy. The parameters `robust` and `shadow` are applied here.
pub fn built<T: Tree>(
    config: &Config,
    frame: Frame,
    tree: Arc<T>,
    leaves: Arc<Blocks>,
    plan: Plan,
    shape: Shape,
) -> Built {
    Built {
        frame: frame.with_robust(config.robust()),
        tree: Some(tree),
        leaves,
        derived: Vec::new(),
        plan: plan.with_shadow(config.choice("shadow"), None),
        shape,
        left_out: Vec::new(),
        growing: None,
        refit: None,
    }
}
