// SPDX-License-Identifier: GPL-3.0-or-later
//! Samet-Standard: the octree whose neighbours are found by ascent.

use super::octree::{self, LEAF_SIZE, MAX_DEPTH_PARAM, REFERENCES, Walked};
use crate::build::Monitor;
use crate::error::Result;
use crate::registry::{Built, StructureSpec};
use crate::scene::Triangles;
use crate::spec::Config;
use crate::structure::Layout;

/// The registry's row.
pub const SPEC: StructureSpec = StructureSpec {
    id: "octree-samet",
    code: 63,
    label: "Octree with ascent",
    family: "octants",
    summary: "Cubes halved along all axes; rays find the next leaf by going up to the common ancestor and down again.",
    paper: "Samet 1989, Implementing ray tracing with octrees and neighbor finding",
    params: &[LEAF_SIZE, REFERENCES, MAX_DEPTH_PARAM],
    build,
};

fn build(scene: &Triangles, config: &Config, monitor: &Monitor) -> Result<Built> {
    octree::build(
        scene,
        config,
        monitor,
        Walked::FromLeafToLeaf,
        Layout::OctreeSamet,
    )
}
