// SPDX-License-Identifier: GPL-3.0-or-later
//! A bounding interval hierarchy walked as a hierarchy of boxes: the nodes and the build of the one,
//! the walk of the other.

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
    id: "bih-bvh",
    code: 46,
    label: "Interval hierarchy walked as boxes",
    family: "objects",
    summary: "The tree of bih; each ray makes the boxes of a box hierarchy from its planes on the way down.",
    paper: "Wächter and Keller 2006, Instant ray tracing: the bounding interval hierarchy; Wald, Boulos and \
            Shirley 2007, Ray tracing deformable scenes using dynamic bounding volume hierarchies",
    params: &[LEAF_SIZE, EMPTY, LEAVES, params::ROBUST],
    build,
};

fn build(scene: &Triangles, config: &Config, monitor: &Monitor) -> Result<Built> {
    interval::by_grid((scene, config, monitor), 2, |binary, bounds, leaves| {
        let tighten = (interval::tighten(config), false);
        let tree = SlabTree::new(binary, bounds, tighten, leaves)?;
        Ok(Objects::SlabBoxes(tree))
    })
}
