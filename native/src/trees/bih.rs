// SPDX-License-Identifier: GPL-3.0-or-later
//! The bounding interval hierarchy: triangles are parted by a grid that is halved again and again,
//! and each node states two planes, where the one half ends and where the other begins. Quick to
//! build, small, and of a size that is known beforehand.

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
    id: "bih",
    code: 40,
    label: "Bounding interval hierarchy",
    family: "objects",
    summary: "Two planes a node, triangles parted by a regular grid: for scenes that change in each frame.",
    paper: "Wächter and Keller 2006, Instant ray tracing: the bounding interval hierarchy; Ooi, \
            McDonell and Sacks-Davis 1987, Spatial kd-tree; Zachmann 2002, Minimal hierarchical \
            collision detection",
    params: &[LEAF_SIZE, EMPTY, LEAVES, params::ROBUST],
    build,
};

fn build(scene: &Triangles, config: &Config, monitor: &Monitor) -> Result<Built> {
    interval::by_grid((scene, config, monitor), 2, |binary, bounds, leaves| {
        let tighten = (interval::tighten(config), false);
        let tree = SlabTree::new(binary, bounds, tighten, leaves)?;
        Ok(Objects::Slabs(tree))
    })
}
