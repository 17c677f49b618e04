// SPDX-License-Identifier: GPL-3.0-or-later
//! The first octree for rays.

use super::octree::{self, LEAF_SIZE, MAX_DEPTH_PARAM, REFERENCES, Walked};
use crate::build::Monitor;
use crate::error::Result;
use crate::registry::{Built, StructureSpec};
use crate::scene::Triangles;
use crate::spec::Config;
use crate::structure::Layout;

/// The registry's row.
pub const SPEC: StructureSpec = StructureSpec {
    id: "octree-glassner",
    code: 64,
    label: "Octree with point location",
    family: "octants",
    summary: "Cubes halved along all axes; rays find every next leaf from the root.",
    paper: "Glassner 1984, Space subdivision for fast ray tracing",
    params: &[LEAF_SIZE, REFERENCES, MAX_DEPTH_PARAM],
    build,
};

fn build(scene: &Triangles, config: &Config, monitor: &Monitor) -> Result<Built> {
    octree::build(
        scene,
        config,
        monitor,
        Walked::FromLeafToLeaf,
        Layout::OctreeGlassner,
    )
}
