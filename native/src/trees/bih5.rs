// SPDX-License-Identifier: GPL-3.0-or-later
//! The bounding interval hierarchy with the fifth case: where much of a region is empty, a node with
//! one child cuts it off on both sides, its two planes being where the child begins and where it
//! ends.

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
    id: "bih5",
    code: 42,
    label: "Interval hierarchy, empty space cut",
    family: "objects",
    summary: "As bih, and nodes of one child that cut off empty space on both sides.",
    paper: "Wächter and Keller 2006, Instant ray tracing: the bounding interval hierarchy",
    params: &[LEAF_SIZE, EMPTY, LEAVES, params::ROBUST],
    build,
};

fn build(scene: &Triangles, config: &Config, monitor: &Monitor) -> Result<Built> {
    interval::by_grid((scene, config, monitor), 2, |binary, bounds, leaves| {
        let tighten = (interval::tighten(config), true);
        let tree = SlabTree::new(binary, bounds, tighten, leaves)?;
        Ok(Objects::Slabs(tree))
    })
}
