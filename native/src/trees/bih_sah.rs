// SPDX-License-Identifier: GPL-3.0-or-later
//! A bounding interval hierarchy parted by the surface area heuristic instead of a grid: slower to
//! build, quicker to walk.

use super::interval::{self, EMPTY, LEAVES};
use crate::build::Monitor;
use crate::build::binned::SurfaceArea;
use crate::build::cost::Costs;
use crate::build::object;
use crate::error::Result;
use crate::registry::{Built, StructureSpec, params};
use crate::scene::Triangles;
use crate::spec::Config;
use crate::traverse::frame::Frame;
use crate::traverse::objects::Objects;
use crate::traverse::slab_tree::SlabTree;

const COSTS: Costs = Costs::BLOCKS;

/// The registry's row.
pub const SPEC: StructureSpec = StructureSpec {
    id: "bih-sah",
    code: 41,
    label: "Interval hierarchy by surface area",
    family: "objects",
    summary: "Two planes a node, triangles parted where the surface area heuristic is lowest.",
    paper: "Wächter and Keller 2006, Instant ray tracing: the bounding interval hierarchy; Wald 2007, On \
            fast construction of SAH-based bounding volume hierarchies",
    params: &[
        EMPTY,
        LEAVES,
        params::ROBUST,
        params::step_cost(COSTS),
        params::leaf_cost(COSTS),
        params::triangle_cost(COSTS),
        params::LEAF_MAX,
    ],
    build,
};

fn build(scene: &Triangles, config: &Config, monitor: &Monitor) -> Result<Built> {
    let frame = Frame::new(scene.bounds());
    let policy = SurfaceArea::configured(config, COSTS);
    let binary = object::build(scene, &frame, &policy, monitor)?;
    interval::finish((scene, config), frame, &binary, |binary, bounds, leaves| {
        let tighten = (interval::tighten(config), false);
        let tree = SlabTree::new(binary, bounds, tighten, leaves)?;
        Ok(Objects::Slabs(tree))
    })
}
