// SPDX-License-Identifier: GPL-3.0-or-later
//! Samet-Net: the octree with stored links.

use super::octree::{self, LEAF_SIZE, MAX_DEPTH_PARAM, REFERENCES, Walked};
use crate::build::Monitor;
use crate::error::Result;
use crate::registry::{Built, StructureSpec};
use crate::scene::Triangles;
use crate::spec::Config;
use crate::structure::Layout;

/// The registry's row.
pub const SPEC: StructureSpec = StructureSpec {
    id: "octree-net",
    code: 62,
    label: "Octree with links",
    family: "octants",
    summary: "Cubes halved along all axes; rays walk from leaf to leaf by six stored links each.",
    paper: "Endl and Sommer 1994, Classification of ray-generators in uniform subdivisions and octrees for ray tracing",
    params: &[LEAF_SIZE, REFERENCES, MAX_DEPTH_PARAM],
    build,
};

fn build(scene: &Triangles, config: &Config, monitor: &Monitor) -> Result<Built> {
    octree::build(scene, config, monitor, Walked::ByLinks, Layout::OctreeNet)
}
