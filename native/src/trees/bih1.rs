// SPDX-License-Identifier: GPL-3.0-or-later
//! A bounding interval hierarchy of one plane a node: it bounds one of the two children, the one for
//! which that saves more. Eight bytes a node.

use super::interval::{self, EMPTY, LEAF_SIZE, LEAVES};
use crate::build::Monitor;
use crate::error::Result;
use crate::registry::{Built, StructureSpec, params};
use crate::scene::Triangles;
use crate::spec::Config;
use crate::traverse::objects::Objects;
use crate::traverse::slab_tree::SlabTree;

/// The registry's row.
pub const SPEC: StructureSpec = StructureSpec {
    id: "bih1",
    code: 43,
    label: "Interval hierarchy, one plane",
    family: "objects",
    summary: "One plane a node, which bounds one of the two children: the smallest nodes of all hierarchies.",
    paper: "Wächter and Keller 2006, Instant ray tracing: the bounding interval hierarchy",
    params: &[LEAF_SIZE, EMPTY, LEAVES, params::ROBUST],
    build,
};

fn build(scene: &Triangles, config: &Config, monitor: &Monitor) -> Result<Built> {
    interval::by_grid((scene, config, monitor), 2, |binary, bounds, leaves| {
        let tighten = (interval::tighten(config), true);
        let tree = SlabTree::new(binary, bounds, tighten, leaves)?;
        Ok(Objects::Single(tree))
    })
}
