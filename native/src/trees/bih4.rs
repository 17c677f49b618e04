// SPDX-License-Identifier: GPL-3.0-or-later
//! A bounding interval hierarchy of four planes a node: each of the two children lies between two of
//! its own. Twenty bytes a node.

use super::interval::{self, EMPTY, LEAF_SIZE, LEAVES};
use crate::build::Monitor;
use crate::error::Result;
use crate::registry::{Built, StructureSpec, params};
use crate::scene::Triangles;
use crate::spec::Config;
use crate::traverse::objects::Objects;
use crate::traverse::slab_wide::WideSlabs;

/// The registry's row.
pub const SPEC: StructureSpec = StructureSpec {
    id: "bih4",
    code: 44,
    label: "Interval hierarchy, four planes",
    family: "objects",
    summary: "Four planes a node: both children are bounded on both sides.",
    paper: "Wächter and Keller 2006, Instant ray tracing: the bounding interval hierarchy; \
            Wächter 2008, Quasi-Monte Carlo light transport simulation by efficient ray tracing",
    params: &[LEAF_SIZE, EMPTY, LEAVES, params::ROBUST],
    build,
};

fn build(scene: &Triangles, config: &Config, monitor: &Monitor) -> Result<Built> {
    interval::by_grid((scene, config, monitor), 2, |binary, bounds, leaves| {
        Ok(Objects::Slabs2(WideSlabs::new(
            binary,
            bounds,
            interval::tighten(config),
            leaves,
        )?))
    })
}
