// SPDX-License-Identifier: GPL-3.0-or-later
//! The octree walked from the top.

use super::octree::{self, LEAF_SIZE, MAX_DEPTH_PARAM, REFERENCES, Walked};
use crate::build::Monitor;
use crate::error::Result;
use crate::registry::{Built, StructureSpec};
use crate::scene::Triangles;
use crate::spec::Config;
use crate::structure::Layout;

/// The registry's row.
pub const SPEC: StructureSpec = StructureSpec {
    id: "octree-param",
    code: 60,
    label: "Octree, from the top",
    family: "octants",
    summary: "Cubes halved along all axes; rays walk down from the root, octants in the order of the direction.",
    paper: "Revelles, Ureña and Lastra 2000, An efficient parametric algorithm for octree traversal",
    params: &[LEAF_SIZE, REFERENCES, MAX_DEPTH_PARAM],
    build,
};

fn build(scene: &Triangles, config: &Config, monitor: &Monitor) -> Result<Built> {
    octree::build(scene, config, monitor, Walked::FromTop, Layout::OctreeParam)
}
