// SPDX-License-Identifier: GPL-3.0-or-later
//! The octree walked from the top, as Arvo has it.

use super::octree::{self, LEAF_SIZE, MAX_DEPTH_PARAM, REFERENCES, Walked};
use crate::build::Monitor;
use crate::error::Result;
use crate::registry::{Built, StructureSpec};
use crate::scene::Triangles;
use crate::spec::Config;
use crate::structure::Layout;

/// The registry's row.
pub const SPEC: StructureSpec = StructureSpec {
    id: "octree-arvo",
    code: 61,
    label: "Octree, linear time",
    family: "octants",
    summary: "The walk of octree-param, from the root down, under the name of the note that first described it.",
    paper: "Arvo 1988, Linear-time voxel walking for octrees (Ray Tracing News 1)",
    params: &[LEAF_SIZE, REFERENCES, MAX_DEPTH_PARAM],
    build,
};

fn build(scene: &Triangles, config: &Config, monitor: &Monitor) -> Result<Built> {
    octree::build(scene, config, monitor, Walked::FromTop, Layout::OctreeParam)
}
